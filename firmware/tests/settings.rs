//! Settings in a flash that loses power at every byte and flips bits: the old ones or the new
//! ones, never anything else.

use massline_core::calibration::Preset;
use massline_core::wire::Setting;
use massline_firmware::models::flash::{Accident, Flash};
use massline_firmware::models::random::Random;
use massline_firmware::settings::{Loaded, Settings, Store, StoreError};

const INPUTS: usize = 4;
/// Small pages, so that a few saves go around.
const PAGE: usize = 1024;
const PAGES: usize = 2;
const ROOM: usize = 900;

type Pages = Flash<PAGE, PAGES>;

/// Settings that differ in all their parts.
fn settings(k: u32) -> Settings<INPUTS> {
    let mut settings = Settings::DELIVERED;
    let name = ["table", "box on the shaker", "3", "the one with the dent"];
    let name = name[k as usize % name.len()];
    settings.set(&Setting::Name(name)).unwrap();
    settings.set(&Setting::LinkBaud(115_200 + k)).unwrap();
    settings
        .set(&Setting::SampleRate(512.0 + f64::from(k)))
        .unwrap();
    for input in 0..2 + (k % 2) as u8 {
        let preset = Preset::bridge(500.0 + f64::from(k), 2e-3, 3.3);
        let input = preset.input(input, "LC-0815", "K 2026-17", None, 1e-3);
        settings.set(&Setting::Input(input)).unwrap();
    }
    settings
}

fn store(flash: Pages) -> Store<Pages> {
    Store::new(flash, 0..(PAGE * PAGES) as u32).unwrap()
}

/// A flash in which `saves` settings have been saved one after the other.
fn used(saves: u32) -> Pages {
    let mut store = store(Pages::new(saves.into()));
    for k in 0..saves {
        store.save(&settings(k), &mut [0; ROOM]).unwrap();
    }
    store.release()
}

/// Settings that were found, and the version they were written by.
type Found = Option<(Settings<INPUTS>, u16)>;

fn look(box_: &mut Store<Pages>) -> Result<Found, StoreError> {
    let mut settings = Settings::DELIVERED;
    settings.set(&Setting::Name("before")).unwrap();
    let loaded = box_.load(&mut settings, &mut [0; ROOM]);
    if !matches!(loaded, Ok(Loaded::Settings(_))) {
        assert_eq!(settings, Settings::DELIVERED);
    }
    Ok(match loaded? {
        Loaded::Settings(version) => Some((settings, version)),
        Loaded::Nothing => None,
    })
}

fn load(flash: Pages) -> Result<Found, StoreError> {
    look(&mut store(flash))
}

#[test]
fn an_empty_flash_holds_nothing() {
    assert_eq!(load(Pages::new(0)), Ok(None));
}

#[test]
fn the_last_settings_are_found() {
    for saves in 1..60 {
        let expected = Some((settings(saves - 1), 2));
        assert_eq!(load(used(saves)), Ok(expected), "{saves} saves");
    }
}

#[test]
fn power_is_cut_at_every_byte() {
    let (mut cases, mut kept_old, mut kept_new) = (0, 0, 0);
    // Where in the pages the save falls differs, and with it what is erased and copied.
    for saves in 0..14 {
        let before = used(saves);
        let old = match saves {
            0 => None,
            _ => Some((settings(saves - 1), 2)),
        };
        let new = settings(saves);
        let start = before.worked();
        for at in start.. {
            let mut flash = before.clone();
            flash.arrange(Accident::Cut(at));
            let mut box_ = store(flash);
            let saved = box_.save(&new, &mut [0; ROOM]);
            let mut flash = box_.release();
            if !flash.is_cut() {
                // All bytes were written before that.
                assert_eq!(saved, Ok(()));
                break;
            }
            assert!(saved.is_err());
            cases += 1;
            flash.switch_on();
            let mut box_ = store(flash);
            let found = look(&mut box_).unwrap();
            if found == old {
                kept_old += 1;
            } else {
                assert_eq!(found, Some((new.clone(), 2)), "cut at {at} of {start}");
                kept_new += 1;
            }
            // And the box goes on as if nothing had been.
            let next = settings(saves + 100);
            box_.save(&next, &mut [0; ROOM]).unwrap();
            assert_eq!(load(box_.release()), Ok(Some((next, 2))));
        }
    }
    println!("{cases} cuts: {kept_old} times the old settings, {kept_new} times the new ones");
    // New settings are there with the last byte, which may be cut so that nothing of it is
    // missing; the end of each save, uncut, is checked above.
    assert!(cases > 3000 && kept_old + kept_new == cases);
}

#[test]
fn power_is_cut_twice() {
    let mut random = Random::new(4);
    for round in 0..2000 {
        let saves = random.below(14) as u32 + 1;
        let flash = used(saves);
        let (old, new) = (settings(saves - 1), settings(saves));
        let at = flash.worked() + random.below(400);
        let mut allowed = vec![old];
        let mut flash = flash;
        for attempt in 0..2 {
            flash.arrange(Accident::Cut(at + attempt * random.below(400)));
            let mut box_ = store(flash);
            // The first thing a box does is to look; that may write, too, when it repairs.
            let found = look(&mut box_);
            let saved = box_.save(&new, &mut [0; ROOM]);
            flash = box_.release();
            if saved.is_ok() {
                allowed = vec![new.clone()];
            } else {
                assert!(found.is_err() || flash.is_cut());
                allowed.push(new.clone());
            }
            flash.switch_on();
        }
        let Ok(Some((found, 2))) = load(flash) else {
            panic!("round {round} lost the settings")
        };
        assert!(allowed.contains(&found), "round {round}");
    }
}

#[test]
fn a_bit_flips_at_every_byte() {
    let mut random = Random::new(9);
    for saves in 0..14 {
        let before = used(saves);
        let new = settings(saves);
        let start = before.worked();
        for at in start..start + 1600 {
            let mut flash = before.clone();
            flash.arrange(Accident::Flip(at, random.bits() as u8));
            let mut box_ = store(flash);
            // It is read back: either it is there, or the box knows that it is not.
            let saved = box_.save(&new, &mut [0; ROOM]);
            let mut flash = box_.release();
            if flash.worked() <= at {
                break;
            }
            flash.switch_on();
            match load(flash) {
                Ok(Some((found, 2))) if found == new => {}
                Ok(Some((found, 2))) => {
                    assert_eq!(found, settings(saves.wrapping_sub(1)));
                    assert!(saved.is_err());
                }
                other => assert!(saved.is_err(), "flip at {at} of {start}: {other:?}"),
            }
        }
    }
}

#[test]
fn bits_that_flip_later_never_make_garbage() {
    let mut random = Random::new(21);
    for saves in 1..14 {
        let before = used(saves);
        let all: Vec<_> = (0..saves).map(settings).collect();
        for _ in 0..1000 {
            let mut flash = before.clone();
            for _ in 0..=random.below(3) {
                let address = random.below((PAGE * PAGES) as u64) as usize;
                flash.flip(address, random.bits() as u8);
            }
            let mut box_ = store(flash);
            match look(&mut box_) {
                Ok(Some((found, 2))) => assert!(all.contains(&found)),
                Ok(Some(_)) => panic!("another version"),
                Ok(None) | Err(_) => {}
            }
            // Whatever it was, new settings can be kept.
            let next = settings(saves + 100);
            box_.save(&next, &mut [0; ROOM]).unwrap();
        }
    }
}

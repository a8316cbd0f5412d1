//! Settings in a flash with power cuts at every byte and wrong bits: the old ones or the new ones
//! are read, never anything else.

use embedded_storage::nor_flash::NorFlash;
use massline_firmware::calibration::Preset;
use massline_firmware::models::flash::{Fault, Flash, FlashError};
use massline_firmware::models::random::Random;
use massline_firmware::settings::{Loaded, Settings, Store, StoreError};
use massline_firmware::wire::{CRC32, Setting};

const INPUTS: usize = 4;
/// Small pages, which a few saves fill.
const PAGE: usize = 1024;
const PAGES: usize = 2;
const ROOM: usize = 900;

type Pages = Flash<PAGE, PAGES>;
/// Pages of a few items, so that every pair of cuts can be tried.
type Small = Flash<256, PAGES>;

/// Settings that differ in all parts for each `k`.
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
        let preset = Preset::bridge(500.0 + f64::from(k), 2e-3, 2.5).unwrap();
        let input = preset.input(input, "LC-0815", "K 2026-17", None, 1e-3);
        settings.set(&Setting::Input(input)).unwrap();
    }
    settings
}

/// Settings of three cells, of which four fit into a small page, for each `k`.
fn short(k: u32) -> Settings<INPUTS> {
    let mut settings = Settings::DELIVERED;
    settings.set(&Setting::Name("three cells")).unwrap();
    settings.set(&Setting::LinkBaud(115_200 + k)).unwrap();
    settings
        .set(&Setting::SampleRate(512.0 + f64::from(k)))
        .unwrap();
    settings
}

fn store<const PAGE: usize>(flash: Flash<PAGE, PAGES>) -> Store<Flash<PAGE, PAGES>> {
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

/// Settings that were found, and the version of their layout.
type Found = Option<(Settings<INPUTS>, u16)>;

fn found<F: NorFlash>(box_: &mut Store<F>) -> Result<Found, StoreError> {
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

fn load<const PAGE: usize>(flash: Flash<PAGE, PAGES>) -> Result<Found, StoreError> {
    let worked = flash.worked();
    let mut box_ = store(flash);
    let found = found(&mut box_);
    assert_eq!(box_.release().worked(), worked, "reading writes nothing");
    found
}

/// Saves, and returns the flash.
fn saved<const PAGE: usize>(
    flash: Flash<PAGE, PAGES>,
    settings: &Settings<INPUTS>,
) -> Flash<PAGE, PAGES> {
    let mut box_ = store(flash);
    box_.save(settings, &mut [0; ROOM]).unwrap();
    box_.release()
}

/// Saves, with the power cut `after` bytes. Returns the flash with the power on, and `true` if it
/// was cut.
fn cut<const PAGE: usize>(
    mut flash: Flash<PAGE, PAGES>,
    settings: &Settings<INPUTS>,
    after: u64,
) -> (Flash<PAGE, PAGES>, bool) {
    flash.inject(Fault::Cut(flash.worked() + after));
    let mut box_ = store(flash);
    let saved = box_.save(settings, &mut [0; ROOM]);
    let mut flash = box_.release();
    let is_cut = flash.is_cut();
    assert_eq!(saved.is_err(), is_cut, "{saved:?}");
    flash.switch_on();
    (flash, is_cut)
}

/// Settings found after power cuts. The remains of a first save are unreadable; they count as no
/// settings.
fn after_cuts(flash: &Small) -> Found {
    match load(flash.clone()) {
        Err(StoreError::Corrupted) => None,
        found => found.unwrap(),
    }
}

#[test]
fn an_empty_flash_holds_nothing() {
    assert_eq!(load(Pages::new(0)), Ok(None));
}

#[test]
fn a_range_is_two_whole_pages_of_the_flash_or_more() {
    let new = |from, to| Store::new(Small::new(0), from..to).map(|_| ());
    assert_eq!(new(0, 512), Ok(()));
    let wrong = [(0, 0), (0, 256), (0, 500), (8, 512), (256, 768), (512, 0)];
    for (from, to) in wrong {
        assert_eq!(new(from, to), Err(StoreError::Range), "{from}..{to}");
    }
}

#[test]
fn there_must_be_room() {
    let mut box_ = store(Small::new(0));
    // 26 bytes of contents lie in two cells of 16 bytes, behind that of the head.
    let name = Setting::Name("twenty bytes of name");
    let mut named = Settings::<INPUTS>::DELIVERED;
    named.set(&name).unwrap();
    assert_eq!(box_.save(&named, &mut [0; 47]), Err(StoreError::Room));
    assert_eq!(box_.save(&named, &mut []), Err(StoreError::Room));
    assert_eq!(found(&mut box_), Ok(None));
    assert_eq!(box_.save(&named, &mut [0; 48]), Ok(()));
    let mut found = Settings::<INPUTS>::DELIVERED;
    let loaded = box_.load(&mut found, &mut [0; 31]);
    assert_eq!(loaded, Err(StoreError::Room));
    let loaded = box_.load(&mut found, &mut [0; 32]);
    assert_eq!((loaded, found), (Ok(Loaded::Settings(2)), named));
    // A page must be as large, too.
    let mut box_ = store(Flash::<32, PAGES>::new(0));
    assert_eq!(
        box_.save(&settings(0), &mut [0; ROOM]),
        Err(StoreError::Room)
    );
}

/// Settings in the journal of an earlier firmware.
#[test]
fn another_journal_is_an_error_until_the_next_save() {
    let mut flash = Small::new(0);
    let earlier = [
        0x00, 0x38, 0x02, 0x2C, 0xF5, 0x3D, 0x00, 0x82, 0xE5, 0x00, 0x02, 0x00, 0x04, 0x00, 0x01,
        0x80, 0x84, 0x07, 0x32, 0x00, 0x03, 0x01, 0x02, 0x07, b'L', b'C', b'-',
    ];
    flash.write(0, &earlier).unwrap();
    assert_eq!(load(flash.clone()), Err(StoreError::Corrupted));
    let flash = saved(flash, &short(1));
    assert_eq!(load(flash), Ok(Some((short(1), 2))));
}

/// No flash lasts for 2^32 items: such a number was written by another program.
#[test]
fn after_the_last_number_comes_the_first() {
    let contents = [2, 0];
    let mut item = [
        *b"S1\x02\0",
        u32::MAX.to_le_bytes(),
        [0; 4],
        [0; 4],
        [255; 4],
    ];
    item[2] = CRC32.checksum(&contents).to_le_bytes();
    item[3] = CRC32.checksum(item[..3].as_flattened()).to_le_bytes();
    item[4][..2].copy_from_slice(&contents);
    let mut flash = Small::new(0);
    flash.write(256, item.as_flattened()).unwrap();
    assert_eq!(load(flash.clone()), Ok(Some((Settings::DELIVERED, 2))));
    for k in 0..20 {
        flash = saved(flash, &short(k));
        assert_eq!(load(flash.clone()), Ok(Some((short(k), 2))));
    }
}

/// A flash in which no item can be read to its end, and the pages that were erased in it.
struct Unreadable {
    flash: Small,
    erased: Vec<u32>,
}

impl embedded_storage::nor_flash::ErrorType for Unreadable {
    type Error = FlashError;
}

impl embedded_storage::nor_flash::ReadNorFlash for Unreadable {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.flash.read(offset, bytes)?;
        // The second cell of each item, which is behind its head.
        for (address, byte) in (offset..).zip(bytes) {
            *byte ^= u8::from(address % ITEM == CELL && *byte != 0xFF);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for Unreadable {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = 256;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.erased.push(from);
        self.flash.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.flash.write(offset, bytes)
    }
}

/// Bytes of the head of an item, and of an item of [`short`] settings.
const CELL: u32 = 16;
const ITEM: u32 = 64;

/// Where nothing can be read, which may come right later, the page that seems to hold the newest settings
/// is not erased: power may be cut before others are written.
#[test]
fn the_newest_page_is_kept_though_it_cannot_be_read() {
    // Four items fill a page: the newest lies in the first page, in the second, and in the first again.
    for (saves, newest) in [(2, 0), (6, 256), (10, 0)] {
        let mut flash = Small::new(3);
        for k in 0..saves {
            flash = saved(flash, &short(k));
        }
        let erased = Vec::new();
        let mut box_ = Store::new(Unreadable { flash, erased }, 0..512).unwrap();
        assert_eq!(found(&mut box_), Err(StoreError::Corrupted));
        let refused = box_.save(&short(99), &mut [0; ROOM]);
        assert_eq!(refused, Err(StoreError::Verify));
        let Unreadable { flash, erased } = box_.release();
        assert!(
            !erased.is_empty() && !erased.contains(&newest),
            "{erased:?}"
        );
        // Read right again, the settings are those that were saved last, or those that were tried.
        let (left, _) = load(flash).unwrap().expect("settings are left");
        assert!([short(saves - 1), short(99)].contains(&left), "{saves}");
    }
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
    // Saves at different places of the pages, with and without an erase.
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
            flash.inject(Fault::Cut(at));
            let mut box_ = store(flash);
            let saved = box_.save(&new, &mut [0; ROOM]);
            let mut flash = box_.release();
            if !flash.is_cut() {
                // All bytes had been written.
                assert_eq!(saved, Ok(()));
                break;
            }
            assert!(saved.is_err());
            cases += 1;
            flash.switch_on();
            let mut box_ = store(flash);
            let found = match found(&mut box_) {
                // The remains of the first save are unreadable.
                Err(StoreError::Corrupted) if saves == 0 => None,
                found => found.unwrap(),
            };
            if found == old {
                kept_old += 1;
            } else {
                assert_eq!(found, Some((new.clone(), 2)), "cut at {at} of {start}");
                kept_new += 1;
            }
            // The next save succeeds.
            let next = settings(saves + 100);
            box_.save(&next, &mut [0; ROOM]).unwrap();
            assert_eq!(load(box_.release()), Ok(Some((next, 2))));
        }
    }
    println!("{cases} cuts: {kept_old} times the old settings, {kept_new} times the new ones");
    // A cut at the last byte may leave it complete, and the new settings with it; complete saves
    // are checked above.
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
            flash.inject(Fault::Cut(at + attempt * random.below(400)));
            let mut box_ = store(flash);
            // A box reads the settings first.
            let found = found(&mut box_);
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

/// From every fill of the pages, every cut of one save, and then every cut of the next.
#[test]
fn power_is_cut_at_every_pair_of_bytes() {
    let mut pairs = 0;
    // Ten saves erase and fill both pages.
    for saves in 0..10 {
        let mut box_ = store(Small::new(saves.into()));
        for k in 0..saves {
            box_.save(&short(k), &mut [0; ROOM]).unwrap();
        }
        let flash = box_.release();
        let old = (saves > 0).then(|| (short(saves - 1), 2));
        assert_eq!(load(flash.clone()), Ok(old.clone()));
        let (first, second) = (short(saves), short(saves + 1));
        for one in 0.. {
            let (flash, was_cut) = cut(flash.clone(), &first, one);
            if !was_cut {
                break;
            }
            let kept = after_cuts(&flash);
            assert!(
                kept == old || kept == Some((first.clone(), 2)),
                "{saves} saves, cut at {one}: {kept:?}"
            );
            for two in 0.. {
                let (flash, was_cut) = cut(flash.clone(), &second, two);
                let found = after_cuts(&flash);
                let at = || format!("{saves} saves, cut at {one}, then at {two}: {found:?}");
                if !was_cut {
                    assert_eq!(found, Some((second.clone(), 2)), "{}", at());
                    break;
                }
                assert!(
                    found == kept || found == Some((second.clone(), 2)),
                    "{}",
                    at()
                );
                pairs += 1;
            }
        }
    }
    println!("{pairs} pairs of cuts");
    assert!(pairs > 100_000);
}

/// Found by fuzzing: a cleared bit anywhere in a page that seems erased. Settings saved since are
/// found after any cut.
#[test]
fn power_is_cut_over_a_page_that_only_seems_erased() {
    for address in (0..512).step_by(3) {
        let mut flash = Small::new(address.into());
        for k in 0..16 {
            // Bits not cleared by the store: of an interrupted erase, or of another program.
            flash.write(address, &[0x5A]).unwrap();
            flash = saved(flash, &short(k));
            for after in 0.. {
                let (flash, was_cut) = cut(flash.clone(), &short(k + 100), after);
                let found = load(flash).unwrap().map(|(settings, _)| settings);
                let expected = if was_cut { k } else { k + 100 };
                assert!(
                    found == Some(short(k + 100)) || found == Some(short(expected)),
                    "a bit at {address}, {k} saves, cut at {after}: {found:?}"
                );
                if !was_cut {
                    break;
                }
            }
        }
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
            flash.inject(Fault::Flip(at, random.bits() as u8));
            let mut box_ = store(flash);
            // The item is read back, and written elsewhere if it is wrong.
            assert_eq!(box_.save(&new, &mut [0; ROOM]), Ok(()));
            let mut flash = box_.release();
            if flash.worked() <= at {
                break;
            }
            flash.switch_on();
            let found = load(flash);
            let expected = Ok(Some((new.clone(), 2)));
            assert_eq!(found, expected, "flip at {at} of {start}");
        }
    }
}

/// With a worn byte in every page, the last settings that could be saved remain.
#[test]
fn a_worn_page_loses_no_saved_settings() {
    let mut refused = 0;
    for address in (0..512).step_by(8) {
        let mut flash = Small::new(9);
        let mut kept = None;
        for k in 0..20 {
            flash.inject(Fault::Worn(address));
            let mut box_ = store(flash);
            match box_.save(&short(k), &mut [0; ROOM]) {
                Ok(()) => kept = Some((short(k), 2)),
                Err(error) => {
                    assert_eq!(error, StoreError::Verify);
                    refused += 1;
                }
            }
            flash = box_.release();
            assert_eq!(load(flash.clone()), Ok(kept.clone()), "{address}, {k}");
        }
    }
    assert!(refused > 0);
}

/// A bit whose change was interrupted may read right only later. Settings saved since remain valid.
#[test]
fn a_bit_that_comes_right_later_brings_no_old_settings_back() {
    let mut flash = saved(Small::new(0), &short(0));
    let from = flash.worked() as usize - 256;
    flash = saved(flash, &short(1));
    let to = flash.worked() as usize - 256;
    // The head is written before the contents, whose last byte may have such a bit.
    for address in from + 16..to {
        let mut flash = flash.clone();
        flash.flip(address, 3);
        // The filling behind the contents is not checked.
        let before = load(flash.clone()).unwrap().unwrap().0;
        flash = saved(flash, &short(2));
        flash.flip(address, 3);
        assert_eq!(load(flash), Ok(Some((short(2), 2))), "{address}");
        assert!(before == short(0) || address + 16 > to);
    }
    // A head without contents, whose last byte reads right later: the next item lies in place of
    // the contents.
    let (mut flash, _) = cut(flash, &short(3), 16);
    flash.flip(to + 15, 3);
    flash = saved(flash, &short(4));
    flash.flip(to + 15, 3);
    assert_eq!(load(flash), Ok(Some((short(4), 2))));
}

#[test]
fn the_next_item_lies_behind_an_interrupted_one() {
    let flash = saved(Small::new(0), &short(0));
    let (flash, _) = cut(flash, &short(1), 20);
    let worked = flash.worked();
    assert_eq!(saved(flash, &short(2)).worked() - worked, 64);
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
            match found(&mut box_) {
                Ok(Some((found, 2))) => assert!(all.contains(&found)),
                Ok(Some(_)) => panic!("another version"),
                Ok(None) | Err(_) => {}
            }
            // New settings can be saved in any case.
            let next = settings(saves + 100);
            box_.save(&next, &mut [0; ROOM]).unwrap();
        }
    }
}

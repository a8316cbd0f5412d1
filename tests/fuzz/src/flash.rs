//! The box's settings in flash: their bytes, and the pages that hold them.
//!
//! The first byte chooses between the bytes of one layout and operations on two pages of flash.

use crate::script::{Bytes, steps};
use embedded_storage::nor_flash::NorFlash;
use massline_firmware::models::flash::{Fault, Flash};
use massline_firmware::settings::layout::{self, LayoutError};
use massline_firmware::settings::{LINK_BAUD_RANGE, Loaded, Settings, Store, StoreError};
use massline_firmware::wire::{Request, SettingKey};

const INPUTS: usize = 4;
const PAGE: usize = 1024;
const PAGES: usize = 2;
const ROOM: usize = 900;

type Pages = Flash<PAGE, PAGES>;

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    if bytes.u8() & 1 == 0 {
        layout(bytes.0);
    } else {
        pages(bytes.0);
    }
}

/// Tests bytes with a right checksum.
fn layout(bytes: &[u8]) {
    let mut settings = Settings::<INPUTS>::DELIVERED;
    match layout::read(bytes, &mut settings) {
        Ok(version) => {
            assert!(version <= layout::VERSION);
            sound(&settings);
            let mut room = [0; layout::room(INPUTS)];
            let length = layout::write(&settings, &mut room).expect("there is room for any");
            let mut again = Settings::DELIVERED;
            let read = layout::read(&room[..length], &mut again);
            assert_eq!((read, &again), (Ok(layout::VERSION), &settings));
        }
        Err(error) => {
            assert_eq!(settings, Settings::DELIVERED);
            if let LayoutError::Newer { found } = error {
                assert!(found > layout::VERSION);
            }
        }
    }
}

/// Asserts the limits of all settings.
fn sound(settings: &Settings<INPUTS>) {
    assert!((LINK_BAUD_RANGE[0]..=LINK_BAUD_RANGE[1]).contains(&settings.link_baud()));
    let rate = settings.sample_rate();
    assert!((256.0..=32_768.0).contains(&rate), "{rate}");
    for (number, certificate) in (0..).zip(settings.inputs()) {
        let reading = certificate.scale().count(8_388_607);
        assert!(reading.is_finite(), "{certificate:?}");
        assert!(settings.get(SettingKey::Input(number)).is_ok());
    }
}

/// Tests two pages, which a script fills, damages and cuts the power of. Settings saved without a
/// fault are found, whatever was in the pages; settings remain after power cuts.
fn pages(script: &[u8]) {
    let mut flash = Pages::new(1);
    let mut settings = Settings::<INPUTS>::DELIVERED;
    // One of these must be found as long as there are only power cuts.
    let mut kept = vec![None];
    for (step, mut bytes) in steps(script).take(40) {
        match step % 8 {
            // Any bytes at any address, as far as bits can be cleared.
            0 => {
                let at = usize::from(bytes.u16()) % (PAGE * PAGES);
                let bytes = bytes.slice(PAGE * PAGES - at);
                let written = flash.write(at as u32, bytes);
                written.expect("the power is on and the place is there");
                kept.clear();
            }
            1 => {
                flash.flip(bytes.u16().into(), bytes.u8());
                kept.clear();
            }
            // A setting from the link.
            2..=4 => {
                let before = settings.clone();
                let mut outcome = None;
                crate::link::request(0x51, bytes.0, |request| {
                    if let Request::WriteSetting(setting) = request {
                        outcome = Some(settings.set(setting));
                    }
                });
                if !matches!(outcome, Some(Ok(()))) {
                    assert_eq!(settings, before);
                }
                sound(&settings);
            }
            5 => settings = Settings::DELIVERED,
            // A save with a fault.
            6 => {
                let at = flash.worked() + u64::from(bytes.u16());
                let flip = bytes.u8();
                flash.inject(match flip {
                    0 => Fault::Cut(at),
                    bit => Fault::Flip(at, bit),
                });
                let mut store = open(flash);
                let saved = store.save(&settings, &mut [0; ROOM]);
                flash = store.release();
                flash.switch_on();
                // A wrong byte is one of the written ones, and is detected.
                if saved.is_ok() {
                    kept = vec![Some(settings.clone())];
                } else if !kept.is_empty() {
                    kept.push(Some(settings.clone()));
                }
            }
            // A save.
            _ => {
                flash = save(flash, &settings);
                kept = vec![Some(settings.clone())];
            }
        }
        flash = look(flash, &kept);
    }
    save(flash, &settings);
}

fn open(flash: Pages) -> Store<Pages> {
    Store::new(flash, 0..(PAGE * PAGES) as u32).expect("these are whole pages")
}

/// Saves settings, and asserts that they are found.
fn save(flash: Pages, settings: &Settings<INPUTS>) -> Pages {
    let mut store = open(flash);
    assert_eq!(store.save(settings, &mut [0; ROOM]), Ok(()));
    let mut found = Settings::DELIVERED;
    let loaded = store.load(&mut found, &mut [0; ROOM]);
    assert_eq!(loaded, Ok(Loaded::Settings(layout::VERSION)));
    assert_eq!(&found, settings);
    store.release()
}

/// Loads settings; asserts that they are one of `kept`, unless that is empty.
fn look(flash: Pages, kept: &[Option<Settings<INPUTS>>]) -> Pages {
    let mut store = open(flash);
    let mut found = Settings::DELIVERED;
    let loaded = store.load(&mut found, &mut [0; ROOM]);
    sound(&found);
    if !matches!(loaded, Ok(Loaded::Settings(_))) {
        assert_eq!(found, Settings::DELIVERED);
    }
    if let Err(error) = loaded {
        assert!(!error.to_string().is_empty());
    }
    if !kept.is_empty() {
        let found = match loaded {
            Ok(Loaded::Settings(_)) => Some(found),
            // The remains of a first save are unreadable.
            Ok(Loaded::Nothing) | Err(StoreError::Corrupted) => None,
            Err(error) => panic!("{error}"),
        };
        assert!(kept.contains(&found), "{found:?} was not saved last");
    }
    store.release()
}

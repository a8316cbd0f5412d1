//! Settings as bytes.
//!
//! Two bytes hold the version of the layout. Then come the settings that are not as delivered, each
//! behind two bytes of its length, so that an unknown setting is skipped. Checksums are in
//! `journal`.
//!
//! | version | a setting is | read as |
//! | --- | --- | --- |
//! | 1 | [`Setting`], with inputs without certificate and uncertainty | certificate empty, uncertainty zero |
//! | 2 | [`Setting`], as it goes over the wire | itself |
//!
//! A new version gets its own line here, a name for the old one's type, and a line in [`read`].

use super::Settings;
use crate::wire::{Circuit, Date, Input, Setting};
use serde::{Deserialize, Serialize};

/// Version of the layout that is written.
pub const VERSION: u16 = 2;

/// Most bytes of one setting: an input with all its texts, integers at their longest.
const SETTING_MAX: usize = 2 + 160;

/// Most bytes of the settings of a box with that many inputs.
#[must_use]
pub const fn room(inputs: usize) -> usize {
    2 + (3 + inputs) * SETTING_MAX
}

/// Error of bytes that are no settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayoutError {
    /// The bytes were written by a later firmware.
    Newer {
        /// Version of their layout.
        found: u16,
    },
    /// The bytes are cut short, or of an unknown form.
    Malformed,
}

/// Writes all settings and returns the number of bytes; `None` if there is no room.
#[must_use]
pub fn write<const INPUTS: usize>(settings: &Settings<INPUTS>, bytes: &mut [u8]) -> Option<usize> {
    let whole = bytes.len();
    let (head, mut rest) = bytes.split_first_chunk_mut()?;
    *head = VERSION.to_le_bytes();
    for setting in settings.changed() {
        let (head, body) = rest.split_first_chunk_mut()?;
        let length = postcard::to_slice(&setting, body).ok()?.len();
        *head = u16::try_from(length).ok()?.to_le_bytes();
        rest = body.get_mut(length..)?;
    }
    whole.checked_sub(rest.len())
}

/// Sets all settings, those missing from the bytes as delivered, and returns the version of the
/// layout.
///
/// # Errors
///
/// [`LayoutError`]; the settings are as delivered then. A single setting that is unknown or not
/// valid is left as delivered.
pub fn read<const INPUTS: usize>(
    bytes: &[u8],
    settings: &mut Settings<INPUTS>,
) -> Result<u16, LayoutError> {
    settings.deliver();
    let version = read_changed(bytes, settings);
    if version.is_err() {
        settings.deliver();
    }
    version
}

fn read_changed<const INPUTS: usize>(
    bytes: &[u8],
    settings: &mut Settings<INPUTS>,
) -> Result<u16, LayoutError> {
    let (head, mut rest) = bytes.split_first_chunk().ok_or(LayoutError::Malformed)?;
    let version = u16::from_le_bytes(*head);
    if version > VERSION {
        return Err(LayoutError::Newer { found: version });
    }
    while !rest.is_empty() {
        let (head, body) = rest.split_first_chunk().ok_or(LayoutError::Malformed)?;
        let length = usize::from(u16::from_le_bytes(*head));
        let (one, behind) = body
            .split_at_checked(length)
            .ok_or(LayoutError::Malformed)?;
        rest = behind;
        let setting = match version {
            1 => postcard::from_bytes::<First>(one).map(Setting::from),
            2 => postcard::from_bytes::<Setting>(one),
            _ => return Err(LayoutError::Malformed),
        };
        if let Ok(setting) = setting {
            // A setting beyond limits that have become narrower must not lose the others.
            let _ = settings.set(&setting);
        }
    }
    Ok(version)
}

/// A setting of version 1.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum First<'a> {
    Name(&'a str),
    LinkBaud(u32),
    SampleRate(f64),
    Input(#[serde(borrow)] FirstInput<'a>),
}

/// An input of version 1.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct FirstInput<'a> {
    input: u8,
    circuit: Circuit,
    serial: &'a str,
    calibrated: Option<Date>,
    per_count: f64,
    offset: f64,
    gain: u8,
    limits: [i32; 2],
}

impl<'a> From<First<'a>> for Setting<'a> {
    fn from(first: First<'a>) -> Self {
        match first {
            First::Name(name) => Self::Name(name),
            First::LinkBaud(baud) => Self::LinkBaud(baud),
            First::SampleRate(rate) => Self::SampleRate(rate),
            First::Input(old) => Self::Input(Input {
                input: old.input,
                circuit: old.circuit,
                serial: old.serial,
                certificate: "",
                calibrated: old.calibrated,
                per_count: old.per_count,
                offset: old.offset,
                uncertainty: 0.0,
                gain: old.gain,
                limits: old.limits,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::SettingKey;

    fn found<const N: usize>(bytes: &[u8]) -> Result<(Settings<N>, u16), LayoutError> {
        // Settings from before must not remain.
        let mut settings = Settings::DELIVERED;
        settings.set(&Setting::Name("before")).unwrap();
        let version = read(bytes, &mut settings);
        if version.is_err() {
            assert_eq!(settings, Settings::DELIVERED);
        }
        Ok((settings, version?))
    }

    /// An input whose every part takes as many bytes as it can.
    fn longest(input: u8) -> Input<'static> {
        const TEXT: &str = "01234567890123456789012345678901";
        Input {
            input,
            circuit: Circuit::Digital,
            serial: TEXT,
            certificate: TEXT,
            calibrated: Some(Date {
                year: 65_535,
                month: 12,
                day: 31,
            }),
            per_count: 1.0 / 3.0,
            offset: -1.0 / 3.0,
            uncertainty: 1.0 / 3.0,
            gain: 128,
            limits: [-8_388_608, 8_388_607],
        }
    }

    fn full() -> Settings<32> {
        let mut settings = Settings::DELIVERED;
        settings.set(&Setting::Name(longest(0).serial)).unwrap();
        settings.set(&Setting::LinkBaud(2_000_000)).unwrap();
        settings.set(&Setting::SampleRate(4096.0)).unwrap();
        for k in 0..32 {
            settings.set(&Setting::Input(longest(k))).unwrap();
        }
        settings
    }

    #[test]
    fn the_largest_settings_have_room_and_come_back() {
        let mut bytes = [0; room(32)];
        let length = write(&full(), &mut bytes).unwrap();
        assert_eq!(found(&bytes[..length]), Ok((full(), VERSION)));
        assert_eq!(write(&full(), &mut bytes[..length - 1]), None);
        let delivered = Settings::<32>::DELIVERED;
        assert_eq!(write(&delivered, &mut bytes), Some(2));
        assert_eq!(found(&bytes[..2]), Ok((delivered, VERSION)));
    }

    #[test]
    fn version_1_is_read() {
        let mut bytes = [0; 400];
        let (head, mut rest) = bytes.split_first_chunk_mut().unwrap();
        *head = 1_u16.to_le_bytes();
        let new = longest(5);
        let old = FirstInput {
            input: 5,
            circuit: new.circuit,
            serial: new.serial,
            calibrated: new.calibrated,
            per_count: new.per_count,
            offset: new.offset,
            gain: new.gain,
            limits: new.limits,
        };
        let mut length = 2;
        for first in [
            First::Name("old box"),
            First::LinkBaud(115_200),
            First::SampleRate(1024.0),
            First::Input(old),
        ] {
            let (head, body) = rest.split_first_chunk_mut().unwrap();
            let used = postcard::to_slice(&first, body).unwrap().len();
            *head = (used as u16).to_le_bytes();
            rest = &mut body[used..];
            length += 2 + used;
        }
        let (settings, version) = found::<32>(&bytes[..length]).unwrap();
        assert_eq!(version, 1);
        assert_eq!(settings.get(SettingKey::Name), Ok(Setting::Name("old box")));
        assert_eq!(settings.link_baud(), 115_200);
        assert_eq!(settings.sample_rate(), 1024.0);
        let expected = Input {
            certificate: "",
            uncertainty: 0.0,
            ..new
        };
        assert_eq!(
            settings.get(SettingKey::Input(5)),
            Ok(Setting::Input(expected))
        );
    }

    #[test]
    fn later_versions_and_unknown_settings() {
        let newer = LayoutError::Newer { found: 3 };
        assert_eq!(found::<4>(&[3, 0, 1, 2, 3]), Err(newer));
        // A setting number 9 of three bytes, then a link's rate.
        let mut bytes = [0; 64];
        let mut settings = Settings::<4>::DELIVERED;
        settings.set(&Setting::LinkBaud(115_200)).unwrap();
        let length = write(&settings, &mut bytes).unwrap();
        bytes.copy_within(2..length, 7);
        bytes[2..7].copy_from_slice(&[3, 0, 9, 1, 1]);
        assert_eq!(found(&bytes[..length + 5]), Ok((settings, VERSION)));
    }

    #[test]
    fn any_bytes_are_settings_or_an_error() {
        let mut random = crate::models::random::Random::new(1);
        for _ in 0..20_000 {
            let mut bytes = [0; 200];
            bytes.iter_mut().for_each(|b| *b = random.bits() as u8);
            bytes[..2].copy_from_slice(&(random.below(4) as u16).to_le_bytes());
            bytes[3] = 0;
            let length = random.below(200) as usize;
            if let Ok((settings, _)) = found::<4>(&bytes[..length]) {
                assert!(settings.changed().count() <= 7);
            }
        }
    }
}

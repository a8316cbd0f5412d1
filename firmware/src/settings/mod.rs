//! Settings of the box: its name, the link's rate, the sample rate, and the calibration of each
//! input.
//!
//! | file | holds |
//! | --- | --- |
//! | [`layout`] | settings as bytes, by version |
//! | `journal` | items of bytes in pages of flash, which survive power cuts |
//! | [`store`] | settings in flash |

mod journal;
pub mod layout;
pub mod store;

pub use store::{Loaded, Store, StoreError};

use crate::calibration::{Certificate, Text};
use crate::wire::{Field, Input, Item, NAME_MAX, Problem, Setting, SettingKey};

/// Rate of the link as delivered, baud.
pub const LINK_BAUD: u32 = 921_600;
/// Lowest and highest rate of the link, baud: below, a frame takes seconds; above, adapters are
/// rare. If the running clock cannot generate a rate, the box uses [`LINK_BAUD`].
pub const LINK_BAUD_RANGE: [u32; 2] = [9_600, 2_000_000];
/// Sample rate as delivered, Hz.
pub const SAMPLE_RATE: f64 = 512.0;
/// Lowest and highest sample rate, Hz, to which the converters' clock can be divided.
pub const SAMPLE_RATE_RANGE: [f64; 2] = [256.0, 32_768.0];

/// All settings of a box with that many inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings<const INPUTS: usize> {
    name: Text,
    link_baud: u32,
    sample_rate: f64,
    inputs: [Certificate; INPUTS],
}

impl<const INPUTS: usize> Settings<INPUTS> {
    /// Settings as delivered: no name, no calibration.
    pub const DELIVERED: Self = Self {
        name: Text::new(),
        link_baud: LINK_BAUD,
        sample_rate: SAMPLE_RATE,
        inputs: [const { Certificate::UNUSED }; INPUTS],
    };

    /// Sets all settings to those that a box is delivered with.
    // Apart: each copy of them takes 4 KB of flash.
    #[inline(never)]
    pub fn deliver(&mut self) {
        *self = Self::DELIVERED;
    }

    /// Rate of the link, baud.
    #[must_use]
    pub const fn link_baud(&self) -> u32 {
        self.link_baud
    }

    /// Sample rate of the converters, Hz.
    #[must_use]
    pub const fn sample_rate(&self) -> f64 {
        self.sample_rate
    }

    /// The inputs' calibrations.
    #[must_use]
    pub const fn inputs(&self) -> &[Certificate; INPUTS] {
        &self.inputs
    }

    /// One setting.
    ///
    /// # Errors
    ///
    /// [`Problem::Index`] if there is no such input.
    pub fn get(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        Ok(match key {
            SettingKey::Name => Setting::Name(&self.name),
            SettingKey::LinkBaud => Setting::LinkBaud(self.link_baud),
            SettingKey::SampleRate => Setting::SampleRate(self.sample_rate),
            SettingKey::Input(number) => {
                let input = self.inputs.get(usize::from(number));
                Setting::Input(input.ok_or(no_input::<INPUTS>(number))?.input(number))
            }
        })
    }

    /// Changes one setting.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the value at fault; nothing is changed then.
    pub fn set(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        match *setting {
            Setting::Name(name) => {
                self.name = Text::try_from(name)
                    .map_err(|_| Problem::capacity(Item::Byte, name.len(), NAME_MAX))?;
            }
            Setting::LinkBaud(baud) => {
                let range = LINK_BAUD_RANGE.map(f64::from);
                check(Field::LinkBaud, baud.into(), range)?;
                self.link_baud = baud;
            }
            Setting::SampleRate(rate) => {
                check(Field::SampleRate, rate, SAMPLE_RATE_RANGE)?;
                self.sample_rate = rate;
            }
            Setting::Input(ref input) => {
                let place = self.inputs.get_mut(usize::from(input.input));
                *place.ok_or(no_input::<INPUTS>(input.input))? = Certificate::new(input)?;
            }
        }
        Ok(())
    }

    /// All settings that are not as delivered.
    pub fn changed(&self) -> impl Iterator<Item = Setting<'_>> {
        // Not compared with `DELIVERED`, whose 4 KB would lie on the small stack.
        let name = (!self.name.is_empty()).then_some(Setting::Name(&self.name));
        let baud = self.link_baud != LINK_BAUD;
        let rate = self.sample_rate != SAMPLE_RATE;
        let inputs = (0_u8..).zip(&self.inputs);
        name.into_iter()
            .chain(baud.then_some(Setting::LinkBaud(self.link_baud)))
            .chain(rate.then_some(Setting::SampleRate(self.sample_rate)))
            .chain(inputs.filter_map(|(k, input)| {
                let input: Input<'_> = input.input(k);
                (input != Certificate::UNUSED.input(k)).then_some(Setting::Input(input))
            }))
    }
}

fn no_input<const INPUTS: usize>(number: u8) -> Problem {
    Problem::index(Item::Input, number.into(), INPUTS)
}

fn check(field: Field, found: f64, [low, high]: [f64; 2]) -> Result<(), Problem> {
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(Problem::range(field, 0, found, [low, high]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Preset;

    #[test]
    fn settings_are_read_as_set() {
        let mut settings = Settings::<4>::DELIVERED;
        let preset = Preset::bridge(500.0, 2e-3, 2.5).unwrap();
        let all = [
            (SettingKey::Name, Setting::Name("table 2")),
            (SettingKey::LinkBaud, Setting::LinkBaud(115_200)),
            (SettingKey::SampleRate, Setting::SampleRate(4096.0)),
            (
                SettingKey::Input(3),
                Setting::Input(preset.input(3, "LC-1", "K 17", None, 1e-3)),
            ),
        ];
        for (key, setting) in &all {
            settings.set(setting).unwrap();
            assert_eq!(settings.get(*key).as_ref(), Ok(setting));
        }
        assert!(settings.changed().eq(all.map(|(_, setting)| setting)));
        assert_eq!(Settings::<4>::DELIVERED.changed().count(), 0);
    }

    #[test]
    fn invalid_settings_are_refused_and_change_nothing() {
        let mut settings = Settings::<4>::DELIVERED;
        let preset = Preset::bridge(500.0, 2e-3, 2.5).unwrap();
        let input = preset.input(4, "", "", None, 0.0);
        for setting in [
            Setting::Name("a name that is much longer than any box should have"),
            Setting::LinkBaud(300),
            Setting::LinkBaud(u32::MAX),
            Setting::SampleRate(f64::NAN),
            Setting::SampleRate(1e6),
            Setting::Input(input),
            Setting::Input(Input {
                input: 0,
                per_count: 0.0,
                ..input
            }),
        ] {
            assert!(settings.set(&setting).is_err(), "{setting:?}");
            assert_eq!(settings, Settings::DELIVERED);
        }
        let index = Problem::index(Item::Input, 4, 4);
        assert_eq!(settings.get(SettingKey::Input(4)), Err(index));
    }
}

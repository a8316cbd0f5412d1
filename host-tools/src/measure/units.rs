//! Units that the recordings of several runs state for one channel, held against each other.
//!
//! A channel whose unit the setup states has that unit in every run. Where the setup leaves it to
//! the recordings, a recording without a unit counts as SI: beside one that says `g` that would be
//! one run in another unit than the others, and a wrong answer without a word.

use super::MeasureError;
use super::unlisted::unlisted;
use crate::printable::quoted;
use crate::recording::{Place, Recording, RecordingError, some_of};
use crate::setup::{Excitation, Run, Setup, UnitsOfTwo};
use std::collections::HashMap;
use std::path::PathBuf;

/// A unit, or none, and the first file that has it.
type Source = (Option<String>, PathBuf);

/// Notes on the runs that were read so far.
#[derive(Debug, Default)]
pub(super) struct Noticed {
    /// Warnings to the user.
    pub(super) warnings: Vec<String>,
    /// The units of each channel.
    units: UnitsOfRuns,
    /// Channels that look like load cells and have no entry in the setup.
    pub(super) unlisted: Vec<String>,
}

/// The units of each channel in the runs that were read so far.
#[derive(Debug, Default)]
pub(super) struct UnitsOfRuns(HashMap<String, Vec<Source>>);

/// Units of the sensors that a recording states.
#[derive(Default)]
pub(super) struct StatedUnits {
    file: PathBuf,
    place: Option<Place>,
    /// In the order of the setup's sensor channels.
    units: Vec<Option<String>>,
    unlisted: Vec<String>,
}

impl StatedUnits {
    pub(super) fn of(setup: &Setup, run: &Run, recording: &Recording) -> Self {
        let unit = |channel: &str| match run.excitation {
            Excitation::Sine => recording.unit(&format!("{channel}.re")),
            _ => recording.unit(channel),
        };
        let channels = setup.sensor_channels();
        Self {
            file: recording.file().to_owned(),
            place: recording.units_at(),
            units: channels.map(|c| unit(c).map(str::to_owned)).collect(),
            unlisted: unlisted(setup, run, recording),
        }
    }
}

impl Noticed {
    /// Notes what a recording's header says, before its first sample is read.
    ///
    /// # Errors
    /// As [`UnitsOfRuns::add`].
    pub(super) fn notice(
        &mut self,
        setup: &Setup,
        run: &Run,
        recording: &Recording,
    ) -> Result<(), MeasureError> {
        self.notice_units(setup, &StatedUnits::of(setup, run, recording))
    }

    /// The same of what it has said.
    ///
    /// # Errors
    /// As [`UnitsOfRuns::add`].
    pub(super) fn notice_units(
        &mut self,
        setup: &Setup,
        stated: &StatedUnits,
    ) -> Result<(), MeasureError> {
        for name in &stated.unlisted {
            if !self.unlisted.contains(name) {
                self.unlisted.push(name.clone());
            }
        }
        self.units.add(setup, stated, &mut self.warnings)
    }

    /// `true` if a recording states the unit of a sensor.
    pub(super) fn states_units(&self) -> bool {
        let mut sources = self.units.0.values().flatten();
        sources.any(|(unit, _)| unit.is_some())
    }
}

impl UnitsOfRuns {
    /// Holds the units of a run's recording against those of the runs before it. Where one of two
    /// recordings is silent and the numbers are the same, a warning says what is assumed.
    ///
    /// # Errors
    /// The channel, both files and the remedy, where the runs would be in different units.
    fn add(
        &mut self,
        setup: &Setup,
        stated: &StatedUnits,
        warnings: &mut Vec<String>,
    ) -> Result<(), MeasureError> {
        let file = &stated.file;
        let mut assumed: Vec<(String, String)> = Vec::new();
        for (channel, found) in setup.sensor_channels().zip(&stated.units) {
            let found = found.as_deref();
            let known = self.0.entry(channel.to_owned()).or_default();
            for (other, first) in known.iter() {
                let first = first.display();
                let says = |unit: Option<&str>| match unit {
                    Some(unit) => format!("says [{}]", quoted(unit)),
                    None => "states no unit".to_owned(),
                };
                let both = format!(
                    "this recording {}, and {first} {}",
                    says(found),
                    says(other.as_deref())
                );
                let reason = match setup.units_of_two(channel, [found, other.as_deref()]) {
                    UnitsOfTwo::Alike => continue,
                    UnitsOfTwo::Assumed => {
                        assumed.push((channel.to_owned(), both));
                        continue;
                    }
                    UnitsOfTwo::Other => format!(
                        "{both}; a channel has one unit in all runs: correct the header that is wrong, or export both recordings alike"
                    ),
                    UnitsOfTwo::Missing { unit, list, si } => format!(
                        "{both}, so that one run would count as {unit} and the other as {si}; if both are in {unit}, write `unit = \"{unit}\"` into the [[{list}]] of the setup, which then holds for recordings without a unit; else write the unit into the header"
                    ),
                };
                let error = RecordingError::Unit {
                    file: file.clone(),
                    place: stated.place,
                    channel: channel.to_owned(),
                    reason,
                };
                return Err(error.into());
            }
            let found = found.map(str::to_owned);
            if known.iter().all(|(unit, _)| *unit != found) {
                known.push((found, file.clone()));
            }
        }
        if let Some((_, both)) = assumed.first() {
            warnings.push(format!(
                "{}, channels {}: {both}; both are taken to be in the same unit",
                file.display(),
                some_of(assumed.iter().map(|(channel, _)| channel))
            ));
        }
        Ok(())
    }
}

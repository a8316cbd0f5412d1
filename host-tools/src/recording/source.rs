//! The trait behind which every format of recordings lies.

use super::{Preamble, RecordingError};
use massline_firmware::wire::Health;
use std::fmt;

/// A channel as its file describes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channel {
    /// Name, unique within the file.
    pub name: String,
    /// Unit of the readings, where the file states it.
    pub unit: Option<String>,
    /// Positive direction as a unit vector, where the file states it.
    pub direction: Option<[f64; 3]>,
}

/// A place in a file, counted from one in lines, records and samples and from zero in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of text.
    Line(u64),
    /// A record of a file that is made of records.
    Record(u64),
    /// A sample of a file that has its channels one after the other.
    Sample(u64),
    /// A byte of a file that has no larger unit.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Record(n) => write!(f, "record {n}"),
            Self::Sample(n) => write!(f, "sample {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
        }
    }
}

/// A sample rate that a file states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedRate {
    /// Samples per second.
    pub value: f64,
    /// The part of the file that states it, for messages: `its preamble`.
    pub place: &'static str,
}

/// Samples that were read together, in memory that does not grow with the file.
#[derive(Debug, Default)]
pub struct Block {
    width: usize,
    most: usize,
    /// Sample by sample, [`Block::width`] readings each.
    readings: Vec<f64>,
    samples: Vec<(Place, Health)>,
    /// `true` if one of them has faults.
    faulty: bool,
}

impl Block {
    /// Empties the block for at most `most` samples of `width` readings.
    pub(super) fn begin(&mut self, width: usize, most: usize) {
        self.width = width;
        self.most = most;
        self.readings.clear();
        self.samples.clear();
        self.faulty = false;
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// `true` if there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Samples that there is room for.
    #[must_use]
    pub fn room(&self) -> usize {
        self.most - self.samples.len()
    }

    /// Adds a sample with its place in the file and its faults. `reading` is asked for each
    /// channel by its position in the selection; where it fails nothing is added.
    ///
    /// # Errors
    /// The error of `reading`.
    pub fn push(
        &mut self,
        place: Place,
        health: Health,
        mut reading: impl FnMut(usize) -> Result<f64, RecordingError>,
    ) -> Result<(), RecordingError> {
        let before = self.readings.len();
        for k in 0..self.width {
            match reading(k) {
                Ok(value) => self.readings.push(value),
                Err(error) => {
                    self.readings.truncate(before);
                    return Err(error);
                }
            }
        }
        self.samples.push((place, health));
        self.faulty |= !health.is_good();
        Ok(())
    }

    /// Adds a sample whose readings `fill` writes all at once, with the place and the faults that it
    /// gives; where it gives none nothing is added. `true` if a sample was added.
    pub(super) fn fill(
        &mut self,
        fill: impl FnOnce(&mut [f64]) -> Option<(Place, Health)>,
    ) -> bool {
        let before = self.readings.len();
        self.readings.resize(before + self.width, 0.0);
        let sample = self.readings.get_mut(before..).and_then(fill);
        if sample.is_none() {
            self.readings.truncate(before);
        }
        self.samples.extend(sample);
        self.faulty |= sample.is_some_and(|(_, health)| !health.is_good());
        sample.is_some()
    }

    /// Adds samples without faults with their places. `columns` are the readings of each channel of the
    /// selection, as many at least.
    pub(super) fn extend(
        &mut self,
        count: usize,
        place: impl Fn(usize) -> Place,
        columns: &[&[f64]],
    ) {
        let before = self.readings.len();
        self.readings.resize(before + count * self.width, f64::NAN);
        let added = self.readings.get_mut(before..).unwrap_or_default();
        let width = self.width.max(1);
        let (fours, rest) = columns.as_chunks::<4>();
        // Four at a time, so that each sample is written in few passes.
        for (at, [a, b, c, d]) in (0..).step_by(4).zip(fours) {
            let readings = a.iter().zip(*b).zip(c.iter().zip(*d));
            for (sample, ((a, b), (c, d))) in added.chunks_exact_mut(width).zip(readings) {
                if let Some(slots) = sample.get_mut(at..at + 4) {
                    slots.copy_from_slice(&[*a, *b, *c, *d]);
                }
            }
        }
        for (at, readings) in (4 * fours.len()..).zip(rest) {
            for (sample, reading) in added.chunks_exact_mut(width).zip(*readings) {
                if let Some(slot) = sample.get_mut(at) {
                    *slot = *reading;
                }
            }
        }
        let places = (0..count).map(|n| (place(n), Health::GOOD));
        self.samples.extend(places);
    }

    /// `true` if a sample has faults.
    pub(super) fn is_faulty(&self) -> bool {
        self.faulty
    }

    /// Readings from a sample on, sample by sample.
    pub(super) fn readings(&self, from: usize) -> &[f64] {
        self.readings.get(from * self.width..).unwrap_or(&[])
    }

    /// Readings, place and faults of a sample.
    pub(super) fn sample(&self, n: usize) -> Option<(&[f64], Place, Health)> {
        let (place, health) = *self.samples.get(n)?;
        let readings = self.readings.get(n * self.width..(n + 1) * self.width)?;
        Some((readings, place, health))
    }
}

/// A recording in some format, read once from its beginning to its end.
///
/// A source knows its file's form and nothing of what the samples are used for: looking for
/// channels, the sample rate, time, and the notes to the user are the same for all formats and
/// lie in [`super::Recording`].
pub trait Source {
    /// All channels of the file, in its order; a column of time is one of them.
    fn channels(&self) -> &[Channel];

    /// Place of the channels' names, for messages about them.
    fn names_at(&self) -> Option<Place> {
        None
    }

    /// Place of the channels' units, for messages about them.
    fn units_at(&self) -> Option<Place> {
        self.names_at()
    }

    /// Position of the sensor of a channel in m, where the file states it.
    fn position(&self, _channel: usize) -> Option<[f64; 3]> {
        None
    }

    /// Sample rate, where the file states it.
    fn sample_rate(&self) -> Option<StatedRate>;

    /// Number of samples, where the file states it.
    fn samples(&self) -> Option<u64> {
        None
    }

    /// Position of the channel of time, where the file tells it by other means than its name.
    fn time(&self) -> Option<usize> {
        None
    }

    /// `true` if readings are shares of the full scale of a converter, which is no unit.
    fn is_share_of_full_scale(&self) -> bool {
        false
    }

    /// `false` if the head of the file has no row of numbers below a row of names.
    fn looks_recorded(&self) -> bool {
        true
    }

    /// The form in which the file is read, in words, where it was guessed.
    fn described(&self) -> Option<String> {
        None
    }

    /// Notes on parts of the file that are not read.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// True sample rate and calibrations, where the file states them.
    fn preamble(&self) -> &Preamble;

    /// Position of the channel that holds the faults of the samples as words.
    fn fault_channel(&self) -> Option<usize> {
        None
    }

    /// Selects the channels, by their positions, of which samples are read, in this order. A
    /// [`Source::fault_channel`] that is not selected is read as faults.
    fn select(&mut self, channels: &[usize]);

    /// Adds the next samples to a block until it has no room or the file ends; at the end
    /// nothing is added. Readings of samples with faults are of no use, but finite.
    ///
    /// # Errors
    /// [`RecordingError`] with the place of the sample at fault; the samples before it are in the
    /// block.
    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError>;

    /// A note on the end of the file, once it was reached.
    fn end_note(&self) -> Option<&'static str> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of one to nine channels, in two parts, of columns that hold more than is taken.
    #[test]
    fn columns_become_samples() {
        for width in 1..=9 {
            let reading = |channel: usize, n: usize| (100 * channel + n) as f64;
            let columns: Vec<Vec<f64>> = (0..width)
                .map(|channel| (0..20).map(|n| reading(channel, n)).collect())
                .collect();
            let mut block = Block::default();
            block.begin(width, 10);
            for (from, count) in [(0, 3), (3, 7)] {
                let columns: Vec<&[f64]> = columns.iter().map(|c| &c[from..]).collect();
                block.extend(count, |n| Place::Sample((from + n) as u64), &columns);
            }
            assert_eq!((block.len(), block.room()), (10, 0));
            for n in 0..10 {
                let (readings, place, health) = block.sample(n).unwrap();
                let expected: Vec<f64> = (0..width).map(|channel| reading(channel, n)).collect();
                assert_eq!(readings, expected, "{width} channels");
                assert!(matches!(place, Place::Sample(at) if at == n as u64));
                assert_eq!(health, Health::GOOD);
            }
        }
    }
}

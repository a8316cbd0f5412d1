//! Files that have each channel as a series of its own, read sample by sample.

use super::source::{Block, Channel, Place, Source, StatedRate};
use super::{Preamble, RecordingError};
use massline_firmware::wire::Health;
use std::collections::HashMap;
use std::hash::Hash;

/// The readings of a channel, one after the other.
pub(super) trait Series {
    /// The next reading.
    ///
    /// # Errors
    /// [`RecordingError`] with its place.
    fn next(&mut self) -> Result<f64, RecordingError>;
}

/// Opens the series of a channel by its position.
pub(super) type Open = Box<dyn Fn(usize) -> Result<Box<dyn Series>, RecordingError>>;

/// The key that most have; of several the largest one.
pub(super) fn most_common<K: Copy + Eq + Hash + Ord>(keys: impl Iterator<Item = K>) -> Option<K> {
    let mut counts: HashMap<K, u64> = HashMap::new();
    for key in keys {
        *counts.entry(key).or_default() += 1;
    }
    let most = counts.into_iter().max_by_key(|(key, count)| (*count, *key));
    most.map(|(key, _)| key)
}

/// A file of series of equal length.
pub(super) struct Columns {
    pub(super) channels: Vec<Channel>,
    /// Positions of the channels' sensors in m; empty where the format has none.
    pub(super) positions: Vec<Option<[f64; 3]>>,
    /// Samples of each channel.
    pub(super) samples: u64,
    pub(super) rate: Option<StatedRate>,
    /// Position of the channel of time, where the format has one.
    pub(super) time: Option<usize>,
    /// Form of the file in words.
    pub(super) form: String,
    pub(super) notes: Vec<String>,
    pub(super) open: Open,
    pub(super) reading: Reading,
}

/// State of the reading of [`Columns`].
#[derive(Default)]
pub(super) struct Reading {
    selected: Vec<usize>,
    /// The series of the selected channels, once the first sample is asked for.
    series: Vec<Box<dyn Series>>,
    next: u64,
    preamble: Preamble,
}

impl Source for Columns {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn position(&self, channel: usize) -> Option<[f64; 3]> {
        self.positions.get(channel).copied().flatten()
    }

    fn sample_rate(&self) -> Option<StatedRate> {
        self.rate
    }

    fn samples(&self) -> Option<u64> {
        Some(self.samples)
    }

    fn time(&self) -> Option<usize> {
        self.time
    }

    fn described(&self) -> Option<String> {
        Some(self.form.clone())
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn preamble(&self) -> &Preamble {
        &self.reading.preamble
    }

    fn select(&mut self, channels: &[usize]) {
        self.reading.selected = channels.to_vec();
        self.reading.series.clear();
    }

    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError> {
        let reading = &mut self.reading;
        if reading.series.len() != reading.selected.len() {
            let open = reading.selected.iter().map(|channel| (self.open)(*channel));
            reading.series = open.collect::<Result<_, _>>()?;
        }
        while block.room() > 0 && reading.next < self.samples {
            let place = Place::Sample(reading.next + 1);
            let series = &mut reading.series;
            block.push(place, Health::GOOD, |k| {
                series
                    .get_mut(k)
                    .map_or(Ok(f64::NAN), |series| series.next())
            })?;
            reading.next += 1;
        }
        Ok(())
    }
}

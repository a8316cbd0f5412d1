//! The survey: the peak response of each accelerometer in the mode band.
//!
//! # Design
//!
//! A block of all accelerometers would take four times the memory of the twelve
//! resultants. So accelerometers take turns, twelve at a time, in the room of a measuring
//! pass: with more than twelve of them, each block looks at the next twelve. The result
//! is an amplitude per unit of drive, so it does not matter that they were not looked at
//! at the same time.

use crate::capacity::SENSORS;
use crate::wire::{Item, Problem};
use core::ops::Range;
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{Average, DriveAverage, Sum};
use massline_core::weighting::peak_response;

/// Accelerometers that one block looks at.
const TOGETHER: usize = RESULTANTS;
/// Sums of a line: the drive's power, and three for each accelerometer.
const SUMS_A_LINE: usize = 1 + 3 * TOGETHER;
/// Groups of them.
const GROUPS: usize = SENSORS.div_ceil(TOGETHER);

/// A survey that is going on.
#[derive(Debug)]
pub(super) struct Survey {
    /// Numbers of the accelerometers.
    sensors: heapless::Vec<u8, SENSORS>,
    /// Lines of the mode band.
    lines: Range<usize>,
    /// Blocks of each group.
    blocks: [u32; GROUPS],
    /// The group whose turn it is.
    group: usize,
}

impl Survey {
    /// A survey of the given accelerometers over the lines of the mode band, with room for
    /// `room` sums.
    pub(super) fn new(
        sensors: impl Iterator<Item = usize>,
        lines: Range<usize>,
        room: usize,
    ) -> Result<Self, Problem> {
        let survey = Self {
            sensors: sensors.map(|s| s as u8).collect(),
            lines,
            blocks: [0; GROUPS],
            group: 0,
        };
        let each = survey.room_of_a_group();
        let (found, limit) = (survey.groups(), room / each.max(1));
        if found > limit {
            return Err(Problem::capacity(
                Item::Line,
                found.saturating_mul(survey.lines.len()),
                limit.saturating_mul(survey.lines.len()),
            ));
        }
        Ok(survey)
    }

    fn groups(&self) -> usize {
        self.sensors.len().div_ceil(TOGETHER)
    }

    fn room_of_a_group(&self) -> usize {
        // Of lines that are kept: at most as many as there is room for.
        SUMS_A_LINE.saturating_mul(self.lines.len())
    }

    fn sums<'s>(&self, group: usize, sums: &'s mut [Sum]) -> Option<DriveAverage<'s>> {
        let part = sums
            .chunks_exact_mut(self.room_of_a_group().max(1))
            .nth(group)?;
        let blocks = *self.blocks.get(group)?;
        DriveAverage::resume(self.lines.len(), TOGETHER, part, blocks).ok()
    }

    /// The samples of the sensors whose turn it is.
    pub(super) fn select(&self, samples: &[f32]) -> [f32; TOGETHER] {
        let mut selected = [0.0; TOGETHER];
        let turn = self.sensors.chunks(TOGETHER).nth(self.group);
        for (slot, sensor) in selected.iter_mut().zip(turn.unwrap_or(&[])) {
            *slot = samples.get(usize::from(*sensor)).copied().unwrap_or(0.0);
        }
        selected
    }

    /// The lines it looks at, of those that are kept.
    pub(super) fn lines(&self) -> Range<usize> {
        self.lines.clone()
    }

    /// The average of the sensors whose turn it is, which takes one block more.
    pub(super) fn average<'s>(&mut self, sums: &'s mut [Sum]) -> Option<DriveAverage<'s>> {
        let average = self.sums(self.group, sums);
        if let Some(blocks) = self.blocks.get_mut(self.group) {
            *blocks = blocks.saturating_add(1);
        }
        average
    }

    /// The next group's turn; `false` if there is only one.
    pub(super) fn turn(&mut self) -> bool {
        let groups = self.groups();
        if groups < 2 {
            return false;
        }
        self.group = match self.group.saturating_add(1) {
            next if next < groups => next,
            _ => 0,
        };
        true
    }

    /// The peaks by sensor number, once every group has had its turn.
    pub(super) fn peaks(&self, sums: &mut [Sum]) -> Option<[f64; SENSORS]> {
        let mut peaks = [0.0; SENSORS];
        for (group, sensors) in (0..GROUPS).zip(self.sensors.chunks(TOGETHER)) {
            let average = self.sums(group, sums)?;
            if average.blocks() == 0 {
                return None;
            }
            for (c, sensor) in (0..TOGETHER).zip(sensors) {
                if let Some(slot) = peaks.get_mut(usize::from(*sensor)) {
                    *slot = peak_response(&average, c, 0..self.lines.len());
                }
            }
        }
        Some(peaks)
    }
}

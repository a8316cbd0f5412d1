//! Samples in the queue from the sampling task.

use super::INPUTS;
use crate::acquisition::Sample;
use crate::wire::Health;

/// Raw counts of all inputs at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct RawFrame {
    /// Number of the sample since the start.
    pub number: u64,
    /// Time of the edge of the DRDY lines, ticks.
    pub ticks: u64,
    /// Counts of all inputs.
    pub counts: [i32; INPUTS],
    /// Faults of all inputs.
    pub health: [Health; INPUTS],
}

impl RawFrame {
    /// The frame of a sample whose edge came at that time, ticks; `None` unless it has all inputs.
    #[must_use]
    pub fn new(sample: &Sample<'_>, ticks: u64) -> Option<Self> {
        Some(Self {
            number: sample.number,
            ticks,
            counts: *sample.counts.first_chunk()?,
            health: *sample.health.first_chunk()?,
        })
    }
}

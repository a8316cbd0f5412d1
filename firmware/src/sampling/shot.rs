//! A sample on its way from the sampling task.

use super::INPUTS;
use crate::acquisition::Sample;
use crate::wire::Health;

/// A sample of all inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Its number since the start.
    pub number: u64,
    /// When its edge came, ticks.
    pub ticks: u64,
    /// Counts of all inputs.
    pub counts: [i32; INPUTS],
    /// Faults of all inputs.
    pub health: [Health; INPUTS],
}

impl Shot {
    /// A sample whose edge came at that time, ticks. All inputs are there; a sample of fewer
    /// would be of another box.
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

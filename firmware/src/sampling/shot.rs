//! A sample on its way from the sampling task.

use super::INPUTS;
use crate::acquisition::Sample;
use massline_core::wire::Health;

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
    /// A sample whose edge came at that time, ticks.
    #[must_use]
    pub fn new(sample: &Sample<'_>, ticks: u64) -> Self {
        let mut shot = Self {
            number: sample.number,
            ticks,
            counts: [0; INPUTS],
            health: [Health::MISSING; INPUTS],
        };
        for (slot, count) in shot.counts.iter_mut().zip(sample.counts) {
            *slot = *count;
        }
        for (slot, health) in shot.health.iter_mut().zip(sample.health) {
            *slot = *health;
        }
        shot
    }
}

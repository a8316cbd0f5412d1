//! The counts of one instant.

use crate::wire::Health;

/// Raw counts of all inputs at one instant, as they wait in a queue: plain values, which are copied once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<const CHIPS: usize, const INPUTS: usize> {
    /// Number of the sample since the start.
    pub number: u64,
    /// Time of the edge of the DRDY lines, ticks.
    pub ticks: u64,
    /// Counts of all inputs.
    pub counts: [i32; INPUTS],
    /// Faults of each converter, which are those of all its inputs.
    pub faults: [Health; CHIPS],
}

impl<const CHIPS: usize, const INPUTS: usize> Frame<CHIPS, INPUTS> {
    /// The frame before the first sample.
    pub(super) const NONE: Self = Self {
        number: 0,
        ticks: 0,
        counts: [0; INPUTS],
        faults: [Health::MISSING; CHIPS],
    };
}

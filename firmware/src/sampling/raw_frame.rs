//! Samples in the queue from the sampling task.

use super::INPUTS;
use crate::acquisition::Sample;
use crate::wire::Health;
use heapless::spsc::Producer;

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
    /// Puts the frame of a sample whose edge came at that time, ticks, into a queue. `false` if there is
    /// no room, or if the sample has not all inputs.
    #[inline]
    pub fn enqueue(sample: &Sample<'_>, ticks: u64, queue: &mut Producer<'_, Self>) -> bool {
        let (Some(counts), Some(health)) =
            (sample.counts.first_chunk(), sample.health.first_chunk())
        else {
            return false;
        };
        // Made where it is passed: any value of it in between is a copy of all inputs.
        queue
            .enqueue(Self {
                number: sample.number,
                ticks,
                counts: *counts,
                health: *health,
            })
            .is_ok()
    }
}

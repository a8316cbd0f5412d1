//! Samples in the queue from the sampling task.

use super::bank::CHANNELS;
use super::{CHIPS, INPUTS};
use crate::acquisition::Sample;
use crate::wire::Health;
use heapless::spsc::Producer;

/// The first input of each converter.
const FIRST: [usize; CHIPS] = {
    let mut first = [0; CHIPS];
    let mut k = 1;
    while k < CHIPS {
        first[k] = first[k - 1] + CHANNELS[k - 1];
        k += 1;
    }
    first
};

/// Raw counts of all inputs at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct RawFrame {
    /// Number of the sample since the start.
    pub number: u64,
    /// Time of the edge of the DRDY lines, ticks.
    pub ticks: u64,
    /// Counts of all inputs.
    pub counts: [i32; INPUTS],
    /// Faults of each converter, which are those of all its inputs: a queue copies them twice.
    faults: [Health; CHIPS],
}

impl RawFrame {
    /// Puts the frame of a sample whose edge came at that time, ticks, into a queue. `false` if there is
    /// no room, or if the sample has not all inputs.
    #[inline]
    pub fn enqueue(sample: &Sample<'_>, ticks: u64, queue: &mut Producer<'_, Self>) -> bool {
        let (Some(counts), Some(health)) = (
            sample.counts.first_chunk(),
            sample.health.first_chunk::<INPUTS>(),
        ) else {
            return false;
        };
        // Made where it is passed: any value of it in between is a copy of all inputs.
        queue
            .enqueue(Self {
                number: sample.number,
                ticks,
                counts: *counts,
                faults: FIRST.map(|input| health.get(input).copied().unwrap_or_default()),
            })
            .is_ok()
    }

    /// `true` if none of the first `inputs` inputs has a fault, those of other converters than these, by
    /// bits, aside.
    #[inline]
    #[must_use]
    pub fn is_good(&self, converters: u32, inputs: usize) -> bool {
        let mut all = (0..).zip(FIRST.iter().zip(&self.faults));
        all.all(|(k, (first, health))| {
            health.is_good() || *first >= inputs || converters.wrapping_shr(k) & 1 == 0
        })
    }

    /// Faults of all inputs.
    #[must_use]
    pub fn health(&self) -> [Health; INPUTS] {
        let each = CHANNELS.into_iter().zip(self.faults);
        let mut each = each.flat_map(|(inputs, health)| core::iter::repeat_n(health, inputs));
        core::array::from_fn(|_| each.next().unwrap_or_default())
    }
}

//! Samples in the queue from the sampling task.

use super::bank::CHANNELS;
use super::{CHIPS, INPUTS};
use crate::acquisition::Frame;
use crate::wire::Health;

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

/// The counts of the box's inputs at one instant.
pub type RawFrame = Frame<CHIPS, INPUTS>;

impl RawFrame {
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

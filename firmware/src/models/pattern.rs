//! A converter of test patterns: each count depends on the numbers of sample and input.

use super::random::mix;
use crate::drivers::{Converter, Fault, Reading, Signal};

/// The count of an input in the sample of this number: pseudo-random, 22 bits.
#[must_use]
pub const fn count(sample: u32, input: usize) -> i32 {
    (mix(((sample as u64) << 6) + input as u64) >> 42) as i32 - (1 << 21)
}

/// A converter of test patterns, for some inputs of a box.
#[derive(Clone, Debug)]
pub struct Pattern {
    first: usize,
    channels: usize,
    /// Samples converted since [`Self::restart`].
    converted: u32,
    unread: bool,
}

impl Pattern {
    /// A converter for `channels` inputs from number `first` on.
    #[must_use]
    pub const fn new(first: usize, channels: usize) -> Self {
        Self {
            first,
            channels,
            converted: 0,
            unread: false,
        }
    }

    /// Restarts at sample 0.
    pub const fn restart(&mut self) {
        self.converted = 0;
        self.unread = false;
    }

    /// Samples since [`Self::restart`].
    #[must_use]
    pub const fn converted(&self) -> u32 {
        self.converted
    }

    /// Converts so many samples, of which the last one can be read.
    pub const fn convert(&mut self, samples: u32) {
        self.converted = self.converted.wrapping_add(samples);
        self.unread |= samples > 0;
    }
}

impl Converter for Pattern {
    fn channels(&self) -> usize {
        self.channels
    }

    /// Restarts at sample 0.
    fn choose(&mut self, _: f64, _: &[u8], _: Signal) -> Result<(), Fault> {
        self.restart();
        Ok(())
    }

    fn prepare(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        if !core::mem::take(&mut self.unread) {
            return Err(Fault::Stale);
        }
        let sample = self.converted.wrapping_sub(1);
        for (input, slot) in (self.first..).zip(counts) {
            *slot = count(sample, input);
        }
        Ok(Reading::default())
    }
}

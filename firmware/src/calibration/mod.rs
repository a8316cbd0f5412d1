//! From counts to SI, and whether a count can be believed.
//!
//! | file | holds |
//! | --- | --- |
//! | `scale` | the straight line from counts or readings to SI, in `f32` |
//! | `watch` | overload with its hold-off, open sensors, readings that do not move |
//! | `certificate` | what is known of one input: sensitivity, uncertainty, who found it and when |
//! | `preset` | what follows from a sensor's data sheet: charge amplifier, bridge, IEPE, digital |
//!
//! # Design
//!
//! One sample of one channel is one call, [`Channel::count`]: a number and the faults that the
//! converter's driver has found go in, SI and all faults come out. The number of a faulty sample
//! is still what the counts say; whether it may be used is told by its [`Health`] and by nothing
//! else.
//!
//! A sample that is told to be good can turn out otherwise only in one way: a reading that stops
//! moving is found after [`watch::STUCK_AFTER`] samples. The block that they end in is then not
//! the block that is rejected, but they are its last few, where a window has all but faded out:
//! Hann's over 1024 samples is below 0.0023 on the last 15 of them.

mod certificate;
mod preset;
mod scale;
pub mod watch;

pub use certificate::{Certificate, Text};
pub use preset::{FULL_SCALE_VOLTS, Preset};
pub use scale::Scale;
pub use watch::{Limits, Watch};

use crate::wire::Health;

/// One channel at work: its line to SI, and the watch over its counts.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    scale: Scale,
    watch: Option<Watch>,
}

impl Channel {
    /// A channel whose readings are only checked for being numbers: recordings, and inputs to
    /// which nothing is wired.
    #[must_use]
    pub const fn unwatched(scale: Scale) -> Self {
        Self { scale, watch: None }
    }

    /// A channel whose counts are watched.
    #[must_use]
    pub const fn watched(scale: Scale, watch: Watch) -> Self {
        Self {
            scale,
            watch: Some(watch),
        }
    }

    /// The line from counts to SI.
    #[must_use]
    pub const fn scale(&self) -> Scale {
        self.scale
    }

    /// Takes one count and the faults known of it, in the samples' order. Gives SI and all
    /// faults.
    ///
    /// A count that came with a fault is not a reading of the sensor, so that the watch does not
    /// learn from it; only its hold-off goes on.
    #[inline]
    pub fn count(&mut self, count: i32, known: Health) -> (f32, Health) {
        let found = match &mut self.watch {
            Some(watch) if known.is_good() => watch.count(count),
            Some(watch) => watch.absent(),
            None => Health::GOOD,
        };
        (self.scale.count(count), known.union(found))
    }

    /// Takes one reading in the recording's unit. Gives SI and all faults.
    #[must_use]
    pub fn reading(&self, reading: f32, known: Health) -> (f32, Health) {
        let si = self.scale.reading(reading);
        if si.is_finite() {
            (si, known)
        } else {
            (si, known.union(Health::NOT_FINITE))
        }
    }

    /// Takes notice that so many samples are missing: a hold-off goes on meanwhile.
    pub fn skip(&mut self, missing: u64) {
        if let Some(watch) = &mut self.watch {
            watch.skip(missing);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_found_elsewhere_stay() {
        let scale = Scale::new(0.5, 0.0).unwrap();
        let mut channel = Channel::watched(scale, Watch::new(Limits::CONVERTER, 512.0));
        let (si, health) = channel.count(8, Health::CHECKSUM);
        assert_eq!((si, health), (4.0, Health::CHECKSUM));
        assert_eq!(channel.count(8, Health::GOOD), (4.0, Health::GOOD));
    }

    #[test]
    fn a_reading_that_is_no_number_says_so() {
        let channel = Channel::unwatched(Scale::ONE);
        assert_eq!(channel.reading(1.5, Health::GOOD), (1.5, Health::GOOD));
        for reading in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let (_, health) = channel.reading(reading, Health::MISSING);
            assert_eq!(health, Health::NOT_FINITE.union(Health::MISSING));
        }
    }

    #[test]
    fn counts_with_faults_teach_the_watch_nothing() {
        let mut channel = Channel::watched(Scale::ONE, Watch::new(Limits::CONVERTER, 512.0));
        // What a converter that does not answer leaves behind is no reading that stands still.
        for _ in 0..10 * watch::STUCK_AFTER {
            assert_eq!(channel.count(0, Health::MISSING).1, Health::MISSING);
        }
        assert_eq!(channel.count(0, Health::GOOD).1, Health::GOOD);
    }
}

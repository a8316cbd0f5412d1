//! Conversion of counts to SI, and faults that follow from the counts.
//!
//! | file | holds |
//! | --- | --- |
//! | `scale` | the straight line from counts or readings to SI, in `f32` |
//! | `watch` | overload with its hold-off, open sensors, readings that do not change |
//! | `certificate` | calibration of one input: sensitivity, uncertainty, laboratory and date |
//! | `alignment` | delay and magnitude of converters' filters, where they differ |
//! | `preset` | values from the data sheet of a sensor: charge amplifier, bridge, IEPE, digital |
//!
//! # Design
//!
//! One call of [`Channel::count`] converts one sample of one channel: it takes a count and the
//! faults that the driver of the converter has found, and gives SI and all faults. The value of a
//! faulty sample is still computed from its count; its [`Health`] alone decides if it may be used.
//!
//! Only one fault is found late: a reading that stops changing is found after
//! [`watch::STUCK_AFTER`] samples. The block in which these samples end may already be complete,
//! but they are its last few, where the window is almost zero: Hann's window over 1024 samples is
//! below 0.0023 on the last 15 of them.

mod alignment;
mod certificate;
mod preset;
mod scale;
pub mod watch;

pub use alignment::Alignment;
pub use certificate::{Certificate, Text};
pub use preset::{
    ADXL355_COUNTS_PER_G, BRIDGE_SUPPLY_MAX, FULL_SCALE_VOLTS, Preset, SupplyTooHigh,
};
pub use scale::Scale;
pub use watch::{Limits, Watch};

use crate::wire::Health;

/// Conversion and supervision of one channel.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    scale: Scale,
    watch: Option<Watch>,
}

impl Channel {
    /// Creates a channel whose readings are only checked for finite numbers: for recordings, and
    /// for inputs to which nothing is wired.
    #[must_use]
    pub const fn unwatched(scale: Scale) -> Self {
        Self { scale, watch: None }
    }

    /// Creates a channel whose counts are supervised.
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

    /// Converts one count with its known faults, in the order of the samples. Returns SI and all
    /// faults.
    ///
    /// A count with a fault is not a reading of the sensor, so that the watch ignores its value;
    /// only the hold-off goes on.
    #[inline]
    pub fn count(&mut self, count: i32, known: Health) -> (f32, Health) {
        let found = match &mut self.watch {
            Some(watch) if known.is_good() => watch.count(count),
            Some(watch) => watch.absent(),
            None => Health::GOOD,
        };
        (self.scale.count(count), known.union(found))
    }

    /// Takes a count without a fault, and returns `true`, if the watch has nothing to say of it: the common
    /// case of [`Self::count`].
    #[inline]
    pub fn take_common(&mut self, count: i32) -> bool {
        self.watch
            .as_mut()
            .is_none_or(|watch| watch.take_common(count))
    }

    /// Converts one reading in the unit of the recording. Returns SI and all faults.
    #[must_use]
    pub fn reading(&self, reading: f32, known: Health) -> (f32, Health) {
        let si = self.scale.reading(reading);
        if si.is_finite() {
            (si, known)
        } else {
            (si, known.union(Health::NOT_FINITE))
        }
    }

    /// Advances the hold-off by the number of missing samples.
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
    fn a_reading_that_is_not_finite_has_a_fault() {
        let channel = Channel::unwatched(Scale::ONE);
        assert_eq!(channel.reading(1.5, Health::GOOD), (1.5, Health::GOOD));
        for reading in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let (_, health) = channel.reading(reading, Health::MISSING);
            assert_eq!(health, Health::NOT_FINITE.union(Health::MISSING));
        }
    }

    #[test]
    fn counts_with_faults_do_not_change_the_watch() {
        let mut channel = Channel::watched(Scale::ONE, Watch::new(Limits::CONVERTER, 512.0));
        // The count in the place of a missing sample is not a reading that does not change.
        for _ in 0..10 * watch::STUCK_AFTER {
            assert_eq!(channel.count(0, Health::MISSING).1, Health::MISSING);
        }
        assert_eq!(channel.count(0, Health::GOOD).1, Health::GOOD);
    }
}

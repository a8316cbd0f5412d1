//! Faults of a channel that follow from its counts.
//!
//! # Design
//!
//! **Overload.** Counts at a limit are wrong, and so is what follows: amplifiers and filters need
//! time to come back. So a sample is [`Health::OVERLOAD`] at a limit and for [`HOLD_OFF`] seconds
//! after. The converter's own filter is shorter than that from 60 samples/s on: its sinc3
//! response lasts three samples.
//!
//! **Open.** The wiring ties each input weakly to the positive supply, so that an input that
//! no sensor drives goes to the upper end of the range and stays there. Shaking reaches the end,
//! too, but comes back within half a period; [`OPEN_AFTER`] seconds without a return, as long as
//! the half of a period of 0.5 Hz, are [`Health::OPEN`]. Until then the samples are overloads, so
//! that none of them counts as good. The input stays open until it has been away from the end for
//! the hold-off.
//!
//! **Stuck.** A converter of 24 bits never reads the same number for long: even a shorted input
//! has a noise of some ten counts (the ADS131M08's data sheet gives 1.9 µV RMS at gain 1 and its
//! slowest rate, thirteen counts; faster rates are noisier, and the ADXL355's noise is above
//! sixty of its counts at 125 Hz). Two readings are then equal in one of 46 cases, for Gaussian
//! noise of standard deviation σ being equal has the probability 1/(2σ√π), and
//! [`STUCK_AFTER`] = 16 of them in a row once in 46^15 or 1e25 samples: never, in four hours of
//! 32 channels at 16384 samples/s, 7.5e9. A reading that does not change is [`Health::STUCK`],
//! unless it is at a limit, where it is an overload or open.

use crate::wire::Health;

/// Seconds after an overload during which samples count as overloads, too.
pub const HOLD_OFF: f32 = 0.05;
/// Seconds at a limit after which a sensor counts as open.
pub const OPEN_AFTER: f32 = 1.0;
/// Equal counts in a row from which on a reading counts as stuck.
pub const STUCK_AFTER: u32 = 16;

const _: () = assert!(STUCK_AFTER <= u8::MAX as u32, "as many are counted");

/// Counts at which a sample is an overload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Counts at and below this one are overloads.
    pub low: i32,
    /// Counts at and above this one are overloads.
    pub high: i32,
}

impl Limits {
    /// The ends of 24 bits, where a converter clips.
    pub const CONVERTER: Self = Self {
        low: -(1 << 23),
        high: (1 << 23) - 1,
    };

    /// `true` if a count lies between the limits.
    #[must_use]
    pub const fn contains(&self, count: i32) -> bool {
        self.low < count && count < self.high
    }
}

/// Supervision of the counts of one channel.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    limits: Limits,
    /// Samples of the hold-off, and at a limit until the sensor is open.
    hold_off: u32,
    open_after: u32,
    state: State,
}

/// State of the supervision.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    /// Samples that the hold-off still lasts.
    held: u32,
    /// Samples at the limits without a return.
    beyond: u32,
    open: bool,
    /// The last count, and how many like it came in a row.
    last: i32,
    equal: u8,
}

impl Watch {
    /// Creates the supervision at a sample rate in Hz. An invalid rate gives the shortest times,
    /// one sample.
    #[must_use]
    pub fn new(limits: Limits, sample_rate: f32) -> Self {
        // A cast saturates, and takes what is not a number for zero.
        let samples = |seconds: f32| (libm::ceilf(seconds * sample_rate) as u32).max(1);
        Self {
            limits,
            hold_off: samples(HOLD_OFF),
            open_after: samples(OPEN_AFTER),
            state: State::default(),
        }
    }

    /// The limits of the counts.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        self.limits
    }

    /// Takes one count of the sensor and returns its faults.
    #[inline]
    pub fn count(&mut self, count: i32) -> Health {
        // The common case of every input of every sample; rare cases are a function of their own.
        if self.take_common(count) {
            return Health::GOOD;
        }
        self.count_conspicuous(count)
    }

    /// Takes a count that changes, lies within the limits, and comes after the hold-off: without a fault.
    /// Any other one is not taken, `false`.
    #[inline]
    pub fn take_common(&mut self, count: i32) -> bool {
        let state = &mut self.state;
        let is_common = count != state.last && state.held == 0 && self.limits.contains(count);
        if is_common {
            state.last = count;
            state.equal = 1;
        }
        is_common
    }

    /// Takes a count that does not change, lies beyond a limit, or follows within the hold-off.
    #[cold]
    fn count_conspicuous(&mut self, count: i32) -> Health {
        let state = &mut self.state;
        if count == state.last {
            state.equal = state.equal.saturating_add(1);
        } else {
            state.last = count;
            state.equal = 1;
        }

        if !self.limits.contains(count) {
            state.held = self.hold_off;
            state.beyond = state.beyond.saturating_add(1);
            state.open |= state.beyond >= self.open_after;
            return state.overload();
        }
        if u32::from(state.equal) >= STUCK_AFTER {
            return self.absent().union(Health::STUCK);
        }
        self.absent()
    }

    /// Takes a sample without a reading of the sensor, and returns the faults that go on.
    pub fn absent(&mut self) -> Health {
        let state = &mut self.state;
        if state.held == 0 {
            return Health::GOOD;
        }
        let health = state.overload();
        state.held -= 1;
        state.beyond = 0;
        state.open &= state.held > 0;
        health
    }

    /// Takes a number of missing samples in a row, as if by that many calls of [`Self::absent`].
    pub fn skip(&mut self, missing: u64) {
        let state = &mut self.state;
        if state.held == 0 || missing == 0 {
            return;
        }
        state.held = u64::from(state.held).saturating_sub(missing) as u32;
        state.beyond = 0;
        state.open &= state.held > 0;
    }
}

impl State {
    fn overload(&self) -> Health {
        if self.open {
            Health::OVERLOAD.union(Health::OPEN)
        } else {
            Health::OVERLOAD
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RATE: f32 = 512.0;
    /// ceil(0.05 s * 512 Hz).
    const HELD: usize = 26;

    fn watch() -> Watch {
        let limits = Limits {
            low: -1000,
            high: 1000,
        };
        Watch::new(limits, RATE)
    }

    /// A signal that moves within the limits.
    fn moving(i: usize) -> i32 {
        [3, -3, 7, 0][i % 4]
    }

    #[test]
    fn an_overload_holds_for_its_time_and_no_longer() {
        for peak in [1000, 5000, -1000, i32::MIN] {
            let mut watch = watch();
            assert_eq!(watch.count(moving(0)), Health::GOOD);
            assert_eq!(watch.count(peak), Health::OVERLOAD);
            let held = (0..100)
                .map(|i| watch.count(moving(i)))
                .take_while(|&health| health == Health::OVERLOAD)
                .count();
            assert_eq!(held, HELD);
            assert_eq!(watch.count(999), Health::GOOD);
            assert_eq!(watch.count(-999), Health::GOOD);
        }
    }

    #[test]
    fn the_hold_off_goes_on_while_samples_are_missing() {
        let mut watch = watch();
        watch.count(1000);
        for _ in 0..HELD {
            assert_eq!(watch.absent(), Health::OVERLOAD);
        }
        assert_eq!(watch.absent(), Health::GOOD);
        assert_eq!(watch.count(1), Health::GOOD);
    }

    #[test]
    fn an_open_sensor_is_an_overload_first() {
        let open = Health::OVERLOAD.union(Health::OPEN);
        let mut watch = watch();
        for _ in 0..511 {
            assert_eq!(watch.count(1000), Health::OVERLOAD);
        }
        for _ in 0..1000 {
            assert_eq!(watch.count(1000), open);
        }
        // Plugged in again: still open for the hold-off.
        for i in 0..HELD {
            assert_eq!(watch.count(moving(i)), open);
        }
        assert_eq!(watch.count(moving(0)), Health::GOOD);
    }

    #[test]
    fn clipping_is_not_open() {
        let mut watch = watch();
        // Half a second at each end in turn, with one sample between.
        for half in 0..40 {
            let end = if half % 2 == 0 { 1000 } else { -1000 };
            for _ in 0..256 {
                assert_eq!(watch.count(end), Health::OVERLOAD);
            }
            assert_eq!(watch.count(0), Health::OVERLOAD);
        }
    }

    #[test]
    fn a_reading_that_stands_still_is_stuck() {
        let mut watch = watch();
        for _ in 1..STUCK_AFTER {
            assert_eq!(watch.count(17), Health::GOOD);
        }
        for _ in 0..100 {
            assert_eq!(watch.count(17), Health::STUCK);
        }
        assert_eq!(watch.count(18), Health::GOOD);
    }

    #[test]
    fn a_rate_that_is_none_holds_one_sample() {
        for rate in [0.0, -5.0, f32::NAN] {
            let mut watch = Watch::new(Limits::CONVERTER, rate);
            assert_eq!(watch.count(i32::MAX).0 & 1, 1);
            assert_eq!(watch.count(1).0 & 1, 1);
            assert_eq!(watch.count(2), Health::GOOD);
        }
    }

    proptest! {
        /// A gap of any length, in one go or sample by sample.
        #[test]
        fn a_gap_is_as_many_absent_samples(
            before in prop::collection::vec(prop_oneof![Just(1000), -1500..1500], 0..700),
            missing in 0_u64..80,
            after in prop::collection::vec(prop_oneof![Just(1000), -1500..1500], 0..40),
        ) {
            let (mut single, mut whole) = (watch(), watch());
            for &count in &before {
                prop_assert_eq!(single.count(count), whole.count(count));
            }
            for _ in 0..missing {
                single.absent();
            }
            whole.skip(missing);
            for &count in &after {
                prop_assert_eq!(single.count(count), whole.count(count));
            }
        }

        /// Against a plain statement of the rules over the whole record.
        #[test]
        fn rules_hold_for_any_counts(
            counts in prop::collection::vec(
                prop_oneof![Just(0), Just(5), Just(1000), -1500..1500], 0..3000,
            )
        ) {
            let mut watch = watch();
            for (k, &count) in counts.iter().enumerate() {
                let health = watch.count(count);
                let overload = counts[k.saturating_sub(HELD)..=k].iter().any(|c| c.abs() >= 1000);
                prop_assert_eq!(health.contains(Health::OVERLOAD), overload);
                let run = counts[..=k].iter().rev().take_while(|&&c| c == count).count();
                let stuck = run >= STUCK_AFTER as usize && count.abs() < 1000;
                prop_assert_eq!(health.contains(Health::STUCK), stuck);
            }
        }
    }
}

//! The converters of a box, and the test patterns that can replace them.

use super::bank::{Bank, CHANNELS, WITH_EDGES};
use super::{CHIPS, CONVERTERS, Failure, Plan};
use crate::drivers::{Converter, Fault};
use crate::models::pattern::Pattern;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

/// Nanoseconds that the SYNC line is low: more than a cycle of the converters' clock, and far
/// less than the 488 µs that would reset them.
const SYNC_NS: u32 = 2_000;

/// The converters of a box, those with a DRDY line on one SYNC line.
pub struct Converters<A, D, P, T> {
    bank: Bank<A, D>,
    sync: P,
    delay: T,
    patterns: [Pattern; CHIPS],
    is_test_pattern: bool,
    /// `true` if they were restarted since [`Self::take_restarted`].
    restarted: bool,
    /// Bit k: converter k was left out.
    left_out: u32,
}

impl<A, D, P, T> Converters<A, D, P, T>
where
    A: SpiDevice,
    D: SpiDevice,
    P: OutputPin,
    T: DelayNs,
{
    /// Converters on these SPI devices, with their SYNC line and a delay.
    pub fn new(ads: [A; CONVERTERS], adxl: D, sync: P, delay: T) -> Self {
        let mut first = 0;
        let patterns = CHANNELS.map(|channels| {
            let pattern = Pattern::new(first, channels);
            first = usize::wrapping_add(first, channels);
            pattern
        });
        Self {
            bank: Bank::new(ads, adxl),
            sync,
            delay,
            patterns,
            is_test_pattern: false,
            restarted: false,
            left_out: 0,
        }
    }

    /// Replaces the chips by test patterns from now on.
    pub(super) const fn use_test_pattern(&mut self) {
        self.is_test_pattern = true;
    }

    /// `true` if test patterns replace the chips.
    pub(super) const fn is_test_pattern(&self) -> bool {
        self.is_test_pattern
    }

    /// `true` if the conversions were restarted since the last call.
    pub(super) const fn take_restarted(&mut self) -> bool {
        core::mem::replace(&mut self.restarted, false)
    }

    /// Makes the test patterns convert so many samples, and returns their number since the start.
    pub(super) fn convert(&mut self, samples: u32) -> u32 {
        self.patterns.iter_mut().for_each(|p| p.convert(samples));
        let [pattern, ..] = &self.patterns;
        pattern.converted()
    }

    /// These bits without those of converters that have no DRDY line or are left out.
    const fn in_use(&self, bits: u32) -> u32 {
        bits & WITH_EDGES & !self.left_out
    }

    /// Bits of all ready converters, from the low DRDY lines: a converter without a line is ready
    /// with the majority of the others, unless it is left out. `None` if the edge is of a converter that
    /// is left out.
    pub(super) const fn with_followers(&self, ready: u32) -> Option<u32> {
        let used = self.in_use(ready);
        if used == 0 && ready != 0 {
            return None;
        }
        let is_majority = 2 * used.count_ones() >= self.in_use(u32::MAX).count_ones();
        let followers = (is_majority as u32) << CONVERTERS;
        Some(used | followers & !self.left_out)
    }

    /// Chooses rate and gains, and returns the bits of the converters that are left out: those that are
    /// not to be read, and those without an input in use that do not answer.
    ///
    /// # Errors
    ///
    /// The fault of the first converter, if none is in use and none answers.
    pub(super) fn configure(&mut self, plan: &Plan) -> Result<u32, Failure> {
        self.left_out = 0;
        let (left_out, first) = self.with(|converters, _| {
            let mut gains = &plan.gains[..];
            for (k, converter) in (0..).zip(converters.iter_mut()) {
                let channels = converter.channels();
                let chosen = converter.choose(plan.rate, gains, plan.conditions.signal);
                chosen.map_err(|fault| (k, fault))?;
                gains = gains.get(channels..).unwrap_or(&[]);
            }
            let mut first: Option<Fault> = None;
            let mut left_out = 0;
            for (k, converter) in converters.iter_mut().enumerate() {
                let bit = 1 << k;
                if plan.read & bit == 0 {
                    left_out |= bit;
                } else if plan.used & bit == 0
                    && let Err(fault) = converter.prepare()
                {
                    first = first.or(Some(fault));
                    left_out |= bit;
                }
            }
            Ok((left_out, first))
        })?;
        self.left_out = left_out;
        match first {
            // The accelerometer alone has no edges to sample at.
            Some(fault) if self.in_use(u32::MAX) == 0 => Err((0, fault)),
            _ => Ok(left_out),
        }
    }

    /// Prepares a converter, by its number, as it was configured last.
    ///
    /// # Errors
    ///
    /// Its fault; [`Fault::Unsupported`] if there is none of this number.
    pub(super) fn prepare(&mut self, number: u8) -> Result<(), Fault> {
        self.with(|converters, _| {
            let converter = converters.get_mut(usize::from(number));
            converter.ok_or(Fault::Unsupported)?.prepare()
        })
    }

    /// Lends the converters, and a function that restarts their conversions together.
    pub(super) fn with<R>(
        &mut self,
        act: impl FnOnce(&mut [&mut dyn Converter; CHIPS], &mut dyn FnMut()) -> R,
    ) -> R {
        let mut converters: [&mut dyn Converter; CHIPS] = if self.is_test_pattern {
            self.patterns
                .each_mut()
                .map(|p| -> &mut dyn Converter { p })
        } else {
            self.bank.all()
        };
        let (sync, delay, restarted) = (&mut self.sync, &mut self.delay, &mut self.restarted);
        let mut synchronise = || {
            // The chip's own pins do not fail. Converters whose pin fails stay out of step, which
            // is counted.
            let _ = sync.set_low();
            delay.delay_ns(SYNC_NS);
            let _ = sync.set_high();
            *restarted = true;
        };
        act(&mut converters, &mut synchronise)
    }
}

//! The converters of a box, and the test pattern that stands in for them.

use super::{CHIPS, CONVERTERS, Failure, Plan};
use crate::drivers::ads131m08::registers::CHANNELS;
use crate::drivers::ads131m08::{self, Ads131m08, CLOCK_HZ, Configuration};
use crate::drivers::adxl355::{self, Adxl355};
use crate::drivers::{Converter, Fault};
use crate::models::pattern::Pattern;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

/// Nanoseconds that the SYNC line is low: more than a cycle of the converters' clock, and far
/// less than the 244 µs that would reset them.
const SYNC_NS: u32 = 2_000;

/// Four ADS131M08 on one SYNC line, and an ADXL355 that follows them.
pub struct Converters<A, D, P, T> {
    ads: [Ads131m08<A>; CONVERTERS],
    adxl: Adxl355<D>,
    sync: P,
    delay: T,
    patterns: [Pattern; CHIPS],
    is_test_pattern: bool,
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
    /// Behind these devices, SYNC line and delay.
    pub fn new(ads: [A; CONVERTERS], adxl: D, sync: P, delay: T) -> Self {
        let pattern = |k: usize| match k {
            CONVERTERS => Pattern::new(CONVERTERS * CHANNELS, adxl355::CHANNELS),
            k => Pattern::new(k * CHANNELS, CHANNELS),
        };
        Self {
            ads: ads.map(|spi| Ads131m08::new(spi, Configuration::PLAIN)),
            adxl: Adxl355::new(adxl, adxl355::Configuration::following(0.0)),
            sync,
            delay,
            patterns: core::array::from_fn(pattern),
            is_test_pattern: false,
            left_out: 0,
        }
    }

    /// Makes test patterns stand in for the chips from now on.
    pub(super) const fn use_test_pattern(&mut self) {
        self.is_test_pattern = true;
    }

    /// `true` if test patterns stand in for the chips.
    pub(super) const fn is_test_pattern(&self) -> bool {
        self.is_test_pattern
    }

    /// Makes the test patterns convert so many samples, and returns their number since the start.
    pub(super) fn convert(&mut self, samples: u32) -> u32 {
        self.patterns.iter_mut().for_each(|p| p.convert(samples));
        let [pattern, ..] = &self.patterns;
        pattern.converted()
    }

    /// Bits of the ADS131M08 that are not left out, of these bits.
    const fn kept(&self, bits: u32) -> u32 {
        const ALL: u32 = (1 << CONVERTERS) - 1;
        bits & ALL & !self.left_out
    }

    /// Bits of all that are ready, when these ADS131M08 are: who has no edge of its own goes
    /// with the majority. `None` if it was an edge of one that is left out.
    pub(super) const fn with_followers(&self, ready: u32) -> Option<u32> {
        let kept = self.kept(ready);
        if kept == 0 && ready != 0 {
            return None;
        }
        let is_majority = 2 * kept.count_ones() >= self.kept(u32::MAX).count_ones();
        Some(kept | (is_majority as u32) << CONVERTERS)
    }

    /// Sets rate and gains, and says by bits which converters nobody needs that do not answer.
    ///
    /// # Errors
    ///
    /// The fault of the first converter, if none is needed and none answers.
    pub(super) fn configure(&mut self, plan: &Plan) -> Result<u32, Failure> {
        self.left_out = 0;
        for (k, chip) in self.ads.iter_mut().enumerate() {
            let mut configuration = Configuration {
                oversampling: plan.oversampling,
                ..Configuration::PLAIN
            };
            let gains = plan.gains.iter().skip(k * CHANNELS);
            for (channel, gain) in configuration.channels.iter_mut().zip(gains) {
                *channel = ads131m08::Channel::pins(*gain);
            }
            chip.configure(configuration);
        }
        let rate = plan.oversampling.rate(CLOCK_HZ);
        self.adxl.configure(adxl355::Configuration::following(rate));
        self.patterns.iter_mut().for_each(Pattern::restart);

        let used = plan.used;
        let (left_out, first) = self.with(|converters, _| {
            let mut first: Option<Fault> = None;
            let mut left_out = 0;
            for (k, converter) in converters.iter_mut().enumerate() {
                if used >> k & 1 == 0
                    && let Err(fault) = converter.prepare()
                {
                    first = first.or(Some(fault));
                    left_out |= 1 << k;
                }
            }
            (left_out, first)
        });
        self.left_out = left_out;
        match first {
            // The accelerometer alone has no edge to sample at.
            Some(fault) if self.kept(u32::MAX) == 0 => Err((0, fault)),
            _ => Ok(left_out),
        }
    }

    /// Lends the converters, and what restarts them together.
    pub(super) fn with<R>(
        &mut self,
        act: impl FnOnce(&mut [&mut dyn Converter; CHIPS], &mut dyn FnMut()) -> R,
    ) -> R {
        let [a, b, c, d] = &mut self.ads;
        let [v, w, x, y, z] = &mut self.patterns;
        let mut converters: [&mut dyn Converter; CHIPS] = if self.is_test_pattern {
            [v, w, x, y, z]
        } else {
            [a, b, c, d, &mut self.adxl]
        };
        let (sync, delay) = (&mut self.sync, &mut self.delay);
        let mut synchronise = || {
            // A pin of the chip's own does not fail, and where one does, the converters stay out
            // of step, which shows.
            let _ = sync.set_low();
            delay.delay_ns(SYNC_NS);
            let _ = sync.set_high();
        };
        act(&mut converters, &mut synchronise)
    }
}

//! How to sample: what follows from the settings.

use super::{CONVERTERS, Failure, GAINS, INPUTS};
use crate::drivers::Fault;
use crate::drivers::ads131m08::registers::CHANNELS;
use crate::drivers::ads131m08::{CLOCK_HZ, Gain, Oversampling};
use crate::settings::Settings;
use crate::wire::{Circuit, ConverterFault, Exact, Field, Problem};

/// How to sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Ticks from sample to sample, nominally.
    pub period: f32,
    /// Sets the rate.
    pub oversampling: Oversampling,
    /// Of each input that has one.
    pub gains: [Gain; GAINS],
    /// Bit k: an input of converter k is in use.
    pub used: u32,
    /// Inputs up to the last one in use; all if none is.
    pub inputs: usize,
}

impl Plan {
    /// At a sample rate, Hz, with a clock of that many ticks a second.
    ///
    /// # Errors
    ///
    /// [`Problem::Range`] if the converters do not have this rate; the ends are the next ones
    /// they have.
    pub fn new(settings: &Settings<INPUTS>, rate: f64, tick_hz: u32) -> Result<Self, Problem> {
        let Some(oversampling) = Oversampling::of_rate(rate, CLOCK_HZ) else {
            return Err(no_such_rate(rate));
        };
        let mut plan = Self {
            period: (f64::from(tick_hz) / rate) as f32,
            oversampling,
            gains: [Gain::ONE; GAINS],
            used: 0,
            inputs: 0,
        };
        for (input, certificate) in settings.inputs().iter().enumerate() {
            let input_of = certificate.input(0);
            if let Some(gain) = plan.gains.get_mut(input) {
                *gain = Gain::new(input_of.gain).unwrap_or(Gain::ONE);
            }
            if input_of.circuit != Circuit::Unused {
                plan.used |= 1 << (input / CHANNELS).min(CONVERTERS);
                plan.inputs = input + 1;
            }
        }
        if plan.inputs == 0 {
            plan.inputs = INPUTS;
        }
        Ok(plan)
    }
}

fn no_such_rate(found: f64) -> Problem {
    let mut rates = Oversampling::ALL.map(|o| o.rate(CLOCK_HZ));
    rates.reverse();
    let [lowest, .., highest] = rates;
    let low = rates.iter().rfind(|rate| **rate <= found);
    let high = rates.iter().find(|rate| **rate >= found);
    Problem::Range {
        field: Field::SampleRate,
        index: 0,
        found: Exact(found),
        low: Exact(low.copied().unwrap_or(lowest)),
        high: Exact(high.copied().unwrap_or(highest)),
    }
}

/// A start that has failed, in the contract's words.
#[must_use]
pub const fn problem((converter, fault): Failure) -> Problem {
    let fault = match fault {
        Fault::Bus => ConverterFault::Bus,
        Fault::Stuck | Fault::Stale => ConverterFault::Stuck,
        Fault::Checksum => ConverterFault::Checksum,
        Fault::Identity { found, expected } => ConverterFault::Identity { found, expected },
        Fault::Register {
            address,
            found,
            expected,
        } => ConverterFault::Register {
            address,
            found,
            expected,
        },
        Fault::Command { .. } | Fault::Reset | Fault::Resynchronised => ConverterFault::Command,
    };
    Problem::Converter { converter, fault }
}

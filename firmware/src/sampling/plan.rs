//! The plan of a recording, which follows from the settings and a sample rate.

use super::bank::{CHANNELS, rates_near};
use super::{Failure, INPUTS};
use crate::drivers::{Fault, Signal};
use crate::settings::Settings;
use crate::wire::{Circuit, Conditions, ConverterFault, Field, Problem};

/// The plan of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Nominal ticks from sample to sample.
    pub period: f32,
    /// Sample rate, Hz.
    pub rate: f64,
    /// Gain of each input.
    pub gains: [u8; INPUTS],
    /// Bit k: an input of converter k is in use.
    pub used: u32,
    /// Number of inputs up to the last one in use; all of them if none is.
    pub inputs: usize,
    /// Conditions under which they are sampled.
    pub conditions: Conditions,
}

impl Plan {
    /// The plan at a sample rate, Hz, with a clock of `tick_hz` ticks a second.
    ///
    /// # Errors
    ///
    /// [`Problem::Range`] if the converters do not have this rate; its ends are the next rates that
    /// they have.
    pub fn new(settings: &Settings<INPUTS>, rate: f64, tick_hz: u32) -> Result<Self, Problem> {
        let [low, high] = rates_near(rate);
        if low != rate || high != rate {
            return Err(Problem::range(Field::SampleRate, 0, rate, [low, high]));
        }
        let mut plan = Self {
            period: (f64::from(tick_hz) / rate) as f32,
            rate,
            gains: [1; INPUTS],
            used: 0,
            inputs: 0,
            conditions: Conditions::default(),
        };
        let channels = (0..).zip(CHANNELS);
        let converters = channels.flat_map(|(k, channels)| core::iter::repeat_n(k, channels));
        let inputs = settings.inputs().iter().zip(&mut plan.gains);
        for (number, ((certificate, gain), converter)) in (1..).zip(inputs.zip(converters)) {
            let input = certificate.input(0);
            *gain = input.gain;
            if input.circuit != Circuit::Unused {
                plan.used |= 1_u32.wrapping_shl(converter);
                plan.inputs = number;
            }
        }
        if plan.inputs == 0 {
            plan.inputs = INPUTS;
        }
        Ok(plan)
    }

    /// The same under other conditions: with a test signal all inputs are sampled.
    #[must_use]
    pub const fn under(mut self, conditions: Conditions) -> Self {
        self.conditions = conditions;
        if !matches!(conditions.signal, Signal::Pins) {
            self.inputs = INPUTS;
        }
        self
    }
}

/// The problem that reports a failed start to the host.
#[must_use]
pub const fn problem((converter, fault): Failure) -> Problem {
    Problem::Converter {
        converter,
        fault: reported(fault),
    }
}

/// A fault of a converter as the host is told of it.
#[must_use]
pub const fn reported(fault: Fault) -> ConverterFault {
    match fault {
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
        Fault::Command { .. } | Fault::Reset | Fault::Resynchronised | Fault::Unsupported => {
            ConverterFault::Command
        }
    }
}

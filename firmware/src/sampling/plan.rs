//! The plan of a recording, which follows from the settings and a sample rate.

use super::bank::{ALL, CHANNELS, WITH_EDGES, rates_near};
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
    /// Bit k: an input of converter k is in use, so that it has to answer.
    pub used: u32,
    /// Bit k: converter k is read, if it answers. The others are left out.
    pub read: u32,
    /// Number of inputs up to the last one in use; all of them if none is.
    pub inputs: usize,
    /// Conditions under which they are sampled.
    pub conditions: Conditions,
}

impl Plan {
    /// The plan at a sample rate, Hz, under conditions, with a clock of `tick_hz` ticks a second. With a test
    /// signal all inputs are sampled.
    ///
    /// # Errors
    ///
    /// [`Problem::Range`] if the converters that are read do not have this rate; its ends are the next rates
    /// that they have.
    pub fn new(
        settings: &Settings<INPUTS>,
        rate: f64,
        conditions: Conditions,
        tick_hz: u32,
    ) -> Result<Self, Problem> {
        let mut plan = Self {
            period: (f64::from(tick_hz) / rate) as f32,
            rate,
            gains: [1; INPUTS],
            used: 0,
            read: 0,
            inputs: 0,
            conditions,
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
        if plan.used == 0 || !matches!(conditions.signal, Signal::Pins) {
            plan.inputs = INPUTS;
            plan.read = ALL;
        } else if plan.used & WITH_EDGES == 0 {
            // Some edges are needed to sample at.
            plan.read = ALL;
        } else {
            plan.read = plan.used;
        }
        let [low, high] = rates_near(rate, plan.read);
        if low != rate || high != rate {
            return Err(Problem::range(Field::SampleRate, 0, rate, [low, high]));
        }
        Ok(plan)
    }

    /// The bits of the converters with an input in use; those of all where no input is, and where a test signal
    /// is sampled.
    #[must_use]
    pub const fn needed(&self) -> u32 {
        if self.used == 0 || !matches!(self.conditions.signal, Signal::Pins) {
            ALL
        } else {
            self.used
        }
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

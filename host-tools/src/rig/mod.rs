//! The measuring chain on the host: sensors, converters, driver and acquisition of the box,
//! with everything going wrong that does next to a shaker.
//!
//! # Design
//!
//! A simulated recording becomes voltages at the inputs of four converters, which are modelled
//! register by register. The firmware's own driver reads them by SPI, its own acquisition makes
//! samples of what they say, and the core's calibration turns counts into SI with a watch over
//! them. What comes out is a recording as the box would make it: counts of 24 bits, converter
//! noise, the true sample rate, calibrations, and faults in the column `health`.
//!
//! Faults are inflicted where they arise: on the wires, in the chips, at the sensors. What they
//! are called in the recording is what firmware and core found out.

mod chain;
mod inputs;
mod sensors;
mod trouble;

pub use chain::Chain;
use chain::Felt;
pub use inputs::{Inputs, Shaker};
pub use sensors::{Outfit, Upset, Voltages};
pub use trouble::{Trouble, Troubles};

use crate::recording::{Preamble, Traceability};
use crate::sample_rate::SampleRate;
use crate::simulate::{Recording, Simulation, Stream};
use massline_firmware::acquisition::Sample;
use massline_firmware::calibration::Channel;
use massline_firmware::drivers::Signal;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::wire::Health;
use sensors::Sensor;

/// Converters of the box.
pub const CHIPS: usize = 4;
/// Inputs of the box.
pub const INPUTS: usize = CHIPS * CHANNELS;
/// Samples before the recording begins: after a start, filters have to settle.
pub const LEAD: u64 = 8;
/// Messages with samples in a second, each of which tells how far the converters have come.
const MESSAGES: f64 = 8.0;

/// Reason why a recording cannot go through the box.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// More channels than inputs.
    #[error(
        "{found} channels, drive included, do not fit the box's {INPUTS} inputs; take sensors out of the model, or leave out the converters"
    )]
    Inputs {
        /// Channels.
        found: usize,
    },
    /// A rate that the converters do not have.
    #[error(
        "the converters do not sample at {found} Hz, but at 256, 512, 1024 and so on up to 32768 Hz; change `sample_rate` in the model, or leave out the converters"
    )]
    Rate {
        /// The rate, Hz.
        found: f64,
    },
    /// A sensor whose calibration the box refuses.
    #[error(
        "channel `{channel}` cannot be calibrated: its largest reading is {peak}, which no sensor has a range for; change the level of excitation in the model"
    )]
    Sensor {
        /// The channel.
        channel: String,
        /// Its largest reading.
        peak: f64,
    },
    /// A driver that does not come up, which only a wrong model of the chip could cause.
    #[error("converter {number} does not start: {fault}")]
    Start {
        /// Its number.
        number: u8,
        /// Fault of the driver.
        fault: massline_firmware::drivers::Fault,
    },
}

/// Sends all recordings of a simulation through the box. Static poses stay as they are: they
/// are read off one by one.
///
/// # Errors
/// [`RigError`].
pub fn acquire(
    simulation: &mut Simulation,
    troubles: &Troubles,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<(), RigError> {
    let outfit = Outfit::new(&simulation.setup, &simulation.recordings)?;
    let count = simulation.recordings.len();
    for (k, recording) in simulation.recordings.iter_mut().enumerate() {
        progress(k as f64 / count as f64, &recording.file);
        if recording.sample_rate.is_some() {
            let seed = troubles.seed.wrapping_add(k as u64);
            *recording = through(recording, &outfit, troubles, seed)?;
        }
    }
    Ok(())
}

/// A recording under way: rows of SI with their faults.
struct Recorder {
    channels: Vec<Channel>,
    samples: Vec<Vec<f32>>,
    health: Vec<Health>,
    rows: usize,
}

impl Recorder {
    /// Takes the next sample; whether there is room for more.
    fn take(&mut self, sample: &Sample<'_>) -> bool {
        let Some(row) = sample.number.checked_sub(LEAD) else {
            return true;
        };
        let row = row as usize;
        while self.health.len() < row.min(self.rows) {
            self.samples.iter_mut().for_each(|s| s.push(0.0));
            self.health.push(Health::MISSING);
        }
        if row >= self.rows {
            return false;
        }
        let mut all = Health::GOOD;
        let inputs = sample.counts.iter().zip(sample.health);
        let places = self.channels.iter_mut().zip(&mut self.samples);
        for ((channel, samples), (count, known)) in places.zip(inputs) {
            let (si, health) = channel.count(*count, *known);
            samples.push(si);
            all = all.union(health);
        }
        self.health.push(all);
        row + 1 < self.rows
    }
}

/// Gives `take` the samples that a box's converters make of a recording, with the true number of
/// each: the recording begins at sample [`LEAD`]. Ends when `take` wants no more.
///
/// # Errors
/// [`RigError`].
pub fn samples(
    recording: &Recording,
    outfit: &Outfit,
    troubles: &Troubles,
    seed: u64,
    take: &mut dyn FnMut(&Sample<'_>) -> bool,
) -> Result<(), RigError> {
    let rate = recording.sample_rate.unwrap_or(0.0);
    let own = outfit.of(recording);
    let felt = Felt {
        samples: &recording.samples[..],
        rate,
        repeats: false,
    };
    let gains: Vec<u8> = own.iter().map(|s| s.preset.gain).collect();
    let mut chain = Chain::new(&own, (&gains, Signal::Pins), felt, rate, troubles, seed)?;
    while chain.step(|sample| take(sample)) {}
    Ok(())
}

fn through(
    recording: &Recording,
    outfit: &Outfit,
    troubles: &Troubles,
    seed: u64,
) -> Result<Recording, RigError> {
    let rate = recording.sample_rate.unwrap_or(0.0);
    let sensors = outfit.of(recording);
    let mut stream = Stream::new(seed, &["rig", &recording.file]);
    let mut recorder = Recorder {
        channels: sensors
            .iter()
            .map(|s| s.certificate.channel(rate as f32))
            .collect(),
        samples: vec![Vec::new(); sensors.len()],
        health: Vec::new(),
        rows: recording.samples.first().map_or(0, Vec::len),
    };
    let mut clock = SampleRate::default();
    // Crystals keep to 20 parts in a million, this computer's against the converters'.
    let true_rate = rate * (1.0 + 20e-6 * stream.signed());
    let mut next_message = 0;
    samples(recording, outfit, troubles, seed, &mut |sample| {
        if sample.number >= next_message {
            next_message = sample.number + (rate / MESSAGES) as u64;
            // A millisecond of the link's, give or take one.
            let arrival = sample.number as f64 / true_rate + 1e-3 * (1.0 + stream.signed());
            clock.arrival(sample.number, arrival);
        }
        recorder.take(sample)
    })?;
    let traceability = |s: &Sensor| Traceability {
        serial: s.serial.clone(),
        certificate: "simulated".to_owned(),
        calibrated: None,
        uncertainty: None,
    };
    Ok(Recording {
        samples: recorder.samples,
        health: recorder.health,
        preamble: Preamble {
            sample_rate: clock.estimate("host"),
            channel: sensors
                .iter()
                .map(|s| (s.channel.clone(), traceability(s)))
                .collect(),
        },
        ..recording.clone()
    })
}

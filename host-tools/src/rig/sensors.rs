//! Sensors: what is at the converters' inputs, volt by volt.

use super::{INPUTS, RigError};
use crate::setup::Setup;
use crate::simulate::{DRIVE, Recording};
use massline_firmware::calibration::{BRIDGE_SUPPLY_MAX, Certificate, FULL_SCALE_VOLTS, Preset};
use massline_firmware::drivers::ads131m08::CLOCK_HZ;
use massline_firmware::models::random::mix;
use massline_firmware::models::rig::Signal;
use massline_firmware::wire::{Circuit, NAME_MAX};

/// A sensor's range over the largest reading that it has to take.
const HEADROOM: f64 = 1.5;
/// Noise of converter and amplifier, RMS over full scale: some eight counts. The data sheet's
/// table for 512 samples/s has 1 to 4 µV at gain 1.
const NOISE: f64 = 1e-6;

/// A sensor with its calibration.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    pub(super) channel: String,
    pub(super) serial: String,
    pub(super) preset: Preset,
    pub(super) certificate: Certificate,
    /// V per unit.
    sensitivity: f64,
}

/// The sensors of a test, each with its calibration.
#[derive(Clone, Debug)]
pub struct Outfit(Vec<Sensor>);

impl Outfit {
    /// Chooses a sensor for each channel: a bridge for load cells, one with its own amplifier for
    /// accelerometers, a voltage for the drive, with a range that takes what all runs ask of it.
    ///
    /// # Errors
    /// [`RigError::Inputs`], [`RigError::Sensor`].
    pub fn new(setup: &Setup, recordings: &[Recording]) -> Result<Self, RigError> {
        let mut sensors: Vec<Sensor> = Vec::new();
        let is_cell = |name: &str| setup.load_cells.iter().any(|c| c.channel == name);
        for recording in recordings.iter().filter(|r| r.sample_rate.is_some()) {
            if recording.channels.len() > INPUTS {
                return Err(RigError::Inputs {
                    found: recording.channels.len(),
                });
            }
            for (at, name) in recording.channels.iter().enumerate() {
                if !sensors.iter().any(|s| s.channel == *name) {
                    sensors.push(Sensor::new(
                        name,
                        at,
                        is_cell(name),
                        peak(recordings, name),
                    )?);
                }
            }
        }
        Ok(Self(sensors))
    }

    /// Certificates in a box's settings for the inputs of a recording, in their order.
    pub fn certificates(&self, recording: &Recording) -> Vec<Certificate> {
        let own = self.of(recording).into_iter();
        own.map(|s| s.certificate.clone()).collect()
    }

    pub(super) fn of(&self, recording: &Recording) -> Vec<&Sensor> {
        let of = |name: &String| self.0.iter().find(|s| s.channel == *name);
        recording.channels.iter().filter_map(of).collect()
    }
}

impl Sensor {
    /// For a channel at an input, whose largest reading is `peak`.
    fn new(name: &str, at: usize, is_cell: bool, peak: f64) -> Result<Self, RigError> {
        let refused = || RigError::Sensor {
            channel: name.to_owned(),
            peak,
        };
        let range = if peak > 0.0 { HEADROOM * peak } else { 1.0 };
        let preset = if is_cell {
            // Bridges take 120 % of their rated load.
            Preset::bridge(range / 1.2, 2e-3, BRIDGE_SUPPLY_MAX).map_err(|_| refused())?
        } else if name == DRIVE {
            Preset::voltage(Circuit::Voltage, 1.0 / range, range)
        } else {
            Preset::iepe(10.0 / range, 0.1, range)
        };
        let serial: String = format!("SIM-{name}").chars().take(NAME_MAX / 4).collect();
        let input = preset.input(at as u8, &serial, "simulated", None, 0.0);
        let certificate = Certificate::new(&input).map_err(|_| refused())?;
        let counts = f64::from(1_u32 << 23) * f64::from(preset.gain);
        Ok(Self {
            channel: name.to_owned(),
            serial,
            sensitivity: FULL_SCALE_VOLTS / counts / preset.per_count,
            preset,
            certificate,
        })
    }
}

fn peak(recordings: &[Recording], name: &str) -> f64 {
    let mut peak: f32 = 0.0;
    for recording in recordings.iter().filter(|r| r.sample_rate.is_some()) {
        for (channel, samples) in recording.channels.iter().zip(&recording.samples) {
            if channel == name {
                peak = samples.iter().fold(peak, |p, x| p.max(x.abs()));
            }
        }
    }
    f64::from(peak)
}

/// State of a sensor that does not measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Upset {
    /// It is knocked: twice its range on top of what it measures.
    Knock,
    /// Its lead is broken: the input floats to its stop.
    Open,
}

/// Voltages at the inputs, from a recording that tells what the sensors feel.
pub(super) struct Sensors<D> {
    sensors: Vec<(f64, f64)>,
    samples: D,
    /// `true` if the recording begins anew behind its end; else its last sample stays.
    repeats: bool,
    /// Cycles from one sample of the recording to the next.
    period: f64,
    /// Cycle of the recording's first sample.
    origin: u64,
    upset: Option<(usize, Upset, u64)>,
}

impl<D: AsRef<[Vec<f32>]>> Sensors<D> {
    pub(super) fn new(sensors: &[&Sensor], samples: D, period: f64, repeats: bool) -> Self {
        let full_scale = |s: &Sensor| FULL_SCALE_VOLTS / f64::from(s.preset.gain);
        Self {
            sensors: sensors
                .iter()
                .map(|s| (s.sensitivity, full_scale(s)))
                .collect(),
            samples,
            repeats,
            period,
            origin: u64::MAX,
            upset: None,
        }
    }

    /// The recording begins at that cycle.
    pub(super) const fn begin_at(&mut self, cycle: u64) {
        self.origin = cycle;
    }

    /// An input is upset until a cycle.
    pub(super) const fn upset(&mut self, input: usize, upset: Upset, until: u64) {
        self.upset = Some((input, upset, until));
    }

    /// Input of a sensor at a cycle, in its recording's unit. Between samples by the cubic
    /// through the four around (Catmull and Rom): the same filter for all channels, so that
    /// ratios of channels stay what they are when converters restart between two samples.
    fn felt(&self, input: usize, cycle: u64) -> f64 {
        let Some(samples) = self.samples.as_ref().get(input) else {
            return 0.0;
        };
        let Some(since) = cycle.checked_sub(self.origin) else {
            return 0.0;
        };
        let at = since as f64 / self.period;
        let whole = at as usize;
        let f = at - whole as f64;
        let x = |offset: isize| {
            let mut k = whole.saturating_add_signed(offset);
            if self.repeats {
                k %= samples.len().max(1);
            }
            f64::from(*samples.get(k).or(samples.last()).unwrap_or(&0.0))
        };
        if f == 0.0 {
            return x(0);
        }
        let (a, b, c, d) = (x(-1), x(0), x(1), x(2));
        let (p, q) = (2.0 * a - 5.0 * b + 4.0 * c - d, 3.0 * (b - c) + d - a);
        b + 0.5 * f * (c - a + f * (p + f * q))
    }
}

/// Voltages at the inputs while the sensors of a test feel one of its recordings, for a model of the
/// converters that is not [`super::Chain`]'s.
pub struct Voltages(Sensors<Vec<Vec<f32>>>);

impl Voltages {
    /// Those of a recording, whose first channel is at the first input. `None` without a sample rate.
    #[must_use]
    pub fn new(outfit: &Outfit, recording: &Recording) -> Option<Self> {
        let period = f64::from(CLOCK_HZ) / recording.sample_rate?;
        let sensors = outfit.of(recording);
        let samples = recording.samples.clone();
        Some(Self(Sensors::new(&sensors, samples, period, false)))
    }

    /// Begins the recording at this cycle of the converters' clock. Before it nothing moves, behind its
    /// end its last sample stays.
    pub const fn begin_at(&mut self, cycle: u64) {
        self.0.begin_at(cycle);
    }

    /// Upsets an input until a cycle.
    pub const fn upset(&mut self, input: usize, upset: Upset, until: u64) {
        self.0.upset(input, upset, until);
    }

    /// Voltage at an input at a cycle, V; zero where nothing is wired.
    pub fn at(&mut self, input: usize, cycle: u64) -> f64 {
        self.0.volts(input, cycle)
    }
}

impl<D: AsRef<[Vec<f32>]>> Signal for Sensors<D> {
    fn volts(&mut self, input: usize, cycle: u64) -> f64 {
        let Some(&(sensitivity, full_scale)) = self.sensors.get(input) else {
            return 0.0;
        };
        let felt = sensitivity * self.felt(input, cycle);
        // Four uniform numbers of 16 bits: variance 4/12 of their width.
        let bits = mix(cycle.wrapping_mul(64).wrapping_add(input as u64));
        let sum: u64 = (0..4).map(|k| bits >> (16 * k) & 0xFFFF).sum();
        let normal = (sum as f64 / 65536.0 - 2.0) * libm::sqrt(3.0);
        let volts = felt + NOISE * full_scale * normal;
        match self.upset {
            Some((upset, what, until)) if upset == input && cycle < until => match what {
                Upset::Knock => volts + 2.0 * full_scale,
                Upset::Open => 2.0 * full_scale,
            },
            _ => volts,
        }
    }
}

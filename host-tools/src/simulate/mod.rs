//! A model to a test: recordings as the sensors would give them, the setup, and the truth.
//!
//! # Design
//!
//! * **Exact in time.** Signals are synthesised from the frequency responses of the
//!   continuous structure, so that a noise-free recording differs from physics by the
//!   rounding to f32 only. What the identification then misses is its own doing.
//! * **The same on every machine.** No function of the system's mathematics library, no
//!   kernel chosen at run time: a model, a seed and the options give the same bytes.
//! * **Every signal has its own random stream**, named by run and channel. Adding a run
//!   or a sensor leaves the drive and the noise of all others as they were.
//! * **Independent of the identification.** Geometry and mass matrices are derived here
//!   once more instead of taken from the core, so that a sign wrong there cannot cancel.

mod beam;
mod disturb;
mod error;
mod fourier;
mod interface;
mod lumped;
mod model;
mod model_file;
mod random;
mod specimen;
mod synthesis;
#[cfg(test)]
mod tests;
mod truth;
mod write;

use std::collections::BTreeSet;
use std::path::PathBuf;

use massline_firmware::wire::Health;
use nalgebra::{Complex, Matrix6, Vector3, Vector6};

pub use error::{ModelError, SimulationError};
pub use model::{Measurement, Model, MotionSensor, Plan, Resonance, Shaking, Table};
pub(crate) use random::Stream;
pub(crate) use specimen::motion_row;
pub use specimen::{Mode, Specimen};
pub use truth::{Bound, InertiaTruth, ModeTruth, Truth};

use crate::recording::{Form, Preamble};
use crate::setup::{Defaults, Estimation, Excitation, Mount, Run, STANDARD_GRAVITY, Setup};
pub(crate) use interface::mounting;
use interface::{TableMotion, load_paths, rotation_matrix, table_motion};
use specimen::{Gains, stack};
use synthesis::{Drive, DriveResponse, modal_response, table_resonance};

/// Name of the channel that carries the generator's signal.
pub const DRIVE: &str = "drive";
/// Most samples a channel: nine hours at 512 Hz.
pub const MOST_SAMPLES: usize = 1 << 24;
/// Most noise, a share of a channel's RMS: single precision holds what it makes of any signal.
const LOUDEST: f64 = 100.0;

/// Options that replace the model's own measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// White noise on every channel, a share of the channel's RMS over all runs; `None`
    /// as in the model, 0 for none at all.
    pub noise: Option<f64>,
    /// Same seed, same bytes.
    pub seed: u64,
    /// Length of each recording, s; `None` as in the model.
    pub duration: Option<f64>,
    /// Hz; `None` as in the model.
    pub sample_rate: Option<f64>,
    /// `true` if drive signals are recorded; `None` as in the model.
    pub drive: Option<bool>,
    /// `true` if the setup states the mass as weighed.
    pub weighed: bool,
}

impl Default for Options {
    /// Everything as in the model, seed 1, not weighed.
    fn default() -> Self {
        Self {
            noise: None,
            seed: 1,
            duration: None,
            sample_rate: None,
            drive: None,
            weighed: false,
        }
    }
}

impl Options {
    /// Noise of a model under these options, a share of each channel's RMS over all runs.
    #[must_use]
    pub fn noise_of(&self, model: &Model) -> f64 {
        self.noise.unwrap_or(model.measurement.noise)
    }
}

/// Progress of a simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// The run that is being recorded.
    pub run: &'a str,
    /// Channels finished over all runs.
    pub done: usize,
    /// Channels of all runs.
    pub total: usize,
}

/// A simulated test.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Refers to the recordings by file name; its folder is empty until it is read from one.
    pub setup: Setup,
    /// True properties of the specimen.
    pub truth: Truth,
    /// One for each run of the setup, in the same order.
    pub recordings: Vec<Recording>,
}

/// The recording of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// File name in the simulation's folder.
    pub file: String,
    /// Hz; `None` for static poses.
    pub sample_rate: Option<f64>,
    /// Column names.
    pub channels: Vec<String>,
    /// One list a channel, all of one length; m/s², N, N m, and 1 for the drive.
    pub samples: Vec<Vec<f32>>,
    /// Faults of each sample; empty where nothing looked for any.
    pub health: Vec<Health>,
    /// True sample rate and calibrations, for the preamble of the file.
    pub preamble: Preamble,
}

impl Simulation {
    /// RMS of a channel over all random runs.
    pub(crate) fn rms(&self, channel: &str) -> f64 {
        disturb::rms_over_runs(channel, true, &self.recordings)
    }

    /// Adds the instruments' noise and offsets to a simulation that has none.
    ///
    /// # Errors
    /// Options outside their range.
    pub fn disturb(&mut self, model: &Model, options: &Options) -> Result<(), SimulationError> {
        let measurement = measurement(model, options)?;
        disturb::disturb(model, &measurement, options.seed, &mut self.recordings);
        Ok(())
    }
}

/// Simulates all runs of a model.
///
/// # Errors
/// Options outside their range, recordings too short or too long, bands that do not fit
/// the sample rate.
pub fn simulate(
    model: &Model,
    options: &Options,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Simulation, SimulationError> {
    let mut simulation = without_errors(model, options, progress)?;
    simulation.disturb(model, options)?;
    Ok(simulation)
}

/// Simulates all runs of a model by perfect instruments.
///
/// # Errors
/// As [`simulate`].
pub fn without_errors(
    model: &Model,
    options: &Options,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Simulation, SimulationError> {
    let measurement = measurement(model, options)?;
    let samples = sample_count(&measurement)?;
    let paths = load_paths(&model.load_cells, model.table.internal_forces, options.seed);
    let sensors = model.accelerometers.len() + model.load_cells.len();
    let total = sensors * model.runs.len();

    let mut recordings = Vec::with_capacity(model.runs.len());
    let mut files = BTreeSet::new();
    for (index, plan) in model.runs.iter().enumerate() {
        let mut report = |done: usize| {
            progress(Progress {
                run: &plan.name,
                done: index * sensors + done.min(sensors),
                total,
            });
        };
        report(0);
        let carry = mounting(&plan.rotation, &plan.translation);
        let gains = all_gains(model, &carry, &paths);
        let mut channels: Vec<String> = channel_names(model).map(str::to_owned).collect();
        let recorded = match &plan.excitation {
            Shaking::Random {
                motion,
                band,
                drive,
            } => {
                let at_interface = table_motion(&model.table, motion, options.seed);
                let at_specimen = TableMotion {
                    steady: carry * at_interface.steady,
                    resonant: carry * at_interface.resonant,
                };
                let mut responses = Vec::with_capacity(sensors + 1);
                if options.drive.unwrap_or(*drive) {
                    channels.insert(0, DRIVE.to_owned());
                    responses.push(DriveResponse::drive());
                }
                for (on_table, gains) in &gains {
                    let motion = if *on_table {
                        &at_interface
                    } else {
                        &at_specimen
                    };
                    responses.push(DriveResponse::new(gains, &model.specimen, motion));
                }
                let rate = measurement.sample_rate;
                let signal = Drive::new(options.seed, &plan.name, *band, rate, samples)
                    .ok_or_else(|| SimulationError::SilentDrive {
                        run: plan.name.clone(),
                        band: band.unwrap_or_default(),
                        sample_rate: rate,
                    })?;
                let modes = &model.specimen.modes;
                signal.record(
                    &responses,
                    modes,
                    model.table.resonance.as_ref(),
                    &mut report,
                )
            }
            Shaking::Poses(tilts) => gains
                .iter()
                .map(|(on_table, gains)| hold(tilts, gains, *on_table, &carry))
                .collect(),
        };
        report(sensors);
        recordings.push(Recording {
            file: file_name(&plan.name, &mut files),
            sample_rate: matches!(plan.excitation, Shaking::Random { .. })
                .then_some(measurement.sample_rate),
            channels,
            samples: recorded,
            health: Vec::new(),
            preamble: Preamble::default(),
        });
    }
    let truth = Truth::of(model, measurement.sample_rate);
    let setup = setup(model, &measurement, options, &recordings, truth.mass);
    Ok(Simulation {
        setup,
        truth,
        recordings,
    })
}

/// Exact frequency responses of all sensors per unit of drive signal, accelerometers first, at
/// each of `frequencies` (Hz) in the random run number `run`; none of a static run. `seed` is
/// that of [`Options`].
pub(crate) fn responses(
    model: &Model,
    run: usize,
    seed: u64,
    frequencies: &[f64],
) -> Vec<Vec<Complex<f64>>> {
    let Some(plan) = model.runs.get(run) else {
        return Vec::new();
    };
    let Shaking::Random { motion, .. } = &plan.excitation else {
        return Vec::new();
    };
    let paths = load_paths(&model.load_cells, model.table.internal_forces, seed);
    let carry = mounting(&plan.rotation, &plan.translation);
    let at_interface = table_motion(&model.table, motion, seed);
    let at_specimen = TableMotion {
        steady: carry * at_interface.steady,
        resonant: carry * at_interface.resonant,
    };
    let channels: Vec<DriveResponse> = all_gains(model, &carry, &paths)
        .iter()
        .map(|(on_table, gains)| {
            let motion = if *on_table {
                &at_interface
            } else {
                &at_specimen
            };
            DriveResponse::new(gains, &model.specimen, motion)
        })
        .collect();
    let at = |&frequency: &f64| {
        let modes: Vec<Complex<f64>> = model
            .specimen
            .modes
            .iter()
            .map(|mode| modal_response(mode, frequency))
            .collect();
        let table = model.table.resonance.as_ref();
        let resonance = table
            .map(|table| table_resonance(table, frequency))
            .unwrap_or_default();
        channels.iter().map(|c| c.at(resonance, &modes)).collect()
    };
    frequencies.iter().map(at).collect()
}

/// Motion of the specimen in a run: the transform from the motion of the interface's origin to that
/// of the specimen's (its transpose carries resultants back), and the directions in which the
/// interface's origin is accelerated, m/s² and rad/s²: one for a random run, for static poses
/// the specific force of each. Cross-talk that varies with frequency is left out.
pub(crate) fn motions(
    model: &Model,
    run: usize,
    seed: u64,
) -> Option<(Matrix6<f64>, Vec<Vector6<f64>>)> {
    let plan = model.runs.get(run)?;
    let directions = match &plan.excitation {
        Shaking::Random { motion, .. } => vec![table_motion(&model.table, motion, seed).steady],
        Shaking::Poses(tilts) => tilts
            .iter()
            .map(|tilt| {
                let up = rotation_matrix(tilt).transpose() * Vector3::z();
                stack(&(up * STANDARD_GRAVITY), &Vector3::zeros())
            })
            .collect(),
    };
    Some((mounting(&plan.rotation, &plan.translation), directions))
}

/// The model's measurement with the options in place.
fn measurement(model: &Model, options: &Options) -> Result<Measurement, SimulationError> {
    let own = &model.measurement;
    let measurement = Measurement {
        noise: options.noise_of(model),
        duration: options.duration.unwrap_or(own.duration),
        sample_rate: options.sample_rate.unwrap_or(own.sample_rate),
        ..own.clone()
    };
    let more_than_none = (f64::MIN_POSITIVE..=f64::MAX, "a number more than 0");
    for (what, found, (range, expected)) in [
        (
            "the noise",
            measurement.noise,
            (0.0..=LOUDEST, "a share of the RMS, 0 to 100"),
        ),
        ("the duration", measurement.duration, more_than_none.clone()),
        ("the sample rate", measurement.sample_rate, more_than_none),
    ] {
        if !range.contains(&found) {
            return Err(SimulationError::Option {
                what,
                found,
                expected,
            });
        }
    }
    if is_shaken(model) {
        measurement
            .processing()
            .check_bands(measurement.sample_rate)?;
    }
    Ok(measurement)
}

fn is_shaken(model: &Model) -> bool {
    model
        .runs
        .iter()
        .any(|run| matches!(run.excitation, Shaking::Random { .. }))
}

fn sample_count(measurement: &Measurement) -> Result<usize, SimulationError> {
    let Measurement {
        duration,
        sample_rate,
        block_length,
        ..
    } = *measurement;
    let exact = libm::round(duration * sample_rate);
    if exact > MOST_SAMPLES as f64 {
        return Err(SimulationError::TooLong {
            duration,
            sample_rate,
            limit: MOST_SAMPLES,
        });
    }
    let samples = exact as usize;
    if samples < block_length {
        return Err(SimulationError::TooShort {
            duration,
            sample_rate,
            samples,
            block_length,
        });
    }
    Ok(samples)
}

fn channel_names(model: &Model) -> impl Iterator<Item = &str> {
    let motion = model
        .accelerometers
        .iter()
        .map(|sensor| &sensor.entry.channel);
    let force = model.load_cells.iter().map(|cell| &cell.channel);
    motion.chain(force).map(String::as_str)
}

/// Gains of all channels in order; `true` where they act on the table's motion in the
/// interface frame, `false` where on the specimen's in its own.
fn all_gains(
    model: &Model,
    carry: &Matrix6<f64>,
    paths: &nalgebra::DMatrix<f64>,
) -> Vec<(bool, Gains)> {
    let mut gains = Vec::with_capacity(model.accelerometers.len() + model.load_cells.len());
    for sensor in &model.accelerometers {
        let entry = &sensor.entry;
        let (position, direction) = (entry.position.into(), entry.direction.into());
        let on_table = entry.mount == Mount::Interface;
        gains.push((
            on_table,
            Gains {
                rigid: motion_row(&position, &direction),
                modal: if on_table {
                    Vec::new()
                } else {
                    sensor.shape.clone()
                },
            },
        ));
    }
    for row in 0..model.load_cells.len() {
        // p·f at the interface is (T p)·f at the specimen's origin, f_I = Tᵀ f_S.
        let combination = Vector6::from_fn(|axis, _| paths[(row, axis)]);
        gains.push((false, model.specimen.force_gains(&(carry * combination))));
    }
    gains
}

/// Readings of a DC-coupled channel in each pose: load cells and accelerometers feel the
/// specific force, acceleration minus gravity, of the table at rest. Sprung masses stay
/// where they are; their sag moves no reading beyond second order.
fn hold(tilts: &[[f64; 3]], gains: &Gains, on_table: bool, carry: &Matrix6<f64>) -> Vec<f32> {
    tilts
        .iter()
        .map(|tilt| {
            let up = rotation_matrix(tilt).transpose() * Vector3::z();
            let at_interface = stack(&(up * STANDARD_GRAVITY), &Vector3::zeros());
            let felt = if on_table {
                at_interface
            } else {
                carry * at_interface
            };
            gains.rigid.dot(&felt) as f32
        })
        .collect()
}

/// A name that every file system takes: small letters, digits and hyphens, unique.
fn file_name(run: &str, taken: &mut BTreeSet<String>) -> String {
    let words: Vec<String> = run
        .to_lowercase()
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect();
    let stem = if words.is_empty() {
        "run".to_owned()
    } else {
        words.join("-")
    };
    let mut candidate = stem.clone();
    let mut number = 2;
    while !taken.insert(candidate.clone()) {
        candidate = format!("{stem}-{number}");
        number += 1;
    }
    format!("{candidate}.csv")
}

fn setup(
    model: &Model,
    measurement: &Measurement,
    options: &Options,
    recordings: &[Recording],
    mass: f64,
) -> Setup {
    Setup {
        title: model.title.clone(),
        reference_point: model.reference_point,
        known_mass: options.weighed.then_some(mass),
        known_mass_uncertainty: None,
        processing: is_shaken(model).then(|| measurement.processing()),
        estimation: Estimation {
            rigid_up_to: model.measurement.rigid_up_to,
            ..Estimation::default()
        },
        defaults: Defaults::default(),
        accelerometers: model
            .accelerometers
            .iter()
            .map(|sensor| sensor.entry.clone())
            .collect(),
        load_cells: model.load_cells.clone(),
        runs: model
            .runs
            .iter()
            .zip(recordings)
            .map(|(plan, recording)| Run {
                name: plan.name.clone(),
                recording: PathBuf::from(&recording.file),
                checksum: None,
                excitation: match plan.excitation {
                    Shaking::Random { .. } => Excitation::Random,
                    Shaking::Poses(_) => Excitation::Static,
                },
                references: recording
                    .channels
                    .iter()
                    .filter(|channel| *channel == DRIVE)
                    .cloned()
                    .collect(),
                reference_unit: None,
                repeats: None,
                weights: Default::default(),
                rotation: plan.rotation,
                translation: plan.translation,
            })
            .collect(),
        form: Form::default(),
        frame: None,
        folder: PathBuf::new(),
    }
}

//! A model: a specimen, its sensors, the table under it, and the runs of the test.

use std::path::Path;

use serde::{Deserialize, Deserializer};

use super::beam::{BeamModel, ReducedBeam};
use super::error::ModelError;
use super::specimen::Specimen;
use crate::printable::quoted;
use crate::setup::keys::{self, outside};
use crate::setup::{
    AccelerometerEntry, DEFAULT_BLOCK_LENGTH, DEFAULT_OVERLAP, LoadCellEntry, Mount, Processing,
    Quantity, block_length, default_block_length, default_overlap, overlap,
};

/// Everything that is simulated, in SI units.
///
/// The formats it is read from are described in `models/README.md`.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Heading of the setup.
    pub title: String,
    /// Reference point of the setup, m, specimen frame.
    pub reference_point: [f64; 3],
    /// The structure.
    pub specimen: Specimen,
    /// Accelerometers on table and specimen.
    pub accelerometers: Vec<MotionSensor>,
    /// Load cells between table and specimen, in the interface frame.
    pub load_cells: Vec<LoadCellEntry>,
    /// The table and what joins it to the specimen.
    pub table: Table,
    /// Sensors, noise and runs.
    pub measurement: Measurement,
    /// The runs.
    pub runs: Vec<Plan>,
}

/// An accelerometer and how it takes part in the modes.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionSensor {
    /// Channel, place and mount.
    pub entry: AccelerometerEntry,
    /// Its reading of each mode shape (unit modal mass, 1/√kg); zeros on the interface.
    pub shape: Vec<f64>,
}

/// The table under the specimen.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Table {
    /// `true` for each of x, y, z, rx, ry, rz that it can move; cross-talk reaches these only.
    #[serde(deserialize_with = "axes")]
    pub axes: [bool; 6],
    /// Largest entry of the coupling between axes, a share of the driven motion.
    #[serde(deserialize_with = "keys::share")]
    pub cross_talk: f64,
    /// A resonance of the table that makes the coupling vary with frequency.
    pub resonance: Option<Resonance>,
    /// Lever arm that turns an angular acceleration into a linear one for cross-talk, m.
    #[serde(deserialize_with = "keys::positive")]
    pub lever_arm: f64,
    /// The point that the runs' motions are about, m, interface frame.
    #[serde(deserialize_with = "keys::vector")]
    pub reference_point: [f64; 3],
    /// Self-equilibrated forces among the load cells, a share of what they carry.
    #[serde(deserialize_with = "keys::share")]
    pub internal_forces: f64,
}

/// A damped resonance.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Resonance {
    /// Hz.
    #[serde(deserialize_with = "keys::positive")]
    pub frequency: f64,
    /// Share of critical damping.
    #[serde(deserialize_with = "keys::positive")]
    pub damping: f64,
}

/// Recording of a test, and its evaluation in the setup.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Measurement {
    /// Hz.
    #[serde(default = "default_sample_rate", deserialize_with = "keys::positive")]
    pub sample_rate: f64,
    /// Length of each recording, s.
    #[serde(default = "default_duration", deserialize_with = "keys::positive")]
    pub duration: f64,
    /// White noise on every channel, a share of the channel's RMS over all runs.
    #[serde(default, deserialize_with = "keys::share")]
    pub noise: f64,
    /// Largest constant offset of a channel, a share of the same RMS.
    #[serde(default, deserialize_with = "keys::share")]
    pub dc_offset: f64,
    /// Samples of one transform.
    #[serde(default = "default_block_length", deserialize_with = "block_length")]
    pub block_length: usize,
    /// Share of a block that the next one uses again.
    #[serde(default = "default_overlap", deserialize_with = "overlap")]
    pub overlap: f64,
    /// Hz.
    #[serde(deserialize_with = "keys::band")]
    pub averaging_band: [f64; 2],
    /// Hz.
    #[serde(default, deserialize_with = "keys::band")]
    pub mode_band: Option<[f64; 2]>,
    /// Highest frequency at which the setup calls the interface rigid, Hz; it says nothing if `None`.
    #[serde(default, deserialize_with = "keys::positive")]
    pub rigid_up_to: Option<f64>,
}

/// A run before it is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Unique among the runs.
    pub name: String,
    /// Motion of the table.
    pub excitation: Shaking,
    /// Rotation vector in degrees: x_interface = R x_specimen + translation.
    pub rotation: [f64; 3],
    /// The specimen's origin in interface coordinates, m.
    pub translation: [f64; 3],
}

/// Motion of the table in a run.
#[derive(Debug, Clone, PartialEq)]
pub enum Shaking {
    /// White random noise.
    Random {
        /// RMS of the table's reference point along and about x, y, z: m/s², rad/s².
        motion: [f64; 6],
        /// Band of the drive, Hz; without one from 0 to 45 % of the sample rate.
        band: Option<[f64; 2]>,
        /// `true` if the drive signal is recorded as channel `drive`.
        drive: bool,
    },
    /// The table is tilted and held; rotation vectors in degrees that carry the level
    /// table into each pose. Gravity is 9.80665 m/s² along -z of the level table.
    Poses(Vec<[f64; 3]>),
}

impl Plan {
    /// A run of the specimen as its coordinates say it stands.
    pub(crate) fn new(name: impl Into<String>, excitation: Shaking) -> Self {
        Self {
            name: name.into(),
            excitation,
            rotation: [0.0; 3],
            translation: [0.0; 3],
        }
    }
}

impl Shaking {
    /// White noise over the whole band of the drive.
    pub(crate) const fn random(motion: [f64; 6], drive: bool) -> Self {
        Self::Random {
            motion,
            band: None,
            drive,
        }
    }
}

impl Default for Table {
    /// Six free axes, no cross-talk, no internal forces.
    fn default() -> Self {
        Self {
            axes: [true; 6],
            cross_talk: 0.0,
            resonance: None,
            lever_arm: 1.0,
            reference_point: [0.0; 3],
            internal_forces: 0.0,
        }
    }
}

/// Names of the table's axes in the order of the six accelerations.
pub(super) const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

fn axes<'de, D: Deserializer<'de>>(value: D) -> Result<[bool; 6], D::Error> {
    let mut axes = [false; 6];
    for word in keys::texts(value)? {
        let Some(axis) = AXES.iter().position(|axis| *axis == word) else {
            let found = format_args!("a list with \"{}\"", quoted(&word));
            let expected = "some of \"x\", \"y\", \"z\", \"rx\", \"ry\", \"rz\"";
            return Err(outside(found, expected));
        };
        axes[axis] = true;
    }
    Ok(axes)
}

/// Default record length, s: about a hundred blocks at the default rate and overlap.
const DEFAULT_DURATION: f64 = 51.0;
/// Default sample rate, Hz.
const DEFAULT_SAMPLE_RATE: f64 = 512.0;

fn default_sample_rate() -> f64 {
    DEFAULT_SAMPLE_RATE
}

fn default_duration() -> f64 {
    DEFAULT_DURATION
}

impl Measurement {
    /// The setup's section.
    pub(super) fn processing(&self) -> Processing {
        Processing {
            sample_rate: Some(self.sample_rate),
            block_length: self.block_length,
            overlap: self.overlap,
            averaging_band: self.averaging_band,
            mode_band: self.mode_band,
        }
    }
}

impl Model {
    /// A plane beam model from text; `path` names the file in messages.
    ///
    /// The runs are lateral X and Z at 1 m/s² RMS and rotation about Y at 10 rad/s² RMS;
    /// the averaging band reaches up to 80 % of the first fixed-base frequency.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub fn from_json(text: &str, path: &Path) -> Result<Self, ModelError> {
        let beam = BeamModel::from_json(text, path)?;
        let reduced = beam.reduce(path)?;
        Ok(plane_test(&beam, reduced, path))
    }

    /// The numerical twin of a plane tuning fork, 0.63 kg, that the tool carries with it.
    ///
    /// # Errors
    /// None in a released tool: the embedded file is read like any other.
    pub fn fork() -> Result<Self, ModelError> {
        const FORK: &str = include_str!("../../models/tuning-fork.json");
        let mut model = Self::from_json(FORK, Path::new("tuning-fork.json"))?;
        model.title = "Tuning fork".to_owned();
        Ok(model)
    }
}

/// The test of a plane model: every sensor as in the file, three resultants at the base
/// node, one run for each motion of the plane.
fn plane_test(beam: &BeamModel, reduced: ReducedBeam, path: &Path) -> Model {
    let [x, z] = reduced.base;
    let base = [x, 0.0, z];
    let accelerometers = beam
        .sensors
        .iter()
        .zip(reduced.sensors)
        .enumerate()
        .map(|(index, (sensor, (position, shape)))| {
            let mount = if sensor.base_plate {
                Mount::Interface
            } else {
                Mount::Structure
            };
            let channel = format!("a{}", index + 1);
            let entry = AccelerometerEntry::new(channel, position, sensor.direction(), mount);
            MotionSensor { entry, shape }
        })
        .collect();
    let cell = |channel: &str, direction: [f64; 3], quantity| {
        LoadCellEntry::new(channel.to_owned(), base, direction, quantity)
    };
    let run = |name: &str, axis: usize, level: f64| {
        let mut motion = [0.0; 6];
        motion[axis] = level;
        Plan::new(name, Shaking::random(motion, true))
    };
    let measurement = plane_measurement(&reduced.specimen);
    Model {
        title: beam.title.clone().unwrap_or_else(|| {
            path.file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
        }),
        reference_point: [0.0; 3],
        specimen: reduced.specimen,
        accelerometers,
        load_cells: vec![
            cell("fx", [1.0, 0.0, 0.0], Quantity::Force),
            cell("fz", [0.0, 0.0, 1.0], Quantity::Force),
            cell("ty", [0.0, 1.0, 0.0], Quantity::Moment),
        ],
        table: Table {
            axes: [true, false, true, false, true, false],
            reference_point: base,
            ..Table::default()
        },
        measurement,
        runs: vec![
            run("lateral X", 0, 1.0),
            run("lateral Z", 2, 1.0),
            run("rotation Y", 4, 10.0),
        ],
    }
}

/// Rate and bands that suit the first fixed-base frequency: the lines below 80 % of it
/// serve the identification, those from 85 to 150 % show the first modes.
fn plane_measurement(specimen: &Specimen) -> Measurement {
    let first = specimen.modes.first().map_or(32.0, |mode| mode.frequency);
    // 512 Hz as it stands for first frequencies from 26 to 51 Hz, else an octave that
    // keeps the sixteenfold distance.
    let octave = libm::round(libm::log2(first / 36.0));
    let sample_rate = DEFAULT_SAMPLE_RATE * libm::exp2(octave);
    let line = sample_rate / DEFAULT_BLOCK_LENGTH as f64;
    let to_line = |frequency: f64| libm::round(frequency / line) * line;
    Measurement {
        sample_rate,
        duration: DEFAULT_DURATION * DEFAULT_SAMPLE_RATE / sample_rate,
        noise: 0.0,
        dc_offset: 0.0,
        block_length: DEFAULT_BLOCK_LENGTH,
        overlap: DEFAULT_OVERLAP,
        averaging_band: [line, to_line(0.8 * first)],
        mode_band: Some([to_line(0.85 * first), to_line(1.5 * first)]),
        // The model's table is rigid; the drive ends at 40 % of the rate.
        rigid_up_to: Some(to_line((6.0 * first).min(0.39 * sample_rate))),
    }
}

//! The set-up in pieces, each of which fits a frame.

use super::Packed;
use massline_core::geometry::{Mount, Quantity};
use massline_core::spectra::{LineGrid, Window};
use serde::{Deserialize, Serialize};

/// Largest length of a name in UTF-8, bytes.
pub const NAME_MAX: usize = 32;

/// Size and reference point of a set-up.
///
/// Coordinates are those of the set-up file: the frame of the table, and the frame of the specimen
/// for accelerometers on it. The box passes all numbers to the core unchanged, so that a host which
/// sends the numbers of its own computation gets the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Number of sensors: accelerometers and load cells, without the drive.
    pub sensors: u8,
    /// Number of runs.
    pub runs: u8,
    /// The reference point A, m.
    pub reference_point: [f64; 3],
    /// Identifier of this set-up, chosen by the host. The box returns it in [`super::Status`], so
    /// that a host that reconnects can tell if the stored runs belong to its set-up.
    pub fingerprint: u32,
}

/// Settings of the spectral analysis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Processing {
    /// Sample rate in Hz.
    pub sample_rate: f64,
    /// Samples per block, a power of two.
    pub block_length: u32,
    /// Overlap of consecutive blocks as a share of the block length.
    pub overlap: f64,
    /// Window of each block.
    pub window: Window,
    /// Lowest and highest frequency of the lines that are kept, Hz.
    pub kept_band: [f64; 2],
    /// Lowest and highest frequency of the averaging band, Hz.
    pub averaging_band: [f64; 2],
    /// Lowest and highest frequency of the band in which a survey measures the first elastic
    /// modes, Hz.
    pub mode_band: Option<[f64; 2]>,
    /// Accelerometers that give the base acceleration of a measuring pass.
    pub accelerations: Accelerations,
    /// Source of the weights.
    pub weighting: Weighting,
    /// Weight of the sensor with the largest amplitude in the mode band; the sensor with the
    /// smallest amplitude has weight one.
    pub minimum_weight: f64,
}

/// Source of the weights of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Weighting {
    /// The host sends the weights; surveys do not change them.
    Given,
    /// Each run's weights follow from its own survey.
    EachRun,
    /// All runs have the same weights, which follow from all surveys so far.
    Joined,
}

/// Accelerometers that give the base acceleration, equation (4).
///
/// Samples are mapped to resultants on arrival, so that the choice is fixed for a stored run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Accelerations {
    /// Accelerometers on the interface, for the apparent mass.
    Interface,
    /// All accelerometers, each with weight one.
    All,
    /// All accelerometers, with the weights of the run.
    Weighted,
}

/// One accelerometer or load cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensor<'a> {
    /// Number of the sensor, from zero, below [`Plan::sensors`].
    pub sensor: u8,
    /// Name of its channel, at most [`NAME_MAX`] bytes.
    pub name: &'a str,
    /// Measured quantity.
    pub kind: SensorKind,
    /// Position in m.
    pub position: [f64; 3],
    /// Positive axis, of any length but zero; a load cell's axis is that of the load on the
    /// structure.
    pub direction: [f64; 3],
    /// Conversion of its readings to SI.
    pub scale: ScaleSource,
}

/// Measured quantity of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SensorKind {
    /// Acceleration along the direction.
    Accelerometer(Mount),
    /// Load along or about the direction.
    LoadCell(Quantity),
}

/// Source of the conversion of a sensor's readings, which are counts or in the unit of a recording,
/// to SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ScaleSource {
    /// `SI = per_unit * (reading - offset)`.
    Given {
        /// Sensitivity in m/s², N or N m per unit of the reading.
        per_unit: f64,
        /// Reading at zero.
        offset: f64,
    },
    /// The box uses its stored calibration of the input that the sensor is wired to: channel k of
    /// a sample is input k.
    Stored,
}

/// One run: the placement of the specimen and the roles of the channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run<'a> {
    /// Number of the run, from zero, below [`Plan::runs`].
    pub run: u8,
    /// Name of the run, at most [`NAME_MAX`] bytes.
    pub name: &'a str,
    /// Kind of excitation.
    pub excitation: Excitation,
    /// Rotation vector from specimen to interface coordinates, degrees.
    pub rotation: [f64; 3],
    /// Translation from specimen to interface coordinates, m.
    pub translation: [f64; 3],
    /// Codes of the [`ChannelRole`] of each channel, in the order of a sample.
    pub channels: &'a [u8],
}

impl<'a> Run<'a> {
    /// Roles of the channels of a sample, in the samples' order.
    pub fn channel_roles(&self) -> impl Iterator<Item = ChannelRole> + use<'a> {
        self.channels
            .iter()
            .map(|&code| ChannelRole::from_code(code))
    }

    /// Channel of the generator's drive signal; `None` without one.
    #[must_use]
    pub fn drive(&self) -> Option<usize> {
        self.channel_roles().position(|c| c == ChannelRole::Drive)
    }
}

/// Role of one channel of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelRole {
    /// The channel is that of the sensor of this number, below 254.
    Sensor(u8),
    /// The channel is the generator's drive signal.
    Drive,
    /// The channel is not used.
    Unused,
}

impl ChannelRole {
    /// Code of the role, one byte: a sensor's number, 254 for the drive, 255 for an unused channel.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Sensor(number) => number,
            Self::Drive => 254,
            Self::Unused => 255,
        }
    }

    /// Role of a code.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code {
            254 => Self::Drive,
            255 => Self::Unused,
            number => Self::Sensor(number),
        }
    }
}

/// Kind of excitation of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Excitation {
    /// Random excitation, recorded as time samples.
    Random,
    /// Stepped sine, recorded as frequency responses.
    Sine,
    /// Static poses, recorded as one DC-coupled sample each.
    Static,
}

/// Weights of the accelerometers in one run. The default is one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights<'a> {
    /// The run.
    pub run: u8,
    /// One weight for each sensor, by its number; the weight of a load cell is ignored.
    #[serde(borrow)]
    pub weights: Packed<'a, f64>,
}

/// The lines that follow from a set-up. The host compares them with its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The kept lines.
    pub lines: LineGrid,
    /// Number of samples from the start of one block to the start of the next.
    pub hop: u32,
    /// The averaging band: its first kept line, and the first kept line after it.
    pub band: [u32; 2],
}

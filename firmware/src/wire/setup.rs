//! The set-up in pieces, each of which fits a frame.

use super::{Exact, Packed};
use serde::{Deserialize, Serialize};

/// Most bytes of a name, UTF-8.
pub const NAME_MAX: usize = 32;

/// What a set-up consists of.
///
/// Coordinates and rules are those of the set-up file: the frame of the table, and that
/// of the specimen for accelerometers on it. The box hands all numbers to its core as
/// they come, so a host that wants equal bits sends what it gives its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Number of sensors: accelerometers and load cells, without the drive.
    pub sensors: u8,
    /// Number of runs.
    pub runs: u8,
    /// The reference point A, m.
    pub reference_point: [f64; 3],
    /// The host's own mark of this set-up. The box only echoes it in [`super::Status`],
    /// so that a host that comes back knows whether the stored runs are of its set-up.
    pub fingerprint: u32,
}

/// How samples become lines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Processing {
    /// Hz.
    pub sample_rate: f64,
    /// Samples per block, a power of two.
    pub block_length: u32,
    /// Share of a block that the next one uses again.
    pub overlap: f64,
    /// The window of each block.
    pub window: Window,
    /// Lowest and highest frequency of the lines that are kept, Hz.
    pub kept_band: [f64; 2],
    /// Lowest and highest frequency of the averaging band, Hz.
    pub averaging_band: [f64; 2],
    /// Where a survey looks for the first elastic modes, Hz.
    pub mode_band: Option<[f64; 2]>,
    /// Which accelerometers give the base acceleration of a measuring pass.
    pub accelerations: Accelerations,
    /// Where the weights come from.
    pub weighting: Weighting,
    /// Weight of the sensor that moves most in the mode band; the one that moves least
    /// has weight one.
    pub minimum_weight: f64,
}

/// Where the weights of a run come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Weighting {
    /// The host sends them; surveys leave them alone.
    Given,
    /// From the survey of the same run.
    EachRun,
    /// From all surveys so far, the same for all runs.
    Joined,
}

/// The window of each block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Window {
    /// None.
    Rectangular,
    /// Hann's.
    Hann,
    /// Hamming's.
    Hamming,
    /// Blackman's.
    Blackman,
    /// Blackman and Harris's.
    BlackmanHarris,
    /// Flat top.
    FlatTop,
}

/// Which accelerometers give the base acceleration, equation (4).
///
/// Samples are mapped to resultants as they come, so a stored run keeps the choice that
/// held when it was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Accelerations {
    /// Those on the interface, for the apparent mass.
    Interface,
    /// All of them, each with weight one.
    All,
    /// All of them, with the run's weights.
    Weighted,
}

/// One accelerometer or load cell. Its direction need not be of unit length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensor<'a> {
    /// Its number, from zero, below [`Plan::sensors`].
    pub sensor: u8,
    /// Its channel's name, at most [`NAME_MAX`] bytes.
    pub name: &'a str,
    /// What it measures.
    pub kind: SensorKind,
    /// m.
    pub position: [f64; 3],
    /// Positive axis; for a load cell, of what acts on the structure.
    pub direction: [f64; 3],
    /// From readings to SI.
    pub scale: Scale,
}

/// What a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SensorKind {
    /// Acceleration along the direction.
    Accelerometer(Mount),
    /// Load along or about the direction.
    LoadCell(Quantity),
}

/// What an accelerometer is glued to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mount {
    /// The table or its adapter.
    Interface,
    /// The specimen.
    Structure,
}

/// What a load cell measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quantity {
    /// A force, N.
    Force,
    /// A moment, N m.
    Moment,
}

/// From readings, which are counts or a recording's own unit, to SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Scale {
    /// `SI = per_unit * (reading - offset)`.
    Given {
        /// m/s², N or N m per unit of the reading.
        per_unit: f64,
        /// The reading at zero.
        offset: f64,
    },
    /// The calibration stored in the box's settings for the input that this sensor is
    /// wired to: channel k of a sample is input k.
    Stored,
}

/// One run: how the specimen stands, and what the samples' channels carry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run<'a> {
    /// Its number, from zero, below [`Plan::runs`].
    pub run: u8,
    /// At most [`NAME_MAX`] bytes.
    pub name: &'a str,
    /// What is recorded.
    pub excitation: Excitation,
    /// Rotation vector from specimen to interface coordinates, degrees.
    pub rotation: [f64; 3],
    /// Shift from specimen to interface coordinates, m.
    pub translation: [f64; 3],
    /// What each channel of a sample carries, in the samples' order: codes of [`ChannelRole`].
    pub channels: &'a [u8],
}

impl<'a> Run<'a> {
    /// Roles of the channels of a sample, in the samples' order.
    pub fn channel_roles(&self) -> impl Iterator<Item = ChannelRole> + use<'a> {
        self.channels
            .iter()
            .map(|&code| ChannelRole::from_code(code))
    }

    /// The channel of the generator's drive signal, if there is one.
    #[must_use]
    pub fn drive(&self) -> Option<usize> {
        self.channel_roles().position(|c| c == ChannelRole::Drive)
    }
}

/// Role of one channel of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelRole {
    /// The sensor of this number, below 254.
    Sensor(u8),
    /// The generator's drive signal.
    Drive,
    /// The channel is not used.
    Unused,
}

impl ChannelRole {
    /// As one byte: a sensor's number, 254 for the drive, 255 for an unused channel.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Sensor(number) => number,
            Self::Drive => 254,
            Self::Unused => 255,
        }
    }

    /// The other way round.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code {
            254 => Self::Drive,
            255 => Self::Unused,
            number => Self::Sensor(number),
        }
    }
}

/// What a run records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Excitation {
    /// Time samples under random excitation.
    Random,
    /// Frequency responses of a stepped sine.
    Sine,
    /// One pose a sample, DC-coupled.
    Static,
}

/// Weights of the accelerometers in one run. Those that are never sent are one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights<'a> {
    /// The run.
    pub run: u8,
    /// One for each sensor, by its number; what stands at a load cell is not read.
    #[serde(borrow)]
    pub weights: Packed<'a, f64>,
}

/// The lines that follow from a set-up. The host compares them with its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grid {
    /// Index of the first kept line; line 0 is the mean.
    pub first: u32,
    /// Number of kept lines.
    pub count: u32,
    /// Distance of neighbouring lines, Hz.
    pub spacing: Exact<f64>,
    /// Samples from one block's start to the next one's.
    pub hop: u32,
    /// The averaging band: first kept line in it, and the first one after it.
    pub band: [u32; 2],
}

//! A run: samples, blocks and lines.

use super::packed::Word;
use super::{Count24, Health, PAYLOAD_MAX, Packed};
use massline_core::geometry::RESULTANTS;
use serde::{Deserialize, Serialize};

/// Start of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// Number of the run in the set-up.
    pub run: u8,
    /// Purpose of the run.
    pub pass: Pass,
    /// Source of the samples.
    pub source: Source,
    /// Treatment of samples that are missing from [`super::Request::Samples`].
    pub gaps: Gaps,
    /// Number of samples after which the run ends by itself, with [`super::Event::RunEnded`], even
    /// if the host is disconnected by then.
    pub limit: Option<u64>,
}

/// Purpose of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pass {
    /// The run measures the amplitude of each accelerometer near the first elastic modes, from
    /// which weights follow as [`super::Weighting`] says. No lines are stored.
    Survey,
    /// The run measures lines, which replace the stored run of the same number.
    Measure,
}

/// Source of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Source {
    /// The host sends the samples.
    Host,
    /// The box's own converters give the samples.
    Inputs,
    /// The box computes the samples of a body of known properties.
    Synthetic,
}

/// Treatment of missing samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Gaps {
    /// Samples beyond a gap are refused with [`super::Problem::Gap`], and the host sends again from
    /// the sample that is expected. This suits a replay over a link that loses frames.
    Refuse,
    /// Missing samples are counted, the block that lacks them is rejected, and the next block
    /// begins behind the gap. This suits a source that has really lost them. A gap of any length is
    /// one rejected block; a gap up to the limit of the run ends the run.
    Count,
}

/// Consecutive samples of all channels.
///
/// Samples that the box already has are skipped, so that a request may be repeated. The index of
/// the first sample may be any: one that is ahead makes a gap, which is treated as [`Gaps`] says,
/// even if the message holds no sample. Only a last index beyond 2⁶⁴ - 1 is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Samples<'a> {
    /// Index of the first sample; the first of a run is 0.
    pub first: u64,
    /// Number of channels of a sample.
    pub channels: u8,
    /// Values of all channels, sample by sample.
    #[serde(borrow)]
    pub values: Values<'a>,
}

impl Samples<'_> {
    /// Number of samples; `None` without channels, or if the last sample is incomplete.
    #[must_use]
    pub fn count(&self) -> Option<usize> {
        let (values, channels) = (self.values.len(), usize::from(self.channels));
        match values.checked_rem(channels)? {
            0 => values.checked_div(channels),
            _ => None,
        }
    }

    /// Number of samples of `channels` values that fit a frame. A value has 4 `bytes` if it is a
    /// reading or a count, and 3 if it is a count of 24 bits.
    #[must_use]
    pub const fn fit(channels: u8, bytes: usize) -> usize {
        match (PAYLOAD_MAX - BEFORE).checked_div((channels as usize).saturating_mul(bytes)) {
            Some(samples) => samples,
            None => 0,
        }
    }
}

/// Consecutive samples of the box's own converters, some of whose inputs are faulty.
///
/// Each message has the faults of its own samples, so that a lost frame leaves no doubt about
/// others. The faults are those that the driver of the converters has found. Faults that follow
/// from the counts themselves (overload, an open lead, a reading that does not change) are found by
/// the host with [`crate::calibration::Channel`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultySamples<'a> {
    /// Bits of [`Health`] for each channel, the same for all samples of the message.
    #[serde(borrow)]
    pub health: Packed<'a, u16>,
    /// The samples. Values of faulty channels are invalid.
    #[serde(borrow)]
    pub samples: Samples<'a>,
}

impl FaultySamples<'_> {
    /// Number of bytes of values that fit a frame beside the faults of 64 channels.
    pub const FIT: usize = PAYLOAD_MAX - (2 + 2 * 64) - BEFORE;
}

/// Largest number of bytes of [`Samples`] before the values: the index takes up to ten, channels
/// and kind one each, the length two.
const BEFORE: usize = 10 + 1 + 1 + 2;

/// Values of samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values<'a> {
    /// Readings in the unit of the recording, which is SI if the scale is one.
    Readings(#[serde(borrow)] Packed<'a, f32>),
    /// Raw counts.
    Counts(#[serde(borrow)] Packed<'a, i32>),
    /// Raw counts of 24 bits, three bytes each.
    Counts24(#[serde(borrow)] Packed<'a, Count24>),
}

impl Values<'_> {
    /// Number of values.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::Readings(list) => list.len(),
            Self::Counts(list) => list.len(),
            Self::Counts24(list) => list.len(),
        }
    }

    /// `true` if there are no values.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// Index of the next sample.
    pub next: u64,
    /// Number of missing samples so far in this run.
    pub missing: u64,
}

/// A complete block.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Block {
    /// Number of the run.
    pub run: u8,
    /// Purpose of the run.
    pub pass: Pass,
    /// Number of the block in this run, from zero, rejected blocks included.
    pub block: u32,
    /// Index of the first sample of the block.
    pub first: u64,
    /// Faults for which the block was rejected; empty if it entered the average.
    pub health: Health,
    /// Number of blocks in the average.
    pub averaged: u32,
    /// Coherence of each resultant with the drive so far, mean over the averaging band; `None`
    /// without a drive or with fewer than two blocks.
    pub coherence: Option<[f32; RESULTANTS]>,
    /// Computing time of the block, ticks of [`super::Info::tick_hz`].
    pub ticks: u32,
}

/// Reason of the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// The host stopped the run.
    Stopped,
    /// The run has reached its limit of samples.
    Limit,
    /// A fault of the box ended the run; the average until then is stored.
    Fault,
}

/// Summary of a finished run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of the run.
    pub run: u8,
    /// Purpose of the run.
    pub pass: Pass,
    /// Source of the samples.
    pub source: Source,
    /// Reason of its end.
    pub outcome: Outcome,
    /// Number of samples received.
    pub samples: u64,
    /// Number of missing samples.
    pub missing: u64,
    /// Number of averaged blocks.
    pub blocks: u32,
    /// Number of rejected blocks.
    pub rejected: u32,
    /// Number of blocks rejected for each fault, by the bits of [`Health`]; a block with two faults
    /// counts twice.
    pub rejected_by: [u32; Health::KINDS],
    /// Union of the faults for which blocks were rejected.
    pub health: Health,
    /// Number of samples with an overload in any channel.
    pub overloads: u64,
    /// Sample rate by the clock of the box, Hz; `None` if the samples are not those of its
    /// converters.
    pub sample_rate: Option<f64>,
    /// Noise power of each resultant, which is its power per line that is not coherent with the
    /// drive; `None` without a drive or lines.
    pub noise: Option<[f32; RESULTANTS]>,
}

/// Request for lines of a stored run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadLines {
    /// Number of the run.
    pub run: u8,
    /// Index of the first requested line among the kept lines.
    pub first: u16,
    /// Number of requested lines. The reply holds at most [`Lines::FIT`] of them.
    pub count: u16,
}

/// Lines of a stored run, referred to its drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lines<'a> {
    /// Number of the run.
    pub run: u8,
    /// Index of the first of these lines among the kept lines.
    pub first: u16,
    /// The lines.
    #[serde(borrow)]
    pub lines: Packed<'a, Line>,
}

impl Lines<'_> {
    /// Number of lines that fit a frame.
    pub const FIT: usize = (PAYLOAD_MAX - 6) / Line::SIZE;
}

/// One line of a stored run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// Power of the drive G_rr, in its unit squared, summed over the blocks.
    pub drive: f32,
    /// Real and imaginary part of the response of each resultant to the drive: m/s² and rad/s², then N and N m, each
    /// per unit of the drive, at the reference point.
    pub responses: [[f32; 2]; RESULTANTS],
}

impl Word for Line {
    const SIZE: usize = 4 + 8 * RESULTANTS;
    type Bytes = [u8; Self::SIZE];

    fn to_bytes(self) -> Self::Bytes {
        let mut bytes = [0; Self::SIZE];
        let numbers = core::iter::once(self.drive).chain(self.responses.into_iter().flatten());
        let (slots, _) = bytes.as_chunks_mut::<4>();
        for (slot, number) in slots.iter_mut().zip(numbers) {
            *slot = number.to_le_bytes();
        }
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let number = |i: usize| f32::from_bytes(bytes.get(4 * i..)?);
        let mut line = Self {
            drive: number(0)?,
            ..Self::default()
        };
        for (c, response) in line.responses.iter_mut().enumerate() {
            *response = [number(1 + 2 * c)?, number(2 + 2 * c)?];
        }
        Some(line)
    }
}

/// Result of a survey.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Peaks<'a> {
    /// Number of the run.
    pub run: u8,
    /// Largest amplitude of each sensor in the mode band, by its number, per unit of drive if there
    /// is a drive; zero for a load cell.
    #[serde(borrow)]
    pub peaks: Packed<'a, f64>,
}

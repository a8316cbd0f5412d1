//! A run: samples in, blocks and lines out.

use super::packed::Word;
use super::{Count24, Health, PAYLOAD_MAX, Packed};
use massline_core::geometry::RESULTANTS;
use serde::{Deserialize, Serialize};

/// Starts a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// The run, by its number in the set-up.
    pub run: u8,
    /// What for.
    pub pass: Pass,
    /// Where the samples come from.
    pub source: Source,
    /// What the box does about samples that are missing from [`super::Request::Samples`].
    pub gaps: Gaps,
    /// Samples after which the run ends by itself, with [`super::Event::RunEnded`]: also
    /// if the host is gone by then.
    pub limit: Option<u64>,
}

/// What a run is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pass {
    /// To see how far each accelerometer moves near the first elastic modes, and to set
    /// weights by that as [`super::Weighting`] says. No lines are stored.
    Survey,
    /// To measure. Replaces the stored run of that number.
    Measure,
}

/// Where samples come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Source {
    /// From the host.
    Host,
    /// From the box's own converters.
    Inputs,
    /// From a body of known properties that the box computes.
    Synthetic,
}

/// What becomes of samples that are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Gaps {
    /// Samples beyond a gap are refused with [`super::Problem::Gap`], and the host sends
    /// again from the sample that is expected: a replay over a link that loses frames.
    Refuse,
    /// Missing samples are counted, the block they are missing from is rejected, and the
    /// next block begins behind the gap: a source that has really lost them. A gap of any
    /// length is one rejected block; one that goes on to the run's limit ends the run.
    Count,
}

/// Consecutive samples of all channels.
///
/// Samples that the box already has are skipped, so that a request may be repeated. The number
/// of the first one may be any: one that is ahead is a gap, which [`Gaps`] says what to do
/// about, also where the message holds no sample. Only a last number beyond 2⁶⁴ - 1 is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Samples<'a> {
    /// Index of the first sample; a run's first is 0.
    pub first: u64,
    /// Channels of a sample.
    pub channels: u8,
    /// Sample after sample, all channels each.
    #[serde(borrow)]
    pub values: Values<'a>,
}

impl Samples<'_> {
    /// Number of samples; `None` if there are no channels or the last sample is not whole.
    #[must_use]
    pub fn count(&self) -> Option<usize> {
        let (values, channels) = (self.values.len(), usize::from(self.channels));
        match values.checked_rem(channels)? {
            0 => values.checked_div(channels),
            _ => None,
        }
    }

    /// How many samples of `channels` values, `bytes` each, fit a frame: 4 for readings
    /// and counts, 3 for counts of 24 bits.
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
/// Such a message holds for itself alone: faults stand beside the samples they are faults
/// of, so that a frame that is lost takes its own samples along and leaves no doubt about
/// others. These are the faults that the converters' driver has found. What the counts
/// themselves tell of a sensor (overload, an open lead, a reading that stands still) is for
/// the host to see, as [`crate::calibration::Channel`] does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultySamples<'a> {
    /// Bits of [`Health`] for each channel, the same for all these samples.
    #[serde(borrow)]
    pub health: Packed<'a, u16>,
    /// The samples. What a faulty channel reads is not to be believed.
    #[serde(borrow)]
    pub samples: Samples<'a>,
}

impl FaultySamples<'_> {
    /// Bytes of values that fit a frame, beside the faults of 64 channels.
    pub const FIT: usize = PAYLOAD_MAX - (2 + 2 * 64) - BEFORE;
}

/// Bytes of [`Samples`] before the values: the index takes up to ten, channels and kind one
/// each, the length two.
const BEFORE: usize = 10 + 1 + 1 + 2;

/// Values of samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values<'a> {
    /// Readings in the recording's unit, SI where the scale is one.
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

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// How far the box has come with the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// Index of the sample that is expected next.
    pub next: u64,
    /// Samples that were missing so far in this run.
    pub missing: u64,
}

/// One block is complete.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Block {
    /// The run.
    pub run: u8,
    /// What the run is for.
    pub pass: Pass,
    /// Number of the block in this run, from zero; rejected ones have a number too.
    pub block: u32,
    /// Index of its first sample.
    pub first: u64,
    /// Why it was rejected; good if it went into the average.
    pub health: Health,
    /// Blocks in the average.
    pub averaged: u32,
    /// Coherence of each resultant with the drive so far, mean over the averaging band;
    /// where there is a drive, and two blocks or more.
    pub coherence: Option<[f32; RESULTANTS]>,
    /// Ticks of [`super::Info::tick_hz`] that the block took to compute.
    pub ticks: u32,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// The host stopped it.
    Stopped,
    /// It had all the samples it was started for.
    Limit,
    /// A fault of the box ended it; what was averaged until then is kept.
    Fault,
}

/// A finished run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The run.
    pub run: u8,
    /// What it was for.
    pub pass: Pass,
    /// Where the samples came from.
    pub source: Source,
    /// Why it ended.
    pub outcome: Outcome,
    /// Samples taken.
    pub samples: u64,
    /// Samples that were missing.
    pub missing: u64,
    /// Blocks averaged.
    pub blocks: u32,
    /// Blocks rejected.
    pub rejected: u32,
    /// Blocks rejected for each fault, by the bits of [`Health`]; a block with two faults
    /// counts twice.
    pub rejected_by: [u32; Health::KINDS],
    /// Every fault that a block was rejected for.
    pub health: Health,
    /// Samples with an overload in any channel.
    pub overloads: u64,
    /// True sample rate by the box's clock, Hz; `None` if the samples came from elsewhere.
    pub sample_rate: Option<f64>,
    /// Power per line that does not come from the drive, of each resultant; `None`
    /// without a drive or lines.
    pub noise: Option<[f32; RESULTANTS]>,
}

/// Asks for lines of a stored run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadLines {
    /// The run.
    pub run: u8,
    /// First line wanted, by its place among the kept ones.
    pub first: u16,
    /// Number of lines wanted. The reply holds at most [`Lines::FIT`] of them.
    pub count: u16,
}

/// Lines of a stored run that was referred to its drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lines<'a> {
    /// The run.
    pub run: u8,
    /// The first of these lines, by its place among the kept ones.
    pub first: u16,
    /// The lines.
    #[serde(borrow)]
    pub lines: Packed<'a, Line>,
}

impl Lines<'_> {
    /// Lines that fit a frame.
    pub const FIT: usize = (PAYLOAD_MAX - 6) / Line::SIZE;
}

/// One line of a stored run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// G_rr, summed over the blocks.
    pub drive: f32,
    /// Real and imaginary part of each resultant's response to the drive.
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

/// What a survey found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Peaks<'a> {
    /// The run.
    pub run: u8,
    /// Largest amplitude in the mode band of each sensor, by its number, per unit of
    /// drive where there is one; zero at a load cell.
    #[serde(borrow)]
    pub peaks: Packed<'a, f64>,
}

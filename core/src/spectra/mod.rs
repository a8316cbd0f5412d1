//! Welch averaging in fixed memory: samples in, averaged spectra of a band of lines out.
//!
//! Data runs one way: [`Blocks`] cuts overlapping blocks out of the stream and
//! transforms them, an average ([`DriveAverage`] or [`CrossAverage`]) sums their
//! products, and [`RunResponses`] or the cross-spectral matrix itself is what the
//! estimators read. All bulk storage is lent by the caller: statics on a chip, vectors
//! on a workstation.
//!
//! Spectra are `f32`; running sums carry their rounding error along ([`Sum`]), so that
//! a four-hour recording is averaged as exactly as a short one.

mod band;
mod blocks;
mod cross;
mod decimate;
mod drive;
mod fft;
mod half_band;
mod history;
mod lane;
mod settings;
mod sum;
mod wide;
mod window;

pub(crate) use band::listed;
pub use band::{BandError, LineRange};
pub use blocks::{BlockSpectra, Blocks};
pub use cross::{CrossAverage, CrossSums};
pub use drive::{DriveAverage, RunResponses};
pub(crate) use fft::MAX_BLOCK_LENGTH;
pub use history::Rings;
pub use settings::BlockSettings;
pub use sum::Sum;
pub use window::Window;

/// A complex number in single precision.
pub type Complex32 = nalgebra::Complex<f32>;

/// Reason why spectral settings or storage are unusable.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SpectraError {
    /// The block length is not a power of two in 16 to 1024, or to 32768 with the feature
    /// `long-blocks`.
    BlockLength(usize),
    /// The sample rate is not above zero, not finite, or too small to divide, Hz.
    SampleRate(f64),
    /// The overlap is outside 0 to 0.95.
    Overlap(f64),
    /// The band of lines reaches outside the spectrum; the last usable line is given.
    Band {
        /// First line asked for.
        first: usize,
        /// Last line asked for.
        last: usize,
        /// Last line that the block length offers to this window.
        usable: usize,
    },
    /// The ends of the band (Hz) are not finite, negative, or not in order.
    BandEnds([f64; 2]),
    /// A band was chosen from other lines than these.
    OtherLines {
        /// Number of lines it was chosen from.
        band: usize,
        /// Number of lines there are.
        lines: usize,
    },
    /// Lent storage is too small.
    Storage {
        /// Elements needed.
        needed: usize,
        /// Elements given.
        given: usize,
    },
}

impl core::fmt::Display for SpectraError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::BlockLength(n) => write!(
                f,
                "a block of {n} samples; expected a power of two from 16 to {MAX_BLOCK_LENGTH}"
            ),
            Self::SampleRate(rate) => {
                write!(
                    f,
                    "a sample rate of {rate} Hz; expected a number above zero"
                )
            }
            Self::Overlap(o) => write!(f, "an overlap of {o}; expected 0 to 0.95"),
            Self::Band {
                first,
                last,
                usable,
            } => write!(
                f,
                "lines {first} to {last} asked for, but the spectrum offers 1 to {usable}"
            ),
            Self::BandEnds(ends) => BandError::Ends(*ends).fmt(f),
            Self::OtherLines { band, lines } => write!(
                f,
                "a band chosen from {band} lines, but there are {lines}; choose it from these"
            ),
            Self::Storage { needed, given } => {
                write!(f, "storage for {given} elements, {needed} are needed")
            }
        }
    }
}

impl core::error::Error for SpectraError {}

/// The lines of a spectrum that are kept, and their frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineGrid {
    /// Index of the first kept line; line 0 is the mean.
    pub first: usize,
    /// Number of kept lines.
    pub count: usize,
    /// Distance of neighbouring lines, Hz: sample rate over block length.
    pub spacing: f64,
}

impl LineGrid {
    /// Frequency of kept line `k`, Hz.
    #[must_use]
    pub fn frequency(&self, k: usize) -> f64 {
        (self.first as f64 + k as f64) * self.spacing
    }

    /// Frequencies of the first and the last line of `band`, Hz.
    #[must_use]
    pub fn ends(&self, band: LineRange) -> [f64; 2] {
        [band.start(), band.end().max(1) - 1].map(|line| self.frequency(line))
    }

    /// Kept lines of a band (Hz), both ends included: see [`LineRange::among`].
    ///
    /// # Errors
    /// [`BandError`] if it is no band, or reaches beyond the kept lines.
    pub fn within(&self, band: [f64; 2]) -> Result<LineRange, BandError> {
        LineRange::between(self.count, |k| self.frequency(k), band)
    }
}

/// An average of block spectra.
pub trait Average {
    /// Adds one block.
    fn add(&mut self, block: &BlockSpectra<'_>);
    /// Number of blocks added.
    fn blocks(&self) -> u32;
}

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

mod blocks;
mod cross;
mod decimate;
mod drive;
mod fft;
mod history;
mod sum;
mod window;

pub use blocks::{BlockSettings, BlockSpectra, Blocks};
pub use cross::CrossAverage;
pub use drive::{DriveAverage, RunResponses};
pub use fft::MAX_BLOCK_LENGTH;
pub use history::{History, Rings};
pub use sum::Sum;
pub use window::Window;

pub use microfft::Complex32;

/// What makes spectral settings unusable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpectraError {
    /// The block length is not a power of two in 16 to [`MAX_BLOCK_LENGTH`].
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
            Self::Storage { needed, given } => {
                write!(f, "storage for {given} elements, {needed} are needed")
            }
        }
    }
}

impl core::error::Error for SpectraError {}

/// Which lines of a spectrum are kept, and where they lie.
#[derive(Clone, Copy, Debug, PartialEq)]
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
        self.first.saturating_add(k) as f64 * self.spacing
    }

    /// Kept lines from `low` to `high` Hz, both ends included, as indices into the
    /// kept ones. A thousandth of a line forgives the rounding of a band's ends. A band whose
    /// ends are no numbers holds no line.
    #[must_use]
    pub fn within(&self, low: f64, high: f64) -> core::ops::Range<usize> {
        const FORGIVEN: f64 = 1e-3;
        let from = libm::ceil(low / self.spacing - FORGIVEN);
        let to = libm::floor(high / self.spacing + FORGIVEN);
        if from.is_nan() || to.is_nan() {
            return 0..0;
        }
        // Casts stop at the largest number there is, as do the sums.
        let [from, to] = [from, to].map(|line| line.max(0.0) as usize);
        let start = from.max(self.first) - self.first;
        // `clamp` would panic if its ends were swapped.
        let end = to.saturating_add(1).max(self.first) - self.first;
        let end = end.min(self.count);
        start.min(end)..end
    }
}

/// An average of block spectra.
pub trait Average {
    /// Adds one block.
    fn add(&mut self, block: &BlockSpectra<'_>);
    /// Number of blocks added.
    fn blocks(&self) -> u32;
    /// Forgets all blocks.
    fn clear(&mut self);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_includes_both_of_its_ends() {
        let grid = LineGrid {
            first: 1,
            count: 60,
            spacing: 0.5,
        };
        let band = grid.within(0.5, 14.5);
        assert_eq!(band, 0..29);
        assert_eq!(grid.frequency(28), 14.5);
        assert_eq!(grid.within(40.0, 50.0).len(), 0);
        assert_eq!(grid.within(0.0, 1000.0), 0..60);
    }
}

//! Settings of the blocks that a stream of samples is cut into.

use super::decimate::{Filters, MAX_STAGES, USABLE};
use super::fft::supported;
use super::lane::GROUP;
use super::{BandError, LineGrid, SpectraError, Window};

/// Settings of the blocks: length, hop, window and kept lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockSettings {
    block_length: usize,
    hop: usize,
    window: Window,
    grid: LineGrid,
    /// Filters of the decimations by two before the transform.
    filters: Filters,
}

impl BlockSettings {
    /// Blocks of `block_length` samples at `sample_rate` Hz that overlap by the share
    /// `overlap`, of which the lines of `band` (Hz) are kept. The mean of
    /// each block, under the window, is removed: sensors have offsets, and the lowest lines
    /// would see them.
    ///
    /// # Errors
    /// [`SpectraError::BlockLength`], [`SpectraError::Overlap`], [`SpectraError::SampleRate`],
    /// [`SpectraError::BandEnds`], or [`SpectraError::Band`] if the band holds no line or
    /// leaves the spectrum.
    pub fn new(
        block_length: usize,
        overlap: f64,
        window: Window,
        sample_rate: f64,
        band: [f64; 2],
    ) -> Result<Self, SpectraError> {
        if !supported(block_length) {
            return Err(SpectraError::BlockLength(block_length));
        }
        if !(0.0..=0.95).contains(&overlap) {
            return Err(SpectraError::Overlap(overlap));
        }
        let spacing = sample_rate / block_length as f64;
        if !(sample_rate.is_finite() && spacing.is_normal() && spacing > 0.0) {
            return Err(SpectraError::SampleRate(sample_rate));
        }
        let usable = (block_length / 2 - 1).saturating_sub(window.reach());
        // Line 0 is the mean, which was removed.
        let whole = LineGrid {
            first: 1,
            count: usable,
            spacing,
        };
        let lines = whole.within(band).map_err(|why| match why {
            BandError::Ends(ends) => SpectraError::BandEnds(ends),
            _ => SpectraError::Band {
                // As in any cast of a float, what is too large becomes the largest.
                first: (libm::ceil(band[0] / spacing) as usize).max(1),
                last: libm::floor(band[1] / spacing) as usize,
                usable,
            },
        })?;
        let (first, last) = (1 + lines.start(), lines.end());
        if lines.len() == 0 {
            return Err(SpectraError::Band {
                first,
                last,
                usable,
            });
        }
        let hop = libm::round(block_length as f64 * (1.0 - overlap)) as usize;
        Ok(Self {
            block_length,
            hop: hop.max(1),
            window,
            grid: LineGrid {
                first,
                count: last - first + 1,
                spacing,
            },
            filters: filters(block_length, last),
        }
        .with_whole_hop())
    }

    /// A hop is a whole number of decimated samples.
    fn with_whole_hop(self) -> Self {
        let unit = 1 << self.filters.stages();
        Self {
            hop: (self.hop / unit).max(1) * unit,
            ..self
        }
    }

    /// The same blocks transformed at the full rate, for comparisons: with the beginning
    /// of the recording, but at several times the cost.
    #[must_use]
    pub fn without_decimation(self) -> Self {
        Self {
            filters: Filters::new(0, 0.0),
            ..self
        }
    }

    pub(super) fn filters(&self) -> Filters {
        self.filters
    }

    /// By how much the samples are decimated before the transform.
    #[cfg(test)]
    pub(super) fn decimation(&self) -> usize {
        1 << self.filters.stages()
    }

    /// Samples that are transformed.
    #[must_use]
    pub fn transform_length(&self) -> usize {
        self.block_length >> self.filters.stages()
    }

    /// Samples per block.
    #[must_use]
    pub fn block_length(&self) -> usize {
        self.block_length
    }

    /// Samples from one block's start to the next one's.
    #[must_use]
    pub fn hop(&self) -> usize {
        self.hop
    }

    /// The kept lines.
    #[must_use]
    pub fn grid(&self) -> LineGrid {
        self.grid
    }

    /// The window.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// One over the power spectral density of a squared line: multiply `|X|²` with this
    /// for units²/Hz, one-sided.
    #[must_use]
    pub fn density(&self) -> f64 {
        let n = self.transform_length() as f64;
        // sample rate = spacing · N, both after decimation
        2.0 / (self.grid.spacing * n * n * self.window.power())
    }

    /// Elements of history that `channels` need: decimated samples, and those of the filters.
    #[must_use]
    pub fn history_len(&self, channels: usize) -> usize {
        channels * self.transform_length() + self.filters.storage_len(channels, GROUP)
    }

    /// Consecutive samples that have a part in a block: those on which its filters settle, too. As many
    /// come from a start to the end of the first block.
    #[must_use]
    pub fn support(&self) -> usize {
        (self.transform_length() + self.settling()) << self.filters.stages()
    }

    /// Decimated samples on which the filters settle.
    pub(super) fn settling(&self) -> usize {
        self.filters.settling(self.window != Window::Rectangular)
    }

    /// Elements of line storage that `channels` need.
    pub(super) fn lines_len(&self, channels: usize) -> usize {
        channels * self.grid.count
    }
}

/// Filters of as many decimations as leave the last line in the pass band and a transform to do.
fn filters(block_length: usize, last: usize) -> Filters {
    let share = |stages: usize| last as f64 / (block_length >> stages) as f64;
    let fits = |stages: usize| supported(block_length >> stages) && share(stages) <= USABLE;
    let stages = (1..=MAX_STAGES).rev().find(|&s| fits(s)).unwrap_or(0);
    Filters::new(stages, share(stages))
}

pub(super) fn enough(given: usize, needed: usize) -> Result<(), SpectraError> {
    if given < needed {
        return Err(SpectraError::Storage { needed, given });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hop_is_a_whole_number_of_decimated_samples() {
        let hop = |overlap| {
            let settings = BlockSettings::new(1024, overlap, Window::Hann, 512.0, [0.5, 48.0]);
            settings.unwrap().hop()
        };
        // Decimated by four: 716.8 samples are rounded to 717, of which 716 are whole.
        assert_eq!(hop(0.3), 716);
        assert_eq!(hop(0.5), 512);
        assert_eq!(hop(0.9), 100);
    }

    #[test]
    fn storage_is_as_much_as_channels_and_lines_take() {
        let settings = BlockSettings::new(1024, 0.5, Window::Hann, 512.0, [0.5, 48.0]).unwrap();
        assert_eq!(settings.grid().count, 96);
        assert_eq!(settings.lines_len(13), 13 * 96);
        assert_eq!(settings.lines_len(1), 96);
        // Filters hold their channels by fours, and one place for all.
        let [four, eight, sixteen] = [4, 8, 16].map(|channels| settings.history_len(channels));
        assert_eq!(sixteen - eight, 2 * (eight - four));
        assert_eq!(2 * four - eight, 4 * 64);
    }

    /// White noise of unit density at a sample rate of 128 Hz has a variance of 64; weighted by
    /// Hann's window, 256 such samples have a squared line of 256 · 3/8 · 64.
    #[test]
    fn density_of_white_noise() {
        let settings = BlockSettings::new(1024, 0.5, Window::Hann, 512.0, [0.5, 48.0]).unwrap();
        assert_eq!(settings.decimation(), 4);
        let line = 256.0 * 0.375 * 64.0;
        assert!((settings.density() * line - 1.0).abs() < 1e-12);
    }
}

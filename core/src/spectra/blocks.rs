//! Overlapping blocks out of a stream of samples, and their windowed spectra.

use super::decimate::{MAX_STAGES, USABLE, settling, state_len};
use super::fft::supported;
use super::history::Rings;
use super::{BandError, Complex32, LineGrid, SpectraError, Window};

/// How a stream is cut and transformed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockSettings {
    block_length: usize,
    hop: usize,
    window: Window,
    grid: LineGrid,
    /// Decimations by two before the transform.
    stages: usize,
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
        if lines.is_empty() {
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
            stages: stages(block_length, last),
        }
        .with_whole_hop())
    }

    /// A hop is a whole number of decimated samples.
    fn with_whole_hop(self) -> Self {
        let unit = 1 << self.stages;
        Self {
            hop: (self.hop / unit).max(1) * unit,
            ..self
        }
    }

    /// The same blocks transformed at the full rate, for comparisons: with the beginning
    /// of the recording, but at several times the cost.
    #[must_use]
    pub fn without_decimation(self) -> Self {
        Self { stages: 0, ..self }
    }

    pub(super) fn stages(&self) -> usize {
        self.stages
    }

    /// By how much the samples are decimated before the transform.
    #[cfg(test)]
    fn decimation(&self) -> usize {
        1 << self.stages
    }

    /// Samples that are transformed.
    #[must_use]
    pub fn transform_length(&self) -> usize {
        self.block_length >> self.stages
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

    /// Elements of history that `channels` need: decimated samples and filter states.
    #[must_use]
    pub fn history_len(&self, channels: usize) -> usize {
        channels * (self.transform_length() + state_len(self.stages))
    }

    /// Consecutive samples that have a part in a block: what its filters look back on, too.
    #[must_use]
    pub fn support(&self) -> usize {
        ((self.transform_length() - 1) << self.stages) + settling(self.stages) + 1
    }

    /// Elements of line storage that `channels` need.
    #[must_use]
    pub fn lines_len(&self, channels: usize) -> usize {
        channels * self.grid.count
    }
}

/// The spectra of one block: for every channel the kept lines.
#[derive(Clone, Copy, Debug)]
pub struct BlockSpectra<'a> {
    lines: &'a [Complex32],
    count: usize,
}

impl<'a> BlockSpectra<'a> {
    /// The kept lines of channel `c`; empty if there is no such channel.
    #[must_use]
    pub fn channel(&self, c: usize) -> &'a [Complex32] {
        self.lines
            .get(c * self.count..(c + 1) * self.count)
            .unwrap_or(&[])
    }
}

/// Blocks of all channels out of a stream, each transformed as soon as it is complete.
#[derive(Debug)]
pub struct Blocks<'s> {
    rings: Rings,
    history: &'s mut [f32],
    work: &'s mut [Complex32],
    lines: &'s mut [Complex32],
}

impl<'s> Blocks<'s> {
    /// Blocks of `channels` channels in lent storage: `history` of
    /// [`BlockSettings::history_len`], `work` of one
    /// transform length, `lines` of
    /// [`BlockSettings::lines_len`].
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if one of them is too small.
    pub fn new(
        settings: BlockSettings,
        channels: usize,
        history: &'s mut [f32],
        work: &'s mut [Complex32],
        lines: &'s mut [Complex32],
    ) -> Result<Self, SpectraError> {
        enough(lines.len(), settings.lines_len(channels))?;
        enough(work.len(), settings.transform_length())?;
        let rings = Rings::new(settings, channels, history)?;
        Ok(Self {
            rings,
            history,
            work,
            lines,
        })
    }

    /// Forgets the history: the next block starts with the next sample. To be called
    /// where samples were lost, so that no block straddles the gap.
    pub fn restart(&mut self) {
        self.rings.restart(self.history);
    }

    /// Takes one sample of every channel; a channel that `sample` lacks reads zero.
    /// Returns the spectra whenever a block is complete.
    pub fn push(&mut self, sample: &[f32]) -> Option<BlockSpectra<'_>> {
        if !self.rings.push(self.history, sample) {
            return None;
        }
        let count = self.rings.settings().grid().count;
        let pairs = self.lines.chunks_mut(2 * count).enumerate();
        for (pair, lines) in pairs.take(self.rings.pairs()) {
            let (a, b) = lines.split_at_mut(count.min(lines.len()));
            self.rings.transform(pair, self.history, self.work, a, b);
        }
        Some(BlockSpectra {
            lines: self.lines,
            count,
        })
    }
}

/// Most decimations that leave the last line in the pass band and a transform to do.
fn stages(block_length: usize, last: usize) -> usize {
    let fits = |stages: usize| {
        let length = block_length >> stages;
        supported(length) && last as f64 <= USABLE * length as f64
    };
    (1..=MAX_STAGES).rev().find(|&s| fits(s)).unwrap_or(0)
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
    use crate::spectra::{Average, DriveAverage, Sum};
    use core::f64::consts::PI;

    const N: usize = 1024;

    /// Responses of a channel that is the drive times `gain(line)`, both periodic in the
    /// block with power on every line of `lines`.
    fn response(
        settings: BlockSettings,
        lines: impl Iterator<Item = usize> + Clone,
        gain: impl Fn(usize) -> f64,
    ) -> [(f64, f64); 96] {
        let mut history = [0.0; 8192];
        let mut work = [Complex32::new(0.0, 0.0); N];
        let mut kept = [Complex32::new(0.0, 0.0); 2 * 96];
        let mut sums = [Sum::ZERO; 4 * 96];
        let mut blocks = Blocks::new(settings, 2, &mut history, &mut work, &mut kept).unwrap();
        let mut average = DriveAverage::new(&settings, 1, &mut sums).unwrap();
        for n in 0..4 * N {
            let (mut x, mut y) = (0.0, 0.0);
            for k in lines.clone() {
                // A phase that differs from line to line keeps the crest low.
                let phase = 2.0 * PI * ((k * n % N) as f64 / N as f64) + (k * k) as f64;
                x += libm::cos(phase);
                y += gain(k) * libm::sin(phase);
            }
            if let Some(block) = blocks.push(&[x as f32, y as f32]) {
                average.add(&block);
            }
        }
        assert!(average.blocks() >= 4);
        core::array::from_fn(|k| {
            let (re, im) = average.cross(0, k);
            let power = average.drive_power(k);
            (re / power, im / power)
        })
    }

    fn settings() -> BlockSettings {
        // Lines 1 to 96 at 512 Hz.
        BlockSettings::new(N, 0.5, Window::Hann, 512.0, [0.5, 48.0]).unwrap()
    }

    #[test]
    fn lines_of_a_fifth_of_the_spectrum_are_decimated_by_four() {
        assert_eq!(settings().decimation(), 4);
        assert_eq!(settings().transform_length(), 256);
        assert_eq!(settings().without_decimation().decimation(), 1);
    }

    #[test]
    fn what_folds_back_is_gone() {
        // A gain of 2 in quadrature on the kept lines, of 1000 on all that fold onto them.
        let all = (2..510).step_by(3);
        let gain = |k: usize| if k <= 96 { 2.0 } else { 1000.0 };
        let h = response(settings(), all.clone(), gain);
        for k in all.filter(|k| *k <= 96) {
            let (re, im) = h[k - 1];
            // Folded lines: 1000 times the stop band's 5e-6, four of them at most; they
            // are lines of their own here and do not average out. f32 adds 1e-6 of the
            // largest amplitudes' sum, 140 lines of 1000 rms: 1e-2.
            assert!(
                re.abs() < 2e-2 && (im + 2.0).abs() < 2e-2,
                "line {k}: {re} {im}"
            );
        }
    }

    #[test]
    fn decimation_leaves_the_response_alone() {
        let lines = (2..97).step_by(2);
        let gain = |k: usize| 1.0 + k as f64 / 50.0;
        for settings in [settings(), settings().without_decimation()] {
            let h = response(settings, lines.clone(), gain);
            for k in lines.clone() {
                let (re, im) = h[k - 1];
                // f32 transforms: 4e-7 of the RMS spectrum a line, 1e-6 with the filters.
                assert!(re.abs() < 4e-6, "line {k}: {re}");
                assert!((im + gain(k)).abs() < 8e-6, "line {k}: {im}");
            }
        }
    }
}

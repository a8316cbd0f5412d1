//! Overlapping blocks out of a stream of samples, transformed as soon as they are complete.

use super::history::Rings;
use super::settings::{BlockSettings, enough};
use super::{Complex32, SpectraError};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::{Average, DriveAverage, Sum, Window};
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

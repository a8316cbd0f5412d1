//! The last block's worth of samples of every channel, and their transforms.

use super::decimate::Decimator;
use super::fft::{lines, transform_pairs};
use super::settings::{BlockSettings, enough};
use super::{Complex32, SpectraError};

/// The last block's worth of samples of every channel, in storage that its owner lends anew with
/// each sample, always the same: for a chip that has no room for the lines of all channels at
/// once. Elsewhere use [`super::Blocks`].
#[derive(Debug)]
pub struct Rings {
    settings: BlockSettings,
    channels: usize,
    head: usize,
    decimator: Decimator,
    /// Decimated samples still missing before the next block is complete.
    missing: usize,
}

impl Rings {
    /// Those of `channels` channels at their beginning. `storage`, of
    /// [`BlockSettings::history_len`] elements at least, will hold one ring of
    /// [`BlockSettings::transform_length`] samples a channel, then their filters' states.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn new(
        settings: BlockSettings,
        channels: usize,
        storage: &mut [f32],
    ) -> Result<Self, SpectraError> {
        enough(storage.len(), settings.history_len(channels))?;
        let mut rings = Self {
            settings,
            channels,
            head: 0,
            decimator: Decimator::new(settings.filters(), channels),
            missing: 0,
        };
        rings.restart(storage);
        Ok(rings)
    }

    /// Pairs of channels; the last one may be half empty.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.channels.div_ceil(2)
    }

    /// Forgets all samples: the next block starts with the next one.
    pub fn restart(&mut self, storage: &mut [f32]) {
        let n = self.settings.transform_length();
        if let Some(filters) = storage.get_mut(self.channels * n..) {
            filters.fill(0.0);
        }
        // Those that see the start from rest are part of no block. The first block is to begin where
        // the rings do.
        let filters = self.settings.filters();
        let unsettled = filters.settling() >> filters.stages();
        self.head = match unsettled.checked_rem(n) {
            Some(rest) if rest > 0 => n - rest,
            _ => 0,
        };
        self.missing = unsettled + n;
        self.begin();
    }

    /// Outputs that the filters yield next.
    fn outputs(&self) -> usize {
        self.missing.min(self.settings.filters().batch())
    }

    /// Goes on to the next outputs of the filters.
    fn begin(&mut self) {
        let base = self.channels * self.settings.transform_length();
        self.decimator.begin(base, self.outputs());
    }

    /// The settings.
    pub(super) fn settings(&self) -> &BlockSettings {
        &self.settings
    }

    /// Takes one sample of every channel; a channel that `sample` lacks reads zero. `true`
    /// whenever a block is complete: it can be transformed until the next sample comes. With
    /// less storage than there was at the beginning it takes nothing.
    #[inline]
    pub fn push(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        if self.settings.filters().stages() == 0 {
            return self.push_unfiltered(storage, sample);
        }
        self.decimator.push(storage, sample) && self.filter(storage)
    }

    /// Filters the samples that wait. `true` if a block is complete.
    #[inline(never)] // Storing a sample is to be short.
    fn filter(&mut self, storage: &mut [f32]) -> bool {
        let n = self.settings.transform_length();
        let outputs = self.outputs();
        let places = storage.split_at_mut_checked(self.channels * n);
        let state_len = self.settings.filters().state_len(self.channels);
        let Some((rings, states)) = places.filter(|(_, states)| states.len() >= state_len) else {
            self.begin();
            return false;
        };
        let place = (n, self.head);
        self.decimator.filter(states, rings, place, outputs);
        let complete = self.advance(outputs);
        self.begin();
        complete
    }

    /// Takes one sample of every channel at the full rate. `true` if a block is complete.
    #[inline(never)] // As above.
    fn push_unfiltered(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        let n = self.settings.transform_length();
        let Some(rings) = storage.get_mut(..self.channels * n) else {
            return false;
        };
        let mut slots = rings.get_mut(self.head..).unwrap_or_default();
        if sample.len() < self.channels {
            slots.iter_mut().step_by(n.max(1)).for_each(|x| *x = 0.0);
        }
        for x in sample {
            let Some(slot) = slots.first_mut() else {
                break;
            };
            *slot = *x;
            slots = slots.get_mut(n..).unwrap_or_default();
        }
        self.advance(1)
    }

    /// Goes on by some outputs. `true` if a block is complete.
    fn advance(&mut self, outputs: usize) -> bool {
        let n = self.settings.transform_length();
        self.head = (self.head + outputs) & n.wrapping_sub(1);
        self.missing -= outputs;
        if self.missing > 0 {
            return false;
        }
        self.missing = self.settings.hop() >> self.settings.filters().stages();
        true
    }

    /// The kept lines of channels `2 pair` and `2 pair + 1`, one after the other in `work` of half a
    /// transform length at least.
    pub fn transform(
        &self,
        pair: usize,
        storage: &[f32],
        work: &mut [Complex32],
        a: &mut [Complex32],
        b: &mut [Complex32],
    ) {
        let n = self.settings.transform_length();
        let rings = storage.chunks_exact(n.max(1)).take(self.channels);
        let Some(work) = work.get_mut(..n / 2) else {
            return;
        };
        for (ring, kept) in rings.skip(2 * pair).zip([a, b]) {
            transform_pairs(ring, self.head, work);
            self.settings.window_lines(work, kept);
        }
    }
}

impl BlockSettings {
    /// The kept lines of the block whose transformed pairs are `z`, under the window.
    ///
    /// The mean under the window is taken out: what makes the windowed line 0 vanish. The plain mean
    /// would let a strong resonance leak in, unwindowed, and leave it in the lowest lines.
    fn window_lines(&self, z: &[Complex32], kept: &mut [Complex32]) {
        let (grid, coefficients) = (self.grid(), self.window().coefficients());
        let kept = kept.get_mut(..grid.count).unwrap_or_default();
        // The lines come twice as large, and the filters' gain is two a stage.
        let gain = 1.0 / (2 << self.filters().stages()) as f32;
        match *coefficients {
            [c0] => {
                let own = c0 * gain;
                for (kept, x) in kept.iter_mut().zip(lines(z, grid.first)) {
                    *kept = x * own;
                }
            }
            [c0, c1] => {
                let (own, beside) = (c0 * gain, -0.5 * c1 * gain);
                // The line before the first one is the mean, or one that is not kept.
                let mut from = lines(z, grid.first.max(2) - 1);
                let mut before = from.next().unwrap_or_default();
                let mut line = before;
                if grid.first > 1 {
                    line = from.next().unwrap_or_default();
                } else {
                    before = Complex32::new(c1 / c0 * line.re, 0.0);
                }
                for (kept, next) in kept.iter_mut().zip(from) {
                    *kept = line * own + (before + next) * beside;
                    (before, line) = (line, next);
                }
            }
            _ => {
                let at = |k: usize| lines(z, k).next().unwrap_or_default();
                let mut others = 0.0;
                for (i, c) in coefficients.iter().enumerate().skip(1) {
                    others += if i % 2 == 1 { *c } else { -c } * at(i).re;
                }
                let first = coefficients.first().copied().unwrap_or(1.0);
                let mean = Complex32::new(others / first, 0.0);
                for (k, kept) in (grid.first..).zip(kept) {
                    let line = |i: isize| match k.checked_add_signed(i) {
                        Some(0) => mean,
                        Some(k) => at(k),
                        None => at(i.unsigned_abs() - k).conj(),
                    };
                    let mut sum = Complex32::new(0.0, 0.0);
                    let mut sign = gain;
                    for (i, c) in (0..).zip(coefficients) {
                        // A cosine of amplitude c is c/2 on either side; c₀ stands alone.
                        sum += match i {
                            0 => line(0) * (sign * c),
                            _ => (line(i) + line(-i)) * (sign * 0.5 * c),
                        };
                        sign = -sign;
                    }
                    *kept = sum;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::Window;

    /// The lines of a small channel beside one that is `beside` times as large.
    fn small(beside: f32) -> [Complex32; 40] {
        const NOTHING: Complex32 = Complex32::new(0.0, 0.0);
        let settings = BlockSettings::new(256, 0.5, Window::Hann, 256.0, [1.0, 40.0]).unwrap();
        let mut storage = [0.0; 4096];
        let mut work = [NOTHING; 256];
        let mut rings = Rings::new(settings, 2, &mut storage).unwrap();
        let (mut a, mut b) = ([NOTHING; 40], [NOTHING; 40]);
        for n in 0..100_000_u32 {
            let x = (n.wrapping_mul(0x9E37_79B1) >> 8) as f32 / (1 << 24) as f32 - 0.5;
            let y = (n.wrapping_mul(0x85EB_CA77) >> 8) as f32 / (1 << 24) as f32 - 0.5;
            if rings.push(&mut storage, &[beside * x, y]) {
                rings.transform(0, &storage, &mut work, &mut a, &mut b);
                return b;
            }
        }
        panic!("no block");
    }

    #[test]
    fn a_channel_does_not_drown_beside_a_large_one() {
        let alone = small(0.0);
        let largest = alone
            .iter()
            .fold(0.0_f32, |m, z| m.max(z.norm_sqr()))
            .sqrt();
        for beside in [1e-9, 1e-3, 1.0, 1e3, 1e6, 1e12] {
            for (found, expected) in small(beside).iter().zip(&alone) {
                // Eight stages of rounding by 6e-8, of what is as large as the largest.
                let off = (found - expected).norm_sqr().sqrt() / largest;
                assert!(off < 2e-6, "{beside}: {off}");
            }
        }
    }

    /// One element less than there was at the beginning, of the filters' states or of the rings.
    #[test]
    fn less_storage_takes_nothing() {
        const NOTHING: f32 = -7.0;
        for whole in [false, true] {
            let mut settings =
                BlockSettings::new(256, 0.5, Window::Hann, 256.0, [1.0, 20.0]).unwrap();
            if whole {
                settings = settings.without_decimation();
            }
            let len = settings.history_len(2);
            let mut storage = [NOTHING; 4096];
            let mut rings = Rings::new(settings, 2, &mut storage[..len]).unwrap();
            let rings_len = 2 * settings.transform_length();
            for _ in 0..10_000 {
                assert!(!rings.push(&mut storage[..len - 1], &[1.0, 1.0]), "{whole}");
            }
            assert!(
                storage[..rings_len].iter().all(|x| *x == NOTHING),
                "{whole}"
            );
        }
    }
}

//! The last block's worth of samples of every channel, and their transforms.

use super::decimate::{Phase, settling, state_len};
use super::fft::transform;
use super::settings::{BlockSettings, enough};
use super::{Complex32, SpectraError};
use crate::cells::seen;

/// The last block's worth of samples of every channel, in storage that its owner lends anew with
/// each sample, always the same: for a chip that has no room for the lines of all channels at
/// once. Elsewhere use [`super::Blocks`].
#[derive(Debug)]
pub struct Rings {
    settings: BlockSettings,
    channels: usize,
    head: usize,
    phase: Phase,
    /// Samples until the filters have forgotten that they started from rest.
    settling: usize,
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
            phase: Phase::new(settings.stages()),
            settling: 0,
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
        let rings = self.channels * self.settings.transform_length();
        if let Some(filters) = storage.get_mut(rings..) {
            filters.fill(0.0);
        }
        self.head = 0;
        self.phase = Phase::new(self.settings.stages());
        self.settling = settling(self.settings.stages());
        self.missing = self.settings.transform_length();
    }

    /// The settings.
    pub(super) fn settings(&self) -> &BlockSettings {
        &self.settings
    }

    /// Takes one sample of every channel; a channel that `sample` lacks reads zero. `true`
    /// whenever a block is complete: it can be transformed until the next sample comes. With
    /// less storage than there was at the beginning it takes nothing.
    pub fn push(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        let n = self.settings.transform_length();
        let kept = self.phase.yields() && self.settling == 0;
        let filters = self.channels * state_len(self.settings.stages());
        let Some((rings, rest)) = storage.split_at_mut_checked(self.channels * n) else {
            return false;
        };
        let Some(states) = rest.get_mut(..filters) else {
            return false;
        };
        let (head, kept_in) = (self.head, if kept { rings } else { &mut [] });
        let slots = kept_in
            .chunks_exact_mut(n.max(1))
            .filter_map(|ring| ring.get_mut(head));
        self.phase.push(states, sample, slots);
        self.phase.advance();
        self.settling = self.settling.saturating_sub(1);
        if !kept {
            return false;
        }
        self.head = if self.head + 1 == n { 0 } else { self.head + 1 };
        self.missing -= 1;
        if self.missing > 0 {
            return false;
        }
        self.missing = self.settings.hop() >> self.settings.stages();
        true
    }

    /// The kept lines of channels `2 pair` and `2 pair + 1`: they travel as real and
    /// imaginary part of one complex transform, in `work` of one transform length at least.
    pub fn transform(
        &self,
        pair: usize,
        storage: &[f32],
        work: &mut [Complex32],
        a: &mut [Complex32],
        b: &mut [Complex32],
    ) {
        let n = self.settings.transform_length();
        let mut rings = storage
            .chunks_exact(n.max(1))
            .take(self.channels)
            .skip(2 * pair);
        let first = rings.next().unwrap_or(&[]);
        let second = rings.next().unwrap_or(&[]);
        let Some(work) = work.get_mut(..n) else {
            return;
        };
        work.fill(Complex32::new(0.0, 0.0));
        for (w, x) in work.iter_mut().zip(oldest_first(first, self.head)) {
            w.re = *x;
        }
        // Rounding is a share of the larger one: a drive in counts would drown the
        // acceleration beside it. Powers of two change no digit.
        let apart = exponent(first) - exponent(second);
        let (level, back) = (power_of_two(apart), power_of_two(-apart));
        for (w, x) in work.iter_mut().zip(oldest_first(second, self.head)) {
            w.im = *x * level;
        }
        transform(work);
        self.settings.remove_mean(work);
        self.settings.unpack(work, a, b);
        for z in b.iter_mut().take(self.settings.grid().count) {
            *z *= back;
        }
    }
}

/// Binary exponent of the largest of these, within 60 of that of one.
fn exponent(ring: &[f32]) -> i32 {
    let largest = ring.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let biased = (largest.to_bits() >> 23) as i32;
    (biased - 127).clamp(-60, 60)
}

/// 2 to the power of `exponent`, which is within 126 of zero.
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

/// The samples of a ring whose oldest one lies at `head`.
fn oldest_first(ring: &[f32], head: usize) -> impl Iterator<Item = &f32> {
    let (new, old) = ring.split_at(head.min(ring.len()));
    old.iter().chain(new)
}

impl BlockSettings {
    /// Takes the mean under the window out: what makes the windowed line 0 vanish.
    ///
    /// The plain mean would let a strong resonance leak in, unwindowed, and leave it in
    /// the lowest lines.
    fn remove_mean(&self, z: &mut [Complex32]) {
        let n = self.transform_length();
        let mut others = Complex32::new(0.0, 0.0);
        let mut sign = -1.0;
        let Some((first, rest)) = self.window().coefficients().split_first() else {
            return;
        };
        // The lines next to the mean on its one side, and on the other side from the end.
        let (_, lines) = z.get_mut(..n).and_then(|z| z.split_first_mut()).unzip();
        let lines: &[Complex32] = lines.map_or(&[], |lines| lines);
        for ((below, above), &c) in lines.iter().rev().zip(lines).zip(rest) {
            others += (above + below) * (sign * 0.5 * c);
            sign = -sign;
        }
        if let Some(mean) = z.first_mut() {
            *mean = others * (-1.0 / first);
        }
    }

    /// Separates the two packed channels and windows them, for the kept lines only.
    fn unpack(&self, z: &[Complex32], a: &mut [Complex32], b: &mut [Complex32]) {
        let n = self.transform_length();
        let coefficients = self.window().coefficients();
        // A power of two, so that a mask is the remainder.
        let (mask, z) = (n.wrapping_sub(1), seen(z));
        let windowed = |k: usize| {
            let mut sum = Complex32::new(0.0, 0.0);
            let mut sign = 1.0;
            for (i, &c) in coefficients.iter().enumerate() {
                // A cosine of amplitude c is c/2 on either side; c₀ stands alone.
                if i == 0 {
                    sum += z[k & mask] * c;
                } else {
                    let half = sign * 0.5 * c;
                    sum += (z[(k + i) & mask] + z[(k + n - i) & mask]) * half;
                }
                sign = -sign;
            }
            sum
        };
        for k in 0..self.grid().count {
            let line = self.grid().first + k;
            let (p, q) = (windowed(line), windowed(n - line));
            // z = a + j b with a, b real: A = (Z(k) + Z*(N-k))/2, B = (Z(k) - Z*(N-k))/2j.
            if let Some(slot) = a.get_mut(k) {
                *slot = Complex32::new(0.5 * (p.re + q.re), 0.5 * (p.im - q.im));
            }
            if let Some(slot) = b.get_mut(k) {
                *slot = Complex32::new(0.5 * (p.im + q.im), 0.5 * (q.re - p.re));
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
}

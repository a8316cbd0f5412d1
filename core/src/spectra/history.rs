//! The last block's worth of samples of every channel, and their transforms.

use super::decimate::Decimator;
use super::fft::{Transformed, lines, lines_by_twos, transform};
use super::lane::{Complex, Lane, Row, plus, scaled};
use super::settings::{BlockSettings, enough};
use super::wide::{plainly, widely};
use super::{Complex32, SpectraError};
use core::marker::PhantomData;

/// The last block's worth of samples of every channel, in storage that its owner lends anew with
/// each sample, always the same: for a chip that has no room for the lines of all channels at
/// once. Elsewhere use [`super::Blocks`]. Channels are transformed one by one, or by groups of four or
/// eight as `[f32; 4]` and `[f32; 8]`, whose samples lie side by side.
#[derive(Debug)]
pub struct Rings<L = f32> {
    settings: BlockSettings,
    channels: usize,
    /// Elements of the storage of the filters, behind which the rings lie.
    filters_len: usize,
    head: usize,
    decimator: Decimator,
    /// Decimated samples still missing before the next block is complete.
    missing: usize,
    lane: PhantomData<L>,
}

impl<L: Compiled> Rings<L> {
    /// Elements of storage for `channels` channels: [`BlockSettings::history_len`] of as many, in whole
    /// groups.
    pub(super) fn storage_len(settings: &BlockSettings, channels: usize) -> usize {
        Self::filters_len(settings, channels) + Self::rings_len(settings, channels)
    }

    /// Those of the filters.
    fn filters_len(settings: &BlockSettings, channels: usize) -> usize {
        settings.filters().storage_len(channels, L::Row::CHANNELS)
    }

    /// Those of the rings.
    fn rings_len(settings: &BlockSettings, channels: usize) -> usize {
        channels.next_multiple_of(L::WIDTH) * settings.transform_length()
    }

    /// Those of `channels` channels at their beginning. `storage`, of [`BlockSettings::history_len`]
    /// elements at least for channels one by one, will hold what the filters need, then one ring of
    /// [`BlockSettings::transform_length`] samples a channel.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn new(
        settings: BlockSettings,
        channels: usize,
        storage: &mut [f32],
    ) -> Result<Self, SpectraError> {
        enough(storage.len(), Self::storage_len(&settings, channels))?;
        let mut rings = Self {
            settings,
            channels,
            filters_len: Self::filters_len(&settings, channels),
            head: 0,
            decimator: Decimator::new(settings.filters(), channels, L::Row::CHANNELS),
            missing: 0,
            lane: PhantomData,
        };
        rings.restart();
        Ok(rings)
    }

    /// Number of the channels' groups.
    pub(super) fn groups(&self) -> usize {
        self.channels.div_ceil(L::WIDTH)
    }

    /// Forgets all samples: the next block starts with the next one.
    pub fn restart(&mut self) {
        let n = self.settings.transform_length();
        self.decimator.restart();
        // Those that see the start are part of no block. The first block is to begin where the rings do.
        let unsettled = self.settings.settling();
        self.head = match unsettled.checked_rem(n) {
            Some(rest) if rest > 0 => n - rest,
            _ => 0,
        };
        self.missing = unsettled + n;
        self.begin();
    }

    /// Goes on to the next outputs of the filters, once around the rings at most.
    fn begin(&mut self) {
        let most = self.settings.transform_length();
        self.decimator.begin(self.missing.min(most));
    }

    /// The settings.
    pub(super) fn settings(&self) -> &BlockSettings {
        &self.settings
    }

    /// Takes one sample of every channel; a channel that `sample` lacks reads zero. `true`
    /// whenever a block is complete: it can be transformed until the next sample comes. With
    /// less storage than there was at the beginning it takes nothing.
    ///
    /// In place of a faulty sample the one before it is to be pushed once more: blocks begin
    /// [`BlockSettings::support`] after it, when filters have forgotten a step, but not yet a number
    /// that is a thousand times as large.
    #[inline(always)]
    pub fn push(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        self.decimator.push::<L::Row>(storage, sample) && self.filter(storage)
    }

    /// Filters the samples that wait. `true` if a block is complete.
    #[inline(never)] // Storing a sample is to be short.
    fn filter(&mut self, storage: &mut [f32]) -> bool {
        let n = self.settings.transform_length();
        let needed = Self::rings_len(&self.settings, self.channels);
        let parts = storage.split_at_mut_checked(self.filters_len);
        let Some((filters, rings)) = parts.filter(|(_, rings)| rings.len() >= needed) else {
            self.begin();
            return false;
        };
        let place = (n, self.head);
        let outputs = L::filter(&mut self.decimator, filters, rings, place);
        let complete = self.advance(outputs);
        self.begin();
        complete
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

    /// The kept lines of a group of channels, by its number: those of its first channel, then of the
    /// next one, as many in each as the grid has. `work` is of half a transform length at least.
    pub fn transform(
        &self,
        group: usize,
        storage: &[f32],
        work: &mut [Complex<L>],
        kept: &mut [Complex32],
    ) {
        let n = self.settings.transform_length();
        let rings = storage.get(self.filters_len..).unwrap_or_default();
        let mut rings = rings
            .chunks_exact((L::WIDTH * n).max(1))
            .take(self.groups());
        if let (Some(ring), Some(work)) = (rings.nth(group), work.get_mut(..n / 2)) {
            L::lines(&self.settings, (L::samples(ring), self.head), work, kept);
        }
    }
}

/// Samples for which the functions that take the time are compiled with the settings of this crate:
/// generic functions have those of the crate that calls them, which may check every sum for an
/// overflow. Those of eight channels use the processor's AVX2, where it has that.
pub trait Compiled: Lane {
    /// [`block_lines`] of this type.
    fn lines(
        settings: &BlockSettings,
        ring: (&[Self], usize),
        work: &mut [Complex<Self>],
        kept: &mut [Complex32],
    );

    /// [`Decimator::filter`] of this type.
    fn filter(
        decimator: &mut Decimator,
        storage: &mut [f32],
        rings: &mut [f32],
        place: (usize, usize),
    ) -> usize;
}

macro_rules! compiled {
    ($samples:ty, $run:ident) => {
        impl Compiled for $samples {
            fn lines(
                settings: &BlockSettings,
                ring: (&[Self], usize),
                work: &mut [Complex<Self>],
                kept: &mut [Complex32],
            ) {
                $run(
                    #[inline(always)]
                    || block_lines(settings, ring, work, kept),
                );
            }

            fn filter(
                decimator: &mut Decimator,
                storage: &mut [f32],
                rings: &mut [f32],
                place: (usize, usize),
            ) -> usize {
                $run(
                    #[inline(always)]
                    || decimator.filter::<Self>(storage, rings, place),
                )
            }
        }
    };
}

compiled!(f32, plainly);
compiled!([f32; 4], plainly);
compiled!([f32; 8], widely);

/// The kept lines of a block, whose oldest sample lies at `head` of its ring.
#[cfg_attr(not(target_os = "none"), inline(always))] // Its caller says for which processor.
pub(super) fn block_lines<L: Lane>(
    settings: &BlockSettings,
    (ring, head): (&[L], usize),
    work: &mut [Complex<L>],
    kept: &mut [Complex32],
) {
    // Those beside the last kept one, too.
    let grid = settings.grid();
    let wanted = grid.first + grid.count + settings.window().reach();
    let transformed = transform(ring, head, work, wanted);
    settings.window_lines(transformed, kept);
}

impl BlockSettings {
    /// The kept lines of a transformed block, under the window.
    ///
    /// The mean under the window is taken out: what makes the windowed line 0 vanish. The plain mean
    /// would let a strong resonance leak in, unwindowed, and leave it in the lowest lines.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn window_lines<L: Lane>(&self, z: Transformed<'_, L>, kept: &mut [Complex32]) {
        let (grid, coefficients) = (self.grid(), self.window().coefficients());
        let count = grid.count;
        // The lines come twice as large, and the filters' gain is two a stage.
        let gain = 1.0 / (2 << self.filters().stages()) as f32;
        match *coefficients {
            [c0] => {
                let own = c0 * gain;
                keep_lines(
                    z,
                    grid.first,
                    (kept, count),
                    #[inline(always)]
                    |line| scaled(line, own),
                );
            }
            [c0, c1] => {
                let (own, beside) = (c0 * gain, -0.5 * c1 * gain);
                // The line before the first one is the mean, or one that is not kept.
                let mut before = z.line(grid.first.max(2) - 1);
                let mut line = before;
                if grid.first > 1 {
                    line = z.line(grid.first);
                } else {
                    before = Complex::new(line.re.times(c1 / c0), L::default());
                }
                keep_lines(
                    z,
                    grid.first + 1,
                    (kept, count),
                    #[inline(always)]
                    move |next| {
                        let both = scaled(plus(before, next), beside);
                        let sum = plus(scaled(line, own), both);
                        (before, line) = (line, next);
                        sum
                    },
                );
            }
            _ => {
                let at = |k: usize| z.line(k);
                let mut others = L::default();
                for (i, c) in coefficients.iter().enumerate().skip(1) {
                    others = others.plus(at(i).re.times(if i % 2 == 1 { *c } else { -c }));
                }
                let first = coefficients.first().copied().unwrap_or(1.0);
                let mean = Complex::new(others.over(first), L::default());
                let windowed = (grid.first..).map(|k| {
                    let line = |i: isize| match k.checked_add_signed(i) {
                        Some(0) => mean,
                        Some(k) => at(k),
                        None => {
                            let Complex { re, im } = at(i.unsigned_abs() - k);
                            Complex::new(re, im.negated())
                        }
                    };
                    let mut sum = Complex::default();
                    let mut sign = gain;
                    for (i, c) in (0..).zip(coefficients) {
                        // A cosine of amplitude c is c/2 on either side; c₀ stands alone.
                        let part = match i {
                            0 => scaled(line(0), sign * c),
                            _ => scaled(plus(line(i), line(-i)), sign * 0.5 * c),
                        };
                        sum = plus(sum, part);
                        sign = -sign;
                    }
                    [sum]
                });
                L::keep(windowed, kept, count, 0);
            }
        }
    }
}

/// Keeps `windowed` of `count` lines from `first` on. Those of one channel are computed two or four at a time, which
/// takes fewer moves and ends of loops.
#[cfg_attr(not(target_os = "none"), inline(always))]
fn keep_lines<L: Lane>(
    z: Transformed<'_, L>,
    first: usize,
    (kept, count): (&mut [Complex32], usize),
    mut windowed: impl FnMut(Complex<L>) -> Complex<L>,
) {
    let z = match z {
        Transformed::Pairs(z) => z,
        Transformed::Lines(z) => {
            let from = z.get(first..).unwrap_or_default();
            let by_fours = count & !3;
            let fours = L::each(
                from.as_chunks().0.iter(),
                #[inline(always)]
                |[a, b, c, d]| [windowed(*a), windowed(*b), windowed(*c), windowed(*d)],
            );
            L::keep(fours, kept, count, 0);
            let rest = L::each(
                from.iter().skip(by_fours),
                #[inline(always)]
                |line| [windowed(*line)],
            );
            L::keep(rest, kept, count, by_fours);
            return;
        }
    };
    let by_twos = if L::WIDTH == 1 { count & !1 } else { 0 };
    if by_twos > 0 {
        let twos = L::each(
            lines_by_twos(z, first),
            #[inline(always)]
            |[a, b]| [windowed(a), windowed(b)],
        );
        L::keep(twos, kept, count, 0);
    }
    let rest = L::each(
        lines(z, first + by_twos),
        #[inline(always)]
        |line| [windowed(line)],
    );
    L::keep(rest, kept, count, by_twos);
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
        let mut rings = Rings::<f32>::new(settings, 2, &mut storage).unwrap();
        let mut lines = [NOTHING; 40];
        for n in 0..100_000_u32 {
            let x = (n.wrapping_mul(0x9E37_79B1) >> 8) as f32 / (1 << 24) as f32 - 0.5;
            let y = (n.wrapping_mul(0x85EB_CA77) >> 8) as f32 / (1 << 24) as f32 - 0.5;
            if rings.push(&mut storage, &[beside * x, y]) {
                rings.transform(1, &storage, &mut work, &mut lines);
                return lines;
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
            let mut rings = Rings::<f32>::new(settings, 2, &mut storage[..len]).unwrap();
            let rings_at = len - 2 * settings.transform_length();
            for _ in 0..10_000 {
                assert!(!rings.push(&mut storage[..len - 1], &[1.0, 1.0]), "{whole}");
            }
            assert!(storage[rings_at..].iter().all(|x| *x == NOTHING), "{whole}");
        }
    }
}

//! Overlapping blocks out of a stream of samples, and their windowed spectra.

use super::fft::{supported, transform};
use super::{Complex32, LineGrid, SpectraError, Window};

/// How a stream is cut and transformed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockSettings {
    block_length: usize,
    hop: usize,
    window: Window,
    grid: LineGrid,
    remove_mean: bool,
}

impl BlockSettings {
    /// Blocks of `block_length` samples at `sample_rate` Hz that overlap by the share
    /// `overlap`, of which the lines between `low` and `high` Hz are kept. The mean of
    /// each block is removed, as sensors have offsets and the lowest line would see them.
    ///
    /// # Errors
    /// [`SpectraError::BlockLength`], [`SpectraError::Overlap`], or
    /// [`SpectraError::Band`] if the band holds no line or leaves the spectrum.
    pub fn new(
        block_length: usize,
        overlap: f64,
        window: Window,
        sample_rate: f64,
        [low, high]: [f64; 2],
    ) -> Result<Self, SpectraError> {
        if !supported(block_length) {
            return Err(SpectraError::BlockLength(block_length));
        }
        if !(0.0..=0.95).contains(&overlap) {
            return Err(SpectraError::Overlap(overlap));
        }
        let spacing = sample_rate / block_length as f64;
        let usable = block_length / 2 - 1 - window.reach();
        let whole = LineGrid {
            first: 0,
            count: block_length,
            spacing,
        };
        let lines = whole.within(low, high);
        // Line 0 is the mean, which was removed.
        let first = lines.start.max(1);
        let last = lines.end.saturating_sub(1);
        if lines.is_empty() || first > last || last > usable {
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
            remove_mean: true,
        })
    }

    /// The same blocks with their means left in.
    #[must_use]
    pub fn keep_mean(self) -> Self {
        Self {
            remove_mean: false,
            ..self
        }
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
        let n = self.block_length as f64;
        // sample rate = spacing · N
        2.0 / (self.grid.spacing * n * n * self.window.power())
    }

    /// Elements of history that `channels` need.
    #[must_use]
    pub fn history_len(&self, channels: usize) -> usize {
        channels * self.block_length
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

/// The last block's worth of samples of every channel, and the machinery to transform it.
#[derive(Debug)]
pub struct Blocks<'s> {
    settings: BlockSettings,
    channels: usize,
    /// One ring of `block_length` samples per channel.
    history: &'s mut [f32],
    work: &'s mut [Complex32],
    lines: &'s mut [Complex32],
    head: usize,
    /// Samples still missing before the next block is complete.
    missing: usize,
}

impl<'s> Blocks<'s> {
    /// Blocks of `channels` channels in lent storage: `history` of
    /// [`BlockSettings::history_len`], `work` of one block length, `lines` of
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
        let history = exactly(history, settings.history_len(channels))?;
        let work = exactly(work, settings.block_length)?;
        let lines = exactly(lines, settings.lines_len(channels))?;
        Ok(Self {
            settings,
            channels,
            history,
            work,
            lines,
            head: 0,
            missing: settings.block_length,
        })
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &BlockSettings {
        &self.settings
    }

    /// Forgets the history: the next block starts with the next sample. To be called
    /// where samples were lost, so that no block straddles the gap.
    pub fn restart(&mut self) {
        self.head = 0;
        self.missing = self.settings.block_length;
    }

    /// Takes one sample of every channel; a channel that `sample` lacks reads zero.
    /// Returns the spectra whenever a block is complete.
    pub fn push(&mut self, sample: &[f32]) -> Option<BlockSpectra<'_>> {
        let n = self.settings.block_length;
        for (c, ring) in self.history.chunks_exact_mut(n).enumerate() {
            if let Some(slot) = ring.get_mut(self.head) {
                *slot = sample.get(c).copied().unwrap_or(0.0);
            }
        }
        self.head = (self.head + 1) % n;
        self.missing -= 1;
        if self.missing > 0 {
            return None;
        }
        self.missing = self.settings.hop;
        self.transform_all();
        Some(BlockSpectra {
            lines: self.lines,
            count: self.settings.grid.count,
        })
    }

    /// Two real channels travel as real and imaginary part of one complex transform.
    fn transform_all(&mut self) {
        let n = self.settings.block_length;
        let count = self.settings.grid.count;
        let mut rings = self.history.chunks_exact(n);
        let mut lines = &mut *self.lines;
        for _ in 0..self.channels.div_ceil(2) {
            let first = rings.next();
            let second = rings.next();
            for (k, w) in self.work.iter_mut().enumerate() {
                // The oldest sample lies at the head.
                let at = (self.head + k) % n;
                let read =
                    |ring: Option<&[f32]>| ring.and_then(|r| r.get(at)).copied().unwrap_or(0.0);
                *w = Complex32::new(read(first), read(second));
            }
            transform(self.work);
            if self.settings.remove_mean
                && let Some(mean) = self.work.first_mut()
            {
                *mean = Complex32::new(0.0, 0.0);
            }
            let (a, rest) = lines.split_at_mut(count.min(lines.len()));
            let (b, rest) = rest.split_at_mut(count.min(rest.len()));
            self.settings.unpack(self.work, a, b);
            lines = rest;
        }
    }
}

impl BlockSettings {
    /// Separates the two packed channels and windows them, for the kept lines only.
    fn unpack(&self, z: &[Complex32], a: &mut [Complex32], b: &mut [Complex32]) {
        let n = self.block_length;
        let coefficients = self.window.coefficients();
        let windowed = |k: usize| {
            let mut sum = Complex32::new(0.0, 0.0);
            let mut sign = 1.0;
            for (i, &c) in coefficients.iter().enumerate() {
                // A cosine of amplitude c is c/2 on either side; c₀ stands alone.
                if i == 0 {
                    sum += z[k % n] * c;
                } else {
                    let half = sign * 0.5 * c;
                    sum += (z[(k + i) % n] + z[(k + n - i) % n]) * half;
                }
                sign = -sign;
            }
            sum
        };
        for k in 0..self.grid.count {
            let line = self.grid.first + k;
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

fn exactly<T>(slice: &mut [T], needed: usize) -> Result<&mut [T], SpectraError> {
    let given = slice.len();
    slice
        .get_mut(..needed)
        .ok_or(SpectraError::Storage { needed, given })
}

//! Numbers that the filters and the transforms calculate with: a sample of one channel on the chip,
//! samples of four channels side by side on a workstation. Each channel is rounded alike in both, so
//! that its spectra have the same bits.

use super::Complex32;

/// Channels whose samples lie side by side on their way through the filters.
pub(super) const GROUP: usize = 4;

/// Samples of the channels of a group at one instant.
pub(super) type Row = [f32; GROUP];

/// A complex number of each channel.
pub(super) type Complex<L> = nalgebra::Complex<L>;

/// a + b.
#[inline(always)]
pub(super) fn plus<L: Lane>(a: Complex<L>, b: Complex<L>) -> Complex<L> {
    Complex::new(a.re.plus(b.re), a.im.plus(b.im))
}

/// a - b.
#[inline(always)]
pub(super) fn minus<L: Lane>(a: Complex<L>, b: Complex<L>) -> Complex<L> {
    Complex::new(a.re.minus(b.re), a.im.minus(b.im))
}

/// -j z.
#[inline(always)]
pub(super) fn turned<L: Lane>(z: Complex<L>) -> Complex<L> {
    Complex::new(z.im, z.re.negated())
}

/// z w.
#[inline(always)]
pub(super) fn times<L: Lane>(z: Complex<L>, w: Complex32) -> Complex<L> {
    Complex::new(
        z.re.times(w.re).minus(z.im.times(w.im)),
        z.re.times(w.im).plus(z.im.times(w.re)),
    )
}

/// z x, `x` real.
#[inline(always)]
pub(super) fn scaled<L: Lane>(z: Complex<L>, x: f32) -> Complex<L> {
    Complex::new(z.re.times(x), z.im.times(x))
}

/// Samples at one instant, of one channel, `f32`, or of four, `[f32; 4]`: each operation is rounded for
/// each channel alone. Nobody else implements it, since its module is private.
pub trait Lane: Copy + Default {
    /// Number of channels.
    const WIDTH: usize;

    /// Sum.
    fn plus(self, other: Self) -> Self;

    /// Difference.
    fn minus(self, other: Self) -> Self;

    /// Product with a number.
    fn times(self, factor: f32) -> Self;

    /// Quotient by a number.
    fn over(self, divisor: f32) -> Self;

    /// The number of opposite sign.
    fn negated(self) -> Self;

    /// Samples that lie in storage, instant after instant.
    fn samples(storage: &[f32]) -> &[Self];

    /// The same, to be written.
    fn samples_mut(storage: &mut [f32]) -> &mut [Self];

    /// Those of a row from channel `first` on.
    fn of_row(row: &Row, first: usize) -> Self;

    /// Puts them into a row from channel `first` on.
    fn into_row(self, row: &mut Row, first: usize);

    /// Keeps the first `count` lines channel by channel, if there is room for those of all channels.
    fn keep(lines: impl Iterator<Item = Complex<Self>>, kept: &mut [Complex32], count: usize);
}

impl Lane for f32 {
    const WIDTH: usize = 1;

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn times(self, factor: f32) -> Self {
        self * factor
    }

    #[inline(always)]
    fn over(self, divisor: f32) -> Self {
        self / divisor
    }

    #[inline(always)]
    fn negated(self) -> Self {
        -self
    }

    #[inline(always)]
    fn samples(storage: &[f32]) -> &[Self] {
        storage
    }

    #[inline(always)]
    fn samples_mut(storage: &mut [f32]) -> &mut [Self] {
        storage
    }

    #[inline(always)]
    fn of_row(row: &Row, first: usize) -> Self {
        // Never beyond the row, which needs no check then.
        row.get(first % GROUP).copied().unwrap_or_default()
    }

    #[inline(always)]
    fn into_row(self, row: &mut Row, first: usize) {
        if let Some(slot) = row.get_mut(first % GROUP) {
            *slot = self;
        }
    }

    #[inline(always)]
    fn keep(lines: impl Iterator<Item = Complex<Self>>, kept: &mut [Complex32], count: usize) {
        let kept = kept.get_mut(..count).unwrap_or_default();
        for (slot, line) in kept.iter_mut().zip(lines) {
            *slot = line;
        }
    }
}

impl Lane for Row {
    const WIDTH: usize = GROUP;

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self, other);
        [a + e, b + f, c + g, d + h]
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self, other);
        [a - e, b - f, c - g, d - h]
    }

    #[inline(always)]
    fn times(self, factor: f32) -> Self {
        self.map(|x| x * factor)
    }

    #[inline(always)]
    fn over(self, divisor: f32) -> Self {
        self.map(|x| x / divisor)
    }

    #[inline(always)]
    fn negated(self) -> Self {
        self.map(|x| -x)
    }

    #[inline(always)]
    fn samples(storage: &[f32]) -> &[Self] {
        storage.as_chunks().0
    }

    #[inline(always)]
    fn samples_mut(storage: &mut [f32]) -> &mut [Self] {
        storage.as_chunks_mut().0
    }

    #[inline(always)]
    fn of_row(row: &Row, _: usize) -> Self {
        *row
    }

    #[inline(always)]
    fn into_row(self, row: &mut Row, _: usize) {
        *row = self;
    }

    #[inline(always)]
    fn keep(lines: impl Iterator<Item = Complex<Self>>, kept: &mut [Complex32], count: usize) {
        let mut lines = lines.take(count);
        let mut channels = kept.chunks_exact_mut(count.max(1));
        let mut channel = || channels.next().unwrap_or_default().iter_mut();
        let mut slots = channel().zip(channel()).zip(channel().zip(channel()));
        // Some lines are computed before they are taken apart: the compiler would calculate with one
        // channel at a time otherwise.
        let mut some = [Complex::default(); 16];
        loop {
            let mut taken = 0;
            for (slot, line) in some.iter_mut().zip(&mut lines) {
                *slot = line;
                taken += 1;
            }
            for (line, ((a, b), (c, d))) in some.iter().take(taken).zip(&mut slots) {
                let Complex { re, im }: &Complex<Self> = line;
                *a = Complex32::new(re[0], im[0]);
                *b = Complex32::new(re[1], im[1]);
                *c = Complex32::new(re[2], im[2]);
                *d = Complex32::new(re[3], im[3]);
            }
            if taken < some.len() {
                break;
            }
        }
    }
}

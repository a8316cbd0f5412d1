//! Numbers that the filters and the transforms calculate with: a sample of one channel on the chip,
//! samples of four or eight channels side by side on a workstation. Each channel is rounded alike in all
//! of them, so that its spectra have the same bits.

use super::Complex32;

/// Channels whose samples lie side by side on their way through the filters, on the chip.
pub(super) const GROUP: usize = 4;

/// Samples of the channels of a group at one instant, which lie side by side on their way through the
/// filters.
pub trait Row: Copy {
    /// Number of channels.
    const CHANNELS: usize;

    /// Zero in all channels.
    const ZERO: Self;

    /// The rows in storage, one after the other.
    fn rows_mut(storage: &mut [f32]) -> &mut [Self];

    /// The same as numbers.
    fn numbers_mut(rows: &mut [Self]) -> &mut [f32];

    /// Stores a sample of channels side by side as the row `at`, modulo `N`, of each group's queue.
    fn store<const N: usize>(queues: &mut [[Self; N]], at: usize, sample: &[f32]);
}

macro_rules! row {
    ($n:literal, |$row:ident, $rest:ident| $store_rest:expr) => {
        impl Row for [f32; $n] {
            const CHANNELS: usize = $n;

            const ZERO: Self = [0.0; $n];

            #[inline(always)]
            fn rows_mut(storage: &mut [f32]) -> &mut [Self] {
                storage.as_chunks_mut().0
            }

            #[inline(always)]
            fn numbers_mut(rows: &mut [Self]) -> &mut [f32] {
                rows.as_flattened_mut()
            }

            #[inline(always)]
            fn store<const N: usize>(queues: &mut [[Self; N]], at: usize, sample: &[f32]) {
                let (groups, rest) = sample.as_chunks::<$n>();
                // Never beyond the queue, which needs no check then.
                let put = |queue: &mut [Self; N], x: &Self| {
                    if let Some(row) = queue.get_mut(at % N) {
                        *row = *x;
                    }
                };
                // Those of twelve channels are written out, since a loop would take half as long again.
                if let ([a, b, c, ..], [x, y, z]) = (&mut *queues, groups) {
                    put(a, x);
                    put(b, y);
                    put(c, z);
                } else {
                    for (queue, x) in queues.iter_mut().zip(groups) {
                        put(queue, x);
                    }
                }
                if !rest.is_empty()
                    && let Some($row) = queues
                        .get_mut(groups.len())
                        .and_then(|queue| queue.get_mut(at % N))
                {
                    let $rest = rest;
                    $store_rest
                }
            }
        }
    };
}

row!(4, |row, rest| {
    let [x, y, z, _] = row;
    // One by one, since a loop would become a call.
    if let [a, rest @ ..] = rest {
        *x = *a;
        if let [b, rest @ ..] = rest {
            *y = *b;
            if let [c, ..] = rest {
                *z = *c;
            }
        }
    }
});
row!(8, |row, rest| {
    for (slot, x) in row.iter_mut().zip(rest) {
        *slot = *x;
    }
});

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

/// Samples at one instant, of one channel, `f32`, of four, `[f32; 4]`, or of eight, `[f32; 8]`: each
/// operation is rounded for each channel alone. Nobody else implements it, since its module is private.
pub trait Lane: Copy + Default {
    /// Number of channels.
    const WIDTH: usize;

    /// A group of channels, of this lane or of several.
    type Row: Row;

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
    fn of_row(row: &Self::Row, first: usize) -> Self;

    /// Puts them into a row from channel `first` on.
    fn into_row(self, row: &mut Self::Row, first: usize);

    /// Keeps lines `from` to `count` channel by channel, if there is room for those of all channels: whole
    /// batches of them.
    fn keep<const BATCH: usize>(
        batches: impl Iterator<Item = [Complex<Self>; BATCH]>,
        kept: &mut [Complex32],
        count: usize,
        from: usize,
    );

    /// Results of `f` for each of `items`, in their order.
    fn each<I: Iterator, T>(items: I, f: impl FnMut(I::Item) -> T) -> impl Iterator<Item = T>;
}

impl Lane for f32 {
    const WIDTH: usize = 1;

    type Row = [f32; GROUP];

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
    fn of_row(row: &Self::Row, first: usize) -> Self {
        // Never beyond the row, which needs no check then.
        row.get(first % GROUP).copied().unwrap_or_default()
    }

    #[inline(always)]
    fn into_row(self, row: &mut Self::Row, first: usize) {
        if let Some(slot) = row.get_mut(first % GROUP) {
            *slot = self;
        }
    }

    #[inline(always)]
    fn keep<const BATCH: usize>(
        batches: impl Iterator<Item = [Complex<Self>; BATCH]>,
        kept: &mut [Complex32],
        count: usize,
        from: usize,
    ) {
        let slots = kept.get_mut(from..count).unwrap_or_default();
        for (slots, batch) in slots.as_chunks_mut().0.iter_mut().zip(batches) {
            *slots = batch;
        }
    }

    #[inline(always)]
    fn each<I: Iterator, T>(items: I, f: impl FnMut(I::Item) -> T) -> impl Iterator<Item = T> {
        items.map(f)
    }
}

/// Samples of several channels: the names of the numbers of two of them, and of their slots.
macro_rules! lanes {
    ($n:literal: $($x:ident $y:ident $slot:ident $i:literal)*) => {
        impl Lane for [f32; $n] {
            const WIDTH: usize = $n;

            type Row = Self;

            #[inline(always)]
            fn plus(self, other: Self) -> Self {
                let ([$($x),*], [$($y),*]) = (self, other);
                [$($x + $y),*]
            }

            #[inline(always)]
            fn minus(self, other: Self) -> Self {
                let ([$($x),*], [$($y),*]) = (self, other);
                [$($x - $y),*]
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
            fn of_row(row: &Self, _: usize) -> Self {
                *row
            }

            #[inline(always)]
            fn into_row(self, row: &mut Self, _: usize) {
                *row = self;
            }

            #[inline(always)]
            fn keep<const BATCH: usize>(
                mut batches: impl Iterator<Item = [Complex<Self>; BATCH]>,
                kept: &mut [Complex32],
                count: usize,
                from: usize,
            ) {
                let mut channels = kept.chunks_exact_mut(count.max(1));
                let mut slots = || channels.next().and_then(|channel| channel.get_mut(from..));
                let [$(mut $slot),*] = [$({ let _ = $i; slots().unwrap_or_default() }),*];
                let mut part = |lines: &[Complex<Self>]| {
                    $(
                        for (slot, Complex { re, im }) in $slot.iter_mut().zip(lines) {
                            *slot = Complex32::new(re[$i], im[$i]);
                        }
                        let rest = core::mem::take(&mut $slot);
                        $slot = rest.get_mut(lines.len()..).unwrap_or_default();
                    )*
                };
                // Some lines are computed before they are taken apart: the compiler would calculate with
                // one channel at a time otherwise.
                let mut some = [Complex::default(); 16];
                let mut left = count - from;
                loop {
                    let mut computed = 0;
                    for slots in some.as_chunks_mut().0.iter_mut().take(left / BATCH) {
                        let Some(batch) = batches.next() else {
                            break;
                        };
                        *slots = batch;
                        computed += BATCH;
                    }
                    part(some.get(..computed).unwrap_or_default());
                    left -= computed;
                    if computed < some.len() {
                        break;
                    }
                }
            }

            #[inline(always)]
            fn each<I: Iterator, T>(
                items: I,
                f: impl FnMut(I::Item) -> T,
            ) -> impl Iterator<Item = T> {
                Each(items, f)
            }
        }
    };
}

/// [`Iterator::map`] that is compiled into its caller, for the processor of that, however long it is.
struct Each<I, F>(I, F);

impl<I: Iterator, T, F: FnMut(I::Item) -> T> Iterator for Each<I, F> {
    type Item = T;

    #[inline(always)]
    fn next(&mut self) -> Option<T> {
        match self.0.next() {
            Some(item) => Some((self.1)(item)),
            None => None,
        }
    }
}

lanes!(4: a e s 0 b f t 1 c g u 2 d h v 3);
lanes!(8: a i s 0 b j t 1 c k u 2 d l v 3 e m w 4 f n x 5 g o y 6 h p z 7);

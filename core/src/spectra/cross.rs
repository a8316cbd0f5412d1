//! The cross-spectral matrix of the twelve resultants, for tests without a drive channel.

use super::sum::{Sum, due, less};
use super::{Average, BlockSettings, BlockSpectra, SpectraError};
use crate::geometry::RESULTANTS;

/// Sums per line: twelve real auto spectra and 66 complex cross spectra.
const SUMS: usize = RESULTANTS * RESULTANTS;

/// Sums of the products of all pairs at one line: each is a [`Sum`], whose parts lie apart, so that
/// neighbouring ones can be added to at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossSums {
    sum: [f32; SUMS],
    carry: [f32; SUMS],
}

impl Default for CrossSums {
    fn default() -> Self {
        Self {
            sum: [0.0; SUMS],
            carry: [0.0; SUMS],
        }
    }
}

impl CrossSums {
    /// Sums that were found elsewhere: `cross` of i and j from i on is the real and the imaginary part of
    /// their product.
    #[must_use]
    pub fn of(cross: impl Fn(usize, usize) -> (f64, f64)) -> Self {
        let mut sums = Self::default();
        for i in 0..RESULTANTS {
            sums.set(i, cross(i, i).0);
            for j in i + 1..RESULTANTS {
                let ((re, im), at) = (cross(i, j), pair(i, j));
                sums.set(at.0, re);
                sums.set(at.1, im);
            }
        }
        sums
    }

    fn set(&mut self, n: usize, value: f64) {
        if let (Some(sum), Some(carry)) = (self.sum.get_mut(n), self.carry.get_mut(n)) {
            Sum::of(value).apart(sum, carry);
        }
    }

    fn value(&self, n: usize) -> f64 {
        match (self.sum.get(n), self.carry.get(n)) {
            (Some(sum), Some(carry)) => Sum::joined(*sum, *carry).value(),
            _ => 0.0,
        }
    }
}

/// Running sums of `G_xy = x y*` for all pairs of the twelve resultants.
#[derive(Debug)]
pub struct CrossAverage<'s> {
    sums: &'s mut [CrossSums],
    blocks: u32,
}

impl<'s> CrossAverage<'s> {
    /// An empty average over lent storage, one element a kept line.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn new(
        settings: &BlockSettings,
        storage: &'s mut [CrossSums],
    ) -> Result<Self, SpectraError> {
        let average = Self::resume(settings, storage, 0)?;
        average.sums.fill(CrossSums::default());
        Ok(average)
    }

    /// Takes up sums of `blocks` blocks that an earlier average left in its storage.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn resume(
        settings: &BlockSettings,
        storage: &'s mut [CrossSums],
        blocks: u32,
    ) -> Result<Self, SpectraError> {
        let needed = settings.grid().count;
        let given = storage.len();
        let sums = storage
            .get_mut(..needed)
            .ok_or(SpectraError::Storage { needed, given })?;
        Ok(Self { sums, blocks })
    }

    /// G_ij at line `k`, summed over the blocks: real and imaginary part of `x_i x_j*`. Zero if there is
    /// no such line or resultant.
    #[must_use]
    pub fn cross(&self, i: usize, j: usize, k: usize) -> (f64, f64) {
        let at = |n: usize| self.sums.get(k).map_or(0.0, |line| line.value(n));
        if i.max(j) >= RESULTANTS {
            return (0.0, 0.0);
        }
        if i == j {
            return (at(i), 0.0);
        }
        let (re, im) = pair(i.min(j), i.max(j));
        (at(re), if i < j { at(im) } else { -at(im) })
    }
}

/// Rows of the matrix that are added together, which share what is loaded.
const ROWS: usize = 4;

/// Indices of the real and the imaginary part of the pair i < j. Rows of the matrix lie by fours: the
/// products of their channels with each other, then the real parts of those of the first one with all
/// later ones, their imaginary parts, and the same of the others.
const fn pair(i: usize, j: usize) -> (usize, usize) {
    let four = i - i % ROWS;
    // Each row r before has the two parts of 11 - r products.
    let before = RESULTANTS + four * (2 * RESULTANTS - four - 1);
    let (i, j) = (i - four, j - four);
    if j < ROWS {
        // 0 1, 0 2, 0 3, 1 2, 1 3 and 2 3.
        let own = before + 2 * (i * (2 * ROWS - 1 - i) / 2 + j - i - 1);
        return (own, own + 1);
    }
    let later = RESULTANTS - four - ROWS;
    let re = before + ROWS * (ROWS - 1) + i * 2 * later + j - ROWS;
    (re, re + later)
}

/// A loop over as many items as there are numbers, or fewer. On the chip it is written out, since its code is
/// made small, with loops, rather than fast; and in tests of this crate, which would not see it otherwise.
macro_rules! written_out {
    ($($number:literal)*: for $item:pat in $items:expr => $block:block) => {
        #[cfg(any(target_os = "none", test))]
        {
            let mut items = $items;
            $(
                let _ = $number;
                if let Some($item) = items.next() $block
            )*
        }
        #[cfg(not(any(target_os = "none", test)))]
        for $item in $items $block
    };
}

impl Average for CrossAverage<'_> {
    fn add(&mut self, block: &BlockSpectra<'_>) {
        for CrossSums { sum, carry } in due(self.sums.iter_mut(), self.blocks) {
            for (sum, carry) in sum.iter_mut().zip(carry) {
                let mut both = Sum::joined(*sum, *carry);
                both.settle();
                both.apart(sum, carry);
            }
        }
        // A channel that the block lacks is zero at all lines.
        let mut x = [[0.0; RESULTANTS]; 2];
        for (k, line) in self.sums.iter_mut().enumerate() {
            let Some((auto, cross)) = line.carry.split_first_chunk_mut::<RESULTANTS>() else {
                continue;
            };
            let [re, im] = &mut x;
            let channels = re.iter_mut().zip(&mut *im).zip(block.line(k));
            written_out!(0 1 2 3 4 5 6 7 8 9 10 11: for ((re, im), z) in channels => {
                (*re, *im) = (z.re, z.im);
            });
            add_products(&x, auto, cross);
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
}

/// Adds the products of all channels at one line, each with itself and all pairs: of the real parts of the
/// channels, and the imaginary ones.
fn add_products(x: &[[f32; RESULTANTS]; 2], auto: &mut [f32; RESULTANTS], cross: &mut [f32]) {
    // Written out, so that lengths are known to the compiler.
    let ([first, second, third], _) = auto.as_chunks_mut::<ROWS>() else {
        return;
    };
    let mut rest = cross;
    rest = add_four_rows::<8>(x, first, rest);
    rest = add_four_rows::<4>(x, second, rest);
    add_four_rows::<0>(x, third, rest);
}

/// Adds the products of four rows of the matrix: of the four channels before the last `N`, each with itself, with
/// each other and with those. Returns the carries of the rows after them.
#[inline(always)]
fn add_four_rows<'s, const N: usize>(
    [re, im]: &[[f32; RESULTANTS]; 2],
    auto: &mut [f32; ROWS],
    carries: &'s mut [f32],
) -> &'s mut [f32] {
    let first = RESULTANTS - N - ROWS;
    let rows = |of: &[f32; RESULTANTS]| of.get(first..)?.first_chunk::<ROWS>().copied();
    let (Some(rows_re), Some(rows_im)) = (rows(re), rows(im)) else {
        return carries;
    };
    let (Some(re), Some(im)) = (re.last_chunk::<N>(), im.last_chunk::<N>()) else {
        return carries;
    };
    let ([a, b, c, d], [e, f, g, h]) = (rows_re, rows_im);
    let (a, b, c, d) = ((a, e), (b, f), (c, g), (d, h));
    let [of_a, of_b, of_c, of_d] = auto;
    add_power(of_a, a);
    add_power(of_b, b);
    add_power(of_c, c);
    add_power(of_d, d);
    let Some((own, mut rest)) = carries.split_first_chunk_mut::<{ ROWS * (ROWS - 1) }>() else {
        return &mut [];
    };
    let [p, q, r, s, t, u, v, w, x, y, z, last] = own;
    add_product((p, q), a, b);
    add_product((r, s), a, c);
    add_product((t, u), a, d);
    add_product((v, w), b, c);
    add_product((x, y), b, d);
    add_product((z, last), c, d);
    let mut take = || {
        let (part, others) = core::mem::take(&mut rest).split_first_chunk_mut::<N>()?;
        rest = others;
        Some(part)
    };
    let mut both = || Some((take()?, take()?));
    if let (Some((p, q)), Some((r, s)), Some((t, u)), Some((v, w))) =
        (both(), both(), both(), both())
    {
        let (first, second) = (p.iter_mut().zip(q), r.iter_mut().zip(s));
        let (third, fourth) = (t.iter_mut().zip(u), v.iter_mut().zip(w));
        let sums = first.zip(second).zip(third.zip(fourth));
        let columns = re.iter().zip(im).zip(sums);
        written_out!(
            0 1 2 3 4 5 6 7:
            for ((re, im), ((p, q), (r, s))) in columns => {
                let column = (*re, *im);
                add_product(p, a, column);
                add_product(q, b, column);
                add_product(r, c, column);
                add_product(s, d, column);
            }
        );
    }
    rest
}

/// Adds x x*.
#[inline(always)]
fn add_power(sum: &mut f32, x: (f32, f32)) {
    *sum = less(*sum, [x.0, x.0], [x.1, x.1]);
}

/// Adds x y*.
#[inline(always)]
fn add_product((re, im): (&mut f32, &mut f32), x: (f32, f32), y: (f32, f32)) {
    *re = less(*re, [x.0, y.0], [x.1, y.1]);
    *im = less(*im, [x.1, y.0], [-x.0, y.1]);
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    #[test]
    fn pairs_fill_the_line_without_gap_or_overlap() {
        let mut is_taken = [false; SUMS];
        is_taken[..RESULTANTS].fill(true);
        for i in 0..RESULTANTS {
            for j in i + 1..RESULTANTS {
                let (re, im) = pair(i, j);
                for n in [re, im] {
                    assert!(!core::mem::replace(&mut is_taken[n], true), "{i} {j}");
                }
            }
        }
        assert_eq!(is_taken, [true; SUMS]);
    }

    /// The matrix of thousands of blocks of noise of unlike channels, against products in `f64`.
    #[test]
    fn every_pair_has_its_own_product() {
        use crate::spectra::{Blocks, Window};
        use std::vec;

        let settings = BlockSettings::new(64, 0.5, Window::Hann, 64.0, [1.0, 20.0]).unwrap();
        let [history, work, lines] = Blocks::<[f32; 4]>::storage_len(&settings, RESULTANTS);
        let (mut history, mut work) = (vec![0.0; history], vec![Default::default(); work]);
        let mut lines = vec![Default::default(); lines];
        let blocks =
            Blocks::<[f32; 4]>::new(settings, RESULTANTS, &mut history, &mut work, &mut lines);
        let mut blocks = blocks.unwrap();
        let mut storage = vec![CrossSums::default(); settings.grid().count];
        let mut average = CrossAverage::new(&settings, &mut storage).unwrap();
        let mut exact = vec![[[[0.0; 2]; RESULTANTS]; RESULTANTS]; settings.grid().count];
        let mut state = 1_u32;
        while average.blocks() < 4000 {
            let sample: [f32; RESULTANTS] = core::array::from_fn(|c| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (c + 1) as f32 * ((state >> 8) as f32 / (1 << 23) as f32 - 1.0)
            });
            let Some(block) = blocks.push(&sample) else {
                continue;
            };
            average.add(&block);
            for (k, exact) in exact.iter_mut().enumerate() {
                for (i, exact) in exact.iter_mut().enumerate() {
                    for (j, [re, im]) in exact.iter_mut().enumerate() {
                        let [x, y] = [i, j].map(|c| block.channel(c)[k]);
                        let [a, b, c, d] = [x.re, x.im, y.re, y.im].map(f64::from);
                        *re += a * c + b * d;
                        *im += b * c - a * d;
                    }
                }
            }
        }
        for (k, exact) in exact.iter().enumerate() {
            for (i, row) in exact.iter().enumerate() {
                for (j, [re, im]) in row.iter().enumerate() {
                    let found = average.cross(i, j, k);
                    let size = libm::sqrt(exact[i][i][0] * exact[j][j][0]);
                    let off = libm::hypot(found.0 - re, found.1 - im) / size;
                    // See `Sum`: 5e-7 if all roundings point one way.
                    assert!(off < 5e-7, "{i} {j} at {k}: {off}");
                }
            }
        }
        // Sums that were found elsewhere go where those of an average are.
        let again: vec::Vec<_> = (0..settings.grid().count)
            .map(|k| CrossSums::of(|i, j| average.cross(i, j, k)))
            .collect();
        let mut copy = again.clone();
        let copy = CrossAverage::resume(&settings, &mut copy, 4000).unwrap();
        for k in 0..again.len() {
            for i in 0..RESULTANTS {
                for j in 0..RESULTANTS {
                    assert_eq!(
                        copy.cross(i, j, k),
                        average.cross(i, j, k),
                        "{i} {j} at {k}"
                    );
                }
            }
        }
    }
}

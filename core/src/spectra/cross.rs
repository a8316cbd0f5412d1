//! The cross-spectral matrix of the twelve resultants, for tests without a drive channel.

use super::sum::{Sum, due, less};
use super::{Average, BlockSettings, BlockSpectra, SpectraError};
use crate::geometry::RESULTANTS;
use core::cmp::Ordering;
use core::iter::zip;

/// Sums per line: twelve real auto spectra and 66 complex cross spectra.
const SUMS: usize = RESULTANTS * RESULTANTS;

/// Sums of the products of all pairs at one line: each is a [`Sum`], whose parts lie apart, so that
/// neighbouring ones can be added to at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct CrossSums {
    // First, since terms are added to it: an instruction of the chip reaches 1020 bytes from where an element begins.
    carry: [f32; SUMS],
    sum: [f32; SUMS],
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
            for j in i..RESULTANTS {
                let ((re, im), at) = (cross(i, j), pair(i, j));
                sums.set(at.0, re);
                if i < j {
                    sums.set(at.1, im);
                }
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
        let (re, im) = pair(i.min(j), i.max(j));
        let im = match i.cmp(&j) {
            Ordering::Less => at(im),
            Ordering::Equal => 0.0,
            Ordering::Greater => -at(im),
        };
        (at(re), im)
    }

    /// Adds a block that lacks channels: they are zero at all lines, and add nothing.
    fn add_some(&mut self, block: &BlockSpectra<'_>) {
        for i in 0..RESULTANTS {
            for j in i..RESULTANTS {
                let (re, im) = pair(i, j);
                let products = zip(block.channel(i), block.channel(j));
                for (CrossSums { carry, .. }, (x, y)) in zip(&mut *self.sums, products) {
                    let (x, y) = ((x.re, x.im), (y.re, y.im));
                    if i == j {
                        if let Some(power) = carry.get_mut(re) {
                            add_power(power, x);
                        }
                    } else if let Ok([re, im]) = carry.get_disjoint_mut([re, im]) {
                        add_product((re, im), x, y);
                    }
                }
            }
        }
    }
}

/// Indices of the real and the imaginary part of the pair i <= j. Each row of the matrix has the power of its
/// channel, whose imaginary part is none, then the real parts of its products with all later ones, then the
/// imaginary parts.
const fn pair(i: usize, j: usize) -> (usize, usize) {
    // Each row r before has 1 + 2 (11 - r) sums.
    let re = i * (2 * RESULTANTS - i) + j - i;
    (re, re + RESULTANTS - 1 - i)
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
    #[inline(never)] // What its caller does with each sample is to have the registers.
    fn add(&mut self, block: &BlockSpectra<'_>) {
        for CrossSums { sum, carry } in due(self.sums.iter_mut(), self.blocks) {
            for (sum, carry) in sum.iter_mut().zip(carry) {
                let mut both = Sum::joined(*sum, *carry);
                both.settle();
                both.apart(sum, carry);
            }
        }
        if let Some(channels) = block.resultants() {
            for (CrossSums { carry, .. }, x) in zip(&mut *self.sums, channels) {
                add_products(&x, carry);
            }
        } else {
            self.add_some(block);
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
}

/// Adds the products of all channels at one line, each with itself and all pairs: of the real parts of the
/// channels, and the imaginary ones.
#[inline(always)]
fn add_products(x: &[[f32; RESULTANTS]; 2], carry: &mut [f32; SUMS]) {
    // Written out, so that lengths are known to the compiler.
    let mut rest = &mut carry[..];
    rest = add_row::<11>(x, rest);
    rest = add_row::<10>(x, rest);
    rest = add_row::<9>(x, rest);
    rest = add_row::<8>(x, rest);
    rest = add_row::<7>(x, rest);
    rest = add_row::<6>(x, rest);
    rest = add_row::<5>(x, rest);
    rest = add_row::<4>(x, rest);
    rest = add_row::<3>(x, rest);
    rest = add_row::<2>(x, rest);
    rest = add_row::<1>(x, rest);
    add_row::<0>(x, rest);
}

/// Adds the products of the channel before the last `N` with itself and with those. Returns the carries of the
/// rows after its own.
#[inline(always)]
fn add_row<'s, const N: usize>(
    [re, im]: &[[f32; RESULTANTS]; 2],
    carries: &'s mut [f32],
) -> &'s mut [f32] {
    let own = |of: &[f32; RESULTANTS]| of.iter().nth_back(N).copied();
    if let (Some(own_re), Some(own_im)) = (own(re), own(im))
        && let (Some(re), Some(im)) = (re.last_chunk::<N>(), im.last_chunk::<N>())
        && let Some((power, rest)) = carries.split_first_mut()
        && let Some((of_re, rest)) = rest.split_first_chunk_mut::<N>()
        && let Some((of_im, rest)) = rest.split_first_chunk_mut::<N>()
    {
        let own = (own_re, own_im);
        add_power(power, own);
        let columns = re.iter().zip(im).zip(of_re.iter_mut().zip(of_im));
        written_out!(
            0 1 2 3 4 5 6 7 8 9 10:
            for ((re, im), sums) in columns => {
                add_product(sums, own, (*re, *im));
            }
        );
        return rest;
    }
    &mut []
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
    use crate::spectra::Window;
    use crate::spectra::blocks::of_noise;
    use std::vec;

    #[test]
    fn pairs_fill_the_line_without_gap_or_overlap() {
        let mut is_taken = [false; SUMS];
        for i in 0..RESULTANTS {
            for j in i..RESULTANTS {
                let (re, im) = pair(i, j);
                for n in [re, im].into_iter().take(if i < j { 2 } else { 1 }) {
                    assert!(!core::mem::replace(&mut is_taken[n], true), "{i} {j}");
                }
            }
        }
        assert_eq!(is_taken, [true; SUMS]);
    }

    /// Sums of blocks of which all channels but the first ones are zero, against those of blocks that lack them, to
    /// the last bit.
    #[test]
    fn channels_that_a_block_lacks_are_zero() {
        let settings = BlockSettings::new(16, 0.5, Window::Hann, 16.0, [1.0, 5.0]).unwrap();
        let sums = |channels: usize, there: usize| {
            let mut sums = vec![CrossSums::default(); settings.grid().count];
            let mut average = CrossAverage::new(&settings, &mut sums).unwrap();
            of_noise::<f32>(settings, (channels, there), 40, |block| average.add(block));
            sums
        };
        for there in 1..RESULTANTS {
            let lacking = sums(there, there);
            assert!(
                lacking
                    .iter()
                    .all(|line| line.value(pair(there - 1, there - 1).0) > 0.0)
            );
            assert_eq!(lacking, sums(RESULTANTS, there), "{there}");
        }
        // One that is none of the resultants adds nothing.
        assert_eq!(
            sums(RESULTANTS + 1, RESULTANTS),
            sums(RESULTANTS, RESULTANTS)
        );
    }

    /// The matrix of thousands of blocks of noise of unlike channels, against products in `f64`.
    #[test]
    fn every_pair_has_its_own_product() {
        let settings = BlockSettings::new(64, 0.5, Window::Hann, 64.0, [1.0, 20.0]).unwrap();
        let mut storage = vec![CrossSums::default(); settings.grid().count];
        let mut average = CrossAverage::new(&settings, &mut storage).unwrap();
        let mut exact = vec![[[[0.0; 2]; RESULTANTS]; RESULTANTS]; settings.grid().count];
        of_noise::<[f32; 4]>(settings, (RESULTANTS, RESULTANTS), 4000, |block| {
            average.add(block);
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
        });
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

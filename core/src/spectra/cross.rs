//! The cross-spectral matrix of the twelve resultants, for tests without a drive channel.

use super::sum::settle;
use super::{Average, BlockSettings, BlockSpectra, Complex32, SpectraError, Sum};
use crate::geometry::RESULTANTS;

/// Sums per line: twelve real auto spectra and 66 complex cross spectra.
const SUMS_PER_LINE: usize = RESULTANTS * RESULTANTS;

/// Running sums of `G_xy = x y*` for all pairs of the twelve resultants.
#[derive(Debug)]
pub struct CrossAverage<'s> {
    sums: &'s mut [Sum],
    blocks: u32,
}

impl<'s> CrossAverage<'s> {
    /// Elements of storage.
    #[must_use]
    pub fn storage_len(settings: &BlockSettings) -> usize {
        settings.grid().count * SUMS_PER_LINE
    }

    /// An empty average over lent storage of [`Self::storage_len`].
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn new(settings: &BlockSettings, storage: &'s mut [Sum]) -> Result<Self, SpectraError> {
        let average = Self::resume(settings, storage, 0)?;
        average.sums.fill(Sum::ZERO);
        Ok(average)
    }

    /// Takes up sums of `blocks` blocks that an earlier average left in its storage.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn resume(
        settings: &BlockSettings,
        storage: &'s mut [Sum],
        blocks: u32,
    ) -> Result<Self, SpectraError> {
        let needed = Self::storage_len(settings);
        let given = storage.len();
        let sums = storage
            .get_mut(..needed)
            .ok_or(SpectraError::Storage { needed, given })?;
        Ok(Self { sums, blocks })
    }

    /// G_ij at line `k`, summed over the blocks: real and imaginary part of `x_i x_j*`.
    #[must_use]
    pub fn cross(&self, i: usize, j: usize, k: usize) -> (f64, f64) {
        let at = |n: usize| self.sums.get(k * SUMS_PER_LINE + n).map_or(0.0, Sum::value);
        if i == j {
            (at(i), 0.0)
        } else if i < j {
            let n = pair(i, j);
            (at(n), at(n + 1))
        } else {
            let n = pair(j, i);
            (at(n), -at(n + 1))
        }
    }
}

/// Index of the real part of pair i < j in the sums of a line.
const fn pair(i: usize, j: usize) -> usize {
    let before = i * RESULTANTS - i * (i + 1) / 2;
    RESULTANTS + 2 * (before + j - i - 1)
}

impl Average for CrossAverage<'_> {
    fn add(&mut self, block: &BlockSpectra<'_>) {
        settle(self.sums, SUMS_PER_LINE, self.blocks);
        let (lines, _) = self.sums.as_chunks_mut();
        for (k, sums) in lines.iter_mut().enumerate() {
            let mut x = [Complex32::new(0.0, 0.0); RESULTANTS];
            block.line(k, &mut x);
            add_line(&x, sums);
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
}

/// Adds the products of one line.
fn add_line(x: &[Complex32; RESULTANTS], sums: &mut [Sum; SUMS_PER_LINE]) {
    let (auto, cross) = sums.split_at_mut(RESULTANTS);
    for (sum, x) in auto.iter_mut().zip(x) {
        sum.add([x.re, x.re], [x.im, x.im]);
    }
    // Written out, so that lengths are known to the compiler.
    let mut left: (&[Complex32], &mut [Sum]) = (x, cross);
    left = add_two_rows(left.0, left.1);
    left = add_two_rows(left.0, left.1);
    left = add_two_rows(left.0, left.1);
    left = add_two_rows(left.0, left.1);
    left = add_two_rows(left.0, left.1);
    add_two_rows(left.0, left.1);
}

/// Adds the products of two rows of the matrix, which share what is loaded, and returns what is left:
/// the spectra after both, and the sums of the rows after them.
#[inline(always)]
fn add_two_rows<'x, 's>(
    x: &'x [Complex32],
    sums: &'s mut [Sum],
) -> (&'x [Complex32], &'s mut [Sum]) {
    let [p, q, after @ ..] = x else {
        return (x, sums);
    };
    let Some((own, rest)) = sums.split_first_chunk_mut() else {
        return (&[], &mut []);
    };
    let (of_p, rest) = rest.split_at_mut((2 * after.len()).min(rest.len()));
    let (of_q, rest) = rest.split_at_mut((2 * after.len()).min(rest.len()));
    add_product(own, p, q);
    let (of_p, of_q) = (of_p.as_chunks_mut().0, of_q.as_chunks_mut().0);
    for ((of_p, of_q), z) in of_p.iter_mut().zip(of_q).zip(after) {
        // Before it is used for both rows, since they might share memory for all the compiler knows.
        let z = *z;
        add_product(of_p, p, &z);
        add_product(of_q, q, &z);
    }
    (after, rest)
}

/// Adds x y*.
#[inline(always)]
fn add_product([re, im]: &mut [Sum; 2], x: &Complex32, y: &Complex32) {
    re.add([x.re, y.re], [x.im, y.im]);
    im.add([x.im, y.re], [-x.re, y.im]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_fill_the_line_without_gap_or_overlap() {
        let mut next = RESULTANTS;
        for i in 0..RESULTANTS {
            for j in i + 1..RESULTANTS {
                assert_eq!(pair(i, j), next);
                next += 2;
            }
        }
        assert_eq!(next, SUMS_PER_LINE);
    }
}

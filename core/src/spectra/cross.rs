//! The cross-spectral matrix of the twelve resultants, for tests without a drive channel.

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
        for (k, sums) in self.sums.chunks_exact_mut(SUMS_PER_LINE).enumerate() {
            let x: [Complex32; RESULTANTS] =
                core::array::from_fn(|c| block.channel(c).get(k).copied().unwrap_or_default());
            let (auto, cross) = sums.split_at_mut(RESULTANTS);
            for (sum, x) in auto.iter_mut().zip(&x) {
                sum.add(x.re * x.re + x.im * x.im);
            }
            let mut cross = cross.chunks_exact_mut(2);
            for (i, xi) in x.iter().enumerate() {
                for xj in &x[i + 1..] {
                    if let Some([re, im]) = cross.next() {
                        re.add(xi.re * xj.re + xi.im * xj.im);
                        im.add(xi.im * xj.re - xi.re * xj.im);
                    }
                }
            }
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
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

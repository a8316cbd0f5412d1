//! Averages referred to the drive signal: the cheapest, and free of noise bias.
//!
//! `H = G_xr / G_rr` of every channel x against the generator's drive r. Noise of a
//! sensor does not correlate with the drive, so it averages out of H; only its scatter
//! remains, and the coherence tells how much.

use super::sum::settle;
use super::{
    Average, BlockSettings, BlockSpectra, Complex32, LineGrid, LineRange, SpectraError, Sum,
};
use crate::algebra::{larger, not_negative};
use crate::cells::seen;
use crate::geometry::{PackedNoise, RESULTANTS, ResultantMap};

/// Sums per line: G_rr, and for each channel G_xr (two) and G_xx.
const fn sums_per_line(channels: usize) -> usize {
    1 + 3 * channels
}

/// Running sums of the products with the drive. Channel 0 of the blocks is the drive,
/// channels 1 and up are the responses.
#[derive(Debug)]
pub struct DriveAverage<'s> {
    sums: &'s mut [Sum],
    channels: usize,
    blocks: u32,
}

impl<'s> DriveAverage<'s> {
    /// Elements of storage for `channels` responses (the drive not counted).
    #[must_use]
    pub fn storage_len(settings: &BlockSettings, channels: usize) -> usize {
        settings.grid().count * sums_per_line(channels)
    }

    /// An empty average over lent storage of [`Self::storage_len`].
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn new(
        settings: &BlockSettings,
        channels: usize,
        storage: &'s mut [Sum],
    ) -> Result<Self, SpectraError> {
        let average = Self::resume(settings.grid().count, channels, storage, 0)?;
        average.sums.fill(Sum::ZERO);
        Ok(average)
    }

    /// Takes up the sums of `lines` lines and `blocks` blocks that an earlier average left
    /// in its storage.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if it is too small.
    pub fn resume(
        lines: usize,
        channels: usize,
        storage: &'s mut [Sum],
        blocks: u32,
    ) -> Result<Self, SpectraError> {
        let needed = lines * sums_per_line(channels);
        let given = storage.len();
        let sums = storage
            .get_mut(..needed)
            .ok_or(SpectraError::Storage { needed, given })?;
        Ok(Self {
            sums,
            channels,
            blocks,
        })
    }

    fn line(&self, k: usize) -> &[Sum] {
        let n = sums_per_line(self.channels);
        self.sums.get(k * n..(k + 1) * n).unwrap_or(&[])
    }

    /// G_rr of line `k`, summed over the blocks (unscaled).
    #[must_use]
    pub fn drive_power(&self, k: usize) -> f64 {
        self.line(k).first().map_or(0.0, Sum::value)
    }

    /// G_xr of response `c` (from 0) at line `k`, real and imaginary part.
    #[must_use]
    pub fn cross(&self, c: usize, k: usize) -> (f64, f64) {
        match self.line(k).get(1 + 3 * c..3 + 3 * c) {
            Some([re, im]) => (re.value(), im.value()),
            _ => (0.0, 0.0),
        }
    }

    /// G_xx of response `c` at line `k`.
    #[must_use]
    pub fn power(&self, c: usize, k: usize) -> f64 {
        self.line(k).get(3 + 3 * c).map_or(0.0, Sum::value)
    }

    /// Coherence γ² of response `c` with the drive at line `k`, 0 to 1.
    #[must_use]
    pub fn coherence(&self, c: usize, k: usize) -> f64 {
        let (re, im) = self.cross(c, k);
        let powers = self.drive_power(k) * self.power(c, k);
        if powers > 0.0 {
            share((re * re + im * im) / powers)
        } else {
            0.0
        }
    }

    /// Mean coherence of response `c` with the drive over `band`, 0 to 1, in single
    /// precision: to be told after every block, where [`Self::coherence`] would cost more
    /// than the block itself.
    #[must_use]
    pub fn mean_coherence(&self, c: usize, band: LineRange) -> f32 {
        let lines = band.len().max(1) as f32;
        let mut sum = 0.0;
        for k in band {
            let line = self.line(k);
            if let (Some(rr), Some([re, im, xx])) = (line.first(), line.get(1 + 3 * c..4 + 3 * c)) {
                // Ratios first: products of powers leave the range of `f32`.
                let [rr, re, im, xx] = [rr.rounded(), re.rounded(), im.rounded(), xx.rounded()];
                if rr > 0.0 && xx > 0.0 {
                    sum += (re * (re / rr) + im * (im / rr)) / xx;
                }
            }
        }
        share((sum / lines).into()) as f32
    }
}

/// A coherence that rounding may have taken above one. Where squares overflow it is zero: nothing
/// is known to be explained.
fn share(coherence: f64) -> f64 {
    if coherence.is_nan() {
        0.0
    } else {
        coherence.min(1.0)
    }
}

impl DriveAverage<'_> {
    /// Adds the drive of one block: its lines. The responses of the same block follow by
    /// [`Self::add_response`].
    pub fn add_drive(&mut self, drive: &[Complex32]) {
        let n = sums_per_line(self.channels);
        settle(self.sums, n, self.blocks);
        for (sums, r) in self.sums.chunks_exact_mut(n.max(1)).zip(drive) {
            if let Some(rr) = sums.first_mut() {
                rr.add([r.re, r.re], [r.im, r.im]);
            }
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    /// Adds response `c` of the block whose drive was added last.
    pub fn add_response(&mut self, c: usize, drive: &[Complex32], response: &[Complex32]) {
        let n = sums_per_line(self.channels);
        let at = 1 + 3 * c;
        let products = drive.iter().zip(response);
        for (sums, (r, x)) in self.sums.chunks_exact_mut(n.max(1)).zip(products) {
            if let Some(sums) = sums.get_mut(at..at + 3) {
                add_products(sums, r, x);
            }
        }
    }

    /// Adds response `c` and the next one, which share what is loaded.
    fn add_two_responses(&mut self, c: usize, drive: &[Complex32], responses: [&[Complex32]; 2]) {
        let n = sums_per_line(self.channels);
        let at = 1 + 3 * c;
        let [x, y] = responses;
        let products = drive.iter().zip(x.iter().zip(y));
        for (sums, (r, (x, y))) in self.sums.chunks_exact_mut(n.max(1)).zip(products) {
            if let Some(sums) = sums.get_mut(at..at + 6) {
                let (sums_of_x, sums_of_y) = sums.split_at_mut(3);
                add_products(sums_of_x, r, x);
                add_products(sums_of_y, r, y);
            }
        }
    }
}

/// Adds the products of a response with the drive and with itself to its three sums.
#[inline(always)]
fn add_products(sums: &mut [Sum], r: &Complex32, x: &Complex32) {
    if let [re, im, xx] = sums {
        re.add([x.re, r.re], [x.im, r.im]);
        im.add([x.im, r.re], [-x.re, r.im]);
        xx.add([x.re, x.re], [x.im, x.im]);
    }
}

impl Average for DriveAverage<'_> {
    #[inline(never)] // What its caller does with each sample is to have the registers.
    fn add(&mut self, block: &BlockSpectra<'_>) {
        let drive = block.channel(0);
        self.add_drive(drive);
        let mut c = 0;
        while c < self.channels {
            let (x, y) = (block.channel(c + 1), block.channel(c + 2));
            // Of two that are not both there, the first is.
            if c + 1 < self.channels && x.len() == y.len() {
                self.add_two_responses(c, drive, [x, y]);
                c += 2;
            } else {
                self.add_response(c, drive, x);
                c += 1;
            }
        }
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
}

/// One finished run: the frequency responses of the twelve resultants to the drive,
/// with what the estimators must know of their noise.
#[derive(Clone, Copy, Debug)]
pub struct RunResponses<'a> {
    /// Frequencies of the lines.
    pub grid: LineGrid,
    /// H, line after line, twelve resultants each: `(a, f)` at A per unit drive.
    pub responses: &'a [[Complex32; RESULTANTS]],
    /// G_rr of each line, summed over the blocks.
    pub drive: &'a [f32],
    /// Power per line that does not come from the drive: the expected `G_rr |error of H|²`
    /// of the resultants, averaged over the averaging band, with the correlations that the
    /// sensors' geometry gives it: a packed [`crate::geometry::ResultantNoise`].
    pub noise: PackedNoise,
    /// Blocks averaged.
    pub blocks: u32,
}

impl<'a> RunResponses<'a> {
    /// Finishes an average of the drive and the twelve resultants into lent storage,
    /// one element a line each. `band` are the kept lines over which the noise is taken,
    /// `block_correlation` is [`super::Window::block_correlation`], `map` made the
    /// resultants.
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if the storage is too small, [`SpectraError::OtherLines`] if
    /// the band was chosen from other lines.
    pub fn finish(
        average: &DriveAverage<'_>,
        grid: LineGrid,
        band: LineRange,
        block_correlation: f64,
        map: &ResultantMap,
        responses: &'a mut [[Complex32; RESULTANTS]],
        drive: &'a mut [f32],
    ) -> Result<Self, SpectraError> {
        if band.count() != grid.count {
            let (band, lines) = (band.count(), grid.count);
            return Err(SpectraError::OtherLines { band, lines });
        }
        let needed = grid.count;
        let given = responses.len().min(drive.len());
        let (Some(responses), Some(drive)) = (responses.get_mut(..needed), drive.get_mut(..needed))
        else {
            return Err(SpectraError::Storage { needed, given });
        };
        for (k, (h, r)) in responses.iter_mut().zip(drive.iter_mut()).enumerate() {
            let power = average.drive_power(k);
            *r = power as f32;
            for (c, h) in h.iter_mut().enumerate() {
                let (re, im) = average.cross(c, k);
                *h = if power > 0.0 {
                    Complex32::new((re / power) as f32, (im / power) as f32)
                } else {
                    Complex32::new(0.0, 0.0)
                };
            }
        }
        let lines = band.len().max(1) as f64;
        let mean = |of: &dyn Fn(usize, usize) -> f64| -> [f64; RESULTANTS] {
            core::array::from_fn(|c| band.indices().map(|k| of(c, k)).sum::<f64>() / lines)
        };
        let scatter = mean(&|c, k| noise_power(average, c, k));
        let rounding = map.rounding_power(&mean(&|c, k| average.power(c, k)));
        let powers = core::array::from_fn(|c| {
            larger(
                block_correlation * seen(&scatter[..])[c],
                seen(&rounding[..])[c],
            )
        });
        let noise = map.noise(&powers).packed();
        Ok(Self {
            grid,
            responses,
            drive,
            noise,
            blocks: average.blocks(),
        })
    }
}

/// Power per block that the drive does not explain. One degree of freedom went into H.
fn noise_power(average: &DriveAverage<'_>, c: usize, k: usize) -> f64 {
    let blocks = f64::from(average.blocks());
    let drive = average.drive_power(k);
    if blocks < 2.0 || drive <= 0.0 {
        return 0.0;
    }
    let (re, im) = average.cross(c, k);
    let left = average.power(c, k) - (re * re + im * im) / drive;
    not_negative(left) / (blocks - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two lines of one response, of which the second is silent.
    #[test]
    fn products_with_the_drive() {
        let z = Complex32::new;
        let mut sums = [Sum::ZERO; 8];
        let mut average = DriveAverage::resume(2, 1, &mut sums, 0).unwrap();
        let drive = [z(3.0, 4.0), z(1.0, -2.0)];
        average.add_drive(&drive);
        average.add_response(0, &drive, &[z(1.0, 2.0), z(0.0, 0.0)]);
        assert_eq!(average.blocks(), 1);
        assert_eq!(
            (average.drive_power(0), average.drive_power(1)),
            (25.0, 5.0)
        );
        // (1 + 2j)(3 - 4j)
        assert_eq!(
            (average.cross(0, 0), average.power(0, 0)),
            ((11.0, 2.0), 5.0)
        );
        assert_eq!(
            (average.coherence(0, 0), average.coherence(0, 1)),
            (1.0, 0.0)
        );
        assert_eq!(average.mean_coherence(0, LineRange::all(2)), 0.5);
    }

    /// Responses added two at a time, and by blocks that lack the last ones, against each alone, to the last
    /// bit.
    #[test]
    fn responses_of_a_block_are_added_as_each_alone() {
        extern crate std;
        use crate::spectra::Window;
        use crate::spectra::blocks::of_noise;
        use std::vec;

        const LINES: usize = 5;
        let settings = BlockSettings::new(16, 0.5, Window::Hann, 16.0, [1.0, 5.0]).unwrap();
        for responses in 0..=5 {
            for there in 1..=responses + 1 {
                let mut sums = vec![[Sum::ZERO; 2]; LINES * sums_per_line(responses)];
                let (together, alone) = sums
                    .as_flattened_mut()
                    .split_at_mut(LINES * sums_per_line(responses));
                let mut together = DriveAverage::new(&settings, responses, together).unwrap();
                let mut alone = DriveAverage::new(&settings, responses, alone).unwrap();
                of_noise::<f32>(settings, (there, there), 40, |block| {
                    together.add(block);
                    alone.add_drive(block.channel(0));
                    for c in 0..responses {
                        alone.add_response(c, block.channel(0), block.channel(1 + c));
                    }
                });
                assert_eq!(
                    together.sums, alone.sums,
                    "{there} of {responses} and the drive"
                );
                for c in 0..responses {
                    assert_eq!(together.power(c, 2) > 0.0, c + 1 < there, "{c}, {there}");
                }
            }
        }
    }
}

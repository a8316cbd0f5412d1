//! Runs with several drives at once: each drive's own part of what was measured.
//!
//! # Design
//!
//! Drives are conditioned one after the other: the second one is what the first one does not
//! explain of it, and so on. Drives that are conditioned so have nothing in common, and what
//! is measured is the sum of the parts that come from each: one recording is as many runs as
//! it has drives, of which each is averaged as if its drive had been the only one. Together
//! these responses are `G_xr G_rr⁻¹`, line by line, and what all drives leave is the noise of
//! each. A drive that those before it explain tells nothing new and is left out.

use massline_core::spectra::{
    Average, BlockSettings, BlockSpectra, Complex32, DriveAverage, SpectraError, Sum,
};
use nalgebra::Complex;

/// Share of a drive's power that those before it must leave of it: a copy of another one with
/// 1 % of noise leaves that much.
const OF_ITS_OWN: f64 = 1e-4;

/// Running sums of the products of the drives, which come first in the blocks, with each other
/// and with all channels.
pub(super) struct DrivesAverage {
    drives: usize,
    channels: usize,
    /// Channels of the blocks that are passed over, before the drives.
    before: usize,
    /// First line, and number of lines.
    first: usize,
    lines: usize,
    /// Line by line: the drives' matrix, then each channel's products with the drives and its
    /// power.
    sums: Vec<Complex<f64>>,
    blocks: u32,
}

/// One drive's part of a recording.
pub(super) struct Part {
    /// Number of the drive among those that were named.
    pub(super) drive: usize,
    sums: Vec<Sum>,
}

/// The parts of all drives that have one.
pub(super) struct Parts {
    pub(super) parts: Vec<Part>,
    /// Drives that those before them explain.
    pub(super) dependent: Vec<usize>,
    /// Blocks of each part, so that the noise has the degrees of freedom which all drives leave.
    pub(super) blocks: u32,
    channels: usize,
    lines: usize,
    /// Line by line, what all drives together explain of each channel, 0 to 1.
    pub(super) coherence: Vec<Vec<f64>>,
    /// Line by line, the power of each channel.
    pub(super) power: Vec<Vec<f64>>,
}

impl DrivesAverage {
    pub(super) fn new(settings: &BlockSettings, drives: usize, channels: usize) -> Self {
        Self::within(0..settings.grid().count, 0, drives, channels)
    }

    /// The same over some of the lines, of blocks that have other channels before the drives.
    pub(super) fn within(
        band: std::ops::Range<usize>,
        before: usize,
        drives: usize,
        channels: usize,
    ) -> Self {
        let each = drives * drives + channels * (drives + 1);
        let lines = band.len();
        Self {
            drives,
            channels,
            before,
            first: band.start,
            lines,
            sums: vec![Complex::default(); lines * each],
            blocks: 0,
        }
    }

    /// The sums of some lines from another average, by line and place among those of a line.
    pub(super) fn of_sums(
        band: &std::ops::Range<usize>,
        (drives, channels): (usize, usize),
        blocks: u32,
        sum: &dyn Fn(usize, usize) -> Complex<f64>,
    ) -> Self {
        let mut found = Self::within(band.clone(), 0, drives, channels);
        let each = found.each().max(1);
        for (line, sums) in band.clone().zip(found.sums.chunks_exact_mut(each)) {
            for (at, slot) in sums.iter_mut().enumerate() {
                *slot = sum(line, at);
            }
        }
        Self { blocks, ..found }
    }

    /// The same of some of the lines.
    pub(super) fn of_lines(&self, band: &std::ops::Range<usize>) -> Self {
        let each = self.each();
        let count = (self.drives, self.channels);
        Self::of_sums(band, count, self.blocks, &|line, at| {
            self.sums[line * each + at]
        })
    }

    /// What was summed since these sums, which are of the same lines.
    pub(super) fn since(mut self, earlier: &Self) -> Self {
        for (sum, before) in self.sums.iter_mut().zip(&earlier.sums) {
            *sum -= before;
        }
        self.blocks -= earlier.blocks;
        self
    }

    /// Number of lines.
    pub(super) fn lines(&self) -> usize {
        self.lines
    }

    /// Number of channels beside the drives.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// `true` if there are drives only.
    pub(super) fn has_no_channels(&self) -> bool {
        self.channels == 0
    }

    /// `true` if there is one drive.
    pub(super) fn has_one_drive(&self) -> bool {
        self.drives == 1
    }

    fn each(&self) -> usize {
        self.drives * self.drives + self.channels * (self.drives + 1)
    }

    /// Product of drives `i` and `j`.
    pub(super) fn between(&self, line: usize, i: usize, j: usize) -> Complex<f64> {
        self.sums[line * self.each() + i * self.drives + j]
    }

    /// Product of a channel and a drive, and at the number of drives its power.
    pub(super) fn with(&self, line: usize, channel: usize, drive: usize) -> Complex<f64> {
        let at = self.drives * self.drives + channel * (self.drives + 1);
        self.sums[line * self.each() + at + drive]
    }

    /// The part of each drive. Which ones depend on others is judged over the lines `band`.
    pub(super) fn parts(&self, band: std::ops::Range<usize>) -> Parts {
        let (used, dependent) = self.independent(band);
        let count = used.len();
        let mut sums: Vec<Vec<Sum>> = (0..count).map(|_| Vec::new()).collect();
        let (mut coherence, mut power) = (Vec::new(), Vec::new());
        for line in 0..self.lines {
            let (l, own) = self.factor(line, &used);
            for (sums, own) in sums.iter_mut().zip(&own) {
                sums.push(Sum::of(*own));
            }
            let (mut shares, mut powers) = (Vec::new(), Vec::new());
            for channel in 0..self.channels {
                let cross = self.conditioned(line, channel, &used, &l);
                let whole = self.with(line, channel, self.drives).re;
                let explained: Vec<f64> = cross
                    .iter()
                    .zip(&own)
                    .map(|(g, d)| if *d > 0.0 { g.norm_sqr() / d } else { 0.0 })
                    .collect();
                let all: f64 = explained.iter().sum();
                let left = (whole - all).max(0.0);
                for (i, sums) in sums.iter_mut().enumerate() {
                    sums.extend([cross[i].re, cross[i].im, explained[i] + left].map(Sum::of));
                }
                shares.push(if whole > 0.0 {
                    (all / whole).min(1.0)
                } else {
                    0.0
                });
                powers.push(whole);
            }
            coherence.push(shares);
            power.push(powers);
        }
        let parts = used.iter().zip(sums);
        Parts {
            parts: parts.map(|(&drive, sums)| Part { drive, sums }).collect(),
            dependent,
            blocks: (self.blocks + 1).saturating_sub(count as u32),
            channels: self.channels,
            lines: self.lines,
            coherence,
            power,
        }
    }

    /// The drives that have parts of their own over the lines `band`, and those that the ones before them explain.
    pub(super) fn independent(&self, band: std::ops::Range<usize>) -> (Vec<usize>, Vec<usize>) {
        let mut used: Vec<usize> = Vec::new();
        let mut dependent = Vec::new();
        for drive in 0..self.drives {
            used.push(drive);
            let last = used.len() - 1;
            let (mut own, mut all) = (0.0, 0.0);
            for line in band.clone() {
                own += self.factor(line, &used).1[last];
                all += self.between(line, drive, drive).re;
            }
            if own.is_nan() || own <= OF_ITS_OWN * all {
                used.pop();
                dependent.push(drive);
            }
        }
        (used, dependent)
    }

    /// Products of a channel with the parts that the drives `used` have of their own, from `G_xr = G_xr' Lᴴ`.
    pub(super) fn conditioned(
        &self,
        line: usize,
        channel: usize,
        used: &[usize],
        l: &[Complex<f64>],
    ) -> Vec<Complex<f64>> {
        let mut cross: Vec<Complex<f64>> = Vec::with_capacity(used.len());
        for (i, drive) in used.iter().enumerate() {
            let mut value = self.with(line, channel, *drive);
            for (j, before) in cross.iter().enumerate() {
                value -= before * l[i * used.len() + j].conj();
            }
            cross.push(value);
        }
        cross
    }

    /// `G_rr = L D Lᴴ` of the drives `used`: L row by row, and D.
    pub(super) fn factor(&self, line: usize, used: &[usize]) -> (Vec<Complex<f64>>, Vec<f64>) {
        let n = used.len();
        let mut l = vec![Complex::default(); n * n];
        let mut d = vec![0.0; n];
        for i in 0..n {
            for j in 0..=i {
                let mut value = self.between(line, used[i], used[j]);
                for k in 0..j {
                    value -= l[i * n + k] * d[k] * l[j * n + k].conj();
                }
                if i == j {
                    d[i] = value.re.max(0.0);
                    l[i * n + i] = Complex::new(1.0, 0.0);
                } else if d[j] > 0.0 {
                    l[i * n + j] = value / d[j];
                }
            }
        }
        (l, d)
    }
}

/// A line in double precision.
pub(super) fn wide(z: &Complex32) -> Complex<f64> {
    Complex::new(f64::from(z.re), f64::from(z.im))
}

impl DrivesAverage {
    /// Takes a block, whose channels are given by their numbers.
    pub(super) fn add_channels<'a>(&mut self, block: &dyn Fn(usize) -> &'a [Complex32]) {
        let each = self.each();
        let n = self.drives;
        let all: Vec<&[Complex32]> = (0..n + self.channels)
            .map(|channel| {
                let lines = block(self.before + channel).get(self.first..);
                lines.unwrap_or_default()
            })
            .collect();
        let mut x = vec![Complex::default(); all.len()];
        for (line, sums) in self.sums.chunks_exact_mut(each.max(1)).enumerate() {
            for (x, lines) in x.iter_mut().zip(&all) {
                *x = lines.get(line).map(wide).unwrap_or_default();
            }
            let (drives, channels) = x.split_at(n);
            let (of_drives, of_channels) = sums.split_at_mut(n * n);
            for (sums, r) in of_drives.chunks_exact_mut(n.max(1)).zip(drives) {
                for (sum, s) in sums.iter_mut().zip(drives) {
                    *sum += r * s.conj();
                }
            }
            for (sums, x) in of_channels.chunks_exact_mut(n + 1).zip(channels) {
                for (sum, r) in sums.iter_mut().zip(drives) {
                    *sum += x * r.conj();
                }
                if let Some(power) = sums.last_mut() {
                    *power += x.norm_sqr();
                }
            }
        }
        self.blocks = self.blocks.saturating_add(1);
    }
}

impl Average for DrivesAverage {
    fn add(&mut self, block: &BlockSpectra<'_>) {
        self.add_channels(&|c| block.channel(c));
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
}

impl Parts {
    /// One drive's part, as an average over that drive alone.
    pub(super) fn average<'s>(&self, part: &'s mut Part) -> Result<DriveAverage<'s>, SpectraError> {
        DriveAverage::resume(self.lines, self.channels, &mut part.sums, self.blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::BlockStorage;
    use massline_core::spectra::Window;

    /// Three drives, of which the second holds half of the first and the third is the sum of
    /// both, and a channel that follows the first two with gains 2 and -3.
    #[test]
    fn each_drive_has_its_own_part_and_a_dependent_one_none() {
        let settings = BlockSettings::new(256, 0.5, Window::Hann, 256.0, [1.0, 60.0]).unwrap();
        let (drives, channels) = (3, 1);
        let all = drives + channels;
        let mut storage = BlockStorage::new(settings, all);
        let mut blocks = storage.blocks().unwrap();
        let mut average = DrivesAverage::new(&settings, drives, channels);
        let mut state = 88_172_645_463_325_252_u64;
        let mut uniform = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        while average.blocks() < 100 {
            let (p, q, noise) = (uniform(), uniform(), 0.1 * uniform());
            let (first, second) = (p, 0.5 * p + q);
            let x = 2.0 * first - 3.0 * second + noise;
            if let Some(block) = blocks.push(&[first, second, first + second, x]) {
                average.add(&block);
            }
        }
        let mut found = average.parts(0..60);
        assert_eq!(found.dependent, [2]);
        let drives: Vec<usize> = found.parts.iter().map(|p| p.drive).collect();
        assert_eq!(drives, [0, 1]);
        // The channel's noise is a tenth; it leaves 0.01 of 1.25 + 9 in all, and of the
        // responses' squares what 100 overlapping blocks leave: 2 % of a gain at a line.
        let mean: f64 = found.coherence.iter().map(|c| c[0]).sum::<f64>() / 60.0;
        assert!((0.998..0.9995).contains(&mean), "{mean}");
        let mut parts = std::mem::take(&mut found.parts);
        // The first drive as it is: with its half in the second one, 2 - 3/2.
        // What the second drive adds is chance to the first: a response of 3 beside a drive of 1
        // in some 95 independent blocks scatters by 3 / sqrt(2 * 95) = 0.22 a line, and by 0.035
        // in the mean of 60 lines of which two thirds are independent. Beside the second drive
        // only the channel's own tenth is left, a thirtieth of that. Bounds are 4.5 deviations.
        for (part, (gain, bound)) in parts.iter_mut().zip([(0.5, 0.16), (-3.0, 0.006)]) {
            let average = found.average(part).unwrap();
            let (mut real, mut imaginary) = (0.0, 0.0);
            for line in 0..60 {
                let (re, im) = average.cross(0, line);
                real += re / average.drive_power(line) / 60.0;
                imaginary += im / average.drive_power(line) / 60.0;
            }
            assert!((real - gain).abs() < bound, "{real}, expected {gain}");
            assert!(imaginary.abs() < bound, "{imaginary}");
        }
    }
}

//! Overlapping blocks out of a stream of samples, transformed as soon as they are complete.

use super::history::{Compiled, Rings};
use super::lane::Complex;
use super::settings::{BlockSettings, enough};
use super::{Complex32, SpectraError};
use crate::geometry::RESULTANTS;
use core::iter::zip;

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

    /// The kept lines of the first twelve channels, line after line: the real parts of all, and the imaginary
    /// ones. `None` if there are fewer channels.
    #[inline(always)]
    pub(super) fn resultants(&self) -> Option<impl Iterator<Item = [[f32; RESULTANTS]; 2]>> {
        let mut channels = self.lines.chunks_exact(self.count.max(1));
        let mut twelve = [&[][..]; RESULTANTS];
        for channel in &mut twelve {
            *channel = channels.next()?;
        }
        // Each by its name, so that the numbers of a line stay in registers.
        let [a, b, c, d, e, f, g, h, i, j, k, l] = twelve;
        let (ad, eh, il) = (
            zip(zip(a, b), zip(c, d)),
            zip(zip(e, f), zip(g, h)),
            zip(zip(i, j), zip(k, l)),
        );
        let lines = zip(zip(ad, eh), il);
        Some(lines.map(
            #[inline(always)]
            |((((a, b), (c, d)), ((e, f), (g, h))), ((i, j), (k, l)))| {
                [
                    [
                        a.re, b.re, c.re, d.re, e.re, f.re, g.re, h.re, i.re, j.re, k.re, l.re,
                    ],
                    [
                        a.im, b.im, c.im, d.im, e.im, f.im, g.im, h.im, i.im, j.im, k.im, l.im,
                    ],
                ]
            },
        ))
    }
}

/// Blocks of all channels out of a stream, each transformed as soon as it is complete: channel by
/// channel, or four or eight at a time as `Blocks<[f32; 4]>` and `Blocks<[f32; 8]>`, where the processor
/// calculates with as many numbers at once. The spectra have the same bits.
#[derive(Debug)]
pub struct Blocks<'s, L = f32> {
    rings: Rings<L>,
    history: &'s mut [f32],
    work: &'s mut [Complex<L>],
    lines: &'s mut [Complex32],
}

impl<'s, L: Compiled> Blocks<'s, L> {
    /// Elements of storage for blocks of `channels` channels, in whole groups: of `history`, `work` and
    /// `lines`.
    #[must_use]
    pub fn storage_len(settings: &BlockSettings, channels: usize) -> [usize; 3] {
        [
            Rings::<L>::storage_len(settings, channels),
            settings.transform_length() / 2,
            settings.lines_len(channels.next_multiple_of(L::WIDTH)),
        ]
    }

    /// Blocks of `channels` channels in lent storage of [`Self::storage_len`].
    ///
    /// # Errors
    /// [`SpectraError::Storage`] if one of them is too small.
    pub fn new(
        settings: BlockSettings,
        channels: usize,
        history: &'s mut [f32],
        work: &'s mut [Complex<L>],
        lines: &'s mut [Complex32],
    ) -> Result<Self, SpectraError> {
        let [_, work_len, lines_len] = Self::storage_len(&settings, channels);
        enough(lines.len(), lines_len)?;
        enough(work.len(), work_len)?;
        let rings = Rings::new(settings, channels, history)?;
        Ok(Self {
            rings,
            history,
            work,
            lines,
        })
    }

    /// Takes one sample of every channel; a channel that `sample` lacks reads zero.
    /// Returns the spectra whenever a block is complete.
    #[inline(always)]
    pub fn push(&mut self, sample: &[f32]) -> Option<BlockSpectra<'_>> {
        if !self.rings.push(self.history, sample) {
            return None;
        }
        Some(self.transform())
    }

    /// The spectra of the block that is complete.
    #[inline(never)] // Storing a sample is to be short.
    fn transform(&mut self) -> BlockSpectra<'_> {
        let count = self.rings.settings().grid().count;
        let groups = self.lines.chunks_mut((L::WIDTH * count).max(1));
        for (group, lines) in groups.enumerate().take(self.rings.groups()) {
            self.rings.transform(group, self.history, self.work, lines);
        }
        BlockSpectra {
            lines: self.lines,
            count,
        }
    }
}

/// Blocks of `channels` channels, of which the first `there` are noise of rising level and the others zero.
#[cfg(test)]
pub(super) fn of_noise<L: Compiled>(
    settings: BlockSettings,
    (channels, there): (usize, usize),
    blocks: usize,
    mut each: impl FnMut(&BlockSpectra<'_>),
) {
    extern crate std;
    use std::vec;

    let [history, work, lines] = Blocks::<L>::storage_len(&settings, channels);
    let (mut history, mut work) = (vec![0.0; history], vec![Complex::default(); work]);
    let mut lines = vec![Complex32::default(); lines];
    let made = Blocks::<L>::new(settings, channels, &mut history, &mut work, &mut lines);
    let (mut made, mut state, mut left) = (made.unwrap(), 1_u32, blocks);
    while left > 0 {
        let noise = (0..there).map(|c| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (c + 1) as f32 * ((state >> 8) as f32 / (1 << 23) as f32 - 1.0)
        });
        if let Some(block) = made.push(&noise.collect::<vec::Vec<f32>>()) {
            each(&block);
            left -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::spectra::{Average, DriveAverage, Sum, Window};
    use core::f64::consts::PI;

    const N: usize = 1024;

    /// Responses of a channel that is the drive times `gain(line)`, both periodic in the
    /// block with power on every line of `lines`.
    fn response(
        settings: BlockSettings,
        lines: impl Iterator<Item = usize> + Clone,
        gain: impl Fn(usize) -> f64,
    ) -> [(f64, f64); 96] {
        let mut history = [0.0; 8192];
        let mut work = [Complex32::new(0.0, 0.0); N];
        let mut kept = [Complex32::new(0.0, 0.0); 2 * 96];
        let mut sums = [Sum::ZERO; 4 * 96];
        let mut blocks = Blocks::new(settings, 2, &mut history, &mut work, &mut kept).unwrap();
        let mut average = DriveAverage::new(&settings, 1, &mut sums).unwrap();
        for n in 0..4 * N {
            let (mut x, mut y) = (0.0, 0.0);
            for k in lines.clone() {
                // A phase that differs from line to line keeps the crest low.
                let phase = 2.0 * PI * ((k * n % N) as f64 / N as f64) + (k * k) as f64;
                x += libm::cos(phase);
                y += gain(k) * libm::sin(phase);
            }
            if let Some(block) = blocks.push(&[x as f32, y as f32]) {
                average.add(&block);
            }
        }
        assert!(average.blocks() >= 4);
        core::array::from_fn(|k| {
            let (re, im) = average.cross(0, k);
            let power = average.drive_power(k);
            (re / power, im / power)
        })
    }

    fn settings() -> BlockSettings {
        // Lines 1 to 96 at 512 Hz.
        BlockSettings::new(N, 0.5, Window::Hann, 512.0, [0.5, 48.0]).unwrap()
    }

    #[test]
    fn lines_of_a_fifth_of_the_spectrum_are_decimated_by_four() {
        assert_eq!(settings().decimation(), 4);
        assert_eq!(settings().transform_length(), 256);
        assert_eq!(settings().without_decimation().decimation(), 1);
    }

    #[test]
    fn what_folds_back_is_gone() {
        // A gain of 2 in quadrature on the kept lines, of 1000 on all that fold onto them.
        let all = (2..510).step_by(3);
        let gain = |k: usize| if k <= 96 { 2.0 } else { 1000.0 };
        let h = response(settings(), all.clone(), gain);
        for k in all.filter(|k| *k <= 96) {
            let (re, im) = h[k - 1];
            // Folded lines: 1000 times the stop band's 5e-6, four of them at most; they
            // are lines of their own here and do not average out. f32 adds 1e-6 of the
            // largest amplitudes' sum, 140 lines of 1000 rms: 1e-2.
            assert!(
                re.abs() < 2e-2 && (im + 2.0).abs() < 2e-2,
                "line {k}: {re} {im}"
            );
        }
    }

    #[test]
    fn decimation_leaves_the_response_alone() {
        let lines = (2..97).step_by(2);
        let gain = |k: usize| 1.0 + k as f64 / 50.0;
        for settings in [settings(), settings().without_decimation()] {
            let h = response(settings, lines.clone(), gain);
            for k in lines.clone() {
                let (re, im) = h[k - 1];
                // f32 transforms: 4e-7 of the RMS spectrum a line, 1e-6 with the filters.
                assert!(re.abs() < 4e-6, "line {k}: {re}");
                assert!((im + gain(k)).abs() < 8e-6, "line {k}: {im}");
            }
        }
    }

    /// Responses from decimated blocks against those from the same samples at the full rate in `f64`,
    /// for a structure with a mode in the band, and two above it that fold back into it and are ten
    /// times as large there as what they fold onto; 1 % noise.
    #[test]
    fn decimation_adds_less_than_a_hundredth_of_the_scatter() {
        const LINES: usize = 64;
        const BLOCKS: usize = 24;
        let settings = BlockSettings::new(N, 0.5, Window::Hann, 512.0, [0.5, 32.0]).unwrap();
        let mut state = 1_u64;
        // Twelve uniform numbers are nearly a normal one.
        let mut noise = || {
            (0..12).fold(-6.0, |sum, _| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                sum + (state >> 11) as f64 / (1_u64 << 53) as f64
            })
        };
        let modes = [(20.0, 0.02, 1.0), (110.0, 0.01, 0.3), (240.0, 0.01, 0.3)];
        let mut states = [[0.0; 2]; 3];
        let length = N + (BLOCKS + 1) * N / 2;
        let mut samples = std::vec::Vec::new();
        for _ in 0..length {
            let drive = f64::from(noise() as f32);
            let mut response = 0.0;
            for ((f, damping, gain), state) in modes.into_iter().zip(&mut states) {
                let omega = 2.0 * PI * f / 512.0;
                let radius = libm::exp(-damping * omega);
                let next = gain * drive + 2.0 * radius * libm::cos(omega) * state[0]
                    - radius * radius * state[1];
                *state = [next, state[0]];
                response += next;
            }
            let response = response + drive;
            samples.push([drive, f64::from((response + 0.05 * noise()) as f32)]);
        }

        let (mut history, mut work) = ([0.0; 2048], [Complex32::new(0.0, 0.0); 128]);
        let mut kept = [Complex32::new(0.0, 0.0); 2 * LINES];
        let mut sums = [Sum::ZERO; 4 * LINES];
        let mut blocks = Blocks::new(settings, 2, &mut history, &mut work, &mut kept).unwrap();
        let mut average = DriveAverage::new(&settings, 1, &mut sums).unwrap();
        let mut ends = std::vec::Vec::new();
        for (n, sample) in samples.iter().enumerate() {
            if let Some(block) = blocks.push(&sample.map(|x| x as f32)) {
                average.add(&block);
                ends.push(n);
            }
        }

        let cosine: std::vec::Vec<f64> = (0..N)
            .map(|n| libm::cos(2.0 * PI * n as f64 / N as f64))
            .collect();
        let (mut difference, mut scatter) = (0.0, 0.0);
        for line in 1..=LINES {
            let (mut rr, mut xx, mut xr) = (0.0, 0.0, [0.0; 2]);
            for end in &ends {
                // The filters delay low frequencies by 1.6 samples, and by 2.7 of every second one: by
                // 2 (1 - c)/(1 + c) in each section of second samples.
                let first = end + 4 - N - 7;
                let mut sum = [[0.0; 2]; 2];
                for (n, sample) in samples[first..first + N].iter().enumerate() {
                    let window = 0.5 - 0.5 * cosine[n];
                    let (c, s) = (cosine[n * line % N], cosine[(n * line + N / 4) % N]);
                    for (sum, x) in sum.iter_mut().zip(sample) {
                        sum[0] += window * c * x;
                        sum[1] += window * s * x;
                    }
                }
                let [r, x] = sum;
                rr += r[0] * r[0] + r[1] * r[1];
                xx += x[0] * x[0] + x[1] * x[1];
                xr[0] += x[0] * r[0] + x[1] * r[1];
                xr[1] += x[1] * r[0] - x[0] * r[1];
            }
            let (re, im) = average.cross(0, line - 1);
            let power = average.drive_power(line - 1);
            difference += (re / power - xr[0] / rr).powi(2) + (im / power - xr[1] / rr).powi(2);
            let explained = (xr[0] * xr[0] + xr[1] * xr[1]) / rr;
            scatter += (xx - explained) / rr / ends.len() as f64;
        }
        let share = libm::sqrt(difference / scatter);
        std::println!("{share}");
        assert!(ends.len() >= BLOCKS && share < 0.01, "{share}");
    }

    /// Channels one by one, by fours and by eights, with the last group half empty or not, at the full
    /// rate and behind each filter, with hops that are no whole batch of them.
    #[test]
    fn some_at_once_have_the_bits_of_one_by_one() {
        fn spectra<L: Compiled>(
            settings: BlockSettings,
            channels: usize,
            others: usize,
        ) -> std::vec::Vec<[u32; 2]> {
            let nothing = Complex32::new(0.0, 0.0);
            let [history, work, lines] = Blocks::<L>::storage_len(&settings, channels);
            let mut history = std::vec![0.0; history];
            let mut work = std::vec![Complex::default(); work];
            let mut lines = std::vec![nothing; lines];
            let blocks = Blocks::<L>::new(settings, channels, &mut history, &mut work, &mut lines);
            let mut blocks = blocks.unwrap();
            let (mut found, mut state) = (std::vec::Vec::new(), 1_u32);
            for n in 0..3000 {
                let mut sample = std::vec::Vec::new();
                for c in 0..channels {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    sample.push((state >> 8) as f32 * [1e-9, 1.0, 1e9][c % 3]);
                }
                if n % 1000 == 999 {
                    // A sample that lacks channels.
                    sample.truncate(channels / 2);
                }
                if n % 1000 == 499 {
                    // One that has too many.
                    sample.resize(channels + others, 1e30);
                }
                if let Some(block) = blocks.push(&sample) {
                    for c in 0..channels {
                        let lines = block.channel(c).iter();
                        found.extend(lines.map(|z| [z.re, z.im].map(f32::to_bits)));
                    }
                }
            }
            found
        }
        for window in [Window::Rectangular, Window::Hann, Window::FlatTop] {
            for (length, overlap, lines) in [
                (1024, 0.5, 64.0),
                (1024, 0.5, 63.0),
                (1024, 0.3, 130.0),
                (512, 0.9, 200.0),
                (256, 0.7, 3.0),
                (32, 0.0, 10.0),
            ] {
                let rate = length as f64;
                let settings = BlockSettings::new(length, overlap, window, rate, [1.0, lines]);
                let settings = settings.unwrap();
                for settings in [settings, settings.without_decimation()] {
                    for channels in 1..=9 {
                        let one = spectra::<f32>(settings, channels, 0);
                        let four = spectra::<[f32; 4]>(settings, channels, 7);
                        let eight = spectra::<[f32; 8]>(settings, channels, 40);
                        assert!(!one.is_empty());
                        assert!(one == four, "{settings:?}, {channels} channels");
                        assert!(one == eight, "{settings:?}, {channels} channels");
                    }
                }
            }
        }
    }
}

//! What the filters of a decimation take from lines, given back line by line.

use super::MAX_BLOCK_LENGTH;
use super::fft::{SHORTEST, circle};
use super::half_band::{MAX_STAGES, NARROW_EARLY, NARROW_LAST};

/// Half of one over the response of the filters of one stage at the first n/2 lines of its longest block,
/// then of one half as long, and so on; after those the same of two stages, and so on.
static GAINS: [f32; MAX_BLOCK_LENGTH] = {
    let mut table = [0.0; MAX_BLOCK_LENGTH];
    let (mut begin, mut stages) = (0, 1);
    while stages <= MAX_STAGES {
        let mut n = MAX_BLOCK_LENGTH >> stages;
        while n >= SHORTEST {
            let mut k = 0;
            while k < n / 2 {
                table[begin + k] = (0.5 / response(stages, k, n)) as f32;
                k += 1;
            }
            begin += k;
            n /= 2;
        }
        stages += 1;
    }
    table
};

/// Response at line k of a block of `n` decimated samples, the delay left out.
const fn response(stages: usize, k: usize, n: usize) -> f64 {
    // Distances from the middle in periods of the filter's input: 0, 1, 2, …
    let mut response = 1.0;
    let mut i = 0;
    while i < NARROW_LAST.len() {
        response += 2.0 * NARROW_LAST[i] as f64 * circle(k * (i + 1), 2 * n).0;
        i += 1;
    }
    let mut stage = 1;
    while stage < stages {
        // 1/2, 3/2, …
        let period = (2 * n) << (stage + 1);
        let mut sum = 2.0 * circle(k, period).0;
        let mut i = 0;
        while i < NARROW_EARLY.len() {
            sum += 2.0 * NARROW_EARLY[i] as f64 * circle(k * (2 * i + 3), period).0;
            i += 1;
        }
        response *= sum;
        stage += 1;
    }
    response
}

/// Gains of the lines of blocks that so many stages decimate.
#[derive(Clone, Copy)]
pub(super) struct Gains {
    stages: usize,
}

impl Gains {
    /// Those of `stages` stages, 1 to [`MAX_STAGES`], whose filters have no pass band.
    pub(super) fn of(stages: usize) -> Self {
        Self { stages }
    }

    /// Those of a block of `n` decimated samples: of the line 0 and up to the one before half the rate.
    pub(super) fn of_block(self, n: usize) -> &'static [f32] {
        // Blocks of a stage have MAX_BLOCK_LENGTH >> stages lines in all, less those of the shorter ones
        // that there are not.
        let all = |stages: usize| (MAX_BLOCK_LENGTH >> stages) - SHORTEST / 2;
        let begin: usize = (1..self.stages).map(all).sum();
        let begin = begin + (MAX_BLOCK_LENGTH >> self.stages).saturating_sub(n);
        GAINS.get(begin..begin + n / 2).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use crate::spectra::{BlockSettings, Blocks, Complex32, Window};
    use core::f64::consts::PI;

    /// A tone on any line has the magnitude of its samples' transform, whatever the filters take from it.
    #[test]
    fn a_tone_is_as_large_as_without_filters() {
        const N: usize = 512;
        for (last, stages) in [(64, 1), (32, 2), (16, 3), (8, 4)] {
            let band = [1.0, f64::from(last)];
            let settings = BlockSettings::new(N, 0.5, Window::Rectangular, N as f64, band).unwrap();
            assert_eq!(settings.transform_length(), N >> stages);
            for line in [1, last / 3, last - 1, last] {
                let (mut history, mut work) = ([0.0; 4096], [Complex32::default(); 128]);
                let mut kept = [Complex32::default(); 64];
                let blocks = Blocks::new(settings, 1, &mut history, &mut work, &mut kept);
                let mut blocks = blocks.unwrap();
                let mut found = 0;
                for n in 0..3 * N as i32 {
                    let phase = 2.0 * PI * f64::from(n * line % N as i32) / N as f64;
                    let Some(block) = blocks.push(&[libm::cos(phase) as f32]) else {
                        continue;
                    };
                    for (k, z) in (1..).zip(block.channel(0)) {
                        let own = if k == line {
                            (N >> stages) as f32 / 2.0
                        } else {
                            0.0
                        };
                        let off = (z.norm_sqr().sqrt() - own) / (N >> stages) as f32;
                        // Roundings of two filters and eight stages.
                        assert!(off.abs() < 1e-6, "{line} of {last}, {k}: {off}");
                    }
                    found += 1;
                }
                assert!(found > 2);
            }
        }
    }
}

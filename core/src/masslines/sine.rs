//! Frequency responses given line by line: stepped sine tests, or any other source.

use super::Moments;
use super::lines::{Amplitudes, Internals, Lines};
use crate::geometry::{RESULTANTS, ResultantNoise};
use crate::spectra::listed;
use nalgebra::{Complex, Vector6};

/// Frequency responses of the twelve resultants, one run.
#[derive(Clone, Copy, Debug)]
pub struct SineRun<'a> {
    /// `(a, f)` at A for each line, in any common unit of excitation.
    pub responses: &'a [[Complex<f64>; RESULTANTS]],
    /// Covariance of the noise of the resultants per line, and at least their resolution.
    pub noise: ResultantNoise,
}

/// Fewest lines whose misfit tells noise.
const MIN_NEIGHBOURS: usize = 5;

impl SineRun<'_> {
    /// The noise of responses that nobody repeated: by how much each line misses the cubic
    /// through its two neighbours on either side. Below the first mode a response is so
    /// smooth that next to nothing of the structure is in it, and what is makes the noise
    /// larger, not smaller.
    ///
    /// `responses` and `frequencies` (Hz, ascending) are those of the averaging band. `None`
    /// below five lines.
    #[must_use]
    pub fn noise_of_neighbours(
        frequencies: &[f64],
        responses: &[[Complex<f64>; RESULTANTS]],
    ) -> Option<ResultantNoise> {
        let mut noise = ResultantNoise::NONE;
        let mut count = 0.0;
        let windows = frequencies.windows(MIN_NEIGHBOURS);
        for (f, x) in windows.zip(responses.windows(MIN_NEIGHBOURS)) {
            let ([f0, f1, f2, f3, f4], [x0, x1, x2, x3, x4]) = (f, x) else {
                continue;
            };
            // Lagrange's weights of the four neighbours in the middle.
            let nodes = [*f0, *f1, *f3, *f4];
            let weight = |k: usize| {
                let others = nodes.iter().enumerate().filter(|(other, _)| *other != k);
                others.fold(1.0, |product, (_, other)| {
                    product * (f2 - other) / (nodes[k] - other)
                })
            };
            let weights: [f64; 4] = core::array::from_fn(weight);
            let gain = 1.0 + weights.iter().map(|w| w * w).sum::<f64>();
            let left: [Complex<f64>; RESULTANTS] = core::array::from_fn(|j| {
                let [a, b, c, d] = weights;
                x2[j] - (x0[j] * a + x1[j] * b + x3[j] * c + x4[j] * d)
            });
            for (half, at) in [(&mut noise.acceleration, 0), (&mut noise.force, 6)] {
                for i in 0..6 {
                    for j in 0..6 {
                        let product = left[at + i] * left[at + j].conj();
                        half[(i, j)] += product.re / gain;
                    }
                }
            }
            count += 1.0;
        }
        if count == 0.0 {
            return None;
        }
        noise.acceleration /= count;
        noise.force /= count;
        Some(noise)
    }
}

/// Runs of frequency responses that share their frequencies, which need not be evenly
/// spaced.
#[derive(Clone, Copy, Debug)]
pub struct SineLines<'a> {
    frequencies: &'a [f64],
    runs: &'a [SineRun<'a>],
}

impl<'a> SineLines<'a> {
    /// Lines at `frequencies` (Hz), which must ascend strictly from above zero. `None` if
    /// they do not, if there is no run, or if one has another number of lines.
    #[must_use]
    pub fn new(frequencies: &'a [f64], runs: &'a [SineRun<'a>]) -> Option<Self> {
        let ascending = frequencies.windows(2).all(|w| w[0] < w[1]);
        let positive = frequencies.first().is_some_and(|f| *f > 0.0);
        let alike = runs.iter().all(|r| r.responses.len() == frequencies.len());
        (ascending && positive && alike && !runs.is_empty()).then_some(Self { frequencies, runs })
    }
}

impl Lines for SineLines<'_> {
    fn count(&self) -> usize {
        self.frequencies.len()
    }

    fn frequency(&self, line: usize) -> f64 {
        // One step beyond the last line is asked for to learn the spacing there.
        listed(self.frequencies, line)
    }

    fn runs(&self) -> usize {
        self.runs.len()
    }

    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        if let Some((a, f)) = self.pair(run, line) {
            into.add_pair(&a, &f, weight);
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        self.runs.get(run).map_or(ResultantNoise::NONE, |r| r.noise)
    }
}

impl Internals for SineLines<'_> {
    fn equations_per_line(&self, _run: usize) -> f64 {
        1.0
    }

    /// Every line was measured by itself.
    fn correlation(&self) -> f64 {
        1.0
    }

    fn pair(&self, run: usize, line: usize) -> Option<Amplitudes> {
        let r = self.runs.get(run)?.responses.get(line)?;
        Some((
            Vector6::from_fn(|i, _| r[i]),
            Vector6::from_fn(|i, _| r[6 + i]),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five lines through a cubic, the middle one `off` it, at these frequencies.
    fn noise(frequencies: &[f64; 5], off: f64) -> ResultantNoise {
        let line = |f: f64, off: f64| {
            core::array::from_fn(|j| {
                let k = j as f64;
                let cubic = 1.0 + k * f - f * f + 0.1 * k * f * f * f;
                Complex::new(cubic + off * (1.0 + k), -cubic)
            })
        };
        let off = [0.0, 0.0, off, 0.0, 0.0];
        let responses: [_; 5] = core::array::from_fn(|k| line(frequencies[k], off[k]));
        SineRun::noise_of_neighbours(frequencies, &responses).unwrap()
    }

    #[test]
    fn a_cubic_has_no_noise_and_a_line_beside_it_its_distance() {
        let even = [1.0, 2.0, 3.0, 4.0, 5.0];
        let uneven = [1.0, 1.5, 3.0, 4.0, 7.0];
        for frequencies in [even, uneven] {
            // Cubics of up to 400, two dozen roundings of 1e-16 of them.
            let none = noise(&frequencies, 0.0);
            assert!(none.acceleration.norm() < 1e-20 && none.force.norm() < 1e-20);
        }
        // Lagrange's weights of the middle are -1/6, 2/3, 2/3, -1/6, so that independent errors
        // of all five lines come out 1 + 34/36 times as large as one.
        let found = noise(&even, 0.5);
        for i in 0..6 {
            for j in 0..6 {
                let expected = 0.25 * ((1 + i) * (1 + j)) as f64 / (1.0 + 34.0 / 36.0);
                assert!((found.acceleration[(i, j)] - expected).abs() < 1e-10);
                let expected = 0.25 * ((7 + i) * (7 + j)) as f64 / (1.0 + 34.0 / 36.0);
                assert!((found.force[(i, j)] - expected).abs() < 1e-10);
            }
        }
    }
}

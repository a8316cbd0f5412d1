//! Frequency responses given line by line: stepped sine tests, or any other source.

use super::Moments;
use super::lines::{Amplitudes, Lines};
use crate::geometry::RESULTANTS;
use crate::spectra::listed;
use nalgebra::{Complex, Vector6};

/// Frequency responses of the twelve resultants, one run.
#[derive(Clone, Copy, Debug)]
pub struct SineRun<'a> {
    /// `(a, f)` at A for each line, in any common unit of excitation.
    pub responses: &'a [[Complex<f64>; RESULTANTS]],
    /// Noise power of each resultant per line, and at least its resolution.
    pub noise: [f64; RESULTANTS],
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

    fn noise(&self, run: usize) -> [f64; RESULTANTS] {
        self.runs.get(run).map_or([0.0; RESULTANTS], |r| r.noise)
    }

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

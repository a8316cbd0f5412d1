//! Lines of runs that were averaged against their drive.

use super::MasslineError;
use super::driven::Driven;
use super::lines::{Amplitudes, Internals, Lines};
use super::moments::Moments;
use crate::geometry::{RESULTANTS, ResultantNoise};
use crate::spectra::{LineGrid, RunResponses, Window};
use nalgebra::{Complex, Vector6};

/// Runs referred to their drive signals.
#[derive(Clone, Copy, Debug)]
pub struct DriveLines<'a> {
    runs: &'a [RunResponses<'a>],
    grid: LineGrid,
    correlation: f64,
}

impl<'a> DriveLines<'a> {
    /// Lines of `runs`, which were averaged with `window`. `None` if there is no run,
    /// their grids differ, or one has fewer responses or powers than lines.
    #[must_use]
    pub fn new(runs: &'a [RunResponses<'a>], window: Window) -> Option<Self> {
        let first = runs.first()?;
        let whole = |r: &RunResponses<'_>| {
            let count = r.grid.count;
            r.grid == first.grid && r.responses.len() >= count && r.drive.len() >= count
        };
        runs.iter().all(whole).then(|| Self {
            runs,
            grid: first.grid,
            correlation: window.line_correlation(),
        })
    }
}

fn halves(h: &[crate::spectra::Complex32; RESULTANTS]) -> [Vector6<Complex<f64>>; 2] {
    let wide = |i: usize| Complex::new(f64::from(h[i].re), f64::from(h[i].im));
    [
        Vector6::from_fn(|i, _| wide(i)),
        Vector6::from_fn(|i, _| wide(6 + i)),
    ]
}

impl Lines for DriveLines<'_> {
    fn count(&self) -> usize {
        self.grid.count
    }

    fn frequency(&self, line: usize) -> f64 {
        self.grid.frequency(line)
    }

    fn runs(&self) -> usize {
        self.runs.len()
    }

    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        if let Some((a, f)) = self.pair(run, line) {
            into.add_pair(&a, &f, weight * self.pair_weight(run, line));
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        let run = self.runs.get(run);
        run.map_or(ResultantNoise::NONE, |r| ResultantNoise::unpacked(&r.noise))
    }
}

impl Internals for DriveLines<'_> {
    /// A single block is explained by its drive to the last digit.
    fn check(&self) -> Result<(), MasslineError> {
        match self.runs.iter().map(|r| r.blocks).min() {
            Some(found @ ..2) => Err(MasslineError::TooFewBlocks { needed: 2, found }),
            _ => Ok(()),
        }
    }

    fn equations_per_line(&self, _run: usize) -> f64 {
        1.0
    }

    fn correlation(&self) -> f64 {
        self.correlation
    }

    fn pair(&self, run: usize, line: usize) -> Option<Amplitudes> {
        let [a, f] = halves(self.runs.get(run)?.responses.get(line)?);
        Some((a, f))
    }

    fn driven(&self) -> Option<Driven<'_>> {
        Some(Driven::new(self.runs))
    }

    /// The power of the drive.
    fn pair_weight(&self, run: usize, line: usize) -> f64 {
        let drive = self.runs.get(run).and_then(|r| r.drive.get(line));
        drive.copied().map_or(0.0, f64::from)
    }
}

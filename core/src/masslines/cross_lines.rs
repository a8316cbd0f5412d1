//! Lines of runs without a drive, and the noise that their own spectra tell.

use super::MasslineError;
use super::lines::{Amplitudes, Internals, Lines};
use super::moments::Moments;
use crate::algebra::{incoherent, larger};
use crate::geometry::{RESULTANTS, ResultantMap, ResultantNoise};
use crate::spectra::{Average, CrossAverage, LineGrid, LineRange, Window};
use nalgebra::Complex;

/// Runs without a drive: their cross-spectral matrices.
#[derive(Debug)]
pub struct CrossLines<'a, 's> {
    runs: &'a [CrossAverage<'s>],
    grid: LineGrid,
    noise: heapless::Vec<ResultantNoise, MAX_RUNS>,
    /// `true` if the noise was stated by the caller, so that blocks need not tell it.
    stated: bool,
    line_correlation: f64,
    block_correlation: f64,
}

/// Most runs that are read together, since what each leaves of the fit is kept beside it.
pub(crate) const MAX_RUNS: usize = 24;

impl<'a, 's> CrossLines<'a, 's> {
    /// Lines of finished cross-spectral averages. `band` are the kept lines over which
    /// the noise is taken, `hop` is the blocks' hop over their length, `maps` made the
    /// resultants of each run.
    ///
    /// # Errors
    /// [`MasslineError::TooManyRuns`], [`MasslineError::TooFewRuns`] without a run or with
    /// fewer maps than runs, [`MasslineError::OtherLines`] for a band of other lines.
    pub fn new(
        runs: &'a [CrossAverage<'s>],
        grid: LineGrid,
        band: LineRange,
        window: Window,
        hop: f64,
        maps: &[ResultantMap],
    ) -> Result<Self, MasslineError> {
        let (needed, found) = (runs.len().max(1), maps.len().min(runs.len()));
        if found < needed {
            return Err(MasslineError::TooFewRuns { needed, found });
        }
        if band.count() != grid.count {
            return Err(MasslineError::OtherLines {
                band: band.count(),
                lines: grid.count,
            });
        }
        let mut lines = Self {
            runs,
            grid,
            noise: heapless::Vec::new(),
            stated: false,
            line_correlation: window.line_correlation(),
            block_correlation: window.block_correlation(hop),
        };
        for (run, map) in maps.iter().enumerate().take(needed) {
            let noise = lines.incoherent(run, band, map);
            lines
                .noise
                .push(noise)
                .map_err(|_| MasslineError::TooManyRuns {
                    limit: MAX_RUNS,
                    found: runs.len(),
                })?;
        }
        Ok(lines)
    }

    /// The same lines with the stated noise of each run, as [`Lines::noise`] has it, where a run
    /// has too few blocks to tell its own and the noise of every run is stated.
    #[must_use]
    pub fn or_stated(mut self, noise: &[ResultantNoise]) -> Self {
        if self.check().is_err() && noise.len() == self.noise.len() {
            self.noise.copy_from_slice(noise);
            self.stated = true;
        }
        self
    }

    /// Independent blocks that were averaged in a run.
    fn independent_blocks(&self, run: usize) -> f64 {
        let blocks = self.runs.get(run).map_or(0, CrossAverage::blocks);
        f64::from(blocks) / self.block_correlation
    }

    /// Accelerations that the forces do not explain, and the other way round:
    /// an upper bound of the sensors' noise, as the noise of both sides is in it.
    fn incoherent(&self, run: usize, band: LineRange, map: &ResultantMap) -> ResultantNoise {
        let mut power = [0.0; RESULTANTS];
        let mut noise = [0.0; RESULTANTS];
        let blocks = self.independent_blocks(run);
        // Six explaining channels take six degrees of freedom. `check` has refused fewer.
        let freedom = blocks / (blocks - EXPLAINING).max(1.0);
        let lines = band.len().max(1) as f64;
        for line in band {
            let mut m = Moments::zero();
            self.add_moments(run, line, 1.0, &mut m);
            let of_accelerations = incoherent(&m.ff, &m.fa.adjoint(), &m.aa);
            let of_forces = incoherent(&m.aa, &m.fa, &m.ff);
            for j in 0..6 {
                power[j] += m.aa[(j, j)].re / lines;
                power[6 + j] += m.ff[(j, j)].re / lines;
                noise[j] += of_accelerations[(j, j)] * freedom / lines;
                noise[6 + j] += of_forces[(j, j)] * freedom / lines;
            }
        }
        let rounding = map.rounding_power(&power);
        map.noise(&core::array::from_fn(|j| larger(noise[j], rounding[j])))
    }
}

/// Channels that explain the others where there is no drive.
const EXPLAINING: f64 = 6.0;

impl Lines for CrossLines<'_, '_> {
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
        let Some(average) = self.runs.get(run) else {
            return;
        };
        let value = |i: usize, j: usize| {
            let (re, im) = average.cross(i, j, line);
            Complex::new(re, im) * weight
        };
        for j in 0..6 {
            for i in 0..6 {
                into.aa[(i, j)] += value(i, j);
                into.fa[(i, j)] += value(6 + i, j);
                into.ff[(i, j)] += value(6 + i, 6 + j);
            }
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        self.noise.get(run).copied().unwrap_or(ResultantNoise::NONE)
    }
}

impl Internals for CrossLines<'_, '_> {
    /// Six channels explain all of six others in as many blocks. One independent block more
    /// tells the noise at some tens of lines together.
    fn check(&self) -> Result<(), MasslineError> {
        if self.stated {
            return Ok(());
        }
        let needed = EXPLAINING + 1.0;
        for run in 0..self.runs.len() {
            if self.independent_blocks(run) < needed {
                return Err(MasslineError::TooFewBlocks {
                    needed: libm::ceil(needed * self.block_correlation) as u32,
                    found: self.runs.get(run).map_or(0, CrossAverage::blocks),
                });
            }
        }
        Ok(())
    }

    fn equations_per_line(&self, run: usize) -> f64 {
        self.runs
            .get(run)
            .map_or(0.0, |r| f64::from(r.blocks()) / self.block_correlation)
    }

    fn correlation(&self) -> f64 {
        self.line_correlation * self.block_correlation
    }

    fn pair(&self, _run: usize, _line: usize) -> Option<Amplitudes> {
        None
    }
}

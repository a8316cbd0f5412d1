//! Lines of the unwindowed transforms of runs, with their noise.

use nalgebra::{Complex, Matrix6, Vector6};

/// Complex amplitudes of six accelerations or six resultants, in the order of equation (1).
pub type Complex6 = Vector6<Complex<f64>>;

/// Covariances `E x x*` of the noise of one line, at a level of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of the six base accelerations: (m/s²)², m/s² rad/s², (rad/s²)².
    pub base: Matrix6<f64>,
    /// Of the six resultants: N², N² m, N² m².
    pub force: Matrix6<f64>,
}

/// One record: a run, or a block of a run whose record was cut. Each record has leakage terms of
/// its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Number of the run that the record belongs to. Records of one run share its offsets of
    /// frequency and damping.
    pub run: usize,
    /// Frequencies of the lines, Hz, ascending and above zero.
    pub frequencies: Vec<f64>,
    /// Base accelerations of each line: the transform of N samples over √N.
    pub base: Vec<Complex6>,
    /// Resultants of each line, scaled alike.
    pub force: Vec<Complex6>,
    /// Noise of a line.
    pub noise: Noise,
    /// Power of the noise of each line over that of `noise`; empty where it is one everywhere.
    pub level: Vec<f64>,
    /// Orthonormal rows of the equations of motion that the load cells complete; rows that are
    /// missing are zero.
    pub equations: Matrix6<f64>,
}

impl Record {
    /// Number of equations that each line has.
    #[must_use]
    pub fn equation_count(&self) -> usize {
        (0..6)
            .filter(|&i| self.equations.row(i).norm_squared() > 0.0)
            .count()
    }

    /// Power of the noise of line `k` over that of [`Record::noise`].
    #[must_use]
    pub fn level(&self, k: usize) -> f64 {
        self.level.get(k).copied().unwrap_or(1.0)
    }

    /// Every `step`-th line from `first` on, of those up to `highest` Hz.
    #[must_use]
    pub fn thinned(&self, first: usize, step: usize, highest: f64) -> Self {
        let kept: Vec<usize> = (first..self.frequencies.len())
            .step_by(step.max(1))
            .filter(|&k| self.frequencies[k] <= highest)
            .collect();
        Self {
            run: self.run,
            frequencies: kept.iter().map(|&k| self.frequencies[k]).collect(),
            base: kept.iter().map(|&k| self.base[k]).collect(),
            force: kept.iter().map(|&k| self.force[k]).collect(),
            noise: self.noise,
            level: if self.level.is_empty() {
                Vec::new()
            } else {
                kept.iter().map(|&k| self.level(k)).collect()
            },
            equations: self.equations,
        }
    }
}

/// Number of real equations of some records: two for each complex one.
#[must_use]
pub fn real_equations(records: &[Record]) -> usize {
    let of = |r: &Record| 2 * r.frequencies.len() * r.equation_count();
    records.iter().map(of).sum()
}

/// Highest frequency of all lines, Hz.
#[must_use]
pub fn highest(records: &[Record]) -> f64 {
    let last = records.iter().filter_map(|r| r.frequencies.last());
    last.copied().fold(0.0, f64::max)
}

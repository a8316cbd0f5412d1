//! The apparent mass of an elastic structure on a rigid interface, and its derivatives.
//!
//! ```text
//! M(ω) = M₀(σ) + Σ_r L_rᵀ L_r D_r(ω) + E (ω/ω_hi)²
//! D_r  = x² / (1 - x² + 2 j ζ_r x^p_r),  x = ω/ω_r
//! ```
//!
//! σ are the ten numbers of equation (6) about A, p_r is 1 for viscous damping and 0 for
//! structural damping. Each run has offsets of ln ω_r and ln ζ_r of its own.

use super::noise::median;
use super::record::Complex6;
use nalgebra::{Complex, Matrix6, Vector6};

/// Number of the rigid-body parameters σ.
pub const RIGID: usize = 10;
/// Parameters of a mode: ln ω, ln ζ, six participations, exponent of the damping.
pub(super) const OF_MODE: usize = 9;
/// Terms of a symmetric 6 x 6 matrix.
pub(super) const SYMMETRIC: usize = 21;

/// Share of critical damping from which a mode does not ring.
pub(super) const OVERDAMPED: f64 = 1.0;

/// A mode of the structure on the fixed interface.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedMode {
    /// Natural logarithm of the undamped natural frequency in Hz.
    pub ln_frequency: f64,
    /// Natural logarithm of the share of critical damping at resonance.
    pub ln_damping: f64,
    /// L_r for unit modal mass, √kg and √kg m.
    pub participation: Vector6<f64>,
    /// Exponent p of the damping: 1 viscous, 0 structural.
    pub exponent: f64,
}

impl FittedMode {
    /// A viscously damped mode from its frequency (Hz), share of critical damping and L_r.
    #[must_use]
    pub fn new(frequency: f64, damping: f64, participation: Vector6<f64>) -> Self {
        Self {
            ln_frequency: frequency.ln(),
            ln_damping: damping.ln(),
            participation,
            exponent: 1.0,
        }
    }

    /// Undamped natural frequency, Hz.
    #[must_use]
    pub fn frequency(&self) -> f64 {
        self.ln_frequency.exp()
    }

    /// `true` if it is no resonance: it is damped by more than what is critical, and not beyond `highest`, Hz, from where
    /// on lines tell little of damping.
    #[must_use]
    pub fn is_overdamped(&self, highest: f64) -> bool {
        self.frequency() < highest && self.damping() > OVERDAMPED
    }

    /// Share of critical damping at resonance.
    #[must_use]
    pub fn damping(&self) -> f64 {
        self.ln_damping.exp()
    }
}

/// The apparent mass with all its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// σ of equation (6) about A: m, first moments, Θxx, Θyy, Θzz, Θxy, Θxz, Θyz.
    pub rigid: [f64; RIGID],
    /// Modes, in the order in which they were found.
    pub modes: Vec<FittedMode>,
    /// Symmetric matrix E of modes beyond the lines, its upper triangle row after row; `None`
    /// without the term.
    pub upper: Option<[f64; SYMMETRIC]>,
    /// Frequency at which the term in ω² is E, Hz.
    pub unit: f64,
    /// Offsets of ln ω and ln ζ of each mode, run by run.
    pub offsets: Vec<Vec<[f64; 2]>>,
}

impl Model {
    /// A model without modes for some runs, whose term in ω² has its unit at `unit` Hz.
    #[must_use]
    pub fn rigid(rigid: [f64; RIGID], unit: f64, runs: usize) -> Self {
        Self {
            rigid,
            modes: Vec::new(),
            upper: None,
            unit,
            offsets: vec![Vec::new(); runs],
        }
    }

    /// Adds a mode without offsets.
    pub fn push(&mut self, mode: FittedMode) {
        self.modes.push(mode);
        for run in &mut self.offsets {
            run.push([0.0; 2]);
        }
    }

    /// Number of parameters that every run shares.
    pub(super) fn shared(&self) -> usize {
        self.upper_at() + if self.upper.is_some() { SYMMETRIC } else { 0 }
    }

    /// Place of E among the parameters, whether it is there or not.
    pub(super) fn upper_at(&self) -> usize {
        RIGID + OF_MODE * self.modes.len()
    }

    /// Number of all parameters: those that are shared, and two offsets for each mode and run.
    pub(super) fn parameters(&self) -> usize {
        self.shared() + 2 * self.modes.len() * self.offsets.len()
    }

    /// Place of the offsets of ln ω and ln ζ of a mode in a run among all parameters.
    pub(super) fn offset_at(&self, run: usize, mode: usize) -> usize {
        self.shared() + 2 * (run * self.modes.len() + mode)
    }

    /// Mode `r` as it is in run `run`.
    pub(super) fn mode_in(&self, run: usize, r: usize) -> (f64, f64) {
        let mode = &self.modes[r];
        let offset = self.offsets.get(run).and_then(|o| o.get(r));
        let [frequency, damping] = offset.copied().unwrap_or([0.0; 2]);
        (
            (mode.ln_frequency + frequency).exp(),
            (mode.ln_damping + damping).exp(),
        )
    }

    /// Median over the modes of the factor by which natural frequencies of a run differ from the median over all runs, in
    /// the run where that is largest; `None` where it is within `limit` of one.
    pub(super) fn run_apart(&self, limit: f64) -> Option<f64> {
        let of_mode = |r: usize| median(self.offsets.iter().map(|run| run[r][0]).collect());
        let medians: Vec<f64> = (0..self.modes.len()).map(of_mode).collect();
        let apart = |run: &Vec<[f64; 2]>| {
            let differences = run
                .iter()
                .zip(&medians)
                .map(|(own, median)| own[0] - median);
            median(differences.collect())
        };
        let runs = self.offsets.iter().map(apart);
        let factor = runs.max_by(|a, b| a.abs().total_cmp(&b.abs()))?.exp();
        ((factor - 1.0).abs() > limit).then_some(factor)
    }

    /// Adds a step to all parameters.
    pub(super) fn step(&mut self, step: &[f64]) {
        for (x, d) in self.rigid.iter_mut().zip(step) {
            *x += d;
        }
        let of_modes = step[RIGID..].chunks_exact(OF_MODE);
        for (mode, d) in self.modes.iter_mut().zip(of_modes) {
            mode.ln_frequency += d[0];
            mode.ln_damping += d[1];
            for (l, d) in mode.participation.iter_mut().zip(&d[2..8]) {
                *l += d;
            }
            mode.exponent += d[8];
        }
        let at = self.upper_at();
        if let Some(upper) = &mut self.upper {
            for (e, d) in upper.iter_mut().zip(&step[at..]) {
                *e += d;
            }
        }
        let shared = self.shared();
        let offsets = self.offsets.iter_mut().flatten().flatten();
        for (x, d) in offsets.zip(&step[shared..]) {
            *x += d;
        }
    }

    /// M₀ of equation (1).
    #[must_use]
    pub fn rigid_matrix(&self) -> Matrix6<f64> {
        let mut matrix = Matrix6::zeros();
        for j in 0..6 {
            let unit = Vector6::from_fn(|i, _| Complex::from(f64::from(u8::from(i == j))));
            for (column, x) in rigid_columns(&unit).iter().zip(self.rigid) {
                for i in 0..6 {
                    matrix[(i, j)] += column[i].re * x;
                }
            }
        }
        matrix
    }

    /// E as a matrix; zero without the term.
    #[must_use]
    pub fn upper_matrix(&self) -> Matrix6<f64> {
        let mut matrix = Matrix6::zeros();
        if let Some(upper) = &self.upper {
            for ((i, j), e) in triangle().zip(upper) {
                matrix[(i, j)] = *e;
                matrix[(j, i)] = *e;
            }
        }
        matrix
    }

    /// Sets E.
    pub fn set_upper_matrix(&mut self, matrix: &Matrix6<f64>) {
        let mut upper = [0.0; SYMMETRIC];
        for ((i, j), e) in triangle().zip(&mut upper) {
            *e = matrix[(i, j)];
        }
        self.upper = Some(upper);
    }

    /// M(ω) in a run at a frequency, Hz.
    #[must_use]
    pub fn at(&self, run: usize, frequency: f64) -> Matrix6<Complex<f64>> {
        let ratio = frequency / self.unit;
        let real = self.rigid_matrix() + self.upper_matrix() * rest_of(ratio);
        let mut matrix = real.map(Complex::from);
        for (r, mode) in self.modes.iter().enumerate() {
            let (natural, damping) = self.mode_in(run, r);
            let d = response(frequency / natural, damping, mode.exponent);
            add_outer(&mut matrix, &mode.participation, d);
        }
        matrix
    }
}

/// Modes beyond the lines are taken to lie at twice the last line: those right beyond it are found by
/// themselves, and those far beyond it weigh little.
const REST: f64 = 2.0;

/// Response per E of the modes beyond the lines, ω² / (1 - (ω/ω_E)²), at a ratio of ω to the last line.
pub(super) fn rest_of(ratio: f64) -> f64 {
    let square = ratio * ratio;
    square / (1.0 - square / (REST * REST))
}

/// Adds `d L Lᵀ`.
pub(super) fn add_outer(matrix: &mut Matrix6<Complex<f64>>, l: &Vector6<f64>, d: Complex<f64>) {
    for j in 0..6 {
        let scaled = d * l[j];
        for i in 0..6 {
            matrix[(i, j)] += scaled * l[i];
        }
    }
}

/// Places of the upper triangle of a 6 x 6 matrix, row after row.
pub(super) fn triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
}

/// Columns of B for an acceleration: the force that each of σ adds, equation (8) written for (6).
#[inline(always)]
pub(crate) fn rigid_columns(a: &Complex6) -> [Complex6; RIGID] {
    let zero = Complex::new(0.0, 0.0);
    let [x, y, z, alpha, beta, gamma] = [a[0], a[1], a[2], a[3], a[4], a[5]];
    let v = |fx, fy, fz, tx, ty, tz| Complex6::new(fx, fy, fz, tx, ty, tz);
    [
        v(x, y, z, zero, zero, zero),
        v(zero, gamma, -beta, zero, -z, y),
        v(-gamma, zero, alpha, z, zero, -x),
        v(beta, -alpha, zero, -y, x, zero),
        v(zero, zero, zero, alpha, zero, zero),
        v(zero, zero, zero, zero, beta, zero),
        v(zero, zero, zero, zero, zero, gamma),
        v(zero, zero, zero, -beta, -alpha, zero),
        v(zero, zero, zero, -gamma, zero, -alpha),
        v(zero, zero, zero, zero, -gamma, -beta),
    ]
}

/// D of a mode at x = ω/ω_r.
pub(super) fn response(x: f64, damping: f64, exponent: f64) -> Complex<f64> {
    let power = if exponent == 1.0 { x } else { x.powf(exponent) };
    (x * x) / Complex::new(1.0 - x * x, 2.0 * damping * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rigid_matrix_is_that_of_equation_1() {
        use massline_core::rigid_body::{Inertia, RigidBody};
        let body = RigidBody {
            mass: 3.0,
            centre_of_gravity: nalgebra::Vector3::new(0.1, -0.2, 0.3),
            inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
        };
        let matrix = body.mass_matrix(&nalgebra::Vector3::zeros());
        let rigid = super::super::rigid::sigma_of(&matrix);
        let model = Model::rigid(rigid, 1.0, 1);
        // A sum of two products: a rounding or two.
        assert!((model.rigid_matrix() - matrix).norm() < 1e-15);
    }

    /// Of five runs one has three of four modes at 0.8 times the frequency; a mode that one run moves is none of the run's.
    #[test]
    fn a_run_of_other_frequencies_is_apart() {
        let mut model = Model::rigid([1.0; RIGID], 60.0, 5);
        for frequency in [20.0, 30.0, 40.0, 50.0] {
            model.push(FittedMode::new(frequency, 0.01, Vector6::zeros()));
        }
        assert_eq!(model.run_apart(0.05), None);
        model.offsets[1][2][0] = -0.2;
        assert_eq!(model.run_apart(0.05), None);
        for r in 0..3 {
            model.offsets[2][r][0] = 0.8_f64.ln();
        }
        let factor = model.run_apart(0.05).unwrap();
        assert!((factor - 0.8).abs() < 1e-12, "{factor}");
    }
}

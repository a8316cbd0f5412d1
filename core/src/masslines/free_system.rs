//! Frequency responses of the *free* system from base excitation, and its modes.
//!
//! The interface forces are all that holds the structure. Referred to them it is free:
//! `H = [A_1 … A_n] [F_1 … F_n]⁻¹` line by line, or `G_AF G_FF⁻¹`, are the accelerations
//! of A per unit interface force. With as many runs as resultants both are the same
//! matrix; with more runs the second is the least-squares one.
//!
//! `H(ω) = M⁻¹ - Σ_r φ_r φ_rᵀ ω² / (ω_r² - ω² + 2jζ_r ω_r ω)` with the poles of the free
//! structure. The constant is the rigid body, which methods c, d and e are after.

use super::regression::between;
use super::{Excitation, Lines, MasslineError, Moments};
use crate::algebra::{HermitianFactor, factor_hermitian};
use crate::geometry::Equations;
use crate::modes::{MAX_MODES, Pole, Residues, Trace, find_poles};
use core::ops::Range;
use nalgebra::{ArrayStorage, Complex, Matrix6, SMatrix, Vector6};

/// Terms of the modal fit: constant, one for the modes above, and two per mode.
const TERMS: usize = 2 + 2 * MAX_MODES;

/// Accelerations of A per unit interface force, line by line.
#[derive(Debug)]
pub struct FreeSystem<'l, L: ?Sized> {
    lines: &'l L,
    equations: Equations,
    /// Inverse root powers of the measured resultants: equilibration of G_FF.
    scale: Vector6<f64>,
    acceleration: Excitation,
}

impl<'l, L: Lines + ?Sized> FreeSystem<'l, L> {
    /// The free system behind `lines`, whose band serves to judge the excitation.
    ///
    /// # Errors
    /// [`MasslineError::TooFewRuns`] unless all measured resultants were excited
    /// independently.
    pub fn new(
        lines: &'l L,
        band: &Range<usize>,
        equations: &Equations,
    ) -> Result<Self, MasslineError> {
        let needed = equations.count();
        if needed == 0 {
            return Err(MasslineError::NoResultant);
        }
        let mut total = Moments::zero();
        let mut noise = [0.0; 12];
        for run in 0..lines.runs() {
            for (sum, n) in noise.iter_mut().zip(lines.noise(run)) {
                *sum += n * band.len() as f64;
            }
            for line in band.clone() {
                lines.add_moments(run, line, 1.0, &mut total);
            }
        }
        let half = |at: usize| Vector6::from_fn(|j, _| noise[at + j]);
        let acceleration = Excitation::new(&total.aa.map(|z| z.re), &half(0));
        let forces = Excitation::new(&total.ff.map(|z| z.re), &half(6));
        let mut found = forces.rank().min(acceleration.rank());
        if lines.pair(0, band.start).is_some() {
            // One response per run and line, whatever its direction does over the band.
            found = found.min(lines.runs());
        }
        if found < needed {
            return Err(MasslineError::TooFewRuns { needed, found });
        }
        let e = equations.rows();
        let power = (e * total.ff.map(|z| z.re) * e.transpose()).diagonal();
        Ok(Self {
            lines,
            equations: *equations,
            scale: power.map(|p| if p > 0.0 { 1.0 / libm::sqrt(p) } else { 0.0 }),
            acceleration,
        })
    }

    /// Number of interface forces, and of columns of H.
    #[must_use]
    pub fn forces(&self) -> usize {
        self.equations.count()
    }

    /// The resultants at A of unit interface force `j`.
    #[must_use]
    pub fn unit_force(&self, j: usize) -> Vector6<f64> {
        self.equations.rows().row(j).transpose()
    }

    pub(super) fn noise_filter(&self) -> &Matrix6<f64> {
        self.acceleration.cleaner()
    }

    /// H at one line: column j is the acceleration of A per unit interface force j.
    ///
    /// # Errors
    /// [`MasslineError::Singular`] if the forces of this line depend on each other.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub fn response(&self, line: usize) -> Result<Matrix6<Complex<f64>>, MasslineError> {
        let mut m = Moments::zero();
        for run in 0..self.lines.runs() {
            self.lines.add_moments(run, line, 1.0, &mut m);
        }
        let scaled = Matrix6::from_diagonal(&self.scale) * self.equations.rows();
        let ff = between(&scaled, &m.ff, &scaled);
        let fa = between(&scaled, &m.fa, &Matrix6::identity());
        let factor: HermitianFactor =
            factor_hermitian(&ff, self.forces()).ok_or(MasslineError::Singular)?;
        // H = G_AF G_FF⁻¹, so G_FF Hᴴ = G_FA.
        let adjoint = factor.solve(&fa);
        let mut h = adjoint.adjoint();
        for j in 0..6 {
            for i in 0..6 {
                h[(i, j)] *= self.scale[j];
            }
        }
        Ok(h)
    }

    /// Modes of the free structure from all lines `fit`, at most `limit` of them, left in
    /// `modes`. `work` holds two elements per line.
    ///
    /// # Errors
    /// [`MasslineError::NoMode`] if there is none in the lines.
    pub fn modes(
        &self,
        fit: Range<usize>,
        limit: usize,
        modes: &mut FreeModes,
        work: &mut [Complex<f64>],
    ) -> Result<(), MasslineError> {
        let fit = fit.start..fit.end.min(fit.start + work.len() / 2);
        let n = self.forces();
        // Every diagonal entry counts by its own size, so that rotations and translations
        // are comparable.
        let mut size = [0.0; 6];
        for line in fit.clone() {
            let h = self.diagonal(line)?;
            for j in 0..n {
                size[j] += libm::sqrt(h[j].norm_sqr());
            }
        }
        let lines = fit.len() as f64;
        let work = &mut work[..2 * fit.len()];
        for (line, t) in fit.clone().zip(work.iter_mut()) {
            let h = self.diagonal(line)?;
            *t = Complex::new(0.0, 0.0);
            for j in 0..n {
                // Elastic modes subtract from the rigid body here.
                *t -= h[j] * (lines / size[j].max(f64::MIN_POSITIVE));
            }
        }
        let frequency = |k: usize| self.lines.frequency(fit.start + k);
        let trace = Trace::new(work);
        let mut poles = find_poles(&trace, Residues::Complex, &frequency);
        poles.truncate(limit);
        if poles.is_empty() {
            return Err(MasslineError::NoMode);
        }
        modes.poles = poles;
        self.fit(&fit, modes, &trace)
    }

    /// H in force directions: what a unit force j moves along itself.
    fn diagonal(&self, line: usize) -> Result<[Complex<f64>; 6], MasslineError> {
        let h = self.response(line)?;
        let e = self.equations.rows();
        Ok(core::array::from_fn(|j| {
            (0..6).map(|i| h[(i, j)] * e[(j, i)]).sum()
        }))
    }

    /// Residues of all entries by linear least squares with the common poles.
    #[inline(never)] // Not on the stack while poles are found.
    fn fit(
        &self,
        fit: &Range<usize>,
        modes: &mut FreeModes,
        trace: &Trace<'_>,
    ) -> Result<(), MasslineError> {
        modes.unit = self.lines.frequency(fit.end.saturating_sub(1));
        let terms = modes.terms();
        let mut normal = SMatrix::<f64, TERMS, TERMS>::identity();
        for i in 0..terms {
            normal[(i, i)] = 0.0;
        }
        let mut right = [Matrix6::<f64>::zeros(); TERMS];
        for (k, line) in fit.clone().enumerate() {
            let phi = modes.basis(self.lines.frequency(line));
            let h = self.response(line)?;
            for i in 0..terms {
                let conjugate = phi[i].conj() * trace.weight(k);
                for j in 0..terms {
                    normal[(i, j)] += (conjugate * phi[j]).re;
                }
                right[i] += h.map(|z| (conjugate * z).re);
            }
        }
        let inverse = normal.try_inverse().ok_or(MasslineError::Singular)?;
        let solved =
            |i: usize| -> Matrix6<f64> { (0..terms).map(|j| right[j] * inverse[(i, j)]).sum() };
        modes.constant = solved(0);
        modes.upper = solved(1);
        modes.residues = [NO_MATRIX; MAX_MODES];
        modes.quadratures = [NO_MATRIX; MAX_MODES];
        for r in 0..modes.poles.len() {
            modes.residues[r] = solved(2 + 2 * r);
            modes.quadratures[r] = solved(3 + 2 * r);
        }
        // Scatter of each entry about the fit, as the lines count.
        let mut squares = Matrix6::<f64>::zeros();
        for (k, line) in fit.clone().enumerate() {
            let left = self.response(line)? - modes.at(self.lines.frequency(line));
            squares += left.map(|z| z.norm_sqr()) * trace.weight(k);
        }
        let freedom = (2.0 * fit.len() as f64 - terms as f64).max(1.0);
        modes.constant_variance = squares * (inverse[(0, 0)] * self.lines.correlation() / freedom);
        Ok(())
    }
}

/// Modes of the free structure, as they show in the accelerations of A per unit force.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeModes {
    /// Poles, ascending.
    pub poles: heapless::Vec<Pole, MAX_MODES>,
    /// The rigid body's share: what remains of H at ω = 0, m/s² per N and so on.
    pub constant: Matrix6<f64>,
    /// Residue of each pole: H holds `(residue + quadrature jω/ω_r) D_r(ω)`.
    pub residues: [Matrix6<f64>; MAX_MODES],
    /// Quadrature of each residue, zero where damping does not couple the modes.
    pub quadratures: [Matrix6<f64>; MAX_MODES],
    /// Share of all modes above, per (ω / unit)².
    upper: Matrix6<f64>,
    /// Variance of each entry of the constant.
    pub constant_variance: Matrix6<f64>,
    /// Frequency at which the upper term is one, Hz.
    unit: f64,
}

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

impl FreeModes {
    /// A place for them, all zero.
    pub(super) const EMPTY: Self = Self {
        poles: heapless::Vec::new(),
        constant: NO_MATRIX,
        residues: [NO_MATRIX; MAX_MODES],
        quadratures: [NO_MATRIX; MAX_MODES],
        upper: NO_MATRIX,
        constant_variance: NO_MATRIX,
        unit: 0.0,
    };

    fn terms(&self) -> usize {
        2 + 2 * self.poles.len()
    }

    fn basis(&self, frequency: f64) -> [Complex<f64>; TERMS] {
        let mut phi = [Complex::new(0.0, 0.0); TERMS];
        let ratio = frequency / self.unit;
        phi[0] = Complex::new(1.0, 0.0);
        phi[1] = Complex::new(ratio * ratio, 0.0);
        for (pair, pole) in phi[2..].chunks_exact_mut(2).zip(&self.poles) {
            let d = pole.amplification(frequency);
            pair[0] = d;
            pair[1] = d * Complex::new(0.0, frequency / pole.frequency);
        }
        phi
    }

    /// The elastic part of H at `frequency` Hz.
    #[must_use]
    pub fn elastic(&self, frequency: f64) -> Matrix6<Complex<f64>> {
        let phi = self.basis(frequency);
        let mut h = self.upper.map(|x| phi[1] * x);
        let residues = self.residues.iter().zip(&self.quadratures);
        for ((residue, quadrature), phi) in residues.zip(phi[2..].chunks_exact(2)) {
            h += residue.map(|x| phi[0] * x) + quadrature.map(|x| phi[1] * x);
        }
        h
    }

    /// The whole of H at `frequency` Hz.
    #[must_use]
    pub fn at(&self, frequency: f64) -> Matrix6<Complex<f64>> {
        self.elastic(frequency) + self.constant.map(|x| Complex::new(x, 0.0))
    }
}

//! Frequency responses of the *free* system from base excitation, and its modes.
//!
//! The interface forces are all that holds the structure. Referred to them it is free:
//! `H = [A_1 … A_n] [F_1 … F_n]⁻¹` line by line, or `G_AF G_FF⁻¹`, are the accelerations
//! of A per unit interface force. With as many runs as resultants both are the same
//! matrix; with more runs the second is the least-squares one.
//!
//! `H(ω) = M⁻¹ - Σ_r φ_r φ_rᵀ ω² / (ω_r² - ω² + 2jζ_r ω_r ω)` with the poles of the free
//! structure. The constant is the rigid body, which methods c, d and e are after.

use super::averaging::{LinePair, RealMoments, noise_of_runs};
use super::excitation::IDENTITY;
use super::lines::{add_squares, indices, two_a_line};
use super::moments::{Squares, add_scaled};
use super::regression::between;
use super::{
    Complex6, EquationWeights, Excitation, Lines, MasslineError, Masslines, Moments, Workspace,
};
use crate::algebra::{
    factor_hermitian, inverse_lower, lower, multiply_left, multiply_right, product, solve_hermitian,
};
use crate::cells::{cells, seen};
use crate::geometry::{Equations, ResultantNoise, resultants_at, transfer};
use crate::modes::{MAX_MODES, Pole, Residues, Trace, find_poles};
use crate::spectra::LineRange;
use core::ops::Range;
use nalgebra::{ArrayStorage, Complex, Matrix6, SMatrix, Vector3, Vector6};

/// Terms of the modal fit: constant, one for the modes above, and two per mode.
const TERMS: usize = 2 + 2 * MAX_MODES;

/// Accelerations of A per unit interface force, line by line.
#[derive(Debug)]
pub(super) struct FreeSystem<'l, L: ?Sized> {
    lines: &'l L,
    equations: Equations,
    /// Inverse root powers of the measured resultants: equilibration of G_FF.
    scale: Vector6<f64>,
    /// The equations with that scale.
    scaled: Matrix6<f64>,
    /// Columns are the interface forces of the pairs, in the equations' coordinates.
    basis: Matrix6<f64>,
    excitation: Excitation,
    /// Covariance of the noise that one line of all pairs together would have.
    noise: ResultantNoise,
}

impl<'l, L: Lines + ?Sized> FreeSystem<'l, L> {
    /// The free system before anything is known of it but its load cells.
    pub(super) fn of(lines: &'l L, equations: &Equations) -> Self {
        Self {
            lines,
            equations: *equations,
            scale: NO_VECTOR,
            scaled: NO_MATRIX,
            basis: IDENTITY,
            excitation: Excitation::NONE,
            noise: ResultantNoise::NONE,
        }
    }

    /// Judges the excitation by the lines of the band. `weights` tells for which forces there are
    /// pairs: unit forces, or those in which the noise of one pair is not that of another.
    ///
    /// # Errors
    /// [`MasslineError::TooFewRuns`] unless all measured resultants were excited
    /// independently, [`MasslineError::OtherLines`].
    #[inline(never)] // Its sums are off the stack when the caller goes on.
    pub(super) fn look_at(
        &mut self,
        band: LineRange,
        weights: EquationWeights,
    ) -> Result<(), MasslineError> {
        let band = indices(self.lines, band)?;
        let needed = self.forces();
        if needed == 0 {
            return Err(MasslineError::NoResultant);
        }
        let mut total = RealMoments::EMPTY;
        self.sum(&band, weights, &mut total);
        total.accelerations(&mut self.excitation);
        let forces = Excitation::rank_of(&total.squares.ff, &total.noise.force);
        let mut found = forces.min(self.excitation.rank());
        if self.lines.pair(0, band.start).is_some() {
            // One response per run and line, whatever its direction does over the band.
            found = found.min(self.lines.runs());
        }
        if found < needed {
            return Err(MasslineError::TooFewRuns { needed, found });
        }
        self.in_equations(&mut total.squares.ff);
        let measured = total.squares.ff.diagonal();
        self.scale = measured.map(|p| if p > 0.0 { 1.0 / libm::sqrt(p) } else { 0.0 });
        let rows = self.equations.rows();
        self.scaled = Matrix6::from_fn(|i, j| self.scale[i] * rows[(i, j)]);
        self.choose_pairs(weights).ok_or(MasslineError::Singular)
    }

    /// Sums the squares of all runs, of the forces also weighted, which are left in the basis,
    /// and the noise in both sums.
    #[inline(never)] // One run's squares and noise are off the stack when the caller goes on.
    fn sum(&mut self, band: &Range<usize>, weights: EquationWeights, total: &mut RealMoments) {
        let lines = self.lines;
        let all = noise_of_runs(lines, 1).variances();
        self.basis.fill(0.0);
        for run in 0..lines.runs() {
            let mut squares = Squares::zero();
            for line in band.clone() {
                add_squares(lines, run, line, 1.0, &mut squares);
            }
            total.squares.add(&squares, 1.0);
            let noise = lines.noise(run);
            total.noise.add(&noise, band.len() as f64);
            let variances = noise.variances();
            let shares = variances.iter().zip(&all).filter(|(_, all)| **all > 0.0);
            let level: f64 = shares.map(|(run, all)| run / all).sum();
            let weight = match weights {
                EquationWeights::Noise if level > 0.0 => 1.0 / level,
                _ => 1.0,
            };
            add_scaled(&mut self.basis, &squares.ff, weight);
            let share = weight * band.len() as f64 / lines.runs() as f64;
            self.noise.add(&noise, share);
        }
        total.lines = band.len() as f64;
    }

    /// Turns second moments of resultants into those of the equations.
    #[inline(never)] // Its copy is off the stack when the caller goes on.
    fn in_equations(&self, moments: &mut Matrix6<f64>) {
        multiply_left(self.equations.rows(), moments);
        multiply_right(moments, &self.equations.rows().transpose());
    }

    /// Makes the interface forces of the pairs of the second moments of the forces, which lie in
    /// the basis, and gives the noise that one line of all pairs together would have. `None` if
    /// the forces of the band depend on each other.
    ///
    /// Unit forces are the paper's. Their responses share the noise of the same runs. With runs
    /// weighed by their noise, the responses to the columns of Cholesky's factor L of Re G_FF
    /// have noise that is independent and that of a run each.
    fn choose_pairs(&mut self, weights: EquationWeights) -> Option<()> {
        let n = self.forces();
        let mut basis = self.basis;
        self.in_equations(&mut basis);
        lower(&mut basis, n)?;
        let pairs = match weights {
            EquationWeights::Noise => n as f64,
            EquationWeights::Unit => {
                inverse_lower(&mut basis, n);
                let squares = basis.norm_squared();
                basis.copy_from(&IDENTITY);
                squares
            }
        };
        self.basis = basis;
        self.noise.acceleration *= pairs;
        self.noise.force *= pairs;
        Some(())
    }

    /// Number of interface forces, and of columns of H.
    #[must_use]
    pub(super) fn forces(&self) -> usize {
        self.equations.count()
    }

    /// The interface forces of the pairs, and the accelerations in phase with them by the
    /// response `h`.
    pub(super) fn pairs(&self, h: &Complex6, pairs: &mut [LinePair]) {
        for (p, pair) in pairs.iter_mut().enumerate() {
            let (h, force) = (seen(h), self.shares(p));
            let in_phase = |i: usize| product(|j| h[(i, j)].re, force.as_slice());
            *pair = (Vector6::from_fn(|i, _| in_phase(i)), self.force(p));
        }
    }

    /// The resultants at A of the interface force of pair `p`.
    fn force(&self, p: usize) -> Vector6<f64> {
        let (rows, force) = (seen(self.equations.rows()), self.shares(p));
        Vector6::from_fn(|i, _| product(|j| rows[(j, i)], force.as_slice()))
    }

    /// The pair `p` of a real response.
    pub(super) fn pair(&self, response: &Matrix6<f64>, p: usize) -> LinePair {
        (response * self.shares(p), self.force(p))
    }

    /// Share of each column of a response in the acceleration of pair `p`.
    pub(super) fn shares(&self, p: usize) -> Vector6<f64> {
        let basis = seen(&self.basis);
        Vector6::from_fn(|j, _| basis[(j, p)])
    }

    /// The accelerations that the runs excite.
    pub(super) fn excitation(&self) -> &Excitation {
        &self.excitation
    }

    /// Gives the pairs of `set` their noise, with that of the forces as the accelerations it
    /// amounts to: G_FF⁻¹ is bent by it at every line, and an average does not straighten that.
    pub(super) fn add_noise<const PAIRS: usize>(&self, set: &mut Masslines<PAIRS>) {
        let mut response = Matrix6::zeros();
        for (mut column, pair) in response.column_iter_mut().zip(&set.pairs) {
            column.copy_from(&pair.acceleration);
        }
        let mut inverse = self.basis;
        inverse_lower(&mut inverse, self.forces());
        multiply_right(&mut response, &inverse);
        multiply_right(&mut response, self.equations.rows());
        set.noise = self.noise.force;
        multiply_left(&response, &mut set.noise);
        multiply_right(&mut set.noise, &response.transpose());
        set.noise += self.noise.acceleration;
        set.pull = set.noise;
        // The paper's least squares knows no noise but what is left of it in an average.
        if !set.equations.is_whitened() {
            let of_lines = set.noise;
            set.set_averaged_noise(&of_lines);
        }
    }

    /// H at one line: column j is the acceleration of A per unit interface force j.
    ///
    /// # Errors
    /// [`MasslineError::Singular`] if the forces of this line depend on each other.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn response_into(&self, line: usize, h: &mut Complex6) -> Result<(), MasslineError> {
        let mut m = Moments::zero();
        for run in 0..self.lines.runs() {
            self.lines.add_moments(run, line, 1.0, &mut m);
        }
        between(&self.scaled, &mut m.ff, &self.scaled);
        between(&self.scaled, &mut m.fa, &IDENTITY);
        // H = G_AF G_FF⁻¹, so G_FF Hᴴ = G_FA.
        let n = self.forces();
        factor_hermitian(&mut m.ff, n).ok_or(MasslineError::Singular)?;
        solve_hermitian(&m.ff, n, &mut m.fa);
        for j in 0..6 {
            for i in 0..6 {
                h[(i, j)] = m.fa[(j, i)].conj() * self.scale[j];
            }
        }
        Ok(())
    }

    /// Modes of the free structure from all lines `fit`, at most `limit` of them, left in
    /// `space`. `work` holds two elements per line.
    ///
    /// # Errors
    /// [`MasslineError::NoMode`] if there is none in the lines, [`MasslineError::Work`].
    pub(super) fn modes(
        &self,
        fit: LineRange,
        limit: usize,
        space: &mut Workspace,
        work: &mut [Complex<f64>],
    ) -> Result<(), MasslineError> {
        let fit = indices(self.lines, fit)?;
        let Workspace {
            free_modes: modes,
            search,
            ..
        } = space;
        let work = two_a_line(&fit, work)?;
        let n = self.forces();
        // Every diagonal entry counts by its own size, so that rotations and translations
        // are comparable.
        let mut size = [0.0; 6];
        for line in fit.clone() {
            let h = self.diagonal(line)?;
            for (size, h) in size.iter_mut().zip(&h).take(n) {
                *size += libm::sqrt(h.norm_sqr());
            }
        }
        let lines = fit.len() as f64;
        for (line, t) in fit.clone().zip(work.iter_mut()) {
            let h = self.diagonal(line)?;
            *t = Complex::new(0.0, 0.0);
            for (size, h) in size.iter().zip(&h).take(n) {
                // Elastic modes subtract from the rigid body here.
                *t -= h * (lines / size.max(f64::MIN_POSITIVE));
            }
        }
        let frequency = |k: usize| self.lines.frequency(fit.start + k);
        let trace = Trace::new(work, &frequency);
        let mut poles = find_poles(&trace, Residues::Complex, search);
        poles.truncate(limit);
        if poles.is_empty() {
            return Err(MasslineError::NoMode);
        }
        modes.poles = poles;
        self.fit(&fit, modes, &trace)
    }

    /// H in force directions: what a unit force j moves along itself.
    #[inline(never)] // Not on the stack while poles are found.
    fn diagonal(&self, line: usize) -> Result<[Complex<f64>; 6], MasslineError> {
        let mut h = Complex6::zeros();
        self.response_into(line, &mut h)?;
        let (h, e) = (seen(&h), seen(self.equations.rows()));
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
        let sums = &mut cells(&mut normal);
        for i in 0..terms {
            sums[(i, i)] = 0.0;
        }
        // Right-hand sides, and the solutions after them, lie where they belong at last.
        for term in 0..TERMS {
            modes.term(term).fill(0.0);
        }
        let mut h = Complex6::zeros();
        for (k, line) in fit.clone().enumerate() {
            let phi = modes.basis(self.lines.frequency(line));
            let phi = seen(&phi[..]);
            self.response_into(line, &mut h)?;
            for i in 0..terms {
                let conjugate = phi[i].conj() * trace.weight(k);
                for j in 0..terms {
                    sums[(i, j)] += (conjugate * phi[j]).re;
                }
                modes
                    .term(i)
                    .zip_apply(&h, |sum, z| *sum += (conjugate * z).re);
            }
        }
        if !normal.try_inverse_mut() {
            return Err(MasslineError::Singular);
        }
        let inverse = &normal;
        for entry in 0..36 {
            let mut right = [0.0; TERMS];
            for (j, right) in right.iter_mut().enumerate().take(terms) {
                *right = seen(modes.term(j))[entry];
            }
            for i in 0..terms {
                let given = right.iter().enumerate().take(terms);
                let products = given.map(|(j, right)| right * seen(inverse)[(i, j)]);
                cells(modes.term(i))[entry] = products.fold(0.0, |sum, product| sum + product);
            }
        }
        // Scatter of each entry about the fit, as the lines count.
        modes.constant_variance.fill(0.0);
        for (k, line) in fit.clone().enumerate() {
            self.response_into(line, &mut h)?;
            modes.take_elastic(self.lines.frequency(line), &mut h);
            for (z, constant) in h.iter_mut().zip(&modes.constant) {
                z.re -= constant;
            }
            let weight = trace.weight(k);
            let squares = &mut modes.constant_variance;
            squares.zip_apply(&h, |sum, z| *sum += z.norm_sqr() * weight);
        }
        let freedom = (2.0 * fit.len() as f64 - terms as f64).max(1.0);
        modes.constant_variance *= inverse[(0, 0)] * self.lines.correlation() / freedom;
        Ok(())
    }
}

/// Modes of the free structure, as they show in the accelerations of A per unit force.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeModes {
    /// Poles, ascending.
    pub poles: heapless::Vec<Pole, MAX_MODES>,
    /// The rigid body's share: what remains of H at ω = 0, m/s² per N and so on.
    pub(super) constant: Matrix6<f64>,
    /// Residue of each pole: H holds `(residue + quadrature jω/ω_r) D_r(ω)`.
    pub(super) residues: [Matrix6<f64>; MAX_MODES],
    /// Quadrature of each residue, zero where damping does not couple the modes.
    pub(super) quadratures: [Matrix6<f64>; MAX_MODES],
    /// Share of all modes above, per (ω / unit)².
    upper: Matrix6<f64>,
    /// Variance of each entry of the constant.
    pub(super) constant_variance: Matrix6<f64>,
    /// Frequency at which the upper term is one, Hz.
    unit: f64,
}

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));
const NO_VECTOR: Vector6<f64> = Vector6::from_array_storage(ArrayStorage([[0.0; 6]]));

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

    /// Expresses the modes about a point from which A lies `shift` (m) away, per unit of the
    /// interface forces `here` in place of `there`, those about A.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(super) fn move_by(&mut self, shift: &Vector3<f64>, here: &Equations, there: &Equations) {
        // a_B = T⁻¹ a_A, and the forces about A of a unit force about B.
        let mut back = transfer(&-shift);
        let mut forces = here.rows().transpose();
        for mut column in forces.column_iter_mut() {
            let moved = resultants_at(shift, &column.clone_owned());
            column.copy_from(&moved);
        }
        multiply_left(there.rows(), &mut forces);
        let Self {
            constant,
            residues,
            quadratures,
            upper,
            constant_variance,
            ..
        } = self;
        let modes = residues.iter_mut().chain(quadratures);
        for m in modes.chain([constant, upper]) {
            multiply_left(&back, m);
            multiply_right(m, &forces);
        }
        // Variances of sums of independent entries.
        back.apply(|x| *x *= *x);
        forces.apply(|x| *x *= *x);
        multiply_left(&back, constant_variance);
        multiply_right(constant_variance, &forces);
    }

    fn terms(&self) -> usize {
        2 + 2 * self.poles.len()
    }

    /// Coefficient of the function `term` of [`Self::basis`].
    fn term(&mut self, term: usize) -> &mut Matrix6<f64> {
        match term {
            0 => &mut self.constant,
            1 => &mut self.upper,
            _ => {
                let all = match term.is_multiple_of(2) {
                    true => &mut self.residues,
                    false => &mut self.quadratures,
                };
                let last = all.len() - 1;
                let at = (term / 2 - 1).min(last);
                let (_, from) = all.split_at_mut(at);
                match from.first_mut() {
                    Some(matrix) => matrix,
                    None => &mut self.upper,
                }
            }
        }
    }

    fn basis(&self, frequency: f64) -> [Complex<f64>; TERMS] {
        let mut phi = [Complex::new(0.0, 0.0); TERMS];
        let ratio = frequency / self.unit;
        phi[0] = Complex::new(1.0, 0.0);
        phi[1] = Complex::new(ratio * ratio, 0.0);
        let (pairs, _) = phi[2..].as_chunks_mut::<2>();
        for ([of_residue, of_quadrature], pole) in pairs.iter_mut().zip(&self.poles) {
            let d = pole.amplification(frequency);
            *of_residue = d;
            *of_quadrature = d * Complex::new(0.0, frequency / pole.frequency);
        }
        phi
    }

    /// One entry of the elastic part, from the functions of frequency.
    fn elastic_entry(&self, phi: &[Complex<f64>; TERMS], i: usize, j: usize) -> Complex<f64> {
        let residues = self.residues.iter().zip(&self.quadratures);
        let (pairs, _) = phi[2..].as_chunks::<2>();
        let modes = residues.zip(pairs);
        modes.fold(phi[1] * seen(&self.upper)[(i, j)], |sum, ((r, q), phi)| {
            let [of_residue, of_quadrature] = *phi;
            sum + (of_residue * seen(r)[(i, j)] + of_quadrature * seen(q)[(i, j)])
        })
    }

    /// Takes the elastic part at `frequency` Hz out of `h`.
    pub(super) fn take_elastic(&self, frequency: f64, h: &mut Complex6) {
        let phi = self.basis(frequency);
        for j in 0..6 {
            for i in 0..6 {
                h[(i, j)] -= self.elastic_entry(&phi, i, j);
            }
        }
    }
}

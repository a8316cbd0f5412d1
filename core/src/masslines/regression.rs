//! Linear regression of forces on accelerations with nuisance terms, condensed to pairs.
//!
//! The model of a line is `f = (M + Σ_t E_t φ_t) a`, with the wanted real matrix M and
//! unwanted ones E_t that multiply known functions φ_t of frequency. All rows of f share
//! one normal matrix. Eliminating the E_t from it leaves a small matrix S for M alone,
//! and `S = UᵀU` turns it into pairs: the rows of U are pseudo accelerations and `M̂ U`
//! the forces that go with them. Nothing is lost: least squares on these pairs with any
//! structure imposed on M is least squares on all lines with that structure imposed.

use super::driven::{Columns, Functions, MAX_TERMS, Whole};
use super::excitation::IDENTITY;
use super::{Excitation, MasslineError, Masslines, Moments};
use crate::algebra::{
    Triangle, inverse_lower, lower, multiply_left, multiply_right, not_negative, triangle_len,
};
use crate::cells::{cells, seen};
use crate::geometry::{Equations, transfer};
use core::ops::{AddAssign, Mul};
use nalgebra::{ArrayStorage, Complex, Matrix6, SMatrix, SVector, Scalar, Vector3, Vector6};

pub(super) const SIZE: usize = 6 * MAX_TERMS;

type Normal = Triangle<{ triangle_len(SIZE) }>;
type Right = SMatrix<f64, SIZE, 6>;

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));
const NO_RIGHT: Right = Right::from_array_storage(ArrayStorage([[0.0; SIZE]; 6]));

/// Normal equations of the regression, in coordinates of the excited directions and of
/// the measured equations.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    excitation: Excitation,
    equations: Equations,
    terms: usize,
    normal: Normal,
    /// Of the equations that were solved last.
    factor: Normal,
    right: Right,
    power: Matrix6<f64>,
    /// Real equations per row of f.
    count: f64,
    correlation: f64,
    /// `true` if the residuals of different resultants are taken as independent.
    independent: bool,
}

/// The first term of a solution.
pub(super) struct FirstTerm {
    coefficients: Matrix6<f64>,
    /// Of the coefficients in one row, for a residual of one.
    variances: [f64; 6],
    /// Residual variance of each measured equation.
    residual: Vector6<f64>,
}

/// The solution with a chosen set of terms.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    terms: heapless::Vec<usize, MAX_TERMS>,
    /// Coefficients of the chosen terms, in their order: `rank` rows each.
    coefficients: Right,
    /// Information on the first term after elimination of the others.
    schur: Matrix6<f64>,
    /// Covariance of one real equation, in measured-equation coordinates.
    residual: Matrix6<f64>,
    /// `true` if all terms and the residual are known, and not the first term alone.
    complete: bool,
    /// Expected squared error over variance: above one where left-out terms may bias.
    inflation: f64,
}

impl Regression {
    /// A place for one, all zero.
    pub(super) const EMPTY: Self = Self {
        excitation: Excitation::ZERO,
        equations: Equations::NONE,
        terms: 0,
        normal: Normal::ZERO,
        factor: Normal::ZERO,
        right: NO_RIGHT,
        power: NO_MATRIX,
        count: 0.0,
        correlation: 0.0,
        independent: false,
    };

    /// Begins a regression with so many terms, which [`Self::restart`] goes on with. `correlation`
    /// is the variance of a mean over lines relative to independent ones.
    pub(super) fn begin(&mut self, equations: &Equations, terms: usize, correlation: f64) {
        self.equations = *equations;
        self.terms = terms.clamp(1, MAX_TERMS);
        self.correlation = correlation;
        self.independent = false;
    }

    /// Starts again with the excitation that these moments of the accelerations show over
    /// their noise. `None` if there is none.
    pub(super) fn restart(&mut self, aa: &Matrix6<f64>, noise: &Matrix6<f64>) -> Option<()> {
        self.excitation.decide(aa, noise);
        self.normal.clear();
        self.right.fill(0.0);
        self.power.fill(0.0);
        self.count = 0.0;
        (self.excitation.rank() > 0).then_some(())
    }

    /// The directions it is done in.
    pub(super) fn excitation(&self) -> &Excitation {
        &self.excitation
    }

    /// Takes the residuals of different resultants as independent: where there are too
    /// few equations to learn how they correlate.
    pub(super) fn take_residuals_as_independent(&mut self) {
        self.independent = true;
    }

    /// Adds the moments of one line, where term t has the value `phi[t]`, that hold
    /// `equations` real equations. [`Self::turn`] follows after the last one.
    pub(super) fn add(&mut self, moments: &Moments, phi: &[Complex<f64>], equations: f64) {
        let Moments { aa, fa, ff } = moments;
        let (aa, fa) = (seen(aa), seen(fa));
        let (normal, right) = (&mut cells(&mut self.normal), &mut cells(&mut self.right));
        for (t, phi_t) in phi.iter().enumerate().take(self.terms) {
            for (u, phi_u) in phi.iter().enumerate().take(t + 1) {
                // Re conj(φ_t a_i) φ_u a_j
                let factor = Factor::of(phi_t.conj() * phi_u);
                for i in 0..6 {
                    let columns = if t == u { i + 1 } else { 6 };
                    for j in 0..columns {
                        normal[(6 * t + i, 6 * u + j)] += factor.real_product(&aa[(j, i)]);
                    }
                }
            }
            let factor = Factor::of(phi_t.conj());
            for i in 0..6 {
                for j in 0..6 {
                    right[(6 * t + i, j)] += factor.real_product(&fa[(j, i)]);
                }
            }
        }
        for (sum, z) in self.power.iter_mut().zip(ff) {
            *sum += z.re;
        }
        self.count += equations;
    }

    /// Adds all lines of `columns`, where the terms have the values of `functions`, that hold
    /// `equations` real equations, to empty sums.
    ///
    /// Whole numbers are summed as they are, in the memory of the sums that they become at last.
    pub(super) fn add_columns(
        &mut self,
        columns: &Columns<'_>,
        functions: &dyn Fn(usize) -> Functions,
        equations: f64,
    ) {
        let Self {
            normal,
            right,
            power,
            ..
        } = self;
        columns.visit_whole(functions, |whole| {
            let (forces, terms) = whole.split_at(6.min(whole.len()));
            let mut rest = normal.entries_mut();
            for (i, column) in terms.iter().enumerate() {
                let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
                    return;
                };
                add_whole(row, column, terms);
                rest = after;
            }
            for (sums, force) in right.data.0.iter_mut().zip(forces) {
                add_whole(sums, force, terms);
            }
            for (sums, force) in power.data.0.iter_mut().zip(forces) {
                add_whole(sums, force, forces);
            }
        });
        let mut rest = normal.entries_mut();
        for i in 0..6 * self.terms {
            let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
                break;
            };
            settle(row, columns, 6 + i, 6);
            rest = after;
        }
        for (j, sums) in right.data.0.iter_mut().enumerate() {
            let used = sums.get_mut(..6 * self.terms).unwrap_or_default();
            settle(used, columns, j, 6);
        }
        for (j, sums) in power.data.0.iter_mut().enumerate() {
            settle(sums, columns, j, 0);
        }
        self.count += equations;
    }

    /// Turns the sums over all lines into the regression's coordinates: once, and not for each line.
    /// With a `shift`, m, amplitudes were those about the point from which that of the regression
    /// lies so far away.
    #[inline(never)] // Its matrices are off the stack when it is solved.
    pub(super) fn turn(&mut self, shift: Option<&Vector3<f64>>) {
        let mut p = *self.excitation.coordinates();
        let mut e = *self.equations.rows();
        if let Some(shift) = shift {
            // Of accelerations, T, and of resultants, T⁻ᵀ.
            multiply_right(&mut p, &transfer(shift));
            multiply_right(&mut e, &transfer(&-shift).transpose());
        }
        let (p, e) = (&p, &e);
        let mut block = NO_MATRIX;
        for t in 0..self.terms {
            for u in 0..=t {
                let normal = &mut cells(&mut self.normal);
                for i in 0..6 {
                    for j in 0..6 {
                        // Of a term with itself there is one half.
                        let (k, l) = if t == u && j > i { (j, i) } else { (i, j) };
                        block[(i, j)] = normal[(6 * t + k, 6 * u + l)];
                    }
                }
                between(p, &mut block, p);
                for i in 0..6 {
                    let columns = if t == u { i + 1 } else { 6 };
                    for j in 0..columns {
                        normal[(6 * t + i, 6 * u + j)] = seen(&block)[(i, j)];
                    }
                }
            }
            let right = &mut cells(&mut self.right);
            for i in 0..6 {
                for j in 0..6 {
                    block[(i, j)] = right[(6 * t + i, j)];
                }
            }
            between(p, &mut block, e);
            for i in 0..6 {
                for j in 0..6 {
                    right[(6 * t + i, j)] = block[(i, j)];
                }
            }
        }
        between(e, &mut self.power, e);
    }

    /// Solves with the given terms, the first of which is the rigid one. `None` if the
    /// chosen terms cannot be told apart or too few equations are left.
    pub(super) fn solve(&mut self, chosen: &[usize], into: &mut Solution) -> Option<()> {
        self.solve_for(chosen, true, into)
    }

    /// As [`Self::solve`], but only what [`Self::risk`] asks for: the first term.
    pub(super) fn solve_first_term(&mut self, chosen: &[usize], into: &mut Solution) -> Option<()> {
        self.solve_for(chosen, false, into)
    }

    /// Completes a solution of [`Self::solve_first_term`] that was compared with others.
    pub(super) fn complete(&mut self, solution: &mut Solution) -> Option<()> {
        if solution.complete {
            return Some(());
        }
        let (terms, inflation) = (solution.terms.clone(), solution.inflation);
        self.solve_for(&terms, true, solution)?;
        solution.inflation = inflation;
        Some(())
    }

    #[inline(never)] // Once in the flash.
    fn solve_for(&mut self, chosen: &[usize], all_terms: bool, into: &mut Solution) -> Option<()> {
        let rank = self.excitation.rank();
        let rows = self.equations.count();
        let unknowns = rank * chosen.len();
        let freedom = self.count - unknowns as f64;
        if unknowns == 0 || rows == 0 || freedom < 1.0 {
            return None;
        }
        // No unknowns, had the rank been zero: the divisions cannot know.
        let each = rank.max(1);
        let all = unknowns.max(1);
        let (chosen_terms, normal) = (seen(chosen), seen(&self.normal));
        let at = |n: usize| 6 * chosen_terms[n / each] + n % each;
        let gathered = |i: usize, j: usize| {
            let (i, j) = (at(i), at(j));
            if i >= j {
                normal[(i, j)]
            } else {
                normal[(j, i)]
            }
        };
        // Column equilibration, then an LDLᵀ without pivoting that starts with the
        // nuisance terms: what it leaves of the rigid block is the Schur complement.
        let order = |n: usize| (n + rank) % all;
        let mut scale = SVector::<f64, SIZE>::zeros();
        let scale = &mut cells(&mut scale);
        for n in 0..unknowns {
            let d = gathered(order(n), order(n));
            if !(d > 0.0 && d.is_finite()) {
                return None;
            }
            scale[n] = 1.0 / libm::sqrt(d);
        }
        let l = &mut cells(&mut self.factor);
        let nuisance = unknowns - rank;
        let Solution {
            coefficients,
            schur,
            residual,
            ..
        } = into;
        schur.fill(0.0);
        let schur = &mut cells(schur);
        for j in 0..unknowns {
            for i in j..unknowns {
                let mut sum = gathered(order(i), order(j)) * scale[i] * scale[j];
                let eliminated = j.min(nuisance);
                for k in 0..eliminated {
                    sum -= l[(i, k)] * l[(j, k)];
                }
                if j >= nuisance {
                    let (a, b) = (i - nuisance, j - nuisance);
                    let value = sum / (scale[i] * scale[j]);
                    schur[(a, b)] = value;
                    schur[(b, a)] = value;
                }
                for k in eliminated..j {
                    sum -= l[(i, k)] * l[(j, k)];
                }
                if i == j {
                    // 1e-12 of a unit diagonal: the column is a combination of others.
                    if sum <= 1e-12 || sum.is_nan() {
                        return None;
                    }
                    l[(j, j)] = libm::sqrt(sum);
                } else {
                    l[(i, j)] = sum / l[(j, j)];
                }
            }
        }
        // One right-hand side after the other. What each leaves of the power is taken off
        // before the back substitution overwrites its projections.
        coefficients.fill(0.0);
        let (right, filled) = (seen(&self.right), &mut cells(coefficients));
        for c in 0..rows {
            for i in 0..unknowns {
                let mut sum = right[(at(order(i)), c)] * scale[i];
                for k in 0..i {
                    sum -= l[(i, k)] * filled[(k, c)];
                }
                filled[(i, c)] = sum / l[(i, i)];
            }
        }
        let first = if all_terms { 0 } else { nuisance };
        if all_terms {
            *residual = self.power;
            let left = &mut cells(residual);
            for c in 0..rows {
                for d in 0..=c {
                    let mut explained = 0.0;
                    for i in 0..unknowns {
                        explained += filled[(i, c)] * filled[(i, d)];
                    }
                    left[(c, d)] -= explained;
                    left[(d, c)] = left[(c, d)];
                }
            }
            *residual /= freedom;
            self.floor(residual);
        }
        let l = seen(&self.factor);
        for mut column in coefficients.column_iter_mut().take(rows) {
            let mut ordered = SVector::<f64, SIZE>::zeros();
            ordered.copy_from(&column);
            let ordered = &mut cells(&mut ordered);
            for i in (first..unknowns).rev() {
                let mut sum = ordered[i];
                for k in i + 1..unknowns {
                    sum -= l[(k, i)] * ordered[k];
                }
                ordered[i] = sum / l[(i, i)];
            }
            let column = &mut cells(&mut column);
            for i in first..unknowns {
                column[order(i)] = ordered[i] * scale[i];
            }
        }
        into.terms = heapless::Vec::from_slice(chosen).ok()?;
        into.complete = all_terms;
        into.inflation = 1.0;
        Some(())
    }

    /// Takes `left`, the residual power of all six resultants from elsewhere, for the
    /// solution's own.
    pub(super) fn replace_residual(&self, solution: &mut Solution, left: &Matrix6<f64>) {
        let e = self.equations.rows();
        let freedom = (self.count - self.excitation.rank() as f64).max(1.0);
        solution.residual = e * left * e.transpose() / freedom;
        self.floor(&mut solution.residual);
    }

    /// Makes a residual covariance one that can be inverted: no better than the `f32` spectra it
    /// was computed from, and no more correlated than 0.999, since a residual of the
    /// model points one way and would grant infinite trust to all others.
    fn floor(&self, c: &mut Matrix6<f64>) {
        const AMPLITUDE: f64 = 2e-7;
        const NOTHING: f64 = 1e-12;
        for i in 0..6 {
            for j in 0..=i {
                let mean = (c[(i, j)] + c[(j, i)]) * 0.5;
                (c[(i, j)], c[(j, i)]) = (mean, mean);
            }
        }
        if self.independent {
            keep_diagonal(c);
        }
        let largest = self.power.diagonal().max();
        let (powers, diagonal) = (seen(&self.power), &mut cells(c));
        for j in 0..self.equations.count() {
            // A resultant that is zero throughout, exactly, is no better known than that.
            let power = powers[(j, j)].max(NOTHING * largest);
            let floor = AMPLITUDE * AMPLITUDE * power / self.count;
            diagonal[(j, j)] =
                not_negative(diagonal[(j, j)]) * 1.001 + floor.max(f64::MIN_POSITIVE);
        }
        // Where the spectra fit to their last digit, the residual is the difference of
        // large numbers and its correlations mean nothing.
        if lower(&mut { *c }, self.equations.count()).is_none() {
            keep_diagonal(c);
        }
    }

    /// The part of a solution with which [`Self::risk`] compares others.
    pub(super) fn first_term(&self, solution: &Solution) -> Option<FirstTerm> {
        Some(FirstTerm {
            coefficients: solution.coefficients.fixed_rows::<6>(0).into(),
            variances: variances(&solution.schur, self.excitation.rank())?,
            residual: solution.residual.diagonal(),
        })
    }

    /// Expected squared error of the first term's coefficients, summed relative to their
    /// variances in `full`, a solution with more terms. Notes the share of bias in
    /// `solution`, whose pairs then carry it in their variances.
    pub(super) fn risk(&self, solution: &mut Solution, full: &FirstTerm) -> f64 {
        let rank = self.excitation.rank();
        let Some(p) = variances(&solution.schur, rank) else {
            return f64::INFINITY;
        };
        let (p, p_full) = (seen(&p[..]), seen(&full.variances[..]));
        let (residual, first) = (seen(&full.residual), seen(&full.coefficients));
        let coefficients = seen(&solution.coefficients);
        let (mut variance, mut distance) = (0.0, 0.0);
        for i in 0..rank {
            for j in 0..self.equations.count() {
                let unit = p_full[i] * residual[j] * self.correlation;
                let difference = coefficients[(i, j)] - first[(i, j)];
                variance += p[i] / p_full[i];
                // Between nested fits the variance of a difference is the difference of
                // the variances.
                distance += difference * difference / unit - (1.0 - p[i] / p_full[i]);
            }
        }
        let bias = not_negative(distance);
        solution.inflation = 1.0 + bias / variance;
        variance + bias
    }

    /// The equations in combinations whose residuals are independent and of variance one.
    pub(super) fn whitened(&self, solution: &Solution) -> Option<Equations> {
        let rows = self.equations.count();
        let mut weights = solution.residual;
        lower(&mut weights, rows)?;
        inverse_lower(&mut weights, rows);
        Some(self.equations.whitened(&weights))
    }

    /// Share of the accelerations' power that is left to the pairs, mean over the excited
    /// directions: the other terms of `solution` take the rest.
    pub(super) fn share_of_pairs(&self, solution: &Solution) -> f64 {
        let rank = self.excitation.rank();
        let mut power = Matrix6::zeros();
        let (normal, entries) = (seen(&self.normal), &mut cells(&mut power));
        for i in 0..rank {
            for j in 0..=i {
                entries[(i, j)] = normal[(i, j)];
                entries[(j, i)] = normal[(i, j)];
            }
        }
        if lower(&mut power, rank).is_none() {
            return 1.0;
        }
        inverse_lower(&mut power, rank);
        let mut left = solution.schur;
        multiply_left(&power, &mut left);
        power.transpose_mut();
        multiply_right(&mut left, &power);
        left.trace() / rank as f64
    }

    /// Independent real equations that are left over in each row.
    pub(super) fn freedom(&self, solution: &Solution) -> f64 {
        let unknowns = self.excitation.rank() * solution.terms.len();
        ((self.count - unknowns as f64) / self.correlation).max(1.0)
    }

    /// Takes accelerations to the pairs, without what the other terms explain of them: all zero if
    /// they cannot be told.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn to_pairs(&self, solution: &Solution) -> Matrix6<f64> {
        let rank = self.excitation.rank();
        let mut to_pairs = solution.schur;
        if lower(&mut to_pairs, rank).is_none() {
            return NO_MATRIX;
        }
        inverse_lower(&mut to_pairs, rank);
        let coordinates = self.excitation.coordinates();
        between(&IDENTITY, &mut to_pairs, &coordinates.transpose());
        to_pairs
    }

    /// Contribution of second moments of acceleration, real part, to each pair: the share
    /// of the pair's power.
    #[inline(never)] // Its matrix is off the stack when the caller goes on.
    pub(super) fn powers(&self, to_pairs: &Matrix6<f64>, moments: &Matrix6<f64>) -> [f64; 6] {
        let mut inner = *moments;
        between(to_pairs, &mut inner, to_pairs);
        let rank = self.excitation.rank();
        core::array::from_fn(|p| if p < rank { inner[(p, p)] } else { 0.0 })
    }

    /// Adds the pairs to `set`, whitened by the residual.
    pub(super) fn masslines<const PAIRS: usize>(
        &self,
        solution: &Solution,
        set: &mut Masslines<PAIRS>,
    ) -> Result<(), MasslineError> {
        let rank = self.excitation.rank();
        let rows = self.equations.count();
        set.equations = self.whitened(solution).ok_or(MasslineError::Singular)?;
        let mut u = solution.schur;
        lower(&mut u, rank).ok_or(MasslineError::Singular)?;
        let (u, coefficients) = (seen(&u), seen(&solution.coefficients));
        for p in 0..rank {
            // Row p of U, with S = U Uᵀ here: column p of the lower factor.
            let c = Vector6::from_fn(|i, _| if i < rank { u[(i, p)] } else { 0.0 });
            let acceleration = self.excitation.basis() * c;
            let measured = Vector6::from_fn(|j, _| {
                (0..rank).map(|i| coefficients[(i, j)] * seen(&c)[i]).sum()
            });
            let force = self.equations.rows().transpose() * measured;
            let mut variance = Vector6::zeros();
            let all = self.correlation * solution.inflation;
            variance.iter_mut().take(rows).for_each(|v| *v = all);
            set.push(acceleration, force, variance)?;
        }
        Ok(())
    }

    /// Residual power of each resultant, summed over all real equations.
    pub(super) fn residual_diagonal(&self, solution: &Solution) -> Vector6<f64> {
        let e = self.equations.rows();
        (e.transpose() * solution.residual * e).diagonal() * self.count
    }

    /// Leaves the coefficient matrix of one term, 6 x 6 in the units of `f / a`, in `into`:
    /// zero where nothing was excited or measured. `false`, and all zero, if the term was
    /// not chosen.
    pub(super) fn coefficient(
        &self,
        solution: &Solution,
        term: usize,
        into: &mut Matrix6<f64>,
    ) -> bool {
        into.fill(0.0);
        let rank = self.excitation.rank();
        let Some(n) = solution.terms.iter().position(|&t| t == term) else {
            return false;
        };
        let (entries, coefficients) = (&mut cells(into), seen(&solution.coefficients));
        for i in 0..rank {
            for j in 0..6 {
                entries[(j, i)] = coefficients[(n * rank + i, j)];
            }
        }
        let (rows, coordinates) = (self.equations.rows(), self.excitation.coordinates());
        between(&rows.transpose(), into, &coordinates.transpose());
        true
    }
}

impl Solution {
    /// A place for one, all zero.
    pub(super) const EMPTY: Self = Self {
        terms: heapless::Vec::new(),
        coefficients: NO_RIGHT,
        schur: NO_MATRIX,
        residual: NO_MATRIX,
        complete: false,
        inflation: 0.0,
    };

    /// `true` if it has a coefficient of this term.
    pub(super) fn has(&self, term: usize) -> bool {
        self.terms.contains(&term)
    }

    /// Its memory, for matrices of six, once it is of no use: one a term.
    pub(super) fn spent(&mut self) -> &mut [[f64; SIZE]; 6] {
        self.terms.clear();
        &mut self.coefficients.data.0
    }
}

/// A factor that often is real: what is zero costs nothing then.
enum Factor {
    One,
    Real(f64),
    Complex(Complex<f64>),
}

impl Factor {
    fn of(x: Complex<f64>) -> Self {
        if x.im == 0.0 && x.re == 1.0 {
            Self::One
        } else if x.im == 0.0 {
            Self::Real(x.re)
        } else {
            Self::Complex(x)
        }
    }

    /// Real part of the product with it.
    fn real_product(&self, y: &Complex<f64>) -> f64 {
        match self {
            Self::One => y.re,
            Self::Real(x) => x * y.re,
            Self::Complex(x) => x.re * y.re - x.im * y.im,
        }
    }
}

/// Replaces `m` by `left m rightᵀ`, for factors most of which are zeros and ones.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
pub(super) fn between<T>(left: &Matrix6<f64>, m: &mut Matrix6<T>, right: &Matrix6<f64>)
where
    T: Scalar + Copy + Default + AddAssign + Mul<f64, Output = T>,
{
    let identity = |m: &Matrix6<f64>| (0..36).all(|k| m[k] == f64::from(u8::from(k % 7 == 0)));
    if identity(left) && identity(right) {
        return;
    }
    let mut half = Matrix6::from_element(T::default());
    for j in 0..6 {
        for k in 0..6 {
            let r = right[(j, k)];
            if r == 1.0 {
                for i in 0..6 {
                    half[(i, j)] += m[(i, k)];
                }
            } else if r != 0.0 {
                for i in 0..6 {
                    half[(i, j)] += m[(i, k)] * r;
                }
            }
        }
    }
    m.fill(T::default());
    for k in 0..6 {
        for i in 0..6 {
            let l = left[(i, k)];
            if l == 1.0 {
                for j in 0..6 {
                    m[(i, j)] += half[(k, j)];
                }
            } else if l != 0.0 {
                for j in 0..6 {
                    m[(i, j)] += half[(k, j)] * l;
                }
            }
        }
    }
}

/// Adds the products of `column` with others to whole numbers that lie in `sums` bit by bit.
#[inline(never)] // In a loop of its own it has registers enough.
fn add_whole(sums: &mut [f64], column: &Whole, others: &[Whole]) {
    let add = |sum: &mut f64, other: &Whole| {
        let whole = sum.to_bits().cast_signed() + column.product(other);
        *sum = f64::from_bits(whole.cast_unsigned());
    };
    // Two at a time, written out: a turn of the loop costs as much as a product.
    let (twos, rest) = sums.as_chunks_mut();
    let (others, after) = others.split_at(others.len().min(2 * twos.len()));
    for ([x, y], [a, b]) in twos.iter_mut().zip(others.as_chunks().0) {
        add(x, a);
        add(y, b);
    }
    for (sum, other) in rest.iter_mut().zip(after) {
        add(sum, other);
    }
}

/// Makes the sums of whole numbers those of the numbers: of the column `own` with those from
/// `first` on.
#[inline(never)] // Once in the flash.
fn settle(sums: &mut [f64], columns: &Columns<'_>, own: usize, first: usize) {
    let unit = columns.unit(own);
    for (j, sum) in sums.iter_mut().enumerate() {
        let whole = sum.to_bits().cast_signed() as f64;
        *sum = whole * unit * columns.unit(first + j);
    }
}

/// Makes all zero beside the diagonal.
fn keep_diagonal(m: &mut Matrix6<f64>) {
    m.fill_lower_triangle(0.0, 1);
    m.fill_upper_triangle(0.0, 1);
}

/// Diagonal of the inverse of the leading `n` x `n` part.
fn variances(matrix: &Matrix6<f64>, n: usize) -> Option<[f64; 6]> {
    let mut inverse = *matrix;
    lower(&mut inverse, n)?;
    inverse_lower(&mut inverse, n);
    let inverse = seen(&inverse);
    Some(core::array::from_fn(|i| {
        (0..n).map(|k| inverse[(k, i)] * inverse[(k, i)]).sum()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masslines::lines::Internals;
    use crate::masslines::samples::{LINES, RUNS, Samples, functions, in_single, weights};
    use crate::masslines::{DriveLines, Lines};
    use crate::spectra::Window;

    const TERMS: usize = 3;

    fn begun() -> Regression {
        let mut regression = Regression::EMPTY;
        regression.begin(&Equations::all(), TERMS, 1.0);
        // All six are excited, so that coordinates are the accelerations themselves.
        let (aa, noise) = (Matrix6::identity(), Matrix6::identity() * 1e-9);
        regression.restart(&aa, &noise).unwrap();
        regression
    }

    /// The sums of double precision about a point `shift` (m) away.
    fn line_by_line(lines: &DriveLines<'_>, shift: &Vector3<f64>) -> Regression {
        let mut regression = begun();
        for line in 0..LINES {
            let mut m = Moments::zero();
            for (run, weight) in weights().iter().enumerate().take(RUNS) {
                lines.add_moments(run, line, *weight, &mut m);
            }
            regression.add(&m, &functions(line)[..TERMS], 2.0 * RUNS as f64);
        }
        regression.turn(Some(shift));
        regression
    }

    /// Whole numbers add up to the sums of double precision, for any reference point.
    ///
    /// A column is off by the roundings of its numbers, some eight of 2^-24, and by less than a unit
    /// in each of its 240 parts, where the largest part is above 2^24 units: by less than
    /// `2^-21 + 16 · 2^-24` of its norm. Sums of products are off by no more than that of the product
    /// of norms (Cauchy and Schwarz), for both columns. The point is moved after that, in double
    /// precision: what is far away has the rounding of the lever.
    #[test]
    fn whole_numbers_add_up_to_the_sums_of_double_precision() {
        let samples = Samples::new();
        let runs = samples.runs();
        let lines = DriveLines::new(&runs, Window::Hann).unwrap();
        let here = line_by_line(&lines, &Vector3::zeros());
        let off = 2.0 * (0.5_f64.powi(21) + 0.5_f64.powi(20));
        for shift in [
            Vector3::zeros(),
            Vector3::new(0.1, -0.2, 0.4),
            Vector3::new(40.0, -70.0, 15.0),
        ] {
            let expected = line_by_line(&lines, &shift);
            let driven = lines.driven().unwrap();
            let columns =
                Columns::new(driven, &weights(), 0..RUNS, &(0..LINES), TERMS, &in_single).unwrap();
            let mut found = begun();
            found.add_columns(&columns, &in_single, (2 * RUNS * LINES) as f64);
            found.turn(Some(&shift));
            assert_eq!(found.count, expected.count);
            let t = transfer(&shift).abs();
            let back = transfer(&-shift).transpose().abs();
            let norm = |column: usize| -> f64 {
                let (term, i) = (column / 6, column % 6);
                let own = |k: usize| here.normal.get(6 * term + k, 6 * term + k).unwrap().sqrt();
                (0..6).map(|k| t[(i, k)] * own(k)).sum()
            };
            let force = |i: usize| -> f64 {
                (0..6)
                    .map(|k| back[(i, k)] * here.power[(k, k)].sqrt())
                    .sum()
            };
            let mut largest = 0.0_f64;
            for i in 0..6 * TERMS {
                for j in 0..=i {
                    let error =
                        found.normal.get(i, j).unwrap() - expected.normal.get(i, j).unwrap();
                    largest = largest.max(error.abs() / (norm(i) * norm(j)));
                }
                for j in 0..6 {
                    let error = found.right[(i, j)] - expected.right[(i, j)];
                    largest = largest.max(error.abs() / (norm(i) * force(j)));
                }
            }
            for i in 0..6 {
                for j in 0..6 {
                    let error = found.power[(i, j)] - expected.power[(i, j)];
                    largest = largest.max(error.abs() / (force(i) * force(j)));
                }
            }
            assert!(largest < off, "{shift}: {largest} {off}");
        }
    }
}

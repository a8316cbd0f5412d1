//! Linear regression of forces on accelerations with nuisance terms, condensed to pairs.
//!
//! The model of a line is `f = (M + Σ_t E_t φ_t) a`, with the wanted real matrix M and
//! unwanted ones E_t that multiply known functions φ_t of frequency. All rows of f share
//! one normal matrix. Eliminating the E_t from it leaves a small matrix S for M alone,
//! and `S = UᵀU` turns it into pairs: the rows of U are pseudo accelerations and `M̂ U`
//! the forces that go with them. Nothing is lost: least squares on these pairs with any
//! structure imposed on M is least squares on all lines with that structure imposed.

use super::driven::{Columns, Functions, MAX_TERMS};
use super::excitation::IDENTITY;
use super::{Excitation, MasslineError, Masslines, Moments};
use crate::algebra::{
    Triangle, inverse_lower, lower, multiply_left, multiply_right, not_negative, solve_positive,
    triangle_len,
};
use crate::cells::{cells, seen};
use crate::geometry::Equations;
use core::ops::Range;
use nalgebra::{ArrayStorage, Complex, Matrix6, Vector3, Vector6};
use sums::{NO_RIGHT, Normal, Right, Sums};

mod motions;
mod sums;

pub(super) use sums::{SIZE, between};

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

/// Normal equations of the regression, in coordinates of the excited directions and of
/// the measured equations.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    excitation: Excitation,
    equations: Equations,
    sums: Sums,
    /// Of the equations that were solved last.
    factor: Normal,
    correlation: f64,
    /// `true` if the residuals of different resultants are taken as independent.
    independent: bool,
}

/// The first term of a solution.
#[derive(Clone)]
pub(super) struct FirstTerm {
    terms: heapless::Vec<usize, MAX_TERMS>,
    coefficients: Matrix6<f64>,
    /// Of the coefficients in one row, for a residual of one.
    variances: [f64; 6],
    /// Residual variance of each measured equation.
    residual: Vector6<f64>,
}

/// The part of a solution that is asked for.
#[derive(Clone, Copy)]
enum Wanted<'f> {
    All,
    FirstTermAndResidual,
    /// The first term, if its risk relative to that of another solution can be below so much.
    FirstTerm(&'f FirstTerm, f64),
}

/// Terms of which the share in the first one is known, if not where it goes in the coefficients.
pub(super) struct KnownTerms {
    /// Mean share of each term, zero where it is not known.
    shares: [f64; MAX_TERMS],
    /// Products of the terms' functions, summed over lines and excited directions.
    products: Triangle<{ triangle_len(MAX_TERMS) }>,
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
    /// Expected squared error over variance: above one where left-out terms may bias.
    inflation: f64,
    /// Of the first term's coefficients in one row, for a residual of one, unless all terms were asked for.
    variances: [f64; 6],
}

impl Regression {
    /// A place for one, all zero.
    pub(super) const EMPTY: Self = Self {
        excitation: Excitation::ZERO,
        equations: Equations::NONE,
        sums: Sums::EMPTY,
        factor: Normal::ZERO,
        correlation: 0.0,
        independent: false,
    };

    /// Begins a regression with so many terms, which [`Self::restart`] goes on with. `correlation`
    /// is the variance of a mean over lines relative to independent ones.
    pub(super) fn begin(&mut self, equations: &Equations, terms: usize, correlation: f64) {
        self.equations = *equations;
        self.sums.begin(terms);
        self.correlation = correlation;
        self.independent = false;
    }

    /// Starts again with the excitation that these moments of the accelerations show over
    /// their noise. `None` if there is none.
    pub(super) fn restart(&mut self, aa: &Matrix6<f64>, noise: &Matrix6<f64>) -> Option<()> {
        self.excitation.decide(aa, noise);
        self.sums.clear();
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

    /// Adds the moments of one line, see [`Sums::add`]. [`Self::turn`] follows after the last one.
    pub(super) fn add(&mut self, moments: &Moments, phi: &[Complex<f64>], equations: f64) {
        self.sums.add(moments, phi, equations);
    }

    /// Adds all lines of `columns`, see [`Sums::add_columns`]. [`Self::turn`] follows.
    pub(super) fn add_columns(
        &mut self,
        columns: &Columns<'_>,
        functions: &dyn Fn(usize) -> Functions,
        equations: f64,
    ) {
        self.sums.add_columns(columns, functions, equations);
    }

    /// Takes the sums to the excited directions, the others after them, and to the measured equations, see
    /// [`Sums::turn`].
    pub(super) fn turn(&mut self, shift: Option<&Vector3<f64>>) {
        let mut directions = *self.excitation.coordinates();
        directions += self.excitation.others();
        self.sums.turn(&directions, self.equations.rows(), shift);
    }

    /// Solves with the given terms, the first of which is the rigid one. `None` if the
    /// chosen terms cannot be told apart or too few equations are left.
    pub(super) fn solve(&mut self, chosen: &[usize], into: &mut Solution) -> Option<()> {
        self.solve_for(chosen, Wanted::All, into)
    }

    /// As [`Self::solve`], but only what [`Self::first_term`] asks for: the first term and the residual.
    pub(super) fn solve_first_term_and_residual(
        &mut self,
        chosen: &[usize],
        into: &mut Solution,
    ) -> Option<()> {
        self.solve_for(chosen, Wanted::FirstTermAndResidual, into)
    }

    /// As [`Self::solve`], but only what [`Self::risk`] asks for: the first term. `None`, too, if its risk is not below
    /// `least` even without bias, relative to `full`.
    pub(super) fn solve_first_term(
        &mut self,
        chosen: &[usize],
        full: &FirstTerm,
        least: f64,
        into: &mut Solution,
    ) -> Option<()> {
        self.solve_for(chosen, Wanted::FirstTerm(full, least), into)
    }

    /// Solves anew for all terms and the residual of a solution that was compared with others.
    pub(super) fn complete(&mut self, solution: &mut Solution) -> Option<()> {
        let (terms, inflation) = (solution.terms.clone(), solution.inflation);
        self.solve_for(&terms, Wanted::All, solution)?;
        solution.inflation = inflation;
        Some(())
    }

    #[inline(never)] // Once in the flash.
    fn solve_for(
        &mut self,
        chosen: &[usize],
        wanted: Wanted<'_>,
        into: &mut Solution,
    ) -> Option<()> {
        let all_terms = matches!(wanted, Wanted::All);
        let rank = self.excitation.rank();
        let rows = self.equations.count();
        let unknowns = rank * chosen.len();
        let freedom = self.sums.count - unknowns as f64;
        if unknowns == 0 || rows == 0 || freedom < 1.0 {
            return None;
        }
        let places = self.places(chosen);
        let nuisance = unknowns - rank;
        self.factorize(&places, [unknowns, nuisance], &mut into.schur)?;
        if !all_terms {
            into.variances = variances(&into.schur, rank)?;
        }
        if let Wanted::FirstTerm(full, least) = wanted {
            let shares = into.variances.iter().zip(&full.variances);
            let variance: f64 = shares.take(rank).map(|(p, p_full)| p / p_full).sum();
            if variance * rows as f64 >= least {
                return None;
            }
        }
        self.project(&places, unknowns, &mut into.coefficients);
        if !matches!(wanted, Wanted::FirstTerm(..)) {
            into.residual = self.unexplained(&into.coefficients, unknowns) / freedom;
            self.floor(&mut into.residual);
        }
        let first = if all_terms { 0 } else { nuisance };
        self.substitute_back(first, [unknowns, nuisance], &mut into.coefficients);
        into.terms = heapless::Vec::from_slice(chosen).ok()?;
        into.inflation = 1.0;
        Some(())
    }

    /// Places of the unknowns in the sums: those of the rigid term, the first of the chosen ones, last.
    fn places(&self, chosen: &[usize]) -> [usize; SIZE] {
        let rank = self.excitation.rank();
        let mut places = [0; SIZE];
        let (rigid, others) = chosen.split_at(1.min(chosen.len()));
        let in_order = others.iter().chain(rigid);
        let of_terms = in_order.flat_map(|t| (0..rank).map(move |i| 6 * t + i));
        for (place, of_term) in places.iter_mut().zip(of_terms) {
            *place = of_term;
        }
        places
    }

    /// Cholesky's factor of the normal matrix at these places, with the reciprocals of its diagonal. Elimination of the
    /// `nuisance` first unknowns leaves the Schur complement of the others.
    fn factorize(
        &mut self,
        places: &[usize; SIZE],
        [unknowns, nuisance]: [usize; 2],
        schur: &mut Matrix6<f64>,
    ) -> Option<()> {
        let (places, normal) = (seen(&places[..]), seen(&self.sums.normal));
        let gathered = |i: usize, j: usize| {
            let (i, j) = (places[i], places[j]);
            if i >= j {
                normal[(i, j)]
            } else {
                normal[(j, i)]
            }
        };
        schur.fill(0.0);
        let schur = &mut cells(schur);
        for j in 0..unknowns {
            for i in j..unknowns {
                let mut sum = gathered(i, j);
                let (own, other) = (self.factor.row(i), self.factor.row(j));
                let mut products = own.iter().zip(other).map(|(x, y)| x * y).take(j);
                for product in products.by_ref().take(nuisance) {
                    sum -= product;
                }
                if j >= nuisance {
                    let (a, b) = (i - nuisance, j - nuisance);
                    schur[(a, b)] = sum;
                    schur[(b, a)] = sum;
                }
                for product in products {
                    sum -= product;
                }
                let l = &mut cells(&mut self.factor);
                if i == j {
                    // At 1e-12 of its power the column is a combination of others.
                    let least = 1e-12 * gathered(j, j);
                    if sum <= least || !sum.is_finite() {
                        return None;
                    }
                    l[(j, j)] = 1.0 / libm::sqrt(sum);
                } else {
                    l[(i, j)] = sum * l[(j, j)];
                }
            }
        }
        Some(())
    }

    /// Projections of each right-hand side, by forward substitution.
    fn project(&self, places: &[usize; SIZE], unknowns: usize, into: &mut Right) {
        into.fill(0.0);
        let columns = self.sums.right.data.0.iter().zip(&mut into.data.0);
        for (right, filled) in columns.take(self.equations.count()) {
            let right = seen(&right[..]);
            for (x, place) in filled.iter_mut().zip(places).take(unknowns) {
                *x = right[*place];
            }
            self.forward(unknowns, filled);
        }
    }

    /// Forward substitution of the first `unknowns` elements.
    fn forward(&self, unknowns: usize, column: &mut [f64]) {
        for i in 0..unknowns {
            let row = self.factor.row(i);
            let mut sum = seen(column)[i];
            for (l, x) in row.iter().zip(&*column).take(i) {
                sum -= l * x;
            }
            cells(column)[i] = sum * seen(row)[i];
        }
    }

    /// Back substitution of these elements, which are the last ones.
    fn backward(&self, elements: Range<usize>, column: &mut [f64]) {
        for i in elements.clone().rev() {
            let row = self.factor.row(i);
            let x = seen(column)[i] * seen(row)[i];
            cells(column)[i] = x;
            for (left, l) in column.iter_mut().zip(row).take(i).skip(elements.start) {
                *left -= l * x;
            }
        }
    }

    /// Power of the measured equations that their projections leave.
    fn unexplained(&self, projections: &Right, unknowns: usize) -> Matrix6<f64> {
        let mut power = self.sums.power;
        let (left, projections) = (&mut cells(&mut power), seen(projections));
        for c in 0..self.equations.count() {
            for d in 0..=c {
                let mut explained = 0.0;
                for i in 0..unknowns {
                    explained += projections[(i, c)] * projections[(i, d)];
                }
                left[(c, d)] -= explained;
                left[(d, c)] = left[(c, d)];
            }
        }
        power
    }

    /// Coefficients from their projections, of the unknowns from `first` on. Those of the rigid term, which are the last,
    /// come first then.
    fn substitute_back(
        &self,
        first: usize,
        [unknowns, nuisance]: [usize; 2],
        coefficients: &mut Right,
    ) {
        let rank = unknowns - nuisance;
        let columns = coefficients.data.0.iter_mut();
        for column in columns.take(self.equations.count()) {
            self.backward(first..unknowns, column);
            let column = &mut cells(&mut column[..]);
            let last = |i| if i < rank { column[nuisance + i] } else { 0.0 };
            let rigid: [f64; 6] = core::array::from_fn(last);
            for i in (0..nuisance).rev() {
                column[rank + i] = column[i];
            }
            for (i, x) in rigid.iter().enumerate().take(rank) {
                column[i] = *x;
            }
        }
    }

    /// Takes `left`, the residual power of all six resultants from elsewhere, for the
    /// solution's own.
    pub(super) fn replace_residual(&self, solution: &mut Solution, left: &Matrix6<f64>) {
        let e = self.equations.rows();
        let freedom = (self.sums.count - self.excitation.rank() as f64).max(1.0);
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
        let largest = self.sums.power.diagonal().max();
        let (powers, diagonal) = (seen(&self.sums.power), &mut cells(c));
        for j in 0..self.equations.count() {
            // A resultant that is zero throughout, exactly, is no better known than that.
            let power = powers[(j, j)].max(NOTHING * largest);
            let floor = AMPLITUDE * AMPLITUDE * power / self.sums.count;
            diagonal[(j, j)] =
                not_negative(diagonal[(j, j)]) * 1.001 + floor.max(f64::MIN_POSITIVE);
        }
        // Where the spectra fit to their last digit, the residual is the difference of
        // large numbers and its correlations mean nothing.
        if lower(&mut { *c }, self.equations.count()).is_none() {
            keep_diagonal(c);
        }
    }

    /// The part of a solution of [`Self::solve_first_term_and_residual`] with which [`Self::risk`] compares others.
    pub(super) fn first_term(solution: &Solution) -> FirstTerm {
        FirstTerm {
            terms: solution.terms.clone(),
            coefficients: solution.coefficients.fixed_rows::<6>(0).into(),
            variances: solution.variances,
            residual: solution.residual.diagonal(),
        }
    }

    /// Expected squared error of the first term's coefficients, summed relative to their
    /// variances in `full`, a solution with more terms. Notes the share of bias in
    /// `solution`, whose pairs then carry it in their variances.
    ///
    /// Few lines hide the bias, so it is taken to be no less than that of the `known` terms. Where these go in the
    /// coefficients is not known: each coefficient is given the same bias relative to its standard deviation, which is
    /// the mean one over the excited directions.
    pub(super) fn risk(
        &self,
        solution: &mut Solution,
        full: &FirstTerm,
        known: &KnownTerms,
    ) -> f64 {
        let rank = self.excitation.rank();
        let (p, p_full) = (seen(&solution.variances[..]), seen(&full.variances[..]));
        let inverse_residual = full.residual.map(|c| 1.0 / c);
        let (weights, first) = (seen(&inverse_residual), seen(&full.coefficients));
        let coefficients = seen(&solution.coefficients);
        let rows = self.equations.count();
        let (mut variance, mut distance, mut size) = (0.0, 0.0, 0.0);
        for i in 0..rank {
            let share = p[i] / p_full[i];
            // Between nested fits the variance of a difference is the difference of
            // the variances.
            let saved = 1.0 - share;
            let (mut squares, mut own) = (0.0, 0.0);
            for j in 0..rows {
                let coefficient = coefficients[(i, j)];
                let difference = coefficient - first[(i, j)];
                squares += difference * difference * weights[j];
                own += coefficient * coefficient * weights[j];
            }
            variance += share * rows as f64;
            distance += squares / (p_full[i] * self.correlation) - saved * rows as f64;
            size += own / (p[i] * self.correlation);
        }
        let told = not_negative(distance) / variance;
        let known = known.relative_bias(&solution.terms);
        solution.inflation = 1.0 + told.max(known * known * size / rank as f64);
        variance * solution.inflation
    }

    /// Terms of which the share in the first one is known.
    pub(super) fn known_terms(&self, shares: &[f64; MAX_TERMS]) -> KnownTerms {
        let (rank, normal) = (self.excitation.rank(), seen(&self.sums.normal));
        let mut products = Triangle::ZERO;
        let entries = &mut cells(&mut products);
        for t in 0..self.sums.terms() {
            for u in 0..=t {
                let diagonal = (0..rank).map(|i| normal[(6 * t + i, 6 * u + i)]);
                entries[(t, u)] = diagonal.sum();
            }
        }
        KnownTerms {
            shares: *shares,
            products,
        }
    }

    /// `true` if a coefficient of the first term lies further from that of `larger`, a solution with more terms,
    /// than chance explains: then those that `solution` leaves out are there. [`Self::risk`] has been asked of it.
    pub(super) fn is_contradicted(&self, solution: &Solution, larger: &FirstTerm) -> bool {
        let (own, other) = (seen(&solution.coefficients), seen(&larger.coefficients));
        let (p, p_other) = (seen(&solution.variances[..]), seen(&larger.variances[..]));
        let residual = seen(&larger.residual);
        (0..self.excitation.rank()).any(|i| {
            let variance = (p_other[i] - p[i]).max(ROUNDING * p[i]) * self.correlation * CHANCE;
            (0..self.equations.count()).any(|j| {
                let difference = own[(i, j)] - other[(i, j)];
                difference * difference > variance * residual[j]
            })
        })
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
        let (normal, entries) = (seen(&self.sums.normal), &mut cells(&mut power));
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
        ((self.sums.count - unknowns as f64) / self.correlation).max(1.0)
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

    /// Adds the pairs to `set`, whitened by the residual, with what the base moves along directions that are not excited, see
    /// [`Self::motions`], of which it returns the variance.
    pub(super) fn masslines<const PAIRS: usize>(
        &mut self,
        solution: &Solution,
        noise: &Matrix6<f64>,
        share: f64,
        set: &mut Masslines<PAIRS>,
    ) -> Result<f64, MasslineError> {
        let rank = self.excitation.rank();
        let rows = self.equations.count();
        set.equations = self.whitened(solution).ok_or(MasslineError::Singular)?;
        let (motions, turned) = self
            .motions(solution, noise, share)
            .ok_or(MasslineError::Singular)?;
        let mut u = solution.schur;
        lower(&mut u, rank).ok_or(MasslineError::Singular)?;
        let (u, coefficients) = (seen(&u), seen(&solution.coefficients));
        for p in 0..rank {
            // Row p of U, with S = U Uᵀ here: column p of the lower factor.
            let c = Vector6::from_fn(|i, _| if i < rank { u[(i, p)] } else { 0.0 });
            let acceleration = motions * c;
            let measured = Vector6::from_fn(|j, _| {
                (0..rank).map(|i| coefficients[(i, j)] * seen(&c)[i]).sum()
            });
            let force = self.equations.rows().transpose() * measured;
            let mut variance = Vector6::zeros();
            let all = self.correlation * solution.inflation;
            variance.iter_mut().take(rows).for_each(|v| *v = all);
            set.push(acceleration, force, variance)?;
        }
        Ok(turned)
    }

    /// Residual power of each resultant, summed over all real equations.
    pub(super) fn residual_diagonal(&self, solution: &Solution) -> Vector6<f64> {
        let e = self.equations.rows();
        (e.transpose() * solution.residual * e).diagonal() * self.sums.count
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
        inflation: 0.0,
        variances: [0.0; 6],
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

/// Square of a difference over its variance that is no chance: four standard deviations. At three, one in eleven
/// comparisons of 36 coefficients is chance, and the fit keeps terms that it could do without.
const CHANCE: f64 = 16.0;
/// Least difference of two variances, as a share of one of them, that is not the rounding of either.
const ROUNDING: f64 = 1e-9;

impl FirstTerm {
    /// `true` if a solution has no terms but these.
    pub(super) fn holds(&self, solution: &Solution) -> bool {
        solution.terms.iter().all(|t| self.terms.contains(t))
    }

    /// Takes the place of that of another solution, of which [`Regression::risk`] has been asked; the residual stays.
    pub(super) fn become_that_of(&mut self, solution: &Solution) {
        self.terms.clone_from(&solution.terms);
        self.coefficients = solution.coefficients.fixed_rows::<6>(0).into();
        self.variances = solution.variances;
    }
}

impl KnownTerms {
    /// Mean bias of the first term, relative to it, in a fit of the `chosen` terms: these take up some of the others.
    fn relative_bias(&self, chosen: &[usize]) -> f64 {
        let (products, shares) = (seen(&self.products), seen(&self.shares[..]));
        let product = |t: usize, u: usize| products[(t.max(u), t.min(u))];
        let left_out: heapless::Vec<usize, MAX_TERMS> = (0..MAX_TERMS)
            .filter(|u| !chosen.contains(u) && shares[*u] != 0.0)
            .collect();
        if left_out.is_empty() {
            return 0.0;
        }
        let mut normal = Triangle::<{ triangle_len(MAX_TERMS) }>::ZERO;
        let mut solution = [0.0; MAX_TERMS];
        let (entries, right) = (&mut cells(&mut normal), &mut cells(&mut solution[..]));
        for (i, t) in chosen.iter().enumerate() {
            for (j, u) in chosen.iter().enumerate().take(i + 1) {
                entries[(i, j)] = product(*t, *u);
            }
            let biasing = left_out.iter();
            right[i] = biasing.map(|u| shares[*u] * product(*t, *u)).sum();
        }
        let solved = solve_positive(&mut normal, &mut solution, chosen.len());
        solved.map_or(0.0, |()| solution[0])
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
mod tests;

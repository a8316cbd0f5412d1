//! Linear regression of forces on accelerations with nuisance terms, condensed to pairs.
//!
//! The model of a line is `f = (M + Σ_t E_t φ_t) a`, with the wanted real matrix M and
//! unwanted ones E_t that multiply known functions φ_t of frequency. All rows of f share
//! one normal matrix. Eliminating the E_t from it leaves a small matrix S for M alone,
//! and `S = UᵀU` turns it into pairs: the rows of U are pseudo accelerations and `M̂ U`
//! the forces that go with them. Nothing is lost: least squares on these pairs with any
//! structure imposed on M is least squares on all lines with that structure imposed.

use super::{Excitation, MasslineError, Masslines, Moments};
use crate::algebra::{inverse_lower, lower};
use crate::geometry::Equations;
use core::ops::{AddAssign, Index, IndexMut, Mul};
use nalgebra::{ArrayStorage, Complex, Matrix6, SMatrix, SVector, Scalar, Vector6};

/// Most terms: the rigid one, one for all modes above, and [`crate::modes::MAX_MODES`].
pub(super) const MAX_TERMS: usize = 2 + crate::modes::MAX_MODES;
const SIZE: usize = 6 * MAX_TERMS;

type Right = SMatrix<f64, SIZE, 6>;

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));
const NO_RIGHT: Right = Right::from_array_storage(ArrayStorage([[0.0; SIZE]; 6]));

/// A lower triangle: half the memory of a square, and it is on a small stack.
#[derive(Clone, Debug)]
struct Triangle([f64; SIZE * (SIZE + 1) / 2]);

impl Triangle {
    const ZERO: Self = Self([0.0; SIZE * (SIZE + 1) / 2]);
}

/// Row and column, the column not past the row.
impl Index<(usize, usize)> for Triangle {
    type Output = f64;

    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.0[i * (i + 1) / 2 + j]
    }
}

impl IndexMut<(usize, usize)> for Triangle {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.0[i * (i + 1) / 2 + j]
    }
}

/// Normal equations of the regression, in coordinates of the excited directions and of
/// the measured equations.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    excitation: Excitation,
    equations: Equations,
    terms: usize,
    normal: Triangle,
    right: Right,
    power: Matrix6<f64>,
    /// Real equations per row of f.
    count: f64,
    correlation: f64,
    /// Whether the residuals of different resultants are taken as independent.
    independent: bool,
}

/// The solution with a chosen set of terms.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    terms: heapless::Vec<usize, MAX_TERMS>,
    /// Coefficients of the chosen terms, in their order: `rank` rows each.
    coefficients: Right,
    /// What is left for the first term when the others are eliminated.
    schur: Matrix6<f64>,
    /// Covariance of one real equation, in measured-equation coordinates.
    residual: Matrix6<f64>,
    /// Expected squared error over variance: above one where left-out terms may bias.
    inflation: f64,
}

impl Regression {
    /// A place for one, all zero.
    pub(super) const EMPTY: Self = Self {
        excitation: Excitation::ZERO,
        equations: Equations::NONE,
        terms: 0,
        normal: Triangle::ZERO,
        right: NO_RIGHT,
        power: NO_MATRIX,
        count: 0.0,
        correlation: 0.0,
        independent: false,
    };

    /// Begins a regression with so many terms. `correlation` is the variance of a mean
    /// over lines relative to independent ones.
    pub(super) fn begin(&mut self, equations: &Equations, terms: usize, correlation: f64) {
        self.restart(Excitation::NONE);
        self.equations = *equations;
        self.terms = terms.clamp(1, MAX_TERMS);
        self.correlation = correlation;
        self.independent = false;
    }

    /// Starts again with another excitation.
    pub(super) fn restart(&mut self, excitation: Excitation) {
        self.excitation = excitation;
        self.normal.0.fill(0.0);
        self.right.fill(0.0);
        self.power.fill(0.0);
        self.count = 0.0;
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
    /// `equations` real equations.
    pub(super) fn add(&mut self, moments: &Moments, phi: &[Complex<f64>], equations: f64) {
        let rank = self.excitation.rank();
        let p = self.excitation.coordinates();
        let e = self.equations.rows();
        let aa = between(p, &moments.aa, p);
        let fa = between(e, &moments.fa, p);
        for (t, phi_t) in phi.iter().enumerate().take(self.terms) {
            for (u, phi_u) in phi.iter().enumerate().take(t + 1) {
                // Re conj(φ_t a_i) φ_u a_j
                let factor = phi_t.conj() * phi_u;
                for i in 0..rank {
                    let columns = if t == u { i + 1 } else { rank };
                    for j in 0..columns {
                        self.normal[(6 * t + i, 6 * u + j)] += real_product(&factor, &aa[(j, i)]);
                    }
                }
            }
            let factor = phi_t.conj();
            for i in 0..rank {
                for j in 0..self.equations.count() {
                    self.right[(6 * t + i, j)] += real_product(&factor, &fa[(j, i)]);
                }
            }
        }
        self.power += between(e, &moments.ff.map(|z| z.re), e);
        self.count += equations;
    }

    /// Solves with the given terms, the first of which is the rigid one. `None` if the
    /// chosen terms cannot be told apart or too few equations are left.
    #[inline(never)] // Its triangle is off the stack when the caller goes on.
    pub(super) fn solve(&self, chosen: &[usize], into: &mut Solution) -> Option<()> {
        let rank = self.excitation.rank();
        let rows = self.equations.count();
        let unknowns = rank * chosen.len();
        let freedom = self.count - unknowns as f64;
        if unknowns == 0 || rows == 0 || freedom < 1.0 {
            return None;
        }
        let at = |n: usize| 6 * chosen[n / rank] + n % rank;
        let gathered = |i: usize, j: usize| {
            let (i, j) = (at(i), at(j));
            if i >= j {
                self.normal[(i, j)]
            } else {
                self.normal[(j, i)]
            }
        };
        // Column equilibration, then an LDLᵀ without pivoting that starts with the
        // nuisance terms: what it leaves of the rigid block is the Schur complement.
        let order = |n: usize| (n + rank) % unknowns;
        let mut scale = SVector::<f64, SIZE>::zeros();
        for n in 0..unknowns {
            let d = gathered(order(n), order(n));
            if !(d > 0.0 && d.is_finite()) {
                return None;
            }
            scale[n] = 1.0 / libm::sqrt(d);
        }
        let mut l = Triangle::ZERO;
        let nuisance = unknowns - rank;
        let Solution {
            coefficients,
            schur,
            residual,
            ..
        } = into;
        schur.fill(0.0);
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
        for c in 0..rows {
            for i in 0..unknowns {
                let mut sum = self.right[(at(order(i)), c)] * scale[i];
                for k in 0..i {
                    sum -= l[(i, k)] * coefficients[(k, c)];
                }
                coefficients[(i, c)] = sum / l[(i, i)];
            }
        }
        *residual = self.power;
        for c in 0..rows {
            for d in 0..rows {
                let mut explained = 0.0;
                for i in 0..unknowns {
                    explained += coefficients[(i, c)] * coefficients[(i, d)];
                }
                residual[(c, d)] -= explained;
            }
        }
        *residual /= freedom;
        self.floor(residual);
        for c in 0..rows {
            for i in (0..unknowns).rev() {
                let mut sum = coefficients[(i, c)];
                for k in i + 1..unknowns {
                    sum -= l[(k, i)] * coefficients[(k, c)];
                }
                coefficients[(i, c)] = sum / l[(i, i)];
            }
            let ordered: SVector<f64, SIZE> = coefficients.column(c).into();
            for i in 0..unknowns {
                coefficients[(order(i), c)] = ordered[i] * scale[i];
            }
        }
        into.terms = heapless::Vec::from_slice(chosen).ok()?;
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
        *c = (*c + c.transpose()) * 0.5;
        if self.independent {
            *c = Matrix6::from_diagonal(&c.diagonal());
        }
        let largest = self.power.diagonal().max();
        for j in 0..self.equations.count() {
            // A resultant that is zero throughout, exactly, is no better known than that.
            let power = self.power[(j, j)].max(NOTHING * largest);
            let floor = AMPLITUDE * AMPLITUDE * power / self.count;
            c[(j, j)] = c[(j, j)].max(0.0) * 1.001 + floor.max(f64::MIN_POSITIVE);
        }
        // Where the spectra fit to their last digit, the residual is the difference of
        // large numbers and its correlations mean nothing.
        if lower(c, self.equations.count()).is_none() {
            *c = Matrix6::from_diagonal(&c.diagonal());
        }
    }

    /// Expected squared error of the first term's coefficients, summed relative to their
    /// variances in `full`, a solution with more terms. Notes the share of bias in
    /// `solution`, whose pairs then carry it in their variances.
    pub(super) fn risk(&self, solution: &mut Solution, full: &Solution) -> f64 {
        let rank = self.excitation.rank();
        let (Some(p), Some(p_full)) = (
            variances(&solution.schur, rank),
            variances(&full.schur, rank),
        ) else {
            return f64::INFINITY;
        };
        let (mut variance, mut distance) = (0.0, 0.0);
        for i in 0..rank {
            for j in 0..self.equations.count() {
                let unit = p_full[i] * full.residual[(j, j)] * self.correlation;
                let difference = solution.coefficients[(i, j)] - full.coefficients[(i, j)];
                variance += p[i] / p_full[i];
                // Between nested fits the variance of a difference is the difference of
                // the variances.
                distance += difference * difference / unit - (1.0 - p[i] / p_full[i]);
            }
        }
        let bias = distance.max(0.0);
        solution.inflation = 1.0 + bias / variance;
        variance + bias
    }

    /// The equations in combinations whose residuals are independent and of variance one.
    pub(super) fn whitened(&self, solution: &Solution) -> Option<Equations> {
        let rows = self.equations.count();
        let factor = lower(&solution.residual, rows)?;
        Some(self.equations.whitened(&inverse_lower(&factor, rows)))
    }

    /// What second moments of acceleration, real part, contribute to each pair: its share
    /// of the pair's power, apart from what the other terms take.
    pub(super) fn powers(&self, solution: &Solution, moments: &Matrix6<f64>) -> [f64; 6] {
        let rank = self.excitation.rank();
        let Some(u) = lower(&solution.schur, rank) else {
            return [0.0; 6];
        };
        let to_pairs = inverse_lower(&u, rank) * self.excitation.coordinates();
        let inner = to_pairs * moments * to_pairs.transpose();
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
        let u = lower(&solution.schur, rank).ok_or(MasslineError::Singular)?;
        for p in 0..rank {
            // Row p of U, with S = U Uᵀ here: column p of the lower factor.
            let c = Vector6::from_fn(|i, _| if i < rank { u[(i, p)] } else { 0.0 });
            let acceleration = self.excitation.basis() * c;
            let measured = Vector6::from_fn(|j, _| {
                (0..rank)
                    .map(|i| solution.coefficients[(i, j)] * c[i])
                    .sum()
            });
            let force = self.equations.rows().transpose() * measured;
            let mut variance = Vector6::zeros();
            for j in 0..rows {
                variance[j] = self.correlation * solution.inflation;
            }
            set.push(acceleration, force, variance)?;
        }
        Ok(())
    }

    /// Residual power of each resultant, summed over all real equations.
    pub(super) fn residual_diagonal(&self, solution: &Solution) -> Vector6<f64> {
        let e = self.equations.rows();
        (e.transpose() * solution.residual * e).diagonal() * self.count
    }

    /// Coefficient matrix of one chosen term as a 6 x 6 matrix in the units of `f / a`,
    /// zero where nothing was excited or measured.
    pub(super) fn coefficient(&self, solution: &Solution, term: usize) -> Option<Matrix6<f64>> {
        let rank = self.excitation.rank();
        let n = solution.terms.iter().position(|&t| t == term)?;
        let inner = Matrix6::from_fn(|j, i| {
            if i < rank {
                solution.coefficients[(n * rank + i, j)]
            } else {
                0.0
            }
        });
        Some(self.equations.rows().transpose() * inner * self.excitation.coordinates())
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
    };
}

/// Real part of a product whose first factor often is real: what is zero costs nothing then.
fn real_product(x: &Complex<f64>, y: &Complex<f64>) -> f64 {
    if x.im == 0.0 && x.re == 1.0 {
        y.re
    } else if x.im == 0.0 {
        x.re * y.re
    } else {
        x.re * y.re - x.im * y.im
    }
}

/// `left m rightᵀ`, for factors most of which are zeros and ones.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
pub(super) fn between<T>(left: &Matrix6<f64>, m: &Matrix6<T>, right: &Matrix6<f64>) -> Matrix6<T>
where
    T: Scalar + Copy + Default + AddAssign + Mul<f64, Output = T>,
{
    let identity = Matrix6::identity();
    if *left == identity && *right == identity {
        return *m;
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
    let mut product = Matrix6::from_element(T::default());
    for k in 0..6 {
        for i in 0..6 {
            let l = left[(i, k)];
            if l == 1.0 {
                for j in 0..6 {
                    product[(i, j)] += half[(k, j)];
                }
            } else if l != 0.0 {
                for j in 0..6 {
                    product[(i, j)] += half[(k, j)] * l;
                }
            }
        }
    }
    product
}

/// Diagonal of the inverse of the leading `n` x `n` part.
fn variances(matrix: &Matrix6<f64>, n: usize) -> Option<[f64; 6]> {
    let inverse = inverse_lower(&lower(matrix, n)?, n);
    Some(core::array::from_fn(|i| {
        (0..n).map(|k| inverse[(k, i)] * inverse[(k, i)]).sum()
    }))
}

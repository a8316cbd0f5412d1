//! Stacking (9), the normal equations (10), and what they can and cannot tell.

use super::{IdentifyError, MasslineSet, Measurement, measurement_matrix};
use crate::algebra::{lower, multiply_left, multiply_right, not_negative, symmetric_eigen};
use crate::cells::{cells, seen};
use crate::geometry::{resultants_at, transfer};
use nalgebra::{ArrayStorage, Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Eigenvalue of the equilibrated normal equations below which a direction is rounding.
///
/// Their diagonal is one, so rounding is 1e-15. The smallest honest eigenvalue falls
/// with the fourth power of the distance of A from the body in radii of gyration: 1e-12
/// allows a thousand.
const RANK: f64 = 1e-12;

/// Share of a parameter in the undetermined directions above which it is one of them.
const SHARE: f64 = 1e-8;

/// Degrees of freedom of the estimate of noise: the variances of masslines count as known.
const NOISE_FREEDOM: f64 = f64::INFINITY;

type Matrix10 = SMatrix<f64, 10, 10>;
type Vector10 = SVector<f64, 10>;

const NO_MATRIX: Matrix10 = Matrix10::from_array_storage(ArrayStorage([[0.0; 10]; 10]));
const NO_VECTOR: Vector10 = Vector10::from_array_storage(ArrayStorage([[0.0; 10]]));

/// The solution about one point.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// Where it was solved, m.
    pub(super) point: Vector3<f64>,
    /// σ of equation (6), or of (7) if the mass is known.
    pub(super) sigma: Vector10,
    pub(super) covariance: Matrix10,
    pub(super) observable: [bool; 10],
    pub(super) condition_number: f64,
    pub(super) consistency: Option<f64>,
    pub(super) attenuation: f64,
    /// Share of the forces that a rigid body leaves, as amplitude.
    pub(super) misfit: f64,
    /// Degrees of freedom of the estimate of noise behind `covariance`.
    pub(super) freedom: f64,
    pub(super) known_mass: Option<f64>,
}

impl Solved {
    /// Nothing solved yet.
    pub(super) const NONE: Self = Self {
        point: Vector3::new(0.0, 0.0, 0.0),
        sigma: NO_VECTOR,
        covariance: NO_MATRIX,
        observable: [false; 10],
        condition_number: 0.0,
        consistency: None,
        attenuation: 0.0,
        misfit: 0.0,
        freedom: f64::INFINITY,
        known_mass: None,
    };

    /// From the point to the identified S, along the axes on which S is known.
    pub(super) fn step(&self) -> Vector3<f64> {
        let mass = match self.known_mass {
            Some(_) => 1.0,
            None => self.sigma[0],
        };
        if self.known_mass.is_none() && !self.observable[0] {
            return Vector3::zeros();
        }
        Vector3::from_fn(|i, _| {
            if self.observable[1 + i] {
                self.sigma[1 + i] / mass
            } else {
                0.0
            }
        })
    }
}

const ONES: Vector6<f64> = Vector6::new(1.0, 1.0, 1.0, 1.0, 1.0, 1.0);

/// Adds `Bᵀ diag(weights) B`.
fn add_square(sum: &mut Matrix10, b: &Measurement, weights: &Vector6<f64>) {
    for i in 0..10 {
        for j in 0..=i {
            let mut entry = 0.0;
            for k in 0..6 {
                entry += b[(k, i)] * weights[k] * b[(k, j)];
            }
            sum[(i, j)] += entry;
            if i != j {
                sum[(j, i)] += entry;
            }
        }
    }
}

/// The measurement matrix of an acceleration in the equations `e`.
#[inline(never)] // One matrix on the caller's stack.
fn measured(e: &Matrix6<f64>, acceleration: &Vector6<f64>, mass: f64) -> Measurement {
    let mut b = measurement_matrix(acceleration, mass);
    for mut column in b.column_iter_mut() {
        let product = e * &column;
        column.copy_from(&product);
    }
    b
}

/// What an identification works in: too large for the stack of a small chip, so it is lent.
#[derive(Clone, Debug)]
pub struct Workspace {
    normal: Normal,
    inverse: Matrix10,
    pub(super) solved: Solved,
}

impl Workspace {
    /// All zero, which takes no flash, and as good as any other state.
    pub const EMPTY: Self = Self {
        normal: Normal::EMPTY,
        inverse: NO_MATRIX,
        solved: Solved::NONE,
    };
}

/// Normal equations of all sets about one point.
#[derive(Clone, Debug)]
struct Normal {
    matrix: Matrix10,
    right: Vector10,
    /// `Σ Bᵀ var B`, for the covariance.
    meat: Matrix10,
    /// The part of `matrix` that noise in the accelerations makes.
    noise: Matrix10,
    forces: f64,
    rows: f64,
    /// Sum of all variances.
    variance: f64,
}

impl Normal {
    const EMPTY: Self = Self {
        matrix: NO_MATRIX,
        right: NO_VECTOR,
        meat: NO_MATRIX,
        noise: NO_MATRIX,
        forces: 0.0,
        rows: 0.0,
        variance: 0.0,
    };

    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    fn stack<S: MasslineSet>(&mut self, sets: &[S], point: &Vector3<f64>, mass: f64) {
        *self = Self::EMPTY;
        for set in sets {
            let shift = point - set.reference();
            let t = transfer(&shift);
            let equations = set.equations().at(&shift);
            let e = equations.rows();
            for pair in set.pairs() {
                let b = measured(e, &(t * pair.acceleration), mass);
                let f = e * resultants_at(&shift, &pair.force);
                add_square(&mut self.matrix, &b, &ONES);
                add_square(&mut self.meat, &b, &pair.variance);
                self.right += b.tr_mul(&f);
                self.forces += f.norm_squared();
                self.rows += equations.count() as f64;
                self.variance += pair.variance.sum();
            }
            for j in 0..6 {
                let b = measured(e, &(t * set.noise().column(j)), mass);
                add_square(&mut self.noise, &b, &ONES);
            }
        }
    }
}

/// `m v`: the operator between values would copy the matrix.
fn times(m: &Matrix10, v: &Vector10) -> Vector10 {
    m * v
}

/// Multiplies rows and columns with `d`.
fn scale(m: &mut Matrix10, d: &Vector10) {
    for i in 0..10 {
        for j in 0..10 {
            m[(i, j)] = m[(i, j)] * d[i] * d[j];
        }
    }
}

/// Solves for the body behind the sets about one point, and leaves the solution in `space`.
pub(super) fn solve<S: MasslineSet>(
    sets: &[S],
    point: &Vector3<f64>,
    known_mass: Option<f64>,
    space: &mut Workspace,
) -> Result<(), IdentifyError> {
    let Workspace {
        normal: n,
        inverse,
        solved: into,
    } = space;
    n.stack(sets, point, known_mass.unwrap_or(1.0));
    let finite = n.matrix.iter().chain(n.right.iter()).all(|x| x.is_finite());
    if !finite {
        return Err(IdentifyError::NotFinite);
    }
    // Column equilibration: metres or millimetres, the diagonal becomes one.
    let d = n.matrix.diagonal().map(|x| {
        if x > f64::MIN_POSITIVE {
            1.0 / libm::sqrt(x)
        } else {
            0.0
        }
    });
    scale(&mut n.matrix, &d);
    scale(&mut n.meat, &d);
    scale(&mut n.noise, &d);
    n.right.component_mul_assign(&d);

    let observable = observability(&n.matrix);
    if !observable.contains(&true) {
        return Err(IdentifyError::NothingObservable);
    }
    let kept = independent(&n.matrix, &observable);
    invert(&n.matrix, &kept, inverse).ok_or(IdentifyError::NothingObservable)?;

    let sigma = times(inverse, &n.right);
    let covariance = &mut n.meat;
    multiply_left(inverse, covariance);
    multiply_right(covariance, inverse);
    let unknowns = kept.iter().filter(|&&k| k).count() as f64;
    let freedom = n.rows - unknowns;
    let left = not_negative(n.forces - sigma.dot(&n.right));
    let mut consistency = None;
    if freedom > 0.0 {
        if n.variance > 0.0 {
            // Birge's ratio: what a rigid body leaves over, against what noise would.
            let ratio = left / (n.variance * freedom / n.rows);
            // What is no number widens them, too, and is refused with them.
            *covariance *= if ratio <= 1.0 { 1.0 } else { ratio };
            consistency = Some(ratio);
        } else {
            for (c, i) in covariance.iter_mut().zip(&*inverse) {
                *c = i * (left / freedom);
            }
        }
    }
    // The pull of the noise is a bias: its square joins the variance.
    let pull = times(inverse, &times(&n.noise, &sigma));
    covariance.ger(1.0, &pull, &pull, 1.0);
    let mut attenuation = 0.0_f64;
    for j in (0..10).filter(|&j| observable[j]) {
        if covariance[(j, j)] > 0.0 {
            attenuation = attenuation.max(pull[j] * pull[j] / covariance[(j, j)]);
        }
    }
    scale(covariance, &d);
    into.point = *point;
    into.sigma = sigma.component_mul(&d);
    into.covariance.copy_from(covariance);
    into.observable = observable;
    into.condition_number = condition(&n.matrix, &observable);
    into.consistency = consistency;
    into.attenuation = attenuation;
    into.misfit = if n.forces > 0.0 {
        libm::sqrt(left / n.forces)
    } else {
        0.0
    };
    into.freedom = NOISE_FREEDOM;
    into.known_mass = known_mass;
    Ok(())
}

/// The one rule: a parameter is observable if no undetermined direction involves it.
#[inline(never)]
fn observability(matrix: &Matrix10) -> [bool; 10] {
    let (mut rest, mut vectors) = (*matrix, Matrix10::zeros());
    let values = symmetric_eigen(&mut rest, &mut vectors);
    let mut undetermined = [0.0; 10];
    for (i, &value) in values.iter().enumerate() {
        if value <= RANK {
            for (j, share) in undetermined.iter_mut().enumerate() {
                let entry = seen(&vectors)[(j, i)];
                *share += entry * entry;
            }
        }
    }
    undetermined.map(|share| share < SHARE)
}

/// A largest set of columns that determine each other: all observable ones, and of the
/// others as many as are independent. They contribute to the forces and must not be
/// struck, though none of them has a value of its own.
#[inline(never)]
fn independent(matrix: &Matrix10, observable: &[bool; 10]) -> [bool; 10] {
    let numbers = |wanted: bool| {
        let all = observable.iter().enumerate();
        all.filter_map(move |(j, is)| (*is == wanted).then_some(j))
    };
    let mut order: heapless::Vec<usize, 10> = numbers(true).collect();
    order.extend(numbers(false));
    let mut l = Matrix10::zeros();
    let mut kept = [false; 10];
    let (matrix, l, is_kept) = (seen(matrix), &mut cells(&mut l), &mut cells(&mut kept[..]));
    for (a, &j) in order.iter().enumerate() {
        let (before, from) = order.split_at_checked(a).unwrap_or((&[], &[]));
        let mut pivot = matrix[(j, j)];
        for &k in before {
            pivot -= l[(j, k)] * l[(j, k)];
        }
        if pivot <= RANK {
            continue;
        }
        is_kept[j] = true;
        let root = libm::sqrt(pivot);
        for &i in from {
            let mut sum = matrix[(i, j)];
            for &k in before {
                sum -= l[(i, k)] * l[(j, k)];
            }
            l[(i, j)] = sum / root;
        }
    }
    kept
}

/// The rows and columns that are kept, with ones on the rest of the diagonal.
#[inline(never)] // One matrix on the caller's stack.
fn reduced(matrix: &Matrix10, kept: &[bool; 10]) -> Matrix10 {
    Matrix10::from_fn(|i, j| {
        if kept[i] && kept[j] {
            matrix[(i, j)]
        } else if i == j {
            1.0
        } else {
            0.0
        }
    })
}

/// Leaves the inverse on the kept rows and columns in `inverse`, by Cholesky; zero elsewhere.
#[inline(never)]
fn invert(matrix: &Matrix10, kept: &[bool; 10], inverse: &mut Matrix10) -> Option<()> {
    let mut l = reduced(matrix, kept);
    lower(&mut l, 10)?;
    inverse.fill_with_identity();
    l.solve_lower_triangular_unchecked_mut(inverse);
    l.ad_solve_lower_triangular_unchecked_mut(inverse);
    for i in 0..10 {
        if !kept[i] {
            inverse[(i, i)] = 0.0;
        }
    }
    Some(())
}

#[inline(never)]
fn condition(matrix: &Matrix10, observable: &[bool; 10]) -> f64 {
    let (mut rest, mut vectors) = (reduced(matrix, observable), Matrix10::zeros());
    let values = symmetric_eigen(&mut rest, &mut vectors);
    values[0] / values[9]
}

//! Stacking (9), the normal equations (10), and what they can and cannot tell.

use super::{IdentifyError, MasslineSet, measurement_matrix};
use crate::algebra::symmetric_eigen;
use crate::geometry::{resultants_at, transfer};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// Eigenvalue of the equilibrated normal equations below which a direction is rounding.
///
/// Their diagonal is one, so rounding is 1e-15. The smallest honest eigenvalue falls
/// with the fourth power of the distance of A from the body in radii of gyration: 1e-12
/// allows a thousand.
const RANK: f64 = 1e-12;

/// Share of a parameter in the undetermined directions above which it is one of them.
const SHARE: f64 = 1e-8;

type Matrix10 = SMatrix<f64, 10, 10>;
type Vector10 = SVector<f64, 10>;

/// The solution about one point.
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
    known_mass: Option<f64>,
}

impl Solved {
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
fn add_square(sum: &mut Matrix10, b: &SMatrix<f64, 6, 10>, weights: &Vector6<f64>) {
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

/// Normal equations of all sets about one point.
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
    #[inline(never)]
    fn stack<S: MasslineSet>(sets: &[S], point: &Vector3<f64>, mass: f64) -> Self {
        let mut n = Self {
            matrix: Matrix10::zeros(),
            right: Vector10::zeros(),
            meat: Matrix10::zeros(),
            noise: Matrix10::zeros(),
            forces: 0.0,
            rows: 0.0,
            variance: 0.0,
        };
        for set in sets {
            let shift = point - set.reference();
            let t = transfer(&shift);
            let equations = set.equations().at(&shift);
            let e = equations.rows();
            for pair in set.pairs() {
                let b = e * measurement_matrix(&(t * pair.acceleration), mass);
                let f = e * resultants_at(&shift, &pair.force);
                add_square(&mut n.matrix, &b, &ONES);
                add_square(&mut n.meat, &b, &pair.variance);
                n.right += b.tr_mul(&f);
                n.forces += f.norm_squared();
                n.rows += equations.count() as f64;
                n.variance += pair.variance.sum();
            }
            for j in 0..6 {
                let column = t * set.noise().column(j);
                let b = e * measurement_matrix(&column, mass);
                add_square(&mut n.noise, &b, &ONES);
            }
        }
        n
    }

    /// Multiplies rows and columns with `d`.
    fn scaled(m: &Matrix10, d: &Vector10) -> Matrix10 {
        Matrix10::from_fn(|i, j| m[(i, j)] * d[i] * d[j])
    }
}

pub(super) fn solve<S: MasslineSet>(
    sets: &[S],
    point: &Vector3<f64>,
    known_mass: Option<f64>,
) -> Result<Solved, IdentifyError> {
    let mut n = Normal::stack(sets, point, known_mass.unwrap_or(1.0));
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
    n.matrix = Normal::scaled(&n.matrix, &d);
    n.meat = Normal::scaled(&n.meat, &d);
    n.noise = Normal::scaled(&n.noise, &d);
    n.right = n.right.component_mul(&d);

    let observable = observability(&n.matrix);
    if !observable.contains(&true) {
        return Err(IdentifyError::NothingObservable);
    }
    let kept = independent(&n.matrix, &observable);
    let inverse = inverse_of(&n.matrix, &kept).ok_or(IdentifyError::NothingObservable)?;

    let sigma = inverse * n.right;
    let mut covariance = inverse * n.meat * inverse;
    let unknowns = kept.iter().filter(|&&k| k).count() as f64;
    let freedom = n.rows - unknowns;
    let left = (n.forces - sigma.dot(&n.right)).max(0.0);
    let mut consistency = None;
    if freedom > 0.0 {
        if n.variance > 0.0 {
            // Birge's ratio: what a rigid body leaves over, against what noise would.
            let ratio = left / (n.variance * freedom / n.rows);
            covariance *= ratio.max(1.0);
            consistency = Some(ratio);
        } else {
            covariance = inverse * (left / freedom);
        }
    }
    // The pull of the noise is a bias: its square joins the variance.
    let pull = inverse * (n.noise * sigma);
    covariance += pull * pull.transpose();
    let mut attenuation = 0.0_f64;
    for j in (0..10).filter(|&j| observable[j]) {
        if covariance[(j, j)] > 0.0 {
            attenuation = attenuation.max(pull[j] * pull[j] / covariance[(j, j)]);
        }
    }
    Ok(Solved {
        point: *point,
        sigma: sigma.component_mul(&d),
        covariance: Normal::scaled(&covariance, &d),
        observable,
        condition_number: condition(&n.matrix, &observable),
        consistency,
        attenuation,
        known_mass,
    })
}

/// The one rule: a parameter is observable if no undetermined direction involves it.
#[inline(never)]
fn observability(matrix: &Matrix10) -> [bool; 10] {
    let (values, vectors) = symmetric_eigen(matrix);
    let mut undetermined = [0.0; 10];
    for (i, &value) in values.iter().enumerate() {
        if value <= RANK {
            for (j, share) in undetermined.iter_mut().enumerate() {
                *share += vectors[(j, i)] * vectors[(j, i)];
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
    let mut order: heapless::Vec<usize, 10> = (0..10).filter(|&j| observable[j]).collect();
    order.extend((0..10).filter(|&j| !observable[j]));
    let mut l = Matrix10::zeros();
    let mut kept = [false; 10];
    for (a, &j) in order.iter().enumerate() {
        let mut pivot = matrix[(j, j)];
        for k in 0..a {
            pivot -= l[(j, order[k])] * l[(j, order[k])];
        }
        if pivot <= RANK {
            continue;
        }
        kept[j] = true;
        let root = libm::sqrt(pivot);
        for &i in &order[a..] {
            let mut sum = matrix[(i, j)];
            for k in 0..a {
                sum -= l[(i, order[k])] * l[(j, order[k])];
            }
            l[(i, j)] = sum / root;
        }
    }
    kept
}

/// Inverse on the kept rows and columns by Cholesky, zero elsewhere.
#[inline(never)]
fn inverse_of(matrix: &Matrix10, kept: &[bool; 10]) -> Option<Matrix10> {
    let reduced = Matrix10::from_fn(|i, j| {
        if kept[i] && kept[j] {
            matrix[(i, j)]
        } else if i == j {
            1.0
        } else {
            0.0
        }
    });
    let mut inverse = reduced.cholesky()?.inverse();
    for i in 0..10 {
        if !kept[i] {
            inverse[(i, i)] = 0.0;
        }
    }
    Some(inverse)
}

#[inline(never)]
fn condition(matrix: &Matrix10, observable: &[bool; 10]) -> f64 {
    let reduced = Matrix10::from_fn(|i, j| {
        if observable[i] && observable[j] {
            matrix[(i, j)]
        } else if i == j {
            1.0
        } else {
            0.0
        }
    });
    let (values, _) = symmetric_eigen(&reduced);
    values[0] / values[9]
}

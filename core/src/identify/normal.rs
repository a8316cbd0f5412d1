//! Stacking (9), the normal equations (10), and what they can and cannot tell.

use super::IdentifyError;
use super::bounded::Bound;
use super::determined::{Answered, Matrix10, NO_MATRIX, determine, times};
use super::measurement::{Measurement, Vector10, inertia_about};
use super::weighed::{ONES, Weighed, floor, is_turned, measured, weights};
use crate::algebra::{half, multiply_left, multiply_right, not_negative, symmetric_values};
use crate::cells::cells;
use crate::geometry::{resultants_at, transfer};
use crate::masslines::Masslines;
use nalgebra::{ArrayStorage, Vector3, Vector6};

const NO_VECTOR: Vector10 = Vector10::from_array_storage(ArrayStorage([[0.0; 10]]));

/// The solution about one point.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// Point of the solution, m.
    pub(super) point: Vector3<f64>,
    /// σ of equation (6), or of (7) if the mass is known.
    pub(super) sigma: Vector10,
    pub(super) covariance: Matrix10,
    /// `true` for elements of σ that the data determine, about this point.
    pub(super) observable: [bool; 10],
    /// `true` for terms of the inertia about the reference of the first set that they determine.
    pub(super) inertia_about_reference: [bool; 6],
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
        inertia_about_reference: [false; 6],
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

/// Adds `Bᵀ diag(weights) B`.
fn add_square(sum: &mut Matrix10, b: &Measurement, weights: &Vector6<f64>) {
    let sum = &mut cells(sum);
    for (i, column) in b.data.0.iter().enumerate() {
        let mut weighted = *column;
        for (x, weight) in weighted.iter_mut().zip(weights) {
            *x *= weight;
        }
        for (j, other) in b.data.0.iter().enumerate().take(i + 1) {
            let mut entry = 0.0;
            for (weighted, x) in weighted.iter().zip(other) {
                // Half of them are zero.
                if *weighted != 0.0 {
                    entry += weighted * x;
                }
            }
            sum[(i, j)] += entry;
            if i != j {
                sum[(j, i)] += entry;
            }
        }
    }
}

/// Working memory of an identification: it is lent, since the stack of a small chip is too small.
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
    /// The value of `matrix` for noise alone, see [`floor`]; used up by [`determine`].
    noise: Matrix10,
    forces: f64,
    stated: Stated,
}

/// Noise of the equations as it was stated.
#[derive(Clone, Copy, Debug)]
struct Stated {
    /// Number of equations.
    rows: f64,
    /// Sum of the equations' variances.
    variance: f64,
    /// `true` if every equation was weighted by its variance.
    weighted: bool,
    /// Degrees of freedom of the variances' estimate.
    freedom: f64,
}

impl Normal {
    const EMPTY: Self = Self {
        matrix: NO_MATRIX,
        right: NO_VECTOR,
        noise: NO_MATRIX,
        forces: 0.0,
        stated: Stated {
            rows: 0.0,
            variance: 0.0,
            weighted: false,
            freedom: 0.0,
        },
    };

    /// Leaves `Σ Bᵀ var B` in `meat`: what the covariance comes from where equations are not
    /// weighted by their variance.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    fn stack<const PAIRS: usize>(
        &mut self,
        sets: &[Masslines<PAIRS>],
        point: &Vector3<f64>,
        mass: f64,
        body: Option<&Vector10>,
        meat: &mut Matrix10,
    ) {
        *self = Self::EMPTY;
        meat.fill(0.0);
        let known = |set: &Masslines<PAIRS>| set.pairs().iter().all(|p| p.variance.max() > 0.0);
        let weighted = sets.iter().all(|s| s.equations().is_whitened() && known(s));
        self.stated.weighted = weighted;
        self.stated.freedom = sets
            .iter()
            .map(Masslines::freedom)
            .fold(f64::INFINITY, f64::min);
        for set in sets {
            let shift = point - set.reference();
            let t = transfer(&shift);
            let weighed = Weighed::new(set, &shift, mass, body);
            let e = &weighed.rows;
            for pair in set.pairs() {
                let b = measured(e, &(t * pair.acceleration), mass);
                let f = e * resultants_at(&shift, &pair.force);
                let w = if weighted {
                    weights(&weighed.variance(pair))
                } else {
                    ONES
                };
                add_square(&mut self.matrix, &b, &w);
                if !weighted {
                    add_square(meat, &b, &pair.variance);
                }
                let weighted = f.component_mul(&w);
                self.right += b.tr_mul(&weighted);
                self.forces += f.dot(&weighted);
                self.stated.rows += weighed.count as f64;
                self.stated.variance += pair.variance.sum();
            }
            let w = if weighted {
                weighed.mean_weights(set.pairs())
            } else {
                ONES
            };
            let columns = t * half(&floor(set));
            for column in columns.column_iter() {
                let b = measured(e, &column.into_owned(), mass);
                add_square(&mut self.noise, &b, &w);
            }
        }
    }

    fn is_finite(&self) -> bool {
        (self.matrix.iter().chain(self.right.iter())).all(|x| x.is_finite())
    }

    /// Scales the unknowns so that the diagonal becomes one, in metres or millimetres alike (column equilibration), and
    /// returns the factors.
    fn equilibrate(&mut self, meat: &mut Matrix10) -> Vector10 {
        let d = self.matrix.diagonal().map(|x| {
            if x > f64::MIN_POSITIVE {
                1.0 / libm::sqrt(x)
            } else {
                0.0
            }
        });
        scale(&mut self.matrix, &d);
        scale(meat, &d);
        scale(&mut self.noise, &d);
        self.right.component_mul_assign(&d);
        d
    }
}

impl Stated {
    /// Turns the meat of [`Normal::stack`] into the covariance for the variances that were stated.
    fn spread(&self, inverse: &Matrix10, bound: Option<&Bound>, covariance: &mut Matrix10) {
        if self.weighted {
            covariance.copy_from(inverse);
            if let Some(bound) = bound {
                bound.add_to(covariance);
            }
        } else {
            multiply_left(inverse, covariance);
            multiply_right(covariance, inverse);
        }
    }

    /// Widens the covariance where the forces that are `left` exceed their noise, and returns the
    /// ratio of the two (Birge's), `None` where no noise was stated: then what is left is the noise.
    fn widen(
        &self,
        left: f64,
        freedom: f64,
        inverse: &Matrix10,
        covariance: &mut Matrix10,
    ) -> Option<f64> {
        if freedom > 0.0 && self.variance > 0.0 {
            let expected = if self.weighted {
                freedom
            } else {
                self.variance * freedom / self.rows
            };
            let ratio = left / expected;
            // What is no number widens them, too, and is refused with them.
            *covariance *= if ratio <= 1.0 { 1.0 } else { ratio };
            return Some(ratio);
        }
        if freedom > 0.0 {
            for (c, i) in covariance.iter_mut().zip(inverse) {
                *c = i * (left / freedom);
            }
        }
        None
    }
}

/// Multiplies rows and columns with `d`.
pub(super) fn scale(m: &mut Matrix10, d: &Vector10) {
    for i in 0..10 {
        for j in 0..10 {
            m[(i, j)] = m[(i, j)] * d[i] * d[j];
        }
    }
}

/// Solves for the body behind the sets about one point, and leaves the solution in `space`.
///
/// The rotation of directions by noise acts as a force of the body, which must be known for it:
/// with such directions the equations are solved twice.
pub(super) fn solve<const PAIRS: usize>(
    sets: &[Masslines<PAIRS>],
    point: &Vector3<f64>,
    known_mass: Option<f64>,
    space: &mut Workspace,
) -> Result<(), IdentifyError> {
    solve_with(sets, point, known_mass, None, space)?;
    if space.normal.stated.weighted && sets.iter().any(is_turned) {
        let body = space.solved.sigma;
        solve_with(sets, point, known_mass, Some(&body), space)?;
    }
    Ok(())
}

/// As [`solve`], where the body is known that [`Weighed::new`] asks for.
fn solve_with<const PAIRS: usize>(
    sets: &[Masslines<PAIRS>],
    point: &Vector3<f64>,
    known_mass: Option<f64>,
    body: Option<&Vector10>,
    space: &mut Workspace,
) -> Result<(), IdentifyError> {
    let Workspace {
        normal: n,
        inverse,
        solved: into,
    } = space;
    let mass = known_mass.unwrap_or(1.0);
    n.stack(sets, point, mass, body, &mut into.covariance);
    if !n.is_finite() {
        return Err(IdentifyError::NotFinite);
    }
    let d = n.equilibrate(&mut into.covariance);

    let pairs = sets.iter().map(|set| set.pairs().len()).max().unwrap_or(0);
    let mut undetermined = determine(&n.matrix, &mut n.noise, inverse, pairs)
        .ok_or(IdentifyError::NothingObservable)?;
    let mut sigma = times(inverse, &n.right);
    let answered = Answered {
        sets,
        point,
        mass,
        weighted: n.stated.weighted,
        body,
        units: &d,
    };
    let mut left = not_negative(n.forces - sigma.dot(&n.right));
    let mut bound = None;
    if n.stated.weighted && undetermined.unknowns() < 10 && sets.iter().any(is_turned) {
        let equations = (&n.matrix, &n.right);
        bound = Bound::new(
            &answered,
            &undetermined,
            known_mass,
            inverse,
            equations,
            &mut sigma,
        );
    }
    if bound.is_some() {
        let explained = 2.0 * sigma.dot(&n.right) - sigma.dot(&times(&n.matrix, &sigma));
        left = not_negative(n.forces - explained);
    }
    let covariance = &mut into.covariance;
    n.stated.spread(inverse, bound.as_ref(), covariance);
    let freedom = n.stated.rows - undetermined.unknowns() as f64;
    let consistency = n.stated.widen(left, freedom, inverse, covariance);
    // The pull of the noise is a bias: its square joins the variance.
    let mut pull = times(inverse, &answered.pull(&sigma, |set| *set.pull()));
    if let Some(bound) = &bound {
        pull += bound.bias(&answered.pull(&sigma, floor));
    }
    covariance.ger(1.0, &pull, &pull, 1.0);
    let mut is_weighed = false;
    if known_mass.is_some() && d[0] > 0.0 {
        is_weighed = !answered.tells(&unit(0), inverse, &undetermined);
        if is_weighed && let Some(w) = undetermined.know_first() {
            weigh(&w, [inverse, covariance], &mut sigma, &mut pull, 1.0 / d[0]);
        }
    }
    let tells = |sum: &Vector10| answered.tells(sum, inverse, &undetermined);
    let mut observable: [bool; 10] = core::array::from_fn(|j| tells(&unit(j)));
    for (observable, rests) in observable
        .iter_mut()
        .zip(bound.iter().flat_map(Bound::rests))
    {
        *observable |= rests;
    }
    // It is known, but not from the data.
    observable[0] &= !is_weighed;
    let to_reference = sets.first().map_or(*point, |set| *set.reference()) - point;
    into.inertia_about_reference =
        core::array::from_fn(|j| tells(&inertia_about(j, &to_reference, known_mass).0));
    let mut attenuation = 0.0_f64;
    for j in (0..10).filter(|&j| observable[j]) {
        if covariance[(j, j)] > 0.0 {
            attenuation = attenuation.max(pull[j] * pull[j] / covariance[(j, j)]);
        }
    }
    into.condition_number = condition(&n.matrix, &observable);
    scale(covariance, &d);
    into.point = *point;
    into.sigma = sigma.component_mul(&d);
    into.observable = observable;
    into.consistency = consistency;
    into.attenuation = attenuation;
    into.misfit = if n.forces > 0.0 {
        libm::sqrt(left / n.forces)
    } else {
        0.0
    };
    into.freedom = n.stated.freedom;
    into.known_mass = known_mass;
    Ok(())
}

/// The parameter `j` alone, as a sum of parameters.
fn unit(j: usize) -> Vector10 {
    Vector10::from_fn(|i, _| if i == j { 1.0 } else { 0.0 })
}

/// Sets Δ, which the data do not determine, to `one`, its value for the weighed mass: moves
/// the solution along the undetermined combination w that alone holds Δ, which changes nothing
/// in the forces.
#[inline(never)] // Not on the stack while equations are solved.
fn weigh(
    w: &Vector10,
    matrices: [&mut Matrix10; 2],
    sigma: &mut Vector10,
    pull: &mut Vector10,
    one: f64,
) {
    sigma.axpy(one - sigma[0], w, 1.0);
    pull.axpy(-pull[0], w, 1.0);
    for matrix in matrices {
        let row = Vector10::from_fn(|j, _| matrix[(0, j)]);
        matrix.ger(-1.0, w, &row, 1.0);
        let column = Vector10::from_fn(|j, _| matrix[(j, 0)]);
        matrix.ger(-1.0, &column, w, 1.0);
    }
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

#[inline(never)]
fn condition(matrix: &Matrix10, observable: &[bool; 10]) -> f64 {
    let values = symmetric_values(&mut reduced(matrix, observable));
    values[0] / values[9]
}

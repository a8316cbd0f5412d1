//! Combinations of the ten parameters that the equations determine.

use super::measurement::{Measurement, Vector10};
use super::weighed::{ONES, Weighed, floor, is_turned, measured, weights};
use crate::algebra::{half, inverse_lower, lower, multiply_left, multiply_right, symmetric_eigen};
use crate::geometry::transfer;
use crate::masslines::{EXCITED, Masslines};
use nalgebra::{ArrayStorage, Matrix6, SMatrix, Vector3, Vector6};

/// Matrix of the ten parameters.
pub(super) type Matrix10 = SMatrix<f64, 10, 10>;

/// All zero.
pub(super) const NO_MATRIX: Matrix10 = Matrix10::from_array_storage(ArrayStorage([[0.0; 10]; 10]));

/// Eigenvalue of the equilibrated normal equations below which a direction is rounding.
///
/// Their diagonal is one, so rounding is 1e-15. The smallest honest eigenvalue falls
/// with the fourth power of the distance of A from the body in radii of gyration: 1e-12
/// allows a thousand.
const RANK: f64 = 1e-12;

/// Limit of the squares of a parameter's shares in the undetermined combinations, in units of the
/// squares that noise gives them: χ² of nine combinations exceeds it once in two hundred times.
const CHANCE: f64 = 23.6;

/// Share of the variance of a parameter that rounding may leave along undetermined combinations.
const ROUNDING: f64 = 1e-8;

/// Share of the noise of a parameter that rounding may leave along a combination that has none:
/// a run keeps its noise in single precision.
const SINGLE: f64 = 1e-6;

/// Combinations of parameters that the equations do not determine, in units in which the normal
/// equations have ones on their diagonal.
#[derive(Debug)]
pub(super) struct Undetermined<'a> {
    /// One a column, the first `count`; the others are zero.
    vectors: &'a mut Matrix10,
    count: usize,
    /// Sum over the determined combinations of noise, times [`EXCITED`], over data.
    noise: f64,
    /// Noise of each parameter that may lie in any equation, since noise is rounded.
    unsure: Vector10,
    /// `true` for a combination that the data weigh more than noise alone would, though not enough:
    /// motion turns it, too, by no more than one over the root of [`EXCITED`] in units of deviations.
    moved: [bool; 10],
}

impl Undetermined<'_> {
    /// Number of combinations that are determined.
    pub(super) fn unknowns(&self) -> usize {
        10 - self.count
    }

    /// The combinations, one a column, in the first columns.
    pub(super) fn vectors(&self) -> &Matrix10 {
        self.vectors
    }

    /// For each combination, `true` if the data weigh it more than noise alone would.
    pub(super) fn moved(&self) -> impl Iterator<Item = bool> + '_ {
        self.moved.iter().take(self.count).copied()
    }

    /// Takes the combination w out that alone holds the first parameter, which is known otherwise;
    /// returns it with a first element of one. `None` if none holds it.
    pub(super) fn know_first(&mut self) -> Option<Vector10> {
        let mut w = Vector10::zeros();
        let mut square = 0.0;
        for v in &self.vectors.data.0 {
            let share = v[0];
            square += share * share;
            w.axpy(share, &Vector10::from(*v), 1.0);
        }
        if square == 0.0 {
            return None;
        }
        w /= square;
        for v in &mut self.vectors.data.0 {
            let share = v[0];
            for (x, w) in v.iter_mut().zip(&w) {
                *x -= share * w;
            }
        }
        Some(w)
    }
}

/// Weight that data give a combination, in units of what noise gives it by one pair, from which it
/// is not noise alone: so many pairs exceed it once in a hundred times (χ²).
fn alone(pairs: usize) -> f64 {
    let pairs = pairs as f64;
    pairs + 3.0 * libm::sqrt(2.0 * pairs) + 1.5
}

/// The one rule: which combinations of parameters the equations determine. Leaves the inverse of the
/// equilibrated normal equations on those in `inverse`; the others take the place of `floor`, which
/// is what noise alone would give the equations. `None` if none is determined.
///
/// A combination v is determined if the data weigh it, `vᵀ Q v`, by [`EXCITED`] times what
/// noise alone would; the pencil of these two matrices has the same eigenvalues at every
/// reference point and in all units. Where data say nothing, the combination is only known to
/// within what noise turns it by: a sum of parameters is observable if the undetermined
/// combinations involve it by no more than chance would, see [`Answered::tells`]. What they involve
/// is left out of the solution.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
pub(super) fn determine<'a>(
    matrix: &Matrix10,
    floor: &'a mut Matrix10,
    inverse: &mut Matrix10,
    pairs: usize,
) -> Option<Undetermined<'a>> {
    *floor *= EXCITED;
    let unsure = floor.diagonal().map(|x| RANK + SINGLE * x);
    for (j, unsure) in unsure.iter().enumerate() {
        floor[(j, j)] += unsure;
    }
    lower(floor, 10)?;
    inverse_lower(floor, 10);
    inverse.copy_from(matrix);
    multiply_left(floor, inverse);
    floor.transpose_mut();
    multiply_right(inverse, floor);
    let mut vectors = *inverse;
    for j in 0..10 {
        vectors[(j, j)] -= 1.0;
    }
    if lower(&mut vectors, 10).is_some() {
        // All eigenvalues exceed one, and nobody asks for them one by one.
        vectors.copy_from(inverse);
        lower(&mut vectors, 10)?;
        inverse_lower(&mut vectors, 10);
        let noise = vectors.norm_squared();
        floor.transpose_mut();
        multiply_right(&mut vectors, floor);
        inverse.copy_from(&vectors);
        vectors.transpose_mut();
        multiply_left(&vectors, inverse);
        floor.fill(0.0);
        return Some(Undetermined {
            vectors: floor,
            count: 0,
            noise,
            unsure,
            moved: [false; 10],
        });
    }
    vectors.fill(0.0);
    let values = symmetric_eigen(inverse, &mut vectors);
    // Of length one in the floor, and of length λ in the data.
    multiply_left(floor, &mut vectors);
    inverse.fill(0.0);
    floor.fill(0.0);
    let (mut count, mut noise) = (0, 0.0);
    let mut moved = [false; 10];
    for (v, &value) in vectors.data.0.iter().zip(&values) {
        if value > 1.0 {
            noise += 1.0 / value;
            let v = Vector10::from(*v);
            inverse.ger(1.0 / value, &v, &v, 1.0);
        } else if let (Some(column), Some(moved)) =
            (floor.data.0.get_mut(count), moved.get_mut(count))
        {
            *column = *v;
            *moved = value * EXCITED > alone(pairs);
            count += 1;
        }
    }
    (count < 10).then_some(Undetermined {
        vectors: floor,
        count,
        noise,
        unsure,
        moved,
    })
}

/// The equations that were solved, for the question of what they determine.
pub(super) struct Answered<'a, const PAIRS: usize> {
    pub(super) sets: &'a [Masslines<PAIRS>],
    /// Point of the equations, m.
    pub(super) point: &'a Vector3<f64>,
    /// The known mass (kg), or one.
    pub(super) mass: f64,
    /// `true` if equations were weighted by their variance.
    pub(super) weighted: bool,
    /// σ about the point, see [`Weighed::new`].
    pub(super) body: Option<&'a Vector10>,
    /// Units of the parameters.
    pub(super) units: &'a Vector10,
}

impl<const PAIRS: usize> Answered<'_, PAIRS> {
    /// `true` if the equations determine the sum of the parameters with these coefficients, in SI
    /// units: if the undetermined combinations v involve it by no more than noise and rounding make
    /// them. A sum may be determined whose elements are not: a rotation about A tells the inertia
    /// about A, and about no other point as long as the mass is unknown.
    ///
    /// Noise N in the measurement matrix B of a pair, see [`floor`], takes v, for which `B v = 0`, to
    /// `v - Q⁻ Bᵀ W N v` with the weights W and the inverse `Q⁻` of the normal equations on what they
    /// determine. So the shares `eᵀ v` of the sum e have the covariance `Σ (rᵀ N v)(rᵀ N v)ᵀ` with
    /// `r = W B Q⁻ e`, summed over the pairs and over the directions of the noise. An equation
    /// without the sum's parameters turns nothing towards them, however precise it is.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn tells(
        &self,
        sum: &Vector10,
        inverse: &Matrix10,
        undetermined: &Undetermined<'_>,
    ) -> bool {
        // No equation contains it.
        if sum
            .iter()
            .zip(self.units)
            .any(|(c, unit)| *c != 0.0 && *unit == 0.0)
        {
            return false;
        }
        let Undetermined {
            vectors,
            count,
            noise,
            unsure,
            moved,
        } = undetermined;
        let sum = sum.component_mul(self.units);
        let mut shares = vectors.tr_mul(&sum);
        let inverse = times(inverse, &sum);
        let determined = sum.dot(&inverse);
        let rounding = ROUNDING * determined;
        let square = shares.norm_squared();
        if square <= rounding {
            return true;
        }
        // Noise turns each v by at most one over the root of `EXCITED`, in units of the sum's
        // deviation.
        if square > CHANCE * *count as f64 / EXCITED * determined + rounding {
            return false;
        }
        let mut limit = self.turned(&inverse, vectors);
        limit *= CHANCE;
        // Noise of the second order: that change itself, turned by noise.
        let again = CHANCE * noise / (EXCITED * EXCITED) * determined;
        // What rounding of the noise leaves may lie in any equation.
        let anywhere = CHANCE / EXCITED * determined;
        for (unsure, row) in unsure.iter().zip(vectors.row_iter()) {
            limit.ger(anywhere * unsure, &row.transpose(), &row.transpose(), 1.0);
        }
        // Methods that do not tell noise along the directions that are not excited from the rest know
        // how much it is, and not where it lies.
        let is_known = self.sets.iter().any(is_turned);
        for (k, moved) in moved.iter().enumerate() {
            let by_motion = if *moved || !is_known {
                CHANCE / EXCITED * determined
            } else {
                0.0
            };
            limit[(k, k)] += again + rounding + by_motion;
        }
        if lower(&mut limit, *count).is_none() {
            return false;
        }
        inverse_lower(&mut limit, *count);
        shares = times(&limit, &shares);
        shares.norm_squared() <= 1.0
    }

    /// Covariance of the shares of a sum e in the undetermined combinations, from `Q⁻ e`.
    pub(super) fn turned(&self, inverse: &Vector10, vectors: &Matrix10) -> Matrix10 {
        let mut covariance = NO_MATRIX;
        for set in self.sets {
            let shift = self.point - set.reference();
            let t = transfer(&shift);
            let weighed = Weighed::new(set, &shift, self.mass, self.body);
            // Σ r rᵀ over the pairs.
            let mut weights_of_rows = Matrix6::zeros();
            for pair in set.pairs() {
                let b = self.scaled(&weighed, &(t * pair.acceleration));
                let mut r = b * inverse;
                if self.weighted {
                    r.component_mul_assign(&weights(&weighed.variance(pair)));
                }
                weights_of_rows.ger(1.0, &r, &r, 1.0);
            }
            let root = half(&weights_of_rows);
            let columns = t * half(&floor(set));
            for column in columns.column_iter() {
                let n = self.scaled(&weighed, &column.into_owned());
                for r in root.column_iter() {
                    let of_parameters = n.tr_mul(&r);
                    let change = vectors.tr_mul(&of_parameters);
                    covariance.ger(1.0, &change, &change, 1.0);
                }
            }
        }
        covariance
    }

    /// Part of the normal equations that second moments of noise, `noise` of a set, add, times the parameters
    /// `sigma`, both in units in which their diagonal is one.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn pull(
        &self,
        sigma: &Vector10,
        noise: fn(&Masslines<PAIRS>) -> Matrix6<f64>,
    ) -> Vector10 {
        let sigma = sigma.component_mul(self.units);
        let mut pull = Vector10::zeros();
        for set in self.sets {
            let shift = self.point - set.reference();
            let weighed = Weighed::new(set, &shift, self.mass, self.body);
            let w = if self.weighted {
                weighed.mean_weights(set.pairs())
            } else {
                ONES
            };
            let columns = transfer(&shift) * half(&noise(set));
            for column in columns.column_iter() {
                let b = measured(&weighed.rows, &column.into_owned(), self.mass);
                let force: Vector6<f64> = b * sigma;
                pull += b.tr_mul(&force.component_mul(&w));
            }
        }
        pull.component_mul(self.units)
    }

    /// Rows of an acceleration in units of the parameters.
    #[inline(never)] // One matrix on the caller's stack.
    fn scaled(&self, weighed: &Weighed, acceleration: &Vector6<f64>) -> Measurement {
        let mut b = measured(&weighed.rows, acceleration, self.mass);
        for (mut column, unit) in b.column_iter_mut().zip(self.units) {
            column *= *unit;
        }
        b
    }
}

/// `m v`: the operator between values would copy the matrix.
pub(super) fn times(m: &Matrix10, v: &Vector10) -> Vector10 {
    m * v
}

#[cfg(test)]
pub(super) mod tests {
    use crate::geometry::Equations;
    use crate::identify::{Identification, Question, identify};
    use crate::masslines::Masslines;
    use crate::rigid_body::{Inertia, RigidBody};
    use nalgebra::{Matrix6, Vector3, Vector6};

    /// Uniform between -√3 and √3, so that its variance is one.
    pub(in crate::identify) struct Draws(pub(in crate::identify) u64);

    impl Draws {
        pub(in crate::identify) fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let unit = (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
            (2.0 * unit - 1.0) * libm::sqrt(3.0)
        }
    }

    /// Noise of a line's accelerations, m/s² and rad/s².
    const NOISE: f64 = 1e-3;
    const LINES: f64 = 20.0;

    /// A rotation about an axis along z that passes 0.3 m beside A. Along z there is no force, and no
    /// noise of it to speak of.
    fn found(draws: &mut Draws) -> Identification {
        let body = RigidBody {
            mass: 5.0,
            centre_of_gravity: Vector3::new(0.1, -0.05, 0.4),
            inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
        };
        let mass = body.mass_matrix(&Vector3::zeros());
        let variance = Vector6::new(1e-4, 1e-4, 1e-14, 1e-4, 1e-4, 1e-4);
        let weights = Matrix6::from_diagonal(&variance.map(|v| 1.0 / libm::sqrt(v)));
        let mut set: Masslines =
            Masslines::new(Vector3::zeros(), Equations::all().whitened(&weights));
        let a = Vector6::new(0.0, -0.3, 0.0, 0.0, 0.0, 1.0);
        let turned = NOISE * libm::sqrt(0.5 / LINES);
        let noise = Vector6::from_fn(|_, _| turned * draws.next());
        let force = mass * a + Vector6::from_fn(|j, _| libm::sqrt(variance[j]) * draws.next());
        set.push(a + noise, force, Vector6::repeat(1.0)).unwrap();
        let excited = a * a.transpose() / a.norm_squared();
        set.noise = Matrix6::identity() * NOISE * NOISE;
        set.pull = excited * NOISE * NOISE;
        set.lines = LINES as f32;
        identify(&[set], &Question::default()).unwrap()
    }

    /// The moment of inertia about A is that about the axis and a multiple of the mass, which a
    /// rotation does not tell. That no force is seen where the noise of the accelerations would
    /// have a mass give one says nothing of the mass.
    #[test]
    fn a_force_without_noise_does_not_tell_the_mass() {
        let mut draws = Draws(7);
        for _ in 0..50 {
            let found = found(&mut draws);
            assert_eq!(found.mass, None);
            // The axis lies beside A along x, so that the mass is no part of the product yz.
            let [others @ .., yz] = found.inertia_reference;
            assert_eq!(others, [None; 5]);
            let yz = yz.unwrap();
            assert!(
                (yz.value - (0.03 - 5.0 * 0.05 * 0.4)).abs() < 9.0 * yz.std,
                "{yz:?}"
            );
        }
    }
}

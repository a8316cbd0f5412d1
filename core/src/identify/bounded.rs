//! Bounds on what the equations do not determine: the least that is known of a body beforehand.
//!
//! A table that translates rotates a little, too. Where that rotation is seen, though not well enough to
//! tell the inertia, the inertia bends the centre of gravity by itself times the rotation. A body has a
//! radius of gyration like its size, and that is like the distance of the accelerometers on its base: with
//! such a bound the centre of gravity is told to within what the inertia may bend it.

use super::determined::{Answered, Matrix10, NO_MATRIX, Undetermined, times};
use super::measurement::Vector10;
use crate::algebra::{inverse_lower, larger, lower, multiply_right, not_negative, symmetric_eigen};
use crate::geometry::accelerometer_places;
use nalgebra::Vector3;

/// Share of its deviation beforehand, which is the mass itself, or one for Δ, up to which it may rest on the bound.
///
/// A run along one oblique direction, below which the vertical forces are measured, is no measurement of the mass: with
/// ten per cent, the bound told one of 43.7 kg to 38.7 ± 10.0 kg.
const LITTLE_OF_MASS: f64 = 0.05;

/// The same for first moments, whose deviation beforehand is the mass times the body's size.
const LITTLE: f64 = 0.1;

/// Standard deviation of the square of the radius of gyration beforehand, in units of the square of the body's
/// size. Twice leaves room for bodies that reach far beyond their base.
const WIDELY: f64 = 2.0;

/// Share of the variance that is left where all of it may be noise: a table that rotates by less than its noise
/// shows no rotation, and the inertia bends the centre of gravity all the same.
const UNSEEN: f64 = 0.1;

/// Most steps towards the scale of the deviations beforehand, and change of its square at which they end.
const STEPS: usize = 30;
const SETTLED: f64 = 1e-3;

/// Weight of a scale of one, in terms that are known: where nothing tells the scale, it stays.
const ONE: f64 = 0.1;

/// Distribution of the undetermined combinations with a bound on the body, in units in which the normal
/// equations have ones on their diagonal.
#[derive(Debug)]
pub(super) struct Bound {
    /// A root of their covariance: ten parameters by combinations.
    root: Matrix10,
    /// `true` for mass and first moments that rest on the data for all that.
    rests: [bool; 4],
}

impl Bound {
    /// Takes what the undetermined combinations V may hold into `sigma`. `None` if the accelerometers do not
    /// tell a size, or if the mass is not told, of which the bound is a multiple.
    ///
    /// The solution may be anything along V. With the weights W of a body beforehand, which has the
    /// parameters zero, give or take its size, and with the equations `Q σ = b` for combinations that motion
    /// reached, it is least uncertain at `σ + V P⁻¹ (Vᵀ b - Vᵀ W σ)`, `P = Vᵀ W V + Vᵀ Q V`, with the covariance
    /// `V P⁻¹ Vᵀ`. Noise alone gives a parameter a share in V, see [`Answered::tells`], which no inertia
    /// bends: that much is left out.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn new<const PAIRS: usize>(
        answered: &Answered<'_, PAIRS>,
        undetermined: &Undetermined<'_>,
        known_mass: Option<f64>,
        inverse: &Matrix10,
        (matrix, right): (&Matrix10, &Vector10),
        sigma: &mut Vector10,
    ) -> Option<Self> {
        let beforehand = beforehand(answered, known_mass, sigma)?;
        let vectors = undetermined.vectors();
        let count = undetermined.moved().count();
        let weights = beforehand.map(|deviation| 1.0 / (deviation * deviation));
        let mut precision = vectors.transpose();
        for (mut column, weight) in precision.column_iter_mut().zip(&weights) {
            column *= *weight;
        }
        multiply_right(&mut precision, vectors);
        let asked = -vectors.tr_mul(&weights.component_mul(sigma));
        let mut own = precision;
        let root = root_of_inverse(&mut own, count)?;
        let prior = Prior::new(vectors, root, &beforehand);
        let rests = prior.rests();
        if known_mass.is_none() && !rests[0] {
            return None;
        }
        let [mut seen, mut told] = [Vector10::zeros(); 2];
        for (k, moved) in undetermined.moved().enumerate() {
            if moved {
                let v = vectors.column(k).into_owned();
                seen[k] = v.dot(&times(matrix, &v));
                told[k] = v.dot(right);
            }
        }
        let wider = prior.widening(sigma, &asked, &seen, &told);
        precision /= wider;
        let asked = asked / wider + told;
        for (k, seen) in seen.iter().enumerate() {
            precision[(k, k)] += seen;
        }
        let root = root_of_inverse(&mut precision, count)?;
        let mut bound = Self {
            root: *vectors,
            rests,
        };
        multiply_right(&mut bound.root, root);
        *sigma += times(&bound.root, &root.tr_mul(&asked));
        for (j, mut row) in bound.root.row_iter_mut().enumerate() {
            let column = Vector10::from_fn(|i, _| inverse[(i, j)]);
            let by_noise = variance(root, &answered.turned(&column, vectors));
            let all = row.norm_squared();
            row *= if all > by_noise / (1.0 - UNSEEN) {
                libm::sqrt(1.0 - by_noise / all)
            } else {
                libm::sqrt(UNSEEN)
            };
        }
        Some(bound)
    }

    /// Adds the covariance of what the combinations hold.
    #[inline(never)] // One matrix on the caller's stack.
    pub(super) fn add_to(&self, covariance: &mut Matrix10) {
        for column in self.root.column_iter() {
            covariance.ger(1.0, &column, &column, 1.0);
        }
    }

    /// The bias along the combinations that an error of the equations' right side brings.
    pub(super) fn bias(&self, right: &Vector10) -> Vector10 {
        times(&self.root, &self.root.tr_mul(right))
    }

    /// `true` for mass (or Δ) and first moments that the test tells with the bound.
    pub(super) fn rests(&self) -> [bool; 4] {
        self.rests
    }
}

/// Standard deviations from zero of the ten parameters of a body beforehand, in units in which the normal
/// equations have ones on their diagonal, from its mass and first moments in `sigma`. Its radius of gyration
/// about its centre is the distance of the accelerometers from an axis, or that of its centre from their middle,
/// whichever is longer. `None` without mass, or if the noise of the accelerometers does not tell their places.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
fn beforehand<const PAIRS: usize>(
    answered: &Answered<'_, PAIRS>,
    known_mass: Option<f64>,
    sigma: &Vector10,
) -> Option<Vector10> {
    let set = answered.sets.first()?;
    let (middle, square) = accelerometer_places(set.noise());
    let middle = set.reference() + middle - answered.point;
    let in_units = sigma.component_mul(answered.units);
    // The elements of (7) are lengths, those of (6) first moments.
    let (mass, moment) = match known_mass {
        Some(mass) => (mass, 1.0),
        None => (in_units[0], in_units[0]),
    };
    let is_usable = mass > 0.0 && square > 0.0 && (mass + square).is_finite();
    if !is_usable {
        return None;
    }
    let c = Vector3::new(in_units[1], in_units[2], in_units[3]) / moment;
    let own = larger(square, (c - middle).norm_squared());
    let first_moment = moment * libm::sqrt(own + middle.norm_squared());
    let of_moment =
        |c: f64, other: f64| mass * libm::hypot(own + c * c + other * other, WIDELY * own);
    // Products of inertia are at most half the difference of two moments.
    let of_product = |c: f64, other: f64| mass * libm::hypot(c * other, 0.5 * WIDELY * own);
    let deviations = Vector10::from_column_slice(&[
        if known_mass.is_some() { 1.0 } else { mass },
        first_moment,
        first_moment,
        first_moment,
        of_moment(c.y, c.z),
        of_moment(c.x, c.z),
        of_moment(c.x, c.y),
        of_product(c.x, c.y),
        of_product(c.x, c.z),
        of_product(c.y, c.z),
    ]);
    Some(deviations.zip_map(answered.units, |deviation, unit| {
        // Without an equation any will do.
        if unit > 0.0 { deviation / unit } else { 1.0 }
    }))
}

/// Distribution of the undetermined combinations V beforehand, without the data that reach them.
struct Prior<'a> {
    vectors: &'a Matrix10,
    /// A root R of their covariance `R Rᵀ = (Vᵀ W V)⁻¹`.
    root: &'a Matrix10,
    /// Of the ten parameters.
    deviations: &'a Vector10,
    /// Share of the variance beforehand of each parameter that the combinations have.
    shares: Vector10,
}

impl<'a> Prior<'a> {
    #[inline(never)] // Its vectors are off the stack when the caller goes on.
    fn new(vectors: &'a Matrix10, root: &'a Matrix10, deviations: &'a Vector10) -> Self {
        let shares = Vector10::from_fn(|j, _| {
            let of_row = root.tr_mul(&vectors.row(j).transpose());
            of_row.norm_squared() / (deviations[j] * deviations[j])
        });
        Self {
            vectors,
            root,
            deviations,
            shares,
        }
    }

    /// `true` for mass and first moments that have little uncertainty from the combinations.
    fn rests(&self) -> [bool; 4] {
        core::array::from_fn(|j| {
            let little = if j == 0 { LITTLE_OF_MASS } else { LITTLE };
            self.shares[j] <= little * little
        })
    }

    /// Square of the scale by which the deviations are as large as the data say: that of most marginal
    /// likelihood, and at least one. From the determined solution `sigma`, from `-Vᵀ W sigma` in `asked`, and from
    /// data of the precision `seen` on V, D, which want `D p = told`.
    ///
    /// With the eigenvalues λ of `Rᵀ D R` the elements g of `Rᵀ (told - D R Rᵀ asked)` along its eigenvectors have
    /// the variances `λ + s² λ²`. The inertia terms of the solution, where V is least uncertain beside it, have
    /// the variance s² in units of their deviations, less the share of V. Fisher's scoring finds s² of both.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    fn widening(
        &self,
        sigma: &Vector10,
        asked: &Vector10,
        seen: &Vector10,
        told: &Vector10,
    ) -> f64 {
        let mean = times(self.root, &self.root.tr_mul(asked));
        let likely = sigma + times(self.vectors, &mean);
        let (mut certain, mut squares) = (ONE, ONE);
        let terms = likely.component_div(self.deviations);
        for (x, share) in terms.iter().zip(&self.shares).skip(4) {
            certain += not_negative(1.0 - share);
            squares += x * x;
        }
        let away = self.root.tr_mul(&(told - seen.component_mul(&mean)));
        let mut turned = *self.root;
        for (mut row, seen) in turned.row_iter_mut().zip(seen) {
            row *= libm::sqrt(*seen);
        }
        let mut turned = turned.tr_mul(&turned);
        let mut vectors = NO_MATRIX;
        let values = symmetric_eigen(&mut turned, &mut vectors);
        let away = vectors.tr_mul(&away);
        let mut square = 1.0_f64;
        for _ in 0..STEPS {
            let [mut found, mut information] = [squares, certain];
            for (g, value) in away.iter().zip(&values) {
                let share = square / (1.0 + square * value);
                found += (g * g - value) * share * share;
                information += value * value * share * share;
            }
            let before = square;
            square = larger(found / information, 1.0);
            if libm::fabs(square - before) < SETTLED * square {
                break;
            }
        }
        square
    }
}

/// Replaces the leading part of a matrix by a root R of its inverse, `R Rᵀ`. `None` if it is not positive
/// definite.
fn root_of_inverse(matrix: &mut Matrix10, count: usize) -> Option<&Matrix10> {
    lower(matrix, count)?;
    inverse_lower(matrix, count);
    matrix.transpose_mut();
    Some(matrix)
}

/// `tr Rᵀ C R`.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
fn variance(root: &Matrix10, covariance: &Matrix10) -> f64 {
    let columns = root.column_iter().map(|r| r.into_owned());
    columns.map(|r| r.dot(&times(covariance, &r))).sum()
}

#[cfg(test)]
mod tests {
    use crate::algebra::half;
    use crate::geometry::Equations;
    use crate::identify::determined::tests::Draws;
    use crate::identify::{Estimate, Identification, Question, identify};
    use crate::masslines::{Masslines, excited_directions};
    use crate::rigid_body::{Inertia, RigidBody};
    use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};

    /// Noise of an accelerometer at a line, m/s².
    const NOISE: f64 = 1e-3;
    const LINES: f64 = 20.0;
    /// Of the recordings of one case.
    const MANY: usize = 100;

    /// Covariance of the accelerations of A, below four triaxial accelerometers on a ring of 0.2 m.
    fn noise_of_accelerations() -> Matrix6<f64> {
        let mut information = Matrix6::zeros();
        for (x, y) in [(0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2)] {
            let z = 0.05;
            // Rows of a + α x p.
            let rows = SMatrix::<f64, 3, 6>::from_row_slice(&[
                1.0, 0.0, 0.0, 0.0, z, -y, 0.0, 1.0, 0.0, -z, 0.0, x, 0.0, 0.0, 1.0, y, -x, 0.0,
            ]);
            information += rows.transpose() * rows;
        }
        information.try_inverse().unwrap() * NOISE * NOISE
    }

    fn six(draws: &mut Draws) -> Vector6<f64> {
        Vector6::from_fn(|_, _| draws.next())
    }

    /// Three translations of 1 m/s² in each of which the table rotates by some `tilt`, rad/s².
    fn translations(body: &RigidBody, tilt: f64, draws: &mut Draws) -> Identification {
        let noise = noise_of_accelerations();
        let root = half(&noise) * libm::sqrt(0.5 / LINES);
        let deviation = NOISE * body.mass * libm::sqrt(0.5 / LINES);
        let deviations = Vector6::new(1.0, 1.0, 1.0, 0.2, 0.2, 0.2) * deviation;
        let weights = Matrix6::from_diagonal(&deviations.map(|d| 1.0 / d));
        let about_a = body.mass_matrix(&Vector3::zeros());
        let mut set: Masslines =
            Masslines::new(Vector3::zeros(), Equations::all().whitened(&weights));
        let mut moments = Matrix6::zeros();
        for axis in 0..3 {
            let mut a = six(draws) * tilt;
            for j in 0..3 {
                a[j] = if j == axis { 1.0 } else { 0.0 };
            }
            let seen = a + root * six(draws);
            let force = about_a * a + deviations.component_mul(&six(draws));
            moments += seen * seen.transpose();
            set.push(seen, force, Vector6::repeat(1.0)).unwrap();
        }
        set.noise = noise * 3.0;
        let (_, along) = excited_directions(&moments, &set.noise);
        set.pull = along * set.noise * along.transpose();
        set.lines = LINES as f32;
        identify(&[set], &Question::default()).unwrap()
    }

    /// Root mean squares of the errors of mass and centre of gravity, in units of their error bars, and the
    /// mean error bar of the centre, m. All are told.
    fn errors(height: f64, inertia: f64, tilt: f64) -> [f64; 3] {
        let terms = [0.5, 0.6, 0.4, 0.05, -0.04, 0.03].map(|x| x * inertia);
        let body = RigidBody {
            mass: 5.0,
            centre_of_gravity: Vector3::new(0.05, -0.03, height),
            inertia: Inertia::from_terms(terms),
        };
        let mut draws = Draws(7);
        let mut sums = [0.0; 3];
        for _ in 0..MANY {
            let found = translations(&body, tilt, &mut draws);
            let square = |e: Estimate, truth: f64| ((e.value - truth) / e.std).powi(2);
            sums[0] += square(found.mass.unwrap(), body.mass);
            for (e, truth) in found.centre_of_gravity.iter().zip(&body.centre_of_gravity) {
                let e = e.unwrap();
                sums[1] += square(e, *truth) / 3.0;
                sums[2] += e.std / 3.0;
            }
        }
        let [mass, centre, bar] = sums.map(|x| x / MANY as f64);
        [libm::sqrt(mass), libm::sqrt(centre), bar]
    }

    const TILTS: [f64; 9] = [0.0, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 0.1, 0.3];

    /// The noise of the table's rotation is 5e-3 rad/s² at a line and 8e-4 in all. A table that translates and
    /// rotates by anything, seen or unseen, tells mass and centre of gravity, with error bars that hold: a
    /// hundred recordings give the root mean square of the mass to 7 %, and that of the centre to some 5 %.
    #[test]
    fn a_table_that_rotates_a_little_tells_the_centre_of_gravity() {
        for (height, inertia) in [(0.4, 1.0), (0.4, 0.1), (0.06, 1.0)] {
            for tilt in TILTS {
                let [mass, centre, bar] = errors(height, inertia, tilt);
                let case = (height, inertia, tilt, bar);
                assert!(mass < 1.25 && centre < 1.3, "{case:?}: {mass}, {centre}");
                // The bound leaves a body of a tenth of the sensors' distance room for ten times its inertia.
                assert!(centre > 0.25, "{case:?}: {centre}");
            }
        }
    }

    /// With a radius of gyration of 0.63 m on a ring of 0.2 m, whose accelerometers are 0.16 m from an axis in the
    /// mean, the inertia is fifteen times that of a body of the ring's size, and seven standard deviations
    /// of what is known beforehand. Where the rotation is seen, or tells a part of the inertia, the data widen
    /// these; a rotation of a third of its noise bends the centre of gravity by 1.6 error bars, and shows nothing.
    #[test]
    fn a_body_that_reaches_far_beyond_its_base_widens_the_bound() {
        for tilt in TILTS {
            let [mass, centre, _] = errors(0.06, 4.0, tilt);
            let limit = if tilt < 1e-3 { 1.7 } else { 1.3 };
            assert!(mass < 1.25 && centre < limit, "{tilt}: {mass}, {centre}");
            assert!(centre > 0.5, "{tilt}: {centre}");
        }
    }
}

//! Noise of the twelve resultants of a run, with its correlations.
//!
//! Sensors are independent, the resultants that are computed from them are not: an
//! accelerometer off A reads into a translation and a rotation alike. So the noise of a run
//! is two 6 x 6 covariance matrices. They move with the reference point by the rule of the
//! resultants themselves, `C_B = T C_A Tᵀ` for accelerations and `C_B = T⁻ᵀ C_A T⁻¹` for
//! forces, and everything that asks how large the noise is reads them.

use super::RESULTANTS;
use crate::algebra::symmetric_eigen;
use crate::cells::seen;
use nalgebra::{ArrayStorage, Matrix3, Matrix6, Vector3, Vector6};

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

/// Elements of one packed covariance: its lower triangle, row after row.
const TRIANGLE: usize = 21;

/// Covariance of the noise of accelerations and of resultants at A, per spectral line: for
/// amplitudes x of a line `E x x*`, the sum of the variances of real and imaginary part.
///
/// Units are those of the resultants squared. A sensor belongs to one half only, so there is
/// no covariance between the halves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResultantNoise {
    /// Of the six accelerations: (m/s²)², m/s² rad/s², (rad/s²)².
    pub acceleration: Matrix6<f64>,
    /// Of the six resultants: N², N² m, N² m².
    pub force: Matrix6<f64>,
}

impl ResultantNoise {
    /// No noise.
    pub(crate) const NONE: Self = Self {
        acceleration: NO_MATRIX,
        force: NO_MATRIX,
    };

    /// Uncorrelated resultants of these variances, accelerations before forces.
    #[must_use]
    pub fn diagonal(variances: &[f64; RESULTANTS]) -> Self {
        Self {
            acceleration: Matrix6::from_diagonal(&Vector6::from_fn(|j, _| variances[j])),
            force: Matrix6::from_diagonal(&Vector6::from_fn(|j, _| variances[6 + j])),
        }
    }

    /// Adds an independent sensor: its contribution to the twelve resultants, of which one
    /// half is zero, and the variance of its noise.
    pub fn add_sensor(&mut self, column: &[f64; RESULTANTS], variance: f64) {
        let a = Vector6::from_fn(|j, _| column[j]);
        let f = Vector6::from_fn(|j, _| column[6 + j]);
        self.acceleration.ger(variance, &a, &a, 1.0);
        self.force.ger(variance, &f, &f, 1.0);
    }

    /// Adds `weight` times another one about the same point.
    pub fn add(&mut self, other: &Self, weight: f64) {
        let sums = self.acceleration.iter_mut().chain(&mut self.force);
        let others = other.acceleration.iter().chain(&other.force);
        for (sum, other) in sums.zip(others) {
            *sum += other * weight;
        }
    }

    /// Variances of the twelve resultants, accelerations before forces.
    #[must_use]
    pub fn variances(&self) -> [f64; RESULTANTS] {
        core::array::from_fn(|j| {
            let half = if j < 6 {
                &self.acceleration
            } else {
                &self.force
            };
            half[(j % 6, j % 6)]
        })
    }

    /// The same noise about a point `shift = r_B - r_A` (m) away.
    #[cfg(test)]
    pub(crate) fn at(&self, shift: &Vector3<f64>) -> Self {
        let mut moved = *self;
        moved.move_by(shift);
        moved
    }

    /// Moves the reference point by `shift`, m.
    pub(crate) fn move_by(&mut self, shift: &Vector3<f64>) {
        move_accelerations(&mut self.acceleration, shift);
        move_forces(&mut self.force, shift);
    }

    /// Both matrices as lower triangles of `f32`, row after row, accelerations first.
    #[must_use]
    pub(crate) fn packed(&self) -> [f32; 2 * TRIANGLE] {
        let mut packed = [0.0; 2 * TRIANGLE];
        let halves = packed.chunks_exact_mut(TRIANGLE);
        for (half, matrix) in halves.zip([&self.acceleration, &self.force]) {
            let entries = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
            for (slot, at) in half.iter_mut().zip(entries) {
                *slot = matrix[at] as f32;
            }
        }
        packed
    }

    /// The noise of the numbers that were packed.
    #[must_use]
    pub fn unpacked(packed: &[f32; 2 * TRIANGLE]) -> Self {
        let mut noise = Self::NONE;
        let Self {
            acceleration,
            force,
        } = &mut noise;
        let halves = packed.chunks_exact(TRIANGLE);
        for (half, matrix) in halves.zip([acceleration, force]) {
            let entries = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
            for (value, (i, j)) in half.iter().zip(entries) {
                matrix[(i, j)] = f64::from(*value);
                matrix[(j, i)] = f64::from(*value);
            }
        }
        noise
    }
}

/// From A to the point at which the three translations of these second moments are least, m.
///
/// For the noise of accelerations it is the centre of the accelerometers, each weighted by what
/// its noise does to a rotation: a point of the body that does not depend on A, which is why
/// estimators work there. Zero where there is no rotation.
#[must_use]
pub(crate) fn least_translation(moments: &Matrix6<f64>) -> Vector3<f64> {
    // With t' = t - s x w the power E|t'|² is least where (tr C_ww - C_ww) s = E w x t.
    let c = moments;
    let ww: Matrix3<f64> = c.fixed_view::<3, 3>(3, 3).into();
    let mut normal = Matrix3::identity() * ww.trace() - ww;
    let right = Vector3::new(
        c[(2, 4)] - c[(1, 5)],
        c[(0, 5)] - c[(2, 3)],
        c[(1, 3)] - c[(0, 4)],
    );
    let mut vectors = Matrix3::zeros();
    let values = symmetric_eigen(&mut normal, &mut vectors);
    let mut point = Vector3::zeros();
    for (i, &value) in values.iter().enumerate() {
        // A point on the only axis of rotation is as good as any other on it.
        if value > 1e-9 * values[0] {
            let v = Vector3::from_fn(|j, _| seen(&vectors)[(j, i)]);
            point += v * (v.dot(&right) / value);
        }
    }
    // A motion that is taken for noise couples with the rotations by chance. The distance that
    // this amounts to has nothing to do with that which the other translations show.
    let largest_square = 10.0 * typical(&c.diagonal(), 0) / typical(&c.diagonal(), 3);
    if point.norm_squared() > largest_square {
        return Vector3::zeros();
    }
    point
}

/// The places of the accelerometers, as the noise of the accelerations at A tells them: their middle
/// (m, from A), and the square of their distance from an axis through it (m², mean over the axes that
/// they see turn). The noise of all that look along the same axis is alike: a rotation is held against the two
/// translations across its axis, of which those that are less noisy tell more. Zero where they see no rotation.
#[must_use]
pub fn accelerometer_places(noise: &Matrix6<f64>) -> (Vector3<f64>, f64) {
    let middle = least_translation(noise);
    let mut there = *noise;
    move_accelerations(&mut there, &middle);
    // At the middle what they tell of translation and of rotation is independent.
    let weight = |i: usize| {
        let variance = seen(&there)[(i, i)];
        (variance > 0.0).then(|| 1.0 / variance)
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for axis in 0..3 {
        let across = [weight((axis + 1) % 3), weight((axis + 2) % 3)];
        let told: f64 = across.iter().flatten().sum();
        let seen = across.iter().flatten().count();
        if let Some(turning) = weight(3 + axis)
            && seen > 0
        {
            sum += turning * seen as f64 / told;
            count += 1.0;
        }
    }
    (middle, if count > 0.0 { sum / count } else { 0.0 })
}

/// The middle one of three variances from `first` on, or the largest if not all of them are there.
fn typical(variances: &Vector6<f64>, first: usize) -> f64 {
    let three = variances.fixed_rows::<3>(first);
    let (least, most) = (three.min(), three.max());
    if least > 0.0 {
        three.sum() - least - most
    } else {
        most
    }
}

/// A packed [`ResultantNoise`].
pub type PackedNoise = [f32; 2 * TRIANGLE];

/// Moves a covariance of accelerations where it lies: `u_B = u_A - s x w` on both sides.
pub(crate) fn move_accelerations(covariance: &mut Matrix6<f64>, shift: &Vector3<f64>) {
    on_both_sides(covariance, |[x, y, z, about_x, about_y, about_z]| {
        take_cross([x, y, z], shift, [*about_x, *about_y, *about_z]);
    });
}

/// Moves a covariance of resultants where it lies: the moment loses `s x force` on both sides.
pub(crate) fn move_forces(covariance: &mut Matrix6<f64>, shift: &Vector3<f64>) {
    on_both_sides(covariance, |[x, y, z, about_x, about_y, about_z]| {
        take_cross([about_x, about_y, about_z], shift, [*x, *y, *z]);
    });
}

/// Changes columns, and then rows in the same way.
fn on_both_sides(matrix: &mut Matrix6<f64>, change: impl Fn(&mut [f64; 6])) {
    for _ in 0..2 {
        for column in &mut matrix.data.0 {
            change(column);
        }
        matrix.transpose_mut();
    }
    // To the last bit, whatever rounding made of it.
    for i in 0..6 {
        for j in 0..i {
            let mean = (matrix[(i, j)] + matrix[(j, i)]) * 0.5;
            (matrix[(i, j)], matrix[(j, i)]) = (mean, mean);
        }
    }
}

/// Takes `shift x lever` off.
fn take_cross([x, y, z]: [&mut f64; 3], shift: &Vector3<f64>, lever: [f64; 3]) {
    let [a, b, c] = lever;
    *x -= shift.y * c - shift.z * b;
    *y -= shift.z * a - shift.x * c;
    *z -= shift.x * b - shift.y * a;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{resultants_at, transfer};
    use nalgebra::SMatrix;

    fn six_sensors(about: Vector3<f64>) -> ResultantNoise {
        // Independent readings of x, y, z at three places, each with its own noise.
        let mut noise = ResultantNoise::NONE;
        let places = [[0.3, 0.1, 0.0], [-0.2, 0.4, 0.1], [0.1, -0.3, 0.5]];
        for (k, place) in places.into_iter().enumerate() {
            let at = Vector3::from(place);
            for axis in 0..3 {
                let mut column = [0.0; RESULTANTS];
                let mut force = Vector6::zeros();
                force[axis] = 1.0;
                let moved = resultants_at(&(about - at), &force);
                column[6..].copy_from_slice(moved.as_slice());
                let mut acceleration = Vector6::zeros();
                acceleration[axis] = 1.0;
                acceleration[3 + (axis + k) % 3] = 2.0;
                let moved = transfer(&(about - at)) * acceleration;
                column[..6].copy_from_slice(moved.as_slice());
                noise.add_sensor(&column, 0.1 + k as f64);
            }
        }
        noise
    }

    #[test]
    fn noise_moves_as_what_it_is_the_noise_of() {
        let shift = Vector3::new(0.4, -1.0, 2.0);
        let moved = six_sensors(Vector3::zeros()).at(&shift);
        let there = six_sensors(shift);
        // Some forty products of numbers below 100.
        assert!((moved.acceleration - there.acceleration).norm() < 1e-11);
        assert!((moved.force - there.force).norm() < 1e-11);
    }

    #[test]
    fn the_centre_is_the_same_point_wherever_a_is() {
        let noise = six_sensors(Vector3::zeros());
        let centre = least_translation(&noise.acceleration);
        for shift in [Vector3::new(0.5, 2.0, -1.0), Vector3::new(-40.0, 3.0, 60.0)] {
            let there = shift + least_translation(&noise.at(&shift).acceleration);
            // Powers of 1e4 there, of which what is left is of order one.
            assert!((there - centre).norm() < 1e-10, "{there} {centre}");
        }
        let translation = |at: &Vector3<f64>| {
            let c = noise.at(at).acceleration;
            c[(0, 0)] + c[(1, 1)] + c[(2, 2)]
        };
        for axis in 0..3 {
            for step in [-0.01, 0.01] {
                let mut beside = centre;
                beside[axis] += step;
                assert!(translation(&beside) > translation(&centre));
            }
        }
    }

    /// A heave of the table that is taken for noise, and couples with a pitch by chance: a point
    /// 45 m away would have the least of it, though the other translations are those of sensors
    /// some decimetres apart.
    #[test]
    fn a_motion_that_couples_with_the_rotations_by_chance_moves_no_point() {
        let coupled = |heave_and_pitch: f64| {
            let mut noise =
                Matrix6::from_diagonal(&Vector6::new(1e-6, 1e-6, 1.0, 1e-4, 1e-4, 1e-4));
            noise[(2, 4)] = heave_and_pitch;
            noise[(4, 2)] = heave_and_pitch;
            least_translation(&noise)
        };
        // The point is E w x t over the sum of two variances of rotation, (c / 2e-4, 0, 0), and its
        // square may be up to ten times 1e-6 / 1e-4: 0.316 m.
        assert_eq!(coupled(0.9e-2), Vector3::zeros());
        assert_eq!(coupled(0.64e-4), Vector3::zeros());
        let near = coupled(0.62e-4);
        assert!(
            (near - Vector3::new(0.31, 0.0, 0.0)).norm() < 1e-12,
            "{near}"
        );
    }

    /// Four triaxial accelerometers whose noise is alike, seen from a point far away.
    #[test]
    fn accelerometers_are_found_from_their_noise() {
        let middle = Vector3::new(0.7, -2.0, 1.1);
        let places = [(0.4, 0.0), (0.0, 0.4), (-0.4, 0.0), (0.0, -0.4)];
        let mut information = Matrix6::zeros();
        for (x, y) in places {
            let p = middle + Vector3::new(x, y, 0.0);
            // Rows of a + α x p.
            let rows = SMatrix::<f64, 3, 6>::from_row_slice(&[
                1.0, 0.0, 0.0, 0.0, p.z, -p.y, 0.0, 1.0, 0.0, -p.z, 0.0, p.x, 0.0, 0.0, 1.0, p.y,
                -p.x, 0.0,
            ]);
            information += rows.transpose() * rows;
        }
        let noise = information.try_inverse().unwrap() * 3e-4;
        let (found, square) = accelerometer_places(&noise);
        // Inverted with a condition number of a thousand.
        assert!((found - middle).norm() < 1e-11, "{found}");
        // 0.08 m² about x and y, 0.16 m² about z.
        assert!((square - 0.32 / 3.0).abs() < 1e-11, "{square}");
        // A plane with rotations about y only: 0.08 m².
        let mut plane = Matrix6::zeros();
        for i in [0, 2, 4] {
            for j in [0, 2, 4] {
                plane[(i, j)] = information[(i, j)];
            }
        }
        let plane = plane.pseudo_inverse(1e-9).unwrap() * 3e-4;
        let (found, square) = accelerometer_places(&plane);
        assert!((found.x - middle.x).abs() < 1e-11 && (found.z - middle.z).abs() < 1e-11);
        assert!((square - 0.08).abs() < 1e-11, "{square}");
        // The base moves along x, and the sensors' noise follows what they see: 1e4 times the power along x. About x
        // there are 0.08 m² as before, about y and z 0.16 m², which the sensors along z and y tell.
        let mut unlike = Matrix6::zeros();
        for (x, y) in places {
            let rows = SMatrix::<f64, 3, 6>::from_row_slice(&[
                1e-2,
                0.0,
                0.0,
                0.0,
                0.0,
                -1e-2 * y,
                0.0,
                1.0,
                0.0,
                0.0,
                0.0,
                x,
                0.0,
                0.0,
                1.0,
                y,
                -x,
                0.0,
            ]);
            unlike += rows.transpose() * rows;
        }
        let (found, square) = accelerometer_places(&unlike.try_inverse().unwrap());
        assert!(found.norm() < 1e-11, "{found}");
        assert!((square - 0.4 / 3.0).abs() < 1e-4, "{square}");
    }

    #[test]
    fn packing_keeps_single_precision() {
        let noise = six_sensors(Vector3::zeros());
        let back = ResultantNoise::unpacked(&noise.packed());
        let error = (back.acceleration - noise.acceleration).abs().max();
        assert!(error <= noise.acceleration.abs().max() * f64::from(f32::EPSILON));
        assert!((back.force - noise.force).abs().max() < 1e-5);
    }
}

//! Which directions of base acceleration (or of force) the runs really excite.
//!
//! A direction that carries nothing but noise looks like a small excitation and would
//! turn into ten confident wrong numbers. So every direction is held against the noise
//! of the very channels it comes from, before anything is inverted. Noise is a covariance
//! matrix: directions and their power over noise are those of the pencil (moments, noise),
//! which do not depend on the reference point.

use crate::algebra::{
    inverse_lower, lower, multiply_left, multiply_right, symmetric_eigen, symmetric_values,
};
use crate::cells::cells;
use nalgebra::{ArrayStorage, Matrix6, Vector6};

pub(super) const IDENTITY: Matrix6<f64> = Matrix6::new(
    1.0, 0.0, 0.0, 0.0, 0.0, 0.0, //
    0.0, 1.0, 0.0, 0.0, 0.0, 0.0, //
    0.0, 0.0, 1.0, 0.0, 0.0, 0.0, //
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, //
    0.0, 0.0, 0.0, 0.0, 1.0, 0.0, //
    0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
);
const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

/// Least ratio of the power of an excitation to that of its noise.
///
/// Noise in the accelerations pulls what they multiply towards zero by noise over power,
/// so 100 limits that pull to 1 %. The remaining pull enters the error bars.
pub(crate) const EXCITED: f64 = 100.0;

/// Eigenvalue of the equilibrated noise below which its direction has none: nothing is
/// measured along it. The noise of a run is kept in single precision, so that rounding is 1e-7;
/// sensors within a hundredth of their distance from A leave 1e-5.
const UNSEEN: f64 = 1e-6;

/// The directions that runs excite: their number, and the matrix that takes out of a vector of six
/// all that is not along them. `moments` are the summed real second moments `Σ a aᵀ`, `noise` is
/// the covariance of the noise in them: a direction is excited if its power exceeds a hundred
/// times its noise. A direction without noise has no sensor that looks along it.
#[must_use]
pub fn excited_directions(moments: &Matrix6<f64>, noise: &Matrix6<f64>) -> (usize, Matrix6<f64>) {
    let excitation = Excitation::new(moments, noise);
    (excitation.rank(), excitation.projector())
}

/// The excited directions: a subspace of the six accelerations (or resultants).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excitation {
    /// First [`Self::rank`] columns: directions, in the units of the vector.
    basis: Matrix6<f64>,
    /// First [`Self::rank`] rows: coordinates of a vector along them.
    coordinates: Matrix6<f64>,
    /// Rows from [`Self::rank`] on: coordinates along the other directions that have noise, in units of its
    /// standard deviation.
    others: Matrix6<f64>,
    rank: usize,
    /// Power over noise of the weakest excited direction.
    weakest: f64,
}

impl Excitation {
    /// No direction.
    pub(super) const NONE: Self = Self {
        basis: NO_MATRIX,
        coordinates: NO_MATRIX,
        others: NO_MATRIX,
        rank: 0,
        weakest: f64::INFINITY,
    };

    /// All zero: a place for one.
    pub(super) const ZERO: Self = Self {
        weakest: 0.0,
        ..Self::NONE
    };

    /// Decides from the summed real second moments `Σ a aᵀ` and the covariance of the noise
    /// in them. A direction without noise has no sensor that looks along it.
    pub(super) fn new(moments: &Matrix6<f64>, noise: &Matrix6<f64>) -> Self {
        let mut excitation = Self::NONE;
        excitation.decide(moments, noise);
        excitation
    }

    /// As [`Self::new`], in this place: a small stack has no room for a second one.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn decide(&mut self, moments: &Matrix6<f64>, noise: &Matrix6<f64>) {
        let Self {
            basis,
            coordinates,
            others,
            rank,
            weakest,
        } = self;
        (*rank, *weakest) = (0, f64::INFINITY);
        others.fill(0.0);
        // Until the coordinates are known, the root of the noise lies in their place.
        let whitening = coordinates;
        whiten(noise, whitening);
        let mut ratio = *moments;
        multiply_left(whitening, &mut ratio);
        ratio.transpose_mut();
        multiply_left(whitening, &mut ratio);
        let coordinates = whitening;
        let mut vectors = ratio;
        for j in 0..6 {
            vectors[(j, j)] -= EXCITED;
        }
        if lower(&mut vectors, 6).is_some() {
            // With all six excited any basis will do, and the plain axes cost no rounding.
            *weakest = symmetric_values(&mut ratio)[5];
            *rank = 6;
            basis.copy_from(&IDENTITY);
            coordinates.copy_from(&IDENTITY);
            return;
        }
        let values = symmetric_eigen(&mut ratio, &mut vectors);
        *rank = values.iter().filter(|value| **value > EXCITED).count();
        for (j, (vector, &value)) in vectors.data.0.iter_mut().zip(&values).enumerate() {
            if value > EXCITED {
                *weakest = value;
            } else {
                for (i, x) in vector.iter_mut().enumerate() {
                    cells(others)[(j, i)] = core::mem::take(x);
                }
            }
        }
        multiply_right(others, coordinates);
        // Coordinates along a direction are vᵀ W. The direction is what the moments hold along
        // them, M Wᵀ v, and not what the noise would: where a direction is excited that no noise
        // is known of, the noise has no such component.
        vectors.transpose_mut();
        multiply_left(&vectors, coordinates);
        basis.copy_from(&coordinates.transpose());
        multiply_left(moments, basis);
        for (direction, &value) in basis.data.0.iter_mut().zip(&values).take(*rank) {
            for x in direction {
                *x /= value;
            }
        }
    }

    /// Number of directions that [`Self::new`] would find.
    #[inline(never)] // The directions are off the stack when the caller goes on.
    pub(super) fn rank_of(moments: &Matrix6<f64>, noise: &Matrix6<f64>) -> usize {
        Self::new(moments, noise).rank
    }

    /// The matrix that takes out of a vector of six all that is not along the excited directions.
    #[must_use]
    pub(super) fn projector(&self) -> Matrix6<f64> {
        self.basis * self.coordinates
    }

    /// Number of excited directions.
    pub(super) fn rank(&self) -> usize {
        self.rank
    }

    /// Power over noise of the weakest excited direction; infinite if there is none.
    pub(super) fn weakest(&self) -> f64 {
        self.weakest
    }

    /// Matrix whose first [`Self::rank`] columns turn coordinates into a vector of six.
    pub(super) fn basis(&self) -> &Matrix6<f64> {
        &self.basis
    }

    /// Matrix whose rows from [`Self::rank`] on turn a vector of six into coordinates along the other directions, in
    /// which the noise has the covariance one. A direction without noise has the row zero.
    pub(super) fn others(&self) -> &Matrix6<f64> {
        &self.others
    }

    /// Matrix whose first [`Self::rank`] rows turn a vector of six into coordinates.
    pub(super) fn coordinates(&self) -> &Matrix6<f64> {
        &self.coordinates
    }
}

/// A root W of the inverse of a covariance C, `W C Wᵀ = 1` on the directions that have noise; zero
/// on the others.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
fn whiten(noise: &Matrix6<f64>, whitening: &mut Matrix6<f64>) {
    // In units of its own noise every component is comparable. One that is exactly zero,
    // because no sensor sees it, stays zero.
    let scale: Vector6<f64> = noise.diagonal().map(|n| {
        if n > 0.0 && n.is_finite() {
            libm::sqrt(n)
        } else {
            0.0
        }
    });
    let mut correlation = Matrix6::from_fn(|i, j| {
        let s = scale[i] * scale[j];
        if s > 0.0 { noise[(i, j)] / s } else { 0.0 }
    });
    // Of eigenvalues that add up to six, the least one is at least the determinant over the largest
    // product of the five others, (6/5)⁵ = 2.5. Far from any doubt, Cholesky's root will do.
    let mut vectors = correlation;
    if lower(&mut vectors, 6).is_some() {
        let determinant = vectors.diagonal().product();
        if determinant * determinant > 10.0 * UNSEEN {
            inverse_lower(&mut vectors, 6);
            for j in 0..6 {
                for i in 0..6 {
                    whitening[(i, j)] = vectors[(i, j)] / scale[j];
                }
            }
            return;
        }
    }
    let values = symmetric_eigen(&mut correlation, &mut vectors);
    whitening.fill(0.0);
    for (i, &value) in values.iter().enumerate() {
        if value > UNSEEN {
            let root = libm::sqrt(value);
            for j in 0..6 {
                if scale[j] > 0.0 {
                    whitening[(i, j)] = vectors[(j, i)] / (root * scale[j]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{move_accelerations, transfer};
    use nalgebra::Vector3;

    fn accelerations_moved(covariance: &Matrix6<f64>, shift: &Vector3<f64>) -> Matrix6<f64> {
        let mut moved = *covariance;
        move_accelerations(&mut moved, shift);
        moved
    }

    fn translations() -> Matrix6<f64> {
        let mut m = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 1e-6, 1e-6, 1e-6));
        m[(0, 1)] = 0.3;
        m[(1, 0)] = 0.3;
        m
    }

    #[test]
    fn noise_is_not_an_excitation() {
        let e = Excitation::new(&translations(), &(Matrix6::identity() * 1e-6));
        assert_eq!(e.rank(), 3);
        assert_eq!(e.basis().fixed_rows::<3>(3).norm(), 0.0);
        let back = e.coordinates() * e.basis();
        // Orthonormal in units of noise: the coordinates of the basis are the axes.
        for i in 0..3 {
            for j in 0..3 {
                let expected = f64::from(u8::from(i == j));
                assert!((back[(i, j)] - expected).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn an_unseen_component_is_never_excited() {
        let m = Matrix6::from_diagonal(&Vector6::new(1.0, 0.0, 1.0, 0.0, 1.0, 0.0));
        let noise = Vector6::new(1e-9, 0.0, 1e-9, 0.0, 1e-9, 0.0);
        let e = Excitation::new(&m, &Matrix6::from_diagonal(&noise));
        assert_eq!(e.rank(), 3);
        assert_eq!(e.basis().row(1).norm(), 0.0);
    }

    /// No noise is known of y, which moves half as far as x does: the direction is that of the
    /// motion, and not the x axis along which there is noise.
    #[test]
    fn a_direction_holds_what_moves_with_it_where_no_noise_is_known() {
        let mut moments = Matrix6::zeros();
        for (i, j, moment) in [(0, 0, 1.0), (0, 1, 0.5), (1, 0, 0.5), (1, 1, 0.25)] {
            moments[(i, j)] = moment;
        }
        let mut noise = Matrix6::zeros();
        noise[(0, 0)] = 1e-4;
        let e = Excitation::new(&moments, &noise);
        assert_eq!(e.rank(), 1);
        assert!((e.weakest() / 1e4 - 1.0).abs() < 1e-14, "{}", e.weakest());
        // In units of the noise of x, whose standard deviation is 0.01.
        let direction = e.basis().column(0) * e.basis()[(0, 0)].signum();
        let expected = Vector6::new(0.01, 0.005, 0.0, 0.0, 0.0, 0.0);
        assert!((direction - expected).norm() < 1e-16, "{direction}");
        let moved = e.projector() * Vector6::new(1.0, 0.5, 0.0, 0.0, 0.0, 0.0);
        assert!((moved - Vector6::new(1.0, 0.5, 0.0, 0.0, 0.0, 0.0)).norm() < 1e-14);
    }

    #[test]
    fn what_is_excited_does_not_depend_on_the_reference_point() {
        let moments = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 10.0, 10.0, 10.0));
        let noise = Matrix6::from_diagonal(&Vector6::new(1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2));
        let weak = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 0.1, 0.1, 0.1));
        for d in [0.0, 0.3, 1.0, 3.0, 5.0, 10.0, 60.0] {
            let shift = Vector3::new(0.2 * d, 0.0, d);
            let there = accelerations_moved(&noise, &shift);
            let e = Excitation::new(&accelerations_moved(&moments, &shift), &there);
            assert_eq!(e.rank(), 6, "{d} m");
            // Numbers of up to 60² in both, which cancel.
            assert!(
                (e.weakest() / 1e3 - 1.0).abs() < 1e-6,
                "{d} m: {}",
                e.weakest()
            );
            let e = Excitation::new(&accelerations_moved(&weak, &shift), &there);
            assert_eq!(e.rank(), 3, "{d} m");
            // The excited directions are the translations, at either point.
            let t = transfer(&shift);
            let projector = e.projector();
            let translation = t * Vector6::new(0.3, -1.0, 0.7, 0.0, 0.0, 0.0);
            assert!(
                (projector * translation - translation).norm() < 1e-9,
                "{d} m"
            );
        }
    }
}

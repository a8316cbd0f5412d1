//! Which directions of base acceleration (or of force) the runs really excite.
//!
//! A direction that carries nothing but noise looks like a small excitation and would
//! turn into ten confident wrong numbers. So every direction is held against the noise
//! of the very channels it comes from, before anything is inverted.

use crate::algebra::{multiply_left, symmetric_eigen};
use crate::cells::{cells, seen};
use nalgebra::{ArrayStorage, Matrix3, Matrix6, Vector3, Vector6};

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

/// What an excitation must exceed the noise by, in power, to count as one.
///
/// Noise in the accelerations pulls what they multiply towards zero by noise over power,
/// so 100 bounds that pull to 1 %. What is left of it enters the error bars.
pub const EXCITED: f64 = 100.0;

/// The excited directions: a subspace of the six accelerations (or resultants).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excitation {
    /// First [`Self::rank`] columns: directions, in the units of the vector.
    basis: Matrix6<f64>,
    /// First [`Self::rank`] rows: coordinates of a vector along them.
    coordinates: Matrix6<f64>,
    rank: usize,
    /// Power over noise of the weakest excited direction.
    weakest: f64,
    /// Takes translations and rotations that are nothing but noise out of a vector.
    cleaner: Matrix6<f64>,
}

impl Excitation {
    /// No direction.
    pub(super) const NONE: Self = Self {
        basis: NO_MATRIX,
        coordinates: NO_MATRIX,
        rank: 0,
        weakest: f64::INFINITY,
        cleaner: NO_MATRIX,
    };

    /// All zero: a place for one.
    pub(super) const ZERO: Self = Self {
        weakest: 0.0,
        ..Self::NONE
    };

    /// Decides from the summed real second moments `Σ a aᵀ` and the noise power in each
    /// of their diagonal terms.
    #[must_use]
    pub fn new(moments: &Matrix6<f64>, noise: &Vector6<f64>) -> Self {
        // In units of its own noise every channel is comparable. A channel that is
        // exactly zero, because no sensor sees it, has no noise either and stays zero.
        let scale = noise.map(|n| if n > 0.0 { libm::sqrt(n) } else { 0.0 });
        let mut ratio = Matrix6::from_fn(|i, j| {
            let s = scale[i] * scale[j];
            if s > 0.0 { moments[(i, j)] / s } else { 0.0 }
        });
        // Filled where it lies: three matrices are not moved over the stack.
        let mut excitation = Self::NONE;
        let Self {
            basis,
            coordinates,
            rank,
            weakest,
            cleaner,
        } = &mut excitation;
        for at in [0, 3] {
            let block: Matrix3<f64> = ratio.fixed_view::<3, 3>(at, at).into();
            let units: Vector3<f64> = scale.fixed_rows::<3>(at).into();
            cleaner
                .fixed_view_mut::<3, 3>(at, at)
                .copy_from(&above_noise(block, &units));
        }
        let mut vectors = Matrix6::zeros();
        let values = symmetric_eigen(&mut ratio, &mut vectors);
        let all = values.iter().all(|&v| v > EXCITED);
        let (axes, shares) = (&mut cells(basis), &mut cells(coordinates));
        let (vectors, scale) = (seen(&vectors), seen(&scale));
        for (i, &value) in values.iter().enumerate() {
            if value <= EXCITED {
                continue;
            }
            *weakest = weakest.min(value);
            // With all six excited any basis will do, and the plain axes cost no rounding.
            if all {
                axes[(i, i)] = 1.0;
                shares[(i, i)] = 1.0;
            } else {
                for j in 0..6 {
                    axes[(j, *rank)] = vectors[(j, i)] * scale[j];
                    shares[(*rank, j)] = if scale[j] > 0.0 {
                        vectors[(j, i)] / scale[j]
                    } else {
                        0.0
                    };
                }
            }
            *rank += 1;
        }
        multiply_left(cleaner, basis);
        excitation
    }

    /// Rank and cleaner of [`Self::new`], for those who need no more of it.
    #[inline(never)] // The rest is off the stack when the caller goes on.
    pub(super) fn rank_and_cleaner(
        moments: &Matrix6<f64>,
        noise: &Vector6<f64>,
    ) -> (usize, Matrix6<f64>) {
        let excitation = Self::new(moments, noise);
        (excitation.rank, excitation.cleaner)
    }

    /// Number of excited directions.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Power over noise of the weakest excited direction; infinite if there is none.
    #[must_use]
    pub fn weakest(&self) -> f64 {
        self.weakest
    }

    /// Projector that removes translations, and rotations, that do not rise above noise.
    ///
    /// An excited direction mixes strong components with the chance noise of weak ones.
    /// A rotation that is noise must become exactly zero, or its inertia would count as
    /// observed; the rank rule of the identification then sees what is really there.
    #[must_use]
    pub fn cleaner(&self) -> &Matrix6<f64> {
        &self.cleaner
    }

    /// Matrix whose first [`Self::rank`] columns turn coordinates into a vector of six.
    #[must_use]
    pub fn basis(&self) -> &Matrix6<f64> {
        &self.basis
    }

    /// Matrix whose first [`Self::rank`] rows turn a vector of six into coordinates.
    #[must_use]
    pub fn coordinates(&self) -> &Matrix6<f64> {
        &self.coordinates
    }
}

/// Projector on the directions of three components that rise above noise, where `ratio`
/// is their second moments in units of their noise `units`.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
fn above_noise(mut ratio: Matrix3<f64>, units: &Vector3<f64>) -> Matrix3<f64> {
    let mut vectors = Matrix3::zeros();
    let values = symmetric_eigen(&mut ratio, &mut vectors);
    if values.iter().all(|&v| v > EXCITED) {
        return Matrix3::identity();
    }
    let mut projector = Matrix3::zeros();
    for (i, &value) in values.iter().enumerate() {
        if value > EXCITED {
            let v: Vector3<f64> = vectors.column(i).into();
            projector += v * v.transpose();
        }
    }
    Matrix3::from_fn(|i, j| {
        if units[j] > 0.0 {
            projector[(i, j)] * units[i] / units[j]
        } else {
            0.0
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_not_an_excitation() {
        let mut m = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 1e-6, 1e-6, 1e-6));
        m[(0, 1)] = 0.3;
        m[(1, 0)] = 0.3;
        let e = Excitation::new(&m, &Vector6::repeat(1e-6));
        assert_eq!(e.rank(), 3);
        assert_eq!(e.basis().fixed_rows::<3>(3).norm(), 0.0);
        let back = e.coordinates() * e.basis();
        // Orthonormal in units of noise: the coordinates of the basis are the axes.
        for i in 0..3 {
            for j in 0..3 {
                let expected = f64::from(u8::from(i == j));
                assert!((back[(i, j)] - expected).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn an_unseen_component_is_never_excited() {
        let m = Matrix6::from_diagonal(&Vector6::new(1.0, 0.0, 1.0, 0.0, 1.0, 0.0));
        let noise = Vector6::new(1e-9, 0.0, 1e-9, 0.0, 1e-9, 0.0);
        let e = Excitation::new(&m, &noise);
        assert_eq!(e.rank(), 3);
        assert_eq!(e.basis().row(1).norm(), 0.0);
    }
}

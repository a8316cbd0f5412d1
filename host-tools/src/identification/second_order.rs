//! Second order of the inertia about the centre of gravity.

use nalgebra::{Matrix3, Matrix6};

/// Coordinates of which a term xx, yy, zz, xy, xz, yz of the inertia has products: each moment two squares, each product of
/// inertia one product.
pub(crate) const TERMS: [&[(usize, usize)]; 6] = [
    &[(1, 1), (2, 2)],
    &[(0, 0), (2, 2)],
    &[(0, 0), (1, 1)],
    &[(0, 1)],
    &[(0, 2)],
    &[(1, 2)],
];

/// Second moments that errors of the centre of gravity with the covariance `centre` (m²) add to the inertia about it of a
/// body of this mass (kg), beyond the first order, (kg m²)²: those of its terms of `-m r rᵀ`, by the theorem of Isserlis.
///
/// They are about S alone. The inertia about a fixed point is linear in what a test tells, so that they are to be taken off
/// a covariance before a derivative carries it there.
pub(crate) fn second_order(mass: f64, centre: &Matrix3<f64>) -> Matrix6<f64> {
    let c = |i: usize, j: usize| centre[(i, j)];
    Matrix6::from_fn(|row, column| {
        let mut sum = 0.0;
        for &(p, q) in TERMS[row] {
            for &(k, l) in TERMS[column] {
                sum += c(p, q) * c(k, l) + c(p, k) * c(q, l) + c(p, l) * c(q, k);
            }
        }
        mass * mass * sum
    })
}

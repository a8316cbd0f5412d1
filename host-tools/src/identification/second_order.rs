//! Second order of the error bars of the inertia about the centre of gravity.
//!
//! The covariance that the document states is of the first order, so that a derivative carries it to any point. What errors of
//! the centre of gravity bend the inertia about it by, `m r rᵀ`, is in the standard deviations alone.

use massline_core::identify::Covariance;
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
pub(super) fn second_order(mass: f64, centre: &Matrix3<f64>) -> Matrix6<f64> {
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

/// A covariance of mass (or Δ), centre of gravity and inertia about it with the second order of the inertia, for a body of
/// this mass, kg; what is not observable adds nothing.
pub(crate) fn with_second_order(mass: Option<f64>, covariance: &Covariance) -> Covariance {
    let mut found = *covariance;
    let centre = Matrix3::from_fn(|i, j| covariance[1 + i][1 + j].unwrap_or(0.0));
    let added = second_order(mass.unwrap_or(0.0), &centre);
    for (row, entries) in found[4..].iter_mut().enumerate() {
        for (column, entry) in entries[4..].iter_mut().enumerate() {
            *entry = entry.map(|first| first + added[(row, column)]);
        }
    }
    found
}

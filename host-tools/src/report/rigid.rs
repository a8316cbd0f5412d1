//! The identified body as the mass matrix of equation (1), as far as it is known.

use crate::result::ResultDocument;
use nalgebra::Matrix6;

/// Symbols of the entries of equation (1).
pub(super) const SYMBOLS: [[&str; 6]; 6] = [
    ["m", "", "", "", "m z", "−m y"],
    ["", "m", "", "−m z", "", "m x"],
    ["", "", "m", "m y", "−m x", ""],
    ["", "−m z", "m y", "Θxx", "−Θxy", "−Θxz"],
    ["m z", "", "−m x", "−Θxy", "Θyy", "−Θyz"],
    ["−m y", "m x", "", "−Θxz", "−Θyz", "Θzz"],
];

/// The unit of force component `row` per acceleration component `column`.
pub(super) fn unit(row: usize, column: usize) -> &'static str {
    match (row < 3, column < 3) {
        (true, true) => "kg",
        (false, false) => "kg m²",
        _ => "kg m",
    }
}

/// One entry about the reference point; `None` where a term of it is not observable.
pub(super) fn entry(result: &ResultDocument, row: usize, column: usize) -> Option<f64> {
    let mass = result.mass.value?;
    let first = |axis: usize| {
        let s = result.centre_of_gravity[axis].value?;
        Some(mass * (s - result.reference_point[axis]))
    };
    let inertia = result.inertia_reference.terms().map(|t| t.value);
    let (row, column) = (row.min(column), row.max(column));
    match (row, column) {
        (0, 0) | (1, 1) | (2, 2) => Some(mass),
        (0, 4) => first(2),
        (0, 5) => first(1).map(|v| -v),
        (1, 3) => first(2).map(|v| -v),
        (1, 5) => first(0),
        (2, 3) => first(1),
        (2, 4) => first(0).map(|v| -v),
        (3, 3) | (4, 4) | (5, 5) => inertia[row - 3],
        (3, 4) => inertia[3].map(|v| -v),
        (3, 5) => inertia[4].map(|v| -v),
        (4, 5) => inertia[5].map(|v| -v),
        _ => Some(0.0),
    }
}

/// The whole matrix with zeros for what is not observable: a term is unobservable where
/// nothing multiplies it.
pub(super) fn matrix(result: &ResultDocument) -> Matrix6<f64> {
    Matrix6::from_fn(|row, column| entry(result, row, column).unwrap_or(0.0))
}

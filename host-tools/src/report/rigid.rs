//! The identified body as the mass matrix of equation (1), as far as it is known.

use massline_core::identify::{Estimate, Identification};
use nalgebra::Matrix6;

/// What stands at row i, column j of equation (1).
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
pub(super) fn entry(i: &Identification, row: usize, column: usize) -> Option<f64> {
    let value = |e: Option<Estimate>| e.map(|e| e.value);
    let mass = value(i.mass)?;
    let first = |axis: usize| {
        let s = value(i.centre_of_gravity[axis])?;
        Some(mass * (s - i.reference[axis]))
    };
    let (row, column) = (row.min(column), row.max(column));
    match (row, column) {
        (0, 0) | (1, 1) | (2, 2) => Some(mass),
        (0, 4) => first(2),
        (0, 5) => first(1).map(|v| -v),
        (1, 3) => first(2).map(|v| -v),
        (1, 5) => first(0),
        (2, 3) => first(1),
        (2, 4) => first(0).map(|v| -v),
        (3, 3) | (4, 4) | (5, 5) => value(i.inertia_reference[row - 3]),
        (3, 4) => value(i.inertia_reference[3]).map(|v| -v),
        (3, 5) => value(i.inertia_reference[4]).map(|v| -v),
        (4, 5) => value(i.inertia_reference[5]).map(|v| -v),
        _ => Some(0.0),
    }
}

/// The whole matrix with zeros for what is not observable: a term is unobservable where
/// nothing multiplies it.
pub(super) fn matrix(i: &Identification) -> Matrix6<f64> {
    Matrix6::from_fn(|row, column| entry(i, row, column).unwrap_or(0.0))
}

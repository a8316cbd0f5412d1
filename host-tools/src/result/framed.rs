//! Numbers and covariances in the frame that a setup states.
//!
//! A number along an axis is a sum of those along the axes of the sensors, by the matrices of
//! [`Frame`]. It has a value where every number of its sum has one, and the variance that the
//! covariance of those gives it. Where that is not known (of inertia about A while mass or centre of
//! gravity is not observable, and of a box, which sends none) its standard deviation is the sum of
//! theirs, which no correlation exceeds; a sum of one number has that number's to the last bit.

use crate::frame::Frame;
use crate::identification::{TERMS, TypeB, number as place, with_second_order};
use massline_core::identify::{Covariance, Estimate, Identification};
use massline_core::masslines::FixedMode;
use nalgebra::{Matrix6, SMatrix, SVector, Vector3};

type Matrix10 = SMatrix<f64, 10, 10>;

/// An identification in a frame; `covariance` is that of [`super::CovarianceDocument`].
pub(super) fn identification(
    frame: &Frame,
    i: &Identification,
    covariance: Option<&Covariance>,
) -> Identification {
    let turn = frame.turn();
    let of_inertia = frame.turn_of_inertia();
    let bent = covariance.map(|c| with_second_order(i.mass.map(|mass| mass.value), c));
    let about_s = |j: usize, k: usize| bent?[4 + j][4 + k];
    let about_a = covariance.and_then(|c| covariance_about_a(i, c));
    let centre = sums(&turn, i.centre_of_gravity, |j, k| covariance?[1 + j][1 + k]);
    let shift = turn * Vector3::from(frame.origin);
    let moved = |k: usize| {
        centre[k].map(|e| Estimate {
            value: e.value - shift[k],
            ..e
        })
    };
    let mut found = *i;
    found.reference = frame.point(&i.reference);
    found.centre_of_gravity = std::array::from_fn(moved);
    found.inertia_reference = sums(&of_inertia, i.inertia_reference, |j, k| {
        Some(about_a?[(j, k)])
    });
    found.inertia_cg = sums(&of_inertia, i.inertia_cg, about_s);
    if let Some(principal) = &mut found.principal {
        principal.axes = turn * principal.axes;
    }
    found
}

/// A covariance of mass (or Δ), centre of gravity and inertia about it in a frame.
pub(super) fn covariance(frame: &Frame, matrix: &Covariance) -> Covariance {
    let mut turn = Matrix10::identity();
    turn.fixed_view_mut::<3, 3>(1, 1).copy_from(&frame.turn());
    turn.fixed_view_mut::<6, 6>(4, 4)
        .copy_from(&frame.turn_of_inertia());
    let parts = |row: usize| (0..10).filter(move |k| turn[(row, *k)] != 0.0);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let pairs = parts(i).flat_map(|k| parts(j).map(move |l| (k, l)));
            let products = pairs.map(|(k, l)| Some(turn[(i, k)] * matrix[k][l]? * turn[(j, l)]));
            products.sum()
        })
    })
}

/// Type B uncertainty in a frame: each error moves the numbers by the same sums.
pub(super) fn type_b(frame: &Frame, type_b: &TypeB) -> TypeB {
    let mut found = type_b.clone();
    let shiftless = Frame {
        origin: [0.0; 3],
        ..*frame
    };
    for contribution in &mut found.contributions {
        let numbers = &mut contribution.numbers;
        let at = place::CENTRE;
        let centre = std::array::from_fn(|k| numbers[at + k]);
        numbers[at..at + 3].copy_from_slice(&shiftless.known_point(centre));
        for at in [place::INERTIA_REFERENCE, place::INERTIA_CG] {
            let terms = std::array::from_fn(|k| numbers[at + k]);
            numbers[at..at + 6].copy_from_slice(&frame.known_inertia(terms));
        }
    }
    found
}

/// Effective mass and participation of a mode along and about the axes of a frame; zero, which is how
/// a mode says that a direction is not known, where a part of a direction is not.
pub(super) fn mode(frame: &Frame, mode: &FixedMode) -> FixedMode {
    let turn = six(frame);
    let unknown =
        |i: usize| (0..6).any(|j| turn[(i, j)] != 0.0 && mode.effective_mass[(j, j)] <= 0.0);
    let mut found = FixedMode {
        effective_mass: turn * mode.effective_mass * turn.transpose(),
        participation: turn * mode.participation,
        ..*mode
    };
    for i in (0..6).filter(|i| unknown(*i)) {
        found.effective_mass.fill_row(i, 0.0);
        found.effective_mass.fill_column(i, 0.0);
        found.participation[i] = 0.0;
    }
    found
}

/// Resultants along and about the axes of a frame.
pub(super) fn resultants(frame: &Frame, resultants: [f64; 6]) -> [f64; 6] {
    (six(frame) * SVector::<f64, 6>::from(resultants)).into()
}

/// Matrix that turns forces and moments.
fn six(frame: &Frame) -> Matrix6<f64> {
    let mut turn = Matrix6::zeros();
    for corner in [0, 3] {
        let mut view = turn.fixed_view_mut::<3, 3>(corner, corner);
        view.copy_from(&frame.turn());
    }
    turn
}

/// Sums of estimates by the rows of a matrix, with the covariance of two of them.
fn sums<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    estimates: [Option<Estimate>; N],
    covariance: impl Fn(usize, usize) -> Option<f64>,
) -> [Option<Estimate>; N] {
    std::array::from_fn(|i| {
        let parts: Vec<usize> = (0..N).filter(|j| matrix[(i, *j)] != 0.0).collect();
        let weight = |j: &usize| matrix[(i, *j)];
        let value = parts.iter().map(|j| Some(weight(j) * estimates[*j]?.value));
        let value = value.sum::<Option<f64>>()?;
        let most = parts
            .iter()
            .map(|j| Some(weight(j).abs() * estimates[*j]?.std));
        let most = most.sum::<Option<f64>>()?;
        let products = parts.iter().flat_map(|j| parts.iter().map(move |k| (j, k)));
        let products = products.map(|(j, k)| Some(weight(j) * covariance(*j, *k)? * weight(k)));
        let variance = products.sum::<Option<f64>>().filter(|_| parts.len() > 1);
        let std = variance.map_or(most, |v| v.max(0.0).sqrt());
        Some(Estimate { value, std })
    })
}

/// Covariance of the six terms about A: those about S and `m (r² 1 - r rᵀ)`, by its exact
/// derivative; `None` where one of the ten is not known.
fn covariance_about_a(i: &Identification, covariance: &Covariance) -> Option<Matrix6<f64>> {
    let mass = i.mass?.value;
    let mut r = [0.0; 3];
    for (k, slot) in r.iter_mut().enumerate() {
        *slot = i.centre_of_gravity[k]?.value - i.reference[k];
    }
    let mut jacobian = SMatrix::<f64, 6, 10>::zeros();
    for (row, pairs) in TERMS.into_iter().enumerate() {
        jacobian[(row, 4 + row)] = 1.0;
        for &(p, q) in pairs {
            // A mass that was weighed is exact, and Δ stands in its place.
            if i.indicator.is_none() {
                jacobian[(row, 0)] += r[p] * r[q];
            }
            jacobian[(row, 1 + p)] += mass * r[q];
            jacobian[(row, 1 + q)] += mass * r[p];
        }
    }
    let mut matrix = Matrix10::zeros();
    for (row, entries) in covariance.iter().enumerate() {
        for (column, entry) in entries.iter().enumerate() {
            matrix[(row, column)] = (*entry)?;
        }
    }
    Some(jacobian * matrix * jacobian.transpose())
}

#[cfg(test)]
mod tests;

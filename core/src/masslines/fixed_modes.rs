//! Modes of the fixed structure with their effective masses: the other result that
//! interface forces allow.
//!
//! The apparent mass on a rigid interface is `M₀ + Σ_r L_rᵀ L_r D_r(ω)`. The row L_r is
//! the participation of mode r in the six motions of the base, per square root of its
//! modal mass, and the diagonal of `L_rᵀ L_r` holds the effective masses. Over all modes
//! they add up to the rigid-body mass matrix.

use super::apparent_mass::{Basis, MAX_RUNS, energy, find_fixed_poles};
use super::averaging::noise_of_runs;
use super::regression::{Regression, Solution};
use super::{Lines, MasslineError, Moments, Powers};
use crate::algebra::symmetric_eigen;
use crate::geometry::Equations;
use crate::modes::{MAX_MODES, Pole, PoleSearch, Trace};
use core::ops::Range;
use nalgebra::{Complex, Matrix6, Vector6};

/// A mode of the structure on a fixed interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedMode {
    /// Natural frequency and damping.
    pub pole: Pole,
    /// Effective mass matrix `L_rᵀ L_r` about the reference point: kg, kg m, kg m², ordered
    /// as equation (1). Only what was excited and measured is filled.
    pub effective_mass: Matrix6<f64>,
    /// L_r for unit modal mass: √kg and √kg m.
    pub participation: Vector6<f64>,
    /// Share of the fitted matrix that one row explains; one for a clean mode.
    pub rank_one: f64,
}

/// The modes of the fixed structure in the lines, ascending. The lines `band` judge the
/// excitation, the lines `fit` are fitted. `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`] if nothing is excited or measured; no mode is an empty list.
pub fn fixed_modes<L: Lines + ?Sized>(
    lines: &L,
    band: Range<usize>,
    fit: Range<usize>,
    equations: &Equations,
    work: &mut [Complex<f64>],
) -> Result<heapless::Vec<FixedMode, MAX_MODES>, MasslineError> {
    let start = fit.start;
    let energy = energy(lines, &band, &[1.0; MAX_RUNS]);
    let mut search = PoleSearch::EMPTY;
    let (poles, trace) = find_fixed_poles(lines, &energy, fit, &mut search, work);
    let mut modes = heapless::Vec::new();
    if poles.is_empty() {
        return Ok(modes);
    }
    let mut regression = regress(lines, &band, &energy, start, equations, &poles, &trace)?;
    let count = 2 + poles.len();
    let chosen: heapless::Vec<usize, { 2 + MAX_MODES }> = (0..count).collect();
    let mut solution = Solution::EMPTY;
    regression
        .solve(&chosen, &mut solution)
        .ok_or(MasslineError::Singular)?;
    for (r, pole) in poles.iter().enumerate() {
        let mut raw = Matrix6::zeros();
        regression.coefficient(&solution, 1 + r, &mut raw);
        // A mode has one shape and so one row: what is left over is noise, and in the
        // small terms more of it than signal.
        let (participation, rank_one) = rank_one(&((raw + raw.transpose()) * 0.5));
        let _ = modes.push(FixedMode {
            pole: *pole,
            effective_mass: participation * participation.transpose(),
            participation,
            rank_one,
        });
    }
    Ok(modes)
}

fn regress<L: Lines + ?Sized>(
    lines: &L,
    band: &Range<usize>,
    energy: &Powers,
    start: usize,
    equations: &Equations,
    poles: &[Pole],
    trace: &Trace<'_>,
) -> Result<Regression, MasslineError> {
    let noise = noise_of_runs(lines, band.len()).acceleration;
    let all = start..start + trace.len();
    let basis = Basis::new(lines, poles, &all);
    let terms = basis.terms();
    let mut regression = Regression::EMPTY;
    regression.begin(equations, terms, lines.correlation());
    regression
        .restart(&energy.aa, &noise)
        .ok_or(MasslineError::NoExcitation)?;
    for line in all {
        let mut m = Moments::zero();
        let mut count = 0.0;
        for run in 0..lines.runs() {
            lines.add_moments(run, line, trace.weight(line - start), &mut m);
            count += 2.0 * lines.equations_per_line(run);
        }
        regression.add(&mut m, &basis.at(lines.frequency(line))[..terms], count);
    }
    Ok(regression)
}

/// The row L with `LᵀL` closest to a symmetric matrix, and the share it explains.
///
/// Kilogram and kilogram metre squared mix, so the matrix is equilibrated first.
fn rank_one(matrix: &Matrix6<f64>) -> (Vector6<f64>, f64) {
    let scale = matrix
        .diagonal()
        .map(|d| if d > 0.0 { libm::sqrt(d) } else { 0.0 });
    let mut scaled = Matrix6::from_fn(|i, j| {
        let s = scale[i] * scale[j];
        if s > 0.0 { matrix[(i, j)] / s } else { 0.0 }
    });
    let mut vectors = Matrix6::zeros();
    let values = symmetric_eigen(&mut scaled, &mut vectors);
    let total: f64 = values.iter().map(|v| v.abs()).sum();
    if values[0] <= 0.0 || total <= 0.0 {
        return (Vector6::zeros(), 0.0);
    }
    let root = libm::sqrt(values[0]);
    let mut row = Vector6::from_fn(|i, _| vectors[(i, 0)] * root * scale[i]);
    // A mode has no sense; the largest participation positive makes it unique.
    let weight = Vector6::from_fn(|i, _| vectors[(i, 0)].abs());
    if row[weight.imax()] < 0.0 {
        row = -row;
    }
    (row, values[0] / total)
}

//! Modes of the fixed structure with their effective masses: the other result that
//! interface forces allow.
//!
//! The apparent mass on a rigid interface is `M₀ + Σ_r L_rᵀ L_r D_r(ω)`. The row L_r is
//! the participation of mode r in the six motions of the base, per square root of its
//! modal mass, and the diagonal of `L_rᵀ L_r` holds the effective masses. Over all modes
//! they add up to the rigid-body mass matrix.

use super::averaging::noise_of_runs;
use super::lines::indices;
use super::methods::apparent_mass::{Basis, few_enough, find_fixed_resonances, fixed_trace};
use super::regression::{Regression, Solution};
use super::run_powers::RunPowers;
use super::{Lines, MAX_RUNS, MasslineError, Moments, Powers};
use crate::algebra::symmetric_eigen;
use crate::geometry::Equations;
use crate::modes::{MAX_MODES, Pole, PoleSearch, Trace};
use crate::spectra::LineRange;
use core::ops::Range;
use nalgebra::{Complex, Matrix6, Vector6};

mod close_modes;

use close_modes::{CLOSE, Neighbourhood};

/// Most modes of the fixed structure: behind each pole up to three.
pub(crate) const MAX_FIXED_MODES: usize = CLOSE * MAX_MODES;

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
    /// Share of the fitted matrix that one row explains, or that the rows of modes explain
    /// which lie together; one for clean modes.
    pub rank_one: f64,
}

impl FixedMode {
    pub(super) fn new(pole: Pole, participation: Vector6<f64>, rank_one: f64) -> Self {
        Self {
            pole,
            effective_mass: participation * participation.transpose(),
            participation,
            rank_one,
        }
    }
}

/// The modes of the fixed structure in the lines, ascending. The lines `band` judge the
/// excitation, the lines `fit` are fitted. `work` holds two elements per line.
///
/// Modes that lie closer than a scalar sum over all motions can tell come apart where their
/// rows are independent and the runs drive all directions at once, line by line: the pairs of
/// an axisymmetric structure, even at one frequency.
///
/// # Errors
/// [`MasslineError`] if nothing is excited or measured, and among them
/// [`MasslineError::OtherLines`], [`MasslineError::Work`] and [`MasslineError::TooManyRuns`];
/// no mode is an empty list.
pub fn fixed_modes<L: Lines + ?Sized>(
    lines: &L,
    band: LineRange,
    fit: LineRange,
    equations: &Equations,
    work: &mut [Complex<f64>],
) -> Result<heapless::Vec<FixedMode, MAX_FIXED_MODES>, MasslineError> {
    let (band, fit) = (indices(lines, band)?, indices(lines, fit)?);
    few_enough(lines)?;
    let energy = RunPowers::EMPTY.weighted(lines, &band, &[1.0; MAX_RUNS]);
    let mut search = PoleSearch::EMPTY;
    let found = find_fixed_resonances(lines, &energy, fit.clone(), &mut search, work)?;
    let poles = found.poles();
    // The modes behind each pole; first as if it were one each.
    let mut behind: heapless::Vec<heapless::Vec<FixedMode, CLOSE>, MAX_MODES> =
        poles.iter().map(|_| heapless::Vec::new()).collect();
    if poles.is_empty() {
        return Ok(heapless::Vec::new());
    }
    // Twice: the second time with better neighbours.
    for _ in 0..2 {
        let close = |of: &heapless::Vec<FixedMode, CLOSE>| of.len() > 1;
        let apart = together(behind.iter().filter(|of| close(of)));
        let left: heapless::Vec<Pole, MAX_MODES> = poles
            .iter()
            .zip(&behind)
            .filter(|(_, of)| !close(of))
            .map(|(pole, _)| *pole)
            .collect();
        let trace = fixed_trace(lines, &energy, fit.clone(), work)?;
        let start = fit.start;
        let mut regression = regress(
            lines, &band, &energy, start, equations, &left, &apart, &trace,
        )?;
        let chosen: heapless::Vec<usize, { 2 + MAX_MODES }> = (0..2 + left.len()).collect();
        let mut solution = Solution::EMPTY;
        regression
            .solve(&chosen, &mut solution)
            .ok_or(MasslineError::Singular)?;
        let mut rigid = Matrix6::zeros();
        regression.coefficient(&solution, 0, &mut rigid);
        let mut term = 0;
        for (pole, of) in poles.iter().zip(&mut behind) {
            if close(of) {
                continue;
            }
            term += 1;
            let mut raw = Matrix6::zeros();
            regression.coefficient(&solution, term, &mut raw);
            // A mode has one shape and so one row: what is left over is noise, and in the
            // small terms more of it than signal.
            let (participation, rank_one) =
                rank_one(&((raw + raw.transpose()) * 0.5), &rigid.diagonal());
            of.clear();
            let _ = of.push(FixedMode::new(*pole, participation, rank_one));
        }
        let neighbourhood = Neighbourhood {
            lines,
            fit: fit.clone(),
            excitation: regression.excitation(),
            equations,
        };
        for (k, pole) in poles.iter().enumerate() {
            let neighbours = behind.iter().enumerate().filter(|(other, _)| *other != k);
            let others = together(neighbours.map(|(_, of)| of));
            let split = neighbourhood.split(pole, &others, &mut search, work)?;
            if let (Some(split), Some(of)) = (split, behind.get_mut(k)) {
                *of = split;
            }
        }
    }
    let mut modes = together(behind.iter());
    modes.sort_unstable_by(|a, b| a.pole.frequency.total_cmp(&b.pole.frequency));
    Ok(modes)
}

fn together<'m>(
    lists: impl Iterator<Item = &'m heapless::Vec<FixedMode, CLOSE>>,
) -> heapless::Vec<FixedMode, MAX_FIXED_MODES> {
    lists.flatten().copied().collect()
}

#[allow(clippy::too_many_arguments)] // What a regression is made of.
fn regress<L: Lines + ?Sized>(
    lines: &L,
    band: &Range<usize>,
    energy: &Powers,
    start: usize,
    equations: &Equations,
    poles: &[Pole],
    apart: &[FixedMode],
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
        let frequency = lines.frequency(line);
        take_out(apart, frequency, &mut m);
        regression.add(&m, &basis.at(frequency)[..terms], count);
    }
    regression.turn(None);
    Ok(regression)
}

/// Takes the forces of known modes out of the moments of a line.
fn take_out(modes: &[FixedMode], frequency: f64, m: &mut Moments) {
    for mode in modes {
        let d = mode.pole.amplification(frequency);
        let mass = mode.effective_mass.map(|x| d * x);
        let (force, acceleration) = (mass * m.fa.adjoint(), mass * m.aa);
        // Of (f - M a)(f - M a)*, the parts that have M in them.
        let both = acceleration * mass.adjoint();
        m.ff += both - force - force.adjoint();
        m.fa -= acceleration;
    }
}

/// A row with the sense that makes it unique, since a mode has none: its largest entry,
/// kilogram and kilogram metre squared aside, is positive.
pub(super) fn row_of(row: Vector6<f64>) -> Vector6<f64> {
    if row[row.iamax()] < 0.0 { -row } else { row }
}

/// The row L with `LᵀL` closest to a symmetric matrix, and the share it explains.
///
/// Kilogram and kilogram metre squared mix, so the matrix is taken in units of the rigid
/// body's own: in its own units, directions in which it is nothing but noise would count as
/// much as the others.
fn rank_one(matrix: &Matrix6<f64>, rigid: &Vector6<f64>) -> (Vector6<f64>, f64) {
    let scale = rigid.map(|d| libm::sqrt(d.abs()));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modes::Pole;

    /// Forces of a rigid mass and two modes; without the modes those of the mass are left.
    #[test]
    fn taking_modes_out_leaves_the_rigid_body() {
        let mode = |frequency, row: [f64; 6]| {
            let damping = 0.03;
            FixedMode::new(Pole { frequency, damping }, row.into(), 1.0)
        };
        let modes = [
            mode(20.0, [2.0, 0.0, 1.0, 0.0, 3.0, 0.5]),
            mode(31.0, [0.0, 1.5, 0.0, -2.0, 0.3, 1.0]),
        ];
        let rigid = Matrix6::from_fn(|i, j| 10.0 / (1.0 + i as f64 + j as f64));
        let (mut all, mut without) = (Moments::zero(), Moments::zero());
        for run in 0..3 {
            let z = |k: usize| {
                let x = (7 * run + k) as f64;
                Complex::new(libm::sin(x), libm::cos(2.0 * x))
            };
            let a = Vector6::from_fn(|k, _| z(k));
            let rigid = rigid.map(|x| Complex::new(x, 0.0)) * a;
            let mut f = rigid;
            for mode in &modes {
                let d = mode.pole.amplification(24.0);
                f += mode.effective_mass.map(|x| d * x) * a;
            }
            all.add_pair(&a, &f, 0.7);
            without.add_pair(&a, &rigid, 0.7);
        }
        take_out(&modes, 24.0, &mut all);
        // Products of numbers up to 30, some dozen roundings each.
        assert!((all.ff - without.ff).norm() < 1e-10);
        assert!((all.fa - without.fa).norm() < 1e-11);
        assert_eq!(all.aa, without.aa);
    }
}

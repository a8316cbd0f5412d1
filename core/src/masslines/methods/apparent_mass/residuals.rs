//! Residuals of a fit of the apparent mass in each run, and their consequences: weights of runs
//! whose noise differs, and variances of the pairs.

use super::{Basis, Fit};
use crate::algebra::not_negative;
use crate::geometry::transfer;
use crate::masslines::driven::{COLUMNS, Columns, MAX_TERMS};
use crate::masslines::regression::{SIZE, between};
use crate::masslines::run_powers::RunPowers;
use crate::masslines::{Complex6, Lines, MAX_RUNS, Massline, Moments};
use core::ops::Range;
use nalgebra::{ArrayStorage, Complex, Matrix6, Vector3, Vector6};

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));
const NO_MODEL: Complex6 =
    Complex6::from_array_storage(ArrayStorage([[Complex::new(0.0, 0.0); 6]; 6]));

/// Residuals of a fit in each run.
#[derive(Clone, Debug)]
pub(in crate::masslines) struct Residuals {
    /// Powers of each run over the averaging band.
    pub(in crate::masslines) powers: RunPowers,
    /// Power of each measured equation per independent complex line of each run, in units
    /// of the pooled residual.
    left: [Vector6<f64>; MAX_RUNS],
}

impl Residuals {
    /// None yet.
    pub(in crate::masslines) const EMPTY: Self = Self {
        powers: RunPowers::EMPTY,
        left: [Vector6::from_array_storage(ArrayStorage([[0.0; 6]])); MAX_RUNS],
    };
}

impl Fit<'_, '_> {
    /// Finds what the fit leaves in each run. `lines` may be about another point than the fit,
    /// which lies `shift` (m) away from theirs: it is the model that is moved, since that is
    /// done once.
    #[inline(never)]
    pub(in crate::masslines) fn find_residuals<L: Lines + ?Sized>(
        &mut self,
        lines: &L,
        shift: &Vector3<f64>,
        band: &Range<usize>,
        basis: &Basis,
    ) {
        let left = &mut self.residuals.left;
        left.fill(Vector6::zeros());
        let Some(whitened) = self.regression.whitened(self.solution) else {
            return;
        };
        // What each chosen term is multiplied with, in whitened equations.
        let models = self.candidate.spent();
        let mut equations = *whitened.rows();
        let moved = transfer(shift).transpose();
        move_equations(&mut equations, shift);
        for (t, stored) in models.iter_mut().enumerate().take(basis.terms()) {
            let mut model = NO_MATRIX;
            self.regression.coefficient(self.solution, t, &mut model);
            between(whitened.rows(), &mut model, &moved);
            for (stored, x) in stored.iter_mut().zip(&model) {
                *stored = *x;
            }
        }
        let models = models.get(..basis.terms()).unwrap_or(&[]);
        let left = left.get_mut(..self.runs).unwrap_or_default();
        let has = |t: usize| self.solution.has(t);
        let done = self
            .columns
            .as_ref()
            .and_then(|columns| in_single(columns, &equations, models, basis, lines, &has, left));
        if done.is_none() {
            left.fill(Vector6::zeros());
            line_by_line(lines, band, &equations, models, basis, &has, left);
        }
        for (run, left) in left.iter_mut().enumerate() {
            *left /= (lines.equations_per_line(run) * band.len() as f64).max(1.0);
        }
    }

    /// Weighs each run with its inverse residual power.
    #[inline(never)]
    pub(in crate::masslines) fn weigh_runs<L: Lines + ?Sized>(
        &mut self,
        lines: &L,
        shift: &Vector3<f64>,
        band: &Range<usize>,
        basis: &Basis,
    ) {
        self.find_residuals(lines, shift, band, basis);
        let left = self.residuals.left.iter().take(self.runs).map(Vector6::sum);
        let mean = left.clone().sum::<f64>() / self.runs as f64;
        if mean > 0.0 {
            for (weight, left) in self.weights.iter_mut().zip(left) {
                // A run is never trusted a thousand times more than the average one.
                *weight = mean / left.max(1e-3 * mean);
            }
        }
    }

    /// Spreads the variance of the pairs' equations where runs differ in their noise: each
    /// pair has that of the runs which excite its direction, in their shares of its power.
    #[inline(never)]
    pub(in crate::masslines) fn spread<L: Lines + ?Sized>(
        &self,
        lines: &L,
        band: &Range<usize>,
        pairs: &mut [Massline],
    ) {
        let to_pairs = self.regression.to_pairs(self.solution);
        let mut variance = [Vector6::zeros(); 6];
        let mut total = [0.0; 6];
        let mut mean = Vector6::zeros();
        let mut counted = 0.0;
        for (run, (weight, left)) in self
            .weights
            .iter()
            .zip(&self.residuals.left)
            .enumerate()
            .take(self.runs)
        {
            let powers = self.residuals.powers.of(lines, band, run);
            let share = self.regression.powers(&to_pairs, &powers.aa);
            let share = share.map(|share| share * *weight);
            for ((variance, total), share) in variance.iter_mut().zip(&mut total).zip(share) {
                *variance += left * (share * *weight);
                *total += share;
            }
            let lines_of_run = lines.equations_per_line(run);
            mean += left * (lines_of_run * *weight);
            counted += lines_of_run;
        }
        // In units of the pooled residual, whose degrees of freedom are taken off already.
        for ((pair, variance), total) in pairs.iter_mut().zip(&variance).zip(total) {
            for j in 0..6 {
                let pooled = mean[j] * total;
                pair.variance[j] *= if pooled > 0.0 {
                    variance[j] * counted / pooled
                } else {
                    1.0
                };
            }
        }
    }
}

/// Makes rows that take resultants about a point take those about the point from which that one
/// lies `shift` (m) away.
fn move_equations(rows: &mut Matrix6<f64>, shift: &Vector3<f64>) {
    // r·f_B is r·f_A less the moment r_m·(s x force), which is force·(r_m x s).
    for mut row in rows.row_iter_mut() {
        let lever = Vector3::new(row[3], row[4], row[5]);
        let lost = lever.cross(shift);
        row[0] -= lost.x;
        row[1] -= lost.y;
        row[2] -= lost.z;
    }
}

/// Sums of [`residual`] over the lines of each run.
#[inline(never)] // Its model is on the stack only where it is needed.
fn line_by_line<L: Lines + ?Sized>(
    lines: &L,
    band: &Range<usize>,
    equations: &Matrix6<f64>,
    models: &[[f64; SIZE]],
    basis: &Basis,
    has: &dyn Fn(usize) -> bool,
    left: &mut [Vector6<f64>],
) {
    for line in band.clone() {
        let phi = basis.at(lines.frequency(line));
        let mut model = NO_MODEL;
        for (t, (m, phi)) in models.iter().zip(&phi).enumerate() {
            if !has(t) {
                continue;
            }
            // The first term is one, others are real.
            for (sum, x) in model.iter_mut().zip(m) {
                sum.re += if t == 0 { *x } else { phi.re * x };
            }
            if phi.im != 0.0 {
                for (sum, x) in model.iter_mut().zip(m) {
                    sum.im += phi.im * x;
                }
            }
        }
        for (run, left) in left.iter_mut().enumerate() {
            *left += residual(lines, run, line, equations, &model);
        }
    }
}

/// As [`line_by_line`], in single precision: what is lost is the rounding of the spectra. `None`
/// where that has no room.
#[inline(never)] // Its coefficients are on the stack only where they are needed.
fn in_single<L: Lines + ?Sized>(
    columns: &Columns<'_>,
    equations: &Matrix6<f64>,
    models: &[[f64; SIZE]],
    basis: &Basis,
    lines: &L,
    has: &dyn Fn(usize) -> bool,
    left: &mut [Vector6<f64>],
) -> Option<()> {
    // Terms that were not chosen have no part.
    let chosen: heapless::Vec<usize, MAX_TERMS> = (0..models.len()).filter(|t| has(*t)).collect();
    let mut rows = [[0.0; COLUMNS]; 6];
    for (j, row) in rows.iter_mut().enumerate() {
        let (of_forces, of_terms) = row.split_at_mut(6);
        for (to, from) in of_forces.iter_mut().zip(equations.row(j).iter()) {
            *to = *from as f32;
        }
        let models = chosen.iter().filter_map(|t| models.get(*t));
        for (to, model) in of_terms.chunks_exact_mut(6).zip(models) {
            // Matrices lie column after column.
            for (to, from) in to.iter_mut().zip(model.iter().skip(j).step_by(6)) {
                *to = -(*from as f32);
            }
        }
    }
    let all = basis.functions(lines);
    let functions = |line: usize| {
        let phi = all(line);
        let of_term = |k: usize| chosen.get(k).and_then(|t| phi.get(*t)).copied();
        core::array::from_fn(|k| of_term(k).unwrap_or_default())
    };
    columns.powers_of(&functions, chosen.len(), &rows, left)
}

/// Power that `model`, the apparent mass in the equations with the rows `e`, leaves in each of
/// them for one run at one line.
fn residual<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    e: &Matrix6<f64>,
    model: &Matrix6<Complex<f64>>,
) -> Vector6<f64> {
    if let Some((a, f)) = lines.pair(run, line) {
        let weight = lines.pair_weight(run, line);
        return Vector6::from_fn(|j, _| {
            let mut left = Complex::new(0.0, 0.0);
            for i in 0..6 {
                // Half of the whitened rows are zero, and often all beside the diagonal.
                if e[(j, i)] != 0.0 {
                    left += f[i] * e[(j, i)];
                }
                left -= model[(j, i)] * a[i];
            }
            left.norm_sqr() * weight
        });
    }
    residual_of_moments(lines, run, line, e, model)
}

/// As [`residual`], from the moments of a run that was not referred to a drive.
#[inline(never)] // Its moments are on the stack only where they are needed.
fn residual_of_moments<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    e: &Matrix6<f64>,
    model: &Matrix6<Complex<f64>>,
) -> Vector6<f64> {
    let mut m = Moments::zero();
    lines.add_moments(run, line, 1.0, &mut m);
    Vector6::from_fn(|j, _| {
        let mut left = 0.0;
        for i in 0..6 {
            let (mut force, mut both) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
            for k in 0..6 {
                let (e, model) = (e[(j, k)], model[(j, k)].conj());
                force += m.ff[(i, k)] * e - m.fa[(i, k)] * model;
                both += m.fa[(k, i)].conj() * e - m.aa[(i, k)] * model;
            }
            left += e[(j, i)] * force.re - (model[(j, i)] * both).re;
        }
        not_negative(left)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masslines::DriveLines;
    use crate::masslines::lines::Internals;
    use crate::masslines::samples::{LINES, RUNS, Samples, weights};
    use crate::modes::Pole;
    use crate::spectra::{Complex32, Window};

    /// Terms that leave a hundred-thousandth of the forces.
    #[test]
    fn single_precision_leaves_what_double_precision_leaves() {
        let mut samples = Samples::new();
        for run in &mut samples.responses {
            // One line a thousand times as large would hide what the others leave.
            run[7] = run[8];
        }
        let models: [Matrix6<f64>; 3] = [3.0, 1.0, -2.0]
            .map(|size| Matrix6::from_fn(|i, j| (((i * 5 + j * 3) % 7) as f64 - 2.5) * size));
        let poles = [Pole {
            frequency: 9.0,
            damping: 0.02,
        }];
        let accelerations = samples.responses;
        {
            let runs = samples.runs();
            let lines = DriveLines::new(&runs, Window::Hann).unwrap();
            let basis = Basis::new(&lines, &poles, &(0..LINES));
            let mut forces = accelerations;
            for (run, of_run) in forces.iter_mut().enumerate() {
                for (line, amplitudes) in of_run.iter_mut().enumerate() {
                    let (a, _) = lines.pair(run, line).unwrap();
                    let phi = basis.at(lines.frequency(line));
                    for i in 0..6 {
                        let terms = phi.iter().zip(&models);
                        let entry = |j: usize| -> Complex<f64> {
                            terms.clone().map(|(phi, m)| phi * m[(i, j)]).sum()
                        };
                        let off = 1.0 + 1e-5 * ((run + 3 * line + i) % 5) as f64;
                        let f = (0..6).map(|j| entry(j) * a[j]).sum::<Complex<f64>>() * off;
                        amplitudes[6 + i] = Complex32::new(f.re as f32, f.im as f32);
                    }
                }
            }
            samples.responses = forces;
        }
        let runs = samples.runs();
        let lines = DriveLines::new(&runs, Window::Hann).unwrap();
        let basis = Basis::new(&lines, &poles, &(0..LINES));
        let stored: [[f64; SIZE]; 3] = core::array::from_fn(|t| {
            core::array::from_fn(|k| models[t].as_slice().get(k).copied().unwrap_or(0.0))
        });
        let band = 0..LINES;
        let equations = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 1.0, 1.0, 1.0));
        let functions = basis.functions(&lines);
        let driven = lines.driven().unwrap();
        let columns = Columns::new(
            driven,
            &weights(),
            0..RUNS,
            &band,
            basis.terms(),
            &functions,
        )
        .unwrap();
        // All terms, and without each of the last two: those behind a term that was not chosen move up.
        for without in [usize::MAX, 1, 2] {
            let has = |t: usize| t != without;
            let mut expected = [Vector6::zeros(); RUNS];
            line_by_line(
                &lines,
                &band,
                &equations,
                &stored,
                &basis,
                &has,
                &mut expected,
            );
            let mut found = [Vector6::zeros(); RUNS];
            in_single(
                &columns, &equations, &stored, &basis, &lines, &has, &mut found,
            )
            .unwrap();
            for (run, (found, expected)) in found.iter().zip(&expected).enumerate() {
                for j in 0..6 {
                    // Of the power of the forces 1e-10 are left, and 1e-14 are rounding: a hundredth
                    // of the amplitude.
                    let ratio = found[j] / expected[j];
                    assert!(
                        (ratio - 1.0).abs() < 0.02,
                        "without {without}, run {run}, equation {j}: {ratio}"
                    );
                }
            }
        }
    }
}

//! How far a fault contradicts exact data: what no examination can see is told apart beforehand.
//!
//! The test is that of the draw without elasticity, noise and differences of sensors: exact readings of
//! a rigid body on the table that moves. From them and the set-up with its fault, the table's motion is
//! solved for run by run, then one body for all runs, by linear least squares. Weights are the noise of
//! the draw, as averaging over the band leaves it, and the usual differences of sensors. The sum of
//! squares that is left is the trace of the fault; without a fault it is zero. Nothing here is shared
//! with the detective.

use super::spoil::{At, Spoilt, channels};
use crate::setup::Setup;
use crate::simulate::{motion_row, mounting, responses};
use crate::study::plans::tell::rows;
use crate::study::trial::Trial;
use massline_core::geometry::Quantity;
use nalgebra::{Complex, DMatrix, DVector, Matrix6, Vector3, Vector6};

/// Trace below which a fault cannot be told: of two thousand faults that are looked for, chance alone
/// gains 2 ln 2000 = 15 for one of them, and as much again is asked for to be sure.
pub(super) const LIMIT: f64 = 30.0;

/// Usual differences of sensors: gain; direction, rad; position, m.
const DIFFERENCES: [f64; 3] = [0.005, 0.0087, 0.001];

/// Rounding of what is solved for, relative.
const ROUNDING: f64 = 1e-9;

/// A set-up's row of a channel in the frame of its table, in a run with this mounting.
fn row(at: &At, quantity: Option<Quantity>, carry: &Matrix6<f64>) -> Vector6<f64> {
    if quantity == Some(Quantity::Moment) {
        let d = at.direction;
        return Vector6::new(0.0, 0.0, 0.0, d.x, d.y, d.z);
    }
    let row = motion_row(&at.position, &at.direction);
    let row = Vector6::from_fn(|i, _| row[i]);
    if at.structure {
        carry.tr_mul(&row)
    } else {
        row
    }
}

/// The data of a test as they are, without noise.
fn exact(clean: &Trial, run: usize, frequency: f64) -> Vec<Complex<f64>> {
    let mut model = clean.model().clone();
    model.specimen.modes.clear();
    model
        .accelerometers
        .iter_mut()
        .for_each(|a| a.shape.clear());
    let seed = clean.seed();
    responses(&model, run, seed, &[frequency])
        .pop()
        .unwrap_or_default()
}

/// Sum of squares by which exact data contradict the set-up with a fault.
pub(super) fn contradiction(clean: &Trial, level: f64, fault: &Spoilt) -> f64 {
    let model = clean.model();
    let m = &model.measurement;
    let [low, high] = m.averaging_band;
    // A delay shows most at the top of the band, and counts as its mean square there.
    let (turn, frequency) = match fault {
        Spoilt::Delayed(_, samples) => {
            let late = *samples as f64 / m.sample_rate;
            let rms = ((high.powi(3) - low.powi(3)) / (3.0 * (high - low))).sqrt();
            (-std::f64::consts::TAU * rms * late, 0.5 * (low + high))
        }
        _ => (0.0, 0.5 * (low + high)),
    };
    let truth = true_setup(clean);
    let mut faulty = truth.clone();
    fault.misstate(&mut faulty);
    let noise = clean.noise(level);
    let averaged = 0.45 / (m.duration * (high - low));
    let sensors = faulty.accelerometers.len();
    let all = channels(&faulty);
    let quantity = |c: usize| (c >= sensors).then(|| faulty.load_cells[c - sensors].quantity);
    let scale = |c: usize| match faulty.accelerometers.get(c) {
        Some(a) => a.scale,
        None => faulty.load_cells[c - sensors].scale,
    };
    let mut left = 0.0;
    let mut design: Vec<[f64; 10]> = Vec::new();
    let mut target: Vec<f64> = Vec::new();
    for (number, plan) in model.runs.iter().enumerate() {
        let carry = mounting(&plan.rotation, &plan.translation);
        let mut y = exact(clean, number, frequency);
        match fault {
            Spoilt::Swapped([a, b]) => y.swap(*a, *b),
            Spoilt::Dead(c) => y[*c] = Complex::default(),
            Spoilt::Delayed(late, _) => late
                .iter()
                .for_each(|&c| y[c] *= Complex::from_polar(1.0, turn)),
            _ => {}
        }
        y.iter_mut().enumerate().for_each(|(c, y)| *y *= scale(c));
        let power = |cells: bool| {
            let mut sum = (0.0, 0.0);
            for (_, y) in all.iter().zip(&y).filter(|(at, _)| at.cell == cells) {
                sum = (sum.0 + y.norm_sqr(), sum.1 + 1.0);
            }
            3.0 * sum.0 / f64::max(sum.1, 1.0)
        };
        let levels = [power(false), power(true)];
        // Once to learn how far the table turns, once with that.
        let mut motion = [Vector6::<f64>::zeros(), Vector6::zeros()];
        let mut spread = DMatrix::<f64>::zeros(6, 6);
        for pass in 0..2 {
            let turning = motion
                .iter()
                .map(|a| a.fixed_rows::<3>(3).norm_squared())
                .sum::<f64>();
            let variance = |c: usize| {
                let own = noise[c] * scale(c);
                let [gain, direction, shift] = DIFFERENCES;
                let turned = direction * direction * levels[usize::from(all[c].cell)];
                let moved = if pass > 0 {
                    shift * shift * turning
                } else {
                    0.0
                };
                own * own * averaged + gain * gain * y[c].norm_sqr() + turned + moved
            };
            let v: Vec<f64> = (0..sensors).map(variance).collect();
            let a = DMatrix::from_fn(sensors, 6, |c, j| {
                row(&all[c], None, &carry)[j] / v[c].sqrt()
            });
            let Ok(inverse) = a.clone().pseudo_inverse(ROUNDING * a.norm()) else {
                return 0.0;
            };
            let mut rest = 0.0;
            for (part, motion) in motion.iter_mut().enumerate() {
                let b = DVector::from_fn(sensors, |c, _| [y[c].re, y[c].im][part] / v[c].sqrt());
                let solved = &inverse * &b;
                rest += (b - &a * &solved).norm_squared();
                *motion = Vector6::from_fn(|i, _| solved[i]);
            }
            spread = &inverse * inverse.transpose();
            if pass > 0 {
                left += rest;
            }
        }
        // The balance of forces: six resultants, of which the load cells measure some.
        let cells: Vec<usize> = (sensors..all.len()).collect();
        let x = DMatrix::from_fn(6, cells.len(), |i, k| {
            row(&all[cells[k]], quantity(cells[k]), &carry)[i]
        });
        let truth = channels(&truth);
        let true_x = DMatrix::from_fn(6, cells.len(), |i, k| {
            row(&truth[cells[k]], quantity(cells[k]), &carry)[i]
        });
        let measured = true_x.clone().svd(true, false);
        let Some(u) = measured.u else { return 0.0 };
        let count = measured
            .singular_values
            .iter()
            .filter(|s| **s > 1e-6 * measured.singular_values.max())
            .count();
        let select = u.columns(0, count).transpose();
        let mut covariance = DMatrix::<f64>::zeros(6, 6);
        for (k, &c) in cells.iter().enumerate() {
            let own = noise[c] * scale(c);
            let [gain, direction, shift] = DIFFERENCES;
            let v = own * own * averaged
                + gain * gain * y[c].norm_sqr()
                + direction * direction * levels[1];
            covariance += x.column(k) * x.column(k).transpose() * v;
            if quantity(c) == Some(Quantity::Force) {
                for axis in 0..3 {
                    let moment = Vector3::ith(axis, 1.0).cross(&all[c].direction);
                    let x = DVector::from_vec(vec![0.0, 0.0, 0.0, moment.x, moment.y, moment.z]);
                    covariance += &x * x.transpose() * (shift * shift * y[c].norm_sqr());
                }
            }
        }
        let body = carry.tr_mul(&model.specimen.mass_matrix) * carry;
        let body = DMatrix::from_fn(6, 6, |i, j| body[(i, j)]);
        covariance += &body * &spread * body.transpose();
        let covariance = &select * covariance * select.transpose();
        let floor = ROUNDING * covariance.trace();
        let covariance = covariance + DMatrix::identity(count, count) * floor;
        let Some(factor) = covariance.cholesky() else {
            return 0.0;
        };
        for (part, motion) in motion.iter().enumerate() {
            let force =
                &x * DVector::from_fn(cells.len(), |k, _| [y[cells[k]].re, y[cells[k]].im][part]);
            let back = carry.transpose();
            let lines = back * rows(&(carry * motion));
            let lines = &select * DMatrix::from_fn(6, 10, |i, p| lines[(i, p)]);
            let (Some(lines), Some(force)) = (
                factor.l().solve_lower_triangular(&lines),
                factor.l().solve_lower_triangular(&(&select * force)),
            ) else {
                return 0.0;
            };
            for i in 0..count {
                design.push(std::array::from_fn(|p| lines[(i, p)]));
                target.push(force[i]);
            }
        }
    }
    let lengths: [f64; 10] = std::array::from_fn(|p| {
        design
            .iter()
            .map(|row| row[p] * row[p])
            .sum::<f64>()
            .sqrt()
            .max(f64::MIN_POSITIVE)
    });
    let design = DMatrix::from_fn(design.len(), 10, |i, p| design[i][p] / lengths[p]);
    let target = DVector::from_vec(target);
    let Ok(inverse) = design.clone().pseudo_inverse(1e-7) else {
        return 0.0;
    };
    left + (&target - &design * (inverse * &target)).norm_squared()
}

/// The set-up as the sensors are.
fn true_setup(clean: &Trial) -> Setup {
    let model = clean.model();
    let mut setup = clean.setup.clone();
    for (entry, sensor) in setup.accelerometers.iter_mut().zip(&model.accelerometers) {
        (entry.position, entry.direction, entry.scale) = (
            sensor.entry.position,
            sensor.entry.direction,
            sensor.entry.scale,
        );
    }
    for (entry, cell) in setup.load_cells.iter_mut().zip(&model.load_cells) {
        (entry.position, entry.direction, entry.scale) =
            (cell.position, cell.direction, cell.scale);
    }
    setup
}

//! How far a fault contradicts exact data: what no examination can see is told apart beforehand.
//!
//! The test is that of the draw without elasticity, noise and differences of sensors: exact readings of
//! a rigid body on the table that moves. From them and the set-up with its fault, the table's motion is
//! solved for run by run, then one body for all runs, by linear least squares. Weights are the noise of
//! the draw, as averaging over the band leaves it, and the usual differences of sensors. The sum of
//! squares that is left is the trace of the fault; without a fault it is zero. How far a structure bends is
//! not known beforehand: of its sensors and of the load cells only the constant of a fit in 1, ω² and ω⁴
//! counts, and its noise. Nothing here is shared with the detective.

use super::spoil::{At, G, Spoilt, channels, position_of};
use crate::detective::Fault;
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

/// Variance of a reading that is taken for nothing, over the mean square of its kind.
const FREED: f64 = 1e4;

/// Relative difference from the weighed mass that is usual.
const WEIGHED: f64 = 0.02;

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

/// Variance of the constant in a fit of 1, ω² and ω⁴ to the lines of a band, over that of the lines' mean.
fn extrapolation([low, high]: [f64; 2]) -> f64 {
    const LINES: usize = 64;
    let design = DMatrix::from_fn(LINES, 3, |line, term| {
        let f = (low + (high - low) * line as f64 / (LINES - 1) as f64) / high;
        f.powi(2 * term as i32)
    });
    let inverse = design.tr_mul(&design).try_inverse();
    inverse.map_or(1.0, |inverse| inverse[(0, 0)] * LINES as f64)
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

/// A set-up with faults, of which an explanation mends what it names.
pub(super) struct Scene<'a> {
    pub(super) clean: &'a Trial,
    /// Noise, a share of each channel's RMS.
    pub(super) level: f64,
    pub(super) faults: &'a [&'a Spoilt],
    pub(super) mended: &'a [&'a Fault],
}

/// Mends a set-up as an explanation says, as far as the fault lies there.
fn mend(setup: &mut Setup, fault: &Fault) {
    match fault {
        Fault::Inverted { channel } => *position_of(setup, *channel).2 *= -1.0,
        Fault::Factor { channel, factor } | Fault::Gain { channel, factor } => {
            *position_of(setup, *channel).2 /= factor;
        }
        Fault::Unit { channels, factor } => channels
            .iter()
            .for_each(|&c| *position_of(setup, c).2 /= factor),
        Fault::Reversed { channels } => channels
            .iter()
            .for_each(|&c| *position_of(setup, c).2 *= -1.0),
        Fault::Turned { place, rotation } => {
            for &c in place {
                let direction = position_of(setup, c).1;
                *direction = (rotation * Vector3::from(*direction)).into();
            }
        }
        Fault::Position {
            place, position, ..
        } => place
            .iter()
            .for_each(|&c| *position_of(setup, c).0 = (*position).into()),
        Fault::PlacesExchanged { places: [a, b] } => {
            let (here, there) = (*position_of(setup, a[0]).0, *position_of(setup, b[0]).0);
            a.iter().for_each(|&c| *position_of(setup, c).0 = there);
            b.iter().for_each(|&c| *position_of(setup, c).0 = here);
        }
        Fault::Swapped { .. }
        | Fault::CrossTalk { .. }
        | Fault::Delayed { .. }
        | Fault::Dead { .. }
        | Fault::Unlisted { .. } => {}
    }
}

impl Scene<'_> {
    /// Readings as they are recorded, and as the explanation takes them, of those of exact data; `turn` is the
    /// phase of a sample.
    fn readings(&self, y: &mut [Complex<f64>], turn: f64, accelerometers: usize) {
        let late = |channels: &[usize], samples: f64, y: &mut [Complex<f64>]| {
            let phase = Complex::from_polar(1.0, turn * samples);
            channels.iter().for_each(|&c| y[c] *= phase);
        };
        for fault in self.faults {
            match fault {
                Spoilt::Swapped([a, b]) => y.swap(*a, *b),
                Spoilt::Dead(c) => y[*c] = Complex::default(),
                Spoilt::CrossTalk([c, from], share) => y[*c] += y[*from] * *share,
                Spoilt::Delayed(channels, samples) => late(channels, *samples as f64, y),
                Spoilt::InG => y[..accelerometers].iter_mut().for_each(|y| *y /= G),
                _ => {}
            }
        }
        for fault in self.mended {
            match fault {
                Fault::Swapped { channels: [a, b] } => y.swap(*a, *b),
                Fault::CrossTalk {
                    channel,
                    from,
                    share,
                } => y[*channel] -= y[*from] * *share,
                Fault::Delayed { channels, samples } => late(channels, -samples, y),
                _ => {}
            }
        }
    }

    /// Channels whose readings the explanation takes for nothing.
    fn freed(&self) -> Vec<usize> {
        let of = |fault: &&&Fault| match fault {
            Fault::Dead { channel } | Fault::Unlisted { channel } => Some(*channel),
            _ => None,
        };
        self.mended.iter().filter_map(|f| of(&f)).collect()
    }
}

/// Sum of squares by which exact data contradict a set-up.
pub(super) fn contradiction(scene: &Scene<'_>) -> f64 {
    let Scene {
        clean,
        level,
        faults,
        mended,
    } = *scene;
    let model = clean.model();
    let m = &model.measurement;
    let [low, high] = m.averaging_band;
    // A delay shows most at the top of the band, and counts as its mean square there.
    let rms = ((high.powi(3) - low.powi(3)) / (3.0 * (high - low))).sqrt();
    let turn = -std::f64::consts::TAU * rms / m.sample_rate;
    let frequency = 0.5 * (low + high);
    let truth = true_setup(clean);
    let mut faulty = truth.clone();
    faults.iter().for_each(|fault| fault.misstate(&mut faulty));
    mended.iter().for_each(|fault| mend(&mut faulty, fault));
    let freed = scene.freed();
    let noise = clean.noise(level);
    let averaged = 0.45 / (m.duration * (high - low));
    let extrapolated = averaged * extrapolation([low, high]);
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
        scene.readings(&mut y, turn, sensors);
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
                let nothing = if freed.contains(&c) {
                    FREED * levels[0]
                } else {
                    0.0
                };
                let averaged = if all[c].structure {
                    extrapolated
                } else {
                    averaged
                };
                own * own * averaged + gain * gain * y[c].norm_sqr() + turned + moved + nothing
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
            let v = own * own * extrapolated
                + gain * gain * y[c].norm_sqr()
                + direction * direction * levels[1]
                + if freed.contains(&c) {
                    FREED * levels[1]
                } else {
                    0.0
                };
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
    if let Some(weighed) = clean.setup.known_mass {
        let mut row = [0.0; 10];
        row[0] = 1.0 / (WEIGHED * weighed);
        design.push(row);
        target.push(1.0 / WEIGHED);
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
    let body = &inverse * &target;
    // No mass and no moment of inertia is negative.
    let projection = &inverse * &design;
    let spread = &inverse * inverse.transpose();
    let impossible = [0, 4, 5, 6].map(|p| match projection[(p, p)] > 1.0 - 1e-6 {
        true => body[p].min(0.0).powi(2) / spread[(p, p)],
        false => 0.0,
    });
    let impossible = impossible.into_iter().fold(0.0, f64::max);
    left + (&target - &design * body).norm_squared() + impossible
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

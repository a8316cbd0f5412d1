//! How far a fault contradicts exact data: what no examination can see is told apart beforehand.
//!
//! The test is that of the draw without elasticity, noise and differences of sensors: exact readings of
//! a rigid body on the table that moves. From them and the set-up with its fault, the table's motion is
//! solved for run by run, then one body for all runs, by linear least squares. Weights are the noise of
//! the draw, as averaging over the band leaves it, and the usual differences of sensors. The sum of
//! squares that is left is the trace of the fault; without a fault it is zero. How far a structure bends is
//! not known beforehand: of its sensors and of the load cells only the constant of a fit in 1, ω² and ω⁴
//! counts, and its noise. Nothing here is shared with the detective.

use super::spoil::{At, Spoilt, channels, position_of};
use crate::detective::Fault;
use crate::setup::{STANDARD_GRAVITY, Setup};
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
        Fault::Datum { channels, shift } => {
            for &c in channels {
                let position = position_of(setup, c).0;
                *position = (Vector3::from(*position) + shift).into();
            }
        }
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
                Spoilt::InG => y[..accelerometers]
                    .iter_mut()
                    .for_each(|y| *y /= STANDARD_GRAVITY),
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

/// Sum of squares by which exact data contradict a set-up; none where it cannot be solved.
pub(super) fn contradiction(scene: &Scene<'_>) -> f64 {
    left(scene).unwrap_or(0.0)
}

fn left(scene: &Scene<'_>) -> Option<f64> {
    let test = Test::of(scene);
    let mut body = BodyEquations::default();
    let mut left = 0.0;
    for (number, plan) in scene.clean.model().runs.iter().enumerate() {
        let carry = mounting(&plan.rotation, &plan.translation);
        let run = RunReadings::of(scene, &test, number, carry);
        let motion = test.motion(&run)?;
        left += motion.left;
        test.balance(&run, &motion, &mut body)?;
    }
    if let Some(weighed) = scene.clean.setup.known_mass {
        body.weigh(weighed);
    }
    let [squares, impossible] = body.left()?;
    Some(left + squares + impossible)
}

/// A test as the set-up with its fault states it.
struct Test {
    /// Places of all channels, the accelerometers' first, as they are stated and as they are.
    all: Vec<At>,
    truth: Vec<At>,
    accelerometers: usize,
    /// Quantity of each load cell.
    quantities: Vec<Quantity>,
    /// Unit of each channel, m/s², N or N m.
    scales: Vec<f64>,
    /// Noise of each channel, m/s², N or N m.
    noise: Vec<f64>,
    /// Channels whose readings are taken for nothing.
    freed: Vec<usize>,
    /// Variance of a mean over the band, over that of the noise, and of the constant of its fit.
    averaged: f64,
    extrapolated: f64,
    /// Frequency, Hz, and phase of a sample, rad.
    frequency: f64,
    turn: f64,
    /// The body, kg, kg m and kg m².
    body: Matrix6<f64>,
}

/// The readings of one run.
struct RunReadings {
    y: Vec<Complex<f64>>,
    /// Mean squares of accelerometers and load cells, of three axes.
    levels: [f64; 2],
    carry: Matrix6<f64>,
}

/// The table's motion in one run.
struct Motion {
    /// Real and imaginary part.
    parts: [Vector6<f64>; 2],
    covariance: DMatrix<f64>,
    /// Sum of squares that is left.
    left: f64,
}

impl RunReadings {
    fn of(scene: &Scene<'_>, test: &Test, number: usize, carry: Matrix6<f64>) -> Self {
        let mut y = exact(scene.clean, number, test.frequency);
        scene.readings(&mut y, test.turn, test.accelerometers);
        y.iter_mut().zip(&test.scales).for_each(|(y, s)| *y *= *s);
        let power = |cells: bool| {
            let mut sum = (0.0, 0.0);
            for (_, y) in test.all.iter().zip(&y).filter(|(at, _)| at.cell == cells) {
                sum = (sum.0 + y.norm_sqr(), sum.1 + 1.0);
            }
            3.0 * sum.0 / f64::max(sum.1, 1.0)
        };
        let levels = [power(false), power(true)];
        Self { y, levels, carry }
    }

    /// Real or imaginary part of a reading.
    fn part(&self, channel: usize, part: usize) -> f64 {
        [self.y[channel].re, self.y[channel].im][part]
    }
}

impl Test {
    fn of(scene: &Scene<'_>) -> Self {
        let model = scene.clean.model();
        let m = &model.measurement;
        let [low, high] = m.averaging_band;
        // A delay shows most at the top of the band, and counts as its mean square there.
        let rms = ((high.powi(3) - low.powi(3)) / (3.0 * (high - low))).sqrt();
        let truth = true_setup(scene.clean);
        let mut faulty = truth.clone();
        let (faults, mended) = (scene.faults, scene.mended);
        faults.iter().for_each(|fault| fault.misstate(&mut faulty));
        mended.iter().for_each(|fault| mend(&mut faulty, fault));
        let averaged = 0.45 / (m.duration * (high - low));
        let of_accelerometers = faulty.accelerometers.iter().map(|a| a.scale);
        let of_cells = faulty.load_cells.iter().map(|cell| cell.scale);
        let scales: Vec<f64> = of_accelerometers.chain(of_cells).collect();
        let noise = scene.clean.noise(scene.level);
        let noise = noise
            .iter()
            .zip(&scales)
            .map(|(noise, scale)| noise * scale);
        Self {
            all: channels(&faulty),
            truth: channels(&truth),
            accelerometers: faulty.accelerometers.len(),
            quantities: faulty.load_cells.iter().map(|cell| cell.quantity).collect(),
            noise: noise.collect(),
            scales,
            freed: scene.freed(),
            averaged,
            extrapolated: averaged * extrapolation([low, high]),
            frequency: 0.5 * (low + high),
            turn: -std::f64::consts::TAU * rms / m.sample_rate,
            body: model.specimen.mass_matrix,
        }
    }

    /// Variance of a reading that is taken for nothing, `level` being the mean square of its kind; none of others.
    fn nothing(&self, channel: usize, level: f64) -> f64 {
        if self.freed.contains(&channel) {
            FREED * level
        } else {
            0.0
        }
    }

    /// Solves for the table's motion, once to learn how far it turns, once with that.
    fn motion(&self, run: &RunReadings) -> Option<Motion> {
        let first = self.motion_of_turning(run, 0.0)?;
        let turning = |a: &Vector6<f64>| a.fixed_rows::<3>(3).norm_squared();
        self.motion_of_turning(run, first.parts.iter().map(turning).sum())
    }

    /// Solves for the motion of a table whose angular acceleration has the square `turning`, rad²/s⁴.
    fn motion_of_turning(&self, run: &RunReadings, turning: f64) -> Option<Motion> {
        let sensors = self.accelerometers;
        let [gain, direction, shift] = DIFFERENCES;
        let variance = |c: usize| {
            let turned = direction * direction * run.levels[usize::from(self.all[c].cell)];
            let averaged = if self.all[c].structure {
                self.extrapolated
            } else {
                self.averaged
            };
            self.noise[c] * self.noise[c] * averaged
                + gain * gain * run.y[c].norm_sqr()
                + turned
                + shift * shift * turning
                + self.nothing(c, run.levels[0])
        };
        let v: Vec<f64> = (0..sensors).map(variance).collect();
        let a = DMatrix::from_fn(sensors, 6, |c, j| {
            row(&self.all[c], None, &run.carry)[j] / v[c].sqrt()
        });
        let inverse = a.clone().pseudo_inverse(ROUNDING * a.norm()).ok()?;
        let mut left = 0.0;
        let parts = [0, 1].map(|part| {
            let b = DVector::from_fn(sensors, |c, _| run.part(c, part) / v[c].sqrt());
            let solved = &inverse * &b;
            left += (b - &a * &solved).norm_squared();
            Vector6::from_fn(|i, _| solved[i])
        });
        Some(Motion {
            parts,
            covariance: &inverse * inverse.transpose(),
            left,
        })
    }

    /// Adds a run's balance of forces: six resultants, of which the load cells measure some.
    fn balance(
        &self,
        run: &RunReadings,
        motion: &Motion,
        equations: &mut BodyEquations,
    ) -> Option<()> {
        let carry = &run.carry;
        let cells: Vec<usize> = (self.accelerometers..self.all.len()).collect();
        let resultants = |of: &[At]| {
            DMatrix::from_fn(6, cells.len(), |i, k| {
                row(&of[cells[k]], Some(self.quantities[k]), carry)[i]
            })
        };
        let x = resultants(&self.all);
        let measured = resultants(&self.truth).svd(true, false);
        let u = measured.u?;
        let count = measured
            .singular_values
            .iter()
            .filter(|s| **s > 1e-6 * measured.singular_values.max())
            .count();
        let select = u.columns(0, count).transpose();
        let mut covariance = self.of_resultants(run, &x);
        let body = carry.tr_mul(&self.body) * carry;
        let body = DMatrix::from_fn(6, 6, |i, j| body[(i, j)]);
        covariance += &body * &motion.covariance * body.transpose();
        let covariance = &select * covariance * select.transpose();
        let floor = ROUNDING * covariance.trace();
        let covariance = covariance + DMatrix::identity(count, count) * floor;
        let factor = covariance.cholesky()?;
        for (part, motion) in motion.parts.iter().enumerate() {
            let force = &x * DVector::from_fn(cells.len(), |k, _| run.part(cells[k], part));
            let lines = carry.transpose() * rows(&(carry * motion));
            let lines = &select * DMatrix::from_fn(6, 10, |i, p| lines[(i, p)]);
            let lines = factor.l().solve_lower_triangular(&lines)?;
            let force = factor.l().solve_lower_triangular(&(&select * force))?;
            for i in 0..count {
                equations.add(std::array::from_fn(|p| lines[(i, p)]), force[i]);
            }
        }
        Some(())
    }

    /// Covariance of the six resultants, to which the load cells contribute by the columns of `x`.
    fn of_resultants(&self, run: &RunReadings, x: &DMatrix<f64>) -> DMatrix<f64> {
        let [gain, direction, shift] = DIFFERENCES;
        let mut covariance = DMatrix::<f64>::zeros(6, 6);
        for (k, quantity) in self.quantities.iter().enumerate() {
            let c = self.accelerometers + k;
            let v = self.noise[c] * self.noise[c] * self.extrapolated
                + gain * gain * run.y[c].norm_sqr()
                + direction * direction * run.levels[1]
                + self.nothing(c, run.levels[1]);
            covariance += x.column(k) * x.column(k).transpose() * v;
            if *quantity == Quantity::Force {
                for axis in 0..3 {
                    let moment = Vector3::ith(axis, 1.0).cross(&self.all[c].direction);
                    let x = DVector::from_vec(vec![0.0, 0.0, 0.0, moment.x, moment.y, moment.z]);
                    covariance += &x * x.transpose() * (shift * shift * run.y[c].norm_sqr());
                }
            }
        }
        covariance
    }
}

/// Equations of the body's ten numbers, each of unit variance.
#[derive(Default)]
struct BodyEquations {
    design: Vec<[f64; 10]>,
    target: Vec<f64>,
}

impl BodyEquations {
    fn add(&mut self, row: [f64; 10], target: f64) {
        self.design.push(row);
        self.target.push(target);
    }

    /// Adds a mass that was weighed, kg.
    fn weigh(&mut self, weighed: f64) {
        let mut row = [0.0; 10];
        row[0] = 1.0 / (WEIGHED * weighed);
        self.add(row, 1.0 / WEIGHED);
    }

    /// Sum of squares that one body leaves, and the square by which the most impossible of its numbers is so: no mass
    /// and no moment of inertia is negative.
    fn left(&self) -> Option<[f64; 2]> {
        let lengths: [f64; 10] = std::array::from_fn(|p| {
            let squares: f64 = self.design.iter().map(|row| row[p] * row[p]).sum();
            squares.sqrt().max(f64::MIN_POSITIVE)
        });
        let rows = self.design.len();
        let design = DMatrix::from_fn(rows, 10, |i, p| self.design[i][p] / lengths[p]);
        let target = DVector::from_column_slice(&self.target);
        let inverse = design.clone().pseudo_inverse(1e-7).ok()?;
        let body = &inverse * &target;
        let projection = &inverse * &design;
        let spread = &inverse * inverse.transpose();
        let impossible = [0, 4, 5, 6].map(|p| match projection[(p, p)] > 1.0 - 1e-6 {
            true => body[p].min(0.0).powi(2) / spread[(p, p)],
            false => 0.0,
        });
        let squares = (&target - &design * body).norm_squared();
        Some([squares, impossible.into_iter().fold(0.0, f64::max)])
    }
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

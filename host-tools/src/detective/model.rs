//! Step 2: how far the rows of all channels contradict one rigid body on one rigid interface.
//!
//! # Design
//!
//! At 0 Hz every accelerometer follows the interface, `k = φ B` with its rigid-body row φ and a
//! free matrix B of the interface's motions, one for each mounting of the specimen; the load cells balance the body, `Xᵀ K = M₀ B` with
//! the ten numbers free, the same in all mountings. Both are linear least squares, the second with the covariance of the
//! first. Nothing is trusted but the shares by which sensors may differ from what the set-up says.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, RowVector6, Vector3, Vector6};

use super::kronecker::{add_lower, congruent};
use super::sensor::{Kind, Sensor};
use super::state::{Rows, State};
use super::table::Row;
use crate::likelihood::{Model, RIGID};
use massline_core::geometry::Quantity;

/// Relative differences that sensors of good laboratories have: gain; direction, rad; position, m.
const GAIN: f64 = 0.005;
const DIRECTION: f64 = 0.0087;
const POSITION: f64 = 0.001;

/// Share of the strongest direction, in power, from which a direction of motion or of load is told:
/// sensors that are tilted by half a degree, or lie a hundredth of the length off, tell none.
const SEEN: f64 = 1e-4;

/// Share of the whole variance that any combination of resultants has at least.
const FLOOR: f64 = 1e-9;

/// Relative difference from the weighed mass that adapters, and gains that all sensors share, explain.
const WEIGHED: f64 = 0.02;

/// Share of the mass in what the runs do not determine, from which they do not determine the mass.
const FREE: f64 = 1e-6;

/// Mean square that a channel should have, over that of a place, from which it has a signal.
const SIGNAL: f64 = 0.03;

/// Load cells of one direction, its own not counted, from which most of them tell if one should have a
/// signal.
const ALIKE: f64 = 0.5;

/// Mean square at a place, over the upper quartile of all, below which it rests.
const RESTING: f64 = 0.01;

/// A sum of squares over its degrees of freedom.
#[derive(Clone, Debug)]
pub(super) struct Score {
    pub(super) chi2: f64,
    pub(super) freedom: f64,
    /// Degrees of freedom of the accelerometers alone.
    pub(super) of_motion: f64,
    /// Mass of the body that fits best.
    pub(super) mass: Option<Mass>,
}

/// A mass with its standard deviation at this tolerance, kg; infinite where the runs do not tell it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mass {
    pub(super) value: f64,
    pub(super) error: f64,
}

impl Score {
    pub(super) fn ratio(&self) -> f64 {
        self.chi2 / self.freedom.max(1.0)
    }
}

/// Mounting of the specimen in some runs, and the number of their motions.
#[derive(Clone, Debug)]
pub(super) struct Mounting {
    /// Independent motions of the interface.
    pub(super) motions: usize,
    /// From the specimen's frame to the table's.
    pub(super) rotation: Matrix3<f64>,
    /// Motion of the specimen's origin, of that of the table's; rotations times the length.
    pub(super) carry: Matrix6<f64>,
}

impl Mounting {
    /// A specimen turned and shifted so, with rotations times `length`.
    pub(super) fn new(
        motions: usize,
        (rotation, translation): (Matrix3<f64>, Vector3<f64>),
        length: f64,
    ) -> Self {
        let mut carry = Matrix6::<f64>::zeros();
        let back = rotation.transpose();
        carry.fixed_view_mut::<3, 3>(0, 0).copy_from(&back);
        carry.fixed_view_mut::<3, 3>(3, 3).copy_from(&back);
        let shifted = back * translation.cross_matrix() * (-1.0 / length);
        carry.fixed_view_mut::<3, 3>(0, 3).copy_from(&shifted);
        Self {
            motions,
            rotation,
            carry,
        }
    }
}

/// The part of the equations that does not change with a hypothesis.
#[derive(Clone, Debug)]
pub(super) struct Bench {
    /// One for each group of runs.
    pub(super) mountings: Vec<Mounting>,
    /// Combinations of the six resultants that the load cells measure, as rows; empty without any.
    pub(super) equations: DMatrix<f64>,
    /// Length that rotations are scaled by, m.
    pub(super) length: f64,
    /// Weighed mass, kg.
    pub(super) weighed: Option<f64>,
    /// Distance from the origin within which the body lies, m: a standard deviation.
    pub(super) reach: f64,
}

/// The ten derivatives of the mass matrix about the origin with respect to σ of equation (6).
fn parts() -> [Matrix6<f64>; RIGID] {
    std::array::from_fn(|p| {
        let unit = std::array::from_fn(|i| f64::from(u8::from(i == p)));
        Model::rigid(unit, 1.0, 0).rigid_matrix()
    })
}

/// Mean square at a place, over the places of a kind: the signal that a sensor which looks
/// elsewhere would read.
pub(super) fn level(sensors: &[Sensor], rows: &[Option<Row>], cells: bool) -> f64 {
    let mut places: Vec<(Vector3<f64>, f64)> = Vec::new();
    for (sensor, row) in sensors.iter().zip(rows) {
        let Some(row) = row else { continue };
        if sensor.kind.is_cell() != cells || sensor.kind == Kind::Cell(Quantity::Moment) {
            continue;
        }
        let square = row.k.norm_squared();
        match places
            .iter_mut()
            .find(|(p, _)| (p - sensor.position).norm() < 1e-9)
        {
            Some((_, sum)) => *sum += square,
            None => places.push((sensor.position, square)),
        }
    }
    let mut squares: Vec<f64> = places.into_iter().map(|(_, s)| s).collect();
    squares.sort_by(f64::total_cmp);
    // Sensors that look across the motion tell nothing of it.
    let most = squares.get(squares.len() * 3 / 4).copied().unwrap_or(0.0);
    squares.retain(|square| *square > RESTING * most);
    squares.get(squares.len() / 2).copied().unwrap_or(0.0)
}

/// A set-up in one mounting whose contradiction is asked for.
struct Posed<'a> {
    bench: &'a Bench,
    mounting: &'a Mounting,
    sensors: &'a [Sensor],
    rows: &'a [Option<Row>],
    /// Square of the tolerance.
    square: f64,
    /// Mean squares of accelerometers and of load cells at a place.
    levels: [f64; 2],
}

/// The motion of the interface that explains the accelerometers best.
pub(super) struct Motion {
    /// Six accelerations about the origin along each motion of the gauge, rotations times the
    /// length.
    rows: DMatrix<f64>,
    covariance: DMatrix<f64>,
    chi2: f64,
    freedom: f64,
}

impl Bench {
    /// Motions of all mountings.
    pub(super) fn motions(&self) -> usize {
        self.mountings.iter().map(|m| m.motions).sum()
    }

    /// `true` if a channel should have a signal: an accelerometer by the motion, a load cell by most of
    /// those that look the same way, or by the motion if it is the only one.
    pub(super) fn expects(
        &self,
        state: &State,
        motions: &[Motion],
        channel: usize,
        quiet: &[usize],
    ) -> bool {
        let sensor = &state.sensors[channel];
        if sensor.kind.is_cell() {
            let (mut loud, mut all) = (0.0, 0.0);
            for (i, other) in state.sensors.iter().enumerate() {
                if i != channel && other.kind == sensor.kind {
                    let along = other.direction.dot(&sensor.direction).powi(2);
                    all += along;
                    loud += if quiet.contains(&i) { 0.0 } else { along };
                }
            }
            if all > ALIKE {
                return 2.0 * loud > all;
            }
            // The only one of its direction carries all of the force.
            let d = sensor.direction;
            return sensor.kind == Kind::Cell(Quantity::Force)
                && motions.iter().any(|motion| {
                    let all = motion.rows.rows(0, 3);
                    (d.transpose() * all).norm_squared() > SIGNAL * all.norm_squared()
                });
        }
        let mut posed = self.posed(state, 1.0).into_iter().zip(motions);
        posed.any(|(posed, motion)| {
            let row = posed.scaled(sensor).transpose() * &motion.rows;
            row.norm_squared() > SIGNAL * posed.levels[0]
        })
    }

    fn posed<'a>(&'a self, state: &'a State, tolerance: f64) -> Vec<Posed<'a>> {
        let pose = |(mounting, rows): (&'a Mounting, &'a Rows)| Posed {
            bench: self,
            mounting,
            sensors: &state.sensors,
            rows: &rows.rows,
            // A sensor differs alike in all mountings: these do not average it out.
            square: tolerance * tolerance * self.mountings.len() as f64,
            levels: [false, true].map(|cells| level(&state.sensors, &rows.rows, cells)),
        };
        self.mountings
            .iter()
            .zip(&state.mountings)
            .map(pose)
            .collect()
    }

    /// The motions alone, one a mounting, `tolerance` times the usual differences of sensors. `None`
    /// if they cannot be solved for.
    pub(super) fn motion(&self, state: &State, tolerance: f64) -> Option<Vec<Motion>> {
        self.posed(state, tolerance)
            .iter()
            .map(Posed::motion)
            .collect()
    }

    /// Contradiction of rows and sensors, `tolerance` times the usual differences of sensors.
    /// `None` if the motion cannot be solved for.
    pub(super) fn score(&self, state: &State, tolerance: f64) -> Option<Score> {
        self.score_moved(state, tolerance, &self.motion(state, tolerance)?)
    }

    /// The same with the motions that are known, since the accelerometers are as they were.
    pub(super) fn score_moved(
        &self,
        state: &State,
        tolerance: f64,
        motions: &[Motion],
    ) -> Option<Score> {
        let of_motion = motions.iter().map(|m| m.freedom).sum();
        let mut score = Score {
            chi2: motions.iter().map(|m| m.chi2).sum(),
            freedom: of_motion,
            of_motion,
            mass: None,
        };
        if let Some((chi2, freedom, mass)) = self.forces(&self.posed(state, tolerance), motions) {
            score.chi2 += chi2;
            score.freedom += freedom;
            score.mass = Some(mass);
        }
        score.chi2.is_finite().then_some(score)
    }

    /// The balance of the load cells with a body and its weighed mass: sum of squares, degrees of
    /// freedom, and mass. No body has a negative mass or moment of inertia: one that fits best with such
    /// a number contradicts the set-up by what it takes to make the number zero.
    fn forces(&self, posed: &[Posed<'_>], motions: &[Motion]) -> Option<(f64, f64, Mass)> {
        let count = self.equations.nrows();
        if count == 0 {
            return None;
        }
        let parts = parts();
        let balances: Vec<Balance> = posed
            .iter()
            .zip(motions)
            .map(|(posed, motion)| posed.balance(motion, &parts))
            .collect();
        // A body of any inertia would explain moments by rotations that are noise.
        let heaviest = balances.iter().map(|b| b.mass).fold(0.0, f64::max);
        let reach = self.reach / self.length;
        let priors: Vec<(usize, f64)> = (1..RIGID)
            .map(|p| (p, heaviest * reach.powi(if p < 4 { 1 } else { 2 })))
            .filter(|(_, size)| *size > 0.0)
            .collect();
        let equations = count * self.motions() + usize::from(self.weighed.is_some());
        let rows = equations + priors.len();
        let mut body = [0.0; 10];
        let mut mass = Mass {
            value: 0.0,
            error: f64::INFINITY,
        };
        let (mut chi2, mut freedom) = (0.0, 0.0);
        for pass in 0..2 {
            let mut a = DMatrix::<f64>::zeros(rows, 10);
            let mut b = DVector::<f64>::zeros(rows);
            let mut at = 0;
            for ((balance, posed), motion) in balances.iter().zip(posed).zip(motions) {
                let body = (pass > 0).then_some(&body);
                let (design, target) = balance.whitened(posed, motion, &parts, body)?;
                a.rows_mut(at, design.nrows()).copy_from(&design);
                b.rows_mut(at, target.nrows()).copy_from(&target);
                at += target.nrows();
            }
            if let Some(weighed) = self.weighed {
                let error = WEIGHED * weighed;
                (a[(at, 0)], b[at]) = (1.0 / error, weighed / error);
                at += 1;
            }
            for &(p, size) in &priors {
                a[(at, p)] = 1.0 / size;
                at += 1;
            }
            // Columns of unit length: what no motion excites is left out.
            let lengths: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
            let longest = lengths.iter().copied().fold(0.0, f64::max);
            let unit = |p: usize| match lengths[p] {
                n if n > 1e-6 * longest => 1.0 / n,
                _ => 0.0,
            };
            let a = DMatrix::from_fn(a.nrows(), 10, |i, p| a[(i, p)] * unit(p));
            let eigen = a.tr_mul(&a).symmetric_eigen();
            let right = a.tr_mul(&b);
            let mut solution = DVector::<f64>::zeros(10);
            let mut rank = 0;
            let mut variance = [0.0; 10];
            let mut free = [0.0; 10];
            for (i, &value) in eigen.eigenvalues.iter().enumerate() {
                let column = eigen.eigenvectors.column(i);
                if value > 1e-9 {
                    solution.axpy(column.dot(&right) / value, &column, 1.0);
                    rank += 1;
                }
                for (p, x) in column.iter().enumerate() {
                    if value > 1e-9 {
                        variance[p] += x * x / value;
                    } else {
                        free[p] += x * x;
                    }
                }
            }
            let told = |p: usize| unit(p) > 0.0 && free[p] < FREE;
            let negative = |p: usize| match told(p) {
                true => solution[p].min(0.0).powi(2) / variance[p],
                false => 0.0,
            };
            // The diagonal of the mass matrix: mass, and the three moments of inertia.
            let impossible = [0, 4, 5, 6].map(negative).into_iter().fold(0.0, f64::max);
            chi2 = (b.norm_squared() - solution.dot(&right)).max(0.0) + impossible;
            freedom = equations as f64 - f64::from(rank);
            for (p, value) in body.iter_mut().enumerate() {
                *value = solution[p] * unit(p);
            }
            mass.value = body[0];
            if told(0) {
                mass.error = variance[0].sqrt() * unit(0);
            }
        }
        Some((chi2, freedom, mass))
    }
}
/// The balance of forces in one mounting.
struct Balance {
    /// Resultants that are measured, motion by motion.
    target: DVector<f64>,
    /// Covariance of all six resultants.
    noise: DMatrix<f64>,
    /// A column for each of the ten numbers.
    design: DMatrix<f64>,
    /// Force over acceleration, kg: about the mass.
    mass: f64,
}

impl Balance {
    /// Design and target with unit noise; the second pass knows the body, and so the noise of what it
    /// is moved by.
    fn whitened(
        &self,
        posed: &Posed<'_>,
        motion: &Motion,
        parts: &[Matrix6<f64>; RIGID],
        body: Option<&[f64; 10]>,
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let size = posed.mounting.motions;
        let mut v = self.noise.clone();
        if let Some(body) = body {
            let mut m = Matrix6::<f64>::zeros();
            for (part, value) in parts.iter().zip(body) {
                m += part * *value;
            }
            let carry = &posed.mounting.carry;
            let m = carry.tr_mul(&m) * carry;
            let m = DMatrix::from_column_slice(6, 6, m.as_slice());
            v += congruent(&m, &motion.covariance, size);
        }
        let v = congruent(&posed.bench.equations, &v, size);
        let floor = FLOOR * v.trace() / v.nrows() as f64;
        let v = (&v + v.transpose()) * 0.5 + DMatrix::identity(v.nrows(), v.nrows()) * floor;
        let l = v.cholesky()?.l();
        let design = l.solve_lower_triangular(&self.design)?;
        Some((design, l.solve_lower_triangular(&self.target)?))
    }
}

impl Posed<'_> {
    /// The sensor's rigid-body row in the table's frame, with moments and rotations over the length.
    fn scaled(&self, sensor: &Sensor) -> Vector6<f64> {
        let mut row = sensor.rigid();
        for i in 3..6 {
            row[i] /= self.bench.length;
        }
        match sensor.kind {
            Kind::Structure => self.mounting.carry.tr_mul(&row),
            _ => row,
        }
    }

    /// Its direction in the table's frame.
    fn direction(&self, sensor: &Sensor) -> Vector3<f64> {
        match sensor.kind {
            Kind::Structure => self.mounting.rotation * sensor.direction,
            _ => sensor.direction,
        }
    }

    /// Covariance of a row but for the sensor's place.
    fn spread(&self, sensor: &Sensor, row: &Row) -> DMatrix<f64> {
        let d = self.mounting.motions;
        let level = self.levels[usize::from(sensor.kind.is_cell())];
        let mut v = row.noise.clone();
        v.ger(self.square * GAIN * GAIN, &row.k, &row.k, 1.0);
        let turned = self.square * DIRECTION * DIRECTION * level / d as f64;
        let floor = 1e-12 * (level + row.k.norm_squared()) / d as f64;
        for j in 0..d {
            v[(j, j)] += turned + floor;
        }
        v
    }

    fn motion(&self) -> Option<Motion> {
        let d = self.mounting.motions;
        // Motion that no accelerometer sees is zero, as the set-up has it.
        let mut gram = Matrix6::<f64>::zeros();
        for (sensor, row) in self.sensors.iter().zip(self.rows) {
            if row.is_some() && !sensor.kind.is_cell() {
                let phi = self.scaled(sensor) / self.scaled(sensor).norm();
                gram += phi * phi.transpose();
            }
        }
        let eigen = gram.symmetric_eigen();
        let seen: Vec<usize> = (0..6)
            .filter(|&i| eigen.eigenvalues[i] > SEEN * eigen.eigenvalues.max())
            .collect();
        let seen = DMatrix::from_fn(6, seen.len(), |i, j| eigen.eigenvectors[(i, seen[j])]);
        let r = seen.ncols();
        // Two passes: the second knows how far the interface rotates.
        let mut motion = DMatrix::<f64>::zeros(6, d);
        let mut factor = None;
        let (mut chi2, mut freedom) = (0.0, 0.0);
        for pass in 0..2 {
            let mut normal = DMatrix::<f64>::zeros(r * d, r * d);
            let mut right = DVector::<f64>::zeros(r * d);
            let mut whole = 0.0;
            let mut count = 0;
            for (sensor, row) in self.sensors.iter().zip(self.rows) {
                let Some(row) = row.as_ref().filter(|_| !sensor.kind.is_cell()) else {
                    continue;
                };
                let mut v = self.spread(sensor, row);
                if pass > 0 {
                    // A shifted sensor reads ω x δ along its axis.
                    let direction = self.direction(sensor);
                    let across = Matrix3::identity() - direction * direction.transpose();
                    let turning = motion.rows(3, 3) / self.bench.length;
                    let across = DMatrix::from_fn(3, 3, |i, j| across[(i, j)]);
                    v += turning.tr_mul(&across) * &turning * (self.square * POSITION * POSITION);
                }
                let weight = v.cholesky()?.inverse();
                let phi = seen.tr_mul(&self.scaled(sensor));
                add_lower(&mut normal, phi.as_slice(), &weight);
                let weighed = &weight * &row.k;
                for i in 0..r {
                    for j in 0..d {
                        right[i * d + j] += phi[i] * weighed[j];
                    }
                }
                whole += row.k.dot(&weighed);
                count += d;
            }
            let solution = factor.insert(normal.cholesky()?).solve(&right);
            motion = &seen * DMatrix::from_fn(r, d, |i, j| solution[i * d + j]);
            chi2 = (whole - solution.dot(&right)).max(0.0);
            freedom = count as f64 - (r * d) as f64;
        }
        Some(Motion {
            rows: motion,
            covariance: congruent(&seen, &factor?.inverse(), d),
            chi2,
            freedom,
        })
    }

    /// The balance of the load cells with the body that the motion moves.
    fn balance(&self, motion: &Motion, parts: &[Matrix6<f64>; RIGID]) -> Balance {
        let d = self.mounting.motions;
        let mut resultants = DMatrix::<f64>::zeros(6, d);
        let mut noise = DMatrix::<f64>::zeros(6 * d, 6 * d);
        for (sensor, row) in self.sensors.iter().zip(self.rows) {
            let Some(row) = row.as_ref().filter(|_| sensor.kind.is_cell()) else {
                continue;
            };
            let x = self.scaled(sensor);
            for i in 0..6 {
                for j in 0..d {
                    resultants[(i, j)] += x[i] * row.k[j];
                }
            }
            add_lower(&mut noise, x.as_slice(), &self.spread(sensor, row));
            if sensor.kind == Kind::Cell(Quantity::Force) {
                // A shifted load cell adds the moment δ x F.
                let product = &row.k * row.k.transpose() * (self.square * POSITION * POSITION);
                for axis in 0..3 {
                    let moment =
                        Vector3::ith(axis, 1.0).cross(&sensor.direction) / self.bench.length;
                    let x = Vector6::new(0.0, 0.0, 0.0, moment.x, moment.y, moment.z);
                    add_lower(&mut noise, x.as_slice(), &product);
                }
            }
        }
        noise.fill_upper_triangle_with_lower_triangle();
        // Motion by motion in each of the measured combinations.
        let pile = |m: DMatrix<f64>| {
            let measured = &self.bench.equations * m;
            DVector::from_column_slice(measured.transpose().as_slice())
        };
        let mut design = DMatrix::<f64>::zeros(self.bench.equations.nrows() * d, RIGID);
        let carry = &self.mounting.carry;
        for (p, part) in parts.iter().enumerate() {
            let part = carry.tr_mul(part) * carry;
            let part = DMatrix::from_column_slice(6, 6, part.as_slice());
            design.set_column(p, &pile(part * &motion.rows));
        }
        let accelerations = motion.rows.rows(0, 3).norm();
        Balance {
            mass: match accelerations > 0.0 {
                true => resultants.rows(0, 3).norm() / accelerations,
                false => 0.0,
            },
            target: pile(resultants),
            noise,
            design,
        }
    }
}

/// Combinations of resultants that these load cells measure, moments over `length`: an orthonormal
/// row each.
pub(super) fn equations(sensors: &[Sensor], length: f64) -> DMatrix<f64> {
    let mut gram = Matrix6::<f64>::zeros();
    for sensor in sensors.iter().filter(|s| s.kind.is_cell()) {
        let mut row: RowVector6<f64> = sensor.rigid().transpose();
        for i in 3..6 {
            row[i] /= length;
        }
        if row.norm() > 0.0 {
            row /= row.norm();
            gram += row.transpose() * row;
        }
    }
    let eigen = gram.symmetric_eigen();
    let rows: Vec<RowVector6<f64>> = (0..6)
        .filter(|&i| eigen.eigenvalues[i] > SEEN * eigen.eigenvalues.max().max(f64::MIN_POSITIVE))
        .map(|i| eigen.eigenvectors.column(i).transpose())
        .collect();
    DMatrix::from_fn(rows.len(), 6, |i, j| rows[i][j])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without order, within one.
    fn drawn(i: usize) -> f64 {
        (17.0 * i as f64 * (i as f64 + 0.3)).sin()
    }

    /// Three force cells of three axes at the corners of a triangle, tilted, and a moment cell.
    fn cells() -> Vec<Sensor> {
        let corners = [[0.4, 0.3, 0.02], [-0.5, 0.2, 0.0], [0.1, -0.4, 0.05]];
        let force = (0..9).map(|i| Sensor {
            channel: format!("cell{i}"),
            kind: Kind::Cell(Quantity::Force),
            position: corners[i / 3].into(),
            direction: (Vector3::ith(i % 3, 1.0) + Vector3::from_fn(|j, _| 0.2 * drawn(3 * i + j)))
                .normalize(),
        });
        let moment = Sensor {
            channel: "moment".into(),
            kind: Kind::Cell(Quantity::Moment),
            position: Vector3::zeros(),
            direction: Vector3::z(),
        };
        force.chain([moment]).collect()
    }

    #[test]
    fn the_noise_of_a_balance_is_that_of_whole_products() {
        let (motions, length) = (3, 0.7);
        let sensors = cells();
        let rows: Vec<Option<Row>> = (0..sensors.len())
            .map(|s| {
                let root = DMatrix::from_fn(motions, motions, |i, j| drawn(50 + 9 * s + 3 * i + j));
                Some(Row {
                    k: DVector::from_fn(motions, |i, _| drawn(200 + 3 * s + i)),
                    noise: &root * root.transpose() * 1e-4,
                })
            })
            .collect();
        let posed = Posed {
            bench: &Bench {
                mountings: Vec::new(),
                equations: equations(&sensors, length),
                length,
                weighed: None,
                reach: 0.0,
            },
            mounting: &Mounting::new(motions, (Matrix3::identity(), Vector3::zeros()), length),
            sensors: &sensors,
            rows: &rows,
            square: 2.0,
            levels: [1.0, 0.8],
        };
        let motion = Motion {
            rows: DMatrix::from_fn(6, motions, |i, j| drawn(300 + 3 * i + j)),
            covariance: DMatrix::zeros(6 * motions, 6 * motions),
            chi2: 0.0,
            freedom: 0.0,
        };
        // Every load cell is read as its resultants, and lies elsewhere by δ along each axis.
        let mut expected = DMatrix::<f64>::zeros(6 * motions, 6 * motions);
        for (sensor, row) in sensors.iter().zip(rows.iter().flatten()) {
            let scale = Vector6::new(1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length);
            let x = sensor.rigid().component_mul(&scale);
            expected += (x * x.transpose()).kronecker(&posed.spread(sensor, row));
            if sensor.kind == Kind::Cell(Quantity::Moment) {
                continue;
            }
            for axis in 0..3 {
                let mut shifted = sensor.clone();
                shifted.position += Vector3::ith(axis, 1.0);
                let moved = (shifted.rigid() - sensor.rigid()).component_mul(&scale);
                let error = moved.kronecker(&row.k) * (posed.square.sqrt() * POSITION);
                expected += &error * error.transpose();
            }
        }
        let balance = posed.balance(&motion, &parts());
        // Rounding of some 40 sums of numbers of up to one.
        assert!((&balance.noise - &expected).norm() < 1e-13 * expected.norm());
        let above = &expected - expected.lower_triangle();
        assert!(above.norm() > 0.1 * expected.norm());
    }
}

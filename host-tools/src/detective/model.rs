//! Step 2: how far the rows of all channels contradict one rigid body on one rigid interface.
//!
//! # Design
//!
//! At 0 Hz every accelerometer follows the interface, `k = φ B` with its rigid-body row φ and a
//! free matrix B of the interface's motions; the load cells balance the body, `Xᵀ K = M₀ B` with
//! the ten numbers free. Both are linear least squares, the second with the covariance of the
//! first. Nothing is trusted but the shares by which sensors may differ from what the set-up says.

use nalgebra::{DMatrix, DVector, Matrix6, RowVector6, Vector3, Vector6};

use super::table::Row;
use crate::likelihood::{Model, RIGID};
use massline_core::geometry::Quantity;

/// Kind of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An accelerometer on the interface.
    Interface,
    /// An accelerometer on the structure.
    Structure,
    /// A load cell.
    Cell(Quantity),
}

impl Kind {
    pub(super) fn is_cell(self) -> bool {
        matches!(self, Self::Cell(_))
    }
}

/// One channel as the set-up describes it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sensor {
    pub(super) channel: String,
    pub(super) kind: Kind,
    /// m.
    pub(super) position: Vector3<f64>,
    /// Unit vector.
    pub(super) direction: Vector3<f64>,
}

impl Sensor {
    /// Reading for a unit motion about the origin of an accelerometer; resultants of a unit reading
    /// of a load cell.
    fn rigid(&self) -> Vector6<f64> {
        let moment = match self.kind {
            Kind::Cell(Quantity::Moment) => {
                return Vector6::from_fn(|i, _| if i < 3 { 0.0 } else { self.direction[i - 3] });
            }
            _ => self.position.cross(&self.direction),
        };
        let d = &self.direction;
        Vector6::new(d.x, d.y, d.z, moment.x, moment.y, moment.z)
    }
}

/// Relative differences that sensors of good laboratories have: gain; direction, rad; position, m.
const GAIN: f64 = 0.005;
const DIRECTION: f64 = 0.0087;
const POSITION: f64 = 0.001;

/// A sum of squares over its degrees of freedom.
#[derive(Clone, Debug)]
pub(super) struct Score {
    pub(super) chi2: f64,
    pub(super) freedom: f64,
    /// Mass and first moments of the body that fits best, kg and kg m.
    pub(super) body: Option<[f64; 10]>,
}

impl Score {
    pub(super) fn ratio(&self) -> f64 {
        self.chi2 / self.freedom.max(1.0)
    }
}

/// What does not change with a hypothesis.
#[derive(Clone, Debug)]
pub(super) struct Bench {
    pub(super) motions: usize,
    /// Combinations of the six resultants that the load cells measure, as rows; empty without any.
    pub(super) equations: DMatrix<f64>,
    /// Length that rotations are scaled by, m.
    pub(super) length: f64,
}

/// The ten derivatives of the mass matrix about the origin with respect to σ of equation (6).
fn parts() -> [Matrix6<f64>; RIGID] {
    std::array::from_fn(|p| {
        let unit = std::array::from_fn(|i| f64::from(u8::from(i == p)));
        Model::rigid(unit, 1.0, 0).rigid_matrix()
    })
}

/// Adds `a aᵀ ⊗ c` to a matrix of blocks.
fn add_kronecker(into: &mut DMatrix<f64>, a: &[f64], c: &DMatrix<f64>) {
    let d = c.nrows();
    for (i, x) in a.iter().enumerate() {
        for (j, y) in a.iter().enumerate() {
            let w = x * y;
            if w != 0.0 {
                for k in 0..d {
                    for l in 0..d {
                        into[(i * d + k, j * d + l)] += w * c[(k, l)];
                    }
                }
            }
        }
    }
}

/// `m ⊗ 1`, with a unit matrix of this size.
fn blocks(m: &DMatrix<f64>, size: usize) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows() * size, m.ncols() * size, |r, c| {
        if r % size == c % size {
            m[(r / size, c / size)]
        } else {
            0.0
        }
    })
}

/// Mean square at a place, over the places of a kind: the signal that a sensor which looks
/// elsewhere would read.
fn level(sensors: &[Sensor], rows: &[Option<Row>], cells: bool) -> f64 {
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
    squares.get(squares.len() / 2).copied().unwrap_or(0.0)
}

/// A set-up whose contradiction is asked for.
struct Posed<'a> {
    bench: &'a Bench,
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
    fn posed<'a>(
        &'a self,
        sensors: &'a [Sensor],
        rows: &'a [Option<Row>],
        tolerance: f64,
    ) -> Posed<'a> {
        Posed {
            bench: self,
            sensors,
            rows,
            square: tolerance * tolerance,
            levels: [false, true].map(|cells| level(sensors, rows, cells)),
        }
    }

    /// The motion alone, `tolerance` times the usual differences of sensors. `None` if it cannot be
    /// solved for.
    pub(super) fn motion(
        &self,
        sensors: &[Sensor],
        rows: &[Option<Row>],
        tolerance: f64,
    ) -> Option<Motion> {
        self.posed(sensors, rows, tolerance).motion()
    }

    /// Contradiction of rows and sensors, `tolerance` times the usual differences of sensors.
    /// `None` if the motion cannot be solved for.
    pub(super) fn score(
        &self,
        sensors: &[Sensor],
        rows: &[Option<Row>],
        tolerance: f64,
    ) -> Option<Score> {
        let posed = self.posed(sensors, rows, tolerance);
        posed.score(&posed.motion()?)
    }

    /// The same with the motion that is known, since the accelerometers are as they were.
    pub(super) fn score_moved(
        &self,
        sensors: &[Sensor],
        rows: &[Option<Row>],
        tolerance: f64,
        motion: &Motion,
    ) -> Option<Score> {
        self.posed(sensors, rows, tolerance).score(motion)
    }
}

impl Posed<'_> {
    /// The sensor's rigid-body row with moments and rotations over the length.
    fn scaled(&self, sensor: &Sensor) -> Vector6<f64> {
        let mut row = sensor.rigid();
        for i in 3..6 {
            row[i] /= self.bench.length;
        }
        row
    }

    /// Covariance of a row but for the sensor's place.
    fn spread(&self, sensor: &Sensor, row: &Row) -> DMatrix<f64> {
        let d = self.bench.motions;
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

    fn score(&self, motion: &Motion) -> Option<Score> {
        let mut score = Score {
            chi2: motion.chi2,
            freedom: motion.freedom,
            body: None,
        };
        if let Some((chi2, freedom, body)) = self.forces(motion) {
            score.chi2 += chi2;
            score.freedom += freedom;
            score.body = Some(body);
        }
        score.chi2.is_finite().then_some(score)
    }

    fn motion(&self) -> Option<Motion> {
        let d = self.bench.motions;
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
            .filter(|&i| eigen.eigenvalues[i] > 1e-6 * eigen.eigenvalues.max())
            .collect();
        let seen = DMatrix::from_fn(6, seen.len(), |i, j| eigen.eigenvectors[(i, seen[j])]);
        let r = seen.ncols();
        // Two passes: the second knows how far the interface rotates.
        let mut motion = DMatrix::<f64>::zeros(6, d);
        let mut covariance = DMatrix::zeros(0, 0);
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
                    let across = nalgebra::Matrix3::identity()
                        - sensor.direction * sensor.direction.transpose();
                    let turning = motion.rows(3, 3) / self.bench.length;
                    let across = DMatrix::from_fn(3, 3, |i, j| across[(i, j)]);
                    v += turning.tr_mul(&across) * &turning * (self.square * POSITION * POSITION);
                }
                let weight = v.cholesky()?.inverse();
                let phi = seen.tr_mul(&self.scaled(sensor));
                add_kronecker(&mut normal, phi.as_slice(), &weight);
                let weighed = &weight * &row.k;
                for i in 0..r {
                    for j in 0..d {
                        right[i * d + j] += phi[i] * weighed[j];
                    }
                }
                whole += row.k.dot(&weighed);
                count += d;
            }
            let factor = normal.cholesky()?;
            let solution = factor.solve(&right);
            motion = &seen * DMatrix::from_fn(r, d, |i, j| solution[i * d + j]);
            chi2 = (whole - solution.dot(&right)).max(0.0);
            freedom = count as f64 - (r * d) as f64;
            covariance = factor.inverse();
        }
        let seen = blocks(&seen, d);
        Some(Motion {
            rows: motion,
            covariance: &seen * covariance * seen.transpose(),
            chi2,
            freedom,
        })
    }

    /// The balance of the load cells: its sum of squares, degrees of freedom, and body.
    fn forces(&self, motion: &Motion) -> Option<(f64, f64, [f64; 10])> {
        let d = self.bench.motions;
        let count = self.bench.equations.nrows();
        if count == 0 {
            return None;
        }
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
            add_kronecker(&mut noise, x.as_slice(), &self.spread(sensor, row));
            if sensor.kind == Kind::Cell(Quantity::Force) {
                // A shifted load cell adds the moment δ x F.
                let product = &row.k * row.k.transpose() * (self.square * POSITION * POSITION);
                for axis in 0..3 {
                    let moment =
                        Vector3::ith(axis, 1.0).cross(&sensor.direction) / self.bench.length;
                    let x = Vector6::new(0.0, 0.0, 0.0, moment.x, moment.y, moment.z);
                    add_kronecker(&mut noise, x.as_slice(), &product);
                }
            }
        }
        let parts = parts();
        let wide = |m: &DMatrix<f64>| blocks(m, d);
        let select = wide(&self.bench.equations);
        let pile = |m: &DMatrix<f64>| DVector::from_fn(6 * d, |i, _| m[(i / d, i % d)]);
        let target = &select * pile(&resultants);
        let mut design = DMatrix::<f64>::zeros(count * d, 10);
        for (p, part) in parts.iter().enumerate() {
            let part = DMatrix::from_fn(6, 6, |i, j| part[(i, j)]);
            design.set_column(p, &(&select * pile(&(part * &motion.rows))));
        }
        let mut body = [0.0; 10];
        let (mut chi2, mut freedom) = (0.0, 0.0);
        for pass in 0..2 {
            let mut v = noise.clone();
            if pass > 0 {
                let mut m = DMatrix::<f64>::zeros(6, 6);
                for (part, value) in parts.iter().zip(body) {
                    m += DMatrix::from_fn(6, 6, |i, j| part[(i, j)] * value);
                }
                let m = wide(&m);
                v += &m * &motion.covariance * m.transpose();
            }
            let v = &select * v * select.transpose();
            let v = (&v + v.transpose()) * 0.5;
            let factor = v.cholesky()?;
            let l = factor.l();
            let a = l.solve_lower_triangular(&design)?;
            let b = l.solve_lower_triangular(&target)?;
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
            for (i, &value) in eigen.eigenvalues.iter().enumerate() {
                if value > 1e-9 {
                    let column = eigen.eigenvectors.column(i);
                    solution.axpy(column.dot(&right) / value, &column, 1.0);
                    rank += 1;
                }
            }
            chi2 = (b.norm_squared() - solution.dot(&right)).max(0.0);
            freedom = (count * d) as f64 - f64::from(rank);
            for (p, value) in body.iter_mut().enumerate() {
                *value = solution[p] * unit(p);
            }
        }
        // Back to metres.
        let power = |p: usize| match p {
            0 => 1.0,
            1..=3 => self.bench.length,
            _ => self.bench.length * self.bench.length,
        };
        for (p, value) in body.iter_mut().enumerate() {
            *value *= power(p);
        }
        Some((chi2, freedom, body))
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
        .filter(|&i| eigen.eigenvalues[i] > 1e-6 * eigen.eigenvalues.max().max(f64::MIN_POSITIVE))
        .map(|i| eigen.eigenvectors.column(i).transpose())
        .collect();
    DMatrix::from_fn(rows.len(), 6, |i, j| rows[i][j])
}

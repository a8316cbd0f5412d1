//! Directions of base acceleration that rise above their noise.

use super::record::{Record, highest};
use super::shrinkage::shrunk;
use nalgebra::{Complex, DMatrix, DVector, Matrix3, Matrix6, Vector6};
use std::collections::BTreeMap;

/// Power of a direction over its noise from which it counts as excited.
const EXCITED: f64 = 3.0;
/// Share of the largest eigenvalue below which rotations' noise is singular.
const SINGULAR: f64 = 1e-12;
/// Share of the noisiest component's noise below which a component is rounding.
const ROUNDING: f64 = 1e-20;

/// Stretches of equal width in frequency in which the motion along directions that rest is looked at: these, then
/// half as many, down to all lines together.
const STRETCHES: usize = 16;
/// Power over its noise from which a run's motion along the directions tells what moves with it.
const STRONG: f64 = 10.0;
/// Share by which the stated noise may be too small.
const TOO_SMALL: f64 = 0.05;

/// Directions in which the base moves.
#[derive(Clone, Debug)]
pub(super) struct Excited {
    /// Coordinates of an acceleration along the excited directions, k x 6: noise of one each.
    pub(super) coordinates: DMatrix<f64>,
    /// Acceleration of each coordinate, 6 x k.
    pub(super) directions: DMatrix<f64>,
    /// Mean power of each coordinate over all lines of all records.
    pub(super) power: Vec<f64>,
    /// Accelerations along the other directions that the sensors see, 6 x m: noise of one each.
    resting: DMatrix<f64>,
    /// Coordinates of an acceleration along these other directions, m x 6: noise of one each.
    rests: DMatrix<f64>,
    /// Lines of all records.
    pub(super) lines: f64,
    /// Share of the rotation along the directions that is taken for motion rather than noise.
    pub(super) believed: f64,
    /// Uncertainty of each direction, 6 x m: the base may move by these accelerations along the directions that rest,
    /// one standard deviation each, where it moves by one along the direction.
    pub(super) tilts: Vec<DMatrix<f64>>,
}

impl Excited {
    /// Of all records together; `None` where nothing moves.
    pub(super) fn of(records: &[Record]) -> Option<Self> {
        Self::above(EXCITED, records)
    }

    /// All directions that accelerometers see.
    pub(super) fn seen(records: &[Record]) -> Option<Self> {
        Self::above(f64::NEG_INFINITY, records)
    }

    /// Power over noise of the weakest direction.
    pub(super) fn weakest(&self) -> f64 {
        self.power.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Directions whose power is above so many times their noise.
    fn above(least: f64, records: &[Record]) -> Option<Self> {
        let (mut power, mut noise) = (Matrix6::zeros(), Matrix6::zeros());
        let mut lines = 0.0;
        for record in records {
            for (k, a) in record.base.iter().enumerate() {
                let level = record.level(k);
                for j in 0..6 {
                    for i in 0..6 {
                        power[(i, j)] += (a[i] * a[j].conj()).re / level;
                    }
                }
                lines += 1.0;
            }
            noise += record.noise.base * record.base.len() as f64;
        }
        if lines == 0.0 {
            return None;
        }
        power /= lines;
        noise /= lines;
        // Noise along directions that no accelerometer sees is zero, but for rounding. Scales make
        // translations and rotations comparable.
        let most = noise.diagonal().max();
        let scale: [f64; 6] = core::array::from_fn(|i| {
            let v: f64 = noise[(i, i)];
            if v > ROUNDING * most {
                1.0 / v.sqrt()
            } else {
                0.0
            }
        });
        let scaled = |m: &Matrix6<f64>| Matrix6::from_fn(|i, j| m[(i, j)] * scale[i] * scale[j]);
        let (power, noise) = (scaled(&power), scaled(&noise));
        let eigen = noise.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let seen: Vec<usize> = (0..6)
            .filter(|&i| eigen.eigenvalues[i] > 1e-9 * largest && largest > 0.0)
            .collect();
        if seen.is_empty() {
            return None;
        }
        let white = DMatrix::from_fn(seen.len(), 6, |r, j| {
            let i = seen[r];
            eigen.eigenvectors[(j, i)] / eigen.eigenvalues[i].sqrt()
        });
        let back = DMatrix::from_fn(6, seen.len(), |j, r| {
            let i = seen[r];
            eigen.eigenvectors[(j, i)] * eigen.eigenvalues[i].sqrt()
        });
        let whitened = &white * DMatrix::from_fn(6, 6, |i, j| power[(i, j)]) * white.transpose();
        let moving = whitened.symmetric_eigen();
        let excited: Vec<usize> = (0..seen.len())
            .filter(|&i| moving.eigenvalues[i] > least)
            .collect();
        if excited.is_empty() {
            return None;
        }
        let k = excited.len();
        let turn = DMatrix::from_fn(seen.len(), k, |i, r| moving.eigenvectors[(i, excited[r])]);
        let mut coordinates = turn.transpose() * &white;
        let mut directions = &back * turn;
        let others: Vec<usize> = (0..seen.len()).filter(|i| !excited.contains(i)).collect();
        let still = DMatrix::from_fn(seen.len(), others.len(), |i, r| {
            moving.eigenvectors[(i, others[r])]
        });
        let mut rests = still.transpose() * white;
        let mut resting = back * still;
        for j in 0..6 {
            for r in 0..others.len() {
                rests[(r, j)] *= scale[j];
                resting[(j, r)] *= if scale[j] > 0.0 { 1.0 / scale[j] } else { 0.0 };
            }
            for r in 0..k {
                coordinates[(r, j)] *= scale[j];
                directions[(j, r)] *= if scale[j] > 0.0 { 1.0 / scale[j] } else { 0.0 };
            }
        }
        let mut found = Self {
            coordinates,
            directions,
            power: excited.iter().map(|&i| moving.eigenvalues[i]).collect(),
            resting,
            rests,
            lines,
            believed: 1.0,
            tilts: Vec::new(),
        };
        found.tilts = (0..k)
            .map(|j| &found.resting * found.noise(j).sqrt())
            .collect();
        Some(found)
    }

    /// Largest deviation from chance, in standard deviations, of the motion along the directions that rest: by how much
    /// it follows the motion along the others, run by run and stretch by stretch of frequency. What follows it
    /// everywhere alike is no such motion, but turns the directions; a table whose shakers leak into each other
    /// near a resonance moves otherwise at each frequency, and what is taken off with the noise is motion then.
    ///
    /// The square of a regression coefficient over its variance is exponential by chance; a sum of them
    /// is made normal by its cube root (Wilson and Hilferty 1931).
    pub(super) fn wandering(&self, records: &[Record]) -> f64 {
        if self.rests.is_empty() {
            return 0.0;
        }
        let most = highest(records);
        let mut runs: BTreeMap<usize, Vec<Followed>> = BTreeMap::new();
        for record in records {
            let stretches = runs
                .entry(record.run)
                .or_insert_with(|| vec![Followed::new(self); STRETCHES]);
            for (k, f) in record.frequencies.iter().enumerate() {
                let at = (f / most * STRETCHES as f64) as usize;
                stretches[at.min(STRETCHES - 1)].add(self, record, k);
            }
        }
        let mut width = 1;
        let mut largest = 0.0_f64;
        while width <= STRETCHES {
            let (mut sum, mut terms) = (0.0, 0.0);
            for together in runs.values().flat_map(|all| all.chunks(width)) {
                let (own, count) = Followed::of(together).statistic();
                sum += own;
                terms += count;
            }
            if terms > 0.0 {
                let ratio = sum / (terms * (1.0 + TOO_SMALL));
                let spread = 1.0 / (9.0 * terms);
                largest = largest.max((ratio.cbrt() - (1.0 - spread)) / spread.sqrt());
            }
            width *= 2;
        }
        largest
    }

    /// Variance by noise of the motion along a direction that rests, for a motion of one along coordinate `j`.
    fn noise(&self, j: usize) -> f64 {
        0.5 / (self.lines * (self.power[j] - 1.0).max(1.0))
    }

    /// Takes off as much of the rotation along the directions as their noise explains: a table that only
    /// translates rotates by nothing, and what is measured of it is noise. Translations follow as their noise
    /// does the rotation's, so that A may lie anywhere. Nothing changes where the rotation is far from noise, or noise
    /// could not turn each direction at will.
    pub(super) fn steady(&mut self) {
        let rotations = self.resting.rows(3, 3);
        let spread = rotations * rotations.transpose();
        let spread = Matrix3::from_fn(|i, j| spread[(i, j)]);
        // To a diagonal of one, so that axes compare.
        let scale = spread.diagonal().map(f64::sqrt);
        let alike = Matrix3::from_fn(|i, j| spread[(i, j)] / (scale[i] * scale[j]));
        let Some(whiten) = inverse_root(&alike) else {
            return;
        };
        let whiten = whiten * Matrix3::from_diagonal(&scale.map(|s| 1.0 / s));
        let measured: Vec<f64> = (0..self.power.len())
            .flat_map(|j| {
                let rotation = self.directions.fixed_view::<3, 1>(3, j);
                let of_noise = whiten * rotation / self.noise(j).sqrt();
                [of_noise.x, of_noise.y, of_noise.z]
            })
            .collect();
        let found = shrunk(&measured);
        self.believed = found.share;
        // Motion along the directions that rest, to rotations whose noise is one along each axis.
        let turn = DMatrix::from_fn(3, 3, |i, j| whiten[(i, j)]) * rotations;
        let still = DMatrix::identity(turn.ncols(), turn.ncols()) - turn.transpose() * &turn;
        let mut tilts = Vec::with_capacity(self.power.len());
        for j in 0..self.power.len() {
            let noise = self.noise(j).sqrt();
            let taken = DVector::from_fn(3, |i, _| found.taken[3 * j + i] * noise);
            let change = &self.resting * (turn.transpose() * taken);
            let mut direction = self.directions.column_mut(j);
            direction -= change;
            let left = DMatrix::from_fn(3, turn.ncols(), |i, k| {
                found.variances[3 * j + i].sqrt() * turn[(i, k)]
            });
            // Rotations that are left, and what of the motion does not rotate.
            let tilt = turn.transpose() * left + &still;
            tilts.push(&self.resting * tilt * noise);
        }
        self.tilts = tilts;
    }

    /// Coordinates of the motion whose work `vᵀ W v`, at the powers of this excitation, is largest,
    /// for a work of one; `None` where none is positive.
    pub(super) fn strongest(&self, work: &DMatrix<f64>) -> Option<DVector<f64>> {
        let k = self.power.len();
        let root: Vec<f64> = self.power.iter().map(|p| p.sqrt()).collect();
        let symmetric = DMatrix::from_fn(k, k, |i, j| {
            0.5 * (work[(i, j)] + work[(j, i)]) * root[i] * root[j]
        });
        let eigen = symmetric.symmetric_eigen();
        let top = eigen.eigenvalues.imax();
        let v = DVector::from_fn(k, |i, _| eigen.eigenvectors[(i, top)] * root[i]);
        let square = v.dot(&(work * &v));
        (square > 0.0).then(|| v / square.sqrt())
    }

    /// Takes the accelerations along other directions off, with their noise. Nothing changes where
    /// all six are excited.
    pub(super) fn project(&self, records: &mut [Record]) {
        if self.power.len() == 6 {
            return;
        }
        let onto = &self.directions * &self.coordinates;
        let onto = Matrix6::from_fn(|i, j| onto[(i, j)]);
        let complex = onto.map(nalgebra::Complex::from);
        for record in records {
            for a in &mut record.base {
                *a = complex * *a;
            }
            record.noise.base = onto * record.noise.base * onto.transpose();
        }
    }
}

/// Inverse of the symmetric root; `None` where there is none.
fn inverse_root(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    if !m.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = m.symmetric_eigen();
    let least = SINGULAR * eigen.eigenvalues.max();
    if !eigen.eigenvalues.iter().all(|x| *x > least) {
        return None;
    }
    let roots = Matrix3::from_diagonal(&eigen.eigenvalues.map(|x| 1.0 / x.sqrt()));
    Some(eigen.eigenvectors * roots * eigen.eigenvectors.transpose())
}

/// Products of the motion along the directions and along those that rest, over some lines of a run.
#[derive(Clone)]
struct Followed {
    /// Of the directions, k x k.
    moving: DMatrix<Complex<f64>>,
    /// Of those that rest with these, m x k.
    across: DMatrix<Complex<f64>>,
    /// Noise of those that rest, summed over the lines.
    noise: DVector<f64>,
    lines: f64,
}

impl Followed {
    fn new(excited: &Excited) -> Self {
        let (k, m) = (excited.power.len(), excited.rests.nrows());
        Self {
            moving: DMatrix::zeros(k, k),
            across: DMatrix::zeros(m, k),
            noise: DVector::zeros(m),
            lines: 0.0,
        }
    }

    fn add(&mut self, excited: &Excited, record: &Record, k: usize) {
        let Some(a) = record.base.get(k) else {
            return;
        };
        let along = |rows: &DMatrix<f64>| {
            let each = rows.row_iter();
            let sums = each.map(|row| row.iter().zip(a.iter()).map(|(x, a)| a * *x).sum());
            DVector::<Complex<f64>>::from_iterator(rows.nrows(), sums)
        };
        let level = record.level(k);
        let (moves, rests) = (along(&excited.coordinates), along(&excited.rests));
        let moves_conjugate = moves.adjoint() * Complex::from(1.0 / level);
        self.moving += &moves * &moves_conjugate;
        self.across += rests * moves_conjugate;
        for (sum, row) in self.noise.iter_mut().zip(excited.rests.row_iter()) {
            let row = Vector6::from_fn(|i, _| row[i]);
            *sum += row.dot(&(record.noise.base * row));
        }
        self.lines += 1.0;
    }

    fn of(parts: &[Self]) -> Self {
        let mut all = parts[0].clone();
        for part in &parts[1..] {
            all.moving += &part.moving;
            all.across += &part.across;
            all.noise += &part.noise;
            all.lines += part.lines;
        }
        all
    }

    /// Sum of the squares of the regression coefficients over their variances, and their number.
    fn statistic(&self) -> (f64, f64) {
        let (mut sum, mut terms) = (0.0, 0.0);
        if self.lines == 0.0 {
            return (sum, terms);
        }
        let eigen = self.moving.clone().symmetric_eigen();
        for (power, motion) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            if *power < STRONG * self.lines {
                continue;
            }
            for (z, noise) in (&self.across * motion).iter().zip(&self.noise) {
                let variance = power * noise / self.lines;
                if variance > 0.0 {
                    sum += z.norm_sqr() / variance;
                    terms += 1.0;
                }
            }
        }
        (sum, terms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Stream;

    /// Standard deviation of each rotation, of 100 lines and a power of 51: √(0.5 / (100 · 50)).
    const NOISE: f64 = 0.01;

    /// Three directions whose rotations are these, and what noise adds.
    fn turned(rotations: [f64; 9], stream: &mut Stream) -> Excited {
        let mut directions = DMatrix::identity(6, 3);
        for j in 0..3 {
            for i in 0..3 {
                directions[(3 + i, j)] = rotations[3 * j + i] + NOISE * stream.normal().re;
            }
        }
        let resting = DMatrix::from_fn(6, 3, |i, j| f64::from(u8::from(i == 3 + j)));
        Excited {
            coordinates: DMatrix::identity(3, 6),
            directions,
            power: vec![51.0; 3],
            tilts: vec![&resting * NOISE; 3],
            resting,
            rests: DMatrix::from_fn(3, 6, |i, j| f64::from(u8::from(j == 3 + i))),
            lines: 100.0,
            believed: 1.0,
        }
    }

    /// Mean squares of the error of all rotations and of what is claimed of them, over the square of their noise, of a
    /// thousand draws.
    fn squares(rotations: [f64; 9]) -> [f64; 2] {
        let mut stream = Stream::new(7, &["steady"]);
        let (mut errors, mut claimed) = (0.0, 0.0);
        for _ in 0..1000 {
            let mut excited = turned(rotations, &mut stream);
            excited.steady();
            for (k, truth) in rotations.iter().enumerate() {
                errors += (excited.directions[(3 + k % 3, k / 3)] - truth).powi(2);
                claimed += excited.tilts[k / 3].row(3 + k % 3).norm_squared();
            }
        }
        [errors, claimed].map(|x| x / (9000.0 * NOISE * NOISE))
    }

    /// A table that rests is known better than its sensors tell, 0.435 of whose noise's power remain and 0.505 are claimed
    /// by another program, and one that rotates by far more than noise as well as they do. Means of 9000 squares spread
    /// by 1.5 %.
    #[test]
    fn rotations_err_by_as_much_as_is_claimed() {
        let [errors, claimed] = squares([0.0; 9]);
        assert!((0.41..0.46).contains(&errors), "{errors}");
        assert!((0.48..0.53).contains(&claimed), "{claimed}");
        let [errors, claimed] = squares([20.0 * NOISE; 9]);
        assert!((0.95..1.05).contains(&errors), "{errors}");
        assert!((0.95..1.05).contains(&claimed), "{claimed}");
    }

    /// The motion that is left, and what is claimed of it, are the same wherever A lies: with A three metres from the
    /// sensors, what noise turns moves A as well.
    #[test]
    fn a_table_at_rest_is_the_same_wherever_a_lies() {
        let mut stream = Stream::new(11, &["anywhere"]);
        let records = leaking(0.0, &mut stream);
        let mut carry = Matrix6::identity();
        // α x r of A, 3 m and 1 m from the sensors.
        for (i, j, x) in [(0, 4, 3.0), (1, 3, -3.0), (1, 5, 1.0), (2, 4, -1.0)] {
            carry[(i, j)] = x;
        }
        let carried: Vec<Record> = (records.iter())
            .map(|record| {
                let mut there = record.clone();
                let complex = carry.map(Complex::from);
                there.base.iter_mut().for_each(|a| *a = complex * *a);
                there.noise.base = carry * record.noise.base * carry.transpose();
                there
            })
            .collect();
        let [here, there] = [&records, &carried].map(|records| {
            let mut excited = Excited::of(records).unwrap();
            let before = excited.directions.clone();
            excited.steady();
            assert!((&excited.directions - before).norm() > 1e-3);
            excited
        });
        let carry = DMatrix::from_fn(6, 6, |i, j| carry[(i, j)]);
        let back = carry.clone().try_inverse().unwrap();
        let onto = |e: &Excited| &e.directions * &e.coordinates;
        let off = &carry * onto(&here) * &back - onto(&there);
        assert!(off.norm() < 1e-9, "{off}");
        assert!((here.believed - there.believed).abs() < 1e-9);
        // Directions come in any order.
        let of = |e: &Excited, carry: &DMatrix<f64>| {
            let mut each: Vec<_> = (e.power.iter().zip(&e.tilts))
                .map(|(power, tilt)| (*power, carry * tilt * tilt.transpose() * carry.transpose()))
                .collect();
            each.sort_by(|a, b| a.0.total_cmp(&b.0));
            each
        };
        let own = of(&there, &DMatrix::identity(6, 6));
        for ((_, here), (_, there)) in of(&here, &carry).iter().zip(&own) {
            assert!((here - there).norm() < 1e-9 * here.norm(), "{here} {there}");
        }
    }

    /// Lines of three runs, each shaken along one axis at ten times the noise, of a base that rests otherwise but for a
    /// share of that motion which rises from nothing to `leak` of it, with a phase of 90 degrees.
    fn leaking(leak: f64, stream: &mut Stream) -> Vec<Record> {
        let run = |run: usize| {
            let frequencies: Vec<f64> = (1..=400).map(|k| 0.1 * f64::from(k)).collect();
            let line = |f: &f64| {
                let mut a = Vector6::from_fn(|_, _| stream.normal() * 0.5_f64.sqrt());
                let motion = stream.normal() * 50.0_f64.sqrt();
                a[run] += motion;
                a[3 + run] += motion * Complex::new(0.0, leak * f / 40.0);
                a
            };
            let base: Vec<_> = frequencies.iter().map(line).collect();
            Record {
                run,
                force: vec![Vector6::zeros(); base.len()],
                frequencies,
                base,
                noise: super::super::record::Noise {
                    base: Matrix6::identity(),
                    force: Matrix6::identity(),
                },
                level: Vec::new(),
                equations: Matrix6::identity(),
            }
        };
        (0..3).map(run).collect()
    }

    /// By chance the deviation is below 4.5 in all of 200 tests (one of 60,000 by the normal distribution, of each of
    /// five looks) and on average that of the largest of five; a leak whose motion has no more than the noise's
    /// power at the last lines, and a third of it on average, is seen.
    #[test]
    fn a_base_that_leaks_into_axes_at_rest_is_seen() {
        let mut stream = Stream::new(10, &["wandering"]);
        let mut of = |leak: f64| {
            let records = leaking(leak, &mut stream);
            let excited = Excited::of(&records).unwrap();
            assert_eq!(excited.power.len(), 3);
            excited.wandering(&records)
        };
        let quiet: Vec<f64> = (0..200).map(|_| of(0.0)).collect();
        assert!(quiet.iter().all(|z| *z < 4.5), "{quiet:?}");
        let above = quiet.iter().filter(|z| **z > 2.0).count();
        // One in ten by chance, and 20 of them spread by 4.
        assert!(above <= 32, "{above}");
        for _ in 0..20 {
            let z = of(0.1);
            assert!(z > 4.5, "{z}");
        }
    }

    /// Of a base that moves along one axis, motion along the two others is as uncertain as measured: no rotation
    /// tells of it.
    #[test]
    fn translations_at_rest_are_as_uncertain_as_measured() {
        let mut stream = Stream::new(12, &["steady"]);
        let mut excited = turned([0.0; 9], &mut stream);
        excited.coordinates = excited.coordinates.rows(0, 1).into_owned();
        excited.directions = excited.directions.columns(0, 1).into_owned();
        excited.power = vec![51.0];
        excited.resting = DMatrix::from_fn(6, 5, |i, j| f64::from(u8::from(i == 1 + j)));
        excited.steady();
        assert_eq!(excited.tilts.len(), 1);
        let deviations: Vec<f64> = excited.tilts[0].row_iter().map(|r| r.norm()).collect();
        for i in [1, 2] {
            assert!((deviations[i] - NOISE).abs() < 1e-12, "{deviations:?}");
        }
        assert!(deviations[0] == 0.0 && excited.believed < 1.0);
        // Three terms are hardly believed to be noise alone.
        for i in 3..6 {
            assert!(
                (0.7 * NOISE..1.05 * NOISE).contains(&deviations[i]),
                "{deviations:?}"
            );
        }
    }

    /// A rotation that the sensors cannot have made up stays as it is.
    #[test]
    fn a_rotation_about_an_axis_without_noise_is_left_alone() {
        let mut stream = Stream::new(9, &["steady"]);
        let mut excited = turned([0.0; 9], &mut stream);
        excited.resting = excited.resting.columns(0, 2).into_owned();
        let before = excited.directions.clone();
        excited.steady();
        assert_eq!(excited.directions, before);
        assert_eq!(excited.believed, 1.0);
    }
}

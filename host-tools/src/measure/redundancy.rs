//! Noise of accelerometers on a rigid interface, from readings that no motion of it explains.
//!
//! A combination of n sensors that no rigid motion shows in reads noise alone: n - 6 of them. With three triads they
//! do not tell nine variances. Where one shaker moves all, five combinations of the six accelerations are noise
//! beside the strongest as well, and tell the rest.

use super::geometry::RunGeometry;
use crate::likelihood::noise::{Beside, BesideStrongest};
use crate::setup::Setup;
use nalgebra::{DMatrix, DVector, Matrix6};

/// Most steps towards the most likely variances.
const STEPS: usize = 400;
/// Relative change of every variance below which they no longer change.
const SETTLED: f64 = 1e-4;
/// Share of all readings below which what a sensor shows in them is rounding.
const UNSEEN: f64 = 1e-12;
/// Eigenvalue of C C' over the largest, for the accelerations C of each sensor, above which the sensors see it.
const RANGE: f64 = 1e-12;
/// Power beside the strongest motion over that of the noise from which there is more motion than one.
const ONE_MOTION: f64 = 1.2;

/// Readings of accelerometers that no rigid motion explains.
pub(super) struct Redundancy {
    sensors: Vec<usize>,
    scales: Vec<f64>,
    /// The six accelerations that one m/s² of each sensor stands for, 6 x n.
    columns: DMatrix<f64>,
    /// Combinations of the sensors that no rigid motion shows in, one a column.
    null: DMatrix<f64>,
    sum: DVector<f64>,
    squares: DMatrix<f64>,
    count: f64,
}

/// Combinations of sensors that read noise alone, and their spread.
struct Reading {
    /// Shares of the sensors, d x n: the real part, and the imaginary one where there is one.
    shares: Vec<DMatrix<f64>>,
    /// Real part of their covariance, d x d.
    spread: DMatrix<f64>,
    /// Real values that it is the mean of.
    count: f64,
}

impl Redundancy {
    /// `None` where the sensors are no more than the motions they tell.
    pub(super) fn new(setup: &Setup, geometry: &RunGeometry) -> Option<Self> {
        let of = |k: &usize| geometry.columns[*k][..6].iter().any(|x| *x != 0.0);
        let sensors: Vec<usize> = (0..setup.accelerometers.len()).filter(of).collect();
        let scales: Vec<f64> = sensors
            .iter()
            .map(|&k| setup.accelerometers[k].scale)
            .collect();
        let of = |i, s: usize| geometry.columns[sensors[s]][i] / scales[s];
        let columns = DMatrix::from_fn(6, sensors.len(), of);
        Self::of(sensors, scales, columns)
    }

    /// Of sensors with their scales and the six accelerations of each.
    fn of(sensors: Vec<usize>, scales: Vec<f64>, columns: DMatrix<f64>) -> Option<Self> {
        let n = sensors.len();
        let eigen = (columns.transpose() * &columns).symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let null: Vec<usize> = (0..n)
            .filter(|&i| eigen.eigenvalues[i] < 1e-9 * largest)
            .collect();
        if null.is_empty() {
            return None;
        }
        let d = null.len();
        Some(Self {
            null: DMatrix::from_fn(n, d, |i, c| eigen.eigenvectors[(i, null[c])]),
            sum: DVector::zeros(d),
            squares: DMatrix::zeros(d, d),
            count: 0.0,
            sensors,
            scales,
            columns,
        })
    }

    pub(super) fn add(&mut self, sample: &[f32]) {
        let d = self.sum.len();
        let mut left = DVector::zeros(d);
        for (i, (&k, scale)) in self.sensors.iter().zip(&self.scales).enumerate() {
            let x = f64::from(sample.get(k).copied().unwrap_or(0.0)) * scale;
            for c in 0..d {
                left[c] += self.null[(i, c)] * x;
            }
        }
        self.sum += &left;
        self.squares.ger(1.0, &left, &left, 1.0);
        self.count += 1.0;
    }

    /// Covariance of the noise of the six accelerations: that of independent sensors with the variances that are
    /// most likely to leave what is left, and what is beside the strongest motion where there is but one. Variances
    /// that cannot be told apart start alike, and stay so. `None` where nothing is left, or there is more than one
    /// motion.
    pub(super) fn noise(&self, beside: Option<&BesideStrongest>) -> Option<Matrix6<f64>> {
        if self.count < 2.0 {
            return None;
        }
        let mean = &self.sum / self.count;
        let spread = &self.squares / self.count - &mean * mean.transpose();
        let alike = spread.trace() / self.null.ncols() as f64;
        let mut readings = vec![Reading {
            shares: vec![self.null.transpose()],
            spread,
            count: self.count,
        }];
        if let Some(beside) = beside {
            readings.extend(self.beside(beside));
        }
        let start = DVector::from_element(self.sensors.len(), alike);
        // Below the scatter of the mean it is chance.
        let least = alike * (2.0 / self.count).sqrt();
        let variances = most_likely(&readings, start, least)?;
        if beside.is_some() && power(&readings[1..], &variances)? > ONE_MOTION {
            return None;
        }
        let mut noise = Matrix6::zeros();
        for (column, variance) in self.columns.column_iter().zip(variances.iter()) {
            noise += Matrix6::from_fn(|i, j| column[i] * column[j] * variance);
        }
        (alike > 0.0).then_some(noise)
    }

    /// The combinations of the accelerations that are seen beside the strongest s = w'b, five of six: with b = h s they
    /// are Q'(b - h s) for Q'w = 0, which is Q'(I - h w') C n for the noise n of the sensors.
    fn beside(&self, beside: &BesideStrongest) -> Vec<Reading> {
        let w = &beside.weights;
        // The accelerations that the sensors see, and of these those to which w is at right angles.
        let seen = basis(&self.columns * self.columns.transpose(), RANGE);
        let along = &seen * w;
        if along.norm_squared() <= 0.0 {
            return Vec::new();
        }
        let across = DMatrix::identity(along.len(), along.len())
            - &along * along.transpose() / along.norm_squared();
        let others = basis(across, 0.5) * seen;
        let strongest = w.transpose() * &self.columns;
        let of = |window: &Beside| {
            let response = &others * window.response.map(|h| h.re);
            let turned = &others * window.response.map(|h| h.im);
            Reading {
                shares: vec![
                    &others * &self.columns - response * &strongest,
                    turned * &strongest,
                ],
                spread: &others * window.left * others.transpose(),
                count: window.count,
            }
        };
        beside.windows.iter().map(of).collect()
    }
}

/// Eigenvectors of a symmetric matrix, one a row, whose eigenvalues are above a share of the largest.
fn basis(matrix: DMatrix<f64>, share: f64) -> DMatrix<f64> {
    let eigen = matrix.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let kept: Vec<usize> = (0..eigen.eigenvalues.len())
        .filter(|&i| eigen.eigenvalues[i] > share * largest)
        .collect();
    DMatrix::from_fn(kept.len(), eigen.eigenvalues.len(), |r, j| {
        eigen.eigenvectors[(j, kept[r])]
    })
}

/// The variances v of independent sensors that are most likely for some readings, by steps that raise the likelihood
/// and keep them positive (Zhou et al. 2019): v_i ← v_i √(Σ c (A'S⁻¹ R S⁻¹ A)_ii / Σ c (A'S⁻¹ A)_ii), for readings
/// with shares A, expected covariance S = A V A', found covariance R and count c. None falls below the `least`.
/// `None` where S is singular.
fn most_likely(readings: &[Reading], start: DVector<f64>, least: f64) -> Option<DVector<f64>> {
    let mut variances = start;
    for _ in 0..STEPS {
        let before = variances.clone();
        variances = step(readings, &before)?.map(|v| v.max(least));
        let change = (&variances - &before).component_div(&before).amax();
        if change < SETTLED {
            break;
        }
    }
    Some(variances)
}

/// Variances after one step; `None` where an expected covariance is singular.
fn step(readings: &[Reading], variances: &DVector<f64>) -> Option<DVector<f64>> {
    let n = variances.len();
    let (mut found, mut expected) = (DVector::<f64>::zeros(n), DVector::<f64>::zeros(n));
    for reading in readings {
        let inverse = reading.expected(variances).cholesky()?.inverse();
        for shares in &reading.shares {
            let weighted = &inverse * shares;
            let spread = &reading.spread * &weighted;
            for i in 0..n {
                found[i] += reading.count * weighted.column(i).dot(&spread.column(i));
                expected[i] += reading.count * shares.column(i).dot(&weighted.column(i));
            }
        }
    }
    let shares = expected.component_mul(variances);
    let least = UNSEEN * shares.sum();
    let next = DVector::from_fn(n, |i, _| {
        if shares[i] <= least {
            return variances[i];
        }
        variances[i] * (found[i] / expected[i]).max(0.0).sqrt()
    });
    next.iter().all(|v| v.is_finite()).then_some(next)
}

/// Mean power of readings over what some variances let expect.
fn power(readings: &[Reading], variances: &DVector<f64>) -> Option<f64> {
    let (mut found, mut expected) = (0.0, 0.0);
    for reading in readings {
        let inverse = reading.expected(variances).cholesky()?.inverse();
        found += reading.count * (inverse * &reading.spread).trace();
        expected += reading.count * reading.spread.nrows() as f64;
    }
    Some(found / expected)
}

impl Reading {
    /// A V A'.
    fn expected(&self, variances: &DVector<f64>) -> DMatrix<f64> {
        let d = self.spread.nrows();
        let mut sum = DMatrix::zeros(d, d);
        for shares in &self.shares {
            for (column, variance) in shares.column_iter().zip(variances.iter()) {
                sum.ger(*variance, &column, &column, 1.0);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::noise::beside_strongest;
    use crate::simulate::Stream;
    use nalgebra::{Complex, Vector3};

    /// Variances of three triads that differ by up to 25.
    const VARIANCES: [f64; 9] = [1.0, 4.0, 2.0, 25.0, 1.0, 3.0, 1.0, 9.0, 1.0];
    const LINES: usize = 2500;

    /// Readings of three triads of one component each: what a unit of the six accelerations is for each.
    fn readings() -> DMatrix<f64> {
        let places = [[0.4, 0.0, 0.1], [-0.3, 0.35, 0.0], [-0.2, -0.4, -0.1]];
        DMatrix::from_fn(9, 6, |s, c| {
            let axis = Vector3::ith(s % 3, 1.0);
            match c.checked_sub(3) {
                None => axis[c],
                Some(turn) => Vector3::ith(turn, 1.0)
                    .cross(&Vector3::from(places[s / 3]))
                    .dot(&axis),
            }
        })
    }

    /// Noise that is found of the six accelerations beside motions of some powers, over the true one: its least and
    /// its largest ratio in any direction, first from redundancy alone. `None` where it is not found.
    fn found(motions: &[f64]) -> [Option<[f64; 2]>; 2] {
        found_by(&readings(), motions)
    }

    /// The same of nine sensors that see some of the accelerations.
    fn found_by(readings: &DMatrix<f64>, motions: &[f64]) -> [Option<[f64; 2]>; 2] {
        let inverse = readings.clone().pseudo_inverse(1e-12).unwrap();
        let mut redundancy =
            Redundancy::of((0..9).collect(), vec![1.0; 9], inverse.clone()).unwrap();
        let mut stream = Stream::new(11, &["redundancy"]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut resultants: [Vec<Complex<f64>>; 12] = Default::default();
        for _ in 0..LINES {
            let mut normal = |power: f64| {
                let size = half * power.sqrt();
                stream.normal() * size
            };
            let mut sensors = [Complex::default(); 9];
            for (m, power) in motions.iter().enumerate() {
                let motion = normal(*power);
                for (s, sensor) in sensors.iter_mut().enumerate() {
                    // Each along an axis of its own, with some of all others.
                    let along = |c: usize| if c == m { 1.0 } else { 0.05 };
                    let all = (0..6).map(|c| readings[(s, c)] * along(c)).sum::<f64>();
                    *sensor += motion * all;
                }
            }
            for (sensor, variance) in sensors.iter_mut().zip(VARIANCES) {
                *sensor += normal(variance);
            }
            for part in [sensors.map(|x| x.re), sensors.map(|x| x.im)] {
                redundancy.add(&part.map(|x| (x / half) as f32));
            }
            for (c, signal) in resultants.iter_mut().enumerate() {
                let seen = (0..9).map(|s| sensors[s] * inverse[(c % 6, s)]);
                signal.push(seen.sum());
            }
        }
        let views: [&[Complex<f64>]; 12] = core::array::from_fn(|c| resultants[c].as_slice());
        let truth = &inverse
            * DMatrix::from_diagonal(&DVector::from_row_slice(&VARIANCES))
            * inverse.transpose();
        let seen = basis(truth.clone(), 1e-9);
        let truth = &seen * truth * seen.transpose();
        let white = truth.cholesky().unwrap().l().try_inverse().unwrap();
        let ratios = |noise: Matrix6<f64>| {
            let noise = &seen * noise * seen.transpose();
            let values = (&white * noise * white.transpose())
                .symmetric_eigen()
                .eigenvalues;
            [values.min(), values.max()]
        };
        let alone = redundancy.noise(None).unwrap();
        let beside = beside_strongest(&alone, &views).unwrap();
        [Some(alone), redundancy.noise(Some(&beside))].map(|noise| noise.map(ratios))
    }

    /// Redundancy tells three of nine variances; what is beside the one motion tells the rest. The sums of some 40,000
    /// and 3,750 values spread by 1 to 4 %, the least and largest of six eigenvalues by up to 10 %: 0.90 and 1.04 were
    /// measured, and 0.19 and 3.43 from redundancy alone.
    #[test]
    fn one_motion_tells_the_noise_of_all_sensors() {
        for power in [1e4, 1e2] {
            let [alone, beside] = found(&[power]).map(Option::unwrap);
            assert!(alone[0] < 0.5 && alone[1] > 2.0, "{alone:?}");
            assert!(beside[0] > 0.85 && beside[1] < 1.15, "{beside:?}");
        }
    }

    /// Sensors that see three of the six accelerations, as in the plane of a fork.
    #[test]
    fn accelerations_that_are_not_seen_do_not_matter() {
        let mut plane = readings();
        for c in [1, 3, 5] {
            plane.column_mut(c).fill(0.0);
        }
        // A plane's third sensor reads nothing: it is turned into one along z.
        for s in [1, 4, 7] {
            let other = plane.row(s + 1).into_owned();
            plane.set_row(s, &other);
        }
        let [_, beside] = found_by(&plane, &[1e4]).map(Option::unwrap);
        assert!(beside[0] > 0.85 && beside[1] < 1.15, "{beside:?}");
    }

    /// Motions beside the strongest are not taken for noise where they are larger than it: ten times the variance of
    /// most sensors.
    #[test]
    fn further_motions_are_no_noise() {
        for motions in [&[1e4, 1e4][..], &[1e4, 1e2], &[1e4, 10.0], &[1e4; 6]] {
            let [alone, beside] = found(motions);
            assert!(
                alone.is_some() && beside.is_none(),
                "{motions:?}: {beside:?}"
            );
        }
    }

    /// A second motion as small as the noise is taken for some of it: 0.77 to 1.36 was measured.
    #[test]
    fn a_motion_as_small_as_the_noise_counts_as_noise() {
        let [_, beside] = found(&[1e4, 1.0]).map(Option::unwrap);
        assert!(beside[0] > 0.7 && beside[1] < 2.0, "{beside:?}");
    }

    /// Two of three sensors of one direction have no noise: without a limit their variances fall until the covariance is
    /// singular, and the noise is still told. The other five directions have no redundancy and keep the variance of
    /// all.
    #[test]
    fn sensors_without_noise_do_not_stop_the_search() {
        let mut columns = DMatrix::zeros(6, 8);
        for c in 1..6 {
            for s in 1..6 {
                columns[(c, s)] = if s == c { 1.0 } else { 0.3 };
            }
        }
        for s in [0, 6, 7] {
            columns[(0, s)] = 1.0 / 3.0;
        }
        let mut redundancy = Redundancy::of((0..8).collect(), vec![1.0; 8], columns).unwrap();
        let mut stream = Stream::new(12, &["one direction"]);
        for _ in 0..LINES {
            let mut sample = [0.0; 8];
            sample[0] = stream.normal().re as f32;
            redundancy.add(&sample);
        }
        let noise = redundancy.noise(None).unwrap();
        for i in 1..6 {
            // The trace of what is left is two thirds of the one variance, over two combinations: a third, and in
            // each direction 1 + 4 · 0.3² times that. 2500 samples spread by 3 %.
            assert!((noise[(i, i)] * 3.0 / 1.36 - 1.0).abs() < 0.12, "{noise}");
        }
        assert!((0.05..0.2).contains(&noise[(0, 0)]), "{}", noise[(0, 0)]);
    }
}

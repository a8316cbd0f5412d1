//! The equations of a set of masslines about a point, and their weights.

use super::measurement::{Measurement, Vector10, measurement_matrix};
use crate::algebra::{half, inverse_lower, larger, lower, multiply_left};
use crate::geometry::transfer;
use crate::masslines::{Massline, Masslines};
use nalgebra::{Matrix6, Vector3, Vector6};

/// Least number of independent lines behind a pair: the elastic terms may leave it a small share of those in the band.
const LEAST: f64 = 1e-6;

/// Second moments by which noise turns the directions of a set: half of a line's noise along those
/// that it does not excite, since real moments hold half of it.
fn turn<const PAIRS: usize>(set: &Masslines<PAIRS>) -> Matrix6<f64> {
    (set.noise() - set.pull()) * (0.5 / larger(set.lines(), LEAST))
}

/// Noise with which an excitation of a set is compared: the noise in its pairs, and the rotation of
/// the excited directions by the rest of the noise, which averages out.
pub(super) fn floor<const PAIRS: usize>(set: &Masslines<PAIRS>) -> Matrix6<f64> {
    set.pull() + turn(set)
}

pub(super) const ONES: Vector6<f64> = Vector6::new(1.0, 1.0, 1.0, 1.0, 1.0, 1.0);

/// Weights of the equations of a pair: inverse variances, none far above the others.
pub(super) fn weights(variance: &Vector6<f64>) -> Vector6<f64> {
    const SMALLEST: f64 = 1e-6;
    let largest = variance.max();
    variance.map(|v| {
        if largest > 0.0 {
            1.0 / v.max(SMALLEST * largest)
        } else {
            0.0
        }
    })
}

/// The measurement matrix of an acceleration in the equations `e`.
#[inline(never)] // One matrix on the caller's stack.
pub(super) fn measured(e: &Matrix6<f64>, acceleration: &Vector6<f64>, mass: f64) -> Measurement {
    let mut b = measurement_matrix(acceleration, mass);
    for column in &mut b.data.0 {
        let given = core::mem::take(column);
        for (x, e) in given.iter().zip(&e.data.0) {
            // Two thirds of the matrix are zero, and a third of the equations.
            if *x == 0.0 {
                continue;
            }
            for (sum, e) in column.iter_mut().zip(e) {
                if *e != 0.0 {
                    *sum += e * x;
                }
            }
        }
    }
    b
}

/// The equations of a set about a point, and how they are weighed.
pub(super) struct Weighed {
    /// The matrix in front of `M a - f`.
    pub(super) rows: Matrix6<f64>,
    pub(super) count: usize,
    /// Mean variance of the equations as the set has them; the rows take it, and what noise turns
    /// the set's directions by, to one. Zero where the variances are the set's own.
    mean: f64,
    /// Share of the set's own variance in the variance of one, by row.
    shares: Vector6<f64>,
}

impl Weighed {
    /// About a point that is `shift` (m) away from the set's. The noise along the directions that
    /// a set does not excite turns those that it does, see [`turn`]. No scatter of the lines shows
    /// that, and it is the same for all of them. With `body`, which is σ about that point, the
    /// forces that go with it are weighed like those that the lines leave.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn new<const PAIRS: usize>(
        set: &Masslines<PAIRS>,
        shift: &Vector3<f64>,
        mass: f64,
        body: Option<&Vector10>,
    ) -> Self {
        // Of the variances, that is rounding.
        const NOTHING: f64 = 1e-9;
        let equations = set.equations().at(shift);
        let mut weighed = Self {
            rows: *equations.rows(),
            count: equations.count(),
            mean: 0.0,
            shares: ONES,
        };
        let Some(body) = body else {
            return weighed;
        };
        let mut turned = turn(set);
        let columns = transfer(shift) * half(&turned);
        turned.fill(0.0);
        for column in columns.column_iter() {
            let b = measured(&weighed.rows, &column.into_owned(), mass);
            let force = b * body;
            turned.ger(1.0, &force, &force, 1.0);
        }
        let pairs = set.pairs();
        let mean = pairs.iter().map(|pair| pair.variance.sum()).sum::<f64>()
            / (pairs.len() * weighed.count).max(1) as f64;
        let most = turned.diagonal().max();
        if !(most > NOTHING * mean && most.is_finite() && mean > 0.0) {
            return weighed;
        }
        for j in 0..weighed.count.min(6) {
            turned[(j, j)] += mean;
        }
        if lower(&mut turned, weighed.count).is_some() {
            inverse_lower(&mut turned, weighed.count);
            multiply_left(&turned, &mut weighed.rows);
            weighed.mean = mean;
            weighed.shares = turned.component_mul(&turned).column_sum() * mean;
        }
        weighed
    }

    /// Variances of the equations of a pair.
    pub(super) fn variance(&self, pair: &Massline) -> Vector6<f64> {
        if self.mean > 0.0 {
            // Runs that differ in their noise differ in the share of it.
            let ratio = pair.variance.sum() / (self.count as f64 * self.mean);
            let mut variance = self.shares.map(|share| 1.0 + share * (ratio - 1.0));
            for unused in variance.iter_mut().skip(self.count) {
                *unused = 0.0;
            }
            variance
        } else {
            pair.variance
        }
    }

    /// Weights of the equations, mean over the pairs of their set.
    pub(super) fn mean_weights(&self, pairs: &[Massline]) -> Vector6<f64> {
        let mut mean = Vector6::zeros();
        for pair in pairs {
            mean += weights(&self.variance(pair));
        }
        mean / (pairs.len() as f64).max(1.0)
    }
}

/// `true` if noise turns the directions of a set, that is if the set does not excite all
/// directions.
pub(super) fn is_turned<const PAIRS: usize>(set: &Masslines<PAIRS>) -> bool {
    // Of the noise, that is rounding.
    const NOTHING: f64 = 1e-9;
    let (noise, pull) = (set.noise(), set.pull());
    (0..6).any(|j| noise[(j, j)] - pull[(j, j)] > NOTHING * noise[(j, j)])
}

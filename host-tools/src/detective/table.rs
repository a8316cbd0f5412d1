//! Step 1: the rows of the channels, that is each channel's share in the motion of the interface
//! at 0 Hz.
//!
//! # Design
//!
//! The interface accelerometers together span the rigid motions of the table, whatever is wrong
//! with some of them: an inverted sensor is still a linear function of the motion. Their principal
//! directions are the gauge, and every channel is regressed on it with real coefficients:
//! interface accelerometers with constants, structure accelerometers and load cells with terms in
//! 1, ω² and ω⁴, by which an elastic structure leaves its rigid body. Only the constants are kept.

use nalgebra::{Complex, DMatrix, DVector};

/// Products of all channels at one low line, summed over the runs; those of static poses are at 0 Hz.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// Frequency over that of the highest line.
    pub(super) frequency: f64,
    /// `Σ x x*` in SI, channels in the order of the sensors.
    pub(super) products: DMatrix<Complex<f64>>,
}

/// Directions of the gauge below this share of the strongest one's power are noise.
const WEAKEST: f64 = 0.002;
/// Variance of what is not known, over the mean square of its kind.
pub(super) const UNKNOWN: f64 = 1e6;
/// Share of the ω⁴ term that the next term of the series may have.
const NEXT_TERM: f64 = 0.03;

/// One channel's response to the motions of the gauge.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// RMS of the channel along each motion, SI.
    pub(super) k: DVector<f64>,
    /// Covariance of its noise.
    pub(super) noise: DMatrix<f64>,
}

/// The gauge: combinations of channels that are the motions.
#[derive(Clone, Debug)]
pub(super) struct Gauge {
    /// A column a motion, an entry a channel.
    directions: DMatrix<f64>,
}

impl Gauge {
    /// The principal directions of these channels, each scaled to the same power. `None` if
    /// nothing moves, or there are none.
    pub(super) fn of(lines: &[Line], channels: &[usize]) -> Option<Self> {
        Self::of_at_most(lines, channels, 6)
    }

    /// The strongest of these directions, up to a number.
    pub(super) fn of_at_most(lines: &[Line], channels: &[usize], most: usize) -> Option<Self> {
        let count = lines.first()?.products.nrows();
        let n = channels.len();
        // Without channels there is nothing whose eigenvalues could be sought.
        if n == 0 {
            return None;
        }
        let mut power = DMatrix::<f64>::zeros(n, n);
        for line in lines {
            for (i, &a) in channels.iter().enumerate() {
                for (j, &b) in channels.iter().enumerate() {
                    power[(i, j)] += line.products[(a, b)].re;
                }
            }
        }
        let scale: Vec<f64> = (0..n)
            .map(|i| match power[(i, i)] {
                p if p > 0.0 => 1.0 / p.sqrt(),
                _ => 0.0,
            })
            .collect();
        let normal = DMatrix::from_fn(n, n, |i, j| power[(i, j)] * scale[i] * scale[j]);
        if !normal.iter().all(|x| x.is_finite()) {
            return None;
        }
        let eigen = normal.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        order.truncate(most);
        order.retain(|&i| eigen.eigenvalues[i] > WEAKEST * largest);
        if order.is_empty() || largest <= 0.0 {
            return None;
        }
        let mut directions = DMatrix::zeros(count, order.len());
        for (column, &i) in order.iter().enumerate() {
            for (row, &channel) in channels.iter().enumerate() {
                directions[(channel, column)] = eigen.eigenvectors[(row, i)] * scale[row];
            }
        }
        Some(Self { directions })
    }

    pub(super) fn motions(&self) -> usize {
        self.directions.ncols()
    }
}

/// A channel's regression on the motions: its row, and the share of its power that is left.
pub(super) struct Fit {
    pub(super) row: Row,
    pub(super) unexplained: f64,
}

/// The sums of a gauge over the lines, from which every channel is regressed.
pub(super) struct Regression<'a> {
    lines: &'a [Line],
    gauge: &'a Gauge,
    /// Products of the motions, line by line.
    motions: Vec<DMatrix<f64>>,
    /// Cholesky factor of the mean product of the motions: unit RMS.
    unit: DMatrix<f64>,
    /// Real equations of a channel.
    equations: f64,
    /// Terms of the series that the lines tell apart.
    terms: usize,
}

impl<'a> Regression<'a> {
    /// The sums over lines that hold so many real equations of a channel.
    pub(super) fn new(lines: &'a [Line], gauge: &'a Gauge, equations: usize) -> Option<Self> {
        let d = gauge.motions();
        let mut frequencies: Vec<f64> = lines.iter().map(|line| line.frequency).collect();
        frequencies.sort_by(f64::total_cmp);
        frequencies.dedup();
        let mut mean = DMatrix::<f64>::zeros(d, d);
        let motions: Vec<DMatrix<f64>> = lines
            .iter()
            .map(|line| {
                let real = line.products.map(|z| z.re);
                let q = gauge.directions.tr_mul(&real) * &gauge.directions;
                mean += &q / lines.len() as f64;
                q
            })
            .collect();
        let unit = mean.cholesky()?.unpack();
        Some(Self {
            lines,
            gauge,
            motions,
            unit,
            equations: equations as f64,
            terms: frequencies.len(),
        })
    }

    /// The fit of a channel that is `delay` units of time late, in which the highest line has the
    /// angular frequency 1; with the first `terms` of 1, ω², ω⁴.
    pub(super) fn fit(&self, channel: usize, terms: usize, delay: f64) -> Option<Fit> {
        let d = self.gauge.motions();
        let terms = terms.min(self.terms);
        let size = d * terms;
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        let mut power = 0.0;
        for (line, q) in self.lines.iter().zip(&self.motions) {
            let square = line.frequency * line.frequency;
            let phi: Vec<f64> = (0..terms).map(|t| square.powi(t as i32)).collect();
            let (sin, cos) = libm::sincos(line.frequency * delay);
            let turn = Complex::new(cos, sin);
            let x = line.products.row(channel) * turn;
            power += line.products[(channel, channel)].re;
            // Re of the channel times the motions' conjugates.
            let along = DVector::from_fn(d, |j, _| {
                let column = self.gauge.directions.column(j);
                x.iter()
                    .zip(column.iter())
                    .map(|(x, g)| x.re * g)
                    .sum::<f64>()
            });
            for (t, &a) in phi.iter().enumerate() {
                for (u, &b) in phi.iter().enumerate() {
                    for i in 0..d {
                        for j in 0..d {
                            normal[(t * d + i, u * d + j)] += a * b * q[(i, j)];
                        }
                    }
                }
                for j in 0..d {
                    right[t * d + j] += a * along[j];
                }
            }
        }
        let cholesky = normal.cholesky()?;
        let solution = cholesky.solve(&right);
        let explained = solution.dot(&right);
        let left = (power - explained).max(1e-12 * power);
        let variance = left / (self.equations - size as f64).max(1.0);
        let inverse = cholesky.inverse();
        let constant = inverse.view((0, 0), (d, d)) * variance;
        let unit = &self.unit;
        let mut noise = unit.tr_mul(&constant) * unit;
        if terms > 2 {
            let next = unit.tr_mul(&solution.rows(2 * d, d)) * NEXT_TERM;
            for j in 0..d {
                noise[(j, j)] += next[j] * next[j];
            }
        }
        let k = unit.tr_mul(&solution.rows(0, d));
        (power > 0.0).then_some(Fit {
            row: Row { k, noise },
            unexplained: left / power,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The channels beside the only one that moves.
    #[test]
    fn no_channels_have_no_directions() {
        let lines = [Line {
            frequency: 1.0,
            products: DMatrix::identity(2, 2),
        }];
        assert!(Gauge::of(&lines, &[]).is_none());
        assert_eq!(
            Gauge::of(&lines, &[1]).map(|gauge| gauge.motions()),
            Some(1)
        );
    }
}

//! Averages over the lines of a band, and what the scatter of the lines says about them.

use super::{Lines, MasslineError, Masslines};
use core::ops::Range;
use nalgebra::{Matrix6, Vector6};

/// Fewest lines of an averaging band.
pub const MIN_LINES: usize = 3;

/// What is taken to be the same for all lines of the band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trend {
    /// The rigid body only: the lines are averaged.
    Constant,
    /// The rigid body plus a term in ω², the leading one of all modes above the band:
    /// the average is replaced by the value of the fit at ω = 0.
    Squared,
}

/// Weights that turn the lines of a band into their value at ω = 0, and into the slope
/// over ω²: the least-squares fit of the trend.
struct LineWeights {
    trend: Trend,
    count: f64,
    /// Mean of x and of (x - mean)², where x = ω² in units of the band's upper end.
    mean: f64,
    spread: f64,
    unit: f64,
}

impl LineWeights {
    fn new<L: Lines + ?Sized>(lines: &L, band: &Range<usize>, trend: Trend) -> Self {
        let unit = lines.frequency(band.end.saturating_sub(1));
        let mut w = Self {
            trend,
            count: band.len() as f64,
            mean: 0.0,
            spread: 0.0,
            unit: unit * unit,
        };
        for line in band.clone() {
            w.mean += w.x(lines.frequency(line)) / w.count;
        }
        for line in band.clone() {
            let d = w.x(lines.frequency(line)) - w.mean;
            w.spread += d * d / w.count;
        }
        w
    }

    fn x(&self, frequency: f64) -> f64 {
        frequency * frequency / self.unit
    }

    /// Weight of a line in the value at ω = 0, and in the slope.
    fn at(&self, frequency: f64) -> (f64, f64) {
        match self.trend {
            Trend::Constant => (1.0 / self.count, 0.0),
            Trend::Squared => {
                let slope = (self.x(frequency) - self.mean) / (self.count * self.spread);
                (1.0 / self.count - self.mean * slope, slope)
            }
        }
    }

    /// Parameters that the trend fits per number.
    fn fitted(&self) -> f64 {
        match self.trend {
            Trend::Constant => 1.0,
            Trend::Squared => 2.0,
        }
    }
}

impl<const PAIRS: usize> Masslines<PAIRS> {
    /// Adds one pair for each `p` that `line_pair(line, p)` knows, averaged over the
    /// lines `band` with the given trend, with the variance that their scatter tells.
    ///
    /// # Errors
    /// [`MasslineError::TooFewLines`] below [`MIN_LINES`], [`MasslineError::Singular`].
    pub(super) fn average<L: Lines + ?Sized>(
        &mut self,
        lines: &L,
        band: &Range<usize>,
        trend: Trend,
        count: usize,
        mut line_pairs: impl FnMut(
            usize,
            &mut [(Vector6<f64>, Vector6<f64>)],
        ) -> Result<(), MasslineError>,
    ) -> Result<(), MasslineError> {
        if band.len() < MIN_LINES {
            return Err(MasslineError::TooFewLines(band.len()));
        }
        let zero = (Vector6::zeros(), Vector6::zeros());
        if count > PAIRS {
            return Err(MasslineError::TooManyPairs);
        }
        let mut buffer = [zero; PAIRS];
        let weights = LineWeights::new(lines, band, trend);
        let (mut value, mut slope) = ([zero; PAIRS], [zero; PAIRS]);
        for line in band.clone() {
            let (w, s) = weights.at(lines.frequency(line));
            line_pairs(line, &mut buffer[..count])?;
            for p in 0..count {
                let (a, f) = buffer[p];
                value[p].0 += a * w;
                value[p].1 += f * w;
                slope[p].0 += a * s;
                slope[p].1 += f * s;
            }
        }
        let first = self.pairs.len();
        for (a, f) in value.iter().take(count) {
            self.push(*a, *f, Vector6::zeros())?;
        }
        // The level of the excitation changes from line to line and is no error: what
        // scatters is the force left over by the matrix that fits the averages best.
        let mass = self.best_matrix();
        let rows = *self.equations.rows();
        let left = |(a, f): (Vector6<f64>, Vector6<f64>)| rows * (f - mass * a);
        let freedom = weights.count - weights.fitted();
        let mut squares = [Vector6::<f64>::zeros(); PAIRS];
        let mut gain = 0.0;
        for line in band.clone() {
            let frequency = lines.frequency(line);
            let (w, _) = weights.at(frequency);
            gain += w * w;
            line_pairs(line, &mut buffer[..count])?;
            for p in 0..count {
                let scatter = match trend {
                    Trend::Constant => left(buffer[p]) - left(value[p]),
                    Trend::Squared => {
                        let x = weights.x(frequency);
                        left(buffer[p]) - left(value[p]) - left(slope[p]) * x
                    }
                };
                squares[p] += scatter.component_mul(&scatter);
            }
        }
        for (pair, squares) in self.pairs[first..].iter_mut().zip(&squares) {
            pair.variance = squares * (lines.correlation() * gain / freedom.max(1.0));
        }
        Ok(())
    }

    /// The matrix that maps accelerations to forces best, without any structure imposed:
    /// `Σ f aᵀ (Σ a aᵀ)⁻¹` on the directions the pairs span.
    pub(super) fn best_matrix(&self) -> Matrix6<f64> {
        let (mut fa, mut aa) = (Matrix6::zeros(), Matrix6::zeros());
        for pair in &self.pairs {
            fa += pair.force * pair.acceleration.transpose();
            aa += pair.acceleration * pair.acceleration.transpose();
        }
        let scale = aa
            .diagonal()
            .map(|d: f64| if d > 0.0 { 1.0 / libm::sqrt(d) } else { 0.0 });
        let d = Matrix6::from_diagonal(&scale);
        let (values, vectors) = crate::algebra::symmetric_eigen(&(d * aa * d));
        let mut inverse = Matrix6::zeros();
        for (i, &value) in values.iter().enumerate() {
            // Pairs are few and exact numbers; below 1e-12 there is only rounding.
            if value > 1e-12 {
                let v: Vector6<f64> = vectors.column(i).into();
                inverse += v * v.transpose() / value;
            }
        }
        fa * (d * inverse * d)
    }
}

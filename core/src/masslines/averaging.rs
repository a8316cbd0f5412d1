//! Averages over the lines of a band, and what the scatter of the lines says about them.

use super::lines::add_squares;
use super::{EquationWeights, Excitation, Lines, MasslineError, Masslines, Squares};
use crate::algebra::{inverse_lower, lower, multiply_left, multiply_right, symmetric_eigen};
use crate::cells::{cells, seen};
use crate::geometry::ResultantNoise;
use core::ops::Range;
use nalgebra::{ArrayStorage, Matrix6, Vector6};

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

/// Fewest lines of an averaging band.
pub const MIN_LINES: usize = 3;

/// Degrees of freedom that the variance of an equation borrows from the others of its pair.
const BORROWED: f64 = 2.0;

/// Model that all lines of the band share.
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

/// Real parts of the moments summed over runs and lines, with the noise in them.
pub(super) struct RealMoments {
    pub(super) squares: Squares,
    /// Covariance of the noise in both sums.
    pub(super) noise: ResultantNoise,
    pub(super) lines: f64,
}

impl RealMoments {
    /// Nothing yet.
    pub(super) const EMPTY: Self = Self {
        squares: Squares {
            aa: NO_MATRIX,
            ff: NO_MATRIX,
        },
        noise: ResultantNoise::NONE,
        lines: 0.0,
    };

    #[inline(never)] // What is summed is off the stack when the caller goes on.
    pub(super) fn new<L: Lines + ?Sized>(lines: &L, band: &Range<usize>) -> Self {
        let mut total = Self::EMPTY;
        for run in 0..lines.runs() {
            for line in band.clone() {
                add_squares(lines, run, line, 1.0, &mut total.squares);
            }
        }
        add_noise_of_runs(lines, band.len(), &mut total.noise);
        total.lines = band.len() as f64;
        total
    }

    /// The accelerations that rise above their noise.
    pub(super) fn accelerations(&self, into: &mut Excitation) {
        into.decide(&self.squares.aa, &self.noise.acceleration);
    }
}

/// Covariance of the noise that so many lines of all runs hold together.
#[inline(never)] // Not on the stack of what else its caller does.
pub(super) fn noise_of_runs<L: Lines + ?Sized>(lines: &L, count: usize) -> ResultantNoise {
    let mut noise = ResultantNoise::NONE;
    add_noise_of_runs(lines, count, &mut noise);
    noise
}

/// Adds it where it is wanted.
#[inline(never)] // One run's noise on the stack.
fn add_noise_of_runs<L: Lines + ?Sized>(lines: &L, count: usize, into: &mut ResultantNoise) {
    for run in 0..lines.runs() {
        into.add(&lines.noise(run), count as f64);
    }
}

/// An acceleration and the force that goes with it at one line.
pub(super) type LinePair = (Vector6<f64>, Vector6<f64>);

/// Fills in the pairs of one line.
pub(super) type PairsOfLine<'f> =
    &'f mut dyn FnMut(usize, &mut [LinePair]) -> Result<(), MasslineError>;

const NO_VECTOR: Vector6<f64> = Vector6::from_array_storage(ArrayStorage([[0.0; 6]]));
const NO_PAIR: LinePair = (NO_VECTOR, NO_VECTOR);

/// The averages and their slopes, whose forces are replaced by what is left over of them by
/// the matrix that fits the averages best.
struct Fitted<const PAIRS: usize> {
    mass: Matrix6<f64>,
    value: [LinePair; PAIRS],
    slope: [LinePair; PAIRS],
}

impl<const PAIRS: usize> Fitted<PAIRS> {
    const NOTHING: Self = Self {
        mass: NO_MATRIX,
        value: [NO_PAIR; PAIRS],
        slope: [NO_PAIR; PAIRS],
    };
}

/// Residual force of a pair, in the equations `rows`.
#[inline(never)] // A handful of vectors is off the stack when the next pair is made.
fn left(rows: &Matrix6<f64>, mass: &Matrix6<f64>, (a, f): &LinePair) -> Vector6<f64> {
    rows * (f - mass * a)
}

impl<const PAIRS: usize> Masslines<PAIRS> {
    /// Adds the `count` pairs that `line_pairs` knows of every line, averaged over the
    /// lines `band` with the given trend, with the variance that their scatter tells. The
    /// noise of the runs decides how the equations are combined, unless they count alike.
    ///
    /// # Errors
    /// [`MasslineError::TooFewLines`] below [`MIN_LINES`], [`MasslineError::Singular`].
    #[expect(
        clippy::too_many_arguments,
        reason = "all that tells what is averaged, and how"
    )]
    pub(super) fn average<L: Lines + ?Sized>(
        &mut self,
        lines: &L,
        band: &Range<usize>,
        trend: Trend,
        equations: EquationWeights,
        excitation: &Excitation,
        count: usize,
        line_pairs: PairsOfLine<'_>,
    ) -> Result<(), MasslineError> {
        if band.len() < MIN_LINES {
            return Err(MasslineError::TooFewLines(band.len()));
        }
        if count > PAIRS {
            return Err(MasslineError::TooManyPairs {
                limit: PAIRS,
                found: count,
            });
        }
        let weights = LineWeights::new(lines, band, trend);
        let first = self.pairs.len();
        let mut fitted = Fitted::<PAIRS>::NOTHING;
        self.add_averages(lines, band, &weights, count, line_pairs, &mut fitted)?;
        // The level of the excitation changes from line to line and is no error: what
        // scatters is the force left over by the matrix that fits the averages best.
        fitted.mass = self.best_matrix(excitation);
        if equations == EquationWeights::Noise {
            self.whiten_by(lines, &fitted.mass);
        }
        let rows = self.equations.rows();
        let Fitted { mass, value, slope } = &mut fitted;
        for pair in value[..count].iter_mut().chain(&mut slope[..count]) {
            pair.1 = left(rows, mass, pair);
        }
        let mut squares = [NO_VECTOR; PAIRS];
        let gain = self.scatter(
            lines,
            band,
            &weights,
            line_pairs,
            &fitted,
            squares.get_mut(..count).unwrap_or(&mut []),
        )?;
        let freedom = weights.count - weights.fitted();
        // Few lines make a poor variance of each equation. Where noise is told apart by the
        // model, all of a pair's equations are alike but for it.
        let measured = self.equations.count();
        let borrowed = if self.equations.is_whitened() {
            BORROWED
        } else {
            0.0
        };
        for (pair, squares) in self.pairs.iter_mut().skip(first).zip(&squares) {
            let mean = squares.sum() / (measured as f64).max(1.0);
            let each = pair.variance.iter_mut().zip(squares).take(measured);
            for (variance, squares) in each {
                let pooled =
                    (squares + borrowed * mean / freedom.max(1.0)) / (freedom + borrowed).max(1.0);
                *variance = pooled * lines.correlation() * gain;
            }
        }
        self.lines = (1.0 / (gain * lines.correlation())) as f32;
        self.freedom = (freedom / lines.correlation()) as f32;
        Ok(())
    }

    /// Adds up the squares by which the force of each pair scatters from line to line, and
    /// returns the sum of the squared weights.
    #[inline(never)] // Its buffer is not on the stack while averages are taken.
    fn scatter<L: Lines + ?Sized>(
        &self,
        lines: &L,
        band: &Range<usize>,
        weights: &LineWeights,
        line_pairs: PairsOfLine<'_>,
        fitted: &Fitted<PAIRS>,
        squares: &mut [Vector6<f64>],
    ) -> Result<f64, MasslineError> {
        let count = squares.len();
        let rows = self.equations.rows();
        let mut buffer = [NO_PAIR; PAIRS];
        let mut gain = 0.0;
        for line in band.clone() {
            let frequency = lines.frequency(line);
            let (w, _) = weights.at(frequency);
            gain += w * w;
            let buffer = buffer.get_mut(..count).unwrap_or(&mut []);
            line_pairs(line, buffer)?;
            let found = fitted.value.iter().zip(&fitted.slope);
            for ((pair, (value, slope)), squares) in buffer.iter().zip(found).zip(&mut *squares) {
                let mut scatter = left(rows, &fitted.mass, pair) - value.1;
                if weights.trend == Trend::Squared {
                    scatter -= slope.1 * weights.x(frequency);
                }
                *squares += scatter.component_mul(&scatter);
            }
        }
        Ok(gain)
    }

    /// Adds the averages to the pairs, and leaves them in `fitted`.
    #[inline(never)] // Its sums are off the stack when scatter is looked at.
    fn add_averages<L: Lines + ?Sized>(
        &mut self,
        lines: &L,
        band: &Range<usize>,
        weights: &LineWeights,
        count: usize,
        line_pairs: PairsOfLine<'_>,
        fitted: &mut Fitted<PAIRS>,
    ) -> Result<(), MasslineError> {
        let mut buffer = [NO_PAIR; PAIRS];
        let Fitted { value, slope, .. } = fitted;
        for line in band.clone() {
            let (w, s) = weights.at(lines.frequency(line));
            let buffer = buffer.get_mut(..count).unwrap_or(&mut []);
            line_pairs(line, buffer)?;
            let sums = value.iter_mut().zip(slope.iter_mut());
            for ((a, f), (value, slope)) in buffer.iter().zip(sums) {
                value.0 += a * w;
                value.1 += f * w;
                slope.0 += a * s;
                slope.1 += f * s;
            }
        }
        for (a, f) in value.iter().take(count) {
            self.push(*a, *f, Vector6::zeros())?;
        }
        Ok(())
    }

    /// Combines the equations by the noise of all runs, see [`Self::whiten`].
    #[inline(never)] // The noise is off the stack when scatter is looked at.
    pub(super) fn whiten_by<L: Lines + ?Sized>(&mut self, lines: &L, mass: &Matrix6<f64>) {
        self.whiten(&noise_of_runs(lines, 1), mass);
    }

    /// Combines the equations so that what `noise` leaves of `f - M a` is independent and of
    /// variance one in each. Without noise they stay as they are.
    fn whiten(&mut self, noise: &ResultantNoise, mass: &Matrix6<f64>) {
        // No equation is trusted a million times more than another of its set.
        const LEAST: f64 = 1e-12;
        let rows = self.equations.count();
        let mut weights = mass * noise.acceleration * mass.transpose() + noise.force;
        let e = self.equations.rows();
        multiply_left(e, &mut weights);
        multiply_right(&mut weights, &e.transpose());
        let largest = weights.diagonal().max();
        let diagonal = &mut cells(&mut weights);
        for j in 0..rows {
            diagonal[(j, j)] += LEAST * largest;
        }
        if largest > 0.0 && lower(&mut weights, rows).is_some() {
            inverse_lower(&mut weights, rows);
            self.equations = self.equations.whitened(&weights);
        }
    }

    /// The matrix that maps accelerations to forces best, without any structure imposed:
    /// `Σ f aᵀ (Σ a aᵀ)⁻¹` on the directions that are excited. What is not maps noise.
    #[inline(never)] // Its matrices are off the stack when the caller goes on.
    pub(super) fn best_matrix(&self, excitation: &Excitation) -> Matrix6<f64> {
        let rank = excitation.rank();
        let (mut fa, mut aa) = (Matrix6::zeros(), Matrix6::zeros());
        for pair in &self.pairs {
            let along = excitation.coordinates() * pair.acceleration;
            fa.ger(1.0, &pair.force, &along, 1.0);
            aa.ger(1.0, &along, &along, 1.0);
        }
        let scale = aa
            .diagonal()
            .map(|d: f64| if d > 0.0 { 1.0 / libm::sqrt(d) } else { 0.0 });
        let d = Matrix6::from_diagonal(&scale);
        multiply_left(&d, &mut aa);
        multiply_right(&mut aa, &d);
        let mut vectors = Matrix6::zeros();
        let values = symmetric_eigen(&mut aa, &mut vectors);
        let mut inverse = Matrix6::zeros();
        let (vectors, entries) = (seen(&vectors), &mut cells(&mut inverse));
        for (i, &value) in values.iter().enumerate().take(rank) {
            // Pairs are few and exact numbers; below 1e-12 there is only rounding.
            if value > 1e-12 {
                for j in 0..6 {
                    for k in 0..6 {
                        entries[(j, k)] += vectors[(j, i)] * vectors[(k, i)] / value;
                    }
                }
            }
        }
        multiply_left(&d, &mut inverse);
        multiply_right(&mut inverse, &d);
        multiply_right(&mut fa, &inverse);
        multiply_right(&mut fa, excitation.coordinates());
        fa
    }
}

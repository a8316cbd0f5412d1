//! One scalar function of frequency with a weight for each line.

use nalgebra::Complex;

/// A scalar function in which the poles are looked for, and how far each line is to be
/// trusted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trace<'w> {
    values: &'w [Complex<f64>],
    /// Weights in the real parts.
    weights: &'w [Complex<f64>],
}

/// Lines on either side over which scatter is judged.
const NEIGHBOURS: usize = 3;

impl<'w> Trace<'w> {
    /// Takes the values from the first half of `work` and leaves their weights in the
    /// second.
    ///
    /// A line counts by the inverse square of what it may be wrong by: the scatter of
    /// its neighbourhood (second differences, which a smooth curve hardly has, but noise
    /// and the leakage of a sharp resonance do), and a share of its own size, so that the
    /// lines below a resonance count as much as the resonance itself.
    #[must_use]
    pub fn new(work: &'w mut [Complex<f64>]) -> Self {
        let (values, weights) = work.split_at_mut(work.len() / 2);
        let values: &'w [Complex<f64>] = values;
        let floor = 0.02 * mean_size(values);
        let second = |line: usize| {
            let at = |k: usize| values.get(k).copied().unwrap_or_default();
            let d = at(line + 1) - at(line) * 2.0 + at(line - 1);
            // The variance of 1, -2, 1 is six.
            d.norm_sqr() / 6.0
        };
        for (line, weight) in weights.iter_mut().enumerate().take(values.len()) {
            let from = line.saturating_sub(NEIGHBOURS).max(1);
            let to = (line + NEIGHBOURS + 1).min(values.len().saturating_sub(1));
            let count = to.saturating_sub(from).max(1) as f64;
            let scatter = (from..to).map(second).sum::<f64>() / count;
            let size = 0.02 * modulus(&values[line]) + floor;
            *weight = Complex::new(1.0 / (scatter + size * size), 0.0);
        }
        Self { values, weights }
    }

    /// Number of lines.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Value at a line, zero beyond the last.
    #[must_use]
    pub fn value(&self, line: usize) -> Complex<f64> {
        self.values.get(line).copied().unwrap_or_default()
    }

    /// Inverse of the squared error that a line may have, zero beyond the last.
    #[must_use]
    pub fn weight(&self, line: usize) -> f64 {
        self.weights.get(line).map_or(0.0, |w| w.re)
    }
}

fn modulus(z: &Complex<f64>) -> f64 {
    libm::sqrt(z.norm_sqr())
}

/// Mean size of the lines, with a resonance counting no more than its share of them.
fn mean_size(values: &[Complex<f64>]) -> f64 {
    let n = values.len().max(1) as f64;
    let roots: f64 = values.iter().map(|t| libm::sqrt(modulus(t))).sum();
    (roots / n) * (roots / n)
}

//! What the scatter of the lines around their average says about the average.

use super::Masslines;
use core::ops::Range;
use nalgebra::{Matrix6, Vector6};

impl Masslines {
    /// Sets the variance of every pair from the scatter of the lines it is the mean of.
    ///
    /// `line_pair(line, p)` gives pair p at one line. The scatter is that of the force
    /// left over by the mass matrix that fits the averages best; the level of the
    /// excitation, which also changes from line to line, drops out of it that way. The
    /// slope that elastic modes put into the band counts as scatter, and should.
    pub(super) fn scatter_over_lines(
        &mut self,
        band: &Range<usize>,
        correlation: f64,
        line_pair: impl Fn(usize, usize) -> Option<(Vector6<f64>, Vector6<f64>)>,
    ) {
        let count = band.len() as f64;
        if count < 2.0 {
            return;
        }
        let mass = self.best_matrix();
        let rows = *self.equations.rows();
        for (p, pair) in self.pairs.iter_mut().enumerate() {
            let mean = rows * (pair.force - mass * pair.acceleration);
            let mut squares = Vector6::zeros();
            for line in band.clone() {
                if let Some((a, f)) = line_pair(line, p) {
                    let left = rows * (f - mass * a) - mean;
                    squares += left.component_mul(&left);
                }
            }
            pair.variance = squares * (correlation / (count - 1.0) / count);
        }
    }

    /// The matrix that maps accelerations to forces best, without any structure imposed:
    /// `Σ f aᵀ (Σ a aᵀ)⁻¹` on the directions the pairs span.
    fn best_matrix(&self) -> Matrix6<f64> {
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

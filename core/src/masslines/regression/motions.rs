//! Motion along directions that hardly rise above their noise.

use super::{NO_MATRIX, Regression, SIZE, Solution};
use crate::algebra::not_negative;
use crate::cells::{cells, seen};
use nalgebra::{Matrix6, Vector6};

impl Regression {
    /// Accelerations that go with those along the excited directions, one column a direction, and the variance of what
    /// they have along the others relative to the first term of a regression: that of the other accelerations on the
    /// functions of a solution, as that of the forces gives M₀. `noise` is that of
    /// [`Self::restart`], `share` that of [`Self::share_of_pairs`]. `None` if the terms cannot be told apart.
    ///
    /// A table whose cross-talk has a resonance moves along the other directions, too, by a share that differs from line
    /// to line. Such motion is none of the noise, however little it is: the forces that go with it are in M₀. Where it is no more
    /// than chance has it differ, the share over all lines errs less, which is zero: that is what the others are. The choice is
    /// that of [`Self::risk`], and what is told of a bias joins the variance.
    #[inline(never)] // Its matrix and its places are off the stack when pairs are made.
    pub(super) fn motions(
        &mut self,
        solution: &Solution,
        noise: &Matrix6<f64>,
        share: f64,
    ) -> Option<(Matrix6<f64>, f64)> {
        let mut motions = *self.excitation.basis();
        let rank = self.excitation.rank();
        if rank == 6 || solution.terms.len() < 2 {
            return Some((motions, share));
        }
        let places = self.places(&solution.terms);
        let unknowns = rank * solution.terms.len();
        let nuisance = unknowns - rank;
        let mut schur = NO_MATRIX;
        self.factorize(&places, [unknowns, nuisance], &mut schur)?;
        let (places, normal) = (seen(&places[..]), seen(&self.sums.normal));
        let mut along = [0.0; SIZE];
        let (mut distance, mut coefficients) = (0.0, 0.0);
        for other in rank..6 {
            for i in 0..unknowns {
                let place = places[i];
                cells(&mut along[..])[i] = normal[(place.max(other), place.min(other))];
            }
            self.forward(unknowns, &mut along);
            // Power that the first term takes after all others.
            let projected = along.iter().skip(nuisance).take(rank);
            distance += projected.map(|x| x * x).sum::<f64>();
            self.backward(nuisance..unknowns, &mut along);
            let row: Vector6<f64> = self.excitation.others().row(other).transpose();
            let motion = noise * row;
            coefficients += if motion.norm_squared() > 0.0 {
                rank as f64
            } else {
                0.0
            };
            for (mut column, part) in motions
                .column_iter_mut()
                .zip(along.iter().skip(nuisance))
                .take(rank)
            {
                column.axpy(*part, &motion, 1.0);
            }
        }
        if coefficients == 0.0 {
            return Some((motions, share));
        }
        // The noise along the others has the power one over all equations.
        distance *= self.sums.count / self.correlation;
        let told = not_negative(distance / coefficients - (1.0 - share));
        if share + told < 1.0 {
            return Some((*self.excitation.basis(), share + told));
        }
        Some((motions, 1.0))
    }
}

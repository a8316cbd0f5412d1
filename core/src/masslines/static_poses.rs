//! Static poses: specific force takes the place of acceleration.
//!
//! A DC-coupled accelerometer at rest reads `a - g`, and a load cell feels the same:
//! `f = M (a - g)`. Tilting the specimen, or just putting it down, is an excitation.
//! Offsets of the six resultants are constant over the poses; they are estimated along,
//! which is the same as taking the means out of both sides.

use super::regression::{Regression, Solution};
use super::{MasslineError, Masslines, Moments};
use crate::geometry::Equations;
use nalgebra::{Complex, Matrix6, Vector3, Vector6};

/// Running sums over poses.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticPoses {
    count: f64,
    mean_a: Vector6<f64>,
    mean_f: Vector6<f64>,
    aa: Matrix6<f64>,
    fa: Matrix6<f64>,
    ff: Matrix6<f64>,
}

/// Masslines of static poses, with the offsets of the resultants.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticFit {
    /// The pairs.
    pub masslines: Masslines,
    /// Mean over the poses of the specific force, m/s², with zeros for the angular accelerations, at the reference
    /// point in the specimen's frame.
    pub mean_acceleration: Vector6<f64>,
    /// Mean resultants over the poses, N and N m about the reference point in the specimen's frame, offsets of the
    /// load cells among them: these are `mean_force - M mean_acceleration`.
    pub mean_force: Vector6<f64>,
    /// Poses used.
    pub poses: usize,
    /// Number of independent directions of specific force.
    pub excited: usize,
}

impl StaticPoses {
    /// No pose yet.
    fn new() -> Self {
        Self {
            count: 0.0,
            mean_a: Vector6::zeros(),
            mean_f: Vector6::zeros(),
            aa: Matrix6::zeros(),
            fa: Matrix6::zeros(),
            ff: Matrix6::zeros(),
        }
    }

    /// Adds one pose: specific force and resultants at A.
    pub fn add(&mut self, specific_force: &Vector6<f64>, resultants: &Vector6<f64>) {
        // Welford's update: the means are taken out without cancellation.
        self.count += 1.0;
        let da = specific_force - self.mean_a;
        let df = resultants - self.mean_f;
        self.mean_a += da / self.count;
        self.mean_f += df / self.count;
        let da_after = specific_force - self.mean_a;
        let df_after = resultants - self.mean_f;
        self.aa += da * da_after.transpose();
        self.fa += df * da_after.transpose();
        self.ff += df * df_after.transpose();
    }

    /// Poses so far.
    #[must_use]
    pub(crate) fn count(&self) -> usize {
        self.count as usize
    }

    /// Condenses the poses to masslines about `reference`. `noise` is the covariance of the
    /// noise of the specific force in one pose, and at least its resolution.
    ///
    /// The resultants are weighted with what a free linear fit leaves of each. Give
    /// `mass_matrix`, about the same point, from a first identification to weight them
    /// with what a rigid body leaves instead: with a couple of dozen poses the sensor's
    /// own errors (cross-talk, misalignment) outweigh its noise, and a free fit hides them.
    ///
    /// # Errors
    /// [`MasslineError`] if the poses do not differ, are too few, or nothing is measured.
    pub fn masslines(
        &self,
        reference: Vector3<f64>,
        equations: &Equations,
        noise: &Matrix6<f64>,
        mass_matrix: Option<&Matrix6<f64>>,
    ) -> Result<StaticFit, MasslineError> {
        if equations.count() == 0 {
            return Err(MasslineError::NoResultant);
        }
        let symmetric = |m: &Matrix6<f64>| (m + m.transpose()) * 0.5;
        let power = noise * self.count;
        let mut regression = Regression::EMPTY;
        regression.begin(equations, 1, 1.0);
        regression
            .restart(&symmetric(&self.aa), &power)
            .ok_or(MasslineError::NoExcitation)?;
        regression.take_residuals_as_independent();
        let complex = |m: Matrix6<f64>| m.map(|x| Complex::new(x, 0.0));
        let moments = Moments {
            aa: complex(symmetric(&self.aa)),
            fa: complex(self.fa),
            ff: complex(symmetric(&self.ff)),
        };
        // One equation per row went into the offset.
        regression.add(&moments, &[Complex::new(1.0, 0.0)], self.count - 1.0);
        regression.turn(None);
        let mut solution = Solution::EMPTY;
        let needed = regression.excitation().rank() + 2;
        if self.count() < needed {
            let found = self.count();
            return Err(MasslineError::TooFewPoses { needed, found });
        }
        regression
            .solve(&[0], &mut solution)
            .ok_or(MasslineError::Singular)?;
        if let Some(m) = mass_matrix {
            let explained = self.fa * m.transpose();
            let left = self.ff - explained - explained.transpose() + m * self.aa * m.transpose();
            regression.replace_residual(&mut solution, &left);
        }
        let mut masslines = Masslines::new(reference, *equations);
        regression.masslines(&solution, &power, 1.0, &mut masslines)?;
        masslines.noise = power;
        masslines.pull = power;
        masslines.lines = self.count as f32;
        masslines.freedom = regression.freedom(&solution) as f32;
        Ok(StaticFit {
            masslines,
            mean_acceleration: self.mean_a,
            mean_force: self.mean_f,
            poses: self.count(),
            excited: regression.excitation().rank(),
        })
    }
}

impl Default for StaticPoses {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of 2 kg at A, put down in so many ways. Its residuals are those of a free fit, or of
    /// a body of `known` mass.
    fn weighed(poses: usize, known: Option<f64>) -> Result<StaticFit, MasslineError> {
        const DIRECTIONS: [[f64; 3]; 5] = [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [-0.6, 0.8, 0.0],
            [0.0, -0.6, 0.8],
        ];
        let mut all = StaticPoses::new();
        for [x, y, z] in DIRECTIONS.into_iter().take(poses) {
            let gravity = Vector6::new(x, y, z, 0.0, 0.0, 0.0) * 9.81;
            all.add(&gravity, &(gravity * 2.0));
        }
        let noise = Matrix6::identity() * 1e-6;
        let matrix = known.map(|mass| Matrix6::identity() * mass);
        all.masslines(Vector3::zeros(), &Equations::all(), &noise, matrix.as_ref())
    }

    fn put_down(poses: usize) -> Result<StaticFit, MasslineError> {
        weighed(poses, None)
    }

    /// Three directions and an offset are four unknowns of each resultant: the fifth pose is the
    /// first that tells noise.
    #[test]
    fn as_many_poses_as_unknowns_are_refused() {
        let refusal = MasslineError::TooFewPoses {
            needed: 5,
            found: 4,
        };
        assert_eq!(put_down(4), Err(refusal));
        let fit = put_down(5).unwrap();
        assert_eq!((fit.poses, fit.excited), (5, 3));
        // Two directions are seen in three poses, and need one more.
        let refusal = MasslineError::TooFewPoses {
            needed: 4,
            found: 3,
        };
        assert_eq!(put_down(3), Err(refusal));
        assert_eq!(put_down(1), Err(MasslineError::NoExcitation));
    }

    /// The equation of fx is weighted by what the body leaves of it: a square that grows with that of
    /// the error of the mass.
    #[test]
    fn a_known_body_leaves_what_it_does_not_explain() {
        let left = |mass| {
            let fit = weighed(5, Some(mass)).unwrap();
            fit.masslines.equations().rows()[(0, 0)].powi(-2)
        };
        let (right, light, lighter) = (left(2.0), left(1.8), left(1.6));
        // The noise of accelerations is left as well: 4e-6 N² beside 0.04 times 96 N².
        assert!(right < 1e-5 * light, "{right} {light}");
        assert!((lighter / light - 4.0).abs() < 1e-4, "{lighter} {light}");
    }
}

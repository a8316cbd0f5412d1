//! What is identified from: masslines, wherever they lie.

use crate::geometry::Equations;
use crate::masslines::{Massline, Masslines};
use nalgebra::{Matrix6, Vector3};

/// A set of masslines that share a reference point and equations.
pub trait MasslineSet {
    /// The reference point A, m.
    fn reference(&self) -> &Vector3<f64>;

    /// The combinations of the rows of `M a = f` that were measured.
    fn equations(&self) -> &Equations;

    /// The pairs.
    fn pairs(&self) -> &[Massline];

    /// Second moments of noise that an excitation is held against, as [`Masslines::noise`].
    fn noise(&self) -> &Matrix6<f64>;

    /// Second moments of the noise in the pairs, as [`Masslines::pull`].
    fn pull(&self) -> &Matrix6<f64>;

    /// Independent lines that went into each pair, as [`Masslines::lines`].
    fn lines(&self) -> f64;

    /// Degrees of freedom of the variances, as [`Masslines::freedom`].
    fn freedom(&self) -> f64;
}

impl<const PAIRS: usize> MasslineSet for Masslines<PAIRS> {
    fn reference(&self) -> &Vector3<f64> {
        &self.reference
    }

    fn equations(&self) -> &Equations {
        &self.equations
    }

    fn pairs(&self) -> &[Massline] {
        &self.pairs
    }

    fn noise(&self) -> &Matrix6<f64> {
        &self.noise
    }

    fn pull(&self) -> &Matrix6<f64> {
        &self.pull
    }

    fn lines(&self) -> f64 {
        f64::from(self.lines)
    }

    fn freedom(&self) -> f64 {
        f64::from(self.freedom)
    }
}

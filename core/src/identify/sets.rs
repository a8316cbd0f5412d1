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

    /// What the accelerations would contain if there were nothing but noise, as
    /// [`Masslines::noise`].
    fn noise(&self) -> &Matrix6<f64>;
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
}

//! Random choices of a draw: every purpose has a stream of its own, the same on every machine.

use crate::simulate::Stream;
use nalgebra::{Matrix3, Vector3};

/// Random choices for one purpose of one draw.
pub(super) struct Chance(Stream);

impl Chance {
    /// The choices that `seed` and the names of their purpose stand for.
    pub(super) fn new(seed: u64, names: &[&str]) -> Self {
        Self(Stream::new(seed, names))
    }

    /// Uniform between two numbers.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    /// Uniform in the logarithm between two positive numbers.
    pub(super) fn by_ratio(&mut self, low: f64, high: f64) -> f64 {
        libm::exp(self.between(libm::log(low), libm::log(high)))
    }

    /// One of the numbers from `low` to `high`, both included.
    pub(super) fn whole(&mut self, low: usize, high: usize) -> usize {
        let steps = (high - low + 1) as f64;
        (low + (steps * (1.0 - self.0.uniform())) as usize).min(high)
    }

    /// True in a `share` of all cases.
    pub(super) fn happens(&mut self, share: f64) -> bool {
        self.0.uniform() <= share
    }

    /// A standard normal deviate.
    pub(super) fn normal(&mut self) -> f64 {
        self.0.normal().re
    }

    /// A unit vector, all directions alike.
    pub(super) fn direction(&mut self) -> Vector3<f64> {
        loop {
            let v = Vector3::from_fn(|_, _| self.normal());
            if v.norm() > 1e-3 {
                return v.normalize();
            }
        }
    }

    /// A rotation about a random axis by up to half a turn.
    pub(super) fn turn(&mut self) -> Matrix3<f64> {
        let axis = self.direction();
        let (sin, cos) = libm::sincos(self.between(0.0, std::f64::consts::PI));
        let cross = axis.cross_matrix();
        Matrix3::identity() + cross * sin + cross * cross * (1.0 - cos)
    }
}

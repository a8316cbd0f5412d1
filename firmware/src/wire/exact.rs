//! Floating-point numbers that are compared by their bits.

use serde::{Deserialize, Serialize};

/// A number that the box has computed and that must be the host's to the last bit.
///
/// Equality is that of bits: `NaN` equals the same `NaN`, and `0.0` is not `-0.0`. All
/// floating-point numbers of the contract travel as their bits, also the plain ones; this
/// type is for those that two computations are compared by.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Exact<T>(pub T);

impl PartialEq for Exact<f64> {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

impl Eq for Exact<f64> {}

impl PartialEq for Exact<f32> {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

impl Eq for Exact<f32> {}

impl<T> From<T> for Exact<T> {
    fn from(value: T) -> Self {
        Self(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equality_is_that_of_bits() {
        assert_eq!(Exact(f64::NAN), Exact(f64::NAN));
        assert_ne!(Exact(0.0_f64), Exact(-0.0));
        assert_ne!(Exact(f32::NAN), Exact(-f32::NAN));
        assert_eq!(Exact(1.5_f32), Exact(1.5));
    }
}

//! A running sum that does not forget small terms.

/// A compensated sum (Kahan): two `f32`, about twice the precision of one.
///
/// A plain `f32` sum over the fourteen thousand blocks of a four-hour recording loses
/// up to 14000 / 2 · 6e-8 = 4e-4; this one stays at 1e-7 whatever the length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    sum: f32,
    carry: f32,
}

impl Sum {
    /// Zero.
    pub const ZERO: Self = Self {
        sum: 0.0,
        carry: 0.0,
    };

    /// A sum that was found elsewhere.
    #[must_use]
    pub fn of(value: f64) -> Self {
        let sum = value as f32;
        let carry = (f64::from(sum) - value) as f32;
        Self { sum, carry }
    }

    /// Adds a term.
    #[inline]
    pub(crate) fn add(&mut self, term: f32) {
        let corrected = term - self.carry;
        let next = self.sum + corrected;
        self.carry = (next - self.sum) - corrected;
        self.sum = next;
    }

    /// The sum as one `f32`.
    #[inline]
    #[must_use]
    pub(crate) fn rounded(&self) -> f32 {
        self.sum
    }

    /// The sum with its carry, which only `f64` can hold.
    #[inline]
    #[must_use]
    pub(crate) fn value(&self) -> f64 {
        f64::from(self.sum) - f64::from(self.carry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_small_terms_are_not_lost() {
        let (mut exact, mut plain) = (Sum::ZERO, 0.0_f32);
        exact.add(1e4);
        plain += 1e4;
        for _ in 0..1_000_000 {
            exact.add(1e-4);
            plain += 1e-4;
        }
        let expected = 1e4 + 1e6 * f64::from(1e-4_f32);
        // Two roundings of 2^-24 against the sum, Kahan's bound.
        assert!((exact.value() / expected - 1.0).abs() < 2.0 * 6e-8);
        assert_eq!(plain, 1e4, "a plain sum loses every one of them");
    }
}

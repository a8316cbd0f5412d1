//! A running sum that does not forget small terms.

/// Additions after which the terms are taken over into the sum.
const TOGETHER: usize = 16;

/// A sum in two `f32`, about twice the precision of one.
///
/// A plain `f32` sum over the fourteen thousand blocks of a four-hour recording loses
/// up to 14000 / 2 · 6e-8 = 4e-4. Here terms are added to a small number first, which is taken
/// over into the large one after sixteen additions, without loss: roundings are those
/// of sums of sixteen, 6e-8 · 135 / 16 = 5e-7 at most if all of them point one way, and 1e-7 otherwise
/// whatever the length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    sum: f32,
    /// The terms that are not yet in `sum`, or what it lacks of them, negative.
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

    /// Adds `a b + c d`, the real or the imaginary part of a product.
    #[inline(always)]
    pub(crate) fn add(&mut self, [a, b]: [f32; 2], [c, d]: [f32; 2]) {
        self.carry = less(self.carry, [a, b], [c, d]);
    }

    /// That of the two parts, which lie apart.
    #[inline(always)]
    pub(super) fn joined(sum: f32, carry: f32) -> Self {
        Self { sum, carry }
    }

    /// Its two parts.
    #[inline(always)]
    pub(super) fn apart(self, sum: &mut f32, carry: &mut f32) {
        (*sum, *carry) = (self.sum, self.carry);
    }

    /// Takes terms over from the carry: to be called at least after every sixteenth addition, see
    /// [`settle`].
    #[inline]
    pub(super) fn settle(&mut self) {
        let next = self.sum - self.carry;
        // What rounding took (Knuth), of whichever is larger.
        let taken = self.sum - next;
        self.carry = (self.carry - taken) + ((next + taken) - self.sum);
        self.sum = next;
    }

    /// The sum as one `f32`.
    #[inline]
    #[must_use]
    pub(crate) fn rounded(&self) -> f32 {
        self.sum - self.carry
    }

    /// The sum with its carry, which only `f64` can hold.
    #[inline]
    #[must_use]
    pub(crate) fn value(&self) -> f64 {
        f64::from(self.sum) - f64::from(self.carry)
    }
}

/// The carry after `a b + c d` was added.
#[inline(always)]
pub(super) fn less(carry: f32, [a, b]: [f32; 2], [c, d]: [f32; 2]) -> f32 {
    (carry - a * b) - c * d
}

/// Takes the terms of the lines whose turn it is over, of `width` sums each.
pub(super) fn settle(sums: &mut [Sum], width: usize, blocks: u32) {
    for line in due(sums.chunks_exact_mut(width.max(1)), blocks) {
        line.iter_mut().for_each(Sum::settle);
    }
}

/// Every sixteenth of the lines, from another one on with each block: all have their turn in sixteen
/// `blocks`.
pub(super) fn due<T>(lines: impl Iterator<Item = T>, blocks: u32) -> impl Iterator<Item = T> {
    lines.skip(blocks as usize % TOGETHER).step_by(TOGETHER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_small_terms_are_not_lost() {
        let (mut exact, mut plain) = (Sum::ZERO, 0.0_f32);
        exact.add([1e4, 1.0], [0.0, 0.0]);
        plain += 1e4;
        for n in 0..1_000_000 {
            settle(core::slice::from_mut(&mut exact), 1, n);
            exact.add([1e-4, 1.0], [0.0, 0.0]);
            plain += 1e-4;
        }
        let expected = 1e4 + 1e6 * f64::from(1e-4_f32);
        // Two roundings of 2^-24 against the sum, Kahan's bound.
        assert!((exact.value() / expected - 1.0).abs() < 2.0 * 6e-8);
        assert_eq!(plain, 1e4, "a plain sum loses every one of them");
    }
}

//! Pseudo-random numbers for models, the same on every machine for a seed.

/// A generator of 64 random bits at a time (Steele, Lea and Flood's SplitMix64).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.0)
    }

    /// A whole number below `end`, zero if that is zero.
    pub fn below(&mut self, end: u64) -> u64 {
        // The upper half of the product: its bias is end / 2^64.
        ((u128::from(self.bits()) * u128::from(end)) >> 64) as u64
    }

    /// An index of a list of this length, zero if that is zero.
    pub fn index(&mut self, length: usize) -> usize {
        self.below(length as u64) as usize
    }

    /// An item of a list, which must not be empty.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.index(of.len())]
    }

    /// `true` once in so many times.
    pub fn once_in(&mut self, times: usize) -> bool {
        self.index(times) == 0
    }

    /// `true` with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        // An f64 holds 53 bits.
        ((self.bits() >> 11) as f64) < probability * (1_u64 << 53) as f64
    }
}

/// The output function of SplitMix64: a bijective mix of 64 bits.
#[must_use]
pub const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

//! Random numbers that are the same on every machine and for ever.
//!
//! The generator is ChaCha with 8 rounds, keyed by the user's seed. Every signal draws
//! from a stream of its own, numbered by a hash of what the signal is called, so that a
//! run or a channel that is added later leaves all others as they were. Normal deviates
//! come from the Box-Muller transform with the functions of the `libm` crate: the
//! system's own logarithm and cosine differ in the last bit from one platform to another.

use nalgebra::Complex;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// One stream of random numbers.
pub(crate) struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of a signal; `names` say which one, for example purpose, run, channel.
    pub(crate) fn new(seed: u64, names: &[&str]) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(fnv1a(names));
        Self(generator)
    }

    /// Uniform in (0, 1], 53 bits: zero is left out because its logarithm is wanted.
    pub(crate) fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        ((self.0.next_u64() >> 11) + 1) as f64 * STEP
    }

    /// Uniform in (-1, 1].
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Two independent standard normal deviates as the parts of one complex number.
    pub(crate) fn normal(&mut self) -> Complex<f64> {
        let radius = libm::sqrt(-2.0 * libm::log(self.uniform()));
        let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * self.uniform());
        Complex::new(radius * cos, radius * sin)
    }
}

/// The 64-bit Fowler-Noll-Vo hash (variant 1a) of the names, kept apart by a byte that
/// UTF-8 never contains.
fn fnv1a(names: &[&str]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for name in names {
        for byte in name.bytes().chain(std::iter::once(0xff)) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_separates_names() {
        assert_ne!(fnv1a(&["ab", "c"]), fnv1a(&["a", "bc"]));
        assert_ne!(fnv1a(&["ab"]), fnv1a(&["ab", ""]));
    }

    #[test]
    fn streams_repeat_and_differ() {
        let draw = |seed, names: &[&str]| Stream::new(seed, names).normal();
        assert_eq!(draw(1, &["noise", "X"]), draw(1, &["noise", "X"]));
        assert_ne!(draw(1, &["noise", "X"]), draw(2, &["noise", "X"]));
        assert_ne!(draw(1, &["noise", "X"]), draw(1, &["noise", "Y"]));
    }

    /// Frozen bits: a change here changes every simulated recording ever published.
    #[test]
    fn numbers_are_frozen() {
        let normal = Stream::new(1, &["noise", "lateral X", "a1"]).normal();
        assert_eq!(
            [normal.re.to_bits(), normal.im.to_bits()],
            FROZEN,
            "{normal}"
        );
    }
    const FROZEN: [u64; 2] = [0xbfe1_a7a1_0d29_297d, 0xbff2_923a_0acd_a21b];

    /// Mean and variance of n normal deviates scatter by 1/√n and √(2/n); five of those.
    #[test]
    fn moments_are_normal() {
        const COUNT: usize = 200_000;
        let mut stream = Stream::new(3, &["moments"]);
        let (mut mean, mut square, mut fourth) = (0.0, 0.0, 0.0);
        for _ in 0..COUNT / 2 {
            let pair = stream.normal();
            for x in [pair.re, pair.im] {
                mean += x;
                square += x * x;
                fourth += x * x * x * x;
            }
        }
        let n = COUNT as f64;
        assert!((mean / n).abs() < 5.0 / n.sqrt());
        assert!((square / n - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
        // The fourth moment is 3 with variance 105 - 9.
        assert!((fourth / n - 3.0).abs() < 5.0 * (96.0 / n).sqrt());
    }
}

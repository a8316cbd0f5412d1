//! Sums and products in double precision against those of this machine's processor.

use massline_firmware::double::{equal, product, sum};

/// Pairs of numbers from a generator, xorshift64*: of any bits, of like sizes, with few bits, and
/// that differ in their last digits.
fn pairs(count: usize) -> impl Iterator<Item = (u64, u64)> {
    const FRACTION: u64 = (1 << 52) - 1;
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        state.wrapping_mul(0x2545_f491_4f6c_dd1d)
    };
    let special = [
        0.0,
        1.0,
        2.0,
        f64::MIN_POSITIVE,
        f64::MAX,
        f64::INFINITY,
        f64::NAN,
        5e-324,
        1.0 - f64::EPSILON / 2.0,
        1.0 + f64::EPSILON,
    ];
    (0..count).map(move |n| {
        let (a, b, kind) = (random(), random(), random());
        let sparse = |x: u64| match kind % 5 {
            0 => x,
            1 => x & !(FRACTION >> (kind >> 8 & 63)),
            2 => x | FRACTION >> (kind >> 16 & 63),
            3 => x & !FRACTION | 1 << ((kind >> 24 & 63) % 52),
            _ => x & !FRACTION | FRACTION & !(1 << ((kind >> 32 & 63) % 52)),
        };
        let exponent = |x: u64, e: u64| x & (FRACTION | 1 << 63) | e << 52;
        let (a, b) = (sparse(a), sparse(b.rotate_left(7)));
        match n % 6 {
            0 => (a, b),
            1 => {
                let e = 100 + (kind >> 40) % 1800;
                (exponent(a, e), exponent(b, e + (kind >> 52) % 64))
            }
            2 => {
                let e = 60 + (kind >> 40) % 8;
                (exponent(a, e), exponent(b, e + (kind >> 52) % 3))
            }
            3 => (a, (a ^ 1 << 63).wrapping_add(kind >> 62)),
            4 => (a, exponent(b, a >> 52 & 0x7ff)),
            _ => {
                let one: f64 = special[(kind >> 40) as usize % special.len()];
                (one.to_bits() | kind & 1 << 63, b)
            }
        }
    })
}

fn assert_same(found: Option<u64>, expected: f64, what: &str, a: f64, b: f64) {
    if let Some(found) = found {
        assert_eq!(
            found,
            expected.to_bits(),
            "{a:e} {what} {b:e}: {expected:e}"
        );
        assert!(!expected.is_nan(), "{a:e} {what} {b:e}");
    }
}

#[test]
fn zeros_have_their_signs() {
    for (x, y) in [(0.0, 0.0), (0.0, -0.0), (-0.0, 0.0), (-0.0_f64, -0.0_f64)] {
        let (a, b) = (x.to_bits(), y.to_bits());
        assert_eq!(sum(a, b), Some((x + y).to_bits()), "{x} + {y}");
        assert_eq!(product(a, b), Some((x * y).to_bits()), "{x} * {y}");
        assert!(equal(a, b), "{x} == {y}");
    }
    for x in [1.0_f64, -3.5] {
        let (a, b) = (x.to_bits(), (-x).to_bits());
        assert_eq!(sum(a, b), Some(0), "{x} - {x}");
    }
}

#[test]
fn they_are_the_processors_own() {
    for (a, b) in pairs(6_000_000) {
        let (x, y) = (f64::from_bits(a), f64::from_bits(b));
        for (a, b, x, y) in [(a, b, x, y), (b, a, y, x)] {
            assert_same(product(a, b), x * y, "*", x, y);
            assert_same(sum(a, b), x + y, "+", x, y);
            assert_eq!(equal(a, b), x == y, "{x:e} == {y:e}");
        }
        assert!(equal(a, a) != x.is_nan(), "{x:e}");
    }
}

/// Numbers that a measurement has take the short way: those from 1e-140 to 1e140, and zeros.
#[test]
fn numbers_of_a_measurement_are_all_here() {
    let small = |x: f64| x == 0.0 || (1e-140..1e140).contains(&x.abs());
    let mut seen = 0;
    for (a, b) in pairs(600_000) {
        let (x, y) = (f64::from_bits(a), f64::from_bits(b));
        if !(small(x) && small(y)) {
            continue;
        }
        seen += 1;
        assert!(product(a, b).is_some(), "{x:e} * {y:e}");
        assert!(sum(a, b).is_some(), "{x:e} + {y:e}");
    }
    assert!(seen > 100_000, "{seen}");
}

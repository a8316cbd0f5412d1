//! Numbers of every size, for property tests.

use proptest::prelude::*;

/// Any 64 bits, and those that calculations break on.
pub fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => any::<u64>().prop_map(f64::from_bits),
        4 => -10.0..10.0_f64,
        1 => prop::sample::select(vec![
            0.0,
            -0.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            f64::MIN_POSITIVE,
            5e-324,
            1e308,
            -1e308,
            1e154,
            1e-160,
        ]),
    ]
}

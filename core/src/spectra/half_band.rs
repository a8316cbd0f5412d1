//! Half-band filters of the decimation: their coefficients, and sums for eight outputs at a time.
//!
//! Every other coefficient is zero, the middle one is a half. The filters are equiripple (Parks and
//! McClellan). There are two sets, by the share of the decimated block that the last line reaches:
//!
//! | lines up to, of the block | stage | taps | pass band, of its input rate | stop band |
//! | --- | --- | --- | --- | --- |
//! | 1/4 | last | 23 | 0.125, ripple 6e-6 | 0.375 and up, -104 dB |
//! | | before | 11 | 0.0625, ripple 2e-5 | 0.4375 and up, -94 dB |
//! | 25/64 | last | 59 | 0.1953125, ripple 5e-6 | 0.3046875 and up, -107 dB |
//! | | before | 19 | 0.09765625, ripple 3e-6 | 0.40234375 and up, -111 dB |
//!
//! A frequency that folds onto a line is uncorrelated with it, so it biases averaged spectra by its
//! power, 4e-10 at most, and makes them scatter by its amplitude, 2e-5. What this does to responses,
//! computed in `f64` for white noise of 24 blocks and a structure with modes in the band and in both
//! stop bands, 1 % noise, 64 lines of 1024; a response without leakage scatters by 2e-3 there:
//!
//! | taps, last and before | stop bands, dB | products an output of four | change of responses |
//! | --- | --- | --- | --- |
//! | 15, 7 | -72, -65 | 8 | 1e-4 |
//! | 19, 11 | -89, -94 | 11 | 3e-6 |
//! | 23, 11 | -105, -94 | 12 | 2e-6 |
//! | 27, 15 | -121, -123 | 15 | 2e-7 |
//! | 59, 19 | -107, -112 | 25 | 7e-7 |
//!
//! The first of them could be seen in the scatter, and the second where modes above the band are a
//! thousand times those in it. The third takes one product in twelve more than the second.

use super::lane::{Lane, Row};

/// Outputs that are computed together.
pub(super) const TOGETHER: usize = 8;

/// Twice the coefficients at the distances 1, 3, 5, … from the middle, on either side: the middle
/// one is then one, and an output is too large by a factor of two a stage.
pub(super) const WIDE_LAST: [f32; 15] = [
    0.633_289_9,
    -0.202_404_4,
    0.111_590_646,
    -0.070_116_31,
    0.045_849_71,
    -0.030_071_497,
    0.019_384_114,
    -0.012_107_438,
    0.007_238_79,
    -0.004_090_422_8,
    0.002_151_031_8,
    -0.001_030_305_6,
    0.000_434_394_2,
    -0.000_151_144_64,
    3.736_980_2e-5,
];
pub(super) const WIDE_EARLY: [f32; 5] = [
    0.611_780_6,
    -0.147_477_62,
    0.044_733,
    -0.010_301_148_6,
    0.001_267_712_6,
];
pub(super) const NARROW_LAST: [f32; 6] = [
    0.618_837_54,
    -0.163_962_47,
    0.061_104_182,
    -0.020_317_484,
    0.005_026_328_4,
    -0.000_693_899_2,
];
pub(super) const NARROW_EARLY: [f32; 3] = [0.590_407_9, -0.104_623_47, 0.014_234_926];

/// Adds the part of one coefficient, of the rows before and after the middle, to an output.
macro_rules! pair {
    ($y:expr, $a:expr, $b:expr, $l:ident, $h:expr) => {
        $y.plus(L::of_row(&$a, $l).plus(L::of_row(&$b, $l)).times($h))
    };
}

/// Adds the part of one coefficient to eight outputs, each of which sees its two samples one row later.
macro_rules! add_pair {
    ($y:ident, $e:ident, $l:ident, $h:expr, $j:literal $k:literal) => {
        $y[0] = pair!($y[0], $e[$j], $e[$k], $l, $h);
        $y[1] = pair!($y[1], $e[$j + 1], $e[$k + 1], $l, $h);
        $y[2] = pair!($y[2], $e[$j + 2], $e[$k + 2], $l, $h);
        $y[3] = pair!($y[3], $e[$j + 3], $e[$k + 3], $l, $h);
        $y[4] = pair!($y[4], $e[$j + 4], $e[$k + 4], $l, $h);
        $y[5] = pair!($y[5], $e[$j + 5], $e[$k + 5], $l, $h);
        $y[6] = pair!($y[6], $e[$j + 6], $e[$k + 6], $l, $h);
        $y[7] = pair!($y[7], $e[$j + 7], $e[$k + 7], $l, $h);
    };
}

/// Eight outputs of a filter over a lane of rows of second samples and of first ones. The sums are
/// written out, since the chip's code is made small rather than fast. Each coefficient comes with the
/// rows of its two samples, those next to the middle one first.
macro_rules! sums {
    ($h:ident, $e:ident, $f:ident, $l:ident, $($i:literal: $j:literal $k:literal),*) => {{
        let mut y = [
            L::of_row(&$f[0], $l),
            L::of_row(&$f[1], $l),
            L::of_row(&$f[2], $l),
            L::of_row(&$f[3], $l),
            L::of_row(&$f[4], $l),
            L::of_row(&$f[5], $l),
            L::of_row(&$f[6], $l),
            L::of_row(&$f[7], $l),
        ];
        $(add_pair!(y, $e, $l, $h[$i], $j $k);)*
        y
    }};
}

/// A filter before the last one, for `channels` channels of a group: its outputs are first and second
/// samples of the next.
macro_rules! early {
    ($name:ident, $h:ident, $rows:literal, $($taps:tt)*) => {
        #[cfg_attr(target_os = "none", inline(never))] // All registers are its own.
        #[cfg_attr(not(target_os = "none"), inline(always))]
        pub(super) fn $name<L: Lane>(
            channels: usize,
            e: &[L::Row],
            f: &[L::Row],
            into: &mut [L::Row],
            [second, first]: [usize; 2],
        ) {
            let (Some(e), Some(f)) = (e.first_chunk::<$rows>(), f.first_chunk::<TOGETHER>()) else {
                return;
            };
            let Some((seconds, firsts)) = into.split_at_mut_checked(first) else {
                return;
            };
            let seconds = seconds.get_mut(second..).and_then(|rows| rows.first_chunk_mut::<4>());
            let (Some(seconds), Some(firsts)) = (seconds, firsts.first_chunk_mut::<4>()) else {
                return;
            };
            let mut l = 0;
            while l < channels.min(L::Row::CHANNELS) {
                let y = sums!($h, e, f, l, $($taps)*);
                y[0].into_row(&mut firsts[0], l);
                y[1].into_row(&mut seconds[0], l);
                y[2].into_row(&mut firsts[1], l);
                y[3].into_row(&mut seconds[1], l);
                y[4].into_row(&mut firsts[2], l);
                y[5].into_row(&mut seconds[2], l);
                y[6].into_row(&mut firsts[3], l);
                y[7].into_row(&mut seconds[3], l);
                l += L::WIDTH;
            }
        }
    };
}

/// The last filter, for as many channels as there are rings, whose places `at` take the outputs.
macro_rules! last {
    ($name:ident, $h:ident, $rows:literal, $($taps:tt)*) => {
        #[cfg_attr(target_os = "none", inline(never))] // All registers are its own.
        #[cfg_attr(not(target_os = "none"), inline(always))]
        pub(super) fn $name<L: Lane>(
            [e, f]: [&[L::Row]; 2],
            rings: &mut [f32],
            (n, at): (usize, usize),
        ) {
            let (Some(e), Some(f)) = (e.first_chunk::<$rows>(), f.first_chunk::<TOGETHER>()) else {
                return;
            };
            let rings = rings.chunks_exact_mut((n * L::WIDTH).max(1)).enumerate();
            for (k, ring) in rings.take(L::Row::CHANNELS / L::WIDTH) {
                let (l, ring) = (k * L::WIDTH, L::samples_mut(ring));
                if let Some(into) = ring.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
                    *into = sums!($h, e, f, l, $($taps)*);
                }
            }
        }
    };
}

early!(narrow_early, NARROW_EARLY, 13,
    0: 2 3, 1: 1 4, 2: 0 5);
early!(wide_early, WIDE_EARLY, 17,
    0: 4 5, 1: 3 6, 2: 2 7, 3: 1 8, 4: 0 9);
last!(narrow_last, NARROW_LAST, 19,
    0: 5 6, 1: 4 7, 2: 3 8, 3: 2 9, 4: 1 10, 5: 0 11);
last!(wide_last, WIDE_LAST, 37,
    0: 14 15, 1: 13 16, 2: 12 17, 3: 11 18, 4: 10 19, 5: 9 20, 6: 8 21, 7: 7 22, 8: 6 23, 9:
    5 24, 10: 4 25, 11: 3 26, 12: 2 27, 13: 1 28, 14: 0 29);

#[cfg(test)]
mod tests {
    use super::*;

    /// Magnitude of a half-band filter at `f` in units of its input rate.
    fn magnitude(h: &[f32], f: f64) -> f64 {
        let cosines = h.iter().enumerate().map(|(i, &h)| {
            let distance = (2 * i + 1) as f64;
            f64::from(h) * libm::cos(2.0 * core::f64::consts::PI * f * distance)
        });
        0.5 + cosines.sum::<f64>()
    }

    #[test]
    fn the_filters_are_what_the_table_says() {
        for (h, edge, ripple, stop) in [
            (&WIDE_LAST[..], 0.195_312_5, 5e-6, -106.9),
            (&WIDE_EARLY[..], 0.097_656_25, 3e-6, -111.0),
            (&NARROW_LAST[..], 0.125, 6e-6, -104.0),
            (&NARROW_EARLY[..], 0.0625, 2e-5, -94.0),
        ] {
            for k in 0..=1000 {
                let pass = edge * f64::from(k) / 1000.0;
                assert!((magnitude(h, pass) - 1.0).abs() < ripple, "{pass}");
                let beyond = 0.5 - pass;
                let db = 20.0 * libm::log10(magnitude(h, beyond).abs());
                assert!(db < stop, "{beyond}: {db} dB");
            }
        }
    }
}

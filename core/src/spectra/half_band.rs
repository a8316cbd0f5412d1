//! Filters of the decimation: their coefficients, and sums for eight outputs at a time.
//!
//! There are two sets, by the share of the decimated block that the last line reaches. The longer ones
//! are half-band filters: every other coefficient is zero, the middle one is a half, and they are
//! equiripple (Parks and McClellan). The shorter ones have all their zeros in the stop band (Dolph and
//! Chebyshev), and no pass band: what they take from a line, [`super::gains`] gives back to it.
//!
//! | lines up to, of the block | stage | taps | pass band, of its input rate | stop band |
//! | --- | --- | --- | --- | --- |
//! | 1/4 | last | 9 | 0.125, -6.0 dB at its end | 0.375 and up, -100 dB |
//! | | before | 6 | 0.0625, -0.9 dB at its end | 0.4375 and up, -93.7 dB |
//! | 25/64 | last | 59 | 0.1953125, ripple 5e-6 | 0.3046875 and up, -107 dB |
//! | | before | 19 | 0.09765625, ripple 3e-6 | 0.40234375 and up, -111 dB |
//!
//! The stop bands of the shorter ones are relative to the line that a frequency folds onto, where
//! that is what counts. A frequency that folds onto a line is uncorrelated with it, so it biases averaged
//! spectra by its power, 4e-10 at most, and makes them scatter by its amplitude, 2e-5. What this does to
//! responses, computed in `f64` for white noise of 24 blocks and a structure with modes in the band and
//! in both stop bands, 1 % noise, 64 lines of 1024; a response without leakage scatters by 2e-3 there:
//!
//! | half-band taps, last and before | stop bands, dB | change of responses |
//! | --- | --- | --- |
//! | 15, 7 | -72, -65 | 1e-4 |
//! | 19, 11 | -89, -94 | 3e-6 |
//! | 23, 11 | -105, -94 | 2e-6 |
//! | 27, 15 | -121, -123 | 2e-7 |
//! | 59, 19 | -107, -112 | 7e-7 |
//!
//! The first of them could be seen in the scatter, and the second where modes above the band are a
//! thousand times those in it. The same stop bands without a pass band take half the work, in products
//! and sums for an output of four:
//!
//! | filters | taps, last and before | stop bands, dB | products | sums |
//! | --- | --- | --- | --- | --- |
//! | half-band | 23, 11 | -104, -94 | 12 | 24 |
//! | zeros in the stop band alone | 8, 6 | -87, -94 | 7 | 17 |
//! | | 9, 6 | -100, -94 | 8 | 18 |
//! | | 10, 7 | -113, -114 | 10 | 21 |
//!
//! The middle one of these is taken, since nothing that folds is to be seen beside the noise of
//! converters: one of 24 bits, of which 17 to 18 are free of noise at the rates of a box, has it 100 dB below its
//! full scale.

use super::lane::{GROUP, Lane, Row};

/// Most stages: a factor of sixteen.
pub(super) const MAX_STAGES: usize = 4;

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
/// Coefficients at the distances 1, 2, … from the middle one, which is one.
pub(super) const NARROW_LAST: [f32; 4] = [0.817_491_8, 0.436_345_5, 0.139_234_75, 0.020_390_457];
/// Coefficients beside the two middle ones, which are one.
pub(super) const NARROW_EARLY: [f32; 2] = [0.509_699_64, 0.105_973_296];

/// What outputs of a filter see.
pub(super) struct Sees {
    /// Number of its taps.
    pub(super) taps: usize,
    /// Rows before the newest ones, of second samples of pairs and of first ones.
    pub(super) before: [usize; 2],
}

pub(super) const WIDE_LAST_SEES: Sees = Sees {
    taps: 59,
    before: [29, 14],
};
pub(super) const WIDE_EARLY_SEES: Sees = Sees {
    taps: 19,
    before: [9, 4],
};
pub(super) const NARROW_LAST_SEES: Sees = Sees {
    taps: 9,
    before: [4, 3],
};
pub(super) const NARROW_EARLY_SEES: Sees = Sees {
    taps: 6,
    before: [2, 2],
};

/// Adds the part of one coefficient, of the two samples at one distance from the middle, to an output.
macro_rules! pair {
    ($y:expr, $a:expr, $b:expr, $l:ident, $h:expr) => {
        $y.plus(L::of_row(&$a, $l).plus(L::of_row(&$b, $l)).times($h))
    };
}

/// Adds the part of one coefficient to eight outputs, each of which sees its two samples one row later.
macro_rules! add_pair {
    ($y:ident, $l:ident, $h:expr, $a:ident $j:literal $b:ident $k:literal) => {
        $y[0] = pair!($y[0], $a[$j], $b[$k], $l, $h);
        $y[1] = pair!($y[1], $a[$j + 1], $b[$k + 1], $l, $h);
        $y[2] = pair!($y[2], $a[$j + 2], $b[$k + 2], $l, $h);
        $y[3] = pair!($y[3], $a[$j + 3], $b[$k + 3], $l, $h);
        $y[4] = pair!($y[4], $a[$j + 4], $b[$k + 4], $l, $h);
        $y[5] = pair!($y[5], $a[$j + 5], $b[$k + 5], $l, $h);
        $y[6] = pair!($y[6], $a[$j + 6], $b[$k + 6], $l, $h);
        $y[7] = pair!($y[7], $a[$j + 7], $b[$k + 7], $l, $h);
    };
}

/// What eight outputs begin with: the samples in the middle, or the sums of the two beside it.
macro_rules! middle {
    ($l:ident, $f:ident $m:literal) => {
        [
            L::of_row(&$f[$m], $l),
            L::of_row(&$f[$m + 1], $l),
            L::of_row(&$f[$m + 2], $l),
            L::of_row(&$f[$m + 3], $l),
            L::of_row(&$f[$m + 4], $l),
            L::of_row(&$f[$m + 5], $l),
            L::of_row(&$f[$m + 6], $l),
            L::of_row(&$f[$m + 7], $l),
        ]
    };
    ($l:ident, $a:ident $j:literal $b:ident $k:literal) => {
        [
            L::of_row(&$a[$j], $l).plus(L::of_row(&$b[$k], $l)),
            L::of_row(&$a[$j + 1], $l).plus(L::of_row(&$b[$k + 1], $l)),
            L::of_row(&$a[$j + 2], $l).plus(L::of_row(&$b[$k + 2], $l)),
            L::of_row(&$a[$j + 3], $l).plus(L::of_row(&$b[$k + 3], $l)),
            L::of_row(&$a[$j + 4], $l).plus(L::of_row(&$b[$k + 4], $l)),
            L::of_row(&$a[$j + 5], $l).plus(L::of_row(&$b[$k + 5], $l)),
            L::of_row(&$a[$j + 6], $l).plus(L::of_row(&$b[$k + 6], $l)),
            L::of_row(&$a[$j + 7], $l).plus(L::of_row(&$b[$k + 7], $l)),
        ]
    };
}

/// Eight outputs of a filter over a lane of rows of second samples and of first ones. The sums are
/// written out, since the chip's code is made small rather than fast. The rows in the middle come
/// first, then those of each coefficient, those next to the middle first.
macro_rules! sums {
    ($h:ident, $l:ident, [$($middle:tt)*], $($i:literal: $a:ident $j:literal $b:ident $k:literal),*) => {{
        let mut y = middle!($l, $($middle)*);
        $(add_pair!(y, $l, $h[$i], $a $j $b $k);)*
        y
    }};
}

/// A filter before the last one, for `channels` channels of a group: eight outputs after eight, as
/// many as `seconds` and `firsts` have room for, which are those samples of the next filter.
macro_rules! early {
    ($name:ident, $h:ident, $e:ident $seconds:literal, $f:ident $firsts:literal, $($taps:tt)*) => {
        #[inline(never)] // All registers are its own.
        pub(super) fn $name<L: Lane>(
            channels: usize,
            mut later_e: &[Row],
            mut later_f: &[Row],
            seconds: &mut [Row],
            firsts: &mut [Row],
        ) {
            let (seconds, firsts) = (seconds.as_chunks_mut::<4>().0, firsts.as_chunks_mut::<4>().0);
            for (seconds, firsts) in seconds.iter_mut().zip(firsts) {
                let (Some($e), Some($f)) = (later_e.first_chunk::<$seconds>(), later_f.first_chunk::<$firsts>())
                else {
                    return;
                };
                let mut l = 0;
                while l < channels.min(GROUP) {
                    let y = sums!($h, l, $($taps)*);
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
                later_e = later_e.get(TOGETHER..).unwrap_or_default();
                later_f = later_f.get(TOGETHER..).unwrap_or_default();
            }
        }
    };
}

/// The last filter, for as many channels as there are rings, whose places `at` take the outputs.
macro_rules! last {
    ($name:ident, $h:ident, $e:ident $seconds:literal, $f:ident $firsts:literal, $($taps:tt)*) => {
        #[inline(never)] // All registers are its own.
        pub(super) fn $name<L: Lane>(
            e: &[Row],
            f: &[Row],
            rings: &mut [f32],
            (n, at): (usize, usize),
        ) {
            let (Some($e), Some($f)) = (e.first_chunk::<$seconds>(), f.first_chunk::<$firsts>())
            else {
                return;
            };
            let rings = rings.chunks_exact_mut((n * L::WIDTH).max(1)).enumerate();
            for (k, ring) in rings.take(GROUP / L::WIDTH) {
                let (l, ring) = (k * L::WIDTH, L::samples_mut(ring));
                if let Some(into) = ring.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
                    *into = sums!($h, l, $($taps)*);
                }
            }
        }
    };
}

early!(narrow_early, NARROW_EARLY, e 10, f 10, [f 1 e 1],
    0: e 0 f 2, 1: f 0 e 2);
early!(wide_early, WIDE_EARLY, e 17, f 8, [f 0],
    0: e 4 e 5, 1: e 3 e 6, 2: e 2 e 7, 3: e 1 e 8, 4: e 0 e 9);
last!(narrow_last, NARROW_LAST, e 12, f 11, [e 2],
    0: f 1 f 2, 1: e 1 e 3, 2: f 0 f 3, 3: e 0 e 4);
last!(wide_last, WIDE_LAST, e 37, f 8, [f 0],
    0: e 14 e 15, 1: e 13 e 16, 2: e 12 e 17, 3: e 11 e 18, 4: e 10 e 19, 5: e 9 e 20, 6: e 8 e 21,
    7: e 7 e 22, 8: e 6 e 23, 9: e 5 e 24, 10: e 4 e 25, 11: e 3 e 26, 12: e 2 e 27, 13: e 1 e 28,
    14: e 0 e 29);

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
    fn half_band_filters_are_what_the_table_says() {
        for (h, edge, ripple, stop) in [
            (&WIDE_LAST[..], 0.195_312_5, 5e-6, -106.9),
            (&WIDE_EARLY[..], 0.097_656_25, 3e-6, -111.0),
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

    #[test]
    fn filters_without_a_pass_band_are_what_the_table_says() {
        // Distances of the first pair from the middle, and what stands in the middle.
        for (h, middle, first, edge, at_end, stop) in [
            (&NARROW_LAST[..], 0.5, 1.0, 0.125, -6.0, -100.2),
            (&NARROW_EARLY[..], 0.0, 0.5, 0.0625, -0.86, -93.7),
        ] {
            let magnitude = |f: f64| {
                let turn = |distance: f64| libm::cos(2.0 * core::f64::consts::PI * f * distance);
                let inner = if middle > 0.0 { middle } else { turn(first) };
                let from = if middle > 0.0 { first } else { first + 1.0 };
                let pairs = h.iter().zip(0..);
                inner
                    + pairs
                        .map(|(&h, i)| f64::from(h) * turn(from + f64::from(i)))
                        .sum::<f64>()
            };
            let db = |ratio: f64| 20.0 * libm::log10(ratio.abs());
            let droop = db(magnitude(edge) / magnitude(0.0));
            assert!((droop - at_end).abs() < 0.01, "{droop}");
            for k in 0..=1000 {
                let line = edge * f64::from(k) / 1000.0;
                let folded = db(magnitude(0.5 - line) / magnitude(line));
                assert!(folded < stop, "{line}: {folded} dB");
            }
        }
    }
}

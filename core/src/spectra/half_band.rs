//! Half-band filters of the decimation by two: two branches of all-pass sections, of which one takes
//! every first sample and the other every second one.
//!
//! An output is the sum of both branches, `A₀(z²) + z⁻¹ A₁(z²)`, whose sections are
//! `y[n] = c (x[n] - y[n-1]) + x[n-1]` at the lower rate: one product each. In the pass band both branches
//! agree, in the stop band they cancel each other. The filters are elliptic (Cauer). There are two sets, by
//! the share of the decimated block that the last line reaches:
//!
//! | lines up to, of the block | stage | sections | pass band, of its input rate | stop band |
//! | --- | --- | --- | --- | --- |
//! | 1/4 | last | 4 | 0.125 | 0.375 and up, -117 dB |
//! | | before | 2 | 0.0625 | 0.4375 and up, -94 dB |
//! | 25/64 | last | 6 | 0.1953125 | 0.3046875 and up, -108 dB |
//! | | before | 3 | 0.09765625 | 0.40234375 and up, -106 dB |
//!
//! The pass band is flat to 4e-10, since the squares of both bands' gains have the sum one. The phase is
//! not linear, but the same for all channels, the drive among them, so that no response and no coherence
//! notices it. Linear-phase filters of such stop bands would take 12 and 25 products an output of four
//! samples instead of 8 and 12, and a delay line of all samples that they see.
//!
//! A frequency that folds onto a line is uncorrelated with it, so it biases averaged spectra by its
//! power, 4e-10 at most, and makes them scatter by its amplitude, 2e-5. This is its effect on responses,
//! computed in `f64` for white noise of 24 blocks and a structure with modes in the band and in both
//! stop bands, 1 % noise, 64 lines of 1024; a response without leakage scatters by 2e-3 there. In the last
//! column the modes above the band are a thousand times as strong:
//!
//! | lines up to | sections, last and before | stop bands, dB | products an output of four | change of responses | with strong modes |
//! | --- | --- | --- | ---: | ---: | ---: |
//! | 1/4 | 2, 1 | -62, -54 | 4 | 4e-4 | 2e-2 |
//! | | 3, 2 | -89, -94 | 7 | 8e-6 | 1.4e-4 |
//! | | **4, 2** | -117, -94 | 8 | 1e-6 | 1.1e-4 |
//! | | 5, 3 | -144, -134 | 11 | 3e-7 | 1e-6 |
//! | 25/64 | 4, 2 | -73, -74 | 8 | 4e-5 | 2e-3 |
//! | | 5, 3 | -90, -106 | 11 | 4e-6 | 5e-5 |
//! | | **6, 3** | -108, -106 | 12 | 1e-6 | 3e-5 |

use super::lane::{Lane, Row};

/// Coefficients of the sections in rising order: in turn those of second samples and of first ones.
pub(super) const WIDE_LAST: [f32; 6] = [
    0.036_826_964,
    0.139_498_75,
    0.289_207_83,
    0.466_490_95,
    0.660_844_7,
    0.876_901_6,
];
pub(super) const WIDE_EARLY: [f32; 3] = [0.062_173_83, 0.262_097_27, 0.664_340_3];
pub(super) const NARROW_LAST: [f32; 4] = [0.042_454_68, 0.170_739_74, 0.393_319_73, 0.745_713_5];
pub(super) const NARROW_EARLY: [f32; 2] = [0.112_484_67, 0.540_805_5];

/// Numbers that a filter of so many sections remembers: the last input of each branch, and the last output
/// of each section.
pub(super) const fn state_len(sections: usize) -> usize {
    2 + sections
}

/// Passes a sample through the sections of a branch, whose last input is the state `$input`: each comes
/// with the numbers of its coefficient and of its state.
macro_rules! branch {
    ($x:expr, $h:ident, $s:ident, $input:literal, $($c:literal $y:literal),*) => {{
        let (mut x, mut before) = ($x, $s[$input]);
        $s[$input] = x;
        $(
            let last = $s[$y];
            let y = x.minus(last).times($h[$c]).plus(before);
            $s[$y] = y;
            (x, before) = (y, last);
        )*
        let _ = before;
        x
    }};
}

/// An output of a filter, twice as large: its first and its second sample, its coefficients, what it
/// remembers, and the branches of second and of first samples.
macro_rules! output {
    ($first:expr, $second:expr, $h:ident, $s:ident, [$($seconds:tt)*], [$($firsts:tt)*]) => {{
        let second = branch!($second, $h, $s, $($seconds)*);
        second.plus(branch!($first, $h, $s, $($firsts)*))
    }};
}

/// Calls `$output` for each output: with the `$per` rows that it takes, and with its slot. All is written
/// out, since the chip's code is made small rather than fast.
macro_rules! each_output {
    ($inputs:expr, $per:literal, $four_take:literal, $slots:expr, $output:ident) => {{
        let (fours, inputs) = $inputs.as_chunks::<$four_take>();
        let (slots_of_fours, slots) = $slots.as_chunks_mut::<4>();
        for (x, y) in fours.iter().zip(slots_of_fours) {
            let (rows, _) = x.as_chunks::<$per>();
            $output!(rows[0], y[0]);
            $output!(rows[1], y[1]);
            $output!(rows[2], y[2]);
            $output!(rows[3], y[3]);
        }
        for (rows, y) in inputs.as_chunks::<$per>().0.iter().zip(slots) {
            $output!(rows, *y);
        }
    }};
}

/// The filter of a stage before the last two, for the first `lanes` lanes of a group.
macro_rules! early {
    ($name:ident, $h:ident, $seconds:tt, $firsts:tt) => {
        #[cfg_attr(target_os = "none", inline(never))] // All registers are its own.
        #[cfg_attr(not(target_os = "none"), inline(always))]
        pub(super) fn $name<L: Lane>(
            lanes: usize,
            states: &mut [L::Row],
            inputs: &[L::Row],
            outputs: &mut [L::Row],
        ) {
            let states = L::samples_mut(L::Row::numbers_mut(states));
            let (states, _) = states.as_chunks_mut::<{ state_len($h.len()) }>();
            let mut l = 0;
            for kept in states.iter_mut().take(lanes) {
                let mut s = *kept;
                macro_rules! store {
                    ($x:expr, $slot:expr) => {{
                        let (first, second) = (L::of_row(&$x[0], l), L::of_row(&$x[1], l));
                        output!(first, second, $h, s, $seconds, $firsts).into_row(&mut $slot, l);
                    }};
                }
                each_output!(inputs, 2, 8, outputs, store);
                *kept = s;
                l += L::WIDTH;
            }
        }
    };
}

/// The filter of the only stage, for as many lanes of a group as there are rings of `n`, whose places from
/// `at` on take the outputs.
macro_rules! only {
    ($name:ident, $h:ident, $seconds:tt, $firsts:tt) => {
        #[cfg_attr(target_os = "none", inline(never))] // As above.
        #[cfg_attr(not(target_os = "none"), inline(always))]
        pub(super) fn $name<L: Lane>(
            states: &mut [L::Row],
            inputs: &[L::Row],
            rings: &mut [L],
            (n, at): (usize, usize),
        ) {
            let states = L::samples_mut(L::Row::numbers_mut(states));
            let (states, _) = states.as_chunks_mut::<{ state_len($h.len()) }>();
            let mut l = 0;
            for (kept, ring) in states.iter_mut().zip(rings.chunks_exact_mut(n.max(1))) {
                let slots = ring.get_mut(at..at + inputs.len() / 2).unwrap_or_default();
                let mut s = *kept;
                macro_rules! store {
                    ($x:expr, $slot:expr) => {{
                        let (first, second) = (L::of_row(&$x[0], l), L::of_row(&$x[1], l));
                        $slot = output!(first, second, $h, s, $seconds, $firsts);
                    }};
                }
                each_output!(inputs, 2, 8, slots, store);
                *kept = s;
                l += L::WIDTH;
            }
        }
    };
}

/// The filters of the last two stages at once, whose states lie one behind the other: outputs of the first
/// one are not stored. Lanes and rings are as above.
macro_rules! last_two {
    ($name:ident, $e:ident, $es:tt, $ef:tt, $h:ident, $seconds:tt, $firsts:tt) => {
        #[cfg_attr(target_os = "none", inline(never))] // As above.
        #[cfg_attr(not(target_os = "none"), inline(always))]
        pub(super) fn $name<L: Lane>(
            states: &mut [L::Row],
            inputs: &[L::Row],
            rings: &mut [L],
            (n, at): (usize, usize),
        ) {
            let early = state_len($e.len()).min(states.len());
            let (early, states) = states.split_at_mut(early);
            let early = L::samples_mut(L::Row::numbers_mut(early));
            let (early, _) = early.as_chunks_mut::<{ state_len($e.len()) }>();
            let states = L::samples_mut(L::Row::numbers_mut(states));
            let (states, _) = states.as_chunks_mut::<{ state_len($h.len()) }>();
            let kept = early.iter_mut().zip(states);
            let mut l = 0;
            for ((kept_early, kept), ring) in kept.zip(rings.chunks_exact_mut(n.max(1))) {
                let slots = ring.get_mut(at..at + inputs.len() / 4).unwrap_or_default();
                let (mut e, mut s) = (*kept_early, *kept);
                macro_rules! store {
                    ($x:expr, $slot:expr) => {{
                        let (first, second) = (L::of_row(&$x[0], l), L::of_row(&$x[1], l));
                        let a = output!(first, second, $e, e, $es, $ef);
                        let (first, second) = (L::of_row(&$x[2], l), L::of_row(&$x[3], l));
                        let b = output!(first, second, $e, e, $es, $ef);
                        $slot = output!(a, b, $h, s, $seconds, $firsts);
                    }};
                }
                each_output!(inputs, 4, 16, slots, store);
                (*kept_early, *kept) = (e, s);
                l += L::WIDTH;
            }
        }
    };
}

early!(narrow_early, NARROW_EARLY, [0, 0 1], [2, 1 3]);
early!(wide_early, WIDE_EARLY, [0, 0 1, 2 2], [3, 1 4]);
only!(narrow_only, NARROW_LAST, [0, 0 1, 2 2], [3, 1 4, 3 5]);
only!(wide_only, WIDE_LAST, [0, 0 1, 2 2, 4 3], [4, 1 5, 3 6, 5 7]);
last_two!(narrow_last_two, NARROW_EARLY, [0, 0 1], [2, 1 3], NARROW_LAST, [0, 0 1, 2 2], [3, 1 4, 3 5]);
last_two!(
    wide_last_two, WIDE_EARLY, [0, 0 1, 2 2], [3, 1 4],
    WIDE_LAST, [0, 0 1, 2 2, 4 3], [4, 1 5, 3 6, 5 7]
);

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use nalgebra::Complex;

    /// Gain of a filter at `f` in units of its input rate.
    fn gain(h: &[f32], f: f64) -> f64 {
        let one = Complex::new(1.0, 0.0);
        let z = |power: f64| Complex::new(libm::cos(PI * f * power), -libm::sin(PI * f * power));
        let branch = |from: usize| {
            let sections = h.iter().skip(from).step_by(2);
            sections.fold(one, |product, &c| {
                let c = f64::from(c);
                product * (z(4.0) + c) / (one + z(4.0) * c)
            })
        };
        (branch(0) + z(2.0) * branch(1)).norm_sqr().sqrt() / 2.0
    }

    #[test]
    fn the_filters_are_what_the_table_says() {
        for (h, edge, stop) in [
            (&WIDE_LAST[..], 0.195_312_5, -107.8),
            (&WIDE_EARLY[..], 0.097_656_25, -105.9),
            (&NARROW_LAST[..], 0.125, -116.7),
            (&NARROW_EARLY[..], 0.0625, -94.2),
        ] {
            for k in 0..=1000 {
                let pass = edge * f64::from(k) / 1000.0;
                assert!((gain(h, pass) - 1.0).abs() < 4e-10, "{pass}");
                let beyond = 0.5 - pass;
                let db = 20.0 * libm::log10(gain(h, beyond));
                assert!(db < stop, "{beyond}: {db} dB");
            }
        }
    }
}

//! Tests of sums over driven lines, against those of double precision and with numbers that are none.

use super::{Columns, Driven, MAX_TERMS};
use crate::geometry::{Equations, RESULTANTS};
use crate::masslines::lines::Internals;
use crate::masslines::moved::Moved;
use crate::masslines::samples::{LINES, RUNS, Samples, in_single, weights};
use crate::masslines::{Bands, DriveLines, Lines, MAX_RUNS, Method, condense, lines_between};
use crate::spectra::{Complex32, RunResponses, Window};
use core::ops::Range;
use nalgebra::{Complex, Vector3, Vector6};

fn columns<'a>(runs: &'a [RunResponses<'a>], band: Range<usize>) -> Option<Columns<'a>> {
    let all = 0..runs.len();
    Columns::new(Driven::new(runs), &weights(), all, &band, 3, &in_single)
}

#[test]
fn what_whole_numbers_cannot_hold_is_left_to_others() {
    let ordinary = Samples::new();
    assert!(columns(&ordinary.runs(), 0..LINES).is_some());
    for off in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38] {
        let mut samples = Samples::new();
        samples.responses[1][5][8].im = off;
        samples.drive[1][5] = 1e10;
        assert!(columns(&samples.runs(), 0..LINES).is_none(), "{off}");
        // It is not among these lines.
        assert!(columns(&samples.runs(), 6..LINES).is_some(), "{off}");
        let mut samples = Samples::new();
        samples.drive[1][5] = -off.abs();
        assert!(columns(&samples.runs(), 0..LINES).is_none(), "{off}");
    }
    // Denormal numbers, which have few digits.
    let mut samples = Samples::new();
    for line in samples.responses.iter_mut().flatten() {
        line[3] *= 1e-41;
    }
    assert!(columns(&samples.runs(), 0..LINES).is_none());
    // More lines than 25 bits allow for.
    let many = [ordinary.runs()[0]; 120];
    let all = 0..many.len();
    let driven = Driven::new(&many);
    let ones = [1.0; MAX_RUNS];
    assert!(Columns::new(driven, &ones, all, &(0..LINES), 3, &in_single).is_none());
}

#[test]
fn a_silent_channel_is_zero_and_the_largest_numbers_overflow_nothing() {
    let mut samples = Samples::new();
    for line in samples.responses.iter_mut().flatten() {
        // All at the top of their range, and in phase.
        *line = [Complex32::new(0.999_999_9, 0.999_999_9); RESULTANTS];
        line[2] = Complex32::new(0.0, 0.0);
    }
    for drive in samples.drive.iter_mut().flatten() {
        *drive = 1.0;
    }
    let runs = samples.runs();
    let ones = [1.0; MAX_RUNS];
    let rigid = |_| [Complex32::new(1.0, 0.0); MAX_TERMS];
    let columns = Columns::new(Driven::new(&runs), &ones, 0..RUNS, &(0..LINES), 3, &rigid).unwrap();
    let mut sum = 0_i64;
    columns.visit_whole(&rigid, |whole| {
        assert_eq!(whole[6 + 2].add_products(&whole[6 + 2], 0), 0);
        // In builds with debug assertions an overflow stops here.
        sum = whole[0].add_products(&whole[7], sum);
    });
    let value = sum as f64 * columns.unit(0) * columns.unit(7);
    let expected = (RUNS * LINES) as f64 * 2.0 * f64::from(0.999_999_9_f32).powi(2);
    assert!((value / expected - 1.0).abs() < 1e-7, "{value} {expected}");
    let squares = Driven::new(&runs).squares(1, &(0..LINES)).unwrap();
    assert_eq!(squares.aa[(2, 2)], 0.0);
    assert!(squares.aa[(1, 1)] > 0.0);
}

/// Whatever the numbers are, an identification ends in finite numbers or says why not.
#[test]
fn numbers_that_are_none_are_no_answer() {
    let answer = |samples: &Samples| {
        let runs = samples.runs();
        let lines = DriveLines::new(&runs, Window::Hann).unwrap();
        let band = lines_between(&lines, [1.0, 12.0]).unwrap();
        let mut work = [Complex::new(0.0, 0.0); 2 * LINES];
        let (bands, all) = (Bands::new(band), Equations::all());
        condense(
            Method::ApparentMass,
            &lines,
            &bands,
            Vector3::zeros(),
            &all,
            &mut work,
        )
    };
    assert!(answer(&Samples::new()).is_ok());
    for off in [f32::NAN, f32::INFINITY] {
        for channel in [1, 8] {
            let mut samples = Samples::new();
            samples.responses[1][5][channel].re = off;
            assert!(answer(&samples).is_err(), "{off} in channel {channel}");
        }
        let mut samples = Samples::new();
        samples.drive[0][9] = off;
        assert!(answer(&samples).is_err(), "drive {off}");
    }
    for size in [0.0, 1e-44, 1e-30, 1e30, 3e37] {
        for channels in [0..6, 6..12, 0..12, 3..4] {
            let mut samples = Samples::new();
            for line in samples.responses.iter_mut().flatten() {
                for z in &mut line[channels.clone()] {
                    *z *= size;
                }
            }
            if let Ok(found) = answer(&samples) {
                for pair in found.masslines.pairs() {
                    let numbers = pair.acceleration.iter().chain(&pair.force);
                    assert!(numbers.chain(&pair.variance).all(|x| x.is_finite()));
                }
            }
        }
    }
}

/// The scalar of the poles is that of double precision.
#[test]
fn the_power_in_single_precision_is_that_in_double() {
    let samples = Samples::new();
    let runs = samples.runs();
    let shift = Vector3::new(0.3, -0.5, 0.1);
    let lines = DriveLines::new(&runs, Window::Hann).unwrap();
    let moved = Moved::new(&lines, &shift);
    let w = Vector6::new(100.0, 50.0, 2.0, 1.0, 30.0, 0.4);
    let mut found = [Complex::new(0.0, 0.0); LINES];
    let driven = moved.driven().unwrap();
    driven.power_like(0..LINES, &w, &mut found).unwrap();
    for (line, found) in found.iter().enumerate() {
        let mut sum = Complex::new(0.0, 0.0);
        let mut size = 0.0;
        for run in 0..moved.runs() {
            let (a, f) = moved.pair(run, line).unwrap();
            let mut norm = 0.0;
            let mut power = Complex::new(0.0, 0.0);
            let mut sizes = 0.0;
            for j in 0..6 {
                power += f[j] * a[j].conj();
                sizes += f[j].norm_sqr().sqrt() * a[j].norm_sqr().sqrt();
                norm += w[j] * a[j].norm_sqr();
            }
            sum += power / norm;
            size += sizes / norm;
        }
        // Some twenty roundings of what is added up, which partly cancels.
        let error = (found - sum).norm_sqr().sqrt();
        assert!(
            error < 30.0 * f64::from(f32::EPSILON) * size,
            "{line}: {error} {size}"
        );
    }
}

/// Second moments of a run about another point are those of amplitudes that are moved one by one:
/// `u_B = u_A - s x w` and `m_B = m_A - s x f`.
///
/// Bounds are those of the sums of a regression, whose whole numbers these are. The lines are an odd
/// number, and none is larger than the others.
#[test]
fn second_moments_are_those_of_moved_amplitudes() {
    type Numbers = [Complex<f64>; 6];
    let samples = Samples::new();
    let runs = samples.runs();
    let band = 8..LINES - 1;
    assert_eq!(band.len() % 2, 1);
    let off = 2.0 * (0.5_f64.powi(21) + 0.5_f64.powi(20));
    for shift in [Vector3::zeros(), Vector3::new(0.3, -0.5, 0.2)] {
        for run in 0..RUNS {
            let driven = Driven::new(&runs).moved(&shift);
            let found = driven.squares(run, &band).unwrap();
            let mut expected = [[[0.0; 6]; 6]; 2];
            let mut norms = [[0.0; 6]; 2];
            for line in band.clone() {
                let drive = f64::from(samples.drive[run][line]);
                let at =
                    samples.responses[run][line].map(|z| Complex::new(z.re.into(), z.im.into()));
                let [x, y, z, p, q, r, f, g, h, k, l, m]: [Complex<f64>; 12] = at;
                let cross = |[a, b, c]: [Complex<f64>; 3]| {
                    let s = &shift;
                    [c * s.y - b * s.z, a * s.z - c * s.x, b * s.x - a * s.y]
                };
                let ([a, b, c], [d, e, n]) = (cross([p, q, r]), cross([f, g, h]));
                let accelerations: Numbers = [x - a, y - b, z - c, p, q, r];
                let forces: Numbers = [f, g, h, k - d, l - e, m - n];
                // Of what is moved, both parts count.
                let size = |x: Complex<f64>, y: Complex<f64>| 2.0 * (x.norm_sqr() + y.norm_sqr());
                let sizes = [
                    [
                        size(x, a),
                        size(y, b),
                        size(z, c),
                        size(p, p),
                        size(q, q),
                        size(r, r),
                    ],
                    [
                        size(f, f),
                        size(g, g),
                        size(h, h),
                        size(k, d),
                        size(l, e),
                        size(m, n),
                    ],
                ];
                for (kind, amplitudes) in [accelerations, forces].iter().enumerate() {
                    for i in 0..6 {
                        norms[kind][i] += drive * sizes[kind][i];
                        for j in 0..6 {
                            let product = amplitudes[i] * amplitudes[j].conj();
                            expected[kind][i][j] += drive * product.re;
                        }
                    }
                }
            }
            for (kind, found) in [found.aa, found.ff].iter().enumerate() {
                for i in 0..6 {
                    for j in 0..6 {
                        let error = (found[(i, j)] - expected[kind][i][j]).abs();
                        let size = (norms[kind][i] * norms[kind][j]).sqrt();
                        assert!(error < off * size, "{shift} {run} {kind}: {i} {j}");
                    }
                }
            }
        }
    }
}

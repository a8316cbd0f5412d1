use super::*;

const LINES: usize = 120;
const CONSTANT: f64 = 2.0;

fn frequency(line: usize) -> f64 {
    0.5 * (line as f64 + 1.0)
}

fn found(modes: &[(f64, f64, f64)], residues: Residues) -> heapless::Vec<Pole, MAX_MODES> {
    found_at(modes, residues, &frequency)
}

fn found_at(
    modes: &[(f64, f64, f64)],
    residues: Residues,
    frequency: &dyn Fn(usize) -> f64,
) -> heapless::Vec<Pole, MAX_MODES> {
    resonances_at(modes, residues, frequency).poles()
}

fn resonances_at(
    modes: &[(f64, f64, f64)],
    residues: Residues,
    frequency: &dyn Fn(usize) -> f64,
) -> Resonances {
    let mut work = [Complex::new(0.0, 0.0); 2 * LINES];
    for (k, t) in work.iter_mut().enumerate().take(LINES) {
        *t = Complex::new(CONSTANT, 0.0);
        for &(e, frequency_of_mode, damping) in modes {
            let pole = Pole {
                frequency: frequency_of_mode,
                damping,
            };
            *t += pole.amplification(frequency(k)) * e;
        }
    }
    let trace = Trace::new(&mut work, frequency);
    find_resonances(&trace, residues, &mut { PoleSearch::EMPTY })
}

#[test]
fn exact_lines_return_their_poles() {
    for (residues, sign) in [(Residues::Positive, 1.0), (Residues::Complex, -1.0)] {
        let modes = [(0.3, 32.5, 0.01), (sign * 0.1, 41.1, 0.02)];
        let found = resonances_at(&modes, residues, &frequency).found;
        assert_eq!(found.len(), 2);
        for (Resonance { pole, share }, (e, f, z)) in found.iter().zip(modes) {
            // The last accepted step gains less than 1e-9 of a cost that is zero at
            // the solution: the parameters are then good to its root, 3e-5.
            assert!((pole.frequency / f - 1.0).abs() < 3e-5, "{pole:?}");
            assert!((pole.damping / z - 1.0).abs() < 3e-5, "{pole:?}");
            assert!((share * CONSTANT / e - 1.0).abs() < 3e-5, "{share}");
        }
    }
}

#[test]
fn a_weak_mode_beside_a_strong_one_is_found() {
    let found = found(
        &[(1.0, 30.0, 0.005), (0.01, 37.0, 0.01)],
        Residues::Positive,
    );
    assert_eq!(found.len(), 2);
    assert!((found[1].frequency / 37.0 - 1.0).abs() < 1e-4);
}

/// Two modes are one if they lie within two lines of each other, wherever the first line lies.
#[test]
fn modes_far_above_the_first_line_are_two() {
    let modes = [(0.5, 23.0, 0.005), (0.5, 28.0, 0.005)];
    let found = found_at(&modes, Residues::Positive, &|line| 20.0 + 0.1 * line as f64);
    assert_eq!(found.len(), 2, "{found:?}");
    for (pole, (_, f, _)) in found.iter().zip(modes) {
        assert!((pole.frequency / f - 1.0).abs() < 3e-5, "{pole:?}");
    }
}

#[test]
fn two_lines_tell_the_resonance_between_them() {
    let (residue, own, damping) = (0.3, 32.3, 0.004);
    // The frequency response has viscous damping, and the estimate damping that does not grow
    // with frequency: half a line from the resonance they differ by a hundredth.
    let at = |f: f64| {
        let pole = Pole {
            frequency: own,
            damping,
        };
        let left = pole.amplification(f) * residue;
        (f as f32, Complex::new(left.re as f32, left.im as f32))
    };
    for (here, beside) in [(32.5, 32.0), (32.0, 32.5)] {
        let [e, f, z] = resonance(at(here), at(beside)).expect("a resonance");
        assert!((f / own - 1.0).abs() < 1e-4, "{f}");
        assert!((z / damping - 1.0).abs() < 0.02, "{z}");
        assert!((e / residue - 1.0).abs() < 0.02, "{e}");
    }
    // A constant has none, and neither has a pole beyond the lines.
    let flat = Complex::new(0.1, -0.1);
    assert_eq!(resonance((32.0, flat), (32.5, flat)), None);
    assert_eq!(resonance(at(40.0), at(40.5)), None);
}

/// 120 lines up to 60 Hz: the mode at 90 Hz is known from its flank alone, and so is one beside a peak.
#[test]
fn a_flank_tells_the_mode_above_the_lines() {
    let above = (0.3, 90.0, 0.01);
    for modes in [&[above][..], &[(0.2, 41.1, 0.02), above]] {
        let Resonances {
            found,
            beyond,
            upper,
        } = resonances_at(modes, Residues::Positive, &frequency);
        assert_eq!(found.len(), modes.len() - 1);
        let (e, f, _) = above;
        let Resonance { pole, share } = beyond.expect("a flank");
        // The root of the last step's gain, as of the peaks above.
        assert!((pole.frequency / f - 1.0).abs() < 3e-5, "{pole:?}");
        let [sum, expected] = [
            upper + share / (pole.frequency * pole.frequency),
            e / CONSTANT / (f * f),
        ];
        assert!((sum / expected - 1.0).abs() < 3e-5, "{sum} {expected}");
    }
}

/// A mode far above the lines is a term in ω², with the coefficient e / ω_r².
#[test]
fn a_flank_that_does_not_bend_is_no_mode() {
    let (e, f) = (0.3, 3000.0);
    let found = resonances_at(&[(e, f, 0.01)], Residues::Positive, &frequency);
    assert_eq!(found.beyond, None);
    let expected = e / CONSTANT / (f * f);
    // The next term of the series is (60 Hz / f)² of it at the last line.
    assert!(
        (found.upper / expected - 1.0).abs() < 4e-4,
        "{}",
        found.upper
    );
}

/// In the free structure, whose residues have any sign, nothing is said of modes above the lines.
#[test]
fn only_positive_residues_have_a_flank() {
    let found = resonances_at(&[(0.3, 90.0, 0.01)], Residues::Complex, &frequency);
    assert_eq!(found.beyond, None);
}

#[test]
fn a_rigid_body_has_none() {
    assert!(found(&[], Residues::Positive).is_empty());
}

#[test]
fn a_mode_above_the_lines_is_not_invented() {
    assert!(found(&[(0.3, 90.0, 0.01)], Residues::Positive).is_empty());
}

#[test]
fn no_lines_no_poles() {
    let none = Trace::new(&mut [], &frequency);
    assert!(find_poles(&none, Residues::Complex, &mut { PoleSearch::EMPTY }).is_empty());
}

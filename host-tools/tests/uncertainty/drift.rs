//! Forces that change within runs, or are coupled to alternating current.

use crate::distortion;
use crate::draws::Draws;
use crate::setups::{identify, satellite, type_b, uniaxial_of};
use massline::identification::{Answer, Session, estimates, number};
use std::collections::HashMap;

/// The warning of a change within runs.
fn told(answer: &Answer) -> Option<&str> {
    let mut warnings = answer.warnings.iter();
    let found = warnings.find(|w| w.starts_with("for the same acceleration"));
    found.map(String::as_str)
}

/// Load cells that drift by 3 % and by 0.3 % over each run: it is said, and the combined interval holds the truth,
/// which is that of the first moment.
#[test]
fn a_drift_of_all_forces_is_told_and_held() {
    for drive in [true, false] {
        for (drift, words) in [
            (0.03, "run \"X\": all +1."),
            (0.003, "all runs together: all +0."),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let mut steady = |_: &str, channel: &str, moment: f64, x: f64| match channel {
                _ if channel.starts_with("cell") => x * (1.0 + drift * moment),
                _ => x,
            };
            let setup = satellite(&folder, (20.0, 1, drive), &mut steady);
            let answer = identify(&setup, None);
            let said = told(&answer).expect("a drift");
            assert!(said.contains(words), "{drift}: {said}");
            let truth = std::fs::read_to_string(folder.path().join("truth.json")).unwrap();
            let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
            let found = estimates(&answer.identification);
            let mass = found[number::MASS].unwrap();
            let b = type_b(&answer).std(number::MASS).unwrap();
            // The mean of a steady drift is half of it off, and its halves as much apart: √3 standard uncertainties.
            // The change itself is known to a twentieth of 1.5 %, and to a sixth of 0.15 %.
            let known = if drift > 0.01 { 0.05 } else { 0.17 };
            let expected = 0.5 * drift * mass.value / 3.0_f64.sqrt();
            assert!((b / expected - 1.0).abs() < 4.0 * known, "{b} {expected}");
            for (k, key) in ["xx", "yy", "zz", "xy", "xz", "yz"].iter().enumerate() {
                let truth = truth["inertia_cg"][key].as_f64().unwrap();
                let estimate = found[number::INERTIA_CG + k].unwrap();
                let off = (estimate.value - truth).abs();
                let b = type_b(&answer).std(number::INERTIA_CG + k).unwrap();
                let limit = 3.0_f64.sqrt() * b * (1.0 + 4.0 * known) + 4.0 * estimate.std;
                assert!(off < limit, "{drift} {key}: {estimate:?} ± {b}, {truth}");
            }
        }
    }
}

/// A drift of one channel in one run is that run's alone.
#[test]
fn a_drift_in_one_run_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut steady = |run: &str, channel: &str, moment: f64, x: f64| match (run, channel) {
        ("Z", "cell1.z") => x * (1.0 + 0.04 * moment),
        _ => x,
    };
    let setup = satellite(&folder, (20.0, 1, true), &mut steady);
    let answer = identify(&setup, None);
    let said = told(&answer).expect("a drift");
    assert!(
        said.contains("not those in the first: run \"Z\": "),
        "{said}"
    );
    assert!(!said.contains("run \"X\""), "{said}");
}

/// Sound tests say nothing of a drift, a distortion or a coupling.
#[test]
fn what_is_steady_does_not_drift() {
    for seed in 1..=3 {
        for drive in [true, false] {
            let folder = tempfile::tempdir().unwrap();
            let setup = satellite(&folder, (12.0, seed, drive), &mut |_, _, _, x| x);
            let answer = identify(&setup, None);
            assert_eq!(told(&answer), None);
            assert_eq!(distortion::told(&answer), None);
            assert!(answer.type_b.is_none());
            let coupled = |w: &String| w.contains("alternating current");
            assert!(!answer.warnings.iter().any(coupled));
            assert!(answer.refused.is_none());
        }
    }
}

/// Load cells, or accelerometers, behind a coupling to alternating current with a corner of 0.1 or of 1 Hz, where the
/// lowest line is at 2 Hz: it is said, and refused. Where both are coupled, nothing is wrong.
#[test]
fn a_coupling_to_alternating_current_is_told() {
    for (corner, sensors, words) in [
        (0.1, "cell", "the forces lead the accelerations by 2."),
        (0.1, "", "the accelerations lead the forces by 2."),
        (1.0, "cell", "the forces lead the accelerations by 2"),
        (1.0, "", "the accelerations lead the forces by 2"),
        (1.0, "both", ""),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut last: HashMap<String, [f64; 2]> = HashMap::new();
        let mut coupled = |run: &str, channel: &str, moment: f64, x: f64| {
            let of = if channel.starts_with("cell") {
                "cell"
            } else {
                ""
            };
            if channel == "drive" || (sensors != "both" && of != sensors) {
                return x;
            }
            // Backward differences of y' + 2 π c y = x'.
            let state = last.entry(format!("{run} {channel}")).or_default();
            if moment == 0.0 {
                *state = [x, 0.0];
            }
            let y = (state[1] + x - state[0]) / (1.0 + std::f64::consts::TAU * corner / 512.0);
            *state = [x, y];
            y
        };
        let setup = satellite(&folder, (20.0, 1, true), &mut coupled);
        let answer = identify(&setup, None);
        let refused = answer.refused.as_ref().map(ToString::to_string);
        assert_eq!(refused.is_some(), corner > 0.5 && !words.is_empty());
        let said = answer.warnings.iter().cloned().chain(refused);
        let said = said.collect::<Vec<_>>().join("\n");
        assert_eq!(
            said.contains("alternating current"),
            !words.is_empty(),
            "{said}"
        );
        assert!(said.contains(words), "{said}");
        let notes = Session::new(&setup).notes(&mut |_| ()).join("\n");
        assert!(notes.contains(words), "{notes}");
    }
}

/// A second half that is a third as loud beside the same noise: without a drive noise takes 0.1 % from the
/// ratio of forces and accelerations at first and 1.3 % then, which is no drift.
#[test]
fn another_level_is_no_drift() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Draws::new(3);
    let mut quieter = |moment: f64, readings: [f64; 2]| {
        let level = if moment < 0.5 { 1.0 } else { 0.3 };
        let [a, f] = readings.map(|x| x * level);
        [a + 0.05 * noise.normal(), f + 0.6 * noise.normal()]
    };
    let mut setup = uniaxial_of(&folder, 32768, &mut quieter);
    setup.runs[0].references.clear();
    let answer = identify(&setup, None);
    assert_eq!(told(&answer), None);
    assert!(answer.type_b.is_none());
}

/// One channel of each kind, whose force drifts by 3 %: the uncertainty is the share of the mass that halves
/// differ by, over √3, with a drive and without.
#[test]
fn a_drift_is_a_share_of_the_mass() {
    for drive in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let mut drifting = |moment: f64, [a, f]: [f64; 2]| [a, f * (1.0 + 0.03 * moment)];
        let mut setup = uniaxial_of(&folder, 32768, &mut drifting);
        if !drive {
            setup.runs[0].references.clear();
        }
        let answer = identify(&setup, None);
        let mass = answer.identification.mass.unwrap().value;
        assert!((mass / (12.5 * 1.015) - 1.0).abs() < 0.002, "{mass}");
        let b = type_b(&answer).std(number::MASS).unwrap();
        // Halves are a part of 32 from the middle at most; a gain of each line is a mean over blocks that are
        // unlike loud, by a seventh of 3 % in 32 lines and 63 blocks.
        let expected = mass * 0.015 / 1.015 / 3.0_f64.sqrt();
        assert!((b / expected - 1.0).abs() < 0.1, "{drive}: {b} {expected}");
    }
}

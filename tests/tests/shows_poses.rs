//! Real static poses of a tool on a force/torque sensor: mass and CG only.

mod bench;

use bench::{document, identify, value};
use massline::setup::Setup;
use massline_tests::fixture;

fn setup() -> Setup {
    Setup::read(&fixture("static-poses/setup.toml")).unwrap_or_else(|error| panic!("{error}"))
}

/// An independent least squares over the same file, each row weighted with its component's
/// scatter (numpy, ten unknowns: m, three first moments, six offsets): kg and m.
const MASS: f64 = 0.9328;
const CENTRE_OF_GRAVITY: [f64; 3] = [0.21e-3, 0.04e-3, 43.85e-3];

/// Offsets of the sensor by that least squares, N and N m, in the sensor's axes.
const OFFSETS: [f64; 6] = [
    9.076_516, -1.018_148, 9.984_755, 0.432_505, -0.691_553, -0.157_035,
];

/// Largest mean of gravity over the poses in any axis, m/s²: the change of an offset by 1 kg of
/// mass, N.
const MEAN_GRAVITY: f64 = 1e-2;

#[test]
fn mass_and_cg_agree_with_an_independent_least_squares() {
    let answer = identify(&setup());
    let i = &answer.identification;
    println!("mass {:.5} kg", value(i.mass));
    // ± 0.003 kg and 0.1 mm: the project's goal for this file.
    assert!((value(i.mass) - MASS).abs() < 3e-3);
    for (axis, truth) in CENTRE_OF_GRAVITY.into_iter().enumerate() {
        let found = value(i.centre_of_gravity[axis]);
        println!("CG {axis}: {:.4} mm", found * 1e3);
        assert!((found - truth).abs() < 1e-4, "{found} instead of {truth}");
    }
}

#[test]
fn static_poses_give_no_inertia() {
    let setup = setup();
    let document = document(&setup, &identify(&setup));
    for about in ["inertia_reference", "inertia_cg"] {
        for term in ["xx", "yy", "zz", "xy", "xz", "yz"] {
            let number = &document[about][term];
            assert!(number["value"].is_null() && number["std"].is_null());
            assert_eq!(number["observable"], false);
        }
    }
    assert_eq!(document["mass"]["observable"], true);
    assert!(document["principal_moments"].is_null());
    // Mass and CG do not determine the plausibility of a body.
    assert!(document["plausible"]["ok"].is_null());
}

#[test]
fn the_offsets_are_those_of_the_sensor() {
    let setup = setup();
    let answer = identify(&setup);
    let (run, offsets) = &answer.offsets[0];
    assert_eq!((run.as_str(), answer.offsets.len()), ("poses", 1));
    for (found, expected) in offsets.iter().zip(OFFSETS) {
        // Two fits whose masses differ by δm have offsets that differ by δm times the mean of
        // gravity, and by the last digit given above. `scale = -1` turns the sign.
        let bound = 3e-3 * MEAN_GRAVITY + 1e-6;
        assert!(
            (found + expected).abs() < bound,
            "{found} instead of {}",
            -expected
        );
    }
}

// An offset is estimated with the parameters: an added offset must change that estimate alone.
#[test]
fn an_added_offset_changes_its_estimate_alone() {
    const ADDED: f64 = 2.5;
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(fixture("static-poses/poses.csv")).unwrap();
    let mut lines = text.lines();
    let mut shifted = lines.next().unwrap().to_owned();
    for line in lines {
        let (fx, rest) = line.split_once(',').unwrap();
        let fx: f64 = fx.trim().parse().unwrap();
        shifted += &format!("\n{},{rest}", fx + ADDED);
    }
    std::fs::write(folder.path().join("poses.csv"), shifted).unwrap();
    let before = identify(&setup());
    let after = identify(&Setup {
        folder: folder.path().to_owned(),
        ..setup()
    });
    // Readings are f32: 2^-24 of about 12 N, of which 0.93 kg are 9.8 m/s².
    let rounding = 12.0 / f64::from(1 << 24);
    let moved = after.offsets[0].1[0] - before.offsets[0].1[0];
    assert!((moved + ADDED).abs() < rounding, "{moved}");
    let masses = [&after, &before].map(|a| value(a.identification.mass));
    assert!((masses[0] - masses[1]).abs() < rounding / 9.8, "{masses:?}");
}

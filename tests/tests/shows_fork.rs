//! The fork's three shared recordings: results of a plane test with three load channels.
//!
//! All bounds are those of the project's goal for these files: 0.3 % for x, z and Θyy about A, 0.9
//! % for Θyy about S, 0.2 % for the mass. The recordings have noise of 1 % of each channel's RMS.

mod bench;

use bench::{document, identify, value};
use massline::setup::Setup;
use massline_core::masslines::Method;
use massline_tests::fixture;

/// The paper's published numbers, which the twin reproduces to 1e-12: kg, m, kg m².
const MASS: f64 = 0.630_76;
const X: f64 = 0.101_13;
const Z: f64 = 0.107_33;
const ABOUT_A: f64 = 20.78e-3;
const ABOUT_S: f64 = ABOUT_A - MASS * (X * X + Z * Z);

fn setup() -> Setup {
    Setup::read(&fixture("fork/setup.toml")).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn within(what: &str, found: f64, truth: f64, bound: f64) {
    let error = found / truth - 1.0;
    println!("{what}: {:+.4} %", 100.0 * error);
    assert!(
        error.abs() < bound,
        "{what}: {found} instead of {truth}, {:+.3} %",
        100.0 * error
    );
}

#[test]
fn mass_known_gives_cg_and_inertia_in_the_plane() {
    let answer = identify(&setup());
    assert_eq!(answer.method, Method::ApparentMass);
    let i = &answer.identification;
    within("x", value(i.centre_of_gravity[0]), X, 3e-3);
    within("z", value(i.centre_of_gravity[2]), Z, 3e-3);
    within("Θyy about A", value(i.inertia_reference[1]), ABOUT_A, 3e-3);
    within("Θyy about S", value(i.inertia_cg[1]), ABOUT_S, 9e-3);
    assert_eq!(value(i.mass), MASS, "the weighed mass is taken as it is");
}

#[test]
fn mass_unknown_is_found() {
    let setup = Setup {
        known_mass: None,
        ..setup()
    };
    let answer = identify(&setup);
    let i = &answer.identification;
    within("mass", value(i.mass), MASS, 2e-3);
    assert!(i.indicator.is_none());
}

#[test]
fn the_six_out_of_the_plane_are_null_and_named() {
    let setup = setup();
    let answer = identify(&setup);
    let document = document(&setup, &answer);
    let unknown = |number: &serde_json::Value| {
        assert!(number["value"].is_null(), "{number}");
        assert!(number["std"].is_null(), "{number}");
        assert_eq!(number["observable"], false);
    };
    unknown(&document["centre_of_gravity"][1]);
    for about in ["inertia_reference", "inertia_cg"] {
        for term in ["xx", "zz", "xy", "xz", "yz"] {
            unknown(&document[about][term]);
        }
        assert_eq!(document[about]["yy"]["observable"], true);
    }
    assert!(document["principal_moments"].is_null());
    assert!(document["principal_axes"].is_null());

    let warnings = answer.warnings.join("\n");
    let line = |words: &str| {
        warnings
            .lines()
            .find(|line| line.contains(words))
            .unwrap_or_else(|| panic!("no warning says «{words}»:\n{warnings}"))
    };
    let missing = line("not observable");
    for name in ["y of the CG", "Θxx", "Θzz", "Θxy", "Θxz", "Θyz"] {
        assert!(missing.contains(name), "{name} is not in: {missing}");
    }
    assert!(!missing.contains("Θyy"), "{missing}");
    let zero = line("taken as zero");
    for name in ["ay", "α", "γ"] {
        assert!(zero.contains(name), "{name} is not in: {zero}");
    }
    let left_out = line("left out");
    for name in ["fy", "tx", "tz"] {
        assert!(left_out.contains(name), "{name} is not in: {left_out}");
    }
}

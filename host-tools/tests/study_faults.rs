//! The study of faults from the command line, on a few seeds.

use serde_json::Value;
use std::process::Command;

fn study(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_massline"))
        .args(["study", "faults", "--json", "--quiet"])
        .args(arguments)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Draws with this outcome, of faults that exact data contradict.
fn count(found: &Value, outcomes: &[&str]) -> usize {
    let draws = found["draws"].as_array().unwrap().iter();
    let spoilt = |d: &&Value| !d["faults"].as_array().unwrap().is_empty();
    draws
        .filter(spoilt)
        .filter(|d| d["invisible"] == false)
        .filter(|d| outcomes.contains(&d["outcome"].as_str().unwrap()))
        .count()
}

/// The table of the manual has the shares over many seeds: nine of ten and more are told, at most one of
/// a hundred wrongly. Four of five in a dozen draws leave room for the seeds.
#[test]
fn faults_are_told_and_nobody_is_accused_wrongly() {
    let found = study(&["--setups", "12", "--clean", "6", "--seed", "5001"]);
    let told = count(&found, &["named", "equal", "tied", "by-size"]);
    let all = count(
        &found,
        &[
            "named", "equal", "tied", "by-size", "asked", "half", "sensor", "unnamed", "silent",
            "wrong",
        ],
    );
    let text = serde_json::to_string_pretty(&found["draws"]).unwrap();
    assert!(all >= 7, "{all}: {text}");
    assert!(5 * told >= 4 * all, "{told} of {all}: {text}");
    let wrong = count(&found, &["wrong"]);
    assert_eq!(wrong, 0, "{text}");
    let accused = found["rows"].as_array().unwrap().last().unwrap()["accused"].clone();
    assert_eq!(accused, 0, "{text}");
    // The first seeds on one thread.
    let again = study(&[
        "--setups",
        "4",
        "--clean",
        "0",
        "--seed",
        "5001",
        "--threads",
        "1",
    ]);
    let first = &found["draws"].as_array().unwrap()[..4];
    assert_eq!(first, again["draws"].as_array().unwrap().as_slice());
}

/// Draws that were once told wrongly: a dead load cell that is the only one of its direction was taken for
/// load cells that are all reversed, and a factor by which the mass happened to be off for a unit.
#[test]
fn a_body_without_mass_is_nobodys_sign() {
    let fork = ["--case", "fork", "--threads", "1"];
    let study = |arguments: &[&str]| study(&[&fork[..], arguments].concat());
    let found = study(&["--setups", "0", "--clean", "1", "--seed", "317"]);
    assert_eq!(found["draws"][0]["outcome"], "silent", "{found}");
    let found = study(&[
        "--faults", "2", "--setups", "1", "--clean", "0", "--seed", "32",
    ]);
    let faults = found["draws"][0]["faults"].as_array().unwrap();
    assert!(faults.iter().any(|f| f == "fx dead"), "{found}");
    assert_eq!(found["draws"][0]["outcome"], "named", "{found}");
}

#[test]
fn options_that_mean_nothing_are_refused() {
    for (options, words) in [
        (&["--faults", "3"][..], "expected 1 or 2"),
        (&["--case", "bridge"], "expected one of satellite, fork"),
        (
            &["--setups", "0", "--clean", "0"],
            "--setups 0: expected at least one",
        ),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_massline"))
            .args(["study", "faults"])
            .args(options)
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains(words), "{errors}");
    }
}

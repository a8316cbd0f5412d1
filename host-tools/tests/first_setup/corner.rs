//! Sensors that are coupled to alternating current: told, corrected by the key that is printed, and right.

use crate::bench::{BAND, massline};
use crate::test::{Recorded, assert_replayed, recorded, rewrite};
use std::f64::consts::TAU;

const CORNER: f64 = 0.3;
const RATE: f64 = 512.0;

/// Puts the load cells or all accelerometers behind a coupling, by the trapezoid rule.
fn couple(test: &Recorded, list: &str) {
    let is_one = |name: &str| match list {
        "load_cell" => name.starts_with("cell"),
        _ => !name.starts_with("cell") && name != "drive",
    };
    rewrite(test, |header, rows| {
        let channels = header.iter().enumerate();
        for (column, _) in channels.filter(|(_, name)| is_one(name)) {
            let w = TAU * CORNER / (2.0 * RATE);
            let (mut before, mut passed) = (0.0, 0.0);
            for row in &mut *rows {
                let reading: f64 = row[column].parse().unwrap();
                passed = ((1.0 - w) * passed + reading - before) / (1.0 + w);
                before = reading;
                row[column] = passed.to_string();
            }
        }
    });
}

/// Mass, and half of its interval.
fn mass(test: &Recorded, setup: &str, more: &[&str]) -> [f64; 2] {
    std::fs::write(test.path().join("setup.toml"), setup).unwrap();
    let identify = ["identify", "setup.toml", "--json", "--anyway"];
    let out = massline(test.path(), identify.iter().chain(&BAND).chain(more));
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    ["value", "interval"].map(|key| document["mass"][key].as_f64().unwrap())
}

#[test]
fn the_key_that_is_printed_mends_it() {
    let test = recorded();
    let setup = test.setup();
    let [clean, half] = mass(&test, &setup.to_toml(), &[]);
    for list in ["accelerometer", "load_cell"] {
        let test = recorded();
        couple(&test, list);
        let [_, wide] = mass(&test, &setup.to_toml(), &[]);
        // The imaginary part of the forces is in the scatter now.
        assert!(wide > 10.0 * half, "{wide} {half}");
        let out = massline(test.path(), ["check", "setup.toml"]);
        out.shows(&format!(
            "corner of 0.30 … write `ac_corner = 0.30 … into every [[{list}]] if its data sheet agrees"
        ));
        let entry = format!("[[{list}]]\n");
        let mended = setup
            .to_toml()
            .replace(&entry, &format!("{entry}ac_corner = {CORNER}\n"));
        let [right, narrow] = mass(&test, &mended, &[]);
        // The first two seconds of 15 are left out, and the noise of 1 % in what is left is another draw.
        assert!((right - clean).abs() < half, "{clean} {right}");
        assert!(narrow < 1.5 * half, "{narrow} {half}");
        let again = massline(test.path(), ["check", "setup.toml"]);
        assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
        assert!(!again.stdout.contains("ac_corner"), "{}", again.stdout);
        let said = massline(test.path(), ["identify", "setup.toml", BAND[0], BAND[1]]);
        said.says("the first 1088 and the last 24 samples of each recording are not used");
        assert_eq!(
            said.stderr.matches("ac_corner").count(),
            1,
            "{}",
            said.stderr
        );
    }
}

/// The box gets the samples that this machine averages.
#[test]
fn replay_sends_corrected_samples() {
    let test = recorded();
    let setup = test.setup().to_toml();
    let entry = "[[load_cell]]\n";
    let coupled = setup.replace(entry, &format!("{entry}ac_corner = {CORNER}\n"));
    assert_replayed(&test, &coupled, "8");
}

#[test]
fn what_cannot_be_corrected_is_refused() {
    let test = recorded();
    let setup = test.setup().to_toml();
    let refused = |name: &str, text: String, expected: &str| {
        std::fs::write(test.path().join(name), text).unwrap();
        let out = massline(test.path(), ["identify", name]);
        assert_eq!(out.code, Some(2), "{}{}", out.stdout, out.stderr);
        out.says(expected);
    };
    let with = |key: &str| setup.replacen("[[load_cell]]\n", &format!("[[load_cell]]\n{key}\n"), 1);
    refused(
        "negative.toml",
        with("ac_corner = -0.1"),
        "`ac_corner` is -0.1; expected Hz from 0 to 100",
    );
    refused(
        "list.toml",
        with("ac_corner = [0.1, 0.2]"),
        "`ac_corner` is a list of 2 values; expected",
    );
    refused(
        "long.toml",
        with("ac_corner = 0.001"),
        "samples, and sensors whose `ac_corner` differ are brought behind the same coupling by the first … record longer",
    );
    let poses = with("ac_corner = 0.1")
        + "\n[[run]]\nname = \"poses\"\nrecording = \"p.csv\"\nexcitation = \"static\"\n";
    refused(
        "poses.toml",
        poses,
        "`ac_corner` is 0.1; expected none in a setup with a run of `excitation = \"static\"`",
    );
}

/// A point mass of 3 kg, whose force is measured behind a coupling, by stepped sines along z.
#[test]
fn amplitudes_of_a_stepped_sine_are_divided_by_the_coupling() {
    const MASS: f64 = 3.0;
    let folder = tempfile::tempdir().unwrap();
    let mut rows = "frequency,a.re,a.im,f.re,f.im\n".to_owned();
    for line in 0..8 {
        let f = 2.0 + f64::from(line);
        // MASS / (1 - i c/f).
        let ratio = CORNER / f;
        let passed = MASS / (1.0 + ratio * ratio);
        rows += &format!("{f},1,0,{passed:?},{:?}\n", passed * ratio);
    }
    std::fs::write(folder.path().join("z.csv"), rows).unwrap();
    let setup = |key: &str| {
        format!(
            "[processing]\naveraging_band = [2, 9]\n\
             [[accelerometer]]\nchannel = \"a\"\nposition = [0, 0, 0]\ndirection = \"+z\"\nmount = \"interface\"\nnoise = 1e-3\n\
             [[load_cell]]\nchannel = \"f\"\nposition = [0, 0, 0]\ndirection = \"+z\"\nnoise = 1e-3\n{key}\n\
             [[run]]\nname = \"z\"\nrecording = \"z.csv\"\nexcitation = \"sine\"\n"
        )
    };
    let mass = |name: &str, key: &str| {
        std::fs::write(folder.path().join(name), setup(key)).unwrap();
        let out = massline(folder.path(), ["identify", name, "--json", "--anyway"]);
        let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
        document["mass"]["value"].as_f64().unwrap()
    };
    // Rounding alone; without the key c²/f² is missing, 2 % at 2 Hz and 0.1 % at 9 Hz.
    let right = mass("right.toml", &format!("ac_corner = {CORNER}"));
    assert!((right - MASS).abs() < 1e-12 * MASS, "{right}");
    let wrong = mass("wrong.toml", "");
    assert!((wrong - MASS).abs() > 1e-3 * MASS, "{wrong}");
}

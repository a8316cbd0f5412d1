//! Units of channels and lengths: the same numbers whatever they are stated in.

use crate::bench::massline;
use crate::test::{Recorded, recorded, rewrite_headers};
use massline::setup::Setup;
use std::path::Path;

/// The satellite's recordings taken as g and lbf, in a setup of SI units with factors, and the same
/// with units and millimetres.
fn in_si_and_in_units(test: &Recorded) -> (String, String) {
    let setup = test.setup();
    let mut si = setup.clone();
    si.accelerometers
        .iter_mut()
        .for_each(|a| a.scale = -9.80665);
    si.load_cells
        .iter_mut()
        .for_each(|c| c.scale = 4.448_221_615_260_5);
    let mut text = String::new();
    let mut keys = "";
    for line in si.to_toml().lines() {
        match line {
            "[[accelerometer]]" => keys = "unit = \"g\"\nscale = -1",
            "[[load_cell]]" => keys = "unit = \"lbf\"",
            "scale = -9.80665" | "scale = 4.4482216152605" => {
                text += keys;
                text += "\n";
                continue;
            }
            _ => {}
        }
        match line.strip_prefix("position = ") {
            Some(position) => {
                let metres: [f64; 3] = serde_json::from_str(position).unwrap();
                // A whole number of millimetres each.
                let mm = metres.map(|x| (x * 1000.0).round());
                text += &format!("position = {mm:?}\n");
            }
            None => text += &format!("{line}\n"),
        }
    }
    (si.to_toml(), format!("length_unit = \"mm\"\n{text}"))
}

/// The numbers of `identify`, as they are printed with all digits.
fn numbers(test: &Recorded, text: &str) -> serde_json::Value {
    std::fs::write(test.path().join("setup.toml"), text).unwrap();
    let out = massline(
        test.path(),
        ["identify", "setup.toml", "--json", "--anyway"],
    );
    assert!(out.code == Some(0) || out.code == Some(1), "{}", out.stderr);
    serde_json::from_str(&out.stdout).unwrap_or_else(|_| panic!("{}", out.stderr))
}

#[test]
fn a_setup_in_g_lbf_and_mm_gives_the_bits_of_the_one_in_si() {
    let test = recorded();
    let (si, units) = in_si_and_in_units(&test);
    let read = |text: &str| Setup::from_str(text, Path::new("setup.toml")).unwrap();
    let (a, b) = (read(&si), read(&units));
    for (a, b) in a.accelerometers.iter().zip(&b.accelerometers) {
        assert_eq!((a.position, a.scale), (b.position, b.scale));
        assert_eq!(b.key_scale(), -1.0);
    }
    // What is printed reads back, and its lengths are metres.
    assert_eq!(read(&b.to_toml()), b);
    assert!(!b.to_toml().contains("length_unit"));
    let (a, b) = (numbers(&test, &si), numbers(&test, &units));
    assert!(a["mass"]["value"].as_f64().is_some(), "{a}");
    assert_eq!(a, b);
}

#[test]
fn units_of_the_header_are_used_and_held_against_the_setup() {
    let test = recorded();
    let (si, units) = in_si_and_in_units(&test);
    let expected = numbers(&test, &si);
    let plain = si.replace("scale = 4.4482216152605\n", "");
    let plain = plain.replace("scale = -9.80665", "scale = -1.0");
    rewrite_headers(&test, |name| match name {
        "drive" => "drive [V]".to_owned(),
        "time" => "time [s]".to_owned(),
        name if name.starts_with("cell") => format!("{name} [lbf]"),
        name => format!("{name} [g]"),
    });
    // Readings are rounded to single precision once after the factor instead of before it.
    let found = numbers(&test, &plain);
    for key in ["mass", "centre_of_gravity"] {
        let all = |v: &serde_json::Value| match v[key].as_array() {
            Some(list) => list.iter().map(|n| n["value"].as_f64().unwrap()).collect(),
            None => vec![v[key]["value"].as_f64().unwrap()],
        };
        for (a, b) in all(&expected).iter().zip(all(&found)) {
            assert!((a - b).abs() < 1e-5 * a.abs(), "{key}: {a} {b}");
        }
    }
    // Stated on both sides, and alike: it counts once.
    assert_eq!(numbers(&test, &units)["mass"], expected["mass"]);
    let cases = [
        (
            units.replacen("unit = \"g\"", "unit = \"mm/s²\"", 1),
            "line 1 … [g] … `unit` says \"mm/s²\" … [[accelerometer]]",
        ),
        (si.clone(), "line 1 … [g] … scale` = -9.80665 … second time"),
        (
            plain.replacen("[[load_cell]]\n", "[[load_cell]]\nunit = \"N\"\n", 1),
            "[lbf] … `unit` says \"N\" … [[load_cell]]",
        ),
        (
            plain.replace(
                "reference = \"drive\"",
                "reference = \"drive\"\nreference_unit = \"mA\"",
            ),
            "[V] … `reference_unit` of its [[run]] says \"mA\"",
        ),
    ];
    for (text, words) in cases {
        std::fs::write(test.path().join("setup.toml"), text).unwrap();
        massline(test.path(), ["identify", "setup.toml"]).refused_input(words);
    }
    // No unit of an acceleration, and one that does not say how much it is.
    rewrite_headers(&test, |name| name.replace("[g]", "[kg]"));
    std::fs::write(test.path().join("setup.toml"), &plain).unwrap();
    massline(test.path(), ["identify", "setup.toml"])
        .refused_input("says \"kg\"; accepted are \"m/s²\", \"g\"");
    rewrite_headers(&test, |name| name.replace("[kg]", "[mV]"));
    let unscaled = plain.replace("scale = -1.0\n", "");
    std::fs::write(test.path().join("setup.toml"), unscaled).unwrap();
    massline(test.path(), ["identify", "setup.toml"])
        .refused_input("[mV] … no `sensitivity`; give … mV/m/s²");
}

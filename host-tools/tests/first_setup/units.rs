//! Units of channels and lengths: the same numbers whatever they are stated in.

use crate::bench::{BAND, massline};
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
    let identify = ["identify", "setup.toml", "--json", "--anyway"];
    let out = massline(test.path(), identify.iter().chain(&BAND));
    assert!(out.code == Some(0) || out.code == Some(1), "{}", out.stderr);
    let mut document: serde_json::Value =
        serde_json::from_str(&out.stdout).unwrap_or_else(|_| panic!("{}", out.stderr));
    // Lines that mend the setup are in its own units.
    for finding in document["findings"].as_array_mut().into_iter().flatten() {
        assert!(finding["repair"].take().is_array());
    }
    document
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
    // Round brackets say the same.
    let found = numbers(&test, &plain);
    rewrite_headers(&test, |name| {
        name.replace("[g]", "(g)").replace("[lbf]", "(lbf)")
    });
    assert_eq!(numbers(&test, &plain), found);
    rewrite_headers(&test, |name| {
        name.replace("(g)", "[g]").replace("(lbf)", "[lbf]")
    });
    // A factor that the stated unit has already, with a header that says the same, and nothing.
    let twice = units.replacen("scale = -1", "scale = -9.80665", 1);
    let says = "`unit` = \"g\" of the setup … `scale` = -9.80665 … second time";
    std::fs::write(test.path().join("setup.toml"), &twice).unwrap();
    massline(test.path(), ["identify", "setup.toml"]).refused_input("second time");
    let bare = |name: &str| name.split(" [").next().unwrap().to_owned();
    let before: Vec<String> = (test.recordings().iter())
        .map(|file| std::fs::read_to_string(file).unwrap())
        .collect();
    rewrite_headers(&test, bare);
    massline(test.path(), ["identify", "setup.toml"]).refused_input(says);
    for (file, text) in test.recordings().iter().zip(before) {
        std::fs::write(file, text).unwrap();
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

/// Rewrites the header of one recording.
fn rewrite_header(test: &Recorded, run: usize, change: impl Fn(&str) -> String) {
    let file = &test.recordings()[run];
    let text = std::fs::read_to_string(file).unwrap();
    let header = text.lines().find(|line| !line.starts_with('#')).unwrap();
    let names: Vec<String> = header.split(',').map(&change).collect();
    std::fs::write(file, text.replacen(header, &names.join(","), 1)).unwrap();
}

/// The recording of one run in g where that of another says m/s², says nothing, or says the same.
#[test]
fn runs_whose_headers_give_a_channel_other_units_are_refused_with_both_files() {
    let test = recorded();
    let setup = test.setup().to_toml();
    let write = |text: &str| std::fs::write(test.path().join("setup.toml"), text).unwrap();
    write(&setup);
    let files: Vec<String> = test
        .recordings()
        .iter()
        .map(|file| file.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    let say = |run: usize, label: &str| {
        rewrite_header(&test, run, |name| match name.split(" [").next() {
            Some("base1.x") => label.to_owned(),
            _ => name.to_owned(),
        });
    };
    let identify = ["identify", "setup.toml", BAND[0], BAND[1]];
    let identify = || massline(test.path(), identify);
    say(0, "base1.x [g]");
    let words = format!(
        "{} … `base1.x` … states no unit … {} says [g] … `unit = \"g\"` … [[accelerometer]]",
        files[1], files[0]
    );
    identify().refused_input(&words);
    massline(test.path(), ["check", "setup.toml"]).refused_input(&words);
    // The later run is the one that says it.
    say(0, "base1.x");
    say(3, "base1.x [mm/s²]");
    identify().refused_input(&format!(
        "{} … says [mm/s²] … {} states no unit … count as mm/s² … m/s²",
        files[3], files[0]
    ));
    for run in 0..files.len() {
        say(
            run,
            if run == 2 {
                "base1.x [mm/s²]"
            } else {
                "base1.x [g]"
            },
        );
    }
    identify().refused_input(&format!(
        "{} … says [mm/s²] … {} says [g] … one unit in all runs",
        files[2], files[0]
    ));
    // A unit of the setup holds for recordings without one.
    for run in 0..files.len() {
        say(
            run,
            if run == 2 {
                "base1.x"
            } else {
                "base1.x [m/s^2]"
            },
        );
    }
    let stated = setup.replacen(
        "channel = \"base1.x\"\n",
        "channel = \"base1.x\"\nunit = \"m/s²\"\n",
        1,
    );
    assert_ne!(stated, setup);
    write(&stated);
    let out = identify();
    assert_eq!(out.code, Some(0), "{}", out.stderr);
    assert!(!out.stderr.contains("states no unit"), "{}", out.stderr);
    // SI is what a recording without a unit has: the numbers are the same, and it is said.
    write(&setup);
    let assumed = identify();
    assert_eq!(assumed.stdout, out.stdout);
    let words = format!(
        "{}, channels base1.x: this recording states no unit, and",
        files[2]
    );
    assert!(assumed.stderr.contains(&words), "{}", assumed.stderr);
}

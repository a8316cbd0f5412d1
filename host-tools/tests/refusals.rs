//! Statements about the numbers: data that do not allow an answer are refused, and error bars
//! mean one thing everywhere.

mod bench;

use bench::{BAND, Bench, Finished, massline};
use massline::simulate::{Model, Options, simulate};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tempfile::TempDir;

/// A satellite of 800 kg, shaken in six axes for twelve seconds each, 1 % noise.
static SATELLITE: LazyLock<TempDir> = LazyLock::new(|| shaken("satellite.toml", 12.0));

fn shaken(model: &str, duration: f64) -> TempDir {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let options = Options {
        noise: Some(0.01),
        duration: Some(duration),
        ..Options::default()
    };
    let model = Model::read(&models.join(model)).unwrap();
    let simulation = simulate(&model, &options, &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    simulation.write(folder.path()).unwrap();
    folder
}

/// The setup of a simulated test, changed, beside its recordings.
struct Setup {
    path: PathBuf,
}

impl Setup {
    fn of(folder: &TempDir, name: &str, change: impl Fn(&str) -> String) -> Self {
        let text = std::fs::read_to_string(folder.path().join("setup.toml")).unwrap();
        let changed = change(&text);
        assert!(changed != text, "the change does nothing");
        let path = folder.path().join(format!("{name}.toml"));
        std::fs::write(&path, changed).unwrap();
        Self { path }
    }

    fn satellite(name: &str, change: impl Fn(&str) -> String) -> Self {
        Self::of(&SATELLITE, name, change)
    }

    fn run(&self, arguments: &[&str]) -> Finished {
        let own = ["identify", self.path.to_str().unwrap()];
        let fast: &[&str] = if arguments.contains(&"--method") {
            &[]
        } else {
            &BAND
        };
        massline(Path::new("."), own.iter().chain(arguments).chain(fast))
    }

    fn document(&self, arguments: &[&str], code: i32) -> Value {
        let arguments: Vec<&str> = arguments.iter().copied().chain(["--json"]).collect();
        let finished = self.run(&arguments);
        assert_eq!(finished.code, Some(code), "{}", finished.stderr);
        serde_json::from_str(&finished.stdout).unwrap()
    }
}

/// The setup with the directions of all sensors reversed of which this is true.
fn reversed(text: &str, which: impl Fn(&str) -> bool) -> String {
    each_sensor(text, |section| {
        if !which(section) {
            return section.to_owned();
        }
        let (before, rest) = section.split_once("direction = [").unwrap();
        let (direction, after) = rest.split_once(']').unwrap();
        let components = direction.split(',').map(|x| x.trim().parse::<f64>());
        let opposite: Vec<String> = components.map(|x| (-x.unwrap()).to_string()).collect();
        format!("{before}direction = [{}]{after}", opposite.join(", "))
    })
}

/// The setup with each sensor's section changed.
fn each_sensor(text: &str, change: impl Fn(&str) -> String) -> String {
    let sections: Vec<String> = text
        .split("\n[[")
        .map(|section| {
            if section.contains("direction = [") {
                change(section)
            } else {
                section.to_owned()
            }
        })
        .collect();
    sections.join("\n[[")
}

fn is(channel: &'static str) -> impl Fn(&str) -> bool {
    move |section| section.contains(&format!("channel = \"{channel}\""))
}

/// Holds that an answer is refused everywhere, for a reason that has these words.
fn is_refused(setup: &Setup, words: &[&str]) {
    let report = setup.path.with_extension("html");
    let finished = setup.run(&["--report", report.to_str().unwrap()]);
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    assert_eq!(finished.stdout, "", "no numbers on the terminal");
    for word in words.iter().chain(&["--anyway"]) {
        finished.says(word);
    }
    // What has another cause leads away from this one.
    for word in ["mode_band", "no real body"] {
        assert!(!finished.stderr.contains(word), "{}", finished.stderr);
    }
    let html = std::fs::read_to_string(report).unwrap();
    assert!(html.contains("Refused"), "the report says so");
    let document = setup.document(&[], 1);
    let reason = document["refused"].as_str().unwrap();
    for word in words {
        assert!(reason.contains(word), "{reason}");
    }
    assert!(document["mass"]["value"].is_f64(), "{document}");
    let anyway = setup.run(&["--anyway"]);
    assert_eq!(anyway.code, Some(1));
    anyway.shows("CG x");
}

#[test]
fn one_load_cell_reversed_is_refused() {
    let setup = Setup::satellite("cell", |t| reversed(t, is("cell1.z")));
    is_refused(
        &setup,
        &["a rigid body leaves", "`cell1.z` has the other sign"],
    );
    assert_ne!(setup.document(&[], 1)["plausible"]["ok"], true);
}

/// The setup without the sections of some sensors.
fn without(text: &str, which: impl Fn(&str) -> bool) -> String {
    let sections: Vec<&str> = text
        .split("\n[[")
        .filter(|section| !section.contains("direction = [") || !which(section))
        .collect();
    sections.join("\n[[")
}

/// What nothing measures is looked for in the others, so that it is said first.
#[test]
fn a_load_cell_without_an_entry_is_said_first() {
    let fact = "`cell1.z` is called like the load cells and has no [[load_cell]]";
    let setup = Setup::satellite("unlisted", |t| without(t, is("cell1.z")));
    is_refused(&setup, &[fact, "or else: "]);
    // Along one axis the other three balance like a lighter body.
    let along_z = Setup::satellite("unlisted-z", |t| {
        let listed = without(t, is("cell1.z"));
        let (sensors, _) = listed.split_once("\n[[run]]").unwrap();
        let z = listed.split("\n[[run]]").nth(3).unwrap();
        format!("{sensors}\n[[run]]{z}")
    });
    along_z.run(&["--anyway"]).says(fact);
    let all = Setup::satellite("listed", |t| t.to_owned() + "\n");
    let finished = all.run(&[]);
    assert!(
        !finished.stderr.contains("called like"),
        "{}",
        finished.stderr
    );
}

#[test]
fn one_interface_accelerometer_inverted_is_refused() {
    let setup = Setup::satellite("accelerometer", |t| reversed(t, is("base1.x")));
    is_refused(
        &setup,
        &["a rigid body leaves", "`base1.x` has the other sign"],
    );
}

#[test]
fn all_forces_reversed_is_refused_for_the_negative_mass() {
    let setup = Setup::satellite("forces", |t| reversed(t, is_load_cell));
    is_refused(
        &setup,
        &["negative, -", "have the other sign", "Turn the load cells"],
    );
    let weighed = Setup::satellite("forces-weighed", |t| {
        known_mass(&reversed(t, is_load_cell), 800.0)
    });
    is_refused(
        &weighed,
        &["negative, -", "have the other sign", "Turn the load cells"],
    );
}

fn is_load_cell(section: &str) -> bool {
    section.starts_with("load_cell")
}

fn known_mass(text: &str, mass: f64) -> String {
    let at = text.find("\n[").unwrap();
    format!("{}\nknown_mass = {mass}\n{}", &text[..at], &text[at..])
}

/// 10 % more than it is, as 140 kg are where the data say 127.
#[test]
fn a_weighed_mass_that_contradicts_the_data_is_refused_with_both_numbers() {
    let setup = Setup::satellite("weighed", |t| known_mass(t, 882.0));
    is_refused(
        &setup,
        &["882 kg", "the data say", "Δ = 0.90", "correct `known_mass`"],
    );
}

#[test]
fn a_weighed_mass_that_is_off_by_a_scale_is_noted_with_both_numbers() {
    let setup = Setup::satellite("scale", |t| known_mass(t, 808.0));
    let finished = setup.run(&[]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let note = finished.stderr.lines().find(|l| l.contains("808 kg"));
    assert!(note.unwrap().contains("the data say"), "{note:?}");
    let right = Setup::satellite("right", |t| known_mass(t, 800.0));
    assert!(!right.run(&[]).stderr.contains("the data say"));
}

/// Of a mass that is 3 % too large the centre of gravity is as wrong as it is far from A, or the gains of all sensors are:
/// its interval holds either.
#[test]
fn a_weighed_mass_that_is_noted_widens_what_rests_on_it() {
    let setup = Setup::satellite("wider", |t| known_mass(t, 824.0));
    let result = setup.document(&[], 0);
    let z = &result["centre_of_gravity"][2];
    let off = number(&z["value"]) - 0.940_25;
    assert!(off.abs() > 10.0 * number(&z["interval"]), "{z}");
    assert!(off.abs() < number(&z["combined"]["interval"]), "{z}");
    assert!(number(&z["combined"]["interval"]) < 2.0 * off.abs(), "{z}");
    let delta = &result["indicator"];
    assert!(
        number(&delta["combined"]["interval"]) < 1.1 * number(&delta["interval"]),
        "{delta}"
    );
}

#[test]
fn all_methods_side_by_side_refuse_each_for_itself() {
    let setup = Setup::satellite("all", |t| reversed(t, is("cell1.z")));
    let finished = setup.run(&["--method", "all"]);
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    let document = setup.document(&["--method", "all"], 1);
    let results = document["results"].as_array().unwrap();
    assert!(results.len() > 5, "{document}");
    for result in results {
        let method = result["method"].as_str().unwrap();
        assert!(result["refused"].is_string(), "{method}");
        let line = format!("{method}: refused: ");
        finished.shows(&line);
    }
    assert!(!finished.stdout.contains('±'), "{}", finished.stdout);
    let anyway = setup.run(&["--method", "all", "--anyway"]);
    assert_eq!(anyway.code, Some(1));
    anyway.shows("±");
}

/// A reversed accelerometer leaves less than a tenth of the forces to some methods, by another body.
#[test]
fn a_method_that_hides_a_contradiction_is_refused_by_the_recommended_one() {
    for (channel, method) in [("base1.y", "b"), ("base1.x", "b"), ("base1.x", "d")] {
        let setup = Setup::satellite("hidden", |t| reversed(t, is(channel)));
        let document = setup.document(&["--method", method], 1);
        assert!(document["misfit"].as_f64().unwrap() < 0.1, "{document}");
        let refused = document["refused"].as_str().unwrap();
        let by = "by the recommended method apparent-mass a rigid body leaves ";
        assert!(refused.starts_with(by), "{refused}");
        assert!(
            refused.contains(&format!("`{channel}` has the other sign")),
            "{refused}"
        );
    }
}

/// Scales that alternate between 3 % too much and too little are a poor calibration, not
/// another body: error bars are widened, and all numbers are within 5 %.
#[test]
fn the_limit_of_the_misfit_lies_between_calibration_and_sign() {
    let number = std::cell::Cell::new(0);
    let setup = Setup::satellite("scales", |t| {
        each_sensor(t, |section| {
            number.set(number.get() + 1);
            let scale = if number.get() % 2 == 0 { 1.03 } else { 0.97 };
            format!("{}\nscale = {scale}\n", section.trim_end())
        })
    });
    let document = setup.document(&["--method", "all"], 0);
    for result in document["results"].as_array().unwrap() {
        assert!(result["refused"].is_null(), "{}", result["refused"]);
    }
    let best = &document["results"][0];
    assert!(best["consistency"].as_f64().unwrap() > 100.0, "{best}");
    assert!(best["misfit"].as_f64().unwrap() > 0.01, "{best}");
    let warnings = best["warnings"].to_string();
    assert!(warnings.contains("error bars were widened"), "{warnings}");
}

#[test]
fn good_data_are_refused_by_no_method() {
    let setup = Setup::satellite("good", |t| format!("{t}\n# As it is.\n"));
    let document = setup.document(&["--method", "all"], 0);
    for result in document["results"].as_array().unwrap() {
        assert!(result["refused"].is_null(), "{}", result["refused"]);
        assert_ne!(result["plausible"]["ok"], false);
    }
    assert_eq!(document["results"][0]["plausible"]["ok"], true);
}

#[test]
fn where_only_the_mass_is_known_it_cannot_be_judged_if_a_body_is_possible() {
    let folder = shaken("three-translations.toml", 12.0);
    let setup = Setup::of(&folder, "same", |t| format!("{t}\n# As it is.\n"));
    let report = setup.path.with_extension("html");
    let document = setup.document(&["--report", report.to_str().unwrap()], 0);
    assert!(document["plausible"]["ok"].is_null(), "{document}");
    let reason = document["plausible"]["reason"].as_str().unwrap();
    assert!(reason.contains("no moment of inertia"), "{reason}");
    let html = std::fs::read_to_string(report).unwrap();
    assert!(html.contains("cannot be judged"));
}

/// The box of the model on a tilt table.
const TILTS: &str = r#"
title = "Rigid box on a tilt table"
extends = "rigid-body.toml"

[[run]]
name = "tilts"
poses = [
    [0, 0, 0], [30, 0, 0], [-30, 0, 0], [0, 30, 0], [0, -30, 0], [20, 20, 0], [-20, 20, 0],
    [20, -20, 0], [90, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0], [180, 0, 0], [45, 0, 0],
    [-45, 0, 0], [0, 45, 0], [0, -45, 0], [45, 45, 0], [-45, 45, 0], [10, 0, 0],
]
"#;

/// A table of poses with the readings of each load cell from the row before.
fn with_forces_of_the_pose_before(rows: &str) -> String {
    let rows: Vec<Vec<&str>> = rows.lines().map(|row| row.split(',').collect()).collect();
    let header = &rows[0];
    let shifted = rows.iter().enumerate().map(|(i, row)| {
        let before = if i < 2 { row } else { &rows[i - 1] };
        let mut cells = header.iter().zip(row).zip(before);
        let cells = cells
            .by_ref()
            .map(|((name, own), before)| match name.starts_with("cell") {
                true => *before,
                false => *own,
            });
        cells.collect::<Vec<_>>().join(",")
    });
    shifted.collect::<Vec<_>>().join("\n") + "\n"
}

/// A tilt table whose specimen was turned into twenty poses, noise of a thousandth: the offsets of load cells take most
/// of what poses with a wrong sign leave, and those whose forces belong to the pose before leave no mass.
#[test]
fn poses_that_contradict_a_body_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    std::fs::copy(
        models.join("rigid-body.toml"),
        folder.path().join("rigid-body.toml"),
    )
    .unwrap();
    std::fs::write(folder.path().join("model.toml"), TILTS).unwrap();
    let simulate = [
        "simulate",
        "model.toml",
        "--out",
        "t",
        "--noise",
        "0.001",
        "--quiet",
    ];
    let finished = massline(folder.path(), simulate);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let test = folder.path().join("t");
    let identified = |name: &str| massline(&test, ["identify", name]);
    assert_eq!(identified("setup.toml").code, Some(0));
    let setup = std::fs::read_to_string(test.join("setup.toml")).unwrap();
    let upright = |section: &str| section.contains("\"cell") && section.contains(".z\"");
    std::fs::write(test.join("signs.toml"), reversed(&setup, upright)).unwrap();
    let finished = identified("signs.toml");
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    finished.says("contradict each other by");
    let rows = std::fs::read_to_string(test.join("tilts.csv")).unwrap();
    std::fs::write(
        test.join("shifted.csv"),
        with_forces_of_the_pose_before(&rows),
    )
    .unwrap();
    let recording = |line: &&str| !line.starts_with("checksum");
    let lines: Vec<&str> = setup.lines().filter(recording).collect();
    let shifted = lines.join("\n").replace("tilts.csv", "shifted.csv");
    std::fs::write(test.join("shifted.toml"), shifted).unwrap();
    let finished = identified("shifted.toml");
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// The moments about A follow from what the covariance is of, so that their error bars follow
/// from the covariance.
#[test]
fn the_covariance_propagates_to_the_error_bars_about_the_reference_point() {
    for mass in [None, Some(800.0)] {
        let name = if mass.is_some() { "known" } else { "unknown" };
        let setup = Setup::satellite(name, |t| {
            let t = format!("{t}\n# As it is.\n");
            mass.map_or(t.clone(), |mass| known_mass(&t, mass))
        });
        let d = setup.document(&[], 0);
        let covariance = &d["covariance"];
        let rows: Vec<&str> = covariance["rows"]
            .as_array()
            .unwrap()
            .iter()
            .map(|r| r.as_str().unwrap())
            .collect();
        let first = if mass.is_some() { "indicator" } else { "mass" };
        assert_eq!(
            rows,
            [first, "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"]
        );
        let c = |i: usize, j: usize| number(&covariance["matrix"][i][j]);
        let near = |variance: f64, std: &Value| {
            let std = number(std);
            // Sums of ten squared products, each rounded to 1e-16.
            assert!(
                (variance.sqrt() / std - 1.0).abs() < 1e-9,
                "{variance} {std}"
            );
        };
        near(c(0, 0), &d[first]["std"]);
        for axis in 0..3 {
            near(c(1 + axis, 1 + axis), &d["centre_of_gravity"][axis]["std"]);
        }
        let m = number(&d["mass"]["value"]);
        for (k, term) in rows[4..].iter().enumerate() {
            // The second order is in the error bars alone: m² times the second moments of y² + z² and the like, and of xy
            // and the like, for errors of the centre of gravity.
            let pairs = [(2, 3), (1, 3), (1, 2), (1, 2), (1, 3), (2, 3)];
            let (p, q) = pairs[k];
            let (pp, qq, pq) = (c(p, p), c(q, q), c(p, q));
            let second = if k < 3 {
                2.0 * (pp * pp + qq * qq + 2.0 * pq * pq) + (pp + qq).powi(2)
            } else {
                pp * qq + 2.0 * pq * pq
            };
            near(
                c(4 + k, 4 + k) + m * m * second,
                &d["inertia_cg"][term]["std"],
            );
        }
        // Θxx about A is Θxx about S and m (y² + z²), with A at the origin.
        assert_eq!(d["reference_point"], serde_json::json!([0.0, 0.0, 0.0]));
        let [y, z] = [1, 2].map(|k| number(&d["centre_of_gravity"][k]["value"]));
        let mut g = [0.0; 10];
        g[0] = if mass.is_some() { 0.0 } else { y * y + z * z };
        (g[2], g[3], g[4]) = (2.0 * m * y, 2.0 * m * z, 1.0);
        let mut variance = 0.0;
        for i in 0..10 {
            for j in 0..10 {
                variance += g[i] * c(i, j) * g[j];
            }
        }
        near(variance, &d["inertia_reference"]["xx"]["std"]);
    }
}

/// The satellite's first mode is at 37.5 Hz.
#[test]
fn a_band_that_holds_a_mode_is_said_of_methods_that_take_it_for_rigid() {
    for (highest, method, said) in [
        (45.0, "a", true),
        (45.0, "apparent-mass", false),
        (20.0, "a", false),
    ] {
        let name = format!("up_to_{highest}_by_{method}");
        let setup = Setup::satellite(&name, |t| {
            let t = t.replace(
                "averaging_band = [2.0, 20.0]",
                &format!("averaging_band = [2.0, {highest:.1}]"),
            );
            assert!(t.contains(&format!("{highest:.1}]")), "{t}");
            format!("{t}\n# By {method}.\n")
        });
        let d = setup.document(&["--method", method], 0);
        let warnings = d["warnings"].to_string();
        assert_eq!(
            warnings.contains("holds the mode at 37."),
            said,
            "{warnings}"
        );
    }
}

#[test]
fn beside_every_standard_deviation_stands_the_interval() {
    let bench = Bench::fork();
    let finished = bench.identify(&["--json"]);
    let d: Value = serde_json::from_str(&finished.stdout).unwrap();
    // Null: the noise counts as known, and the normal distribution holds.
    let freedom = d["freedom"].as_f64().unwrap_or(f64::INFINITY);
    let factor = massline_core::identify::half_width_95(freedom);
    let mut seen = 0;
    let mut hold = |n: &Value| match n["std"].as_f64() {
        Some(std) => {
            assert_eq!(number(&n["interval"]), std * factor);
            seen += 1;
        }
        None => assert!(n["interval"].is_null()),
    };
    hold(&d["indicator"]);
    (0..3).for_each(|axis| hold(&d["centre_of_gravity"][axis]));
    for about in ["inertia_reference", "inertia_cg"] {
        for term in ["xx", "yy", "zz", "xy", "xz", "yz"] {
            hold(&d[about][term]);
        }
    }
    assert_eq!(seen, 5);
    assert_eq!(d["mass"]["interval"], 0.0, "weighed");
    // Δ, x, z and Θyy are what this plane test tells.
    for i in 0..10 {
        for j in 0..10 {
            let known = [i, j].iter().all(|k| [0, 1, 3, 5].contains(k));
            assert_eq!(d["covariance"]["matrix"][i][j].is_f64(), known, "{i} {j}");
        }
    }
}

/// The error of a coordinate is a share of the radius of gyration, not of the coordinate.
#[test]
fn errors_in_per_cent_have_the_base_of_the_report() {
    let bench = Bench::fork();
    let shown = bench.identify(&["--truth", "truth.json", "--quiet"]).stdout;
    let found: Value = serde_json::from_str(&bench.identify(&["--json"]).stdout).unwrap();
    let truth = std::fs::read_to_string(bench.file("truth.json")).unwrap();
    let truth: Value = serde_json::from_str(&truth).unwrap();
    let moment = number(&truth["inertia_cg"]["yy"]);
    let gyration = (moment / number(&truth["mass"])).sqrt();
    let error = |f: &Value, t: &Value| number(&f["value"]) - number(t);
    let x = error(
        &found["centre_of_gravity"][0],
        &truth["centre_of_gravity"][0],
    );
    let yy = error(&found["inertia_cg"]["yy"], &truth["inertia_cg"]["yy"]);
    for (row, share) in [("CG x", x / gyration), ("Θyy about S", yy / moment)] {
        let line = shown.lines().find(|l| l.starts_with(row)).unwrap();
        let expected = format!("{:+.3} %", 100.0 * share);
        assert!(line.contains(&expected), "{expected}: {line}");
    }
    assert!(shown.contains("radius of gyration"), "{shown}");
}

#[test]
fn what_the_box_finds_is_refused_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let simulated = ["simulate", "fork", "--out", ".", "--duration", "6", "-q"];
    assert_eq!(massline(folder.path(), simulated).code, Some(0));
    let path = folder.path().join("setup.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, reversed(&text, is_load_cell)).unwrap();
    let measure = |more: &[&str]| {
        let own = [
            "board",
            "measure",
            "setup.toml",
            "--host",
            "--duration",
            "20",
            "-q",
        ];
        massline(folder.path(), own.iter().chain(more))
    };
    let finished = measure(&[]);
    assert_eq!(finished.code, Some(1), "{finished:?}");
    assert_eq!(finished.stdout, "");
    finished.says("opposite signs");
    let finished = measure(&["--json"]);
    assert_eq!(finished.code, Some(1), "{finished:?}");
    let document: Value = serde_json::from_str(&finished.stdout).unwrap();
    assert!(document["refused"].as_str().unwrap().contains("negative"));
    let finished = measure(&["--anyway"]);
    assert_eq!(finished.code, Some(1), "{finished:?}");
    finished.shows("CG x");
}

/// A `mode_band` that ends below the first mode, at 37.5 Hz, has none, though it expects one: the terms in its place are
/// named, and the method that finds many modes. With the satellite's own band nothing is said.
#[test]
fn modes_that_are_expected_and_not_found_are_told() {
    const WORDS: [&str; 3] = [
        "no elastic mode was found up to 25 Hz",
        "a term in ω² and a pseudo-mode above the band take its place",
        "--method ml finds them",
    ];
    let low = Setup::satellite("low", |t| {
        let (head, rest) = t.split_once("mode_band = [").unwrap();
        let (_, rest) = rest.split_once(']').unwrap();
        format!("{head}mode_band = [21.0, 25.0]{rest}")
    });
    let told = low.run(&[]);
    for word in WORDS {
        told.says(word);
    }
    let own = Setup::satellite("own", |t| format!("{t}\n# Unchanged.\n"));
    let silent = own.run(&[]);
    assert!(
        !silent.stderr.contains("no elastic mode"),
        "{}",
        silent.stderr
    );
}

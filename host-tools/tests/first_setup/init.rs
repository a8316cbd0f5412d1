//! From recordings to a setup: with a table of sensors, and without.

use crate::bench::{Finished, massline};
use crate::test::{Recorded, recorded, rewrite};
use std::path::Path;

/// Positions as `massline init` wants them, for the satellite's sensors under names of a laboratory.
const SENSORS: &str = "\
name,x [mm],y [mm],z [mm],directions,mount
T1,600,550,0,,interface
T2,-550,600,50,,interface
T3,-600,-550,0,,interface
T4,550,-600,50,-x -y +z,interface
T5,100,50,1800,,structure
S1:X,500,200,1900,,structure
LC1,500,500,-50,,
LC2,-500,500,-50,,
LC3,-500,-500,-50,,
LC4,500,-500,-50,,
";

/// The satellite's recordings as a laboratory has them: accelerations in g, three axes a sensor, one
/// of which is mounted turned by half a turn.
fn laboratory() -> (Recorded, Vec<String>) {
    let test = recorded();
    rewrite(&test, |header, rows| {
        for (column, name) in header.iter_mut().enumerate() {
            let Some((sensor, axis)) = name.split_once('.') else {
                continue;
            };
            let axis = axis.to_uppercase();
            let renamed = match sensor.split_at(sensor.len() - 1) {
                ("cell", number) => format!("LC{number}:{axis} [N]"),
                ("base", number) => format!("T{number}:{axis} [g]"),
                _ if sensor == "top" => format!("T5:{axis} [g]"),
                _ if sensor == "antenna" => format!("S1:{axis} [g]"),
                _ => format!("{sensor} {axis} [g]"),
            };
            if renamed.ends_with("[g]") {
                let turned = renamed.starts_with("T4") && axis != "Z";
                let g = if turned { -9.80665 } else { 9.80665 };
                for row in rows.iter_mut() {
                    row[column] = format!("{:e}", row[column].parse::<f64>().unwrap() / g);
                }
            }
            *name = renamed;
        }
    });
    let names = test.recordings();
    let names = names.iter().map(|file| file.file_name().unwrap());
    let names = names
        .map(|name| name.to_str().unwrap().to_owned())
        .collect();
    (test, names)
}

fn init(folder: &Path, recordings: &[String], more: &[&str]) -> Finished {
    let all = std::iter::once("init").chain(recordings.iter().map(String::as_str));
    massline(folder, all.chain(more.iter().copied()))
}

fn succeeded(finished: Finished) -> Finished {
    assert_eq!(
        finished.code,
        Some(0),
        "{}{}",
        finished.stdout,
        finished.stderr
    );
    finished
}

/// The README says that it takes four steps, of which one is a table to write.
#[test]
fn six_recordings_become_the_right_numbers_in_four_steps() {
    let (test, recordings) = laboratory();
    assert_eq!(recordings.len(), 6);
    let folder = test.path();
    let mut steps = 0;
    let mut step = |finished: Option<Finished>| {
        steps += 1;
        finished.map(succeeded)
    };
    std::fs::write(folder.join("sensors.csv"), SENSORS).unwrap();
    step(None);
    let more = [
        "--sensors",
        "sensors.csv",
        "--band",
        "2,20",
        "--sample-rate",
        "512",
    ];
    // As the shell writes `*.csv`, with the table among the recordings.
    let all: Vec<String> = (recordings.iter().cloned())
        .chain(["sensors.csv".to_owned()])
        .collect();
    let said = step(Some(init(folder, &all, &more))).unwrap();
    said.says("10 sensors, 28 channels; 3 without an entry … next: massline sketch");
    step(Some(massline(folder, ["check", "setup.toml"])));
    let out = step(Some(massline(folder, ["identify", "setup.toml", "--json"]))).unwrap();
    assert_eq!(steps, 4);
    let found: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let truth = std::fs::read_to_string(folder.join("truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let mut compared = 0;
    let mut near = |number: &serde_json::Value, truth: f64| {
        let (value, half) = (number["value"].as_f64(), number["interval"].as_f64());
        let (value, half) = (value.unwrap(), half.unwrap());
        // Twice the 95 % interval: four standard deviations of fixed draws.
        assert!((value - truth).abs() < 2.0 * half, "{number} {truth}");
        // And it is an answer: a hundredth of the size of the body or better.
        assert!(half < 0.01 * truth.abs().max(100.0), "{number} {truth}");
        compared += 1;
    };
    near(&found["mass"], truth["mass"].as_f64().unwrap());
    for k in 0..3 {
        near(
            &found["centre_of_gravity"][k],
            truth["centre_of_gravity"][k].as_f64().unwrap(),
        );
    }
    for key in ["xx", "yy", "zz", "xy", "xz", "yz"] {
        near(
            &found["inertia_cg"][key],
            truth["inertia_cg"][key].as_f64().unwrap(),
        );
    }
    assert_eq!(compared, 10);
    // The sketch is drawn from the setup alone.
    for recording in &recordings {
        std::fs::remove_file(folder.join(recording)).unwrap();
    }
    succeeded(massline(
        folder,
        ["sketch", "setup.toml", "--out", "sketch.svg"],
    ));
    let svg = std::fs::read_to_string(folder.join("sketch.svg")).unwrap();
    let svg = roxmltree::Document::parse(&svg).unwrap();
    assert!(
        svg.descendants()
            .any(|n| n.text().is_some_and(|t| t.contains("LC1")))
    );
    massline(folder, ["sketch", "setup.toml", "--out", "sketch.svg"]).refused_input("sketch.svg");
}

#[test]
fn what_is_not_known_waits_and_is_named_one_by_one() {
    let (test, recordings) = laboratory();
    let folder = test.path();
    let said = succeeded(init(folder, &recordings, &[]));
    said.shows("setup.toml");
    said.says("13 sensors, 31 channels … fill in");
    let file = folder.join("setup.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    for words in [
        "triaxial = \"T1\"\ntype = \"accelerometer\"\n# position",
        "channel = \"battery Z\"",
        "[[load_cell]]\ntriaxial = \"LC4\"",
        "unit = \"g\"  # as the recordings say",
        "reference = \"drive\"",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // Never over what is there.
    init(folder, &recordings, &[]).refused_input("setup.toml … --force");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
    init(folder, &recordings, &["--out", &recordings[0]]).refused_input(&recordings[0]);
    // The first thing that is missing, then the next.
    let missing = |text: &str, words: &str| {
        std::fs::write(&file, text).unwrap();
        massline(folder, ["identify", "setup.toml"]).refused_input(words);
    };
    missing(&text, "[processing] … `averaging_band` is missing");
    let mut text = text.replacen("# averaging_band", "averaging_band", 1);
    for sensor in ["T1", "T2", "T3", "T4", "antenna"] {
        if sensor != "antenna" {
            missing(&text, &format!("\"{sensor}\" … `position` is missing"));
        }
        text = text.replacen("# position", "position", 1);
    }
}

#[test]
fn channels_of_other_quantities_are_no_sensors() {
    let folder = tempfile::tempdir().unwrap();
    let text = "T1:X [g],Mic:1:+X [Pa],cell z [N],Oven [°C]\n1,2,3,4\n5,6,7,8\n";
    std::fs::write(folder.path().join("a.csv"), text).unwrap();
    let said = succeeded(init(folder.path(), &["a.csv".to_owned()], &[]));
    said.says("2 sensors, 2 channels; 2 without an entry");
    let text = std::fs::read_to_string(folder.path().join("setup.toml")).unwrap();
    assert!(
        text.contains("#   Mic:1:+X [Pa]\n#   Oven [°C]\n"),
        "{text}"
    );
}

/// Without units in the headers a draft is no setup before they are filled in: what is left out would
/// be read as SI.
#[test]
fn units_that_nothing_states_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(
        path.join("a b.csv"),
        "T1:X,T1:Y,T1:Z,F1x,F1y,F1z,Mz,odd\n1,2,3,4,5,6,7,8\n",
    )
    .unwrap();
    std::fs::create_dir(path.join("out")).unwrap();
    let recordings = ["a b.csv".to_owned()];
    succeeded(init(
        path,
        &recordings,
        &["--out", "out/s.toml", "--band", "1,9"],
    ));
    let text = std::fs::read_to_string(path.join("out/s.toml")).unwrap();
    for words in [
        "# sample_rate = 1000.0  # fill in",
        "unit = \"?\"  # fill in, for the recordings do not say it: \"m/s²\"",
        "triaxial = \"F1\"\nchannels = [\"F1x\", \"F1y\", \"F1z\"]\ntype = \"force\"",
        "quantity = \"moment\"",
        "its name does not say that it is an accelerometer",
        "channel = \"odd\"",
        "name = \"a b\"",
        "# reference",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let filled = text
        .replace("# position", "position")
        .replace("# direction", "direction");
    std::fs::write(path.join("s.toml"), filled).unwrap();
    massline(path, ["identify", "s.toml"]).refused_input("`unit` is \"?\" … \"m/s²\", \"g\"");
}

#[test]
fn a_table_that_does_not_fit_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(path.join("x.csv"), "T1:X,T1:Y,T1:Z,F1:Z\n1,2,3,4\n").unwrap();
    let recordings = ["x.csv".to_owned()];
    for (table, words) in [
        ("", "s.csv, line 1: it is empty"),
        ("name,x,y\nT1,1,2\n", "line 1 … column \"z\" is missing"),
        (
            "name,x,y,z,mont\n",
            "line 1 … \"mont\" … did you mean `mount`?",
        ),
        ("name,x [mm],y,z\n", "line 1 … different units"),
        ("name,x [km],y [km],z [km]\n", "line 1 … \"km\""),
        (
            "name,x,y,z\nT1,600,2,3\n",
            "line 2 … \"T1\" is at 600, and the header states no unit; write `x [mm],",
        ),
        (
            "name,x,y,z\nT1,1,2,3\nT2,1,2,3\n",
            "line 3 … no sensor \"T2\"; known are `T1`, `F1:Z`",
        ),
        (
            "name,x,y,z\nT1,1,2,3\nT1:Y,1,2,3\n",
            "line 3 … has a row already",
        ),
        (
            "name,x,y,z\nT1,1,,3\n",
            "line 2 … `y` of \"T1\" is \"\"; expected a number",
        ),
        (
            "name,x,y,z,directions\nT1,1,2,3,+x +y\n",
            "line 2 … each of its 3 channels",
        ),
        (
            "name,x,y,z,mount\nT1,1,2,3,wall\n",
            "line 2 … \"interface\", \"structure\" or \"load cell\"",
        ),
        (
            "name,x,y,z\r\n# tower\r\n\r\nT1,1,2\r\n",
            "s.csv, line 4: the row has 3 fields; expected 4",
        ),
        (
            "name,x,y,z\nT1,\"1,5\",2,3\n",
            "line 2 … `x` of \"T1\" is \"1,5\"",
        ),
        ("name,x,x,z\n", "line 1 … \"x\" stands there twice"),
    ] {
        std::fs::write(path.join("s.csv"), table).unwrap();
        init(path, &recordings, &["--sensors", "s.csv"]).refused_input(words);
        assert!(!path.join("setup.toml").exists());
    }
    // Semicolons and decimal commas, as spreadsheets of half of Europe write them.
    std::fs::write(
        path.join("s.csv"),
        "name;x;y;z;unit\r\nT1;0;0,25;0;g\r\nF1:Z;1;1;1;kN\r\n",
    )
    .unwrap();
    succeeded(init(
        path,
        &recordings,
        &["--sensors", "s.csv", "--band", "1,9"],
    ));
    let text = std::fs::read_to_string(path.join("setup.toml")).unwrap();
    assert!(
        text.contains("unit = \"kN\"")
            && text.contains("direction = \"+z\"")
            && text.contains("0.25"),
        "{text}"
    );
    // Recordings that are none, or have nothing.
    std::fs::write(path.join("t.csv"), "time,drive\n0,1\n").unwrap();
    init(path, &["t.csv".to_owned()], &["--force"])
        .refused_input("no channel in common … time, drive");
    std::fs::write(path.join("t.csv"), "Dear all\nplease find, below\n").unwrap();
    init(path, &["t.csv".to_owned()], &["--force"])
        .refused_input("t.csv: no row of numbers stands below a row of names");
    init(path, &["no.csv".to_owned()], &["--force"]).refused_input("no.csv");
    let twice = ["x.csv".to_owned(), "./x.csv".to_owned()];
    init(path, &twice, &["--force"]).refused_input("x.csv is given twice");
}

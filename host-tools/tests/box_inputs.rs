//! Recording and watching the inputs of a box, with the box in this program.

mod bench;

use bench::{Finished, by_hand, command, massline};
use serde_json::Value;
use std::path::Path;

fn board(folder: &Path, arguments: &[&str]) -> Finished {
    massline(folder, ["board"].iter().chain(arguments))
}

/// The fork's setup with the lateral run only, recorded by a box; and the names of its columns
/// as the box's inputs.
fn setup(folder: &Path) -> String {
    let simulate = ["simulate", "fork", "--out", ".", "--duration", "6", "-q"];
    assert_eq!(massline(folder, simulate).code, Some(0));
    by_hand(&folder.join("setup.toml"));
    let header = std::fs::read_to_string(folder.join("lateral-x.csv")).unwrap();
    let names = header.lines().next().unwrap().split(',').enumerate();
    let inputs = names.map(|(k, name)| format!("{name}={}", k + 1));
    let text = std::fs::read_to_string(folder.join("setup.toml")).unwrap();
    let end = text.match_indices("[[run]]").nth(1).unwrap().0;
    let text = text[..end].replace("lateral-x.csv", "box.csv");
    std::fs::write(folder.join("box.toml"), text).unwrap();
    inputs.collect::<Vec<_>>().join(",")
}

fn identify(folder: &Path) -> (Finished, Value) {
    let identify = ["identify", "box.toml", "--json"];
    let finished = massline(folder, identify.iter().chain(&bench::BAND));
    let document = serde_json::from_str(&finished.stdout).unwrap_or(Value::Null);
    (finished, document)
}

#[test]
fn what_is_recorded_is_identified_faults_and_all() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = setup(folder.path());
    let record = ["record", "box.csv", "--host", "--seconds", "60", "--json"];
    let faults = ["--fault", "checksum", "--fault", "open"];
    let wired = ["--inputs", &inputs];
    let finished = board(folder.path(), &[&record[..], &faults, &wired].concat());
    assert_eq!((finished.code, &*finished.stderr), (Some(0), ""));
    let recorded: Value = serde_json::from_str(&finished.stdout).unwrap();
    assert_eq!(recorded["schema"], "massline/record/1");
    assert_eq!(recorded["samples"], 30_720);
    assert_eq!(recorded["ending"], "complete");
    let faulty = recorded["faulty_samples"].as_u64().unwrap();
    assert!(faulty > 0, "{recorded:#}");

    let (finished, document) = identify(folder.path());
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let run = &document["runs"][0];
    assert_eq!(run["faulty_samples"], faulty);
    assert!(run["rejected"].as_u64() > Some(0), "{run:#}");
    assert_eq!(run["true_sample_rate"], recorded["true_sample_rate"]);
    assert_eq!(run["calibration"]["fx"]["serial"], "SIM-fx");
    // One lateral run tells the mass of a fork of 0.63076 kg: within what its noise of 1 %
    // leaves, four standard deviations.
    let [mass, std] = ["value", "std"].map(|key| document["mass"][key].as_f64().unwrap());
    assert!((mass - 0.630_76).abs() < 4.0 * std, "{mass} ± {std}");
    assert!(std < 0.01 * mass, "{std}");
    // The box has them as faulty as the recording says.
    let replay = massline(folder.path(), ["replay", "box.toml", "--host"]);
    assert_eq!(replay.code, Some(0), "{replay:?}");
}

#[test]
fn a_recording_full_of_faults_is_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = setup(folder.path());
    let record = ["record", "box.csv", "--host", "--seconds", "10"];
    let faults = ["--fault", "checksum", "--fault-rate", "600"];
    let finished = board(
        folder.path(),
        &[&record[..], &faults, &["--inputs", &inputs]].concat(),
    );
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.shows("checksum (");
    let (finished, document) = identify(folder.path());
    assert_eq!((finished.code, document), (Some(1), Value::Null));
    finished.says("without a faulty sample");
}

#[test]
fn a_file_of_inputs_names_columns_and_has_to_agree_with_the_box() {
    let folder = tempfile::tempdir().unwrap();
    let export = ["settings", "--host", "--export", "inputs.toml"];
    assert_eq!(board(folder.path(), &export).code, Some(0));
    let file = folder.path().join("inputs.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(
        &file,
        text.replacen("[[input]]", "[[input]]\nchannel = \"u\"", 1),
    )
    .unwrap();
    let record = |name: &str| {
        let own = ["record", name, "--host", "--seconds", "1", "--inputs"];
        board(folder.path(), &[&own[..], &["inputs.toml"]].concat())
    };
    assert_eq!(record("x.csv").code, Some(0));
    let recording = std::fs::read_to_string(folder.path().join("x.csv")).unwrap();
    let header = recording.lines().find(|l| !l.starts_with('#')).unwrap();
    assert!(
        header.starts_with("u,input 2,") && header.ends_with(",health"),
        "{header}"
    );
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("offset = 0.0", "offset = 3.0", 1)).unwrap();
    let refused = record("y.csv");
    assert_eq!(refused.code, Some(2));
    let words = "input 1 is calibrated otherwise";
    refused.says(words);
}

#[test]
fn what_cannot_be_recorded_is_said_with_a_way_out() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("x.csv"), "").unwrap();
    for (arguments, words) in [
        (&["record", "x.csv"][..], "--force"),
        (&["record", "x.txt"], ".csv, .csv.gz or .parquet"),
        (
            &["record", "y.csv", "--inputs", "30"],
            "nothing is wired to input 30",
        ),
        (&["record", "y.csv", "--inputs", "health=1"], "channel name"),
        (&["record", "y.csv", "--inputs", "a=1,a=2"], "channel name"),
        (&["record", "y.csv", "--seconds", "0"], "above 0"),
        (&["record", "y.csv", "--fault", "fire"], "stuck-line"),
        (&["monitor", "--inputs", "0"], "from 1 on"),
    ] {
        let finished = board(folder.path(), &[arguments, &["--host"]].concat());
        assert_eq!(finished.code, Some(2), "{arguments:?}");
        finished.says(words);
        assert!(!folder.path().join("y.csv").exists(), "{arguments:?}");
    }
    let elsewhere = ["monitor", "--port", "none", "--fault", "open"];
    let finished = board(folder.path(), &elsewhere);
    finished.says("cannot be used with");
}

#[test]
fn levels_come_as_lines_where_nobody_watches() {
    let monitor = [
        "monitor",
        "--host",
        "--inputs",
        "drive=1,a1=2",
        "--seconds",
        "3",
    ];
    let finished = board(Path::new("."), &monitor);
    assert_eq!((finished.code, &*finished.stderr), (Some(0), ""));
    let lines: Vec<Vec<&str>> = finished
        .stdout
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    let heads: Vec<&[&str]> = lines.iter().map(|l| &l[..2]).collect();
    let expected = ["1.0", "2.0", "3.0"].map(|t| [[t, "drive"], [t, "a1"]]);
    assert_eq!(heads, expected.concat());
    for line in &lines {
        // White noise of RMS 1: over 512 samples its RMS scatters by 3 %.
        let [rms, peak] = [3, 4].map(|k| line[k].parse::<f64>().unwrap());
        assert!(
            (0.85..1.15).contains(&rms) && (2.0..5.0).contains(&peak),
            "{line:?}"
        );
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_recording_and_keeps_it() {
    let folder = tempfile::tempdir().unwrap();
    let record = ["board", "record", "x.csv", "--host", "--inputs", "1-2"];
    let mut child = command(folder.path(), record);
    child.stdout(std::process::Stdio::piped());
    let child = child.spawn().unwrap();
    let part = folder.path().join("x.csv.part");
    let begun = || part.metadata().is_ok_and(|m| m.len() > 100_000);
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(30);
    while !begun() && std::time::Instant::now() < deadline {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    // The shell's own: a small machine has no program of this name.
    let kill = std::process::Command::new("sh")
        .args(["-c", &format!("kill -INT {}", child.id())])
        .status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(!part.exists());
    let text = std::fs::read_to_string(folder.path().join("x.csv")).unwrap();
    assert!(text.starts_with("# massline recording 1\n") && text.ends_with(",\n"));
    let rows = text.lines().filter(|l| !l.starts_with('#')).count() - 1;
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(
        told.contains(&format!("samples         {rows} in ")),
        "{told}"
    );
}

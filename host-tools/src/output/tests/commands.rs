//! Every command that writes a file as a whole.

use super::at_every_step;
use crate::cli::run_words;
use crate::commands::Failure;
use crate::recording::RecordingError;
use crate::setup::Setup;
use std::path::Path;

fn run(folder: &Path, words: &[&str]) -> Result<(), Failure> {
    let folder = folder.to_str().unwrap();
    let words: Vec<String> = words.iter().map(|w| w.replace("HERE", folder)).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    run_words(&words)
}

fn simulate(folder: &Path, duration: &str, seed: &str) -> Result<(), Failure> {
    let own = ["simulate", "fork", "--out", "HERE", "--quiet"];
    let chosen = ["--duration", duration, "--seed", seed];
    run(folder, &[&own[..], &chosen].concat())
}

#[test]
fn a_report() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, "6", "1").unwrap();
    let identify = ["identify", "HERE/setup.toml", "--json", "--report"];
    let report = |more: &[&str]| run(folder, &[&identify[..], &["HERE/report.html"], more].concat());
    // The old one is of another method.
    report(&["--method", "b"]).unwrap();
    at_every_step(folder, &["report.html"], || report(&[]), |_| ());
}

#[test]
fn a_first_report() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let study = ["study", "tuning-fork", "--draws", "0", "--json"];
    let study = [&study[..], &["--report", "HERE/study.html"]].concat();
    at_every_step(folder, &["study.html"], || run(folder, &study), |_| ());
}

#[test]
fn exported_settings() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("inputs.toml"), "# by hand\n").unwrap();
    let settings = ["board", "settings", "--host", "--json", "--force"];
    let export = [&settings[..], &["--export", "HERE/inputs.toml"]].concat();
    at_every_step(folder, &["inputs.toml"], || run(folder, &export), |_| ());
}

const TEST: [&str; 5] = [
    "setup.toml",
    "truth.json",
    "lateral-x.csv",
    "lateral-z.csv",
    "rotation-y.csv",
];

/// Whether all recordings can be read to their ends, each as the one that the setup means.
fn read_all(folder: &Path) -> Result<(), RecordingError> {
    let setup = Setup::read(&folder.join("setup.toml")).unwrap();
    for run in &setup.runs {
        let mut recording = setup.open_recording(run, &["a1"])?;
        while recording.next_row(&mut [0.0])? {}
    }
    Ok(())
}

/// A test that is simulated over another one: all of the old one, all of the new one, or a
/// mixture that is seen.
fn over_another(change: impl Fn(&Path)) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, "2", "1").unwrap();
    change(folder);
    let (mut mixtures, mut whole) = (0, 0);
    let counts = std::cell::RefCell::new((&mut mixtures, &mut whole));
    at_every_step(
        folder,
        &TEST,
        || simulate(folder, "2", "2"),
        |left| {
            let all = |of: &super::Files| TEST.iter().all(|name| left.now[*name] == of[*name]);
            let mut counts = counts.borrow_mut();
            if all(left.old) || all(left.new) {
                *counts.1 += 1;
                return;
            }
            *counts.0 += 1;
            let error = read_all(folder).unwrap_err();
            let seen = matches!(error, RecordingError::OtherRecording { .. });
            assert!(seen, "{error}");
            let text = error.to_string();
            let told = text.contains("simulate again") && text.contains("`checksum`");
            assert!(told, "{text}");
        },
    );
    // Between the first rename and the last one lie nine operations, with two faults each: a
    // full disk has them pass.
    assert!(mixtures >= 9 && whole > mixtures, "{mixtures} {whole}");
}

#[test]
fn a_simulated_test_over_another() {
    over_another(|_| ());
}

#[test]
fn a_simulated_test_over_one_without_checksums() {
    over_another(|folder| {
        let file = folder.join("setup.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        let kept = text.lines().filter(|line| !line.starts_with("checksum"));
        let kept: Vec<&str> = kept.collect();
        assert!(kept.len() + 3 == text.lines().count());
        std::fs::write(file, kept.join("\n")).unwrap();
    });
}

/// The whole of `demo`: at every operation but most of a recording's writes, of which there are
/// hundreds that differ in nothing.
#[test]
fn a_demo() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let demo = || run(folder, &["demo", "--json", "--out", "HERE"]);
    let started = std::time::Instant::now();
    demo().unwrap();
    println!("{:?}", started.elapsed());
}

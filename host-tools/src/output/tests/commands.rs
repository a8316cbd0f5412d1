//! Every command that writes a file as a whole.

use super::{Left, at_steps};
use crate::cli::run_words;
use crate::commands::{Failure, Verbosity, demo};
use crate::identification::Wanted;
use crate::output::operation::Operation;
use crate::recording::RecordingError;
use crate::setup::Setup;
use crate::simulate::Options;
use massline_core::masslines::Method;
use std::path::Path;

fn run(folder: &Path, words: &[&str]) -> Result<(), Failure> {
    let folder = folder.to_str().unwrap();
    let words: Vec<String> = words.iter().map(|w| w.replace("HERE", folder)).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    run_words(&words)
}

fn every(_: Operation, _: &Path) -> bool {
    true
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
    let report = |more: &[&str]| {
        run(
            folder,
            &[&identify[..], &["HERE/report.html"], more].concat(),
        )
    };
    // The old one is of another method.
    report(&["--method", "b"]).unwrap();
    let again = || report(&["--method", "apparent-mass"]);
    at_steps(folder, &["report.html"], every, again, |_| ());
}

#[test]
fn a_first_report() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let study = ["study", "tuning-fork", "--draws", "0", "--json"];
    let study = [&study[..], &["--report", "HERE/study.html"]].concat();
    at_steps(
        folder,
        &["study.html"],
        every,
        || run(folder, &study),
        |_| (),
    );
}

#[test]
fn an_exported_result() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let result = serde_json::to_vec(&*crate::result::tests::FORK).unwrap();
    std::fs::write(folder.join("result.json"), result).unwrap();
    let export = ["export", "HERE/result.json", "--to", "csv", "--quiet"];
    let export = [&export[..], &["--force", "--out", "HERE/result.csv"]].concat();
    std::fs::write(folder.join("result.csv"), "by hand\n").unwrap();
    at_steps(
        folder,
        &["result.csv"],
        every,
        || run(folder, &export),
        |_| (),
    );
}

#[test]
fn results_exported_beside_the_answer() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, "6", "1").unwrap();
    let identify = [
        "identify",
        "HERE/setup.toml",
        "--quiet",
        "--json",
        "--force",
        "--method",
        "apparent-mass",
    ];
    let export = [
        "--export",
        "HERE/ten.csv",
        "--export",
        "covariance=HERE/c.csv",
    ];
    for name in ["ten.csv", "c.csv"] {
        std::fs::write(folder.join(name), "by hand\n").unwrap();
    }
    at_steps(
        folder,
        &["ten.csv", "c.csv"],
        every,
        || run(folder, &[&identify[..], &export].concat()),
        |_| (),
    );
}

#[test]
fn a_first_setup_and_its_sketch() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("x.csv"), "T1:X [g],T1:Y [g],T1:Z [g]\n1,2,3\n").unwrap();
    std::fs::write(folder.join("draft.toml"), "by hand\n").unwrap();
    let init = ["init", "HERE/x.csv", "--quiet", "--force", "--out"];
    let init = [&init[..], &["HERE/draft.toml"]].concat();
    at_steps(
        folder,
        &["draft.toml"],
        every,
        || run(folder, &init),
        |_| (),
    );
    simulate(folder, "6", "1").unwrap();
    let sketch = ["sketch", "HERE/setup.toml", "--quiet", "--force", "--out"];
    let sketch = [&sketch[..], &["HERE/x.svg"]].concat();
    at_steps(folder, &["x.svg"], every, || run(folder, &sketch), |_| ());
}

#[test]
fn exported_settings() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("inputs.toml"), "# by hand\n").unwrap();
    let settings = ["board", "settings", "--host", "--json", "--force"];
    let export = [&settings[..], &["--export", "HERE/inputs.toml"]].concat();
    at_steps(
        folder,
        &["inputs.toml"],
        every,
        || run(folder, &export),
        |_| (),
    );
}

const TEST: [&str; 5] = [
    "setup.toml",
    "truth.json",
    "lateral-x.csv",
    "lateral-z.csv",
    "rotation-y.csv",
];

/// Reads all recordings to their ends, each as the one that the setup means.
fn read_all(folder: &Path) -> Result<(), RecordingError> {
    let setup = Setup::read(&folder.join("setup.toml")).unwrap();
    for run in &setup.runs {
        let mut recording = setup.open_recording(run, &["a1"])?;
        while recording.next_row(&mut [0.0])? {}
    }
    Ok(())
}

/// A mixture of two tests has to be seen: whether it is one.
fn is_seen_if_mixed(folder: &Path, left: &Left<'_>) -> bool {
    let all = |of: &super::Files| TEST.iter().all(|name| left.now[*name] == of[*name]);
    if all(left.old) || all(left.new) {
        return false;
    }
    let error = read_all(folder).unwrap_err();
    let seen = matches!(error, RecordingError::OtherRecording { .. });
    assert!(seen, "{error}");
    let text = error.to_string();
    let told = text.contains("simulate again") && text.contains("`checksum`");
    assert!(told, "{text}");
    true
}

/// Simulates a test over another one: all of the old one, all of the new one, or a mixture that
/// is seen.
fn over_another(folder: &Path, chosen: impl Fn(Operation, &Path) -> bool) {
    let mut mixtures = 0;
    let again = || simulate(folder, "2", "2");
    at_steps(folder, &TEST, chosen, again, |left| {
        mixtures += u32::from(is_seen_if_mixed(folder, left));
    });
    // Five renames and as many syncs by turns: a mixture is left where one of the eight between
    // the first rename and the last one's end fails or is not reached. A full disk lets renames
    // pass but not the syncs behind them, those behind the first four.
    assert_eq!(mixtures, 8 + 8 + 8);
}

#[test]
fn a_simulated_test_over_another() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "2", "1").unwrap();
    over_another(folder.path(), every);
}

#[test]
fn a_simulated_test_over_one_without_checksums() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "2", "1").unwrap();
    let file = folder.path().join("setup.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let kept = text.lines().filter(|line| !line.starts_with("checksum"));
    let kept: Vec<&str> = kept.collect();
    assert!(kept.len() + 3 == text.lines().count());
    std::fs::write(file, kept.join("\n")).unwrap();
    // What comes before does not differ from the test above.
    let placing = |operation, _: &Path| matches!(operation, Operation::Rename | Operation::Sync);
    over_another(folder.path(), placing);
}

#[test]
fn a_demo() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let demo = |seed| {
        let quiet = Verbosity {
            quiet: true,
            verbose: false,
        };
        let options = Options {
            duration: Some(6.0),
            seed,
            ..demo::options()
        };
        // The files are the same by the method that takes least time.
        let wanted = Wanted::Band(Method::ApparentMass);
        demo::leave(folder, &options, wanted, false, quiet).map(|_| ())
    };
    demo(1).unwrap();
    let targets = [&TEST[..], &["report.html"]].concat();
    // The tests above have seen the others.
    let chosen = |operation, path: &Path| {
        let name = path.file_name().unwrap().to_string_lossy();
        operation == Operation::Rename || name.starts_with("report.html")
    };
    at_steps(
        folder,
        &targets,
        chosen,
        || demo(2),
        |left| {
            is_seen_if_mixed(folder, left);
        },
    );
}

//! Which files a command replaces.

use crate::bench::{BAND, Bench, massline};
use crate::files;

/// A command that is refused, with words of the reason, and changes nothing.
fn refused(bench: &Bench, arguments: &[&str], words: &[&str]) {
    let before = files(bench.path());
    let finished = massline(bench.path(), arguments);
    assert_eq!(finished.code, Some(2), "{arguments:?}: {finished:?}");
    for word in words {
        finished.says(word);
    }
    assert!(files(bench.path()) == before, "{arguments:?}");
}

fn done(bench: &Bench, arguments: &[&str]) {
    let finished = massline(bench.path(), arguments);
    assert_eq!(finished.code, Some(0), "{arguments:?}: {finished:?}");
}

#[test]
fn a_report_is_never_written_over_an_input() {
    let bench = Bench::fork();
    let link = |name: &str| bench.file(name);
    std::fs::hard_link(link("setup.toml"), link("hard.html")).unwrap();
    let mut names = vec!["setup.toml", "./lateral-z.csv", "truth.json", "hard.html"];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("lateral-x.csv", link("soft.html")).unwrap();
        names.push("soft.html");
    }
    std::fs::create_dir(bench.file("x")).unwrap();
    names.push("x/../lateral-x.csv");
    for name in names {
        for force in [&[][..], &["--force"]] {
            let own = ["identify", "setup.toml", "--truth", "truth.json"];
            let report = ["--report", name];
            refused(
                &bench,
                &[&own[..], &report, force].concat(),
                &["is read by the same command", "choose another name"],
            );
        }
    }
}

#[test]
fn a_report_replaces_reports_only_unless_it_is_forced() {
    let bench = Bench::fork()
        .write("notes.html", "<p>mine</p>")
        .write("empty.html", "");
    let own = [
        &["identify", "setup.toml", "--json"],
        &BAND[..],
        &["--report"],
    ]
    .concat();
    let report = |name| [&own[..], &[name]].concat();
    let words = ["no report of this program", "--force"];
    refused(&bench, &report("notes.html"), &words);
    let study = ["study", "tuning-fork", "--draws", "0", "--report"];
    refused(&bench, &[&study[..], &["notes.html"]].concat(), &words);
    done(&bench, &[&report("notes.html")[..], &["--force"]].concat());
    // A report may be replaced, an empty file is nobody's.
    for name in ["notes.html", "empty.html"] {
        done(&bench, &report(name));
        assert!(files(bench.path())[name].starts_with(b"<!DOCTYPE html>"));
    }
}

#[test]
fn settings_are_exported_over_nothing_unless_it_is_forced() {
    let bench = Bench::fork().write("other.toml", "# mine\n");
    let own = ["board", "settings", "--host", "--json", "--export"];
    let export = |more: &[&'static str]| [&own[..], more].concat();
    refused(
        &bench,
        &export(&["other.toml"]),
        &["is there already", "--force"],
    );
    done(&bench, &export(&["inputs.toml"]));
    refused(&bench, &export(&["inputs.toml"]), &["--force"]);
    let same = ["inputs.toml", "--inputs", "inputs.toml", "--force"];
    refused(&bench, &export(&same), &["is read by the same command"]);
    done(&bench, &export(&["other.toml", "--force"]));
    let files = files(bench.path());
    assert!(files["other.toml"] == files["inputs.toml"]);
}

#[cfg(unix)]
#[test]
fn a_recording_is_never_made_of_its_inputs() {
    let bench = Bench::fork();
    let own = ["board", "settings", "--host", "--json"];
    done(&bench, &[&own[..], &["--export", "inputs.toml"]].concat());
    std::os::unix::fs::symlink("inputs.toml", bench.file("x.csv")).unwrap();
    let record = ["board", "record", "x.csv", "--host", "--seconds", "1"];
    let inputs = ["--inputs", "inputs.toml", "--force"];
    let words = ["is read by the same command"];
    refused(&bench, &[&record[..], &inputs].concat(), &words);
}

#[test]
fn a_simulation_replaces_simulations_only_unless_it_is_forced() {
    let bench = Bench::fork();
    let simulate = ["simulate", "fork", "--out", ".", "--duration", "2", "-q"];
    let demo = ["demo", "--out", "."];
    // It was simulated.
    done(&bench, &simulate);
    let bench = bench.edit("setup.toml", |text| {
        text.replacen("# Written by `massline simulate`.", "# Measured.", 1)
    });
    let words = ["setup.toml", "no test that was simulated", "--force"];
    refused(&bench, &simulate, &words);
    refused(&bench, &demo, &words);
    std::fs::remove_file(bench.file("setup.toml")).unwrap();
    std::fs::remove_file(bench.file("truth.json")).unwrap();
    refused(&bench, &simulate, &["lateral-x.csv", "--force"]);
    done(&bench, &[&simulate[..], &["--force"]].concat());
}

#[test]
fn a_simulation_is_never_written_over_its_model() {
    let models = concat!(env!("CARGO_MANIFEST_DIR"), "/models/");
    let read = |name: &str| std::fs::read_to_string(models.to_owned() + name).unwrap();
    let bench = Bench::fork();
    for name in ["setup.toml", "truth.json", "lateral-x.csv"] {
        std::fs::remove_file(bench.file(name)).unwrap();
    }
    // A model that extends the one that would be lost.
    let bench = bench.write("setup.toml", read("rigid-body.toml"));
    let bench = bench.write("model.toml", "extends = \"setup.toml\"\n");
    for model in ["setup.toml", "model.toml"] {
        let simulate = ["simulate", model, "--out", ".", "--force"];
        refused(&bench, &simulate, &["is read by the same command"]);
    }
}

#[test]
fn a_recording_that_was_exchanged_is_no_answer_and_told_before_anything_else() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, seed) in [("one", "1"), ("two", "2")] {
        let own = ["simulate", "fork", "--out", name, "--seed", seed];
        assert_eq!(
            massline(folder, own.iter().chain(&["--duration", "6"])).code,
            Some(0)
        );
    }
    let setup = "one/setup.toml";
    let identify = ["identify", setup, BAND[0], BAND[1]];
    assert_eq!(massline(folder, identify).code, Some(0));
    let file = folder.join("one/lateral-z.csv");
    let own = std::fs::read(&file).unwrap();
    let mut digit = own.clone();
    // The last digit of the last reading.
    let last = digit.iter().rposition(u8::is_ascii_digit).unwrap();
    digit[last] = if digit[last] == b'1' { b'2' } else { b'1' };
    let mut text = own.clone();
    let middle = text.len() / 2;
    text[middle..middle + 5].copy_from_slice(b"other");
    let other = std::fs::read(folder.join("two/lateral-z.csv")).unwrap();
    for bytes in [
        digit,
        text,
        other,
        own[..own.len() / 2].to_vec(),
        b"a header of something else\n".to_vec(),
        Vec::new(),
    ] {
        std::fs::write(&file, bytes).unwrap();
        for command in [
            &["identify", setup][..],
            &["identify", setup, "--method", "all"],
            &["replay", setup, "--host"],
            &["replay", setup, "--host", "--blocks", "3"],
        ] {
            let finished = massline(folder, command);
            assert_eq!(finished.code, Some(2), "{command:?} {finished:?}");
            for words in ["lateral-z.csv: this is not the recording", "simulate again"] {
                finished.says(words);
            }
        }
    }
    // It says how to have it believed.
    crate::bench::by_hand(&folder.join(setup));
    std::fs::write(&file, own).unwrap();
    assert_eq!(massline(folder, identify).code, Some(0));
}

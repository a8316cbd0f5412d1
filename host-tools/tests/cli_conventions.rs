//! Properties of all commands: streams, exit codes, help, colours, silence.

mod bench;

use bench::{Bench, Finished, command, finish, massline};
use std::path::Path;
use std::process::Stdio;

const ESCAPE: char = '\u{1b}';

fn run(arguments: &[&str]) -> Finished {
    massline(Path::new("."), arguments)
}

/// The commands that the help lists.
fn commands() -> Vec<String> {
    listed(&run(&["--help"]).stdout)
}

/// The commands that a help lists.
fn listed(help: &str) -> Vec<String> {
    let list = help.split("Commands:\n").nth(1).unwrap_or_default();
    list.lines()
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(str::to_owned)
        .collect()
}

#[test]
fn help_is_one_screen_with_an_example() {
    // Rows and columns of a terminal window as it is commonly opened on a workstation.
    const ROWS: usize = 50;
    let commands = commands();
    for expected in ["demo", "identify", "simulate"] {
        assert!(commands.iter().any(|c| c == expected), "{commands:?}");
    }
    let top = vec!["--help".to_owned()];
    let each = commands.into_iter().map(|c| vec![c, "--help".to_owned()]);
    for arguments in std::iter::once(top).chain(each) {
        let finished = massline(Path::new("."), &arguments);
        assert_eq!(finished.code, Some(0), "{arguments:?}");
        assert_eq!(finished.stderr, "", "{arguments:?}");
        let help = &finished.stdout;
        assert!(
            help.contains("  massline "),
            "no example: {arguments:?}\n{help}"
        );
        assert!(help.lines().count() <= ROWS, "{arguments:?}\n{help}");
        assert!(help.contains("--help"), "{arguments:?}");
    }
}

/// All options but those of the paper's open choices, of which the manual says that the help lists them.
#[test]
fn the_manual_has_every_option() {
    let manual = concat!(env!("CARGO_MANIFEST_DIR"), "/README.md");
    let manual = std::fs::read_to_string(manual).unwrap();
    let mut waiting: Vec<Vec<String>> = commands().into_iter().map(|c| vec![c]).collect();
    let mut options = 0;
    while let Some(path) = waiting.pop() {
        let all = path.iter().cloned().chain(["--help".to_owned()]);
        let help = massline(Path::new("."), all).stdout;
        for name in listed(&help) {
            waiting.push(path.iter().cloned().chain([name]).collect());
        }
        let own = help.split("What the paper leaves open").next().unwrap();
        for word in own.split(|c: char| !(c.is_ascii_lowercase() || c == '-')) {
            if let Some(name) = word.strip_prefix("--").filter(|name| !name.is_empty()) {
                assert!(manual.contains(&format!("--{name}")), "{path:?} --{name}");
                options += 1;
            }
        }
    }
    assert!(options > 100, "{options}");
}

#[test]
fn wrong_usage_is_code_2_and_says_where_help_is() {
    for (arguments, word) in [
        (&["frobnicate"][..], "frobnicate"),
        (&["identify"], "<SETUP>"),
        (
            &["identify", "setup.toml", "--method", "z"],
            "apparent-mass, a, b",
        ),
        (&["identify", "setup.toml", "-q", "-v"], "--verbose"),
        (&["simulate", "fork"], "--out <DIR>"),
        (&["demo", "--seed", "1"], "--seed"),
        (
            &["identify", "setup.toml", "--threads", "0"],
            "whole number, at least 1",
        ),
    ] {
        let finished = run(arguments);
        assert_eq!(finished.code, Some(2), "{arguments:?}");
        assert_eq!(finished.stdout, "", "{arguments:?}");
        finished.says(word);
        finished.says("--help");
    }
}

#[test]
fn without_a_command_the_help_is_shown() {
    let finished = run(&[]);
    assert_eq!(finished.code, Some(2));
    finished.says("massline demo");
}

#[test]
fn results_go_to_stdout_and_the_rest_to_stderr() {
    let finished = Bench::fork().identify(&[]);
    assert_eq!(finished.code, Some(0));
    finished.shows("CG x");
    assert!(!finished.stdout.contains("note:"), "{}", finished.stdout);
    finished.says("note: ");
    assert!(!finished.stderr.contains("CG x"), "{}", finished.stderr);
    // Neither is a terminal here: no bar, no colour.
    for stream in [&finished.stdout, &finished.stderr] {
        assert!(!stream.contains(['\r', ESCAPE]), "{stream:?}");
    }
}

#[test]
fn json_is_alone_on_stdout() {
    let bench = Bench::fork();
    for (arguments, schema) in [
        (&["--json"][..], "massline/result/2"),
        (&["--json", "-v"], "massline/result/2"),
        (&["--json", "--report", "report.html"], "massline/result/2"),
        (&["--json", "--method", "all"], "massline/comparison/1"),
    ] {
        let finished = bench.identify(arguments);
        assert_eq!(finished.code, Some(0), "{}", finished.stderr);
        let document: serde_json::Value = serde_json::from_str(&finished.stdout).unwrap();
        assert_eq!(document["schema"], schema, "{arguments:?}");
    }
}

#[test]
fn quiet_leaves_results_and_errors() {
    let bench = Bench::fork();
    let finished = bench.identify(&["--quiet"]);
    assert_eq!(finished.code, Some(0));
    assert_eq!(finished.stderr, "");
    assert_eq!(finished.stdout, bench.identify(&[]).stdout);
    let finished = massline(bench.path(), ["identify", "nowhere.toml", "-q"]);
    assert_eq!(finished.code, Some(2));
    assert!(finished.stderr.starts_with("error: nowhere.toml"));
}

#[test]
fn verbose_says_what_was_averaged_and_fitted() {
    let bench = Bench::fork();
    let finished = bench.identify(&["-v"]);
    // Six seconds at 512 Hz in blocks of 1024 that overlap by half: 1 + (3072 - 1024) / 512,
    // the last of which lacks the decimator's delay.
    for words in [
        "run \"lateral X\": 3072 samples at 512 Hz (6 s), 4 blocks of 1024, referred to the drive",
        "52 of them in the averaging band from 0.5 to 26 Hz",
        "condition number",
    ] {
        finished.says(words);
    }
    assert_eq!(finished.stdout, bench.identify(&[]).stdout);
}

#[test]
fn no_color_is_honoured() {
    let bench = Bench::fork();
    let arguments = ["identify", "setup.toml", "--method", "apparent-mass"];
    let mut forced = command(bench.path(), arguments);
    forced.env("CLICOLOR_FORCE", "1");
    let coloured = finish(forced);
    coloured.shows("\u{1b}");
    coloured.says("\u{1b}");
    let mut plain = command(bench.path(), arguments);
    plain.env("CLICOLOR_FORCE", "1").env("NO_COLOR", "1");
    let plain = finish(plain);
    assert!(!plain.stdout.contains(ESCAPE));
    assert!(!plain.stderr.contains(ESCAPE));
}

#[test]
fn a_reader_that_hangs_up_is_no_error() {
    let bench = Bench::fork();
    for arguments in [
        &["identify", "setup.toml", "--quiet"][..],
        &["identify", "setup.toml", "--quiet", "--json"],
        &["identify", "setup.toml", "--quiet", "--method", "all"],
        &["completions", "zsh"],
    ] {
        let mut child = command(bench.path(), arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(stderr, "", "{arguments:?}");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
    }
}

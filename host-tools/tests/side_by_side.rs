//! `massline identify --method all` and `massline study` as a user runs them.

mod bench;

use bench::Finished;
use massline::identification::{Choice, Session, Wanted};
use massline::setup::Setup;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn massline(arguments: &[&str]) -> Finished {
    bench::massline(Path::new("."), arguments)
}

#[track_caller]
fn stdout(finished: Finished) -> String {
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.stdout
}

fn setup() -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/fork/setup.toml");
    path.to_str().unwrap().to_owned()
}

const METHODS: [&str; 9] = [
    "ml",
    "apparent-mass",
    "a",
    "b",
    "b-cholesky",
    "c",
    "c-squared",
    "d",
    "e",
];

#[test]
fn all_methods_stand_side_by_side_and_the_recommended_one_is_marked() {
    let text = stdout(massline(&["identify", &setup(), "--method", "all"]));
    let headings: Vec<&str> = text
        .lines()
        .filter(|l| l.contains("apparent-mass ") || l.contains("b-cholesky") || l.contains(" e "))
        .flat_map(str::split_whitespace)
        .collect();
    let plain: Vec<&str> = headings.iter().map(|h| h.trim_end_matches('*')).collect();
    assert_eq!(plain, METHODS);
    let marked: Vec<&&str> = headings.iter().filter(|h| h.ends_with('*')).collect();
    assert_eq!(marked, [&"ml*"]);
    assert!(text.contains("* recommended: "), "{text}");
    for name in ["CG x, mm", "CG z, mm", "Θyy about A", "Θyy about S"] {
        let lines: Vec<&str> = text.lines().filter(|l| l.starts_with(name)).collect();
        // Three blocks of three methods, each with an error bar.
        assert_eq!(lines.len(), 3, "{name}: {text}");
        for line in lines {
            assert_eq!(line.matches('±').count(), 3, "{line}");
        }
    }
}

#[test]
fn the_comparison_is_one_json_document() {
    let text = stdout(massline(&[
        "identify",
        &setup(),
        "--method",
        "all",
        "--json",
    ]));
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document["schema"], "massline/comparison/1");
    assert_eq!(document["recommended"], "ml");
    let results = document["results"].as_array().unwrap();
    let names: Vec<&str> = results
        .iter()
        .filter_map(|r| r["method"].as_str())
        .collect();
    assert_eq!(names, METHODS);
    assert_eq!(document["failed"].as_array().unwrap().len(), 0);
}

#[test]
fn the_study_prints_tables_and_writes_its_report() {
    let report = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("study.html");
    let report = report.to_str().unwrap();
    let arguments = ["study", "tuning-fork", "--draws", "0", "--report", report];
    let text = stdout(massline(&arguments));
    for heading in [
        "Table 1: natural frequencies of the fixed system",
        "Table 2: natural frequencies of the free system",
        "Table 3: direct estimation",
        "The rows that the paper lacks",
        "Table 4: direct and iterative",
        "The pattern",
    ] {
        assert!(text.contains(heading), "{heading} is not in: {text}");
    }
    // A terminal of a hundred columns.
    let widest = text.lines().map(|l| l.chars().count()).max();
    assert!(widest <= Some(100), "{widest:?}");
    let html = std::fs::read_to_string(report).unwrap();
    assert!(html.contains("<svg") && html.contains("Table 3"));
}

#[test]
fn the_study_json_is_alone_on_stdout_and_its_noise_free_claims_hold() {
    let arguments = [
        "study",
        "tuning-fork",
        "--draws",
        "0",
        "--json",
        "--fit-band",
        "0.5,200",
    ];
    let document: Value = serde_json::from_str(&stdout(massline(&arguments))).unwrap();
    assert_eq!(document["schema"], "massline/study/1");
    assert_eq!(document["options"]["fit_band"][1], 200.0);
    let pattern = document["pattern"].as_array().unwrap();
    assert_eq!(pattern.len(), 10);
    for check in pattern {
        assert_eq!(check["holds"], true, "{check}");
    }
}

#[test]
fn an_option_out_of_range_ends_with_code_two() {
    let finished = massline(&["study", "tuning-fork", "--ranges", "0.8,0.45"]);
    assert_eq!(finished.code, Some(2));
    finished.says("--ranges … expected");
}

/// Results, warnings and errors do not depend on the number of threads, nor does what comes first.
#[test]
fn threads_change_nothing() {
    let spoilt = |files: &[&str]| {
        let bench = bench::Bench::satellite();
        files.iter().fold(bench, |bench, file| {
            bench.channel(file, "top.x", |row, field| match row {
                3000 => "x".to_owned(),
                _ => field.to_owned(),
            })
        })
    };
    let dead = bench::Bench::satellite().channel("about-y.csv", "top.y", |_, _| "1".to_owned());
    for (bench, code) in [
        (bench::Bench::satellite(), 0),
        (dead, 1),
        (spoilt(&["z.csv", "about-x.csv"]), 2),
        (spoilt(&["about-z.csv"]), 2),
    ] {
        let of = |threads: &str| bench.identify(&["--json", "--threads", threads]);
        let one = of("1");
        assert_eq!(one.code, Some(code), "{}", one.stderr);
        for threads in ["2", "3", "5", "8"] {
            let several = of(threads);
            assert_eq!(several.code, one.code);
            assert!(several.stdout == one.stdout, "{threads} threads");
            assert_eq!(several.stderr, one.stderr);
        }
    }
}

/// Modes that are found beside an answer from averages at hand are those that are found after it from passes of
/// their own, to the last bit.
#[test]
fn modes_beside_an_answer_are_those_after_it() {
    let bench = bench::Bench::satellite();
    let setup = Setup::read(&bench.path().join("setup.toml")).unwrap();
    let choice = Choice::default();
    let modes = |ahead: bool, threads: usize| {
        let mut session = Session::new(&setup).on_threads(Some(threads));
        if ahead {
            session.read_ahead(&choice, &mut |_| ());
        }
        let answer = session.wanted_with_modes(Wanted::Recommended, &choice, &mut |_| ());
        let modal = answer.unwrap().modal.unwrap();
        let free = modal.free.iter().map(|mode| (mode.pole, &mode.shape));
        let free: Vec<_> = free.collect();
        let fixed = modal
            .fixed
            .iter()
            .map(|m| (m.mode.pole, m.modal_mass, &m.shape));
        let fixed: Vec<_> = fixed.collect();
        assert!(!free.is_empty() && !fixed.is_empty());
        format!("{free:?} {fixed:?} {:?}", modal.warnings)
    };
    let after = modes(false, 1);
    for threads in [1, 2] {
        assert_eq!(modes(true, threads), after, "{threads} threads");
    }
}

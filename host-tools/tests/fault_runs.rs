//! Everything that goes wrong next to a shaker, through the command: a simulated fork is
//! recorded by the modelled box, faults and all, and identified.

mod bench;

use bench::massline;
use serde_json::Value;
use std::path::Path;

/// Records the fork for so many seconds a run.
fn record(folder: &Path, seconds: &str, more: &[&str]) {
    let own = ["simulate", "fork", "--out", "test", "--noise", "0.01"];
    let duration = ["--duration", seconds, "--quiet"];
    let finished = massline(folder, [&own[..], &duration, more].concat());
    assert_eq!(finished.code, Some(0), "{finished:?}");
}

fn identify(folder: &Path) -> (Option<i32>, Value, String) {
    let identify = ["identify", "test/setup.toml", "--json"];
    let finished = massline(folder, identify.iter().chain(&bench::BAND));
    let document = serde_json::from_str(&finished.stdout).unwrap_or(Value::Null);
    (finished.code, document, finished.stderr)
}

/// The ten numbers with their standard deviations, as far as this plane test tells them.
fn ten(document: &Value) -> Vec<(String, f64, f64)> {
    let mut found = Vec::new();
    let mut add = |name: String, number: &Value| {
        if let (Some(value), Some(std)) = (number["value"].as_f64(), number["std"].as_f64()) {
            found.push((name, value, std));
        }
    };
    add("mass".to_owned(), &document["mass"]);
    for k in 0..3 {
        add(format!("cg {k}"), &document["centre_of_gravity"][k]);
    }
    for term in ["xx", "yy", "zz", "xy", "xz", "yz"] {
        add(term.to_owned(), &document["inertia_reference"][term]);
    }
    found
}

/// Blocks left out for a fault, over all runs.
fn rejected(document: &Value, by: &str) -> u64 {
    let runs = document["runs"].as_array().unwrap();
    let of = |run: &Value| run["rejected_by"][by].as_u64().unwrap_or(0);
    runs.iter().map(of).sum()
}

/// Each fault on the command line, and what it is found out as.
const FAULTS: [(&str, &str); 7] = [
    ("checksum", "checksum"),
    ("missed", "missing"),
    ("reset", "converter-reset"),
    ("out-of-step", "out-of-step"),
    ("stuck-line", "stuck"),
    ("overload", "overload"),
    ("open", "open"),
];

#[test]
fn a_box_without_faults_records_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "60", &["--through-converters"]);
    let (code, through, _) = identify(folder.path());
    assert_eq!(code, Some(0));
    record(folder.path(), "60", &[]);
    let (_, direct, _) = identify(folder.path());
    for ((name, a, std), (_, b, _)) in ten(&through).iter().zip(ten(&direct)) {
        // The converters add noise at 1e-6 of full scale to sensors' noise of 1e-2: the numbers
        // move by far less than their error bars.
        assert!((a - b).abs() < 0.02 * std, "{name}: {a} {b} ± {std}");
    }
    assert_eq!(rejected(&through, "missing"), 0);
    let rate = &through["runs"][0]["true_sample_rate"];
    let (value, uncertainty) = (&rate["value"], &rate["uncertainty"]);
    let off = value.as_f64().unwrap() / 512.0 - 1.0;
    // The model's crystal is up to 20 parts in a million off.
    assert!(off.abs() < 25e-6 && off != 0.0, "{off:e}");
    let uncertainty = uncertainty.as_f64().unwrap();
    assert!(
        uncertainty > 0.0 && uncertainty < 5e-6 * 512.0,
        "{uncertainty}"
    );
    assert_eq!(through["runs"][0]["calibration"]["fx"]["serial"], "SIM-fx");
}

#[test]
fn each_fault_is_named_and_the_ten_numbers_stay() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "60", &["--through-converters"]);
    let (_, whole, _) = identify(folder.path());
    let truth = ten(&whole);
    assert_eq!(
        truth.len(),
        4,
        "a plane test: mass, two of the CG, one moment"
    );
    for (fault, flag) in FAULTS {
        let more = ["--fault", fault, "--fault-rate", "5"];
        record(folder.path(), "60", &more);
        let (code, document, errors) = identify(folder.path());
        assert_eq!(code, Some(0), "{fault}: {errors}");
        assert!(rejected(&document, flag) > 0, "{fault}: {document:#}");
        let warned = document["warnings"].to_string();
        assert!(warned.contains(&format!("{flag} (")), "{fault}: {warned}");
        for ((name, value, std), (_, before, least)) in ten(&document).iter().zip(&truth) {
            // Both come from the same noise; what the lost blocks had to say is part of the
            // wider error bar.
            assert!(
                (value - before).abs() < 2.0 * std,
                "{fault}, {name}: {before} became {value} ± {std}"
            );
            // Fewer blocks have wider bars, by the root of their number and the chance of
            // which are left.
            assert!(*std < 3.0 * least, "{fault}, {name}: {std} {least}");
        }
    }
}

#[test]
fn where_no_good_block_is_left_there_is_no_answer() {
    for (fault, flag) in FAULTS {
        let folder = tempfile::tempdir().unwrap();
        // Blocks last two seconds: one in a hundred or so would be spared.
        let more = ["--fault", fault, "--fault-rate", "300"];
        record(folder.path(), "12", &more);
        let (code, document, errors) = identify(folder.path());
        assert_eq!(code, Some(1), "{fault}: {errors}");
        assert_eq!(document, Value::Null);
        let says = errors.contains("without a faulty sample") && errors.contains(flag);
        assert!(says, "{fault}: {errors}");
    }
}

//! Each command's own promises.

mod bench;

use bench::{Bench, RECORDINGS, massline};
use std::collections::BTreeMap;
use std::path::Path;

/// Every file of a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, std::fs::read(entry.path()).unwrap())
        })
        .collect()
}

#[test]
fn demo_shows_truth_and_error_and_leaves_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let finished = massline(folder.path(), ["demo", "--out", "shown"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let table = &finished.stdout;
    for words in [
        "apparent mass",
        "95 % interval",
        "truth",
        "error",
        "not observable",
    ] {
        assert!(table.contains(words), "{table}");
    }
    // One row each for what this plane test tells, with a percentage at its end.
    for row in ["indicator Δ", "CG x", "CG z", "Θyy about A", "Θyy about S"] {
        let line = table.lines().find(|l| l.starts_with(row)).unwrap();
        assert!(line.contains('±') && line.contains('%'), "{line}");
    }
    finished.says("shown/report.html");
    let files = files(&folder.path().join("shown"));
    for file in ["setup.toml", "truth.json", "report.html"]
        .iter()
        .chain(&RECORDINGS)
    {
        assert!(files.contains_key(*file), "{file}");
    }
    let html = String::from_utf8(files["report.html"].clone()).unwrap();
    assert!(html.contains("<svg") && html.contains("The ten numbers"));
    for outside in [
        "<script",
        "src=\"http",
        "href=\"http",
        "@import",
        "url(http",
    ] {
        assert!(!html.contains(outside), "not self-contained: {outside}");
    }
}

#[test]
fn demo_has_one_document_with_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let finished = massline(folder.path(), ["demo", "--json", "--quiet"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    assert_eq!(finished.stderr, "");
    let document: serde_json::Value = serde_json::from_str(&finished.stdout).unwrap();
    assert_eq!(document["schema"], "massline/result/2");
    assert_eq!(document["truth"]["schema"], "massline/truth/1");
    assert!(
        folder.path().join("demo/report.html").exists(),
        "the default place"
    );
}

#[test]
fn the_next_step_that_is_named_works() {
    let folder = tempfile::tempdir().unwrap();
    let finished = massline(
        folder.path(),
        ["simulate", "fork", "--out", "fork", "--duration", "8"],
    );
    assert_eq!(finished.stdout.trim_end(), "fork/setup.toml");
    let next = finished
        .stderr
        .lines()
        .find_map(|l| l.strip_prefix("next: massline "));
    let next: Vec<&str> = next.unwrap().split_whitespace().collect();
    let finished = massline(folder.path(), next);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.shows("truth");
}

fn simulated(seed: &str) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "simulate",
        "fork",
        "--out",
        ".",
        "--duration",
        "2",
        "--seed",
        seed,
    ];
    let finished = massline(folder.path(), arguments);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    files(folder.path())
}

#[test]
fn a_seed_gives_the_same_bytes_and_another_one_others() {
    let first = simulated("7");
    assert_eq!(first, simulated("7"));
    let other = simulated("8");
    for recording in RECORDINGS {
        assert_ne!(first[recording], other[recording]);
    }
    assert_eq!(first["truth.json"], other["truth.json"]);
}

/// FNV-1a, 64 bits.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The bytes as they came out on the machine that this was written on (x86-64, Linux).
#[test]
fn a_seed_gives_the_same_bytes_on_every_machine() {
    assert_eq!(
        hash(&simulated("7")["lateral-x.csv"]),
        9_059_926_063_220_378_318
    );
}

#[test]
fn the_options_of_simulate_reach_the_setup() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--duration", "2", "--weighed", "--no-drive"];
    let arguments = ["simulate", "fork", "--out", "."].iter().chain(&options);
    assert_eq!(massline(folder.path(), arguments).code, Some(0));
    let files = files(folder.path());
    let setup = String::from_utf8(files["setup.toml"].clone()).unwrap();
    assert!(setup.contains("known_mass = 0.63"), "{setup}");
    assert!(!setup.contains("reference = "), "{setup}");
    let recording = String::from_utf8(files["lateral-x.csv"].clone()).unwrap();
    assert!(!recording.lines().next().unwrap().contains("drive"));
    assert_eq!(recording.lines().count(), 1 + 2 * 512);
}

#[test]
fn a_comparison_has_the_truth_and_no_report() {
    let finished = Bench::fork().identify(&["--method", "all", "--truth", "truth.json"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.shows("true 20.78");
    let finished = Bench::fork().identify(&["--method", "all", "--report", "x.html"]);
    assert_eq!(finished.code, Some(2));
    finished.says("name the method");
}

#[test]
fn the_default_says_which_method_and_why() {
    let bench = Bench::fork();
    let finished = bench.recommended(&[]);
    finished.shows(
        "maximum likelihood fit … recommended: its residuals are noise … Θyy about S … fitted: ",
    );
    let named = bench.identify(&["--method", "apparent-mass"]);
    assert!(!named.stdout.contains("recommended"), "{}", named.stdout);
    let of = |bench: &Bench, arguments: &[&str]| -> serde_json::Value {
        serde_json::from_str(&bench.recommended(arguments).stdout).unwrap()
    };
    let document = of(&bench, &["--json"]);
    assert_eq!(document["method"], "ml");
    assert!(document["recommended_because"].is_string());
    let named = of(&bench, &["--json", "--method", "ml"]);
    assert_eq!(document["mass"], named["mass"]);
    assert!(named["recommended_because"].is_null());
    // The reference point is stepped by the averaging band's methods.
    let iterated = of(&bench, &["--json", "--iterative"]);
    assert_eq!(iterated["method"], "apparent-mass");
    assert!(iterated["likelihood"].is_null());
    // Accelerometers on the structure alone are for another method.
    let structure = Bench::fork().edit("setup.toml", |text| {
        text.replace("mount = \"interface\"", "mount = \"structure\"")
    });
    structure
        .recommended(&[])
        .refused_data("method c-squared: this method needs 3 independent runs");
}

#[test]
fn of_two_procedures_the_last_one_counts() {
    let bench = Bench::fork();
    let iterative = |arguments: &[&str]| {
        let finished = bench.identify(arguments);
        let document: serde_json::Value = serde_json::from_str(&finished.stdout).unwrap();
        document["iterative"].as_bool().unwrap()
    };
    assert!(iterative(&["--json", "--iterative"]));
    assert!(!iterative(&["--json", "--direct"]));
    assert!(!iterative(&["--json", "--iterative", "--direct"]));
    assert!(iterative(&["--json", "--direct", "--iterative"]));
    bench
        .identify(&["--method", "ml", "--iterative"])
        .refused_input("ml has no steps of a reference point … leave out --iterative");
}

#[test]
fn a_result_is_exported_to_every_form() {
    let bench = Bench::fork();
    let document = bench.identify(&["--json"]).stdout;
    let bench = bench.write("result.json", &document);
    let export = |more: &[&str]| {
        let arguments = ["export", "result.json", "--to"].iter().chain(more);
        massline(bench.path(), arguments)
    };
    let same = export(&["json"]);
    assert_eq!(same.code, Some(0), "{}", same.stderr);
    assert_eq!(same.stdout, document);
    assert_eq!(same.stderr, "");

    let table = export(&["csv"]).stdout;
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let rows: Vec<BTreeMap<String, String>> = rows.deserialize().map(Result::unwrap).collect();
    // Mass, Δ, three coordinates, six terms about A, six about S.
    assert_eq!(rows.len(), 17);
    let document: serde_json::Value = serde_json::from_str(&document).unwrap();
    for row in &rows {
        let mut number = &document;
        for key in row["parameter"].split('.') {
            number = match ["x", "y", "z"].iter().position(|axis| *axis == key) {
                Some(axis) => &number[axis],
                None => &number[key],
            };
        }
        for (column, key) in [
            ("value", "value"),
            ("std", "std"),
            ("interval_95", "interval"),
        ] {
            let text = &row[column];
            let found: Option<f64> = (!text.is_empty()).then(|| text.parse().unwrap());
            assert_eq!(found, number[key].as_f64(), "{row:?}");
        }
        let status = ["not observable", "ok"][usize::from(number["observable"].as_bool().unwrap())];
        assert_eq!(row["status"], status, "{row:?}");
    }
    let row = rows.iter().find(|row| row["parameter"] == "inertia_cg.yy");
    let row = row.unwrap();
    assert_eq!((&*row["unit"], &*row["point"]), ("kg m²", "S"));
    let centre = document["centre_of_gravity"][2]["value"].as_f64();
    assert_eq!(row["point_z_m"].parse().ok(), centre);

    let written = export(&["csv", "--out", "out/result.csv"]);
    assert_eq!(
        (written.code, &*written.stdout),
        (Some(0), ""),
        "{}",
        written.stderr
    );
    assert_eq!(
        std::fs::read_to_string(bench.file("out/result.csv")).unwrap(),
        table
    );
    let again = export(&["csv", "--out", "out/result.csv"]);
    assert_eq!(again.code, Some(2));
    again.says("--force");
    assert_eq!(
        export(&["csv", "--out", "out/result.csv", "--force"]).code,
        Some(0)
    );
    let own = export(&["csv", "--out", "result.json", "--force"]);
    assert_eq!(own.code, Some(2), "an input is never written over");
}

/// The satellite's test tells all ten: every format is written beside the answer, and the same by
/// `export` afterwards. The fork's does not.
#[test]
fn identify_exports_beside_the_answer() {
    let bench = Bench::satellite();
    let names = [
        "a.json", "a.csv", "a.bdf", "a.urdf", "a.sdf", "a.xml", "a.yaml",
    ];
    let others = ["mass-matrix=m.csv", "covariance=c.csv"];
    let files = names.iter().chain(&others);
    let exports: Vec<&str> = files.flat_map(|file| ["--export", file]).collect();
    let written = bench.identify(&exports);
    assert_eq!(written.code, Some(0), "{}", written.stderr);
    written.says("nastran: a.bdf");
    let formats = [
        "json",
        "csv",
        "nastran",
        "urdf",
        "sdf",
        "mjcf",
        "mujoco-sysid",
    ];
    let formats = formats.into_iter().chain(["mass-matrix", "covariance"]);
    for (format, file) in formats.zip(names.into_iter().chain(["m.csv", "c.csv"])) {
        let made = massline(bench.path(), ["export", "a.json", "--to", format]);
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        let beside = std::fs::read_to_string(bench.file(file)).unwrap();
        assert_eq!(made.stdout, beside, "{format}");
    }
    let responses = bench.identify(&["--export", "a.uff", "--quiet"]);
    assert_eq!(responses.code, Some(0), "{}", responses.stderr);
    let responses = std::fs::read_to_string(bench.file("a.uff")).unwrap();
    assert!(responses.starts_with("    -1\n    58\nax per drive\n"));
    // Twelve resultants of six runs, and the entries of the apparent mass.
    assert_eq!(responses.matches("    -1\n    58\n").count(), 12 * 6 + 36);
    let again = bench.identify(&["--export", "a.bdf"]);
    assert_eq!(again.code, Some(2));
    again.says("--force");
    let unknown = bench.identify(&["--export", "setup.toml"]);
    assert_eq!(unknown.code, Some(2));
    unknown.says("its ending tells no format");
    let misspelt = bench.identify(&["--export", "covarience=x.csv"]);
    assert_eq!(misspelt.code, Some(2), "{}", misspelt.stderr);
    misspelt.says("no format is called `covarience`; there are json, csv, covariance");
    assert!(!bench.file("covarience=x.csv").exists());
    bench
        .identify(&["--export", "csv=setup.toml", "--force"])
        .refused_input("is read by the same command");
    bench
        .identify(&["--export", "twice.csv", "--export", "covariance=twice.csv"])
        .refused_input("two outputs");
    bench
        .identify(&["--method", "all", "--export", "x.csv"])
        .refused_input("one method");
    bench
        .identify(&["--force"])
        .refused_input("--force is about");
    let plane = Bench::fork();
    let plane = plane.identify(&["--export", "x.urdf", "--export", "x.csv", "--quiet"]);
    assert_eq!(plane.code, Some(1), "{}", plane.stderr);
    plane.says("no export to urdf: the format needs all ten numbers");
    plane.shows("CG x");
}

/// The truth is compared about the reference point of the setup: with A moved by 10 m the moment about it grows four
/// thousandfold, and its error stays within a few intervals.
#[test]
fn the_truth_is_about_the_reference_point_of_the_setup() {
    let bench = Bench::satellite().with("reference_point", "[10.0, 0.0, 0.0]");
    let report = [
        "--truth",
        "truth.json",
        "--method",
        "apparent-mass",
        "--report",
        "r.html",
    ];
    let finished = bench.identify(&report);
    let row = finished
        .stdout
        .lines()
        .find(|line| line.starts_with("Θyy about A"));
    let error = row
        .unwrap()
        .split_whitespace()
        .find(|word| word.starts_with(['+', '-']));
    let error: f64 = error.unwrap().parse().unwrap();
    // The interval of the mass is 0.05 % of it after 20 s, and decides on a moment of 10 m.
    assert!(error.abs() < 0.2, "{}", finished.stdout);
    // 328.235 kg m² about S and 800 kg: 328.235 + 800 (9.96125² + 0.94025²). The report groups its digits.
    finished.shows("Θyy about A … 80416.7");
    let page = std::fs::read_to_string(bench.file("r.html")).unwrap();
    assert!(page.contains("416.7"));
}

/// `[frame]` gives table and document in other axes; the truth goes along.
#[test]
fn results_are_given_in_the_frame_of_the_setup() {
    let own = Bench::satellite();
    let frame = "\n[frame]\norigin = [0.5, 0.0, -1.0]\nx = \"+y\"\nz = [0, 0, 2]\n";
    let turned = Bench::satellite().edit("setup.toml", |text| text.to_owned() + frame);
    let document = |bench: &Bench| -> serde_json::Value {
        let finished = bench.identify(&["--json", "--report", "r.html", "--force"]);
        assert_eq!(finished.code, Some(0), "{}", finished.stderr);
        serde_json::from_str(&finished.stdout).unwrap()
    };
    let (own, found) = (document(&own), document(&turned));
    assert_eq!(own.get("frame"), None);
    assert_eq!(
        found["frame"]["axes"][1],
        serde_json::json!([-1.0, 0.0, 0.0])
    );
    let value = |document: &serde_json::Value, axis: usize| {
        document["centre_of_gravity"][axis]["value"]
            .as_f64()
            .unwrap()
    };
    // Coordinates of order one, less an origin.
    assert!((value(&found, 1) - (0.5 - value(&own, 0))).abs() < 1e-15);
    assert!((value(&found, 2) - (value(&own, 2) + 1.0)).abs() < 1e-15);
    assert_eq!(found["inertia_cg"]["xx"], own["inertia_cg"]["yy"]);
    assert_eq!(
        found["covariance"]["matrix"][3][6],
        own["covariance"]["matrix"][3][6]
    );
    let table = turned.identify(&["--truth", "truth.json"]);
    table.shows("in a frame with the origin (0.5, 0, -1) m, x along (0, 1, 0), y along (-1, 0, 0)");
    let row = table
        .stdout
        .lines()
        .find(|l| l.starts_with("CG y"))
        .unwrap();
    let error = row
        .split_whitespace()
        .rev()
        .nth(1)
        .unwrap()
        .parse::<f64>()
        .unwrap();
    assert!(error.abs() < 1.0, "the truth is in the frame, too: {row}");
    let html = std::fs::read_to_string(turned.file("r.html")).unwrap();
    assert!(html.contains("In a frame with the origin (0.5, 0, -1) m"));
}

/// `--method all` gives several results; the one to export is named.
#[test]
fn one_of_several_results_is_exported() {
    let bench = Bench::fork();
    let document = bench.identify(&["--method", "all", "--json"]).stdout;
    let bench = bench.write("all.json", &document);
    let export = |more: &[&str]| {
        let arguments = ["export", "all.json", "--to", "csv"].iter().chain(more);
        massline(bench.path(), arguments)
    };
    export(&[]).refused_input("name it by --method: ml (recommended), apparent-mass, a, ");
    export(&["--method", "x"]).refused_input("no result of the method \"x\"");
    let method_a = export(&["--method", "a"]);
    assert_eq!(method_a.code, Some(0), "{}", method_a.stderr);
    assert_ne!(
        method_a.stdout,
        export(&["--method", "apparent-mass"]).stdout
    );
    export(&["--method", "a", "--about", "0,0,1"])
        .refused_input("--about is for mass-matrix, nastran");
}

#[test]
fn what_is_no_result_is_not_exported() {
    let bench = Bench::fork().write("result.json", "{\n  \"schema\": 3\n}");
    let export = |file: &str, more: &[&str]| {
        let finished = massline(bench.path(), ["export", file].iter().chain(more));
        assert_eq!(finished.stdout, "");
        (finished.code, finished.stderr)
    };
    for (file, words) in [
        ("result.json", "result.json, line 2, column"),
        ("setup.toml", "setup.toml, line 1, column"),
        ("truth.json", "`schema` is \"massline/truth/1\""),
        ("nowhere.json", "nowhere.json: cannot be read"),
        (".", ".: cannot be read"),
    ] {
        let (code, stderr) = export(file, &["--to", "csv", "--out", "x.csv"]);
        assert_eq!(code, Some(2), "{stderr}");
        assert!(stderr.contains(words), "{stderr}");
        assert!(!bench.file("x.csv").exists());
    }
    let (code, stderr) = export("result.json", &["--to", "doc"]);
    assert_eq!(code, Some(2));
    assert!(stderr.contains("json, csv"), "{stderr}");
}

/// A mass that is stated as a tenth of the true one contradicts the data.
#[test]
fn refused_numbers_are_exported_on_demand_only() {
    let bench = Bench::fork().with("known_mass", "0.063");
    let document = bench.identify(&["--json"]);
    assert_eq!(document.code, Some(1), "{}", document.stderr);
    let beside = bench.identify(&["--export", "beside.csv"]);
    assert_eq!(beside.code, Some(1));
    beside.says("beside.csv: not written, since the numbers are refused");
    assert!(!bench.file("beside.csv").exists());
    bench.identify(&["--export", "beside.csv", "--anyway"]);
    assert!(bench.file("beside.csv").exists());
    let bench = bench.write("result.json", document.stdout);
    let arguments = ["export", "result.json", "--to", "csv"];
    let refused = massline(bench.path(), arguments);
    assert_eq!((refused.code, &*refused.stdout), (Some(1), ""));
    let anyway = massline(bench.path(), arguments.iter().chain(&["--anyway"]));
    assert_eq!(anyway.code, Some(1), "{}", anyway.stderr);
    anyway.shows(",refused\n");
    assert!(!anyway.stdout.contains(",ok\n"), "{}", anyway.stdout);
}

#[test]
fn places_that_cannot_be_written_are_named() {
    let bench = Bench::fork().write("file", "");
    let finished = bench.identify(&["--report", "file/report.html"]);
    assert_eq!(finished.code, Some(2));
    finished.says("file: cannot be written");
    finished.says("choose another place");
    let finished = massline(bench.path(), ["demo", "--out", "file/demo"]);
    assert_eq!(finished.code, Some(2));
    finished.says("cannot be written");
}

/// A folder is refused before the work, a full disk after it: the numbers are shown.
#[test]
fn numbers_outlive_a_report_that_cannot_be_written() {
    let folder = Bench::fork().identify(&["--report", "."]);
    assert_eq!(folder.code, Some(2));
    folder.says("this is a folder: add a file name");
    assert_eq!(folder.stdout, "");
    if !cfg!(target_os = "linux") {
        return;
    }
    for json in [false, true] {
        let json = if json { &["--json"][..] } else { &[] };
        let full = Bench::fork().identify(&[&["--report", "/dev/full"], json].concat());
        assert_eq!(full.code, Some(2));
        full.says("/dev/full: cannot be written");
        full.shows(if json.is_empty() {
            "Θyy about S"
        } else {
            "\"inertia_cg\""
        });
        assert!(!full.stderr.contains("report: "), "{}", full.stderr);
    }
}

#[test]
fn a_truth_of_another_test_is_told() {
    let truth = Bench::satellite();
    let truth = truth.file("truth.json");
    let truth = truth.to_str().unwrap();
    let other = Bench::fork().identify(&["--truth", truth]);
    other.says("--truth is of \"Satellite … the setup of \"Tuning fork … are they one test?");
    // However large, errors keep apart from the truth.
    let row = other.stdout.lines().find(|l| l.starts_with("Θyy about S"));
    let words: Vec<&str> = row.unwrap().split_whitespace().collect();
    let at = words.iter().rposition(|w| *w == "%").unwrap();
    assert!(words[at - 2].parse::<f64>().is_ok(), "{words:?}");
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish"] {
        let finished = massline(Path::new("."), ["completions", shell]);
        assert_eq!(finished.code, Some(0));
        finished.shows("simulate");
    }
}

/// Noise that single precision does not hold beside the signal.
#[test]
fn noise_beyond_any_signal_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for noise in ["1e300", "100.1", "-0.1", "nan"] {
        let noise = format!("--noise={noise}");
        let finished = massline(folder.path(), ["simulate", "fork", "--out", "f", &noise]);
        finished.refused_input("the noise … a share of the RMS, 0 to 100");
        assert!(!folder.path().join("f").exists());
    }
}

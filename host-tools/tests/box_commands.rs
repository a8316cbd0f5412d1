//! The commands that talk to a box, with the box in this program.

mod bench;

use bench::{Bench, Finished, command, finish, massline};
use serde_json::Value;
use std::path::Path;

fn replay(bench: &Bench, arguments: &[&str]) -> Finished {
    let own = ["replay", "setup.toml", "--host"];
    massline(bench.path(), own.iter().chain(arguments))
}

fn board(arguments: &[&str]) -> Finished {
    let own = ["board", arguments[0], "--host"];
    massline(Path::new("."), own.iter().chain(&arguments[1..]))
}

fn document(finished: &Finished) -> Value {
    serde_json::from_str(&finished.stdout).unwrap_or_else(|e| panic!("{e}: {finished:?}"))
}

#[test]
fn a_replay_is_identical_and_says_so() {
    let finished = replay(&Bench::fork(), &["--method", "apparent-mass,a"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    assert_eq!(finished.stderr, "");
    let last = finished.stdout.lines().last().unwrap();
    assert!(last.starts_with("identical: "), "{last}");
    for words in [
        "ten numbers by apparent-mass",
        "ten numbers by a ",
        "weighted",
    ] {
        finished.shows(words);
    }
    assert!(!finished.stdout.contains("differ"), "{}", finished.stdout);
}

#[test]
fn a_flipped_bit_is_code_1_with_its_run_and_line_named() {
    // The highest bit of the mantissa: the lowest one of a reading across the motion would be
    // lost in the rounding of the sums that it goes into.
    let flip = ["--flip", "lateral Z:1500:a1:22"];
    let finished = replay(&Bench::fork(), &flip);
    assert_eq!(finished.code, Some(1), "{finished:?}");
    let table = &finished.stdout;
    let differing: Vec<&str> = table.lines().filter(|l| l.ends_with(" differ")).collect();
    assert!(differing[0].contains("lateral Z"), "{table}");
    assert!(table.contains("    line 0 ("), "{table}");
    finished.says("flipped bit was noticed");
}

#[test]
fn a_flip_beyond_the_blocks_is_said_to_hit_nothing() {
    let finished = replay(
        &Bench::fork(),
        &["--blocks", "2", "--flip", "1:100000:a1:0"],
    );
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.says("changed nothing");
}

#[test]
fn the_document_has_every_comparison() {
    let finished = replay(&Bench::fork(), &["--blocks", "3", "--json", "--iterative"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let document = document(&finished);
    assert_eq!(document["schema"], "massline/replay/1");
    assert_eq!(document["identical"], true);
    assert_eq!(document["link"]["lost"], 0);
    let compared = document["compared"].as_array().unwrap();
    let kinds: Vec<&str> = compared
        .iter()
        .map(|entry| entry["kind"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["grid", "run", "run", "run", "answer"]);
    for entry in &compared[1..4] {
        assert_eq!(entry["blocks"], 3);
        assert_eq!(entry["samples"], document["samples_per_run"]);
        assert_eq!(entry["different"], 0);
    }
}

#[test]
fn faulty_samples_are_replayed_as_such_and_told() {
    let bench = Bench::fork().edit("lateral-z.csv", |text| {
        let lines = text.lines().enumerate().map(|(row, line)| match row {
            0 => format!("{line},health"),
            // One in the middle of the first block.
            500 => format!("{line},checksum"),
            _ => format!("{line},"),
        });
        lines.collect::<Vec<_>>().join("\n")
    });
    let finished = replay(&bench, &["--no-weights"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let note = "note: run \"lateral Z\": faulty samples (1) went to the box";
    assert_eq!(finished.stderr.matches("note:").count(), 1, "{finished:?}");
    finished.says(note);
    let document = document(&replay(&bench, &["--no-weights", "--json"]));
    let runs = &document["compared"].as_array().unwrap()[1..4];
    let of = |key: &str| runs.iter().map(|r| r[key].as_u64()).collect::<Vec<_>>();
    assert_eq!(of("faulty_samples"), [Some(0), Some(1), Some(0)]);
    assert_eq!(of("rejected")[0], Some(0));
    assert!(of("rejected")[1] > Some(0), "{document:#}");
}

#[test]
fn what_cannot_be_replayed_is_said_with_a_way_out() {
    let long = |bench: Bench| bench.with("block_length", "2048");
    let undriven = |bench: Bench| {
        bench.edit("setup.toml", |text| {
            let kept = text.lines().filter(|line| !line.starts_with("reference ="));
            kept.collect::<Vec<_>>().join("\n")
        })
    };
    let short = replay(&Bench::fork(), &["--blocks", "2", "--method", "a"]);
    assert_eq!(short.code, Some(1), "{short:?}");
    short.says("--no-weights");
    for (bench, words) in [
        (long(Bench::fork()), "set `block_length = 1024`"),
        (undriven(Bench::fork()), "record it and name its channel"),
    ] {
        let finished = replay(&bench, &[]);
        assert_eq!(finished.code, Some(2), "{finished:?}");
        finished.says(words);
    }
}

#[test]
fn exactly_one_place_of_the_box_is_named() {
    let run = |arguments: &[&str]| massline(Path::new("."), arguments);
    for (arguments, word) in [
        (&["board", "info"][..], "<--port <DEV>|--emulator|--host>"),
        (&["board", "info", "--host", "--emulator"], "--emulator"),
        (&["board", "info", "--host", "--baud", "9600"], "--baud"),
        (&["board", "info", "--port", "/dev/none"], "--emulator"),
        (
            &["board", "info", "--emulator", "--elf", "none"],
            "cargo build --profile chip -p massline-firmware",
        ),
    ] {
        let finished = run(arguments);
        assert_eq!(finished.code, Some(2), "{arguments:?}");
        finished.says(word);
    }
}

#[test]
fn help_of_the_box_is_one_screen_with_an_example() {
    for command in [
        "info", "selftest", "bringup", "settings", "record", "monitor", "forget", "restart",
    ] {
        let finished = massline(Path::new("."), ["board", command, "--help"]);
        assert_eq!(finished.code, Some(0), "{command}");
        let help = &finished.stdout;
        assert!(
            help.contains(&format!("  massline board {command} ")),
            "{help}"
        );
        assert!(help.lines().count() <= 50, "{help}");
    }
}

#[test]
fn info_says_who_it_is_and_what_fits() {
    let finished = board(&["info"]);
    assert_eq!((finished.code, &*finished.stderr), (Some(0), ""));
    for line in [
        "massline ",
        "clock ",
        "fits ",
        "methods ",
        "doing           no set-up",
    ] {
        let table = &finished.stdout;
        assert!(table.lines().any(|l| l.starts_with(line)), "{table}");
    }
    let document = document(&board(&["info", "--json"]));
    assert_eq!(document["schema"], "massline/board/1");
    assert_eq!(document["version"], env!("CARGO_PKG_VERSION"));
    let methods = document["capacity"]["methods"].as_array().unwrap();
    assert!(methods.contains(&"apparent-mass".into()), "{methods:?}");
}

#[test]
fn the_selftest_passes_within_its_bounds() {
    let finished = board(&["selftest"]);
    assert_eq!((finished.code, &*finished.stderr), (Some(0), ""));
    let lines: Vec<&str> = finished.stdout.lines().collect();
    assert_eq!(lines.iter().filter(|l| l.ends_with(" passed")).count(), 10);
    assert_eq!(lines.last(), Some(&"passed"));
    let document = document(&board(&["selftest", "--json"]));
    assert_eq!(document["schema"], "massline/selftest/1");
    let checks = document["checks"].as_array().unwrap();
    assert_eq!(checks.len(), 10);
    for check in checks {
        let [found, truth, bound] = ["found", "truth", "bound"].map(|k| check[k].as_f64().unwrap());
        assert!((found - truth).abs() <= bound, "{check}");
        // A bound that anything passes would say nothing.
        assert!(bound < 0.01 * truth.abs(), "{check}");
    }
}

#[test]
fn inputs_are_wired_by_a_file_shown_and_exported_again() {
    let folder = tempfile::tempdir().unwrap();
    let settings = |arguments: &[&str]| {
        let own = ["board", "settings", "--host"];
        massline(folder.path(), own.iter().chain(arguments))
    };
    let shown = settings(&[]);
    assert_eq!(shown.code, Some(0), "{shown:?}");
    // The fork's drive and 18 sensors are wired to the box in this program, nothing else.
    let rows = shown.stdout.lines().filter(|l| l.contains("SIM-")).count();
    assert_eq!(rows, 19, "{}", shown.stdout);
    assert!(!shown.stdout.contains("unused"), "{}", shown.stdout);
    let file = r#"
        [[input]]
        input = 3
        channel = "fx"
        circuit = "bridge"
        serial = "LC-0815"
        certificate = "K 2026-17"
        calibrated = "2026-03-02"
        uncertainty = 0.002
        rated_load = 500
        rated_output = 2e-3
        [[input]]
        input = 1
        circuit = "unused"
    "#;
    std::fs::write(folder.path().join("in.toml"), file).unwrap();
    let wire = ["--inputs", "in.toml", "--export", "out.toml", "--json"];
    let document = document(&settings(&wire));
    let inputs = document["inputs"].as_array().unwrap();
    assert_eq!(inputs.len(), 18);
    let cell = inputs.iter().find(|i| i["input"] == 3).unwrap();
    assert_eq!(cell["serial"], "LC-0815");
    assert_eq!(cell["calibrated"], "2026-03-02");
    // 10 µV/N on 2.5 V, at gain 128: 1.2 V / 128 / 2^23 / 10e-6 V/N.
    let per_count = cell["per_count"].as_f64().unwrap();
    assert!((per_count / 1.117587e-4 - 1.0).abs() < 1e-4, "{per_count}");
    assert_eq!(
        (&cell["gain"], inputs[0]["input"].as_u64()),
        (&128.into(), Some(2))
    );
    // What was exported is taken back and shows the same.
    let again = settings(&["--inputs", "out.toml", "--set", "rate=512", "--json"]);
    assert_eq!(again.code, Some(0), "{again:?}");
    let again: Value = serde_json::from_str(&again.stdout).unwrap();
    let kept = again["inputs"].as_array().unwrap();
    assert_eq!(kept.iter().find(|i| i["input"] == 3), Some(cell));
    let text = std::fs::read_to_string(folder.path().join("out.toml")).unwrap();
    assert!(text.contains("channel = \"fx\""), "{text}");
    let table = settings(&["--inputs", "out.toml"]).stdout;
    let row = table.lines().find(|l| l.contains("LC-0815")).unwrap();
    let cells: Vec<&str> = row.split_whitespace().collect();
    let expected = "3 bridge LC-0815 K 2026-17 2026-03-02 1.11759e-4 0.2 % 128";
    assert_eq!(cells.join(" "), expected);
    std::fs::write(
        folder.path().join("in.toml"),
        file.replace("= 1\n", "= 36\n"),
    )
    .unwrap();
    let refused = settings(&["--inputs", "in.toml"]);
    assert_eq!(refused.code, Some(2));
    refused.says("input 36: this box has inputs 1 to 35");
}

#[test]
fn settings_are_changed_and_what_is_not_kept_is_said() {
    let changes = ["settings", "--set", "name=table 2", "--set", "rate=256"];
    let finished = board(&changes);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.shows("name            table 2\n");
    finished.shows("256 samples/s");
    finished.says("--save");
    let finished = board(&[&changes[..], &["--save", "--json"]].concat());
    assert_eq!(document(&finished)["saved"], true);
    finished.says("until it is switched off");
    let finished = board(&["settings", "--set", "rate=0"]);
    assert_eq!(finished.code, Some(2));
    finished.says("256 to 32768");
}

#[test]
fn flash_says_what_it_would_run_and_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("firmware"), "").unwrap();
    let flash = ["flash", "--elf", "firmware", "--probe", "0483:374b"];
    let dry = massline(folder.path(), flash.iter().chain(&["--dry-run"]));
    assert_eq!(dry.code, Some(0), "{dry:?}");
    assert_eq!(
        dry.stdout,
        "probe-rs download --chip STM32F405RGTx --probe 0483:374b --verify firmware\n\
         probe-rs reset --chip STM32F405RGTx --probe 0483:374b\n"
    );
    let mut without = command(folder.path(), flash);
    without.env("PATH", folder.path());
    let finished = finish(without);
    assert_eq!(finished.code, Some(2), "{finished:?}");
    finished.says("cargo install probe-rs-tools --locked");
}

// A stand-in for probe-rs: what it is asked goes into a file, and it fails on request.
#[cfg(unix)]
#[test]
fn flash_writes_then_starts_and_passes_a_failure_on() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("firmware"), "").unwrap();
    let program = folder.path().join("probe-rs");
    let script = "#!/bin/sh\necho \"$1\" >> asked\n[ \"$1\" != \"$FAILS\" ]\n";
    std::fs::write(&program, script).unwrap();
    std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
    for (fails, code, asked) in [
        ("nothing", 0, "download\nreset\n"),
        ("download", 2, "download\n"),
        ("reset", 2, "download\nreset\n"),
    ] {
        let mut flash = command(folder.path(), ["flash", "--elf", "firmware"]);
        flash.env("PATH", folder.path()).env("FAILS", fails);
        let finished = finish(flash);
        assert_eq!(finished.code, Some(code), "{finished:?}");
        let log = folder.path().join("asked");
        assert_eq!(std::fs::read_to_string(&log).unwrap(), asked);
        std::fs::remove_file(log).unwrap();
        assert_eq!(finished.stderr.contains("failed, see above"), code != 0);
    }
}

#[test]
fn a_bring_up_measures_what_a_modelled_box_has() {
    let arguments = ["board", "bringup", "--host", "--seconds", "1"];
    let finished = massline(Path::new("."), arguments);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    for part in ["open  crystal", "good  round trip", "good  link"] {
        let page = &finished.stdout;
        assert!(page.lines().any(|line| line.starts_with(part)), "{page}");
    }
    let arguments = arguments.into_iter().chain(["--json"]);
    let document = document(&massline(Path::new("."), arguments));
    assert_eq!(document["schema"], "massline/bringup/1");
    assert_eq!(document["passed"], true);
    let finished = massline(
        Path::new("."),
        ["board", "bringup", "--host", "--without", "5"],
    );
    assert_eq!(finished.code, Some(2));
    finished.says("0..5");
}

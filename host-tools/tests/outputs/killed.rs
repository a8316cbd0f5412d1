//! `kill -9` at any time.

use crate::bench::{command, massline};
use crate::files;
use massline::acquire::{Order, record};
use massline::device::{Client, ClientMemory, HostBox, HostBoxMemory};
use massline::inputs::InputEntry;
use massline::rig::{Inputs, Troubles};
use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A time up to `longest`, another one each time.
fn some_time(longest: Duration) -> Duration {
    let random = RandomState::new().build_hasher().finish();
    longest.mul_f64(random as f64 / u64::MAX as f64)
}

fn quietly(mut command: Command) -> std::process::Child {
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

#[test]
fn a_simulation_leaves_the_old_test_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let words = |seed: &str| {
        let own = [
            "simulate",
            "fork",
            "--out",
            "t",
            "--duration",
            "20",
            "--seed",
        ];
        own.into_iter().map(str::to_owned).chain([seed.to_owned()])
    };
    let test = folder.join("t");
    let mut whole = BTreeMap::new();
    let mut longest = Duration::ZERO;
    for seed in ["1", "2"] {
        let started = Instant::now();
        assert_eq!(massline(folder, words(seed)).code, Some(0));
        longest = longest.max(started.elapsed());
        whole.insert(seed, files(&test));
    }
    let (mut old, mut new) = ("2", "1");
    for _ in 0..12 {
        let mut child = quietly(command(folder, words(new)));
        std::thread::sleep(some_time(longest));
        child.kill().unwrap();
        child.wait().unwrap();
        let left = files(&test);
        let is = |seed: &str| {
            let mut all = whole[seed].iter();
            all.all(|(name, bytes)| left.get(name) == Some(bytes))
        };
        let finished = massline(folder, ["identify", "t/setup.toml"]);
        if is(new) {
            (old, new) = (new, old);
        } else if !is(old) {
            // Between the first and the last file that was put in its place.
            assert_eq!(finished.code, Some(2), "{finished:?}");
            finished.says("simulate again");
            assert_eq!(massline(folder, words(old)).code, Some(0));
            assert!(files(&test) == whole[old]);
            continue;
        }
        assert_eq!(finished.code, Some(0), "{finished:?}");
    }
    // What was left beside them is gone with the next.
    assert_eq!(massline(folder, words(new)).code, Some(0));
    assert!(files(&test) == whole[new]);
}

/// The name of the file, to the process that records until it is killed.
const FILE: &str = "MASSLINE_TEST_RECORDS_TO";

/// Records until it is killed, and says how many rows there are. Run by the test below.
#[test]
#[ignore = "a part of the test below"]
fn that_records() {
    let Some(file) = std::env::var_os(FILE) else {
        return;
    };
    let none = Troubles {
        kinds: Vec::new(),
        per_minute: 0.0,
        seed: 1,
    };
    let inputs = Inputs::fork(none).unwrap();
    let entry = |input: u8| InputEntry {
        input,
        channel: None,
        certificate: inputs.certificates()[usize::from(input)].clone(),
    };
    let order = Order {
        inputs: (0..19).map(entry).collect(),
        seconds: None,
        file: file.into(),
        replace: false,
    };
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let ended = record(&mut client, &order, &mut |progress| {
        let rows = (progress.seconds * 512.0).round();
        writeln!(std::io::stderr(), "rows {rows}").is_ok()
    });
    ended.unwrap();
}

/// Whole rows of what a killed program has left.
fn rows(part: &Path) -> usize {
    let text = std::fs::read_to_string(part).unwrap();
    let (whole, _) = text.rsplit_once('\n').unwrap_or_default();
    let columns = |line: &str| line.split(',').count();
    assert!(whole.lines().all(|line| columns(line) == 20), "a cut row");
    whole.lines().count().saturating_sub(1)
}

#[test]
fn what_a_recording_has_told_is_found_again() {
    let folder = tempfile::tempdir().unwrap();
    for round in 0..5 {
        let file = folder.path().join(format!("{round}.csv"));
        let mut child = Command::new(std::env::current_exe().unwrap());
        child.args([
            "--exact",
            "killed::that_records",
            "--ignored",
            "--nocapture",
        ]);
        child.env(FILE, &file).stdout(Stdio::null());
        let mut child = child.stderr(Stdio::piped()).spawn().unwrap();
        let told = child.stderr.take().unwrap();
        let told = std::thread::spawn(move || {
            let lines = BufReader::new(told).lines().map_while(Result::ok);
            let told = lines.filter_map(|line| line.strip_prefix("rows ")?.parse().ok());
            told.last().unwrap_or(0_usize)
        });
        // Long enough for it to begin even on a machine that has other things to do.
        let begun = Instant::now();
        while !file.with_extension("csv.part").exists() {
            assert!(begun.elapsed() < Duration::from_secs(60));
            std::thread::sleep(Duration::from_millis(1));
        }
        let longest = Duration::from_secs(2);
        std::thread::sleep(some_time(longest));
        child.kill().unwrap();
        child.wait().unwrap();
        let told = told.join().unwrap();
        let part = file.with_extension("csv.part");
        let found = rows(&part);
        assert!(found >= told, "{found} of {told} rows");
        println!("{told} rows were told, {found} found");
        again(folder.path(), &file, &part);
    }
}

/// The obvious second try.
fn again(folder: &Path, file: &Path, part: &Path) {
    let left = std::fs::read(part).unwrap();
    let name = file.file_name().unwrap().to_str().unwrap();
    let own = ["board", "record", name, "--host", "--seconds", "1"];
    let refused = massline(folder, own);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    for words in [".csv.part: holds the rows", "rename it", "--force"] {
        refused.says(words);
    }
    assert!(!file.exists() && std::fs::read(part).unwrap() == left);
    let forced = massline(folder, own.iter().chain(&["--force"]));
    assert_eq!(forced.code, Some(0), "{forced:?}");
    let aside = file.with_extension("csv.1.part");
    let named = aside.file_name().unwrap().to_str().unwrap();
    forced.says(named);
    assert!(std::fs::read(aside).unwrap() == left && !part.exists());
    // Under another name it is a recording.
    let renamed = file.with_extension("kept.csv");
    std::fs::write(&renamed, left).unwrap();
    let columns: Vec<&str> = Vec::new();
    massline::recording::Recording::open(&renamed, &columns).unwrap();
}

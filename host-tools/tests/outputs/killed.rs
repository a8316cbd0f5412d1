//! `kill -9` at any time.

use crate::bench::{BAND, command, massline};
use crate::files;
use massline::acquire::{Order, record};
use massline::device::{Client, ClientMemory, HostBox, HostBoxMemory};
use massline::inputs::InputEntry;
use massline::recording::Recording;
use massline::rig::{Inputs, Troubles};
use std::collections::BTreeMap;
use std::ffi::OsStr;
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
        let finished = massline(folder, ["identify", "t/setup.toml", BAND[0], BAND[1]]);
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
        firmware: None,
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

/// Rows of a recording, as bits.
fn rows(file: &Path) -> Vec<u32> {
    let names: Vec<String> = (1..=19).map(|n| format!("input {n}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut recording = Recording::open(file, &names).unwrap();
    let (mut rows, mut sample) = (Vec::new(), [0.0_f32; 19]);
    while recording.next_row(&mut sample).unwrap() {
        assert!(recording.health().is_good());
        rows.extend(sample.map(f32::to_bits));
    }
    rows
}

/// Number of kills, where it is another one than in every test; the hundred of the project's goal take
/// three minutes.
const KILLS: &str = "MASSLINE_TEST_KILLS";

/// Lines of CSV and frames of a journal: `massline recover` finds all rows that were told of.
#[test]
fn what_a_recording_has_told_is_found_again() {
    let folder = tempfile::tempdir().unwrap();
    let kills = std::env::var(KILLS).map_or(6, |kills| kills.parse().unwrap());
    // The box says the same each time, so that each recording is the beginning of the longest one.
    let mut longest = Vec::new();
    for round in 0..kills {
        let ending = ["parquet", "csv"][usize::from(round % 2 == 1)];
        let file = folder.path().join(format!("{round}.{ending}"));
        let part = file.with_extension(format!("{ending}.part"));
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
        while !part.exists() {
            assert!(begun.elapsed() < Duration::from_secs(60));
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(some_time(Duration::from_secs(2)));
        child.kill().unwrap();
        child.wait().unwrap();
        let told = told.join().unwrap();
        let left = std::fs::read(&part).unwrap();
        let recovered = massline(folder.path(), [OsStr::new("recover"), part.as_os_str()]);
        let found = if recovered.code == Some(0) {
            assert!(!recovered.stderr.contains("damaged"), "{recovered:?}");
            rows(&file)
        } else {
            assert!(told == 0, "{told} rows were told of: {recovered:?}");
            recovered.says("no whole row");
            Vec::new()
        };
        assert!(std::fs::read(&part).unwrap() == left, "it stays as it is");
        assert!(
            found.len() >= 19 * told,
            "{} of {told} rows",
            found.len() / 19
        );
        println!(
            "{ending}: {told} rows were told, {} found",
            found.len() / 19
        );
        let (short, long) = if found.len() > longest.len() {
            (&longest, &found)
        } else {
            (&found, &longest)
        };
        assert!(long.starts_with(short), "other rows");
        if round < 2 && recovered.code == Some(0) {
            std::fs::remove_file(&file).unwrap();
            again(folder.path(), &file, &part);
        }
        if found.len() > longest.len() {
            longest = found;
        }
        std::fs::remove_file(&part).unwrap_or_default();
        std::fs::remove_file(&file).unwrap_or_default();
    }
    assert!(!longest.is_empty());
}

/// The obvious second try.
fn again(folder: &Path, file: &Path, part: &Path) {
    let left = std::fs::read(part).unwrap();
    let name = file.file_name().unwrap().to_str().unwrap();
    let own = ["board", "record", name, "--host", "--seconds", "1"];
    let refused = massline(folder, own);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    for words in [".part: holds the rows", "massline recover", "--force"] {
        refused.says(words);
    }
    assert!(!file.exists() && std::fs::read(part).unwrap() == left);
    let forced = massline(folder, own.iter().chain(&["--force"]));
    assert_eq!(forced.code, Some(0), "{forced:?}");
    let aside = folder.join(format!("{name}.1.part"));
    let named = aside.file_name().unwrap().to_str().unwrap();
    forced.says(named);
    assert!(std::fs::read(&aside).unwrap() == left && !part.exists());
    // By a name of its own it is a recording.
    let own = ["recover", named, "--out", "kept.parquet", "--force"];
    assert_eq!(massline(folder, own).code, Some(0));
    let columns: Vec<&str> = Vec::new();
    Recording::open(&folder.join("kept.parquet"), &columns).unwrap();
}

//! Recordings whose program is killed: all rows that it had told of are in the recording, or
//! `massline recover` makes one of them.
#![cfg(unix)]

use massline::acquire::{Order, record};
use massline::device::{Client, ClientMemory, HostBox, HostBoxMemory, Port, PortError};
use massline::inputs::InputEntry;
use massline::journal::recover;
use massline::recording::Recording;
use massline::rig::{Inputs, Troubles};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// The file that this program is to record to, where it is the one that is killed.
const FILE: &str = "MASSLINE_KILLED_FILE";
/// Number of kills; the hundred of the project's goal take half a minute.
const KILLS: &str = "MASSLINE_KILLS";

fn inputs() -> (Inputs, Vec<InputEntry>) {
    let inputs = Inputs::fork(Troubles {
        kinds: Vec::new(),
        per_minute: 0.0,
        seed: 1,
    })
    .unwrap();
    let entry = |input: u8| InputEntry {
        input,
        channel: Some(inputs.channels()[usize::from(input)].clone()),
        certificate: inputs.certificates()[usize::from(input)].clone(),
    };
    let entries = [0, 3, 9, 17].map(entry).to_vec();
    (inputs, entries)
}

/// A box that has nothing to say now and then, as one whose samples take their time.
struct Halting<'m>(HostBox<'m>, u32);

impl Port for Halting<'_> {
    fn name(&self) -> String {
        self.0.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        self.1 += 1;
        // Not while it is asked for its settings.
        if self.1 > 10 && self.1.is_multiple_of(4) {
            return Ok(0);
        }
        self.0.receive(into, timeout)
    }

    fn patience(&self) -> Duration {
        self.0.patience()
    }

    fn seconds(&self) -> f64 {
        self.0.seconds()
    }
}

/// Records, and tells on stdout of the rows of which `record` tells.
fn record_to(file: &Path, seconds: f64) {
    let (inputs, entries) = inputs();
    let order = Order {
        inputs: entries,
        seconds: Some(seconds),
        file: file.to_owned(),
        firmware: None,
        replace: false,
    };
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(
        Halting(HostBox::with_inputs(&mut own, 1, inputs), 0),
        &mut memory,
    );
    record(&mut client, &order, &mut |progress| {
        let mut out = std::io::stdout();
        let told = (progress.seconds * 512.0).round() as u64;
        writeln!(out, "\ntold {told}")
            .and_then(|()| out.flush())
            .is_ok()
    })
    .unwrap();
}

/// The program that is killed: this one, with [`FILE`]. Else there is nothing to do.
#[test]
fn recorder() {
    if let Some(file) = std::env::var_os(FILE) {
        // Some end by themselves, and are killed while the recording is put together.
        let file = PathBuf::from(file);
        let long = file
            .file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with("long"));
        record_to(&file, if long { 1e5 } else { 20.0 });
    }
}

fn rows(file: &Path) -> Vec<[u32; 4]> {
    let (_, entries) = inputs();
    let names: Vec<String> = entries.iter().map(InputEntry::column).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut recording = Recording::open(file, &names).unwrap();
    let (mut rows, mut sample) = (Vec::new(), [0.0_f32; 4]);
    while recording.next_row(&mut sample).unwrap() {
        assert!(recording.health().is_good());
        rows.push(sample.map(f32::to_bits));
    }
    rows
}

#[test]
fn every_row_that_was_told_of_outlives_a_kill() {
    let kills = std::env::var(KILLS).map_or(12, |kills| kills.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut state = std::process::id().wrapping_mul(2_654_435_761);
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    let (mut recovered, mut whole, mut most) = (0, 0, 0);
    let mut found: Vec<Vec<[u32; 4]>> = Vec::new();
    for kill in 0..kills {
        let length = ["long", "short"][usize::from(kill % 3 == 2)];
        let ending = ["parquet", "csv"][usize::from(kill % 4 == 3)];
        let file = folder.path().join(format!("{length}-{kill}.{ending}"));
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["recorder", "--exact", "--nocapture"])
            .env(FILE, &file)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        let reader = std::thread::spawn(move || {
            let told = lines.lines().map_while(Result::ok);
            let told = told.filter_map(|line| line.strip_prefix("told ")?.parse().ok());
            told.max().unwrap_or(0_usize)
        });
        std::thread::sleep(Duration::from_micros(u64::from(random() % 300_000)));
        // SIGKILL on this system; it may be done already.
        child.kill().unwrap();
        child.wait().unwrap();
        let told = reader.join().unwrap();
        let part = folder.path().join(format!("{length}-{kill}.{ending}.part"));
        let rows = if file.exists() {
            whole += 1;
            rows(&file)
        } else if told == 0 && recover(&part, None, false).is_err() {
            Vec::new()
        } else {
            recovered += 1;
            let made = recover(&part, None, false).map_or_else(
                |error| {
                    if file.exists() {
                        file.clone()
                    } else {
                        panic!("{error}")
                    }
                },
                |made| made.file,
            );
            rows(&made)
        };
        assert!(
            rows.len() >= told,
            "{} of {told} rows that were told of",
            rows.len()
        );
        most = most.max(told);
        found.push(rows);
    }
    // The box says the same each time: what was recorded is the beginning of the longest recording.
    let longest = found.iter().max_by_key(|rows| rows.len()).unwrap();
    for rows in &found {
        assert!(rows[..] == longest[..rows.len()], "other rows");
    }
    println!("{kills} kills: {recovered} recovered, {whole} whole, up to {most} rows told of");
    assert!(recovered > 0, "every recording was whole or empty");
}

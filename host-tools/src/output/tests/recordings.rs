//! Recordings that grow: none of the rows that somebody was told of is lost, and no recording is
//! replaced by less than another one.

use super::{Files, files, restore, unfinished};
use crate::acquire::{AcquireError, Order, Progress, Recorded, record};
use crate::device::{Client, ClientMemory, HostBox, HostBoxMemory, Port, PortError};
use crate::inputs::InputEntry;
use crate::journal::recover;
use crate::output::OutputError;
use crate::output::faults::{self, Fault};
use crate::output::operation::Operation;
use crate::recording::Recording;
use crate::rig::{Inputs, Troubles};
use massline_firmware::wire::Health;
use std::path::Path;
use std::time::Duration;

/// Samples per second of the box in this program.
const RATE: f64 = 512.0;

fn inputs() -> (Inputs, Vec<InputEntry>) {
    let none = Troubles {
        kinds: Vec::new(),
        per_minute: 0.0,
        seed: 1,
    };
    let inputs = Inputs::fork(none).unwrap();
    let entry = |input: u8| InputEntry {
        input,
        channel: Some(inputs.channels()[usize::from(input)].clone()),
        certificate: inputs.certificates()[usize::from(input)].clone(),
    };
    let entries = [0, 3, 9, 17].map(entry).to_vec();
    (inputs, entries)
}

/// A box that has nothing to say now and then, so that there is time to tell how far a recording
/// is.
struct Halting<'m> {
    port: HostBox<'m>,
    receives: u32,
}

impl Port for Halting<'_> {
    fn name(&self) -> String {
        self.port.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        self.receives += 1;
        // Not while it is asked for its settings.
        if self.receives > 10 && self.receives.is_multiple_of(4) {
            return Ok(0);
        }
        self.port.receive(into, timeout)
    }

    fn patience(&self) -> Duration {
        self.port.patience()
    }

    fn seconds(&self) -> f64 {
        self.port.seconds()
    }
}

/// Records from the box in this program, and the rows that it was told of.
fn recorded(file: &Path, replace: bool, seconds: f64) -> (Result<Recorded, AcquireError>, usize) {
    recorded_while(file, replace, seconds, &mut |_| true)
}

fn recorded_while(
    file: &Path,
    replace: bool,
    seconds: f64,
    watch: &mut dyn FnMut(&Progress<'_>) -> bool,
) -> (Result<Recorded, AcquireError>, usize) {
    let (inputs, entries) = inputs();
    let order = Order {
        inputs: entries,
        seconds: Some(seconds),
        file: file.to_owned(),
        replace,
        firmware: None,
    };
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let port = Halting {
        port: HostBox::with_inputs(&mut own, 1, inputs),
        receives: 0,
    };
    let mut client = Client::new(port, &mut memory);
    let mut told = 0;
    let result = record(&mut client, &order, &mut |progress| {
        told = (progress.seconds * RATE).round() as usize;
        watch(progress)
    });
    (result, told)
}

/// The whole rows of a recording, or of what is to become one.
fn rows(bytes: &[u8]) -> Vec<&str> {
    let text = std::str::from_utf8(bytes).unwrap();
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let lines = whole.lines().filter(|line| !line.starts_with('#'));
    lines.skip(1).collect()
}

const FILE: &str = "x.csv";
const PART: &str = "x.csv.part";
const ASIDE: &str = "x.csv.1.part";

/// Everything that is said of a fault while `x.csv` is recorded over an older one.
fn check(old: &Files, new: &Files, fault: Fault, at: usize, folder: &Path) {
    restore(folder, old);
    let file = folder.join(FILE);
    let done = faults::with(at, fault, || recorded(&file, true, 1.0));
    let (result, told) = done.value;
    let operation = done.seen[at].0;
    let place = format!("{fault:?} at {at}, {operation:?}");
    let now = files(folder);
    let all = rows(&new[FILE]);
    // Whole as a file, if not as long as it was to be.
    let own = now[FILE].strip_prefix(b"# massline recording 1\n");
    let own = own.filter(|_| now[FILE].ends_with(b"\n")).map(rows);
    let is_new = own.as_ref().is_some_and(|own| match &result {
        Ok(recorded) => own.len() as u64 == recorded.samples,
        // It was in its place already.
        Err(_) => *own == all,
    });
    assert!(
        is_new || now[FILE] == old[FILE],
        "{place}: neither old nor new"
    );
    // All that somebody was told of is there, in the recording or where it grew.
    let kept = now.get(PART).map_or(Vec::new(), |part| rows(part));
    let found = if is_new {
        own.unwrap_or_default()
    } else {
        kept
    };
    assert!(found.len() >= told, "{place}: {} of {told}", found.len());
    assert!(found[..] == all[..found.len()], "{place}: other rows");
    match &result {
        Ok(recorded) => {
            assert!(is_new, "{place}");
            // Rows that were there before the fault are a recording, if only a shorter one.
            let left_over = recorded.left_over.is_some();
            assert_eq!(left_over, now.contains_key(PART), "{place}");
            assert!(!left_over || operation == Operation::Remove, "{place}");
        }
        Err(error) => {
            let text = error.to_string();
            let advised = text.contains("make room") || text.contains("choose another place");
            assert!(text.contains(FILE) && advised, "{place}: {text}");
            // An end of a line would show as what stands for one.
            assert!(!text.contains('\n'), "{place}: {text}");
            let keeps = matches!(error, AcquireError::Kept { .. });
            assert_eq!(keeps, text.contains("kept in"), "{place}: {text}");
            if fault != Fault::Killed {
                assert_eq!(keeps, now.contains_key(PART), "{place}: {text}");
                assert!(keeps || told == 0, "{place}: {text}");
            }
        }
    }
    if fault != Fault::Killed {
        assert!(unfinished(&now).is_empty(), "{place}");
    }
    let Some(part) = now.get(PART) else {
        return;
    };
    // The next one says that there is something, and leaves it alone.
    std::fs::remove_file(&file).unwrap();
    let refused = recorded(&file, false, 0.1).0.unwrap_err();
    let unfinished = matches!(
        refused,
        AcquireError::Output(OutputError::Unfinished { .. })
    );
    assert!(unfinished, "{place}: {refused}");
    assert_eq!(&std::fs::read(folder.join(PART)).unwrap(), part);
    // The one that is told to, sets it aside, and says so.
    let forced = recorded(&file, true, 0.1).0.unwrap();
    assert_eq!(forced.set_aside, Some(folder.join(ASIDE)), "{place}");
    let after = files(folder);
    assert_eq!(&after[ASIDE], part, "{place}");
    let names: Vec<&str> = after.keys().map(String::as_str).collect();
    assert_eq!(names, [FILE, ASIDE], "{place}: something is left");
}

#[test]
fn at_every_operation_the_rows_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = folder.join(FILE);
    let old: Files = [(FILE.to_owned(), b"an older recording\n".to_vec())].into();
    restore(folder, &old);
    let clean = faults::with(usize::MAX, Fault::Error, || recorded(&file, true, 1.0));
    let (result, told) = clean.value;
    assert_eq!((result.unwrap().samples, told), (512, 512));
    let new = files(folder);
    assert_eq!(new.len(), 1);
    for fault in [Fault::Full, Fault::Error, Fault::Killed] {
        for at in 0..clean.seen.len() {
            check(&old, &new, fault, at, folder);
        }
    }
}

#[test]
fn rows_that_somebody_is_told_of_are_with_the_system() {
    let folder = tempfile::tempdir().unwrap();
    for name in [FILE, "x.csv.gz"] {
        let file = folder.path().join(name);
        let part = folder.path().join(format!("{name}.part"));
        let mut looks = 0;
        recorded_while(&file, false, 5.0, &mut |progress| {
            let told = (progress.seconds * RATE).round() as usize;
            let found = rows(&std::fs::read(&part).unwrap()).len();
            assert_eq!(found, told);
            looks += usize::from(told > 0);
            true
        })
        .0
        .unwrap();
        assert!(looks > 5, "{looks}");
    }
}

/// A power cut takes what the disk was not told to hold.
#[test]
fn once_a_second_the_disk_is_told_to_hold_all_rows() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(FILE);
    let part = folder.path().join(PART);
    let seconds = 6_u32;
    let record = || recorded(&file, true, f64::from(seconds)).0;
    let clean = faults::with(usize::MAX, Fault::Error, record);
    assert_eq!(clean.value.unwrap().samples, u64::from(seconds) * 512);
    let told = |(_, (operation, path)): &(usize, &(Operation, _))| {
        *operation == Operation::Sync && *path == part
    };
    let seen = clean.seen.iter().enumerate();
    let syncs: Vec<usize> = seen.filter(told).map(|(at, _)| at).collect();
    // The last second is told of with the whole recording.
    assert_eq!(syncs.len(), seconds as usize - 1);
    for (k, at) in syncs.into_iter().enumerate() {
        std::fs::remove_file(&file).unwrap_or_default();
        // With the system by then, and nothing beyond.
        let _ = faults::with(at, Fault::Killed, record);
        assert_eq!(rows(&std::fs::read(&part).unwrap()).len(), 512 * (k + 1));
        std::fs::remove_file(&part).unwrap();
    }
    // The name of the rows, before the first of them.
    let named = |(operation, path): &(Operation, _)| {
        *operation == Operation::Sync && *path == folder.path()
    };
    assert!(clean.seen.iter().position(named) < clean.seen.iter().position(|(_, p)| *p == file));
}

#[test]
fn two_programs_do_not_record_to_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(FILE);
    let mut tried = 0;
    let (first, _) = recorded_while(&file, false, 1.0, &mut |_| {
        if tried == 0 {
            for force in [false, true] {
                let second = recorded(&file, force, 0.1).0.unwrap_err();
                let in_use = matches!(second, AcquireError::Output(OutputError::InUse { .. }));
                assert!(in_use, "{second}");
            }
        }
        tried += 1;
        true
    });
    assert_eq!(first.unwrap().samples, 512);
    assert_eq!(rows(&std::fs::read(&file).unwrap()).len(), 512);
}

/// All rows of a recording: the bits of its readings, and its faults.
fn numbers(file: &Path) -> Vec<(Vec<u32>, Health)> {
    let channels: Vec<String> = inputs().1.iter().map(InputEntry::column).collect();
    let names: Vec<&str> = channels.iter().map(String::as_str).collect();
    let mut recording = Recording::open(file, &names).unwrap();
    let mut sample = vec![0.0; names.len()];
    let mut rows = Vec::new();
    while recording.next_row(&mut sample).unwrap() {
        let bits = sample.iter().map(|x| x.to_bits()).collect();
        rows.push((bits, recording.health()));
    }
    rows
}

#[test]
fn parquet_and_csv_hold_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let [text, columns] = ["x.csv", "x.parquet"].map(|name| {
        let file = folder.path().join(name);
        assert_eq!(recorded(&file, false, 2.0).0.unwrap().samples, 1024);
        numbers(&file)
    });
    assert_eq!(text.len(), 1024);
    assert_eq!(text, columns);
}

/// A journal in the place of lines: at every operation all rows that somebody was told of are in the
/// recording, or `recover` makes one of them.
#[test]
fn at_every_operation_the_rows_of_a_journal_can_be_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = folder.join("x.parquet");
    let part = folder.join("x.parquet.part");
    let clean = faults::with(usize::MAX, Fault::Error, || recorded(&file, true, 1.0));
    assert_eq!(clean.value.0.unwrap().samples, 512);
    let all = numbers(&file);
    let old: Files = [("x.parquet".to_owned(), b"an older recording\n".to_vec())].into();
    for fault in [Fault::Full, Fault::Error, Fault::Killed] {
        for at in 0..clean.seen.len() {
            restore(folder, &old);
            let done = faults::with(at, fault, || recorded(&file, true, 1.0));
            let (result, told) = done.value;
            let place = format!("{fault:?} at {at}, {:?}: {result:?}", done.seen[at]);
            let now = files(folder);
            let is_new = now["x.parquet"] != old["x.parquet"];
            // As lines: a recording that was placed is whole.
            assert!(result.is_err() || is_new, "{place}");
            let found = if is_new {
                numbers(&file)
            } else if part.exists() {
                let recovered = folder.join("recovered.parquet");
                match recover(&part, Some(&recovered), true) {
                    Ok(found) => {
                        assert_eq!(found.lost.bytes, 0, "{place}");
                        numbers(&recovered)
                    }
                    Err(error) => {
                        assert!(told == 0, "{place}: {error}");
                        Vec::new()
                    }
                }
            } else {
                Vec::new()
            };
            assert!(found.len() >= told, "{place}: {} of {told}", found.len());
            assert!(found[..] == all[..found.len()], "{place}: other rows");
            if let Err(error) = result {
                let text = error.to_string();
                let advised = text.contains("make room") || text.contains("choose another place");
                assert!(text.contains("x.parquet") && advised, "{place}");
                let keeps = matches!(error, AcquireError::Kept { .. });
                assert_eq!(keeps, text.contains("`massline recover "), "{place}");
            }
        }
    }
}

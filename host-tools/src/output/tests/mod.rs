//! The old file or the whole new one, whatever fails.
//!
//! Each command that writes is run once for every operation that it has the file system do, and
//! every fault that this operation can meet.

mod commands;
mod recordings;

use super::faults::{self, Fault};
use super::operation::Operation;
use crate::commands::Failure;
use std::collections::BTreeMap;
use std::path::Path;

/// Files of a folder and their content.
type Files = BTreeMap<String, Vec<u8>>;

fn files(folder: &Path) -> Files {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, std::fs::read(entry.path()).unwrap())
        })
        .collect()
}

/// Makes a folder hold these files and no others.
fn restore(folder: &Path, old: &Files) {
    for name in files(folder).keys() {
        std::fs::remove_file(folder.join(name)).unwrap();
    }
    for (name, bytes) in old {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

/// Names of a folder's files that wait for their place.
fn unfinished(files: &Files) -> Vec<&String> {
    let ours = |name: &&String| name.ends_with(super::UNFINISHED);
    files.keys().filter(ours).collect()
}

/// State of a folder after a fault.
struct Left<'a> {
    fault: Fault,
    /// The operation that met it.
    operation: Operation,
    result: Result<(), Failure>,
    old: &'a Files,
    new: &'a Files,
    now: Files,
}

/// Runs a command on a folder with every fault at every operation of those that are `chosen`.
/// Holds for all commands; `look` adds checks of this one.
fn at_steps(
    folder: &Path,
    targets: &[&str],
    chosen: impl Fn(Operation, &Path) -> bool,
    command: impl Fn() -> Result<(), Failure>,
    mut look: impl FnMut(&Left<'_>),
) {
    let old = files(folder);
    let clean = faults::with(usize::MAX, Fault::Error, &command);
    clean.value.unwrap();
    let new = files(folder);
    assert!(unfinished(&new).is_empty(), "{:?}", new.keys());
    // A file takes five operations: it is made, written, synced and renamed, and its folder is
    // synced.
    let fewest = 5 * targets.len();
    assert!(clean.seen.len() >= fewest, "{:?}", clean.seen);
    for fault in [Fault::Full, Fault::Error, Fault::Killed] {
        for (at, (operation, path)) in clean.seen.iter().enumerate() {
            if !chosen(*operation, path) {
                continue;
            }
            restore(folder, &old);
            let done = faults::with(at, fault, &command);
            let left = Left {
                fault,
                operation: *operation,
                result: done.value,
                old: &old,
                new: &new,
                now: files(folder),
            };
            let place = format!("{fault:?} at {at}, {operation:?}");
            left.check(targets, &place);
            look(&left);
            if fault == Fault::Killed {
                // The next one takes away what it left.
                command().unwrap();
                assert!(files(folder) == new, "{place}: the next one differs");
            }
        }
    }
    restore(folder, &new);
}

impl Left<'_> {
    fn check(&self, targets: &[&str], place: &str) {
        for name in self.old.keys().chain(self.new.keys()) {
            let now = self.now.get(name);
            let is_target = targets.contains(&name.as_str());
            let is_new = is_target && now == self.new.get(name);
            assert!(
                is_new || now == self.old.get(name),
                "{place}: {name} has {:?} bytes, neither the old nor the new file",
                now.map(Vec::len)
            );
        }
        match &self.result {
            Ok(()) => {
                let full = self.fault == Fault::Full;
                // A renaming or removing on a full disk goes well, and half a write is followed
                // by the other half where only one is held up.
                assert!(
                    full || self.operation == Operation::Write,
                    "{place}: the fault passed unseen"
                );
                assert!(self.now == *self.new, "{place}: not what it should be");
            }
            Err(failure) => {
                assert_eq!(failure.code, 2, "{place}");
                let text = &failure.message;
                let named = targets.iter().any(|name| text.contains(name));
                assert!(named, "{place}: {text}");
                let advised = text.contains("make room") || text.contains("choose another place");
                assert!(advised, "{place}: {text}");
            }
        }
        if self.fault != Fault::Killed {
            let unfinished = unfinished(&self.now);
            assert!(unfinished.is_empty(), "{place}: {unfinished:?}");
        }
        let known = |name: &&String| self.old.contains_key(*name) || self.new.contains_key(*name);
        let strange = self.now.keys().filter(|name| !known(name));
        let strange: Vec<&String> = strange.collect();
        assert_eq!(strange, unfinished(&self.now), "{place}");
    }
}

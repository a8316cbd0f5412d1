//! Files that this program writes: the old one or the whole new one, never less.
//!
//! | file | holds |
//! | --- | --- |
//! | `place` | where a path leads: to a regular file, a device, or a stream that is open already |
//! | `guard` | which files may not be written over: inputs, and what others made |
//! | `part` | rows of a recording that grows, and what a killed program left of one |
//! | `disk` | the few operations on the file system that all of this is made of |
//! | `operation` | these operations by name |
//! | `faults` | has any of those operations fail, for tests |
//!
//! # Design
//!
//! A file is written beside its place under a name that ends in `.massline-tmp`, handed to the
//! disk (`fsync`), and renamed; then the folder is handed to the disk. Until the rename the old
//! file is untouched, from then on the new one is there as a whole. Whatever fails before that
//! removes the file beside it. A program that is killed cannot: what it left is known by its
//! name and by the lock that nobody holds any more, and the next one that writes the same file
//! removes it.
//!
//! * A symbolic link is followed: the file that it leads to is replaced, the link stays.
//! * The new file has the permissions of the old one, and its owner and group where the system
//!   lets this user set them. A file that this user may not write is not replaced. Other hard
//!   links to the old file keep the old content.
//! * What is no regular file, such as `/dev/null` or a named pipe, is written directly: nothing
//!   is renamed over it. `/dev/stdout` and `/dev/stderr` are this program's own streams.

mod disk;
mod error;
#[cfg(test)]
pub(crate) mod faults;
mod guard;
mod operation;
mod part;
mod place;
#[cfg(test)]
mod tests;

pub(crate) use disk::is_in_use;
pub use error::OutputError;
pub(crate) use guard::{Existing, check, same_file};
pub(crate) use part::{GROWING, Part, part_of};

use disk::Handle;
use place::Place;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Ending of the name of a file that is not in its place yet.
const UNFINISHED: &str = ".massline-tmp";
/// Bytes that are handed to the system at a time.
const BUFFER: usize = 64 << 10;
/// Names that are tried before it is given up to find a free one.
const TRIES: u32 = 100;

/// Writes a file as a whole, its folder included.
///
/// # Errors
/// [`OutputError`] that names the file; then the old one is as it was.
pub(crate) fn write(file: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut output = Output::create(file)?;
    let written = output.write_all(bytes);
    written.map_err(|source| OutputError::write(file, source))?;
    output.finish()?.place()
}

/// A file on its way to its place. It is removed if it does not get there.
pub(crate) struct Output {
    /// As the user named it.
    file: PathBuf,
    to: To,
}

enum To {
    /// A regular file, by way of one beside it.
    File {
        rows: BufWriter<Handle>,
        beside: Beside,
    },
    /// A device, pipe or stream, which is written directly.
    Stream(Box<dyn Write + Send>),
}

/// A file beside its place, and how to get rid of it.
struct Beside {
    path: PathBuf,
    target: PathBuf,
    placed: bool,
}

impl Drop for Beside {
    fn drop(&mut self) {
        if !self.placed {
            // What remains is known by its name: see `sweep`.
            let _ = disk::remove(&self.path);
        }
    }
}

/// A file that is whole and on the disk, but not in its place yet.
pub(crate) struct Ready {
    file: PathBuf,
    /// With its handle, whose lock says that it is in use.
    beside: Option<(Beside, Handle)>,
}

impl Output {
    /// Begins a file. Its folder is made if it is missing.
    ///
    /// # Errors
    /// [`OutputError`] if there can be no such file.
    pub(crate) fn create(file: &Path) -> Result<Self, OutputError> {
        let refused = |source| OutputError::write(file, source);
        let to = match place::find(file).map_err(refused)? {
            Place::Stream(stream) => To::Stream(stream),
            Place::File { target, old } => {
                let folder = place::folder(&target);
                disk::create_folders(folder)
                    .map_err(|source| OutputError::write(folder, source))?;
                sweep(&target);
                let (handle, path) = begin(&target).map_err(refused)?;
                let beside = Beside {
                    path,
                    target,
                    placed: false,
                };
                if let Some(old) = old {
                    handle.be_like(&old).map_err(refused)?;
                }
                To::File {
                    rows: BufWriter::with_capacity(BUFFER, handle),
                    beside,
                }
            }
        };
        Ok(Self {
            file: file.to_owned(),
            to,
        })
    }

    /// Hands it to the disk.
    ///
    /// # Errors
    /// [`OutputError`]; the old file is as it was.
    pub(crate) fn finish(self) -> Result<Ready, OutputError> {
        let Self { file, to } = self;
        let done = match to {
            To::File { rows, beside } => match rows.into_inner() {
                Ok(handle) => handle.sync().map(|()| Some((beside, handle))),
                Err(error) => Err(error.into_error()),
            },
            To::Stream(mut stream) => stream.flush().map(|()| None),
        };
        match done {
            Ok(beside) => Ok(Ready { file, beside }),
            Err(source) => Err(OutputError::write(&file, source)),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.to {
            To::File { rows, .. } => rows.write(bytes),
            To::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.to {
            To::File { rows, .. } => rows.flush(),
            To::Stream(stream) => stream.flush(),
        }
    }
}

impl Ready {
    /// Puts it in its place, where it replaces the old one.
    ///
    /// # Errors
    /// [`OutputError`]; the old file is as it was, or the new one is there as a whole.
    pub(crate) fn place(self) -> Result<(), OutputError> {
        let Self { file, beside } = self;
        let Some((mut beside, _in_use)) = beside else {
            return Ok(());
        };
        disk::rename(&beside.path, &beside.target)
            .and_then(|()| {
                beside.placed = true;
                disk::sync_folder(place::folder(&beside.target))
            })
            .map_err(|source| OutputError::write(&file, source))
    }
}

/// A new file beside a place, under a name that no other program uses.
fn begin(target: &Path) -> io::Result<(Handle, PathBuf)> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let mut last = io::Error::from(io::ErrorKind::AlreadyExists);
    for _ in 0..TRIES {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!(
            "{}{}-{count}{UNFINISHED}",
            prefix(target),
            std::process::id()
        );
        let path = target.with_file_name(name);
        match disk::create_new(&path) {
            Ok(handle) => return Ok((handle, path)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => last = error,
            Err(error) => return Err(error),
        }
    }
    Err(last)
}

/// Beginning of the names of files beside a place. It is cut: file systems take 255 bytes.
fn prefix(target: &Path) -> String {
    const LONGEST: usize = 50;
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let mut prefix: String = name.chars().take(LONGEST).collect();
    prefix.push('.');
    prefix
}

/// Removes what killed programs left beside a place. What cannot be removed does no harm.
fn sweep(target: &Path) {
    let Ok(entries) = std::fs::read_dir(place::folder(target)) else {
        return;
    };
    let prefix = prefix(target);
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let number = name
            .strip_prefix(&prefix)
            .and_then(|rest| rest.strip_suffix(UNFINISHED));
        let ours = number.is_some_and(|n| n.chars().all(|c| c.is_ascii_digit() || c == '-'));
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if ours && is_file && disk::is_in_use(&entry.path()) == Some(false) {
            let _ = disk::remove(&entry.path());
        }
    }
}

//! Why a file is not written.

use std::io;
use std::path::{Path, PathBuf};

/// Why a file is not written: which one, why, and what to do about it. What was there before
/// is as it was, except where a message says otherwise.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The file system refuses.
    #[error("{}: cannot be written: {source}; {}", file.display(), advice(source))]
    Write {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// It is read by the same command.
    #[error(
        "{}: this file is read by the same command, as {}, and would be lost; choose another \
         name for what is written", file.display(), input.display()
    )]
    Input {
        /// The file, as it was to be written.
        file: PathBuf,
        /// The same file, as it is read.
        input: PathBuf,
    },
    /// There is such a file, and this program has no business with it.
    #[error(
        "{}: is there already{why}; choose another name, or replace it by --force",
        file.display()
    )]
    Present {
        /// The file.
        file: PathBuf,
        /// Why it is not replaced, or nothing where no file is.
        why: &'static str,
    },
    /// Rows of a recording that a killed program could not finish.
    #[error(
        "{}: holds the rows ({bytes} bytes) of a recording to {} that was not finished; make it a \
         recording by `massline recover {}` and move it away, or have it set aside by --force",
        part.display(), file.display(), part.display()
    )]
    Unfinished {
        /// The rows.
        part: PathBuf,
        /// The file that they were to become.
        file: PathBuf,
        /// Number of bytes.
        bytes: u64,
    },
    /// Another program is at it.
    #[error(
        "{}: another massline is recording to it; let it finish, or choose another name",
        file.display()
    )]
    InUse {
        /// The file.
        file: PathBuf,
    },
    /// A recording to something that keeps nothing.
    #[error(
        "{}: this is no regular file, and a recording needs one: what stands above its rows is \
         known at its end only; choose another name", file.display()
    )]
    NotRegular {
        /// The device or pipe.
        file: PathBuf,
    },
}

impl OutputError {
    pub(crate) fn write(file: &Path, source: io::Error) -> Self {
        Self::Write {
            file: file.to_owned(),
            source,
        }
    }
}

/// Advice on a refusal of the file system.
pub(crate) fn advice(source: &io::Error) -> &'static str {
    use io::ErrorKind as Kind;
    match source.kind() {
        Kind::StorageFull | Kind::QuotaExceeded | Kind::FileTooLarge => {
            "make room on the disk, or choose another place for it"
        }
        Kind::ReadOnlyFilesystem | Kind::PermissionDenied => {
            "ask for the permission to write there, or choose another place for it"
        }
        Kind::IsADirectory => "this is a folder: add a file name, or choose another place for it",
        _ => "choose another place for it",
    }
}

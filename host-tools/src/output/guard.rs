//! Files that may not be written over.

use super::OutputError;
use super::place::{End, follow};
use crate::report::page::MADE_BY;
use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::Path;

/// Permission to replace a file that is there already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Existing {
    /// It may be replaced: the user said so.
    Replace,
    /// It is left alone.
    Keep,
    /// It may be replaced if it is a report that this program made.
    KeepUnlessReport,
    /// It is left alone, for nothing in its folder says that this program simulated it.
    KeepUnlessSimulated,
}

impl Existing {
    /// [`Existing::Replace`] with `--force`, else unchanged.
    pub(crate) const fn or_force(self, force: bool) -> Self {
        if force { Self::Replace } else { self }
    }
}

/// First bytes of a report, among which the mark of this program stands.
const REPORT_HEAD: usize = 1024;

/// Checks that a file may be written: it is none of `inputs`, under whatever name, and no file
/// is there that has to stay. To be called before the work that the file is the result of.
///
/// # Errors
/// [`OutputError::Input`], [`OutputError::Present`]; [`OutputError::Write`] of a folder.
pub(crate) fn check<'i>(
    file: &Path,
    inputs: impl IntoIterator<Item = &'i Path>,
    existing: Existing,
) -> Result<(), OutputError> {
    for input in inputs {
        if same_file(file, input) {
            return Err(OutputError::Input {
                file: file.to_owned(),
                input: input.to_owned(),
            });
        }
    }
    if fs::metadata(file).is_ok_and(|found| found.is_dir()) {
        return Err(OutputError::Write {
            file: file.to_owned(),
            source: ErrorKind::IsADirectory.into(),
        });
    }
    let why = match existing {
        Existing::Replace => return Ok(()),
        Existing::Keep => "",
        Existing::KeepUnlessReport if is_report(file) => return Ok(()),
        Existing::KeepUnlessReport => ", and it is no report of this program",
        Existing::KeepUnlessSimulated => ", and this folder holds no test that was simulated",
    };
    // An empty file is nobody's work: it was made to hold what comes. A device keeps nothing.
    let kept = |end: End| matches!(end, End::Found(_, found) if found.is_file() && found.len() > 0);
    if follow(file).is_ok_and(kept) {
        return Err(OutputError::Present {
            file: file.to_owned(),
            why,
        });
    }
    Ok(())
}

/// `true` if a file is a report that this program made.
fn is_report(file: &Path) -> bool {
    // A pipe would wait for somebody to write.
    if !fs::metadata(file).is_ok_and(|found| found.is_file()) {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(file).and_then(|f| f.take(REPORT_HEAD as u64).read_to_end(&mut head));
    let mark = MADE_BY.as_bytes();
    read.is_ok() && head.windows(mark.len()).any(|bytes| bytes == mark)
}

/// `true` if two paths lead to one regular file, by symbolic or by hard links.
pub(crate) fn same_file(a: &Path, b: &Path) -> bool {
    let (Ok(of_a), Ok(of_b)) = (fs::metadata(a), fs::metadata(b)) else {
        return false;
    };
    if !of_a.is_file() || !of_b.is_file() {
        return false;
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        (of_a.dev(), of_a.ino()) == (of_b.dev(), of_b.ino())
    }
    #[cfg(not(unix))]
    {
        matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
    }
}

//! A recording while it grows.
//!
//! The preamble above a recording's header is known at its end only, the true sample rate for
//! one. So rows go to a file beside it, whose name ends in `.part`; at the end the preamble and
//! they become the recording, which is in its place as a whole or not at all. If this program
//! dies before, the rows are there: a recording without a preamble. Those that were flushed are
//! all there, however it dies; the last line may be cut. Once a second the disk is to hold what
//! came up to then, so that a power cut takes no more than two, or twice the time that the disk
//! takes for it if that is longer than a second.

use super::AcquireError;
use crate::output::{self, Existing, Output, OutputError, Part};
use crate::recording::{HEALTH_COLUMN, Preamble, field, spell};
use flate2::Compression;
use flate2::write::GzEncoder;
use massline_firmware::wire::Health;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A recording while it grows.
pub(super) struct Growing {
    file: PathBuf,
    /// `true` if a file of that name may be replaced.
    replace: bool,
    part: Part,
    line: String,
    /// Rows that the disk was not told to hold.
    unsynced: u64,
    /// As many as there may be: a second's.
    every: u64,
}

impl Growing {
    /// Begins a recording of these channels, which have so many samples a second. Its folder is
    /// made if it is missing.
    ///
    /// # Errors
    /// [`AcquireError::Output`] if there can be no such file, or if it would take the place of
    /// what another recording has left.
    pub(super) fn create(
        file: &Path,
        channels: &[String],
        rate: f64,
        replace: bool,
    ) -> Result<Self, AcquireError> {
        let part = Part::begin(file, replace)?;
        let mut growing = Self {
            file: file.to_owned(),
            replace,
            part,
            line: String::new(),
            unsynced: 0,
            every: (rate as u64).max(1),
        };
        let mut header: Vec<String> = channels.iter().map(|name| field(name)).collect();
        header.push(HEALTH_COLUMN.to_owned());
        growing.line = header.join(",");
        let begun = growing.end_line().and_then(|()| growing.flush());
        let named = |growing: &Self| {
            let named = growing.part.sync_name();
            named.map_err(|source| growing.refused(source))
        };
        let begun = begun.and_then(|()| named(&growing));
        if begun.is_err() {
            growing.discard();
        }
        begun.map(|()| growing)
    }

    /// New path of the rows of an earlier recording that were in the way.
    pub(super) fn set_aside(&self) -> Option<&Path> {
        self.part.set_aside()
    }

    /// Adds a row; once a second the disk is told before to hold those that there are. A sample
    /// that never came has no readings.
    ///
    /// # Errors
    /// [`AcquireError::Output`] if the file system takes no more; then it is not added.
    pub(super) fn row(&mut self, si: &[f32], health: Health) -> Result<(), AcquireError> {
        if self.unsynced >= self.every {
            let wanted = self.part.sync_behind();
            wanted.map_err(|source| self.refused(source))?;
            self.unsynced = 0;
        }
        self.line.clear();
        for x in si {
            if !health.contains(Health::MISSING) {
                // The shortest text that reads back to the same number. Writing to a String
                // cannot fail.
                let _ = write!(self.line, "{x:?}");
            }
            self.line.push(',');
        }
        if !health.is_good() {
            self.line.push_str(&spell(health));
        }
        self.end_line()?;
        self.unsynced += 1;
        Ok(())
    }

    /// Hands all rows to the system, so that they outlive this program. To be called before
    /// anybody is told of them.
    ///
    /// # Errors
    /// [`AcquireError::Output`] if the file system does not take them.
    pub(super) fn flush(&mut self) -> Result<(), AcquireError> {
        let flushed = self.part.flush();
        flushed.map_err(|source| self.refused(source))
    }

    fn end_line(&mut self) -> Result<(), AcquireError> {
        self.line.push('\n');
        // The buffer, which is longer than any line, takes one as a whole or not at all, and
        // keeps what the system did not take: no later line follows a part of one.
        let written = self.part.write_all(self.line.as_bytes());
        written.map_err(|source| self.refused(source))
    }

    fn refused(&self, source: io::Error) -> AcquireError {
        OutputError::write(self.part.path(), source).into()
    }

    /// Makes it a recording. Where its rows still are, if they could not be removed.
    ///
    /// # Errors
    /// [`AcquireError::Kept`]; the rows are where they were, and so is a recording that was to
    /// be replaced.
    pub(super) fn finish(&mut self, preamble: &Preamble) -> Result<Option<PathBuf>, AcquireError> {
        self.join(preamble).map_err(|source| AcquireError::Kept {
            part: self.part.path().to_owned(),
            source,
        })?;
        let removed = self.part.remove();
        Ok(removed.err().map(|_| self.part.path().to_owned()))
    }

    fn join(&mut self, preamble: &Preamble) -> Result<(), OutputError> {
        // Nobody knows what has come there since the recording began.
        let existing = Existing::Keep.or_force(self.replace);
        output::check(&self.file, [], existing)?;
        let mut out = Output::create(&self.file)?;
        let zipped = self.file.extension();
        let copied = if zipped.is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
            let mut zip = GzEncoder::new(&mut out, Compression::default());
            let copied = self.copy(preamble, &mut zip);
            copied.and_then(|()| zip.try_finish())
        } else {
            self.copy(preamble, &mut out)
        };
        copied.map_err(|source| OutputError::write(&self.file, source))?;
        out.finish()?.place()
    }

    fn copy(&mut self, preamble: &Preamble, out: &mut dyn Write) -> io::Result<()> {
        preamble.write(out)?;
        io::copy(&mut self.part.reread()?, out)?;
        Ok(())
    }

    /// Throws it away: there is nothing in it that anybody wants.
    pub(super) fn discard(&mut self) {
        self.part.undo();
    }
}

//! A recording while it grows.
//!
//! The preamble above a recording's header is known at its end only, the true sample rate for
//! one, and so is the index of a Parquet file. So rows go to a file beside it, whose name ends in
//! `.part`: as lines of CSV, or to a journal ([`crate::journal`]). At the end they become the recording,
//! which is in its place as a whole or not at all. If this program dies before, the rows are there, and
//! `massline recover` makes a recording of them. Those that were flushed are all there, however it
//! dies; the last line or frame may be cut. Once a second the disk is to hold what came up to then, so
//! that a power cut takes no more than two, or twice the time that the disk takes for it if that is
//! longer than a second.

use super::AcquireError;
use crate::journal::{self, Journal};
use crate::output::{self, Existing, Output, OutputError, Part};
use crate::recording::{About, Line, Rows, TrueRate, Written};
use massline_firmware::wire::Health;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A recording while it grows.
pub(super) struct Growing {
    file: PathBuf,
    format: Written,
    /// `true` if a file of that name may be replaced.
    replace: bool,
    part: Part,
    form: Form,
    rows: u64,
    /// Rows that the disk was not told to hold.
    unsynced: u64,
    /// As many as there may be: a second's.
    every: u64,
}

/// Form of the rows while they are no recording.
enum Form {
    Lines(Line),
    Frames(Journal),
}

impl Growing {
    /// Begins a recording of which this is known, which has so many samples a second. Its folder is
    /// made if it is missing.
    ///
    /// # Errors
    /// [`AcquireError::Output`] if there can be no such file, or if it would take the place of
    /// what another recording has left.
    pub(super) fn create(
        file: &Path,
        about: &About,
        rate: f64,
        replace: bool,
    ) -> Result<Self, AcquireError> {
        let part = Part::begin(file, replace)?;
        let format = Written::of(file).unwrap_or(Written::Csv);
        let form = match format {
            Written::Csv | Written::PackedCsv => Form::Lines(Line::new(true)),
            Written::Parquet => Form::Frames(Journal::new(about)),
        };
        let mut growing = Self {
            file: file.to_owned(),
            format,
            replace,
            part,
            form,
            rows: 0,
            unsynced: 0,
            every: (rate as u64).max(1),
        };
        let begun = growing.begin(about);
        if begun.is_err() {
            growing.discard();
        }
        begun.map(|()| growing)
    }

    fn begin(&mut self, about: &About) -> Result<(), AcquireError> {
        if let Form::Lines(line) = &self.form {
            let mut header = Vec::new();
            let names = about.channels.iter().map(|c| c.name.as_str());
            line.header(names, &mut header);
            let written = self.part.write_all(&header);
            written.map_err(|source| self.refused(source))?;
        }
        self.flush()?;
        let named = self.part.sync_name();
        named.map_err(|source| self.refused(source))
    }

    /// New path of the rows of an earlier recording that were in the way.
    pub(super) fn set_aside(&self) -> Option<&Path> {
        self.part.set_aside()
    }

    /// Adds a row; once a second the disk is told before to hold those that there are, and the `rate`
    /// as far as it is known. A sample that never came has no readings.
    ///
    /// # Errors
    /// [`AcquireError::Output`] if the file system takes no more; then it is not added.
    pub(super) fn row(
        &mut self,
        si: &[f32],
        health: Health,
        rate: impl FnOnce() -> Option<TrueRate>,
    ) -> Result<(), AcquireError> {
        if self.unsynced >= self.every {
            if let Form::Frames(journal) = &mut self.form
                && let Some(rate) = rate()
            {
                journal.rate(&rate);
            }
            let wanted = self.hand_over().and_then(|()| self.part.sync_behind());
            wanted.map_err(|source| self.refused(source))?;
            self.unsynced = 0;
        }
        let written = match &mut self.form {
            // The buffer, which is longer than any line, takes one as a whole or not at all, and
            // keeps what the system did not take: no later line follows a part of one.
            Form::Lines(line) => self.part.write_all(line.of(si, health)),
            Form::Frames(journal) if journal.is_full() => journal.write_to(&mut self.part),
            Form::Frames(_) => Ok(()),
        };
        written.map_err(|source| self.refused(source))?;
        if let Form::Frames(journal) = &mut self.form {
            journal.row(si, health);
        }
        self.rows += 1;
        self.unsynced += 1;
        Ok(())
    }

    /// Hands what is in the making to the buffer.
    fn hand_over(&mut self) -> io::Result<()> {
        match &mut self.form {
            Form::Lines(_) => Ok(()),
            Form::Frames(journal) => journal.write_to(&mut self.part),
        }
    }

    /// Hands all rows to the system, so that they outlive this program. To be called before
    /// anybody is told of them.
    ///
    /// # Errors
    /// [`AcquireError::Output`] if the file system does not take them.
    pub(super) fn flush(&mut self) -> Result<(), AcquireError> {
        let flushed = self.hand_over().and_then(|()| self.part.flush());
        flushed.map_err(|source| self.refused(source))
    }

    fn refused(&self, source: io::Error) -> AcquireError {
        OutputError::write(self.part.path(), source).into()
    }

    /// Makes it a recording of which this is known. Where its rows still are, if they could not be
    /// removed.
    ///
    /// # Errors
    /// [`AcquireError::Kept`]; the rows are where they were, and so is a recording that was to
    /// be replaced.
    pub(super) fn finish(&mut self, about: &About) -> Result<Option<PathBuf>, AcquireError> {
        self.join(about).map_err(|source| AcquireError::Kept {
            part: self.part.path().to_owned(),
            source,
        })?;
        let removed = self.part.remove();
        Ok(removed.err().map(|_| self.part.path().to_owned()))
    }

    fn join(&mut self, about: &About) -> Result<(), OutputError> {
        // Nobody knows what has come there since the recording began.
        let existing = Existing::Keep.or_force(self.replace);
        output::check(&self.file, [], existing)?;
        let mut out = Output::create(&self.file)?;
        let copied = self.hand_over().and_then(|()| self.copy(about, &mut out));
        copied.map_err(|source| OutputError::write(&self.file, source))?;
        out.finish()?.place()
    }

    fn copy(&mut self, about: &About, out: &mut Output) -> io::Result<()> {
        let part = self.part.reread()?;
        if matches!(self.form, Form::Lines(_)) {
            let rows = Rows::begin(self.format, out, about, true)?;
            return rows.lines(part);
        }
        let mut rows = Rows::begin(self.format, out, about, true)?;
        let mut reader = journal::Reader::new(part);
        let mut copied = 0;
        let mut row = Vec::with_capacity(about.channels.len());
        while let Some(part) = reader.next()? {
            let journal::Part::Rows { content, .. } = part else {
                continue;
            };
            for (health, readings) in journal::rows(content) {
                row.clear();
                row.extend(readings);
                rows.row(&row, health)?;
                copied += 1;
            }
        }
        if copied != self.rows {
            let rows = self.rows;
            return Err(io::Error::other(format!(
                "of {rows} rows that were written {copied} are read back"
            )));
        }
        rows.finish()
    }

    /// Throws it away: there is nothing in it that anybody wants.
    pub(super) fn discard(&mut self) {
        self.part.undo();
    }
}

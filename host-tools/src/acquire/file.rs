//! A recording while it grows.
//!
//! What stands above a recording's header is known at its end only, the true sample rate for
//! one. So rows go to a file beside it, whose name ends in `.part`; at the end the preamble and
//! they become the recording. If this program dies before, the rows are there: a recording
//! without a preamble.

use super::AcquireError;
use crate::recording::{HEALTH_COLUMN, Preamble, field, spell};
use flate2::Compression;
use flate2::write::GzEncoder;
use massline_core::wire::Health;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A recording while it grows.
pub(super) struct Growing {
    file: PathBuf,
    part: PathBuf,
    rows: BufWriter<File>,
    line: String,
}

impl Growing {
    /// Begins a recording of these channels. Its folder is made if it is missing.
    pub(super) fn create(file: &Path, channels: &[String]) -> Result<Self, AcquireError> {
        let refused = |source| AcquireError::Write {
            file: file.to_owned(),
            source,
        };
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder).map_err(refused)?;
        }
        let mut part = file.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let rows = File::create(&part).map_err(refused)?;
        let mut growing = Self {
            file: file.to_owned(),
            part,
            rows: BufWriter::new(rows),
            line: String::new(),
        };
        let mut header: Vec<String> = channels.iter().map(|name| field(name)).collect();
        header.push(HEALTH_COLUMN.to_owned());
        growing.line = header.join(",");
        growing.flush_line()?;
        Ok(growing)
    }

    /// Adds a row. A sample that never came has no readings.
    pub(super) fn row(&mut self, si: &[f32], health: Health) -> Result<(), AcquireError> {
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
        self.flush_line()
    }

    fn flush_line(&mut self) -> Result<(), AcquireError> {
        self.line.push('\n');
        let written = self.rows.write_all(self.line.as_bytes());
        written.map_err(|source| self.refused(source))
    }

    fn refused(&self, source: io::Error) -> AcquireError {
        AcquireError::Write {
            file: self.file.clone(),
            source,
        }
    }

    /// Makes it a recording.
    pub(super) fn finish(&mut self, preamble: &Preamble) -> Result<(), AcquireError> {
        let done = self.rows.flush().and_then(|()| self.join(preamble));
        done.and_then(|()| std::fs::remove_file(&self.part))
            .map_err(|source| self.refused(source))
    }

    fn join(&self, preamble: &Preamble) -> io::Result<()> {
        let mut rows = BufReader::new(File::open(&self.part)?);
        let mut out = BufWriter::new(File::create(&self.file)?);
        let zipped = self.file.extension();
        if zipped.is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
            let mut out = GzEncoder::new(out, Compression::default());
            preamble.write(&mut out)?;
            io::copy(&mut rows, &mut out)?;
            return out.finish()?.flush();
        }
        preamble.write(&mut out)?;
        io::copy(&mut rows, &mut out)?;
        out.flush()
    }

    /// Throws it away.
    pub(super) fn discard(&mut self) {
        // There is nothing in it that anybody wants.
        let _ = std::fs::remove_file(&self.part);
    }
}

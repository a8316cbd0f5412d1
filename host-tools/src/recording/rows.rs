//! Recordings that are written, row by row, in the format that the file's name tells.

use super::about::About;
use super::csv::field;
use super::parquet::ParquetRows;
use super::{HEALTH_COLUMN, spell};
use flate2::Compression;
use flate2::write::GzEncoder;
use massline_firmware::wire::Health;
use std::fmt::Write as _;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;

/// Formats that recordings are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Written {
    /// Text, which every program reads.
    Csv,
    /// The same, compressed by gzip.
    #[value(skip)]
    PackedCsv,
    /// Columns in single precision, with facts about the recording.
    Parquet,
}

impl Written {
    /// The format of a file of this name; `None`: its ending is another one.
    #[must_use]
    pub fn of(file: &Path) -> Option<Self> {
        let name = file.file_name()?.to_string_lossy().to_ascii_lowercase();
        let ends = |ending| name.ends_with(ending);
        match () {
            () if ends(".csv") => Some(Self::Csv),
            () if ends(".csv.gz") => Some(Self::PackedCsv),
            () if ends(".parquet") => Some(Self::Parquet),
            () => None,
        }
    }
}

/// A recording that is being written.
pub(crate) enum Rows<'w> {
    Csv(Box<dyn Write + 'w>, Line),
    PackedCsv(GzEncoder<Box<dyn Write + 'w>>, Line),
    Parquet(Box<ParquetRows<Box<dyn Write + Send + 'w>>>),
}

impl<'w> Rows<'w> {
    /// Begins a recording. With `tells` it has a column of faults, and readings may be missing.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn begin(
        format: Written,
        out: impl Write + Send + 'w,
        about: &About,
        tells: bool,
    ) -> io::Result<Self> {
        let line = Line::new(tells);
        let mut text: Vec<u8> = Vec::new();
        about.preamble().write(&mut text)?;
        let names = about.channels.iter().map(|c| c.name.as_str());
        line.header(names, &mut text);
        Ok(match format {
            Written::Csv => {
                let mut out: Box<dyn Write + 'w> = Box::new(out);
                out.write_all(&text)?;
                Self::Csv(out, line)
            }
            Written::PackedCsv => {
                let mut zip = GzEncoder::new(Box::new(out) as _, Compression::default());
                zip.write_all(&text)?;
                Self::PackedCsv(zip, line)
            }
            Written::Parquet => {
                let rows =
                    ParquetRows::begin(Box::new(out) as _, about.clone(), about.rate(), tells);
                Self::Parquet(Box::new(rows?))
            }
        })
    }

    /// Adds a row. A sample that never came has no readings.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn row(&mut self, si: &[f32], health: Health) -> io::Result<()> {
        match self {
            Self::Csv(out, line) => out.write_all(line.of(si, health)),
            Self::PackedCsv(out, line) => out.write_all(line.of(si, health)),
            Self::Parquet(rows) => rows.row(si, health),
        }
    }

    /// Adds the rows that come below a header as lines of CSV, and ends the recording, which is CSV.
    ///
    /// # Errors
    /// The reader's and the writer's.
    pub(crate) fn lines(mut self, lines: impl Read) -> io::Result<()> {
        let mut lines = BufReader::new(lines);
        // The header stands there already.
        lines.skip_until(b'\n')?;
        match &mut self {
            Self::Csv(out, _) => io::copy(&mut lines, out).map(drop)?,
            Self::PackedCsv(out, _) => io::copy(&mut lines, out).map(drop)?,
            Self::Parquet(_) => return Err(io::Error::other("lines are no columns")),
        }
        self.finish()
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn finish(self) -> io::Result<()> {
        match self {
            Self::Csv(mut out, _) => out.flush(),
            Self::PackedCsv(out, _) => out.finish()?.flush(),
            Self::Parquet(rows) => rows.finish(),
        }
    }
}

/// A row as a line of CSV.
pub(crate) struct Line {
    text: String,
    tells: bool,
}

impl Line {
    /// With `tells` each line ends in the faults of the sample.
    pub(crate) const fn new(tells: bool) -> Self {
        Self {
            text: String::new(),
            tells,
        }
    }

    /// Adds the line of these names.
    pub(crate) fn header<'n>(&self, names: impl Iterator<Item = &'n str>, out: &mut Vec<u8>) {
        let mut fields: Vec<String> = names.map(field).collect();
        if self.tells {
            fields.push(HEALTH_COLUMN.to_owned());
        }
        out.extend_from_slice(fields.join(",").as_bytes());
        out.push(b'\n');
    }

    /// The line of a row. A sample that never came has no readings.
    pub(crate) fn of(&mut self, si: &[f32], health: Health) -> &[u8] {
        let text = &mut self.text;
        text.clear();
        for (column, x) in si.iter().enumerate() {
            if column > 0 {
                text.push(',');
            }
            if !health.contains(Health::MISSING) {
                // The shortest text that reads back to the same number, with an exponent in the place
                // of a long row of zeros. Writing to a String cannot fail.
                let _ = write!(text, "{x:?}");
            }
        }
        if self.tells {
            if !si.is_empty() {
                text.push(',');
            }
            text.push_str(&spell(health));
        }
        text.push('\n');
        text.as_bytes()
    }
}

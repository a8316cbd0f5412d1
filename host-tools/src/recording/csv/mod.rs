//! CSV, one row at a time; also the format of whatever no other format recognises.

mod decimal;
mod decode;
mod dialect;
#[cfg(target_arch = "x86_64")]
mod fours;
mod gauge;
mod header;
mod lines;
mod marks;
mod records;
mod stamp;
#[cfg(test)]
mod tests;

pub(crate) use header::field;

use super::form::Form;
use super::input::Input;
use super::names::labelled;
use super::preamble::{self, Preamble};
use super::source::{Block, Channel, Place, Source, StatedRate};
use super::{Format, HEALTH_COLUMN, RecordingError, faults};
use crate::limits;
use crate::printable::quoted;
use ::csv::ByteRecord;
use decode::Encoding;
use dialect::Dialect;
use lines::{Lines, Step};
use massline_firmware::wire::Health;
use records::Records;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use stamp::Stamp;

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |_| true,
    open: |input, form| Ok(Box::new(CsvFile::open(input, form)?)),
};

/// Bytes of a field that a message repeats.
const SHOWN: usize = 40;

/// A CSV file that is being read.
struct CsvFile {
    file: PathBuf,
    rows: Rows,
    dialect: Dialect,
    /// The first time stamp.
    first: Option<Stamp>,
    channels: Vec<Channel>,
    selected: Vec<usize>,
    /// `true` if the selected channels are columns of numbers.
    plain: bool,
    preamble: Preamble,
    /// Column of faults, and whether it is read as such.
    faults: Option<usize>,
    read_faults: bool,
    record: ByteRecord,
    /// `true` if the file ends in the middle of a line.
    unfinished: bool,
}

/// Rows that are being read.
enum Rows {
    /// Rows without quotes, each of which is a line.
    Lines(Lines),
    /// Rows of any form.
    Records(Records),
}

impl Rows {
    /// Line where the next row begins, in front of comments and empty lines.
    fn line(&self) -> u64 {
        match self {
            Self::Lines(lines) => lines.row(),
            Self::Records(records) => records.line(),
        }
    }

    /// Has the rows from here on read in any form.
    fn leave_lines(&mut self, dialect: &Dialect) {
        let nothing = Self::Records(Records::new(std::io::empty(), 0, dialect));
        *self = match std::mem::replace(self, nothing) {
            Self::Lines(lines) => {
                let (rest, line) = lines.rest();
                Self::Records(Records::new(rest, line.saturating_sub(1), dialect))
            }
            records => records,
        };
    }
}

impl CsvFile {
    /// Reads preamble, head and header.
    fn open(input: Input, form: &Form) -> Result<Self, RecordingError> {
        let Input {
            file,
            start,
            content,
            ..
        } = input;
        let damaged = |e: std::io::Error| RecordingError::Damaged {
            file: file.clone(),
            place: Place::Line(1),
            reason: e.to_string(),
        };
        let content = Encoding::of(&start).decoded(content).map_err(damaged)?;
        let mut content = BufReader::new(content);
        let (mut head, preamble) = preamble::take(&mut content).map_err(damaged)?;
        let preamble = preamble.map_err(|e| RecordingError::Preamble {
            file: file.clone(),
            reason: quoted(e.message()),
        })?;
        let whole = read_head(&mut content, &mut head);
        let dialect = Dialect::of(&head, whole, form, &file)?;
        let names = head.get(dialect.start..).unwrap_or(&[]).to_vec();
        let rows = Records::new(Cursor::new(names.clone()), dialect.line, &dialect);
        let mut csv = Self {
            file,
            rows: Rows::Records(rows),
            dialect,
            first: None,
            channels: Vec::new(),
            selected: Vec::new(),
            plain: false,
            preamble,
            faults: None,
            read_faults: false,
            record: ByteRecord::new(),
            unfinished: false,
        };
        let read = csv.read_header();
        let passed = csv.passed(&names);
        let (dialect, before) = (&csv.dialect, names.get(..passed).unwrap_or(&[]));
        if passed < names.len() || whole {
            read?;
            let line = dialect.line + dialect::line_ends(before) + 1;
            let mut rows = Cursor::new(names);
            rows.set_position(passed as u64);
            let rows = Box::new(rows.chain(content));
            let lines = Lines::new(rows, line, dialect.delimiter, dialect.decimal);
            csv.rows = Rows::Lines(lines);
        } else {
            // Names that are longer than the head.
            let rows = Cursor::new(names).chain(content);
            csv.rows = Rows::Records(Records::new(rows, dialect.line, dialect));
            csv.read_header()?;
        }
        csv.skip_to(form.first_row)?;
        Ok(csv)
    }

    /// Bytes of the names that were read, with the end of their last line.
    fn passed(&self, names: &[u8]) -> usize {
        let Rows::Records(records) = &self.rows else {
            return 0;
        };
        let passed = records.passed() as usize;
        let behind = passed.checked_sub(1).and_then(|last| names.get(last..));
        passed + usize::from(behind.is_some_and(|behind| behind.starts_with(b"\r\n")))
    }

    /// Leaves out the rows before a line, counted from one.
    fn skip_to(&mut self, line: Option<u64>) -> Result<(), RecordingError> {
        let Some(line) = line else { return Ok(()) };
        while self.rows.line() < line && self.advance()?.is_some() {}
        Ok(())
    }

    fn read_header(&mut self) -> Result<(), RecordingError> {
        if self.advance()?.is_none() {
            return Err(RecordingError::Empty {
                file: self.file.clone(),
            });
        }
        if self.record.len() > limits::COLUMNS {
            return Err(RecordingError::TooManyColumns {
                file: self.file.clone(),
                found: self.record.len(),
            });
        }
        let mut names = header::names(&self.record, &self.file)?;
        // A delimiter at the end of the header makes a name of nothing.
        let columns = self
            .dialect
            .columns
            .map_or(usize::MAX, |columns| columns + 1);
        if names.len() == columns {
            names.pop_if(|name| name.is_empty());
        }
        self.faults = names.iter().position(|name| name == HEALTH_COLUMN);
        self.channels = labelled(&names);
        if self.dialect.units && self.advance()?.is_some() {
            for (channel, unit) in self.channels.iter_mut().zip(&self.record) {
                let unit = decode::text(unit);
                let unit = dialect::bare(&unit);
                channel.unit = (!["", "-"].contains(&unit)).then(|| unit.to_owned());
            }
        }
        self.record.clear();
        Ok(())
    }

    /// Reads the next row into the record, and gives its line; `None` at the end.
    fn advance(&mut self) -> Result<Option<u64>, RecordingError> {
        let line = self.rows.line();
        loop {
            let lines = match &mut self.rows {
                Rows::Lines(lines) => lines,
                Rows::Records(records) => {
                    let more = records.advance(&mut self.record, &self.file)?;
                    self.unfinished = !more && !records.ends_a_line();
                    return Ok(more.then_some(line));
                }
            };
            let place = |lines: &Lines| (self.file.clone(), Place::Line(lines.line()));
            match lines.step() {
                Step::Row(range) => {
                    self.record.clear();
                    let fields = lines.part(range).split(|b| *b == self.dialect.delimiter);
                    fields.for_each(|field| self.record.push_field(field.trim_ascii()));
                    return Ok(Some(line));
                }
                Step::End => {
                    self.unfinished = lines.unfinished();
                    return Ok(None);
                }
                Step::Other => self.rows.leave_lines(&self.dialect),
                Step::TooLong => {
                    let (file, place) = place(lines);
                    return Err(RecordingError::RowTooLong { file, place });
                }
                Step::Failed(error) => {
                    let (file, place) = place(lines);
                    let reason = error.to_string();
                    return Err(RecordingError::Damaged {
                        file,
                        place,
                        reason,
                    });
                }
            }
        }
    }

    /// Reads a row of numbers into a block; `false`, with nothing read, if the next row is of
    /// another form.
    fn numbers(&mut self, block: &mut Block) -> bool {
        let Rows::Lines(lines) = &mut self.rows else {
            return false;
        };
        lines.ready();
        let (columns, empty) = (
            self.channels.len(),
            self.faults.filter(|_| self.read_faults),
        );
        self.plain
            && block.fill(|readings| {
                let line = lines.numbers(columns, &self.selected, empty, readings)?;
                Some((Place::Line(line), Health::GOOD))
            })
    }

    /// Reads a row into a block; `false` at the end.
    fn row(&mut self, block: &mut Block) -> Result<bool, RecordingError> {
        let Some(line) = self.advance()? else {
            return Ok(false);
        };
        let row = Row {
            file: &self.file,
            place: Place::Line(line),
            record: &self.record,
            decimal: self.dialect.decimal,
        };
        // A delimiter at the end of each row makes one more.
        let ends = row.record.len() == self.channels.len() + 1;
        let ends = ends && row.record.iter().next_back() == Some(b"");
        if row.record.len() != self.channels.len() && !ends {
            return Err(RecordingError::RowLength {
                file: self.file.clone(),
                place: row.place,
                found: row.record.len(),
                expected: self.channels.len(),
            });
        }
        let health = row.health(self.faults.filter(|_| self.read_faults))?;
        block.push(row.place, health, |k| {
            let column = self.selected.get(k).copied().unwrap_or(usize::MAX);
            // A sample that never came has no readings.
            if !health.is_good() && row.record.get(column) == Some(b"") {
                return Ok(f64::NAN);
            }
            if self.dialect.stamps == Some(column) {
                return row.stamp(column, &self.channels, &mut self.first);
            }
            row.number(column, &self.channels)
        })?;
        Ok(true)
    }
}

impl Source for CsvFile {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn names_at(&self) -> Option<Place> {
        Some(Place::Line(self.dialect.line + 1))
    }

    fn looks_recorded(&self) -> bool {
        self.dialect.columns.is_some()
    }

    fn units_at(&self) -> Option<Place> {
        // A row of them stands below the names.
        let below = u64::from(self.dialect.units);
        Some(Place::Line(self.dialect.line + 1 + below))
    }

    fn time(&self) -> Option<usize> {
        self.dialect.stamps
    }

    fn described(&self) -> Option<String> {
        let time = self.dialect.stamps.and_then(|time| self.channels.get(time));
        Some(self.dialect.described(time.map(|c| c.name.as_str())))
    }

    fn sample_rate(&self) -> Option<StatedRate> {
        let rate = self.preamble.sample_rate.as_ref()?;
        Some(StatedRate {
            value: rate.value,
            place: "its preamble",
        })
    }

    fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    fn fault_channel(&self) -> Option<usize> {
        self.faults
    }

    fn select(&mut self, channels: &[usize]) {
        self.selected = channels.to_vec();
        self.read_faults = self.faults.is_some_and(|own| !channels.contains(&own));
        let is_number =
            |column: &usize| *column < self.channels.len() && self.dialect.stamps != Some(*column);
        self.plain = channels.iter().all(is_number);
    }

    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError> {
        while block.room() > 0 && (self.numbers(block) || self.row(block)?) {}
        Ok(())
    }

    fn end_note(&self) -> Option<&'static str> {
        self.unfinished.then_some(
            "the last row has no line end, so that its last number may be cut off; it was taken as it stands: compare it with the original, or delete that row",
        )
    }
}

/// A row of fields.
struct Row<'a> {
    file: &'a Path,
    place: Place,
    record: &'a ByteRecord,
    decimal: u8,
}

impl Row<'_> {
    fn health(&self, column: Option<usize>) -> Result<Health, RecordingError> {
        let Some(field) = column.and_then(|column| self.record.get(column)) else {
            return Ok(Health::GOOD);
        };
        faults::read(&String::from_utf8_lossy(field)).map_err(|found| RecordingError::NoFault {
            file: self.file.to_owned(),
            place: self.place,
            found: quoted(&found),
        })
    }

    /// Seconds of a time stamp since the midnight before the first one.
    fn stamp(
        &self,
        column: usize,
        channels: &[Channel],
        first: &mut Option<Stamp>,
    ) -> Result<f64, RecordingError> {
        let field = self.record.get(column).unwrap_or(&[]);
        let stamp = std::str::from_utf8(field).ok().and_then(Stamp::parse);
        let stamp = stamp.ok_or_else(|| self.not_a_number(column, channels))?;
        Ok(stamp.since_day_of(first.get_or_insert(stamp)))
    }

    fn not_a_number(&self, column: usize, channels: &[Channel]) -> RecordingError {
        RecordingError::NotANumber {
            file: self.file.to_owned(),
            place: self.place,
            channel: name(column, channels),
            found: self.shown(column),
            sign: if self.decimal == b',' {
                "comma"
            } else {
                "point"
            },
        }
    }

    /// The start of a field, for messages.
    fn shown(&self, column: usize) -> String {
        let field = self.record.get(column).unwrap_or(&[]);
        // A character has up to four bytes.
        let start = field.get(..SHOWN).unwrap_or(field);
        quoted(&String::from_utf8_lossy(start))
    }

    fn number(&self, column: usize, channels: &[Channel]) -> Result<f64, RecordingError> {
        let field = self.record.get(column).unwrap_or(&[]);
        let value = dialect::number(field, self.decimal)
            .ok_or_else(|| self.not_a_number(column, channels))?;
        if (value as f32).is_finite() {
            Ok(value)
        } else {
            Err(RecordingError::NotFinite {
                file: self.file.to_owned(),
                place: self.place,
                channel: name(column, channels),
                found: self.shown(column),
            })
        }
    }
}

fn name(column: usize, channels: &[Channel]) -> String {
    channels.get(column).map_or("", |c| &c.name).to_owned()
}

/// Reads the head of a file behind what was read of it: [`dialect::HEAD`] bytes, or a few rows
/// where these are longer, up to a mebibyte, which takes ten times as much while it is looked
/// through; `true` if it is all of the file. An error of the reader comes again with the next
/// bytes.
fn read_head(content: &mut impl Read, head: &mut Vec<u8>) -> bool {
    const ROWS: usize = 4;
    let most = 1 << 20;
    loop {
        let before = head.len();
        let chunk = content.take(dialect::HEAD as u64).read_to_end(head);
        match chunk {
            Ok(count) if count < dialect::HEAD => return true,
            Err(_) => return false,
            Ok(_) => {}
        }
        let rows = head.iter().filter(|byte| **byte == b'\n').count();
        if rows >= ROWS || head.len() >= most || head.len() == before {
            return false;
        }
    }
}

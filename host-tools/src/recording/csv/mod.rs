//! CSV, one row at a time; also the format of whatever no other format recognises.

mod decode;
mod dialect;
mod gauge;
mod header;
mod stamp;

pub(crate) use header::field;

use super::form::Form;
use super::input::Input;
use super::names::labelled;
use super::preamble::{self, Preamble};
use super::source::{Block, Channel, Place, Source, StatedRate};
use super::{Format, HEALTH_COLUMN, RecordingError, faults};
use crate::limits;
use crate::printable::quoted;
use ::csv::{ByteRecord, Position, Reader, ReaderBuilder, Trim};
use decode::Encoding;
use dialect::Dialect;
use gauge::{Gauge, Gauged};
use massline_firmware::wire::Health;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;

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
    reader: Reader<Box<dyn Read>>,
    dialect: Dialect,
    /// The first time stamp.
    first: Option<Stamp>,
    channels: Vec<Channel>,
    selected: Vec<usize>,
    preamble: Preamble,
    /// Column of faults, and whether it is read as such.
    faults: Option<usize>,
    read_faults: bool,
    record: ByteRecord,
    gauge: Rc<Gauge>,
    /// `true` if the file ends in the middle of a line.
    unfinished: bool,
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
        let gauge = Rc::new(Gauge::default());
        let mut head = Cursor::new(head);
        head.set_position(dialect.start as u64);
        let content = Gauged::new(head.chain(content), Rc::clone(&gauge));
        let content: Box<dyn Read> = Box::new(content);
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .delimiter(dialect.delimiter)
            .trim(Trim::All)
            .from_reader(content);
        let mut csv = Self {
            file,
            reader,
            dialect,
            first: None,
            channels: Vec::new(),
            selected: Vec::new(),
            preamble,
            faults: None,
            read_faults: false,
            record: ByteRecord::new(),
            gauge,
            unfinished: false,
        };
        csv.read_header()?;
        csv.skip_to(form.first_row)?;
        Ok(csv)
    }

    /// Leaves out the rows before a line, counted from one.
    fn skip_to(&mut self, line: Option<u64>) -> Result<(), RecordingError> {
        let Some(line) = line else { return Ok(()) };
        while self.line_of(self.reader.position()) < line && self.advance()? {}
        Ok(())
    }

    /// Line of the file, counted from one.
    fn line_of(&self, position: &Position) -> u64 {
        // The reader ends a row at CR and counts lines at LF, which it takes for the next row's.
        let late = self.dialect.crlf && position.byte() > 0;
        self.dialect.line + position.line() + u64::from(late)
    }

    fn read_header(&mut self) -> Result<(), RecordingError> {
        if !self.advance()? {
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
        if self.dialect.units && self.advance()? {
            for (channel, unit) in self.channels.iter_mut().zip(&self.record) {
                let unit = decode::text(unit);
                let unit = dialect::bare(&unit);
                channel.unit = (!["", "-"].contains(&unit)).then(|| unit.to_owned());
            }
        }
        self.record.clear();
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, RecordingError> {
        self.gauge.begin_row();
        let more = self.reader.read_byte_record(&mut self.record);
        let more = more.map_err(|e| {
            if self.gauge.exceeded() {
                return RecordingError::RowTooLong {
                    file: self.file.clone(),
                    place: Place::Line(self.line_of(self.reader.position())),
                };
            }
            RecordingError::Damaged {
                file: self.file.clone(),
                place: Place::Line(self.line_of(e.position().unwrap_or(self.reader.position()))),
                reason: e.to_string(),
            }
        })?;
        self.unfinished = !more && !self.gauge.ends_a_line();
        Ok(more)
    }

    /// Reads a row into a block; `false` at the end.
    fn row(&mut self, block: &mut Block) -> Result<bool, RecordingError> {
        if !self.advance()? {
            return Ok(false);
        }
        let row = Row {
            file: &self.file,
            place: Place::Line(self.record.position().map_or(0, |p| self.line_of(p))),
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
    }

    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError> {
        while block.room() > 0 && self.row(block)? {}
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

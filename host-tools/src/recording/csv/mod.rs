//! CSV, one row at a time; also the format of whatever no other format recognises.

mod gauge;
mod header;

pub(crate) use header::field;

use super::input::Input;
use super::names::labelled;
use super::preamble::{self, Preamble};
use super::source::{Block, Channel, Place, Source, StatedRate};
use super::{Format, HEALTH_COLUMN, RecordingError, faults};
use crate::limits;
use crate::printable::quoted;
use ::csv::{ByteRecord, Position, Reader, ReaderBuilder, Trim};
use gauge::{Gauge, Gauged};
use massline_firmware::wire::Health;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |_| true,
    open: |input| Ok(Box::new(CsvFile::open(input)?)),
};

/// Bytes of a field that a message repeats.
const SHOWN: usize = 40;

/// A CSV file that is being read.
struct CsvFile {
    file: PathBuf,
    reader: Reader<Box<dyn Read>>,
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
    /// Reads preamble and header.
    fn open(input: Input) -> Result<Self, RecordingError> {
        let Input { file, content, .. } = input;
        let mut content = BufReader::new(content);
        let (remarks, preamble) =
            preamble::take(&mut content).map_err(|e| RecordingError::Damaged {
                file: file.clone(),
                place: Place::Line(1),
                reason: e.to_string(),
            })?;
        let preamble = preamble.map_err(|e| RecordingError::Preamble {
            file: file.clone(),
            reason: quoted(e.message()),
        })?;
        // Back they go, so that lines are counted from the file's beginning.
        let gauge = Rc::new(Gauge::default());
        let content = Gauged::new(Cursor::new(remarks).chain(content), Rc::clone(&gauge));
        let content: Box<dyn Read> = Box::new(content);
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(Trim::All)
            .from_reader(content);
        let mut csv = Self {
            file,
            reader,
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
        Ok(csv)
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
        let names = header::names(&self.record, &self.file)?;
        self.faults = names.iter().position(|name| name == HEALTH_COLUMN);
        self.channels = labelled(&names);
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
                    place: Place::Line(self.reader.position().line()),
                };
            }
            RecordingError::Damaged {
                file: self.file.clone(),
                place: Place::Line(
                    e.position()
                        .map_or_else(|| self.reader.position().line(), Position::line),
                ),
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
            place: Place::Line(self.record.position().map_or(0, Position::line)),
            record: &self.record,
        };
        if row.record.len() != self.channels.len() {
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
        Some(Place::Line(1))
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

    fn number(&self, column: usize, channels: &[Channel]) -> Result<f64, RecordingError> {
        let field = self.record.get(column).unwrap_or(&[]);
        let channel = || channels.get(column).map_or("", |c| &c.name).to_owned();
        let text = || {
            // A character has up to four bytes.
            let start = field.get(..SHOWN).unwrap_or(field);
            quoted(&String::from_utf8_lossy(start))
        };
        let value: f64 = std::str::from_utf8(field)
            .ok()
            .and_then(|t| t.parse().ok())
            .ok_or_else(|| RecordingError::NotANumber {
                file: self.file.to_owned(),
                place: self.place,
                channel: channel(),
                found: text(),
            })?;
        if (value as f32).is_finite() {
            Ok(value)
        } else {
            Err(RecordingError::NotFinite {
                file: self.file.to_owned(),
                place: self.place,
                channel: channel(),
                found: text(),
            })
        }
    }
}

//! Rows of any form: with quotes, carriage returns alone, or names that are longer than the head of the file.

use super::dialect::Dialect;
use super::gauge::{Gauge, Gauged};
use crate::recording::{Place, RecordingError};
use ::csv::{ByteRecord, Position, Reader, ReaderBuilder, Trim};
use std::io::Read;
use std::path::Path;
use std::rc::Rc;

/// Rows of any form.
pub(super) struct Records {
    reader: Reader<Box<dyn Read>>,
    gauge: Rc<Gauge>,
    /// Number of lines before the first one.
    before: u64,
    /// `true` if lines end in CR and LF.
    crlf: bool,
}

impl Records {
    pub(super) fn new(content: impl Read + 'static, before: u64, dialect: &Dialect) -> Self {
        let gauge = Rc::new(Gauge::default());
        let content: Box<dyn Read> = Box::new(Gauged::new(content, Rc::clone(&gauge)));
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .delimiter(dialect.delimiter)
            .trim(Trim::All)
            .from_reader(content);
        Self {
            reader,
            gauge,
            before,
            crlf: dialect.crlf,
        }
    }

    /// Line of the file, counted from one.
    fn line_of(&self, position: &Position) -> u64 {
        // The reader ends a row at CR and counts lines at LF, which it takes for the next row's.
        let late = self.crlf && position.byte() > 0;
        self.before + position.line() + u64::from(late)
    }

    /// Line where the next row begins, in front of comments and empty lines.
    pub(super) fn line(&self) -> u64 {
        self.line_of(self.reader.position())
    }

    /// Reads the next row into a record; `false` at the end.
    pub(super) fn advance(
        &mut self,
        record: &mut ByteRecord,
        file: &Path,
    ) -> Result<bool, RecordingError> {
        self.gauge.begin_row();
        self.reader.read_byte_record(record).map_err(|e| {
            if self.gauge.exceeded() {
                return RecordingError::RowTooLong {
                    file: file.to_owned(),
                    place: Place::Line(self.line()),
                };
            }
            RecordingError::Damaged {
                file: file.to_owned(),
                place: Place::Line(self.line_of(e.position().unwrap_or(self.reader.position()))),
                reason: e.to_string(),
            }
        })
    }

    /// Bytes that were read.
    pub(super) fn passed(&self) -> u64 {
        self.reader.position().byte()
    }

    /// `true` if the text ends with the end of a line.
    pub(super) fn ends_a_line(&self) -> bool {
        self.gauge.ends_a_line()
    }
}

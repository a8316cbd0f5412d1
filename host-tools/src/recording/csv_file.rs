//! CSV and gzipped CSV, one row at a time.

use super::gauge::{Gauge, Gauged};
use super::header::{Header, some_of};
use super::preamble::{self, Preamble};
use super::{Checksum, HEALTH_COLUMN, RecordingError, Summed, faults};
use crate::limits;
use crate::setup::quoted;
use csv::ByteRecord;
use flate2::read::MultiGzDecoder;
use massline_firmware::wire::Health;
use std::cell::RefCell;
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Rows of which the time column is looked at to learn the sample rate.
const RATE_ROWS: usize = 1000;

/// Bytes of a field that a message repeats.
const SHOWN: usize = 40;

/// A recording that is being read.
pub struct Recording {
    file: PathBuf,
    reader: csv::Reader<Box<dyn Read>>,
    names: Vec<String>,
    columns: Vec<usize>,
    width: usize,
    ignored: Vec<String>,
    time: Option<usize>,
    /// Column of faults.
    faults: Option<usize>,
    /// Faults of the row read last.
    health: Health,
    preamble: Preamble,
    clock: Option<Clock>,
    record: ByteRecord,
    rows: u64,
    /// Rows after which the recording counts as ended.
    limit: Option<u64>,
    size: u64,
    raw: Shared,
    /// What the setup says that the file is, until it has been compared.
    expected: Option<Checksum>,
    gauge: Rc<Gauge>,
    /// Whether the file ends in the middle of a line.
    unfinished: bool,
}

/// The time a row should carry.
struct Clock {
    start: f64,
    rate: f64,
}

/// The file, while others read on from it.
#[derive(Clone)]
struct Shared(Rc<RefCell<Summed<File>>>);

impl Read for Shared {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().read(buffer)
    }
}

impl Recording {
    /// The same of a file that should be the one with this checksum, if there is one. Its
    /// length is compared now, its bytes when the last row is asked for, or when something is
    /// wrong with a row.
    ///
    /// # Errors
    /// [`RecordingError`]; [`RecordingError::OtherRecording`] before any other.
    pub fn open_as(
        file: &Path,
        channels: &[&str],
        expected: Option<Checksum>,
    ) -> Result<Self, RecordingError> {
        let is_other = |expected: &Checksum| {
            let found = std::fs::metadata(file);
            found.is_ok_and(|found| found.is_file() && found.len() != expected.bytes)
        };
        if let Some(other) = expected.filter(is_other) {
            compare(file, other)?;
        }
        let mut recording = Self::open(file, channels).or_else(|error| {
            expected.map_or(Ok(()), |expected| compare(file, expected))?;
            Err(error)
        })?;
        recording.expected = expected;
        Ok(recording)
    }

    /// Opens a recording and looks for `channels` in its header; rows are then returned
    /// in the order asked for.
    ///
    /// # Errors
    /// [`RecordingError`] if the file cannot be read or lacks one of them.
    pub fn open(file: &Path, channels: &[&str]) -> Result<Self, RecordingError> {
        let unreadable = |source| RecordingError::Unreadable {
            file: file.to_owned(),
            source,
        };
        let metadata = std::fs::metadata(file).map_err(unreadable)?;
        if metadata.is_dir() {
            return Err(unreadable(std::io::ErrorKind::IsADirectory.into()));
        }
        // Recordings are read several times, which a pipe cannot be; one without a writer would
        // not even open.
        if !metadata.is_file() {
            return Err(RecordingError::NoFile {
                file: file.to_owned(),
            });
        }
        let opened = File::open(file).map_err(unreadable)?;
        let size = metadata.len();
        if size == 0 {
            return Err(RecordingError::Empty {
                file: file.to_owned(),
            });
        }
        let raw = Shared(Rc::new(RefCell::new(Summed::new(opened))));
        let zipped = file
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("gz"));
        let input: Box<dyn Read> = if zipped {
            Box::new(MultiGzDecoder::new(BufReader::new(raw.clone())))
        } else {
            Box::new(raw.clone())
        };
        let mut input = BufReader::new(input);
        let (remarks, preamble) =
            preamble::take(&mut input).map_err(|e| RecordingError::Damaged {
                file: file.to_owned(),
                line: 1,
                reason: e.to_string(),
            })?;
        let preamble = preamble.map_err(|e| RecordingError::Preamble {
            file: file.to_owned(),
            reason: quoted(e.message()),
        })?;
        // Back they go, so that lines are counted from the file's beginning.
        let gauge = Rc::new(Gauge::default());
        let input = Gauged::new(Cursor::new(remarks).chain(input), Rc::clone(&gauge));
        let input: Box<dyn Read> = Box::new(input);
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(input);
        let mut recording = Self {
            file: file.to_owned(),
            reader,
            names: channels.iter().map(|&c| c.to_owned()).collect(),
            columns: Vec::new(),
            width: 0,
            ignored: Vec::new(),
            time: None,
            faults: None,
            health: Health::GOOD,
            preamble,
            clock: None,
            record: ByteRecord::new(),
            rows: 0,
            limit: None,
            size,
            raw,
            expected: None,
            gauge,
            unfinished: false,
        };
        recording.read_header()?;
        Ok(recording)
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
        let header = Header::read(&self.record, &self.file)?;
        for name in &self.names {
            self.columns
                .push(header.column(name, &self.names, &self.file)?);
        }
        let names = header.names();
        self.time = names
            .iter()
            .position(|n| n.eq_ignore_ascii_case("time") && !self.names.contains(n));
        self.faults = names
            .iter()
            .position(|n| n == HEALTH_COLUMN && !self.names.contains(n));
        let own = self.columns.iter().copied().chain(self.time);
        let own: HashSet<usize> = own.chain(self.faults).collect();
        let others = names.iter().enumerate().filter(|(i, _)| !own.contains(i));
        self.ignored = others.map(|(_, name)| name.clone()).collect();
        self.width = header.len();
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
                    line: self.reader.position().line(),
                };
            }
            RecordingError::Damaged {
                file: self.file.clone(),
                line: e
                    .position()
                    .map_or_else(|| self.reader.position().line(), csv::Position::line),
                reason: e.to_string(),
            }
        })?;
        self.unfinished = !more && !self.gauge.ends_a_line();
        Ok(more)
    }

    /// Adds what a user should know before the first row is read: the columns that nothing asked
    /// for.
    pub fn notice_columns(&self, warnings: &mut Vec<String>) {
        if !self.ignored.is_empty() {
            let (count, list) = (self.ignored.len(), some_of(self.ignored.iter()));
            let of = if list.ends_with('…') {
                format!(" ({count} of them)")
            } else {
                String::new()
            };
            let file = self.file.display();
            warnings.push(format!("{file}: columns not used: {list}{of}"));
        }
    }

    /// Adds what a user should know once the last row was read: whether it may be cut within its
    /// last number. One that lacks a number as well is an error when it is read.
    pub fn notice_end(&self, warnings: &mut Vec<String>) {
        if self.unfinished {
            warnings.push(format!(
                "{}: the last row has no line end, so that its last number may be cut off; it was taken as it stands: compare it with the original, or delete that row",
                self.file.display()
            ));
        }
    }

    /// Line of the row read last, counted from one.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.record
            .position()
            .map_or(self.rows + 1, csv::Position::line)
    }

    /// The file that is read.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Number of channels asked for.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.names.len()
    }

    /// Columns that nothing asked for.
    #[must_use]
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// What the recording says of itself.
    #[must_use]
    pub fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    /// Faults of the row read last; good in a recording that does not tell. What stands in a
    /// faulty row is no reading to be believed.
    #[must_use]
    pub fn health(&self) -> Health {
        self.health
    }

    /// Rows read so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Has the recording end after `rows` rows, if it is not shorter; `None`: not before
    /// its end.
    pub fn limit(&mut self, rows: Option<u64>) {
        self.limit = rows;
    }

    /// Share of what is to be read that was read, 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        if let Some(limit) = self.limit {
            return self.rows as f64 / limit.max(1) as f64;
        }
        self.raw.0.borrow().checksum().bytes as f64 / self.size.max(1) as f64
    }

    /// Settles the sample rate from the setup's, the preamble's and the time column's, whichever
    /// is there first. The setup's goes before the true one of the preamble, so that lines lie
    /// where they were planned; the two must agree to what converters' clocks are off by. From
    /// here on every row's time is checked against it. To be called before the first row.
    ///
    /// # Errors
    /// [`RecordingError::NoRate`] if neither tells, [`RecordingError::WrongRate`] if they
    /// contradict each other.
    pub fn settle_rate(&mut self, stated: Option<f64>) -> Result<f64, RecordingError> {
        let measured = self.preamble.sample_rate.as_ref().map(|rate| rate.value);
        let Some((start, found)) = self.rate_of_time_column()? else {
            let rate = stated.or(measured).ok_or_else(|| RecordingError::NoRate {
                file: self.file.clone(),
            })?;
            return match measured {
                // Crystals keep to 1e-4; a box without one to a percent.
                Some(found) if (found / rate - 1.0).abs() > 2e-2 || !found.is_finite() => {
                    Err(RecordingError::WrongRate {
                        file: self.file.clone(),
                        place: "its preamble",
                        found,
                        stated: rate,
                    })
                }
                _ => Ok(rate),
            };
        };
        let rate = stated.or(measured).unwrap_or(found);
        // A thousand rows of times with three decimals tell the rate to about 1e-3.
        if (found / rate - 1.0).abs() > 2e-3 {
            return Err(RecordingError::WrongRate {
                file: self.file.clone(),
                place: "its time column",
                found,
                stated: rate,
            });
        }
        self.clock = Some(Clock { start, rate });
        Ok(rate)
    }

    /// First time and mean rate over the first rows, read from a second opening.
    fn rate_of_time_column(&self) -> Result<Option<(f64, f64)>, RecordingError> {
        if self.time.is_none() {
            return Ok(None);
        }
        let mut probe = Self::open(&self.file, &[])?;
        let (mut first, mut last, mut steps) = (None, 0.0, 0.0);
        while steps < RATE_ROWS as f64 && probe.next_row(&mut [])? {
            let time = probe.time_of_row()?.unwrap_or(0.0);
            match first {
                None => first = Some(time),
                Some(_) => steps += 1.0,
            }
            last = time;
        }
        let Some(first) = first else {
            return Ok(None);
        };
        let rate = steps / (last - first);
        if rate.is_finite() && rate > 0.0 {
            Ok(Some((first, rate)))
        } else {
            Err(RecordingError::TimeJump {
                file: self.file.clone(),
                line: probe.line(),
                found: last,
                expected: first,
            })
        }
    }

    fn time_of_row(&self) -> Result<Option<f64>, RecordingError> {
        match self.time {
            Some(column) => self.number(column, "time").map(Some),
            None => Ok(None),
        }
    }

    fn health_of_row(&self) -> Result<Health, RecordingError> {
        let Some(field) = self.faults.and_then(|column| self.record.get(column)) else {
            return Ok(Health::GOOD);
        };
        faults::read(&String::from_utf8_lossy(field)).map_err(|found| RecordingError::NoFault {
            file: self.file.clone(),
            line: self.line(),
            found: quoted(&found),
        })
    }

    fn number(&self, column: usize, channel: &str) -> Result<f64, RecordingError> {
        let field = self.record.get(column).unwrap_or(&[]);
        let text = || {
            // A character has up to four bytes.
            let start = field.get(..SHOWN).unwrap_or(field);
            quoted(&String::from_utf8_lossy(start))
        };
        let value: f64 = std::str::from_utf8(field)
            .ok()
            .and_then(|t| t.parse().ok())
            .ok_or_else(|| RecordingError::NotANumber {
                file: self.file.clone(),
                line: self.line(),
                channel: channel.to_owned(),
                found: text(),
            })?;
        if (value as f32).is_finite() {
            Ok(value)
        } else {
            Err(RecordingError::NotFinite {
                file: self.file.clone(),
                line: self.line(),
                channel: channel.to_owned(),
                found: text(),
            })
        }
    }

    /// Reads the next row into `sample`, in the order of the channels asked for.
    /// `false` at the end.
    ///
    /// # Errors
    /// [`RecordingError`] that names line and channel.
    pub fn next_row(&mut self, sample: &mut [f32]) -> Result<bool, RecordingError> {
        self.next_row_f64(|i, value| {
            if let Some(slot) = sample.get_mut(i) {
                *slot = value as f32;
            }
        })
    }

    /// The same in double precision: calls `store` with channel and reading.
    ///
    /// # Errors
    /// [`RecordingError`] that names line and channel.
    pub fn next_row_f64(&mut self, store: impl FnMut(usize, f64)) -> Result<bool, RecordingError> {
        let row = self.row_f64(store);
        if !matches!(row, Ok(true))
            && let Some(expected) = self.expected.take()
        {
            let found = self.raw.0.borrow().checksum();
            // All of it has passed by, unless reading stopped early.
            if found != expected {
                compare(&self.file, expected)?;
            }
        }
        row
    }

    fn row_f64(&mut self, mut store: impl FnMut(usize, f64)) -> Result<bool, RecordingError> {
        if self.limit.is_some_and(|limit| self.rows >= limit) {
            return Ok(false);
        }
        if !self.advance()? {
            return if self.rows == 0 {
                Err(RecordingError::HeaderOnly {
                    file: self.file.clone(),
                })
            } else {
                Ok(false)
            };
        }
        if self.record.len() != self.width {
            return Err(RecordingError::RowLength {
                file: self.file.clone(),
                line: self.line(),
                found: self.record.len(),
                expected: self.width,
            });
        }
        self.health = self.health_of_row()?;
        for (i, &column) in self.columns.iter().enumerate() {
            // A sample that never came has no readings.
            let absent = !self.health.is_good() && self.record.get(column) == Some(b"");
            let reading = if absent {
                0.0
            } else {
                self.number(column, &self.names[i])?
            };
            store(i, reading);
        }
        self.check_time()?;
        self.rows += 1;
        Ok(true)
    }

    fn check_time(&self) -> Result<(), RecordingError> {
        let (Some(clock), Some(found)) = (&self.clock, self.time_of_row()?) else {
            return Ok(());
        };
        let expected = clock.start + self.rows as f64 / clock.rate;
        // Half a sample, and the drift of a rate that is known to 1e-4: a lost sample
        // early in the file is a whole one.
        let allowed = 0.6 / clock.rate + 1e-4 * (expected - clock.start).abs();
        if (found - expected).abs() > allowed {
            return Err(RecordingError::TimeJump {
                file: self.file.clone(),
                line: self.line(),
                found,
                expected,
            });
        }
        Ok(())
    }
}

/// Whether a file is the one with this checksum. What is no regular file has none.
fn compare(file: &Path, expected: Checksum) -> Result<(), RecordingError> {
    if !std::fs::metadata(file).is_ok_and(|found| found.is_file()) {
        return Ok(());
    }
    let found = Checksum::of_file(file).map_err(|source| RecordingError::Unreadable {
        file: file.to_owned(),
        source,
    })?;
    if found == expected {
        return Ok(());
    }
    Err(RecordingError::OtherRecording {
        file: file.to_owned(),
        expected,
        found,
    })
}

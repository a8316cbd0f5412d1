//! Parquet: columns of numbers, in row groups that are read page by page.
//!
//! | file | holds |
//! | --- | --- |
//! | `thrift` | the protocol of footers and page headers |
//! | `footer` | columns, row groups, and notes of the writer |
//! | `pages` | the pages of a column, unpacked and vetted |
//! | `series` | the values of a column |
//! | `write` | recordings of this program to Parquet |
//! | `pandas` | columns that pandas describes beside the file's schema |
//!
//! Each column that is read holds one page, and its dictionary; a row group may be as long as the
//! file. Files that this program has written carry a document on the recording
//! ([`About`]); their column `time` is a count of the samples at the true rate, and is not read.

mod footer;
mod pages;
mod pandas;
mod series;
#[cfg(test)]
mod tests;
mod thrift;
mod write;

pub(super) use write::ParquetRows;

use super::about::About;
use super::input::Input;
use super::names::with_units;
use super::source::{Block, Channel, Place, Source, StatedRate};
use super::{Format, HEALTH_COLUMN, Mismatch, Preamble, RecordingError};
use crate::limits;
use crate::printable::{printable, quoted};
use ::parquet::errors::ParquetError;
use footer::{Column, Footer, Values};
use massline_firmware::wire::Health;
use pages::Store;
use series::Series;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// First and last bytes of a file.
const MAGIC: &[u8; 4] = b"PAR1";
/// Last bytes of a file whose footer is encrypted.
const ENCRYPTED: &[u8; 4] = b"PARE";

/// Name of the column of time in files that this program writes.
const TIME_COLUMN: &str = "time";
/// Beginning of the name of the program in files that it has written.
const WRITER: &str = "massline ";

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |start| start.starts_with(MAGIC) || start.starts_with(ENCRYPTED),
    open: |input, _| Ok(Box::new(ParquetFile::open(input)?)),
};

const AGAIN: &str = "copy the file again, or write it again: from pandas by to_parquet(file, row_group_size=100000), or as CSV";

/// A Parquet file that is being read.
struct ParquetFile {
    file: PathBuf,
    store: Arc<Store>,
    footer: Rc<Footer>,
    channels: Vec<Channel>,
    /// Column of each channel.
    columns: Vec<usize>,
    /// Checksum of each channel, where the file states it.
    sums: Vec<Option<u32>>,
    time: Option<usize>,
    /// Channel of faults.
    faults: Option<usize>,
    rate: Option<f64>,
    preamble: Preamble,
    notes: Vec<String>,
    selected: Vec<usize>,
    /// The series of the selected channels and of faults, once the first sample is asked for.
    series: Option<(Vec<Series>, Option<Series>)>,
    frame: Vec<f64>,
    next: u64,
}

fn malformed(file: &Path, found: impl Into<String>) -> RecordingError {
    RecordingError::Malformed {
        file: file.to_owned(),
        place: None,
        mismatch: Box::new(Mismatch {
            channel: String::new(),
            found: found.into(),
            expected: "a Parquet file".to_owned(),
            advice: AGAIN,
        }),
    }
}

/// Reads the footer.
fn footer(file: &Path, store: &Store, size: u64) -> Result<Footer, RecordingError> {
    let unreadable = |source| RecordingError::Unreadable {
        file: file.to_owned(),
        source,
    };
    let tail = store.read(size.saturating_sub(8), 8).map_err(unreadable)?;
    let Some((length, magic)) = tail.split_first_chunk::<4>() else {
        return Err(malformed(file, "a file of a few bytes"));
    };
    let length = u64::from(u32::from_le_bytes(*length));
    let encrypted = || RecordingError::OtherKind {
        file: file.to_owned(),
        kind: "an encrypted Parquet file".to_owned(),
        advice: "write it without encryption",
    };
    if magic == ENCRYPTED {
        return Err(encrypted());
    }
    if magic != MAGIC {
        return Err(malformed(
            file,
            "no footer at its end (its writer was ended before it was done, or it was cut)",
        ));
    }
    if length > limits::FOOTER || length + 12 > size {
        return Err(malformed(file, format!("a footer of {length} bytes")));
    }
    let bytes = store.read(size - 8 - length, length).map_err(unreadable)?;
    let footer = Footer::read(&bytes).map_err(|reason| malformed(file, reason))?;
    if footer.encrypted {
        return Err(encrypted());
    }
    if footer.columns.len() > limits::COLUMNS {
        return Err(RecordingError::TooManyColumns {
            file: file.to_owned(),
            found: footer.columns.len(),
        });
    }
    Ok(footer)
}

/// `true` for the column of the faults of the samples.
fn is_faults(column: &Column) -> bool {
    column.name == HEALTH_COLUMN && column.values == Some(Values::Text)
}

impl ParquetFile {
    fn open(input: Input) -> Result<Self, RecordingError> {
        let file = input.file;
        if input.packed {
            return Err(RecordingError::OtherKind {
                file,
                kind: "a Parquet file compressed by gzip".to_owned(),
                advice: "its footer lies at its end, so that it cannot be read while it is unpacked: unpack it first (its pages are compressed already)",
            });
        }
        let unreadable = |source| RecordingError::Unreadable {
            file: file.clone(),
            source,
        };
        let opened = File::open(&file).map_err(unreadable)?;
        let size = opened.metadata().map_err(unreadable)?.len();
        let store = Store::new(opened, size);
        let mut footer = footer(&file, &store, size)?;
        let [about, pandas] = std::mem::take(&mut footer.notes);
        let about = about.and_then(|text| About::read(text.as_bytes()));
        let about = about.unwrap_or_default();
        let index = pandas.map_or_else(Vec::new, |text| pandas::describe(&text, &mut footer));
        // Others may have taken the document over with the samples, and changed these.
        let own = footer.writer.starts_with(WRITER) && about.samples == footer.rows;
        let (mut channels, mut columns, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        let (mut unread, mut time, mut faults) = (Vec::new(), None, None);
        for (position, column) in footer.columns.iter().enumerate() {
            if own && column.name == TIME_COLUMN {
                continue;
            }
            let known = about.channels.iter().find(|c| c.name == column.name);
            match column.values {
                Some(_) if is_faults(column) => faults = Some(channels.len()),
                None | Some(Values::Text) => {
                    unread.push(column.name.clone());
                    continue;
                }
                Some(values) => {
                    let is_time = values.is_time() || index.contains(&column.name);
                    time = time.or(is_time.then_some(channels.len()));
                }
            }
            let unit = known.and_then(|c| c.unit.as_deref());
            // Counted from the first instant on, in seconds.
            let second = column.values.is_some_and(Values::is_time).then_some("s");
            channels.push(Channel {
                name: printable(&column.name).into_owned(),
                unit: second.or(unit).map(|unit| printable(unit).into_owned()),
                direction: known.and_then(|c| c.direction),
            });
            columns.push(position);
            sums.push(known.and_then(|c| c.crc32).filter(|_| own));
        }
        let channels = with_units(channels);
        let used = columns.iter();
        codecs(&file, &footer, used)?;
        let mut notes = Vec::new();
        if !unread.is_empty() {
            let names = super::some_of(unread.iter());
            notes.push(format!(
                "columns that are not numbers are not read: {names}"
            ));
        }
        Ok(Self {
            rate: about.rate(),
            preamble: about.preamble(),
            file,
            store,
            footer: Rc::new(footer),
            channels,
            columns,
            sums,
            time,
            faults,
            notes,
            selected: Vec::new(),
            series: None,
            frame: Vec::new(),
            next: 0,
        })
    }

    fn series(&self, channel: usize) -> Series {
        let column = self.columns.get(channel).copied().unwrap_or(usize::MAX);
        let sum = self.sums.get(channel).copied().flatten();
        Series::new(&self.store, &self.footer, column, sum)
    }

    /// The error of a channel at the next sample.
    fn wrong(&self, channel: usize, error: ParquetError) -> RecordingError {
        let name = self.channels.get(channel).map(|c| c.name.as_str());
        let place = Place::Sample(self.next + 1);
        let found = match error {
            ParquetError::General(reason) => reason,
            other => other.to_string(),
        };
        RecordingError::Malformed {
            file: self.file.clone(),
            place: Some(place),
            mismatch: Box::new(Mismatch {
                channel: name.unwrap_or_default().to_owned(),
                found: quoted(&found),
                expected: "pages as the format has them".to_owned(),
                advice: AGAIN,
            }),
        }
    }

    /// Adds the next samples to a block while they are decoded and have no faults; their number. The last
    /// one, at which checksums are looked at, is not among them.
    fn many(
        &self,
        (columns, faults): &mut (Vec<Series>, Option<Series>),
        block: &mut Block,
    ) -> Result<usize, RecordingError> {
        let left = usize::try_from(self.footer.rows - self.next).unwrap_or(usize::MAX);
        let mut count = block.room().min(left - 1);
        if let (Some(channel), Some(faults)) = (self.faults, faults.as_mut()) {
            count = count.min(faults.good().map_err(|e| self.wrong(channel, e))?);
        }
        for (channel, column) in self.selected.iter().zip(columns.iter_mut()) {
            let numbers = column.numbers().map_err(|e| self.wrong(*channel, e))?;
            count = count.min(numbers.len());
        }
        if count == 0 {
            return Ok(0);
        }
        let place = |n: usize| Place::Sample(self.next + 1 + n as u64);
        let decoded = columns.iter().map(Series::decoded).collect::<Vec<_>>();
        block.extend(count, place, &decoded);
        for column in columns.iter_mut().chain(faults) {
            column.skip(count);
        }
        Ok(count)
    }

    /// Reads the next sample; its faults.
    fn frame(
        &mut self,
        series: &mut (Vec<Series>, Option<Series>),
    ) -> Result<Health, RecordingError> {
        let mut health = Health::GOOD;
        if let (Some(faults), Some(words)) = (self.faults, &mut series.1) {
            let read = words.faults().map_err(|e| self.wrong(faults, e))?;
            health = read.map_err(|found| RecordingError::NoFault {
                file: self.file.clone(),
                place: Place::Sample(self.next + 1),
                found: quoted(&found),
            })?;
        }
        self.frame.clear();
        for (k, column) in series.0.iter_mut().enumerate() {
            let channel = self.selected.get(k).copied().unwrap_or_default();
            let number = column.number().map_err(|e| self.wrong(channel, e))?;
            if number.is_none() {
                health = health.union(Health::MISSING);
            }
            if self.next + 1 == self.footer.rows && !column.is_whole() {
                let reason = "readings whose checksum is another one than was recorded";
                return Err(self.wrong(channel, ParquetError::General(reason.to_owned())));
            }
            self.frame.push(number.unwrap_or(f64::NAN));
        }
        Ok(health)
    }
}

/// Checks that the columns are in codecs that can be unpacked.
fn codecs<'c>(
    file: &Path,
    footer: &Footer,
    columns: impl Iterator<Item = &'c usize>,
) -> Result<(), RecordingError> {
    for column in columns {
        let mut chunks = footer.groups.iter().filter_map(|g| g.chunks.get(*column));
        if let Some(chunk) = chunks.find(|chunk| !pages::is_read(chunk.codec)) {
            let known = usize::try_from(chunk.codec).ok();
            let known = known.and_then(|codec| pages::CODECS.get(codec));
            return Err(RecordingError::OtherKind {
                file: file.to_owned(),
                kind: format!(
                    "a Parquet file compressed by {}",
                    known.unwrap_or(&"an unknown codec")
                ),
                advice: "write it with the compression snappy, zstd, gzip or none",
            });
        }
    }
    Ok(())
}

impl Source for ParquetFile {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn sample_rate(&self) -> Option<StatedRate> {
        self.rate.map(|value| StatedRate {
            value,
            place: "its metadata",
        })
    }

    fn samples(&self) -> Option<u64> {
        Some(self.footer.rows)
    }

    fn time(&self) -> Option<usize> {
        self.time
    }

    fn described(&self) -> Option<String> {
        let Footer {
            rows,
            columns,
            groups,
            writer,
            ..
        } = &*self.footer;
        let by = if writer.is_empty() {
            String::new()
        } else {
            format!(", written by {}", quoted(writer))
        };
        Some(format!(
            "Parquet, {} columns of {rows} rows in {} row groups{by}",
            columns.len(),
            groups.len()
        ))
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    fn fault_channel(&self) -> Option<usize> {
        self.faults
    }

    fn select(&mut self, channels: &[usize]) {
        self.selected = channels.to_vec();
        self.series = None;
    }

    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError> {
        let series = self.series.take();
        let mut series = series.unwrap_or_else(|| {
            let faults = self.faults.filter(|f| !self.selected.contains(f));
            let all = self.selected.iter().map(|channel| self.series(*channel));
            (all.collect(), faults.map(|channel| self.series(channel)))
        });
        while block.room() > 0 && self.next < self.footer.rows {
            let many = self.many(&mut series, block)?;
            self.next += many as u64;
            if many > 0 {
                continue;
            }
            let health = self.frame(&mut series)?;
            self.next += 1;
            let frame = &self.frame;
            block.push(Place::Sample(self.next), health, |k| {
                Ok(frame.get(k).copied().unwrap_or(f64::NAN))
            })?;
        }
        self.series = Some(series);
        Ok(())
    }
}

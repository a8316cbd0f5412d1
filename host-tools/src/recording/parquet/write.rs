//! Recordings to Parquet: a column `time` in s, one of single precision a channel, and the faults of
//! the samples as words.
//!
//! Rows are collected to a row group, which takes a few mebibytes, whatever the length of the recording.

use super::{TIME_COLUMN, WRITER};
use crate::recording::about::About;
use crate::recording::{HEALTH_COLUMN, spell};
use massline_firmware::wire::Health;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, FloatType};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, PrimitiveTypeBuilder, Type, TypePtr};
use std::io::{self, Write};
use std::sync::Arc;

/// Bytes of the readings of a row group.
const GROUP: usize = 8 << 20;
/// Rows of a row group.
const ROWS: std::ops::RangeInclusive<usize> = 1 << 12..=1 << 20;
/// Bytes of a page: a reader holds one of each column.
const PAGE: usize = 64 << 10;
/// Values that are handed to the writer of a column at a time.
const BATCH: usize = 1 << 12;

/// A recording that is being written.
pub(crate) struct ParquetRows<W: Write + Send> {
    file: SerializedFileWriter<W>,
    about: About,
    /// Rate at which the column of time counts, Hz; `None`: there is no such column.
    rate: Option<f64>,
    /// `true` if samples may have faults.
    tells: bool,
    /// Rows of a whole group.
    most: usize,
    /// Readings of the group, channel by channel, without missing ones.
    readings: Vec<Vec<f32>>,
    /// 1 for each row of the group that has readings, else 0.
    present: Vec<i16>,
    health: Vec<Health>,
    sums: Vec<flate2::Crc>,
}

impl<W: Write + Send> ParquetRows<W> {
    /// Begins a recording. With `tells` it has a column of faults, and readings may be missing; with a
    /// `rate` it has a column of time.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn begin(out: W, about: About, rate: Option<f64>, tells: bool) -> io::Result<Self> {
        let rate = rate.filter(|_| about.channels.iter().all(|c| c.name != TIME_COLUMN));
        let schema = schema(&about, rate.is_some(), tells).map_err(of_system)?;
        let file = SerializedFileWriter::new(out, schema, properties()).map_err(of_system)?;
        let count = about.channels.len();
        Ok(Self {
            file,
            rate,
            tells,
            most: (GROUP / (4 * count.max(1))).clamp(*ROWS.start(), *ROWS.end()),
            readings: vec![Vec::new(); count],
            present: Vec::new(),
            health: Vec::new(),
            sums: (0..count).map(|_| flate2::Crc::new()).collect(),
            about: About {
                samples: 0,
                faulty_samples: 0,
                missing_samples: 0,
                by_fault: [].into(),
                ..about
            },
        })
    }

    /// Adds a row. A sample that never came has no readings.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn row(&mut self, si: &[f32], health: Health) -> io::Result<()> {
        let missing = health.contains(Health::MISSING);
        self.present.push(i16::from(!missing));
        self.health.push(health);
        if !missing {
            for (column, x) in self.readings.iter_mut().zip(si) {
                column.push(*x);
            }
        }
        let about = &mut self.about;
        about.samples += 1;
        about.faulty_samples += u64::from(!health.is_good());
        about.missing_samples += u64::from(missing);
        if !health.is_good() {
            for word in spell(health).split('+') {
                *about.by_fault.entry(word.to_owned()).or_default() += 1;
            }
        }
        if self.health.len() == self.most {
            self.group().map_err(of_system)?;
        }
        Ok(())
    }

    /// Writes what is left, and the footer.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        if !self.health.is_empty() {
            self.group().map_err(of_system)?;
        }
        for (channel, sum) in self.about.channels.iter_mut().zip(&self.sums) {
            channel.crc32 = Some(sum.sum());
        }
        let note = KeyValue::new(super::footer::KEYS[0].to_owned(), self.about.to_json());
        self.file.append_key_value_metadata(note);
        self.file.close().map(drop).map_err(of_system)
    }

    /// Writes a row group.
    fn group(&mut self) -> Result<()> {
        let rows = self.health.len();
        let before = self.about.samples - rows as u64;
        let levels = self.tells.then_some(self.present.as_slice());
        let mut group = self.file.next_row_group()?;
        if let Some(rate) = self.rate {
            let numbers = before..self.about.samples;
            let times: Vec<f64> = numbers.map(|n| n as f64 / rate).collect();
            column::<DoubleType, _>(&mut group, &times, None)?;
        }
        for (readings, sum) in self.readings.iter_mut().zip(&mut self.sums) {
            column::<FloatType, _>(&mut group, readings, levels)?;
            readings.iter().for_each(|x| sum.update(&x.to_le_bytes()));
            readings.clear();
        }
        if self.tells {
            let faulty: Vec<i16> = self
                .health
                .iter()
                .map(|h| i16::from(!h.is_good()))
                .collect();
            let words = self.health.iter().filter(|h| !h.is_good());
            let words: Vec<ByteArray> = words.map(|h| spell(*h).into_bytes().into()).collect();
            column::<ByteArrayType, _>(&mut group, &words, Some(&faulty))?;
        }
        group.close()?;
        self.present.clear();
        self.health.clear();
        Ok(())
    }
}

/// Writes the next column of a group. Where there are `levels`, the values are those of the rows whose
/// level is 1.
fn column<T: DataType, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    mut values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<()> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("one column too many".to_owned()));
    };
    let writer = column.typed::<T>();
    match levels {
        None => {
            for batch in values.chunks(BATCH) {
                writer.write_batch(batch, None, None)?;
            }
        }
        Some(levels) => {
            for levels in levels.chunks(BATCH) {
                let count = levels.iter().filter(|level| **level == 1).count();
                let (batch, rest) = values.split_at(count.min(values.len()));
                values = rest;
                writer.write_batch(batch, Some(levels), None)?;
            }
        }
    }
    column.close()
}

fn properties() -> WriterPropertiesPtr {
    let health = ColumnPath::from(HEALTH_COLUMN);
    let properties = WriterProperties::builder()
        .set_created_by(format!("{WRITER}{}", env!("CARGO_PKG_VERSION")))
        .set_compression(Compression::SNAPPY)
        .set_dictionary_enabled(false)
        .set_column_dictionary_enabled(health, true)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_offset_index_disabled(true)
        .set_data_page_size_limit(PAGE)
        .set_write_batch_size(BATCH);
    Arc::new(properties.build())
}

fn schema(about: &About, time: bool, tells: bool) -> Result<TypePtr> {
    fn column(name: &str, kind: Physical, repetition: Repetition) -> PrimitiveTypeBuilder<'_> {
        Type::primitive_type_builder(name, kind).with_repetition(repetition)
    }
    let readings = if tells {
        Repetition::OPTIONAL
    } else {
        Repetition::REQUIRED
    };
    let mut columns = Vec::new();
    if time {
        columns.push(column(TIME_COLUMN, Physical::DOUBLE, Repetition::REQUIRED).build()?);
    }
    for channel in &about.channels {
        columns.push(column(&channel.name, Physical::FLOAT, readings).build()?);
    }
    if tells {
        let words = column(HEALTH_COLUMN, Physical::BYTE_ARRAY, Repetition::OPTIONAL);
        columns.push(words.with_logical_type(Some(LogicalType::String)).build()?);
    }
    let columns = columns.into_iter().map(Arc::new).collect();
    let root = Type::group_type_builder("recording").with_fields(columns);
    Ok(Arc::new(root.build()?))
}

/// The system's error, where it is one.
fn of_system(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}

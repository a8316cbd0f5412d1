//! The values of a column, one after the other, across its row groups.

use super::footer::{Column, Footer, Meaning, Values};
use super::pages::{Pages, Store};
use crate::recording::faults;
use massline_firmware::wire::Health;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{DataType, FixedLenByteArrayType, Int32Type, Int64Type};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::{ColumnDescriptor, ColumnPath, Type};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::Arc;

/// Values that are decoded at a time.
const BATCH: usize = 1024;

/// The values of a column.
pub(super) struct Series {
    store: Arc<Store>,
    footer: Rc<Footer>,
    position: usize,
    /// The next group.
    group: usize,
    reader: Option<ColumnReader>,
    /// Values to come of the group.
    left: u64,
    batch: Batch,
    /// Number of the next value in the batch.
    next: usize,
    /// The first instant, from which on time is counted.
    first: Option<i64>,
    /// Checksum of the values so far, and the one that they should have at the end.
    sum: Option<(flate2::Crc, u32)>,
}

/// Values that were decoded together.
#[derive(Default)]
struct Batch {
    /// NaN where one is missing.
    numbers: Vec<f64>,
    /// One for each number, zero where it is missing; empty where none is.
    levels: Vec<i16>,
    words: Vec<std::result::Result<Health, String>>,
    /// Floats as they were stored.
    floats: Vec<f32>,
    /// The same as bytes in little-endian order.
    bytes: Vec<u8>,
}

impl Series {
    /// The values of a column by its position.
    pub(super) fn new(
        store: &Arc<Store>,
        footer: &Rc<Footer>,
        position: usize,
        crc: Option<u32>,
    ) -> Self {
        Self {
            store: Arc::clone(store),
            footer: Rc::clone(footer),
            position,
            group: 0,
            reader: None,
            left: 0,
            batch: Batch::default(),
            next: 0,
            first: None,
            sum: crc.map(|crc| (flate2::Crc::new(), crc)),
        }
    }

    /// The next number; `None`: it is missing.
    pub(super) fn number(&mut self) -> Result<Option<f64>> {
        if self.next >= self.batch.numbers.len() {
            self.fill()?;
        }
        let number = self.batch.numbers.get(self.next).copied();
        let missing = self.batch.levels.get(self.next) == Some(&0);
        self.next += 1;
        number.ok_or_else(ended).map(|x| (!missing).then_some(x))
    }

    /// The next numbers as far as they are decoded, after one at least was; none where some of these are missing.
    pub(super) fn numbers(&mut self) -> Result<&[f64]> {
        if self.next >= self.batch.numbers.len() {
            self.fill()?;
        }
        Ok(self.decoded())
    }

    /// The next numbers as far as they are decoded; none where some of these are missing.
    pub(super) fn decoded(&self) -> &[f64] {
        if !self.batch.levels.is_empty() {
            return &[];
        }
        self.batch.numbers.get(self.next..).unwrap_or_default()
    }

    /// Number of the next texts that state no fault, as far as they are decoded.
    pub(super) fn good(&mut self) -> Result<usize> {
        if self.next >= self.batch.words.len() {
            self.fill()?;
        }
        let words = self.batch.words.get(self.next..).ok_or_else(ended)?;
        let good = words.iter().take_while(|w| **w == Ok(Health::GOOD));
        Ok(good.count())
    }

    /// Goes on by so many values of those that are decoded.
    pub(super) fn skip(&mut self, count: usize) {
        self.next += count;
    }

    /// The next text as faults, or the word in it that is none.
    pub(super) fn faults(&mut self) -> Result<std::result::Result<Health, String>> {
        if self.next >= self.batch.words.len() {
            self.fill()?;
        }
        let words = self.batch.words.get(self.next).cloned();
        self.next += 1;
        words.ok_or_else(ended)
    }

    /// `true` if all values have the checksum that is stated for them.
    pub(super) fn is_whole(&self) -> bool {
        let sum = self.sum.as_ref();
        sum.is_none_or(|(crc, stated)| crc.sum() == *stated)
    }

    fn fill(&mut self) -> Result<()> {
        self.batch.clear();
        self.next = 0;
        while self.left == 0 {
            let column = self.footer.columns.get(self.position).ok_or_else(ended)?;
            let group = self.footer.groups.get(self.group).ok_or_else(ended)?;
            let chunk = group.chunks.get(self.position).ok_or_else(ended)?;
            let values = column.values.ok_or_else(ended)?;
            let pages = Pages::new(&self.store, column, values, chunk);
            self.reader = Some(reader(column, values, pages)?);
            self.group += 1;
            self.left = chunk.values;
        }
        let most = usize::try_from(self.left).map_or(BATCH, |left| left.min(BATCH));
        // The crate's decoders stop the program at contradictions, and a reader that has met one is
        // not used again. Those that are known are refused before (`pages`).
        let read = catch_unwind(AssertUnwindSafe(|| self.decode(most)));
        let read = read.unwrap_or_else(|_| {
            Err(ParquetError::General(
                "values that cannot be decoded".to_owned(),
            ))
        });
        if read.is_err() {
            self.reader = None;
            self.left = 0;
            self.group = usize::MAX;
        }
        let read = read?;
        if read == 0 {
            return Err(ended());
        }
        self.left -= read as u64;
        Ok(())
    }

    fn decode(&mut self, most: usize) -> Result<usize> {
        let column = self.footer.columns.get(self.position);
        let meaning = match column.and_then(|c| c.values) {
            Some(Values::Int32(meaning) | Values::Int64(meaning)) => meaning,
            _ => Meaning::Signed,
        };
        let Self {
            reader,
            batch,
            first,
            sum,
            ..
        } = self;
        match reader {
            Some(ColumnReader::FloatColumnReader(reader)) => {
                let Batch { floats, bytes, .. } = batch;
                floats.clear();
                let found = reader.read_records(most, Some(&mut batch.levels), None, floats)?;
                if let Some((crc, _)) = sum {
                    bytes.resize(4 * floats.len(), 0);
                    for (slot, x) in bytes.chunks_exact_mut(4).zip(&*floats) {
                        slot.copy_from_slice(&x.to_le_bytes());
                    }
                    // A few bytes take as long to be summed up as many.
                    crc.update(bytes);
                }
                batch.numbers.extend(floats.iter().map(|x| f64::from(*x)));
                batch.spread(found.0)
            }
            Some(ColumnReader::DoubleColumnReader(reader)) => {
                let Batch {
                    numbers, levels, ..
                } = batch;
                let found = reader.read_records(most, Some(levels), None, numbers)?;
                batch.spread(found.0)
            }
            Some(ColumnReader::Int32ColumnReader(reader)) => {
                batch.read::<Int32Type>(reader, most, |x| match meaning {
                    Meaning::Unsigned => f64::from(*x as u32),
                    meaning => whole(i64::from(*x), meaning, first),
                })
            }
            Some(ColumnReader::Int64ColumnReader(reader)) => {
                batch.read::<Int64Type>(reader, most, |x| whole(*x, meaning, first))
            }
            Some(ColumnReader::FixedLenByteArrayColumnReader(reader)) => {
                let Some(Values::Fixed(_, unit)) = column.and_then(|c| c.values) else {
                    return Err(ended());
                };
                batch.read::<FixedLenByteArrayType>(reader, most, |x| wide(x.data()) as f64 / unit)
            }
            Some(ColumnReader::ByteArrayColumnReader(reader)) => {
                let mut texts = Vec::with_capacity(most);
                let levels = &mut batch.levels;
                let (records, ..) = reader.read_records(most, Some(levels), None, &mut texts)?;
                let mut texts = texts.iter();
                for k in 0..records {
                    let text = if batch.levels.get(k) == Some(&0) {
                        None
                    } else {
                        Some(texts.next().ok_or_else(ended)?)
                    };
                    batch.words.push(text.map_or(Ok(Health::GOOD), |x| {
                        faults::read(&String::from_utf8_lossy(x.data()))
                    }));
                }
                Ok(records)
            }
            _ => Err(ended()),
        }
    }
}

impl Batch {
    fn clear(&mut self) {
        self.numbers.clear();
        self.levels.clear();
        self.words.clear();
    }

    /// Reads whole numbers.
    fn read<T: DataType>(
        &mut self,
        reader: &mut ColumnReaderImpl<T>,
        most: usize,
        number: impl FnMut(&T::T) -> f64,
    ) -> Result<usize> {
        let mut values = Vec::with_capacity(most);
        let levels = &mut self.levels;
        let (records, ..) = reader.read_records(most, Some(levels), None, &mut values)?;
        self.numbers.extend(values.iter().map(number));
        self.spread(records)
    }

    /// Moves the numbers of so many records, which are stored without those that are missing, to their places.
    fn spread(&mut self, records: usize) -> Result<usize> {
        let stored = self.numbers.len();
        if stored == records {
            self.levels.clear();
            return Ok(records);
        }
        if self.levels.len() != records {
            return Err(ended());
        }
        self.numbers.resize(records, f64::NAN);
        let mut left = stored;
        for (k, level) in self.levels.iter().enumerate().rev() {
            let number = if *level == 0 {
                f64::NAN
            } else {
                left = left.checked_sub(1).ok_or_else(ended)?;
                *self.numbers.get(left).ok_or_else(ended)?
            };
            *self.numbers.get_mut(k).ok_or_else(ended)? = number;
        }
        Ok(records)
    }
}

fn ended() -> ParquetError {
    ParquetError::General("fewer values than its footer states".to_owned())
}

/// A whole number as its logical type has it.
fn whole(value: i64, meaning: Meaning, first: &mut Option<i64>) -> f64 {
    match meaning {
        Meaning::Signed => value as f64,
        Meaning::Unsigned => value as u64 as f64,
        Meaning::Scaled(unit) => value as f64 / unit,
        // Nanoseconds since 1970 are more than double precision holds.
        Meaning::Time(second) => {
            let first = *first.get_or_insert(value);
            value.wrapping_sub(first) as f64 * second
        }
    }
}

/// A whole number whose bytes begin with the highest, in two's complement.
fn wide(bytes: &[u8]) -> i128 {
    let first = bytes.first().map_or(0, |first| i128::from(*first as i8));
    let rest = bytes.get(1..).unwrap_or_default();
    rest.iter()
        .fold(first, |value, byte| value << 8 | i128::from(*byte))
}

fn reader(column: &Column, values: Values, pages: Pages) -> Result<ColumnReader> {
    use parquet::basic::{Repetition, Type as Physical};
    let physical = match values {
        Values::Float => Physical::FLOAT,
        Values::Double => Physical::DOUBLE,
        Values::Int32(_) => Physical::INT32,
        Values::Int64(_) => Physical::INT64,
        Values::Fixed(..) => Physical::FIXED_LEN_BYTE_ARRAY,
        Values::Text => Physical::BYTE_ARRAY,
    };
    let length = match values {
        Values::Fixed(bytes, _) => i32::try_from(bytes).unwrap_or(i32::MAX),
        _ => -1,
    };
    let repetition = if column.nullable {
        Repetition::OPTIONAL
    } else {
        Repetition::REQUIRED
    };
    let kind = Type::primitive_type_builder(&column.name, physical);
    let kind = kind
        .with_repetition(repetition)
        .with_length(length)
        .build()?;
    let path = ColumnPath::from(column.name.as_str());
    let described = ColumnDescriptor::new(Arc::new(kind), i16::from(column.nullable), 0, path);
    Ok(get_column_reader(Arc::new(described), Box::new(pages)))
}

//! The pages of a piece of a column, unpacked one at a time.
//!
//! The crate's own reader takes the memory that a page's header asks for, and its decoders stop the
//! program at pages that contradict themselves. So pages are read, held against limits and vetted
//! here, and only what is as the format has it is handed on.

use super::footer::{Chunk, Column, Values};
use super::thrift::{Kind, Read as Taken, Thrift};
use crate::limits;
use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use ruzstd::decoding::StreamingDecoder;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Bytes in which the header of a page is looked for: first these, then those.
const HEADERS: [u64; 2] = [1 << 9, 1 << 16];

/// Codecs by their number in the file.
pub(super) const CODECS: [&str; 8] = [
    "none", "snappy", "gzip", "LZO", "Brotli", "LZ4", "zstd", "LZ4",
];

/// `true` if pages in a codec can be unpacked.
pub(super) const fn is_read(codec: i64) -> bool {
    matches!(codec, 0 | 1 | 2 | 6)
}

/// The file, and the memory that its pages take.
pub(super) struct Store {
    file: Mutex<File>,
    size: u64,
    held: AtomicU64,
}

impl Store {
    /// The file and its size, bytes.
    pub(super) fn new(file: File, size: u64) -> Arc<Self> {
        Arc::new(Self {
            file: Mutex::new(file),
            size,
            held: AtomicU64::new(0),
        })
    }

    /// At most `most` bytes from a place on: fewer where the file ends.
    pub(super) fn read(&self, at: u64, most: u64) -> std::io::Result<Vec<u8>> {
        let mut file = match self.file.lock() {
            Ok(file) => file,
            Err(poisoned) => poisoned.into_inner(),
        };
        file.seek(SeekFrom::Start(at))?;
        // At once, since a vector that grows is filled by a dozen small reads.
        let there = most.min(self.size.saturating_sub(at));
        let mut bytes = vec![0; usize::try_from(there).unwrap_or_default()];
        file.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

/// The pages of a piece of a column.
pub(super) struct Pages {
    store: Arc<Store>,
    values: Values,
    nullable: bool,
    codec: i64,
    at: u64,
    end: u64,
    /// Values of the piece that are to come.
    left: u64,
    has_dictionary: bool,
    /// Memory of the dictionary and of the page read last.
    held: [u64; 2],
}

/// Header of a page.
#[derive(Default)]
struct Header {
    kind: i64,
    unpacked: u64,
    packed: u64,
    crc: Option<u32>,
    values: u64,
    encoding: i64,
    /// Encoding of the levels, in pages of version 1.
    levels: i64,
    /// Nulls, and bytes of the definition and of the repetition levels, in pages of version 2.
    nulls: u64,
    definition: u64,
    repetition: u64,
    is_packed: bool,
}

fn wrong(reason: impl Into<String>) -> ParquetError {
    ParquetError::General(reason.into())
}

fn size(thrift: &mut Thrift<'_>, kind: Kind) -> Taken<u64> {
    u64::try_from(thrift.whole(kind)?).map_err(|_| "a page of fewer than no bytes or values")
}

impl Header {
    /// Reads a header and its length.
    fn read(bytes: &[u8]) -> Taken<(Self, u64)> {
        let mut header = Self {
            is_packed: true,
            ..Self::default()
        };
        let mut thrift = Thrift::new(bytes);
        thrift.fields(|t, field, kind| match field {
            1 => t.whole(kind).map(|x| header.kind = x),
            2 => size(t, kind).map(|x| header.unpacked = x),
            3 => size(t, kind).map(|x| header.packed = x),
            4 => t.whole(kind).map(|x| header.crc = Some(x as u32)),
            // Pages of version 1, and dictionaries.
            5 | 7 => t.structure(kind, |t, part, kind| match part {
                1 => size(t, kind).map(|x| header.values = x),
                2 => t.whole(kind).map(|x| header.encoding = x),
                3 if field == 5 => t.whole(kind).map(|x| header.levels = x),
                _ => t.skip(kind),
            }),
            8 => t.structure(kind, |t, part, kind| match part {
                1 => size(t, kind).map(|x| header.values = x),
                2 => size(t, kind).map(|x| header.nulls = x),
                4 => t.whole(kind).map(|x| header.encoding = x),
                5 => size(t, kind).map(|x| header.definition = x),
                6 => size(t, kind).map(|x| header.repetition = x),
                7 => t.flag(kind).map(|x| header.is_packed = x),
                _ => t.skip(kind),
            }),
            _ => t.skip(kind),
        })?;
        Ok((header, thrift.read() as u64))
    }
}

impl Pages {
    pub(super) fn new(store: &Arc<Store>, column: &Column, values: Values, chunk: &Chunk) -> Self {
        Self {
            store: Arc::clone(store),
            values,
            nullable: column.nullable,
            codec: chunk.codec,
            at: chunk.begin,
            end: chunk.begin.saturating_add(chunk.bytes),
            left: chunk.values,
            has_dictionary: false,
            held: [0; 2],
        }
    }

    fn header(&self) -> Result<(Header, u64)> {
        let mut reason = "";
        for most in HEADERS {
            let bytes = self.store.read(self.at, most.min(self.end - self.at))?;
            match Header::read(&bytes) {
                Ok(header) => return Ok(header),
                Err(error) => reason = error,
            }
        }
        Err(wrong(format!("{reason} at byte {} of the file", self.at)))
    }

    /// Counts memory in the place of what was held in it before.
    fn hold(&mut self, place: usize, bytes: u64) -> Result<()> {
        let held = &mut self.held[place];
        let all = &self.store.held;
        let before = all.fetch_sub(*held, Ordering::Relaxed) - *held;
        *held = bytes;
        all.fetch_add(bytes, Ordering::Relaxed);
        if before + bytes > limits::PAGES {
            return Err(wrong(format!(
                "pages of all columns that take more than {} MiB at a time",
                limits::PAGES >> 20
            )));
        }
        Ok(())
    }

    /// The next page that is no index; `None` behind the last value.
    fn next_page(&mut self) -> Result<Option<Page>> {
        while self.left > 0 {
            if self.at >= self.end {
                return Err(wrong(format!(
                    "{} values are missing at its end",
                    self.left
                )));
            }
            let (header, length) = self.header()?;
            let begin = self.at + length;
            self.at = begin.saturating_add(header.packed);
            for bytes in [header.packed, header.unpacked] {
                if bytes > limits::PAGE {
                    return Err(wrong(format!(
                        "a page of {bytes} bytes, where at most {} MiB can be read",
                        limits::PAGE >> 20
                    )));
                }
            }
            if !matches!(header.kind, 0 | 2 | 3) {
                continue;
            }
            let packed = self.store.read(begin, header.packed)?;
            if (packed.len() as u64) < header.packed || self.at > self.end {
                return Err(wrong("a page that breaks off"));
            }
            if header.crc.is_some_and(|crc| crc != crc_of(&packed)) {
                return Err(wrong(
                    "a page whose checksum is another one than its header's",
                ));
            }
            if header.kind == 2 {
                return self.dictionary(&header, &packed).map(Some);
            }
            if header.values == 0 {
                continue;
            }
            let left = self.left.checked_sub(header.values);
            self.left = left.ok_or_else(|| wrong("more values than its footer states"))?;
            let place = usize::from(header.kind == 3);
            return [Self::data, Self::data_2][place](self, &header, &packed).map(Some);
        }
        Ok(None)
    }

    fn dictionary(&mut self, header: &Header, packed: &[u8]) -> Result<Page> {
        if std::mem::replace(&mut self.has_dictionary, true) {
            return Err(wrong("a second dictionary"));
        }
        let bytes = unpack(self.codec, packed, header.unpacked)?;
        let least = self.values.width().unwrap_or(4) as u64;
        let texts = self.values.width().is_none();
        let is_list = !texts || texts_in(&bytes) == Some(header.values);
        let fits = header.values <= bytes.len() as u64 / least;
        if !matches!(header.encoding, 0 | 2) || !is_list || !fits {
            return Err(wrong("a dictionary that is no list of values"));
        }
        // As it lies in the file, and as values, of which texts take some 32 bytes each.
        let decoded = header.values * self.values.width().unwrap_or(32) as u64;
        self.hold(0, bytes.len() as u64 + decoded)?;
        Ok(Page::DictionaryPage {
            buf: bytes.into(),
            num_values: header.values as u32,
            encoding: Encoding::PLAIN,
            is_sorted: false,
        })
    }

    /// A page of version 1: levels and values unpacked together.
    fn data(&mut self, header: &Header, packed: &[u8]) -> Result<Page> {
        let mut bytes = unpack(self.codec, packed, header.unpacked)?;
        self.hold(1, bytes.len() as u64)?;
        let mut levels = 0;
        if self.nullable {
            let stated = bytes
                .first_chunk()
                .map(|length| u32::from_le_bytes(*length));
            levels = stated.map_or(usize::MAX, |length| 4 + length as usize);
            if header.levels != 3 || levels > bytes.len() {
                return Err(wrong("a page whose marks of missing values cannot be read"));
            }
        }
        let encoding = self.vet(header, &mut bytes, levels)?;
        Ok(Page::DataPage {
            buf: bytes.into(),
            num_values: header.values as u32,
            encoding,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        })
    }

    /// A page of version 2: levels as they are, then values.
    fn data_2(&mut self, header: &Header, packed: &[u8]) -> Result<Page> {
        let levels = header.definition as usize;
        let fits = levels <= packed.len() && header.definition <= header.unpacked;
        if header.repetition > 0 || !fits || header.nulls > header.values {
            return Err(wrong("a page whose marks of missing values cannot be read"));
        }
        let codec = if header.is_packed { self.codec } else { 0 };
        let (marks, packed) = packed.split_at(levels);
        let values = if packed.is_empty() {
            Vec::new()
        } else {
            unpack(codec, packed, header.unpacked - header.definition)?
        };
        let mut bytes = Vec::with_capacity(marks.len() + values.len());
        bytes.extend_from_slice(marks);
        bytes.extend_from_slice(&values);
        self.hold(1, bytes.len() as u64)?;
        let encoding = self.vet(header, &mut bytes, levels)?;
        Ok(Page::DataPageV2 {
            buf: bytes.into(),
            num_values: header.values as u32,
            encoding,
            num_nulls: header.nulls as u32,
            num_rows: header.values as u32,
            def_levels_byte_len: header.definition as u32,
            rep_levels_byte_len: 0,
            is_compressed: false,
            statistics: None,
        })
    }

    /// Checks the values of a page, which begin behind its levels, and brings them into an encoding
    /// that the crate's decoders read without further conditions.
    fn vet(&self, header: &Header, bytes: &mut Vec<u8>, levels: usize) -> Result<Encoding> {
        let values = bytes.get_mut(levels..).unwrap_or_default();
        match (header.encoding, self.values) {
            (0, Values::Text) => {
                let Some(there) = texts_in(values) else {
                    return Err(wrong("a page of texts that cannot be read"));
                };
                // The crate's decoder takes it for granted that all texts are there. Those that are
                // marked as missing are not asked for; others are texts that nobody takes for one.
                for _ in there..header.values {
                    bytes.extend_from_slice(&[1, 0, 0, 0, b'?']);
                }
                Ok(Encoding::PLAIN)
            }
            (0, _) => Ok(Encoding::PLAIN),
            (2 | 8, _) if self.has_dictionary => Ok(Encoding::RLE_DICTIONARY),
            (2 | 8, _) => Err(wrong(
                "a page that refers to a dictionary, and there is none",
            )),
            (5, Values::Int32(_) | Values::Int64(_)) => {
                let Some(there) = deltas(values) else {
                    return Err(wrong("a page of differences that cannot be read"));
                };
                if there == 0 {
                    // The crate's decoder takes a first one.
                    bytes.truncate(levels);
                    return Ok(Encoding::PLAIN);
                }
                Ok(Encoding::DELTA_BINARY_PACKED)
            }
            (9, _) if self.values.width().is_some() => {
                // The crate's decoder takes it for granted that all values are there.
                let width = self.values.width().unwrap_or(1);
                let split = values.to_vec();
                let count = split.len() / width;
                for (n, value) in values.chunks_exact_mut(width).enumerate() {
                    for (k, byte) in value.iter_mut().enumerate() {
                        *byte = split.get(n + k * count).copied().unwrap_or_default();
                    }
                }
                Ok(Encoding::PLAIN)
            }
            (encoding, _) => Err(wrong(format!("values in the encoding number {encoding}"))),
        }
    }
}

/// Number of values in differences of whole numbers; `None` if their header is none.
fn deltas(bytes: &[u8]) -> Option<u64> {
    let mut rest = bytes.iter();
    let mut number = || {
        let mut value = 0_u64;
        for shift in (0..35).step_by(7) {
            let byte = rest.next()?;
            value |= u64::from(byte & 0x7f) << shift;
            if *byte < 0x80 {
                return Some(value);
            }
        }
        None
    };
    let [block, parts, values] = [number()?, number()?, number()?];
    let sound = (128..=1 << 16).contains(&block) && (1..=512).contains(&parts);
    (sound && values <= u64::from(u32::MAX)).then_some(values)
}

/// Number of texts, each behind its length; `None` if the last one breaks off.
fn texts_in(mut bytes: &[u8]) -> Option<u64> {
    let mut count = 0;
    while !bytes.is_empty() {
        let (length, rest) = bytes.split_first_chunk()?;
        bytes = rest.get(u32::from_le_bytes(*length) as usize..)?;
        count += 1;
    }
    Some(count)
}

fn crc_of(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}

/// Unpacks bytes that are to become so many.
fn unpack(codec: i64, packed: &[u8], size: u64) -> Result<Vec<u8>> {
    let unpacked = match codec {
        0 => packed.to_vec(),
        1 => {
            let stated = snap::raw::decompress_len(packed);
            if stated.map_err(|e| wrong(e.to_string()))? as u64 != size {
                return Err(wrong("a page of another size than its header states"));
            }
            let unpacked = snap::raw::Decoder::new().decompress_vec(packed);
            unpacked.map_err(|e| wrong(e.to_string()))?
        }
        2 => read_all(flate2::read::MultiGzDecoder::new(packed), size)?,
        6 => {
            let unpacked = StreamingDecoder::new_with_max_window_size(packed, limits::PAGE);
            read_all(unpacked.map_err(|e| wrong(e.to_string()))?, size)?
        }
        other => return Err(wrong(format!("pages in the codec number {other}"))),
    };
    if unpacked.len() as u64 == size {
        Ok(unpacked)
    } else {
        Err(wrong("a page of another size than its header states"))
    }
}

/// All bytes of a reader, and at most one more than there should be.
fn read_all(reader: impl Read, size: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.take(size + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

impl Drop for Pages {
    fn drop(&mut self) {
        let held = self.held.iter().sum();
        self.store.held.fetch_sub(held, Ordering::Relaxed);
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        self.next_page()
    }

    // Nothing is skipped here, and no column has repetition levels.
    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        Err(wrong("pages are read in their order"))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        Err(wrong("pages are read in their order"))
    }
}

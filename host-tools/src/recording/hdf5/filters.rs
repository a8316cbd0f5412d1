//! Filters that chunks were written through: deflate, shuffle and checksums.

use super::file::Cursor;
use flate2::bufread::ZlibDecoder;
use std::io::Read;

/// A filter that is read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Filter {
    Deflate,
    /// Bytes of equal place in numbers of this size lie together.
    Shuffle(usize),
    Checksum,
}

/// The filters of a dataset, in the order of writing.
#[derive(Clone, Debug, Default)]
pub(super) struct Filters(Vec<Filter>);

impl Filters {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Reads them; or the number of one that is not read.
    pub(super) fn read(mut cursor: Cursor<'_>) -> Option<Result<Self, u64>> {
        let version = cursor.byte()?;
        let count = cursor.byte()?;
        cursor.take(if version == 1 { 6 } else { 0 })?;
        let mut filters = Vec::new();
        for _ in 0..count {
            let number = cursor.uint(2)?;
            let named = version == 1 || number >= 256;
            let name = if named { cursor.uint(2)? as usize } else { 0 };
            cursor.uint(2)?;
            let values = cursor.uint(2)? as usize;
            cursor.take(if version == 1 {
                name.next_multiple_of(8)
            } else {
                name
            })?;
            let first = Cursor(cursor.take(4 * values)?).uint(4);
            cursor.take(if version == 1 && values % 2 == 1 {
                4
            } else {
                0
            })?;
            filters.push(match number {
                1 => Filter::Deflate,
                2 => Filter::Shuffle(first? as usize),
                3 => Filter::Checksum,
                other => return Some(Err(other)),
            });
        }
        Some(Ok(Self(filters)))
    }

    /// Undoes the filters but those of `mask`, which were left out: the bytes of a chunk, `size` of
    /// them, or the fault.
    pub(super) fn undo(&self, stored: Vec<u8>, mask: u32, size: usize) -> Result<Vec<u8>, String> {
        let mut bytes = stored;
        for (number, filter) in self.0.iter().enumerate().rev() {
            if mask.checked_shr(number as u32).unwrap_or(0) & 1 != 0 {
                continue;
            }
            bytes = match filter {
                Filter::Deflate => {
                    // A checksum behind the numbers may be compressed with them.
                    let most = size as u64 + 5;
                    let mut unpacked = Vec::with_capacity(size + 5);
                    let mut decoder = ZlibDecoder::new(bytes.as_slice()).take(most);
                    let read = decoder.read_to_end(&mut unpacked);
                    read.map_err(|e| format!("compressed numbers that break off ({e})"))?;
                    unpacked
                }
                Filter::Shuffle(width) => unshuffled(&bytes, *width),
                Filter::Checksum => {
                    let (numbers, sum) = bytes
                        .split_last_chunk::<4>()
                        .ok_or("no checksum behind the numbers")?;
                    if fletcher(numbers) != u32::from_le_bytes(*sum) {
                        return Err("numbers that do not have their checksum".to_owned());
                    }
                    numbers.to_vec()
                }
            };
        }
        match bytes.len() {
            found if found == size => Ok(bytes),
            found => Err(format!("{found} bytes of numbers")),
        }
    }
}

fn unshuffled(bytes: &[u8], width: usize) -> Vec<u8> {
    let count = bytes.len() / width.max(1);
    if width <= 1 || count <= 1 {
        return bytes.to_vec();
    }
    let mut numbers = bytes.to_vec();
    for (place, plane) in bytes.chunks_exact(count).take(width).enumerate() {
        let slots = numbers.iter_mut().skip(place).step_by(width);
        for (slot, byte) in slots.zip(plane) {
            *slot = *byte;
        }
    }
    numbers
}

/// Fletcher's checksum of 32 bits over words of two bytes, the most significant one first.
fn fletcher(bytes: &[u8]) -> u32 {
    let (mut low, mut high) = (0_u32, 0_u32);
    for pair in bytes.chunks(2) {
        let word = u32::from(pair.first().copied().unwrap_or(0)) << 8
            | u32::from(pair.get(1).copied().unwrap_or(0));
        low = (low + word) % 65_535;
        high = (high + low) % 65_535;
    }
    high << 16 | low
}

//! Text as UTF-8: byte order marks, UTF-16, and characters of a single byte.

use std::io::{self, Read};

/// Byte order mark of UTF-8.
const UTF_8: [u8; 3] = [0xef, 0xbb, 0xbf];
/// Bytes that are read at a time.
const CHUNK: usize = 8192;

/// Encoding of a text by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// UTF-8, or an encoding whose first 128 characters are its.
    Bytes,
    /// UTF-8 behind its mark.
    Marked,
    /// UTF-16, least significant byte first.
    Little,
    /// UTF-16, most significant byte first.
    Big,
}

impl Encoding {
    /// Encoding of a text that starts with these bytes.
    pub(super) fn of(start: &[u8]) -> Self {
        match start {
            [0xff, 0xfe, ..] => Self::Little,
            [0xfe, 0xff, ..] => Self::Big,
            start if start.starts_with(&UTF_8) => Self::Marked,
            _ => Self::Bytes,
        }
    }

    /// The text without its mark, in UTF-8 where it was UTF-16.
    ///
    /// # Errors
    /// The reader's.
    pub(super) fn decoded(self, mut text: Box<dyn Read>) -> io::Result<Box<dyn Read>> {
        let mark = match self {
            Self::Bytes => return Ok(text),
            Self::Marked => UTF_8.len(),
            Self::Little | Self::Big => 2,
        };
        text.read_exact(&mut [0; 3][..mark])?;
        if self == Self::Marked {
            return Ok(text);
        }
        Ok(Box::new(Utf16 {
            text,
            big: self == Self::Big,
            raw: Vec::new(),
            high: None,
            ready: Vec::new(),
            given: 0,
        }))
    }
}

/// A reader of UTF-16 as UTF-8. Half a pair of surrogates becomes the replacement character.
struct Utf16 {
    text: Box<dyn Read>,
    big: bool,
    /// A byte whose other half has not been read.
    raw: Vec<u8>,
    /// The first unit of a pair.
    high: Option<u16>,
    ready: Vec<u8>,
    given: usize,
}

impl Utf16 {
    fn push(&mut self, units: &[u16]) {
        for decoded in char::decode_utf16(units.iter().copied()) {
            let c = decoded.unwrap_or(char::REPLACEMENT_CHARACTER);
            let mut bytes = [0; 4];
            self.ready
                .extend_from_slice(c.encode_utf8(&mut bytes).as_bytes());
        }
    }

    /// Decodes the next bytes; nothing is ready behind the last one.
    fn refill(&mut self) -> io::Result<()> {
        self.ready.clear();
        self.given = 0;
        while self.ready.is_empty() {
            let mut chunk = [0; CHUNK];
            let count = match self.text.read(&mut chunk) {
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                read => read?,
            };
            if count == 0 {
                let half = !std::mem::take(&mut self.raw).is_empty();
                let mut rest: Vec<u16> = self.high.take().into_iter().collect();
                // Half a unit is no character.
                rest.extend(half.then_some(0xfffd));
                self.push(&rest);
                return Ok(());
            }
            self.raw
                .extend_from_slice(chunk.get(..count).unwrap_or(&[]));
            let mut units: Vec<u16> = self.high.take().into_iter().collect();
            let pairs = self.raw.chunks_exact(2);
            let rest = pairs.remainder().to_vec();
            units.extend(pairs.map(|pair| match (self.big, pair) {
                (true, [a, b]) => u16::from_be_bytes([*a, *b]),
                (false, [a, b]) => u16::from_le_bytes([*a, *b]),
                _ => 0,
            }));
            self.raw = rest;
            self.high = units.pop_if(|last| (0xd800..0xdc00).contains(last));
            self.push(&units);
        }
        Ok(())
    }
}

impl Read for Utf16 {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.given == self.ready.len() {
            self.refill()?;
        }
        let ready = self.ready.get(self.given..).unwrap_or(&[]);
        let count = ready.len().min(buffer.len());
        for (slot, byte) in buffer.iter_mut().zip(ready) {
            *slot = *byte;
        }
        self.given += count;
        Ok(count)
    }
}

/// A field as text: UTF-8, else one character a byte as in Windows-1252, whose letters and signs
/// beyond ASCII are Unicode's but for 27 of them that no unit or name needs.
pub(super) fn text(field: &[u8]) -> String {
    match std::str::from_utf8(field) {
        Ok(text) => text.to_owned(),
        Err(_) => field.iter().copied().map(char::from).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that gives a byte at a time.
    struct Slow(std::vec::IntoIter<u8>);

    impl Read for Slow {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match (buffer.first_mut(), self.0.next()) {
                (Some(slot), Some(byte)) => {
                    *slot = byte;
                    Ok(1)
                }
                _ => Ok(0),
            }
        }
    }

    fn read(bytes: Vec<u8>) -> String {
        let encoding = Encoding::of(&bytes);
        let decode = |reader: Box<dyn Read>| {
            let mut text = String::new();
            let mut decoded = encoding.decoded(reader).unwrap();
            decoded.read_to_string(&mut text).unwrap();
            text
        };
        let whole = decode(Box::new(io::Cursor::new(bytes.clone())));
        assert_eq!(decode(Box::new(Slow(bytes.into_iter()))), whole);
        whole
    }

    #[test]
    fn utf16_of_both_orders_reads_as_utf8() {
        let text = "Zeit;a [m/s²]\r\n時間;𝄞\n".repeat(2000);
        let units = || text.encode_utf16();
        let little: Vec<u8> = units().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = units().flat_map(u16::to_be_bytes).collect();
        assert_eq!(read([&[0xff, 0xfe], &little[..]].concat()), text);
        assert_eq!(read([&[0xfe, 0xff], &big[..]].concat()), text);
        assert_eq!(read([&UTF_8, text.as_bytes()].concat()), text);
        // Cut within a pair, and within a unit.
        let cut = |bytes: usize| read([&[0xff, 0xfe][..], &[0x34, 0xd8, 0x1e][..bytes]].concat());
        assert_eq!(cut(2), "\u{fffd}");
        assert_eq!(cut(3), "\u{fffd}\u{fffd}");
    }

    #[test]
    fn a_field_of_single_bytes_is_text() {
        assert_eq!(text(b"m/s\xb2"), "m/s²");
        assert_eq!(text("m/s²".as_bytes()), "m/s²");
    }
}

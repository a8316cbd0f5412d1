//! The compact protocol of Thrift, in which footers and page headers of Parquet are written.
//!
//! No length is trusted: a text or a list that is longer than the bytes behind it is an error
//! before memory is taken for it.

/// Deepest nesting of parts that are not read.
const DEEPEST: u8 = 16;

/// Result of reading; the error says what is wrong.
pub(super) type Read<T> = Result<T, &'static str>;

const ENDS: &str = "a header that breaks off";
const OTHER: &str = "a header with a field of another kind";

/// Kind of a value, as the protocol numbers it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind(u8);

const TRUE: Kind = Kind(1);
const FALSE: Kind = Kind(2);
const BYTE: Kind = Kind(3);
const DOUBLE: Kind = Kind(7);
const TEXT: Kind = Kind(8);
const LIST: Kind = Kind(9);
const SET: Kind = Kind(10);
const MAP: Kind = Kind(11);
const STRUCTURE: Kind = Kind(12);

/// Bytes in the compact protocol, read from their beginning.
pub(super) struct Thrift<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Thrift<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Number of bytes that were read.
    pub(super) const fn read(&self) -> usize {
        self.at
    }

    fn take(&mut self, count: usize) -> Read<&'a [u8]> {
        let end = self.at.checked_add(count).ok_or(ENDS)?;
        let taken = self.bytes.get(self.at..end).ok_or(ENDS)?;
        self.at = end;
        Ok(taken)
    }

    fn byte(&mut self) -> Read<u8> {
        Ok(self.take(1)?.first().copied().unwrap_or_default())
    }

    fn varint(&mut self) -> Read<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("a header with a number of more than 64 bits")
    }

    /// A whole number of any size.
    pub(super) fn whole(&mut self, kind: Kind) -> Read<i64> {
        match kind {
            BYTE => Ok(i64::from(self.byte()? as i8)),
            Kind(4..=6) => {
                let zigzag = self.varint()?;
                Ok((zigzag >> 1) as i64 ^ -((zigzag & 1) as i64))
            }
            _ => Err(OTHER),
        }
    }

    /// A truth value.
    pub(super) fn flag(&self, kind: Kind) -> Read<bool> {
        match kind {
            TRUE => Ok(true),
            FALSE => Ok(false),
            _ => Err(OTHER),
        }
    }

    /// Bytes or a text.
    pub(super) fn text(&mut self, kind: Kind) -> Read<&'a [u8]> {
        if kind != TEXT {
            return Err(OTHER);
        }
        let length = self.varint()?;
        self.take(usize::try_from(length).map_err(|_| ENDS)?)
    }

    /// A structure: calls `field` with each field's number and kind, which has to read it.
    pub(super) fn structure(
        &mut self,
        kind: Kind,
        field: impl FnMut(&mut Self, i64, Kind) -> Read<()>,
    ) -> Read<()> {
        if kind == STRUCTURE {
            self.fields(field)
        } else {
            Err(OTHER)
        }
    }

    /// The fields of a structure that begins here.
    pub(super) fn fields(
        &mut self,
        mut field: impl FnMut(&mut Self, i64, Kind) -> Read<()>,
    ) -> Read<()> {
        let mut number = 0_i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(());
            }
            number = match head >> 4 {
                0 => self.whole(Kind(4))?,
                step => number.wrapping_add(i64::from(step)),
            };
            field(self, number, Kind(head & 0xf))?;
        }
    }

    /// A list: calls `element` once for each, with its kind, which has to read it.
    pub(super) fn list(
        &mut self,
        kind: Kind,
        mut element: impl FnMut(&mut Self, Kind) -> Read<()>,
    ) -> Read<()> {
        if kind != LIST && kind != SET {
            return Err(OTHER);
        }
        let head = self.byte()?;
        let count = match head >> 4 {
            15 => self.varint()?,
            count => u64::from(count),
        };
        // Each takes a byte at least.
        if count > (self.bytes.len() - self.at) as u64 {
            return Err(ENDS);
        }
        for _ in 0..count {
            element(self, Kind(head & 0xf))?;
        }
        Ok(())
    }

    /// Passes over a value.
    pub(super) fn skip(&mut self, kind: Kind) -> Read<()> {
        self.skip_within(kind, 0)
    }

    fn skip_within(&mut self, kind: Kind, depth: u8) -> Read<()> {
        if depth > DEEPEST {
            return Err("a header that is nested too deeply");
        }
        match kind {
            TRUE | FALSE => Ok(()),
            BYTE | Kind(4..=6) => self.whole(kind).map(drop),
            DOUBLE => self.take(8).map(drop),
            TEXT => self.text(kind).map(drop),
            LIST | SET => self.list(kind, |own, kind| own.skip_element(kind, depth + 1)),
            STRUCTURE => self.fields(|own, _, kind| own.skip_within(kind, depth + 1)),
            MAP => {
                let count = self.varint()?;
                let kinds = if count == 0 { 0 } else { self.byte()? };
                for _ in 0..count {
                    self.skip_element(Kind(kinds >> 4), depth + 1)?;
                    self.skip_element(Kind(kinds & 0xf), depth + 1)?;
                }
                Ok(())
            }
            _ => Err(OTHER),
        }
    }

    /// Passes over an element of a list, where truth values take a byte.
    fn skip_element(&mut self, kind: Kind, depth: u8) -> Read<()> {
        match kind {
            TRUE | FALSE => self.byte().map(drop),
            kind => self.skip_within(kind, depth),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_taken_that_is_not_there() {
        // A text, a list and a map of 2³¹ bytes and elements.
        let long = [0xff, 0xff, 0xff, 0xff, 0x07];
        let text = Thrift::new(&long).text(TEXT);
        assert_eq!(text, Err(ENDS));
        let mut list = vec![0xfc];
        list.extend_from_slice(&long);
        assert_eq!(Thrift::new(&list).skip(LIST), Err(ENDS));
        let mut map = long.to_vec();
        map.push(0xcc);
        assert_eq!(Thrift::new(&map).skip(MAP), Err(ENDS));
        // Structures in each other, and a number without an end.
        assert!(Thrift::new(&[0x1c; 1000]).skip(STRUCTURE).is_err());
        assert!(Thrift::new(&[0xff; 20]).whole(Kind(5)).is_err());
    }

    #[test]
    fn fields_are_numbered_by_steps_and_in_full() {
        // Field 3: -2 as i32; field 100, in full: a text; field 101: true; the end.
        let bytes = [
            0x35, 0x03, 0x08, 0xc8, 0x01, 0x02, b'h', b'i', 0x11, 0x00, 0xee,
        ];
        let mut thrift = Thrift::new(&bytes);
        let mut seen = Vec::new();
        let done = thrift.fields(|own, number, kind| {
            seen.push(number);
            match number {
                3 => assert_eq!(own.whole(kind), Ok(-2)),
                100 => assert_eq!(own.text(kind), Ok(&b"hi"[..])),
                _ => assert_eq!(own.flag(kind), Ok(true)),
            }
            Ok(())
        });
        assert_eq!((done, seen, thrift.read()), (Ok(()), vec![3, 100, 101], 10));
    }
}

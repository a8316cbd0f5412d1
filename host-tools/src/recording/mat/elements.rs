//! The elements of a MAT file of version 5: variables, and the numbers in them.

use crate::limits;
use crate::recording::bytes::{Bytes, Part};
use crate::recording::columns::Series;
use crate::recording::number::{Coding, Kind};
use crate::recording::{Place, RecordingError};
use flate2::bufread::ZlibDecoder;
use std::io::{self, Read};
use std::rc::Rc;

/// Bytes of the header of a file.
const HEADER: u64 = 128;
/// Most bytes of a name. MATLAB allows 63.
const NAME: u32 = 4096;
/// Kinds of an element.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// A numeric variable.
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) dimensions: [u64; 2],
    /// First byte of its element in the file.
    pub(super) at: u64,
    /// The bytes of the element, compressed or not.
    part: [u64; 2],
    compressed: bool,
    coding: Coding,
    /// Bytes of the element, unpacked, before its first number.
    lead: u64,
}

/// Error within an element: an error of the reader, or what was found and what was expected.
enum Wrong {
    Io(io::Error),
    Other(String, &'static str),
}

impl From<io::Error> for Wrong {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// The bytes of an element.
fn content(bytes: &Rc<Bytes>, [at, end]: [u64; 2], compressed: bool) -> Box<dyn Read> {
    let part: Part = bytes.part(at, end);
    if compressed {
        Box::new(ZlibDecoder::new(part))
    } else {
        Box::new(part)
    }
}

/// A reader that counts, in the order of bytes of the file.
struct Elements<'a> {
    inner: &'a mut dyn Read,
    big: bool,
    read: u64,
}

/// Type and length of an element, and bytes from its data to the next one.
struct Tag {
    kind: u32,
    length: u32,
    padded: u64,
}

impl Elements<'_> {
    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.inner.read_exact(&mut bytes)?;
        self.read += N as u64;
        Ok(bytes)
    }

    fn u32(&mut self) -> io::Result<u32> {
        let bytes = self.bytes()?;
        Ok(if self.big {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    fn tag(&mut self) -> io::Result<Tag> {
        let first = self.u32()?;
        // Up to four bytes lie in the tag itself.
        if first >> 16 != 0 {
            return Ok(Tag {
                kind: first & 0xffff,
                length: (first >> 16).min(4),
                padded: 4,
            });
        }
        let length = self.u32()?;
        Ok(Tag {
            kind: first,
            length,
            padded: u64::from(length).next_multiple_of(8),
        })
    }

    fn skip(&mut self, count: u64) -> io::Result<()> {
        skip(self.inner, count)?;
        self.read += count;
        Ok(())
    }
}

/// Leaves out bytes, all of which have to be there.
fn skip(from: &mut dyn Read, count: u64) -> io::Result<()> {
    let skipped = io::copy(&mut from.take(count), &mut io::sink())?;
    if skipped < count {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(())
}

/// The numeric variables of a file, and notes on the others.
pub(super) fn variables(bytes: &Rc<Bytes>) -> Result<(Vec<Variable>, Vec<String>), RecordingError> {
    let header = bytes.part(HEADER - 2, HEADER);
    let big = header.bytes().next().and_then(Result::ok) == Some(b'M');
    let (mut variables, mut notes) = (Vec::new(), Vec::new());
    let mut at = HEADER;
    // A file may end with padding that is no tag.
    while at + 8 <= bytes.len {
        let mut part = bytes.part(at, bytes.len);
        let mut elements = Elements {
            inner: &mut part,
            big,
            read: 0,
        };
        let tag = elements.tag().map_err(|e| bytes.damaged(at, &e))?;
        let lead = elements.read;
        let place = Place::Byte(at);
        let begin = at + lead;
        let end = begin + u64::from(tag.length);
        let is_known = [MATRIX, COMPRESSED].contains(&tag.kind);
        if !is_known || lead != 8 {
            let found = format!("an element of type {}", tag.kind);
            return Err(bytes.malformed(place, "", found, "a variable (14 or 15)"));
        }
        if end > bytes.len {
            let found = format!("{} bytes up to the end of the file", bytes.len - begin);
            let expected = format!("{} as the variable states", tag.length);
            return Err(bytes.malformed(place, "", found, expected));
        }
        let compressed = tag.kind == COMPRESSED;
        let mut inner = content(bytes, [begin, end], compressed);
        let found = variable(&mut *inner, big, compressed, [begin, end]);
        match found {
            Ok(Ok(variable)) => variables.push(Variable { at, ..variable }),
            Ok(Err(Some(note))) => notes.push(note),
            Ok(Err(None)) => {}
            Err(Wrong::Io(e)) => return Err(bytes.damaged(at, &e)),
            Err(Wrong::Other(found, expected)) => {
                return Err(bytes.malformed(place, "", found, expected));
            }
        }
        if variables.len() + notes.len() > limits::COLUMNS {
            return Err(RecordingError::TooManyColumns {
                file: bytes.file.clone(),
                found: variables.len() + notes.len(),
            });
        }
        // Compressed elements are not padded.
        at = if compressed {
            end
        } else {
            end.next_multiple_of(8)
        };
    }
    Ok((variables, notes))
}

/// Reads a variable up to its numbers; or a note where it has none that are read.
fn variable(
    inner: &mut dyn Read,
    big: bool,
    compressed: bool,
    part: [u64; 2],
) -> Result<Result<Variable, Option<String>>, Wrong> {
    let mut elements = Elements {
        inner,
        big,
        read: 0,
    };
    let mut size = part[1] - part[0];
    if compressed {
        let tag = elements.tag()?;
        if tag.kind != MATRIX {
            let found = format!("an element of type {} within a compressed one", tag.kind);
            return Err(Wrong::Other(found, "a variable (14)"));
        }
        size = u64::from(tag.length) + 8;
    }
    if size < 16 {
        // The workspace of functions, and variables without anything.
        return Ok(Err(None));
    }
    let flags = elements.tag()?;
    if (flags.kind, flags.length) != (6, 8) {
        let found = format!(
            "an element of type {} and {} bytes",
            flags.kind, flags.length
        );
        return Err(Wrong::Other(found, "the flags of a variable (6, 8 bytes)"));
    }
    let class = elements.u32()?;
    elements.u32()?;
    let shape = elements.tag()?;
    if shape.kind != 5 || shape.length < 8 || shape.length % 4 != 0 {
        let found = format!(
            "an element of type {} and {} bytes",
            shape.kind, shape.length
        );
        return Err(Wrong::Other(found, "the dimensions of a variable (5)"));
    }
    let dimensions = [elements.u32()?, elements.u32()?].map(u64::from);
    elements.skip(shape.padded - 8)?;
    let name = elements.tag()?;
    if name.kind != 1 || name.length > NAME {
        let found = format!("an element of type {} and {} bytes", name.kind, name.length);
        return Err(Wrong::Other(found, "the name of a variable (1)"));
    }
    let mut text = vec![0; name.padded as usize];
    elements.inner.read_exact(&mut text)?;
    elements.read += name.padded;
    text.truncate(name.length as usize);
    let name: String = text.into_iter().map(char::from).collect();
    let not_read = |kind: &str| {
        let name = crate::printable::quoted(&name);
        Ok(Err(Some(format!("variable `{name}` not read: {kind}"))))
    };
    match class & 0xff {
        6..=15 if shape.length > 8 => return not_read("it has more than two dimensions"),
        6..=15 if class & 0x800 != 0 => return not_read("its numbers are complex"),
        6..=15 => {}
        1 => return not_read("a cell array"),
        2 => return not_read("a struct"),
        3 => return not_read("an object"),
        4 => return not_read("text"),
        5 => return not_read("a sparse matrix"),
        _ => return not_read("a function or an object"),
    }
    let Some(count) = dimensions[0].checked_mul(dimensions[1]).filter(|n| *n > 0) else {
        return not_read("it is empty");
    };
    let data = elements.tag()?;
    let kind = match data.kind {
        1 => Kind::I8,
        2 => Kind::U8,
        3 => Kind::I16,
        4 => Kind::U16,
        5 => Kind::I32,
        6 => Kind::U32,
        7 => Kind::F32,
        9 => Kind::F64,
        12 => Kind::I64,
        13 => Kind::U64,
        other => {
            let found = format!("numbers of type {other} in variable `{name}`");
            return Err(Wrong::Other(found, "a type of number"));
        }
    };
    let needed = count.checked_mul(kind.size() as u64);
    if needed.is_none_or(|needed| needed > u64::from(data.length)) {
        let [rows, columns] = dimensions;
        let found = format!(
            "{} bytes for {rows} x {columns} numbers of `{name}`",
            data.length
        );
        return Err(Wrong::Other(found, "as many as they take"));
    }
    if elements.read + u64::from(data.length) > size {
        let found = format!(
            "{} bytes of numbers in `{name}`, more than the variable has",
            data.length
        );
        return Err(Wrong::Other(found, "as many as are there"));
    }
    Ok(Ok(Variable {
        name,
        dimensions,
        at: 0,
        part,
        compressed,
        coding: Coding { kind, big },
        lead: elements.read,
    }))
}

/// Numbers of a variable at even distances.
pub(super) struct Numbers {
    bytes: Rc<Bytes>,
    channel: String,
    at: u64,
    inner: Box<dyn Read>,
    coding: Coding,
    /// Bytes between two numbers.
    between: u64,
    started: bool,
}

impl Numbers {
    pub(super) fn new(
        bytes: &Rc<Bytes>,
        variable: &Variable,
        first: u64,
        stride: u64,
        channel: &str,
    ) -> Result<Self, RecordingError> {
        let size = variable.coding.kind.size() as u64;
        let lead = variable.lead + first * size;
        let [mut at, end] = variable.part;
        if !variable.compressed {
            at += lead;
        }
        let mut inner = content(bytes, [at, end], variable.compressed);
        if variable.compressed {
            skip(&mut *inner, lead).map_err(|e| bytes.damaged(variable.at, &e))?;
        }
        Ok(Self {
            bytes: Rc::clone(bytes),
            channel: channel.to_owned(),
            at: variable.at,
            // A decoder gives few bytes at a time where few are asked for.
            inner: Box::new(io::BufReader::new(inner)),
            coding: variable.coding,
            between: (stride - 1) * size,
            started: false,
        })
    }
}

impl Series for Numbers {
    fn next(&mut self) -> Result<f64, RecordingError> {
        let mut raw = [0; 8];
        let raw = raw.get_mut(..self.coding.kind.size()).unwrap_or(&mut []);
        let gap = if self.started { self.between } else { 0 };
        self.started = true;
        let read = match gap {
            0 => Ok(()),
            gap => skip(&mut *self.inner, gap),
        };
        match read.and_then(|()| self.inner.read_exact(raw)) {
            Ok(()) => Ok(self.coding.value(raw)),
            Err(e) => Err(self.bytes.malformed(
                Place::Byte(self.at),
                &self.channel,
                format!("the variable breaks off ({e})"),
                "as many numbers as it states",
            )),
        }
    }
}

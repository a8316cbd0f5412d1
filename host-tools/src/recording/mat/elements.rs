//! The elements of a MAT file of version 5: variables, fields of structs among them, and the numbers in them.

use super::inflater::Places;
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
/// Most bytes of a name, which MATLAB allows 63, and of a text.
const NAME: u32 = 4096;
/// Unpacked bytes before a channel's numbers that are unpacked again for it.
const NEAR: u64 = 32 << 10;
/// Structs and cells within each other.
const DEPTH: u32 = 16;
/// Kinds of an element.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Class of a table, a `string`, a `datetime` and other objects, which have a name and no dimensions.
const OPAQUE: u32 = 17;

/// Numeric variables of a file, texts within its structs, and notes on what is not read. Names of fields stand behind
/// a point (`Signal.y_values.values`), places in arrays in brackets (`Signal(2).name{1}`).
#[derive(Default)]
pub(super) struct Contents {
    pub(super) variables: Vec<Variable>,
    pub(super) texts: Vec<(String, String)>,
    pub(super) notes: Vec<String>,
}

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
    TooMany,
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

    /// The name of a variable.
    fn name(&mut self) -> Result<String, Wrong> {
        let name = self.tag()?;
        if name.kind != 1 || name.length > NAME {
            let found = format!("an element of type {} and {} bytes", name.kind, name.length);
            return Err(Wrong::Other(found, "the name of a variable (1)"));
        }
        Ok(self.text(&name)?.into_iter().map(char::from).collect())
    }

    /// The bytes of an element, of which few are expected.
    fn text(&mut self, tag: &Tag) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let read = (&mut *self.inner)
            .take(tag.padded)
            .read_to_end(&mut bytes)?;
        if (read as u64) < tag.padded {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.read += tag.padded;
        bytes.truncate(tag.length as usize);
        Ok(bytes)
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

/// The variables of a file.
pub(super) fn contents(bytes: &Rc<Bytes>) -> Result<Contents, RecordingError> {
    let header = bytes.part(HEADER - 2, HEADER);
    let big = header.bytes().next().and_then(Result::ok) == Some(b'M');
    let mut contents = Contents::default();
    let mut seen = 0;
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
        let mut walk = Walk {
            elements: Elements {
                inner: &mut *inner,
                big,
                read: 0,
            },
            at,
            part: [begin, end],
            compressed,
            seen: &mut seen,
            contents: &mut contents,
        };
        match walk.variable() {
            Ok(()) => {}
            Err(Wrong::Io(e)) => return Err(bytes.damaged(at, &e)),
            Err(Wrong::Other(found, expected)) => {
                return Err(bytes.malformed(place, "", found, expected));
            }
            Err(Wrong::TooMany) => {
                return Err(RecordingError::TooManyColumns {
                    file: bytes.file.clone(),
                    found: seen,
                });
            }
        }
        // Compressed elements are not padded.
        at = if compressed {
            end
        } else {
            end.next_multiple_of(8)
        };
    }
    Ok(contents)
}

/// A way through the bytes of a variable.
struct Walk<'a> {
    elements: Elements<'a>,
    /// First byte of the variable in the file.
    at: u64,
    part: [u64; 2],
    compressed: bool,
    /// Matrices of the file so far.
    seen: &'a mut usize,
    contents: &'a mut Contents,
}

/// Type, form and name of a matrix.
struct Head {
    class: u32,
    /// `true` if its numbers are complex.
    complex: bool,
    dimensions: [u64; 2],
    /// `true` if it has more than two.
    deep: bool,
    name: String,
}

impl Walk<'_> {
    /// Reads a variable; the bytes of its numbers are left out.
    fn variable(&mut self) -> Result<(), Wrong> {
        self.count()?;
        let mut size = self.part[1] - self.part[0];
        if self.compressed {
            let tag = self.elements.tag()?;
            if tag.kind != MATRIX {
                let found = format!("an element of type {} within a compressed one", tag.kind);
                return Err(Wrong::Other(found, "a variable (14)"));
            }
            size = u64::from(tag.length) + 8;
        }
        if size < 16 {
            // The workspace of functions, and variables without anything.
            return Ok(());
        }
        self.matrix(size, None, 0)
    }

    /// Counts a matrix.
    fn count(&mut self) -> Result<(), Wrong> {
        *self.seen += 1;
        if *self.seen > limits::COLUMNS {
            return Err(Wrong::TooMany);
        }
        Ok(())
    }

    /// Reads a matrix that ends after `end` bytes of the variable: one within another at a path, or the variable itself.
    fn matrix(&mut self, end: u64, path: Option<String>, depth: u32) -> Result<(), Wrong> {
        let head = self.head()?;
        let within = path.is_some();
        // What objects hold follows them, as bytes without a name.
        if !within && head.name.is_empty() {
            return Ok(());
        }
        let name = path.unwrap_or(head.name);
        let [rows, columns] = head.dimensions;
        let count = rows.checked_mul(columns);
        let mut not_read = |kind: &str| {
            let name = crate::printable::quoted(&name);
            let note = format!("variable `{name}` not read: {kind}");
            self.contents.notes.push(note);
            Ok(())
        };
        // 1 is a cell, 2 a struct, 3 an object, 4 text, 5 sparse, 6 to 15 are kinds of numbers.
        match head.class {
            1 | 2 if depth == DEPTH => return not_read("it lies in too many others"),
            1 | 2 | 6..=15 if head.deep => return not_read("it has more than two dimensions"),
            6..=15 if head.complex => return not_read("its numbers are complex"),
            1 | 2 | 4 if within && count == Some(0) => return Ok(()),
            1 => return self.cells(end, &name, count, depth),
            2 => return self.fields(end, &name, count, depth),
            3 => return not_read("an object"),
            4 if within => return self.text(name, head.dimensions),
            4 => return not_read("text"),
            5 => return not_read("a sparse matrix"),
            OPAQUE => return not_read("a table, a string or another object"),
            6..=15 => {}
            _ => return not_read("a function or an object"),
        }
        let Some(count) = count.filter(|n| *n > 0) else {
            return if within {
                Ok(())
            } else {
                not_read("it is empty")
            };
        };
        let (kind, length) = self.numbers(&name)?;
        let needed = count.checked_mul(kind.size() as u64);
        if needed.is_none_or(|needed| needed > length) {
            let found = format!("{length} bytes for {rows} x {columns} numbers of `{name}`");
            return Err(Wrong::Other(found, "as many as they take"));
        }
        if self.elements.read + length > end {
            let found =
                format!("{length} bytes of numbers in `{name}`, more than the variable has");
            return Err(Wrong::Other(found, "as many as are there"));
        }
        self.contents.variables.push(Variable {
            name,
            dimensions: head.dimensions,
            at: self.at,
            part: self.part,
            compressed: self.compressed,
            coding: Coding {
                kind,
                big: self.elements.big,
            },
            lead: self.elements.read,
        });
        Ok(())
    }

    /// Flags, dimensions and name of a matrix.
    fn head(&mut self) -> Result<Head, Wrong> {
        let elements = &mut self.elements;
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
        if class & 0xff == OPAQUE {
            return Ok(Head {
                class: OPAQUE,
                complex: false,
                dimensions: [1, 1],
                deep: false,
                name: elements.name()?,
            });
        }
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
        Ok(Head {
            class: class & 0xff,
            complex: class & 0x800 != 0,
            dimensions,
            deep: shape.length > 8,
            name: elements.name()?,
        })
    }

    /// Kind of numbers and their bytes.
    fn numbers(&mut self, name: &str) -> Result<(Kind, u64), Wrong> {
        let data = self.elements.tag()?;
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
        Ok((kind, u64::from(data.length)))
    }

    /// Reads a line of text.
    fn text(&mut self, name: String, [rows, _]: [u64; 2]) -> Result<(), Wrong> {
        let tag = self.elements.tag()?;
        if rows != 1 || tag.length > NAME {
            return Ok(());
        }
        let bytes = self.elements.text(&tag)?;
        let big = self.elements.big;
        let text = match tag.kind {
            // Characters of two bytes.
            4 | 17 => {
                let (pairs, _) = bytes.as_chunks::<2>();
                let units: Vec<u16> = pairs
                    .iter()
                    .map(|pair| match big {
                        true => u16::from_be_bytes(*pair),
                        false => u16::from_le_bytes(*pair),
                    })
                    .collect();
                String::from_utf16_lossy(&units)
            }
            _ => String::from_utf8_lossy(&bytes).into_owned(),
        };
        self.contents.texts.push((name, text));
        Ok(())
    }

    /// Reads the matrices of a cell array.
    fn cells(&mut self, end: u64, name: &str, count: Option<u64>, depth: u32) -> Result<(), Wrong> {
        for n in 1..=count.unwrap_or(u64::MAX) {
            self.inner(end, format!("{name}{{{n}}}"), depth)?;
        }
        Ok(())
    }

    /// Reads the matrices of a struct, or of an array of them.
    fn fields(
        &mut self,
        end: u64,
        name: &str,
        count: Option<u64>,
        depth: u32,
    ) -> Result<(), Wrong> {
        let tag = self.elements.tag()?;
        let length = self.elements.text(&tag)?;
        let length = <[u8; 4]>::try_from(length).map(|bytes| match self.elements.big {
            true => u32::from_be_bytes(bytes),
            false => u32::from_le_bytes(bytes),
        });
        let names = self.elements.tag()?;
        // A struct without fields has a length of their names, and none of them.
        let length = match length {
            Ok(length @ 1..=NAME) if names.length <= NAME * NAME => length as usize,
            _ => {
                let found = format!("{} bytes of names of `{name}`", names.length);
                return Err(Wrong::Other(found, "names of fields, 1 to 4096 bytes each"));
            }
        };
        let names: Vec<String> = self
            .elements
            .text(&names)?
            .chunks(length)
            .map(|name| {
                let name = name.split(|byte| *byte == 0).next().unwrap_or(name);
                name.iter().copied().map(char::from).collect()
            })
            .collect();
        if names.is_empty() {
            return Ok(());
        }
        for n in 1..=count.unwrap_or(u64::MAX) {
            for field in &names {
                let path = match count {
                    Some(1) => format!("{name}.{field}"),
                    _ => format!("{name}({n}).{field}"),
                };
                self.inner(end, path, depth)?;
            }
        }
        Ok(())
    }

    /// Reads a matrix within another one, which ends after `end` bytes of the variable.
    fn inner(&mut self, end: u64, path: String, depth: u32) -> Result<(), Wrong> {
        self.count()?;
        let tag = self.elements.tag()?;
        let own = self.elements.read + u64::from(tag.length);
        if tag.kind != MATRIX || own > end {
            let path = crate::printable::quoted(&path);
            let found = format!(
                "an element of type {} and {} bytes at `{path}`",
                tag.kind, tag.length
            );
            return Err(Wrong::Other(found, "a matrix (14) within the variable"));
        }
        // What is empty may have nothing but its tag.
        if tag.length > 0 {
            self.matrix(own, Some(path), depth + 1)?;
        }
        let read = self.elements.read;
        let left = own.checked_sub(read).ok_or_else(|| {
            let found = format!("{read} bytes of a matrix that ends after {own}");
            Wrong::Other(found, "as many as it states")
        })?;
        Ok(self.elements.skip(left)?)
    }
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
        (first, stride): (u64, u64),
        channel: &str,
        places: &Places,
    ) -> Result<Self, RecordingError> {
        let size = variable.coding.kind.size() as u64;
        let lead = variable.lead + first * size;
        let [begin, end] = variable.part;
        let damaged = |e: io::Error| bytes.damaged(variable.at, &e);
        let inner = match variable.compressed {
            false => content(bytes, [begin + lead, end], false),
            // The faster decoder, which no other goes on from.
            true if lead <= NEAR => {
                let mut inner = content(bytes, [begin, end], true);
                skip(&mut *inner, lead).map_err(damaged)?;
                inner
            }
            true => {
                let inner = places.from(bytes, variable.part, lead);
                Box::new(inner.map_err(damaged)?)
            }
        };
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

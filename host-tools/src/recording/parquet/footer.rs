//! The footer of a Parquet file: its columns, its row groups, and what its writer has noted.
//!
//! Read here and not by the crate, which takes memory for as many parts as a footer says it has.

use super::thrift::{Kind, Read, Thrift};
use crate::limits;

/// The footer of a file.
#[derive(Debug, Default)]
pub(super) struct Footer {
    pub(super) rows: u64,
    pub(super) columns: Vec<Column>,
    pub(super) groups: Vec<Group>,
    /// Name and version of the program that wrote the file.
    pub(super) writer: String,
    /// Texts under the keys that are read here, [`KEYS`].
    pub(super) notes: [Option<String>; KEYS.len()],
    /// `true` if the columns are encrypted.
    pub(super) encrypted: bool,
}

/// Keys of notes that are read: those of massline and of pandas.
pub(super) const KEYS: [&str; 2] = ["massline", "pandas"];

/// A column of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    pub(super) name: String,
    /// Values; `None`: of a kind that is not read.
    pub(super) values: Option<Values>,
    /// `true` if a value may be missing.
    pub(super) nullable: bool,
}

/// Numbers or texts as they are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Values {
    Float,
    Double,
    Int32(Meaning),
    Int64(Meaning),
    /// Whole numbers of so many bytes, in units of one over this.
    Fixed(usize, f64),
    Text,
}

/// Meaning of a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    Signed,
    Unsigned,
    /// In units of this.
    Scaled(f64),
    /// An instant or a time, in units of so many seconds.
    Time(f64),
}

impl Values {
    /// Bytes of a value; `None` for texts.
    pub(super) const fn width(self) -> Option<usize> {
        match self {
            Self::Float | Self::Int32(_) => Some(4),
            Self::Double | Self::Int64(_) => Some(8),
            Self::Fixed(bytes, _) => Some(bytes),
            Self::Text => None,
        }
    }

    /// `true` for instants and times.
    pub(super) const fn is_time(self) -> bool {
        matches!(
            self,
            Self::Int32(Meaning::Time(_)) | Self::Int64(Meaning::Time(_))
        )
    }
}

/// Rows of which each column lies in one piece.
#[derive(Debug, Default)]
pub(super) struct Group {
    pub(super) rows: u64,
    pub(super) chunks: Vec<Chunk>,
}

/// Piece of a column.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Chunk {
    pub(super) begin: u64,
    pub(super) bytes: u64,
    pub(super) values: u64,
    pub(super) codec: i64,
    /// `true` if it lies in another file.
    elsewhere: bool,
}

/// An element of the schema.
#[derive(Default)]
struct Element {
    name: String,
    physical: Option<i64>,
    /// Bytes of a value of a fixed length.
    length: i64,
    repetition: i64,
    children: i64,
    converted: Option<i64>,
    scale: i64,
    logical: Option<Logical>,
}

/// A logical type that changes what a number means.
enum Logical {
    Decimal(i64),
    /// Seconds of the unit.
    Time(f64),
    Unsigned,
    Signed,
    Other,
}

const MILLI: f64 = 1e-3;
const MICRO: f64 = 1e-6;
const NANO: f64 = 1e-9;

fn words(text: &[u8]) -> String {
    String::from_utf8_lossy(text).into_owned()
}

fn count(thrift: &mut Thrift<'_>, kind: Kind) -> Read<u64> {
    u64::try_from(thrift.whole(kind)?).map_err(|_| "a footer with a number below zero")
}

impl Footer {
    /// Reads a footer.
    ///
    /// # Errors
    /// The fault of it, and where it is.
    pub(super) fn read(bytes: &[u8]) -> Read<Self> {
        let mut footer = Self::default();
        let mut elements = Vec::new();
        let mut thrift = Thrift::new(bytes);
        thrift.fields(|t, field, kind| match field {
            2 => t.list(kind, |t, kind| {
                if elements.len() > limits::COLUMNS {
                    return Err("a footer with more columns than can be read");
                }
                elements.push(Element::read(t, kind)?);
                Ok(())
            }),
            3 => count(t, kind).map(|rows| footer.rows = rows),
            4 => t.list(kind, |t, kind| {
                let group = Group::read(t, kind)?;
                // So that empty groups take no memory.
                if group.rows > 0 && group.chunks.is_empty() {
                    return Err("a row group without columns");
                }
                if group.rows > 0 {
                    footer.groups.push(group);
                }
                Ok(())
            }),
            5 => t.list(kind, |t, kind| footer.note(t, kind)),
            6 => t.text(kind).map(|text| footer.writer = words(text)),
            8 => {
                footer.encrypted = true;
                t.skip(kind)
            }
            _ => t.skip(kind),
        })?;
        footer.columns = columns(&elements)?;
        footer.check()?;
        Ok(footer)
    }

    fn note(&mut self, thrift: &mut Thrift<'_>, kind: Kind) -> Read<()> {
        let (mut key, mut value) = (&[][..], None);
        thrift.structure(kind, |t, field, kind| match field {
            1 => t.text(kind).map(|text| key = text),
            2 => t.text(kind).map(|text| value = Some(text)),
            _ => t.skip(kind),
        })?;
        for (known, note) in KEYS.iter().zip(&mut self.notes) {
            if known.as_bytes() == key {
                *note = value.map(words);
            }
        }
        Ok(())
    }

    /// Checks that all groups have all columns, and as many rows as the file states.
    fn check(&self) -> Read<()> {
        let mut rows = 0_u64;
        for group in &self.groups {
            if group.chunks.len() != self.columns.len() {
                return Err("a row group with another number of columns than the file");
            }
            let other = |(column, chunk): (&Column, &Chunk)| {
                column.values.is_some() && chunk.values != group.rows
            };
            if self.columns.iter().zip(&group.chunks).any(other) {
                return Err("columns of different lengths");
            }
            if group.chunks.iter().any(|chunk| chunk.elsewhere) {
                return Err("columns that lie in another file");
            }
            rows = rows.checked_add(group.rows).ok_or("too many rows")?;
        }
        if rows == self.rows {
            Ok(())
        } else {
            Err("row groups with more or fewer rows than the file states")
        }
    }
}

impl Group {
    fn read(thrift: &mut Thrift<'_>, kind: Kind) -> Read<Self> {
        let mut group = Self::default();
        thrift.structure(kind, |t, field, kind| match field {
            1 => t.list(kind, |t, kind| {
                group.chunks.push(Chunk::read(t, kind)?);
                Ok(())
            }),
            3 => count(t, kind).map(|rows| group.rows = rows),
            _ => t.skip(kind),
        })?;
        Ok(group)
    }
}

impl Chunk {
    fn read(thrift: &mut Thrift<'_>, kind: Kind) -> Read<Self> {
        let mut chunk = Self::default();
        let (mut data, mut dictionary) = (None, 0);
        let (mut values, mut bytes) = (None, None);
        thrift.structure(kind, |t, field, kind| match field {
            1 => t.text(kind).map(|_| chunk.elsewhere = true),
            3 => t.structure(kind, |t, field, kind| match field {
                4 => t.whole(kind).map(|codec| chunk.codec = codec),
                5 => count(t, kind).map(|x| values = Some(x)),
                7 => count(t, kind).map(|x| bytes = Some(x)),
                9 => count(t, kind).map(|x| data = Some(x)),
                11 => count(t, kind).map(|at| dictionary = at),
                _ => t.skip(kind),
            }),
            _ => t.skip(kind),
        })?;
        // All of them have to be there, so that memory is in proportion to the footer's bytes.
        let (Some(data), Some(values), Some(bytes)) = (data, values, bytes) else {
            return Err("a piece of a column without its place");
        };
        (chunk.values, chunk.bytes) = (values, bytes);
        // Some writers state zero where there is no dictionary.
        chunk.begin = if dictionary > 0 {
            data.min(dictionary)
        } else {
            data
        };
        Ok(chunk)
    }
}

impl Element {
    fn read(thrift: &mut Thrift<'_>, kind: Kind) -> Read<Self> {
        let mut element = Self::default();
        thrift.structure(kind, |t, field, kind| match field {
            1 => t.whole(kind).map(|x| element.physical = Some(x)),
            2 => t.whole(kind).map(|x| element.length = x),
            3 => t.whole(kind).map(|x| element.repetition = x),
            4 => t.text(kind).map(|text| element.name = words(text)),
            5 => t.whole(kind).map(|x| element.children = x),
            6 => t.whole(kind).map(|x| element.converted = Some(x)),
            7 => t.whole(kind).map(|x| element.scale = x),
            10 => t.structure(kind, |t, field, kind| {
                element.logical = Some(Logical::read(t, field, kind)?);
                Ok(())
            }),
            _ => t.skip(kind),
        })?;
        Ok(element)
    }

    /// Meaning of whole numbers; `None` for those that are no quantity, such as dates.
    fn meaning(&self) -> Option<Meaning> {
        let decimal = |scale: i64| {
            let scale = i32::try_from(scale).ok().filter(|x| (0..=18).contains(x));
            scale.map(|scale| Meaning::Scaled(10_f64.powi(scale)))
        };
        match (&self.logical, self.converted) {
            (Some(Logical::Decimal(scale)), _) => decimal(*scale),
            (Some(Logical::Time(second)), _) => Some(Meaning::Time(*second)),
            (Some(Logical::Unsigned), _) => Some(Meaning::Unsigned),
            (Some(Logical::Signed), _) => Some(Meaning::Signed),
            (Some(Logical::Other), _) => None,
            (None, Some(5)) => decimal(self.scale),
            (None, Some(7 | 9)) => Some(Meaning::Time(MILLI)),
            (None, Some(8 | 10)) => Some(Meaning::Time(MICRO)),
            (None, Some(11..=14)) => Some(Meaning::Unsigned),
            (None, None | Some(15..=18)) => Some(Meaning::Signed),
            (None, Some(_)) => None,
        }
    }

    fn values(&self) -> Option<Values> {
        match self.physical? {
            1 => self.meaning().map(Values::Int32),
            2 => self.meaning().map(Values::Int64),
            4 => Some(Values::Float),
            5 => Some(Values::Double),
            6 => Some(Values::Text),
            7 => self.fixed(),
            _ => None,
        }
    }

    /// Decimals of a fixed length, as far as 128 bits hold them.
    fn fixed(&self) -> Option<Values> {
        let bytes = usize::try_from(self.length)
            .ok()
            .filter(|n| (1..=16).contains(n))?;
        let scale = match (&self.logical, self.converted) {
            (Some(Logical::Decimal(scale)), _) => *scale,
            (None, Some(5)) => self.scale,
            _ => return None,
        };
        let scale = i32::try_from(scale).ok().filter(|x| (0..=38).contains(x))?;
        Some(Values::Fixed(bytes, 10_f64.powi(scale)))
    }
}

impl Logical {
    fn read(thrift: &mut Thrift<'_>, field: i64, kind: Kind) -> Read<Self> {
        let mut read = match field {
            5 => Self::Decimal(0),
            10 => Self::Signed,
            _ => Self::Other,
        };
        thrift.structure(kind, |t, part, kind| match (field, part) {
            (5, 1) => t.whole(kind).map(|scale| read = Self::Decimal(scale)),
            (7 | 8, 2) => t.structure(kind, |t, unit, kind| {
                read = match unit {
                    1 => Self::Time(MILLI),
                    2 => Self::Time(MICRO),
                    3 => Self::Time(NANO),
                    _ => Self::Other,
                };
                t.skip(kind)
            }),
            (10, 2) => t.flag(kind).map(|signed| {
                if !signed {
                    read = Self::Unsigned;
                }
            }),
            _ => t.skip(kind),
        })?;
        Ok(read)
    }
}

/// The columns of a schema, which lists a tree from its root on, each element before its children.
fn columns(elements: &[Element]) -> Read<Vec<Column>> {
    let mut columns = Vec::new();
    // Names of the elements that lead here, each with the number of its children to come.
    let mut path: Vec<(&str, i64)> = Vec::new();
    for (position, element) in elements.iter().enumerate() {
        while path.pop_if(|(_, left)| *left == 0).is_some() {}
        match path.last_mut() {
            Some((_, left)) => *left -= 1,
            None if position == 0 => {}
            None => return Err("a schema with more than one root"),
        }
        if position == 0 || element.children > 0 {
            if path.len() > 32 {
                return Err("a schema that is nested too deeply");
            }
            path.push((&element.name, element.children.max(0)));
            continue;
        }
        let names = path.iter().skip(1).map(|(name, _)| *name);
        let names: Vec<&str> = names.chain([element.name.as_str()]).collect();
        columns.push(Column {
            name: names.join("."),
            // Lists, and what lies in other structures, are no channels.
            values: element
                .values()
                .filter(|_| path.len() == 1 && element.repetition < 2),
            nullable: element.repetition == 1,
        });
    }
    if path.iter().any(|(_, left)| *left > 0) {
        return Err("a schema that breaks off");
    }
    Ok(columns)
}

//! Datasets: kind, shape and place of their elements.

use super::chunks::Index;
use super::file::{Cursor, File};
use super::filters::Filters;
use super::object::{FILL, FILTERS, LAYOUT, Object, SPACE, TYPE};
use super::types::{Datatype, Element, Space};
use crate::recording::RecordingError;
use crate::recording::number::Coding;

/// Place of the elements of a dataset.
pub(super) enum Place {
    /// In one piece; not given where none was ever written.
    Whole(Option<u64>),
    /// In the header of the dataset.
    Inside(Vec<u8>),
    /// In chunks of equal shape.
    Chunks(Vec<u64>, Index),
}

/// A dataset.
pub(super) struct Dataset {
    /// Address of its header.
    pub(super) at: u64,
    pub(super) datatype: Datatype,
    pub(super) space: Space,
    pub(super) place: Place,
    pub(super) filters: Filters,
    /// Number that stands for elements that were never written, where one is named.
    pub(super) fill: Option<f64>,
}

impl Dataset {
    /// Reads the description of a dataset; or why it is not read. `None` if the object is none.
    ///
    /// # Errors
    /// [`RecordingError`] of a damaged header.
    pub(super) fn read(
        file: &File,
        object: &Object,
    ) -> Result<Option<Result<Self, String>>, RecordingError> {
        let is = |kind| object.messages.iter().any(|m| m.kind == kind);
        if !is(LAYOUT) {
            return Ok(None);
        }
        let broken = |part: &str| {
            let found = format!("the {part} of a dataset, of another form");
            file.wrong(object.at, found, "one that can be read")
        };
        let Some(datatype) = object.message(TYPE) else {
            return Ok(Some(
                Err("its type stands elsewhere in the file".to_owned()),
            ));
        };
        let datatype = Datatype::read(datatype).filter(|datatype| datatype.size > 0);
        let datatype = datatype.ok_or_else(|| broken("type"))?;
        let space = object.message(SPACE);
        let space = space.and_then(|space| Space::read(space, file.length));
        let space = space.ok_or_else(|| broken("shape"))?;
        let filters = match object.message(FILTERS) {
            None => Filters::default(),
            Some(filters) => match Filters::read(filters).ok_or_else(|| broken("filters"))? {
                Ok(filters) => filters,
                Err(number) => return Ok(Some(Err(not_unpacked(number)))),
            },
        };
        let place = object.message(LAYOUT);
        let place = place.and_then(|layout| place_of(file, layout, &space));
        let place = match place.ok_or_else(|| broken("layout"))? {
            Ok(place) => place,
            Err(kind) => return Ok(Some(Err(kind.to_owned()))),
        };
        let fill = match datatype.element {
            Element::Number(coding) => object.message(FILL).and_then(|m| fill(m, coding)),
            _ => None,
        };
        Ok(Some(Ok(Self {
            at: object.at,
            datatype,
            space,
            place,
            filters,
            fill,
        })))
    }

    /// Bytes of all elements.
    pub(super) fn size(&self) -> Option<u64> {
        self.space.count()?.checked_mul(self.datatype.size as u64)
    }

    /// All elements of a small dataset that is not in chunks; empty if it was never written.
    ///
    /// # Errors
    /// [`RecordingError`] of the structure.
    pub(super) fn elements(&self, file: &File) -> Result<Option<Vec<u8>>, RecordingError> {
        Ok(match &self.place {
            Place::Inside(bytes) => Some(bytes.clone()),
            Place::Whole(Some(at)) => Some(file.read(*at, self.size().unwrap_or(u64::MAX))?),
            _ => None,
        })
    }
}

fn not_unpacked(filter: u64) -> String {
    let name = match filter {
        4 => "szip",
        5 => "nbit",
        6 => "scaleoffset",
        32_000 => "lzf",
        32_001 => "blosc",
        32_004 => "lz4",
        32_015 => "zstd",
        _ => "of another program",
    };
    format!("its filter {filter} ({name}) is not read; `h5repack -f GZIP=1 IN OUT` writes another")
}

/// The layout of a dataset; or why it is not read.
fn place_of(
    file: &File,
    mut cursor: Cursor<'_>,
    space: &Space,
) -> Option<Result<Place, &'static str>> {
    let version = cursor.byte()?;
    let rank = space.shape.len();
    let given = |at: u64| file.is_given(at).then_some(at);
    if version <= 2 {
        let dimensions = usize::from(cursor.byte()?);
        let class = cursor.byte()?;
        cursor.take(5)?;
        let at = if class == 0 {
            0
        } else {
            cursor.uint(file.address)?
        };
        let mut sides: Vec<u64> = (0..dimensions)
            .map(|_| cursor.uint(4))
            .collect::<Option<_>>()?;
        return Some(Ok(match class {
            0 => {
                let size = cursor.uint(4)? as usize;
                Place::Inside(cursor.take(size)?.to_vec())
            }
            1 => Place::Whole(given(at)),
            _ => {
                sides.truncate(rank);
                Place::Chunks(sides, Index::Tree(given(at)))
            }
        }));
    }
    Some(match (version, cursor.byte()?) {
        (3.., 0) => {
            let size = cursor.uint(2)? as usize;
            Ok(Place::Inside(cursor.take(size)?.to_vec()))
        }
        (3.., 1) => Ok(Place::Whole(given(cursor.uint(file.address)?))),
        (3, 2) => {
            let dimensions = usize::from(cursor.byte()?);
            let at = given(cursor.uint(file.address)?);
            let sides = (0..dimensions).map(|_| cursor.uint(4)).take(rank);
            Ok(Place::Chunks(
                sides.collect::<Option<_>>()?,
                Index::Tree(at),
            ))
        }
        (4 | 5, 2) => {
            let flags = cursor.byte()?;
            let dimensions = usize::from(cursor.byte()?);
            let width = usize::from(cursor.byte()?);
            let mut sides = (0..dimensions)
                .map(|_| cursor.uint(width))
                .collect::<Option<Vec<_>>>()?;
            sides.truncate(rank);
            match Index::read(file, cursor, flags)? {
                Some(index) => Ok(Place::Chunks(sides, index)),
                None => Err(
                    "it grows along two dimensions; `h5repack -l CONTI IN OUT` writes it in one piece",
                ),
            }
        }
        (_, 3) => Err("it is made of datasets of other files"),
        _ => return None,
    })
}

/// The number that stands for elements that were never written, where a program chose one.
fn fill(mut cursor: Cursor<'_>, coding: Coding) -> Option<f64> {
    let version = cursor.byte()?;
    let defined = match version {
        1 | 2 => cursor.take(3)?.get(2) == Some(&1),
        _ => cursor.byte()? & 0x20 != 0,
    };
    let size = defined.then(|| cursor.uint(4))?? as usize;
    let value = coding.value(cursor.take(size)?);
    // Zero is the number that a library takes by itself.
    (size == coding.kind.size() && value != 0.0).then_some(value)
}

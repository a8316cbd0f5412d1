//! Attributes of groups and datasets.

use super::file::{Cursor, File};
use super::heap;
use super::object::{ATTRIBUTE, ATTRIBUTE_INFO, Object};
use super::types::{Datatype, Element, Space};
use crate::recording::RecordingError;

/// A named value of an object.
pub(super) struct Attribute {
    pub(super) name: String,
    datatype: Datatype,
    count: u64,
    values: Vec<u8>,
}

/// The attributes of an object; those of a form that is not read are left out.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn attributes(file: &File, object: &Object) -> Result<Vec<Attribute>, RecordingError> {
    let own = object
        .messages
        .iter()
        .filter(|m| m.kind == ATTRIBUTE && !m.shared);
    let mut found: Vec<Attribute> = own.filter_map(|m| attribute(file, &m.body)).collect();
    let elsewhere = || {
        let mut cursor = object.message(ATTRIBUTE_INFO)?;
        let flags = cursor.uint(2)? >> 8;
        cursor.take(if flags & 1 != 0 { 2 } else { 0 })?;
        Some((cursor.uint(file.address)?, cursor.uint(file.address)?))
    };
    if let Some((heap, tree)) = elsewhere()
        && file.is_given(heap)
        && file.is_given(tree)
    {
        let objects = heap::objects(file, heap, tree, 0)?;
        found.extend(objects.iter().filter_map(|body| attribute(file, body)));
    }
    Ok(found)
}

fn attribute(file: &File, body: &[u8]) -> Option<Attribute> {
    let mut cursor = Cursor(body);
    let version = cursor.byte()?;
    let shared = cursor.byte()? & 3 != 0;
    let sizes = [cursor.uint(2)?, cursor.uint(2)?, cursor.uint(2)?];
    if version == 3 {
        cursor.byte()?;
    }
    if shared && version > 1 {
        return None;
    }
    let mut part = |size: u64| {
        let start = cursor.0.len();
        let part = cursor.take(size as usize)?;
        if version == 1 {
            cursor.pad(start)?;
        }
        Some(part)
    };
    let name = part(sizes[0])?;
    let datatype = Datatype::read(Cursor(part(sizes[1])?))?;
    let space = Space::read(Cursor(part(sizes[2])?), file.length)?;
    let name = name.split(|byte| *byte == 0).next()?;
    let count = space.count()?;
    let size = usize::try_from(count.checked_mul(datatype.size as u64)?).ok()?;
    Some(Attribute {
        name: String::from_utf8_lossy(name).into_owned(),
        datatype,
        count,
        values: cursor.take(size)?.to_vec(),
    })
}

/// Elements of a kind as texts; `None` if they are no texts.
///
/// # Errors
/// [`RecordingError`] of the heap that they lie in.
pub(super) fn texts(
    file: &File,
    datatype: Datatype,
    values: &[u8],
) -> Result<Option<Vec<String>>, RecordingError> {
    let parts = values.chunks_exact(datatype.size.max(1));
    Ok(match datatype.element {
        Element::Text => {
            let text = |part: &[u8]| {
                let part = part.split(|byte| *byte == 0).next().unwrap_or(&[]);
                String::from_utf8_lossy(part).trim_end().to_owned()
            };
            Some(parts.map(text).collect())
        }
        Element::TextElsewhere => {
            let all = parts.map(|part| heap::text(file, part));
            Some(all.collect::<Result<_, _>>()?)
        }
        _ => None,
    })
}

impl Attribute {
    /// Its texts, if it has texts.
    ///
    /// # Errors
    /// [`RecordingError`] of the heap that they lie in.
    pub(super) fn texts(&self, file: &File) -> Result<Option<Vec<String>>, RecordingError> {
        texts(file, self.datatype, &self.values)
    }

    /// Its number, if it has one number.
    pub(super) fn number(&self) -> Option<f64> {
        match self.datatype.element {
            Element::Number(coding) if self.count == 1 => Some(coding.value(&self.values)),
            _ => None,
        }
    }
}

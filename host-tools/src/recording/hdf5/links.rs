//! Links of a group: names and addresses of the objects in it.

use super::file::{Cursor, File};
use super::heap;
use super::object::{LINK, LINK_INFO, Object, SYMBOLS};
use crate::limits;
use crate::recording::RecordingError;

/// Name of an object in a group, and address of its header.
pub(super) type Link = (String, u64);

/// `true` if an object is a group.
pub(super) fn is_group(object: &Object) -> bool {
    let kinds = [SYMBOLS, LINK_INFO, LINK];
    object.messages.iter().any(|m| kinds.contains(&m.kind))
}

/// Links of a group in their order; those to names rather than objects are left out.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn links(file: &File, group: &Object) -> Result<Vec<Link>, RecordingError> {
    let broken = || file.wrong(group.at, "other bytes", "the links of a group");
    if let Some(mut cursor) = group.message(SYMBOLS) {
        let places = cursor.uint(file.address).zip(cursor.uint(file.address));
        let (tree, heap) = places.ok_or_else(broken)?;
        return old(file, tree, heap);
    }
    let own = group.messages.iter().filter(|m| m.kind == LINK);
    let mut found: Vec<(u64, Link)> = own
        .filter_map(|message| link(file, &message.body))
        .collect();
    if let Some(mut cursor) = group.message(LINK_INFO) {
        let places = (|| {
            let flags = cursor.uint(2)? >> 8;
            cursor.take(if flags & 1 != 0 { 8 } else { 0 })?;
            Some((cursor.uint(file.address)?, cursor.uint(file.address)?))
        })();
        let (heap, tree) = places.ok_or_else(broken)?;
        if file.is_given(heap) && file.is_given(tree) {
            // Behind the hash of the name.
            let objects = heap::objects(file, heap, tree, 4)?;
            found.extend(objects.iter().filter_map(|body| link(file, body)));
        }
    }
    // By creation where it was kept, else by name: a heap lists them in an order of its own.
    found.sort();
    Ok(found.into_iter().map(|(_, link)| link).collect())
}

/// A link to an object, with its number by creation, or zero.
fn link(file: &File, body: &[u8]) -> Option<(u64, Link)> {
    let mut cursor = Cursor(body);
    let flags = cursor.uint(2)? >> 8;
    let kind = if flags & 8 != 0 { cursor.byte()? } else { 0 };
    let order = if flags & 4 != 0 { cursor.uint(8)? } else { 0 };
    cursor.take(if flags & 16 != 0 { 1 } else { 0 })?;
    let length = cursor.uint(1 << (flags & 3))?;
    let name = cursor.take(usize::try_from(length).ok()?)?;
    let name = String::from_utf8_lossy(name).into_owned();
    let at = cursor.uint(file.address)?;
    (kind == 0).then_some((order, (name, at)))
}

/// Links of a group of the first version: a tree of tables, and a heap of names.
fn old(file: &File, tree: u64, heap: u64) -> Result<Vec<Link>, RecordingError> {
    let size = (8 + 2 * file.length + file.address) as u64;
    let (size, at) = file.parse(heap, size, "HEAP", |mut cursor| {
        cursor.take(4)?;
        let size = cursor.uint(file.length)?;
        cursor.take(file.length)?;
        Some((size, cursor.uint(file.address)?))
    })?;
    let names = file.read(at, size)?;
    let mut tables = Vec::new();
    collect(file, tree, None, &mut tables)?;
    let mut found = Vec::new();
    for table in tables {
        let entry = 24 + 2 * file.address;
        let count = file.parse(table, 8, "SNOD", |mut cursor| {
            cursor.take(2)?;
            cursor.uint(2)
        })?;
        let bytes = file.read(table + 8, count * entry as u64)?;
        for entry in bytes.chunks_exact(entry) {
            let mut cursor = Cursor(entry);
            let place = cursor.uint(file.address).zip(cursor.uint(file.address));
            let kind = cursor.uint(4);
            let name = place.and_then(|(name, _)| names.get(usize::try_from(name).ok()?..));
            let Some((name, (_, object))) = name.zip(place) else {
                return Err(file.wrong(table, "a name beyond its heap", "one within it"));
            };
            let name = name.split(|byte| *byte == 0).next().unwrap_or(&[]);
            // Links to names are of kind 2.
            if kind != Some(2) {
                found.push((String::from_utf8_lossy(name).into_owned(), object));
            }
        }
        if found.len() > limits::COLUMNS {
            let most = format!("{} at most", limits::COLUMNS);
            return Err(file.wrong(table, "more links", most));
        }
    }
    Ok(found)
}

/// Addresses of the tables below a node of a tree of version 1.
fn collect(
    file: &File,
    at: u64,
    above: Option<u8>,
    tables: &mut Vec<u64>,
) -> Result<(), RecordingError> {
    let lead = (8 + 2 * file.address) as u64;
    let (kind, level, count) = file.parse(at, lead, "TREE", |mut cursor| {
        Some((cursor.byte()?, cursor.byte()?, cursor.uint(2)?))
    })?;
    if kind != 0 || above.is_some_and(|above| level >= above) || level > 16 {
        return Err(file.wrong(
            at,
            format!("a node of level {level}"),
            "one of links, lower",
        ));
    }
    let pair = file.length + file.address;
    let bytes = file.read(at + lead, count * pair as u64)?;
    for pair in bytes.chunks_exact(pair) {
        let mut cursor = Cursor(pair);
        cursor.uint(file.length);
        let child = cursor.uint(file.address).unwrap_or(u64::MAX);
        if level == 0 {
            tables.push(child);
        } else {
            collect(file, child, Some(level), tables)?;
        }
    }
    Ok(())
}

//! Heaps: links and attributes of objects that have many of them, and texts.

use super::file::{Cursor, File};
use crate::limits;
use crate::recording::RecordingError;

/// Deepest tree of records, and deepest nest of blocks.
const DEEPEST: u64 = 16;

/// The objects that a tree of version 2 lists by their identities, which begin behind `lead` bytes
/// of each record, in a fractal heap.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn objects(
    file: &File,
    heap: u64,
    tree: u64,
    lead: usize,
) -> Result<Vec<Vec<u8>>, RecordingError> {
    let heap = Heap::read(file, heap)?;
    let records = records(file, tree)?;
    let identity = |record: &Vec<u8>| record.get(lead..).map(<[u8]>::to_vec);
    let identities = records.iter().filter_map(identity);
    identities.map(|id| heap.object(file, &id)).collect()
}

/// Number of bytes that hold numbers up to `most`.
fn width(most: u64) -> usize {
    most.max(1).ilog2() as usize / 8 + 1
}

/// All records of a tree of version 2, in their order.
fn records(file: &File, at: u64) -> Result<Vec<Vec<u8>>, RecordingError> {
    let size = (18 + file.address + file.length) as u64;
    let (node, record, depth, root, count) = file.parse(at, size, "BTHD", |mut cursor| {
        cursor.take(2)?;
        let node = cursor.uint(4)?;
        let record = cursor.uint(2)?;
        let depth = cursor.uint(2)?;
        cursor.take(2)?;
        let root = cursor.uint(file.address)?;
        Some((node, record, depth, root, cursor.uint(2)?))
    })?;
    if record == 0 || depth > DEEPEST || node < 64 {
        return Err(file.wrong(at, format!("a tree of depth {depth}"), "one of links"));
    }
    // Sizes of what a node says of its children, by their depth: the number of records is as wide
    // for all, that of all records below them grows.
    let most = (node - 10) / record;
    let mut below = vec![0];
    let mut all = most;
    for _ in 0..depth {
        let known = below.last().copied().unwrap_or(0);
        let pointer = (file.address + width(most) + known) as u64;
        let records = node.saturating_sub(10 + pointer) / (record + pointer);
        all = (records + 1).saturating_mul(all).saturating_add(records);
        below.push(width(all));
    }
    let mut found = Vec::new();
    let tree = Tree {
        file,
        node,
        record: record as usize,
        width: width(most),
        below,
    };
    if count > 0 && file.is_given(root) {
        tree.collect(root, count, depth as usize, &mut found)?;
    }
    Ok(found)
}

struct Tree<'a> {
    file: &'a File,
    node: u64,
    record: usize,
    width: usize,
    below: Vec<usize>,
}

impl Tree<'_> {
    fn collect(
        &self,
        at: u64,
        count: u64,
        depth: usize,
        found: &mut Vec<Vec<u8>>,
    ) -> Result<(), RecordingError> {
        let signature = if depth == 0 { "BTLF" } else { "BTIN" };
        let (own, children) = self.file.parse(at, self.node, signature, |mut cursor| {
            cursor.take(2)?;
            let own = (0..count).map(|_| cursor.take(self.record).map(<[u8]>::to_vec));
            let own: Vec<_> = own.collect::<Option<_>>()?;
            let below = depth.checked_sub(1).and_then(|d| self.below.get(d));
            let mut children = Vec::new();
            if let Some(below) = below {
                for _ in 0..=count {
                    children.push((cursor.uint(self.file.address)?, cursor.uint(self.width)?));
                    cursor.take(*below)?;
                }
            }
            Some((own, children))
        })?;
        found.extend(own);
        if found.len() > limits::COLUMNS {
            return Err(self
                .file
                .wrong(at, "more links", format!("{} at most", limits::COLUMNS)));
        }
        for (child, count) in children {
            self.collect(child, count, depth - 1, found)?;
        }
        Ok(())
    }
}

/// A fractal heap without filters.
struct Heap {
    at: u64,
    /// Bytes of a place in the heap, and of an object's size.
    offset: usize,
    length: usize,
    /// Blocks of a row, size of a block of the first row, and of the largest that has objects.
    width: u64,
    first: u64,
    largest: u64,
    root: u64,
    /// Rows of the root; 0: it has objects itself.
    rows: u64,
}

impl Heap {
    fn read(file: &File, at: u64) -> Result<Self, RecordingError> {
        let size = 22 + 12 * file.length as u64 + 3 * file.address as u64;
        let (heap, filters) = file.parse(at, size, "FRHP", |mut cursor| {
            cursor.take(3)?;
            let filters = cursor.uint(2)?;
            cursor.byte()?;
            let object = cursor.uint(4)?;
            cursor.take(10 * file.length + 2 * file.address)?;
            let columns = cursor.uint(2)?;
            let first = cursor.uint(file.length)?;
            let largest = cursor.uint(file.length)?;
            let bits = cursor.uint(2)?;
            cursor.take(2)?;
            let heap = Self {
                at,
                offset: bits.div_ceil(8) as usize,
                // Of a place in the largest block, or of the largest object.
                length: width(object).min((largest.max(1).ilog2() as usize).div_ceil(8)),
                width: columns,
                first,
                largest,
                root: cursor.uint(file.address)?,
                rows: cursor.uint(2)?,
            };
            Some((heap, filters))
        })?;
        let powers = heap.first.is_power_of_two() && heap.largest.is_power_of_two();
        if filters != 0 || !powers || heap.width == 0 || heap.offset > 8 {
            return Err(file.wrong(at, "a heap of another form", "one without filters"));
        }
        Ok(heap)
    }

    /// Size of a block of a row.
    fn block(&self, row: u64) -> Option<u64> {
        self.first.checked_shl(row.saturating_sub(1) as u32)
    }

    /// An object by its identity.
    fn object(&self, file: &File, id: &[u8]) -> Result<Vec<u8>, RecordingError> {
        let mut cursor = Cursor(id);
        let kind = cursor.byte().map(|byte| byte >> 4 & 3);
        let place = cursor.uint(self.offset).zip(cursor.uint(self.length));
        let Some((mut place, size)) = place.filter(|_| kind == Some(0)) else {
            return Err(file.wrong(self.at, "a link of more than 64 KiB", "a shorter one"));
        };
        let lost = || file.wrong(self.at, "a link beyond the heap", "one within it");
        let (mut at, mut rows) = (self.root, self.rows);
        for _ in 0..DEEPEST {
            if rows == 0 {
                return file.read(at.checked_add(place).ok_or_else(lost)?, size);
            }
            // The row that has the place, the block within it, and the place within the block.
            let mut row = 0;
            let mut begin = 0;
            let (column, block) = loop {
                let block = self.block(row).filter(|_| row < rows).ok_or_else(lost)?;
                let end = block
                    .checked_mul(self.width)
                    .and_then(|all| all.checked_add(begin));
                let end = end.ok_or_else(lost)?;
                if place < end {
                    break ((place - begin) / block, block);
                }
                (begin, row) = (end, row + 1);
            };
            let entry = (row * self.width + column) * file.address as u64;
            let lead = 5 + (file.address + self.offset) as u64;
            let bytes = file.read(at.saturating_add(lead + entry), file.address as u64)?;
            at = Cursor(&bytes).uint(file.address).ok_or_else(lost)?;
            place -= begin + column * block;
            // A block that has no objects itself has as many rows as make its size.
            rows = 0;
            if block > self.largest {
                let all = block / (self.first * self.width).max(1);
                rows = u64::from(all.max(1).ilog2()) + 1;
            }
        }
        Err(lost())
    }
}

/// A text that lies in a global heap: its length, the address of a collection and the number of an
/// object in it.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn text(file: &File, element: &[u8]) -> Result<String, RecordingError> {
    let mut cursor = Cursor(element);
    let place = (|| Some((cursor.uint(4)?, cursor.uint(file.address)?, cursor.uint(4)?)))();
    let Some((size, at, number)) = place.filter(|(size, ..)| *size > 0) else {
        return Ok(String::new());
    };
    let whole = file.parse(at, 8 + file.length as u64, "GCOL", |mut cursor| {
        cursor.take(4)?;
        cursor.uint(file.length)
    })?;
    // Texts are short and collections have some thousand bytes: object by object.
    let lead = 8 + file.length as u64;
    let mut next = lead;
    while next.checked_add(lead).is_some_and(|end| end <= whole) {
        let bytes = file.read(at.saturating_add(next), lead)?;
        let mut cursor = Cursor(&bytes);
        let own = cursor.uint(2);
        let length = cursor.take(6).and_then(|_| cursor.uint(file.length));
        let length = length.unwrap_or(0);
        if own == Some(number) {
            let bytes = file.read(at + next + lead, size.min(length))?;
            return Ok(String::from_utf8_lossy(&bytes).into_owned());
        }
        if own == Some(0) {
            break;
        }
        next = next
            .saturating_add(lead)
            .saturating_add(length)
            .next_multiple_of(8);
    }
    Err(file.wrong(at, "no text", format!("text {number} of this heap")))
}

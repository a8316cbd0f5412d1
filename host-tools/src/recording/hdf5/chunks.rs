//! Chunks of a dataset: their places, by each of the indices that the format has for them.

use super::file::{Cursor, File};
use crate::recording::RecordingError;
use std::cmp::Ordering;

/// Deepest tree.
const DEEPEST: u8 = 16;

/// Index of the chunks; addresses are not given where no chunk was written.
#[derive(Clone, Debug)]
pub(super) enum Index {
    /// A tree of version 1.
    Tree(Option<u64>),
    /// One chunk, with its stored size and the filters left out where it went through filters.
    Single(Option<u64>, Option<(u64, u32)>),
    /// Chunks one after the other.
    Implicit(Option<u64>),
    /// A list of fixed length.
    Fixed(Option<u64>),
    /// A list that grows.
    Growing(Option<u64>),
}

impl Index {
    /// Reads the description of an index of layouts of version 4 on; `None` within: one that is
    /// not read.
    pub(super) fn read(file: &File, mut cursor: Cursor<'_>, flags: u8) -> Option<Option<Self>> {
        let kind = cursor.byte()?;
        let mut stored = None;
        match kind {
            1 if flags & 2 != 0 => {
                stored = Some((cursor.uint(file.length)?, cursor.uint(4)? as u32));
            }
            1 | 2 => {}
            3 => cursor.take(1).map(|_| ())?,
            4 => cursor.take(5).map(|_| ())?,
            _ => return Some(None),
        }
        let at = cursor.uint(file.address)?;
        let at = file.is_given(at).then_some(at);
        Some(Some(match kind {
            1 => Self::Single(at, stored),
            2 => Self::Implicit(at),
            3 => Self::Fixed(at),
            _ => Self::Growing(at),
        }))
    }
}

/// A chunk as it is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stored {
    pub(super) at: u64,
    pub(super) size: u64,
    /// Filters that were left out.
    pub(super) mask: u32,
}

/// Chunks of a dataset.
pub(super) struct Chunks {
    index: Index,
    /// Elements of a chunk along each dimension, and bytes of a chunk without filters.
    sides: Vec<u64>,
    size: u64,
    filtered: bool,
    /// Dimensions from the slowest one of the lists, with the number of chunks along each.
    order: Vec<(usize, u64)>,
    /// Nodes of the tree on the way to the last chunk that was asked for.
    way: Vec<(u64, Vec<u8>)>,
    list: Option<List>,
}

impl Chunks {
    /// `most` are the most elements along each dimension; `None`: without a limit.
    pub(super) fn new(
        index: Index,
        sides: &[u64],
        size: u64,
        filtered: bool,
        most: &[Option<u64>],
    ) -> Self {
        let along = |d: usize| {
            let side = sides.get(d).copied().unwrap_or(1).max(1);
            most.get(d)
                .copied()
                .flatten()
                .map(|most| most.div_ceil(side))
        };
        // The dimension without a limit is the slowest one.
        let mut order: Vec<usize> = (0..sides.len()).collect();
        order.sort_by_key(|d| along(*d).is_some());
        Self {
            index,
            size,
            filtered,
            order: order
                .into_iter()
                .map(|d| (d, along(d).unwrap_or(1)))
                .collect(),
            sides: sides.to_vec(),
            way: Vec::new(),
            list: None,
        }
    }

    /// The chunk at a place, which counts chunks along each dimension; `None` if it was never
    /// written.
    ///
    /// # Errors
    /// [`RecordingError`] of the structure.
    pub(super) fn find(
        &mut self,
        file: &File,
        place: &[u64],
    ) -> Result<Option<Stored>, RecordingError> {
        let whole = |at: u64| Stored {
            at,
            size: self.size,
            mask: 0,
        };
        let number = || {
            let step = |all: u64, (d, count): &(usize, u64)| {
                let own = place.get(*d)?;
                all.checked_mul(*count)?.checked_add(*own)
            };
            self.order.iter().try_fold(0, step)
        };
        Ok(match self.index {
            Index::Tree(None)
            | Index::Single(None, _)
            | Index::Implicit(None)
            | Index::Fixed(None)
            | Index::Growing(None) => None,
            Index::Single(Some(at), None) => Some(whole(at)),
            Index::Single(Some(at), Some((size, mask))) => Some(Stored { at, size, mask }),
            Index::Implicit(Some(at)) => {
                let before = number().and_then(|number| number.checked_mul(self.size));
                before.and_then(|before| at.checked_add(before)).map(whole)
            }
            Index::Tree(Some(at)) => self.in_tree(file, at, place)?,
            Index::Fixed(Some(at)) | Index::Growing(Some(at)) => {
                let grows = matches!(self.index, Index::Growing(_));
                let number = number();
                let list = match &self.list {
                    Some(list) => list,
                    None => self.list.insert(List::read(file, at, grows)?),
                };
                let entry = match number {
                    Some(number) => list.entry(file, number)?,
                    None => None,
                };
                let Some(entry) = entry else { return Ok(None) };
                let bytes = file.read(entry, list.size as u64)?;
                let mut cursor = Cursor(&bytes);
                let width = (list.size).saturating_sub(file.address + 4);
                let at = cursor.uint(file.address).filter(|at| file.is_given(*at));
                match (at, self.filtered) {
                    (Some(at), false) => Some(whole(at)),
                    (Some(at), true) => {
                        let rest = cursor.uint(width).zip(cursor.uint(4));
                        rest.map(|(size, mask)| Stored {
                            at,
                            size,
                            mask: mask as u32,
                        })
                    }
                    (None, _) => None,
                }
            }
        })
    }

    /// Looks for a chunk in a tree of version 1, along the way that was gone before where it is the
    /// same.
    fn in_tree(
        &mut self,
        file: &File,
        root: u64,
        place: &[u64],
    ) -> Result<Option<Stored>, RecordingError> {
        let key = 16 + 8 * place.len();
        let pair = key + file.address;
        let lead = 8 + 2 * file.address;
        let mut at = root;
        let mut above = DEEPEST;
        for step in 0.. {
            if self.way.get(step).is_none_or(|(own, _)| *own != at) {
                self.way.truncate(step);
                self.way.push((at, node(file, at, lead, pair)?));
            }
            let node: &[u8] = self.way.get(step).map_or(&[], |(_, node)| node);
            let level = node.get(5).copied().unwrap_or(0);
            if level >= above {
                let found = format!("a node of level {level}");
                return Err(file.wrong(at, found, format!("one below {above}")));
            }
            let pairs = node.get(lead..).unwrap_or(&[]);
            // Elements before a chunk along each dimension lie behind its size and its mask.
            let compare = |number: usize| {
                let mut offsets = Cursor(pairs.get(number * pair + 8..).unwrap_or(&[]));
                let sides = self.sides.iter().zip(place);
                let each = sides.map(|(side, own)| {
                    let offset = offsets.uint(8).unwrap_or(u64::MAX);
                    offset.cmp(&own.saturating_mul(*side))
                });
                each.fold(Ordering::Equal, Ordering::then)
            };
            // The last pair that does not begin behind the chunk.
            let (mut low, mut high) = (0, pairs.len() / pair);
            while low < high {
                let middle = low.midpoint(high);
                if compare(middle) == Ordering::Greater {
                    high = middle;
                } else {
                    low = middle + 1;
                }
            }
            let Some(number) = low.checked_sub(1) else {
                return Ok(None);
            };
            let mut cursor = Cursor(pairs.get(number * pair..).unwrap_or(&[]));
            let found = (|| {
                let (size, mask) = (cursor.uint(4)?, cursor.uint(4)? as u32);
                cursor.take(key - 8)?;
                let at = cursor.uint(file.address)?;
                Some(Stored { at, size, mask })
            })();
            let Some(found) = found else { return Ok(None) };
            if level == 0 {
                return Ok((compare(number) == Ordering::Equal).then_some(found));
            }
            (at, above) = (found.at, level);
        }
        Ok(None)
    }
}

/// The bytes of a node of a tree of version 1: its pairs of key and address behind `lead` bytes.
fn node(file: &File, at: u64, lead: usize, pair: usize) -> Result<Vec<u8>, RecordingError> {
    let (kind, count) = file.parse(at, lead as u64, "TREE", |mut cursor| {
        Some((cursor.uint(2)? as u8, cursor.uint(2)?))
    })?;
    if kind != 1 {
        return Err(file.wrong(at, "a tree of links", "one of chunks"));
    }
    file.read(at, lead as u64 + count * pair as u64)
}

/// A list of chunks.
struct List {
    /// Bytes of an entry.
    size: usize,
    /// Entries of a page.
    page: u64,
    form: Form,
}

enum Form {
    /// Number of entries and address of the block that has them.
    Fixed(u64, u64),
    Growing {
        at: u64,
        /// Bytes of a place in the list.
        offset: u64,
        /// Entries in the index block itself, and in the smallest data block.
        own: u64,
        least: u64,
        /// Data blocks that the index block lists, and groups of equal data blocks in them.
        direct: u64,
        groups: u64,
    },
}

impl List {
    fn read(file: &File, at: u64, grows: bool) -> Result<Self, RecordingError> {
        let wrong = || file.wrong(at, "other bytes", "a list of chunks");
        let size = (12 + 7 * file.length + file.address) as u64;
        let list = if grows {
            file.parse(at, size, "EAHD", |mut cursor| {
                cursor.take(2)?;
                let size = cursor.byte()?.into();
                let bits = u64::from(cursor.byte()?);
                let own = cursor.byte()?.into();
                let least = u64::from(cursor.byte()?);
                let pointers = u64::from(cursor.byte()?);
                let page = 1_u64.checked_shl(cursor.byte()?.into())?;
                cursor.take(6 * file.length)?;
                let at = cursor.uint(file.address)?;
                let sound = least.is_power_of_two() && pointers.is_power_of_two();
                let form = Form::Growing {
                    at,
                    offset: bits.div_ceil(8),
                    own,
                    least,
                    direct: 2 * (pointers - u64::from(sound)),
                    groups: 2 * u64::from(pointers.checked_ilog2()?),
                };
                sound.then_some(Self { size, page, form })
            })?
        } else {
            file.parse(at, size, "FAHD", |mut cursor| {
                cursor.take(2)?;
                let size = cursor.byte()?.into();
                let page = 1_u64.checked_shl(cursor.byte()?.into())?;
                let form = Form::Fixed(cursor.uint(file.length)?, cursor.uint(file.address)?);
                Some(Self { size, page, form })
            })?
        };
        if list.size < file.address || list.size > file.address + 12 {
            return Err(wrong());
        }
        Ok(list)
    }

    /// Address of an entry; `None` if it was never written.
    fn entry(&self, file: &File, number: u64) -> Result<Option<u64>, RecordingError> {
        let address = file.address as u64;
        match self.form {
            Form::Fixed(count, at) if number < count && file.is_given(at) => {
                self.within(file, at, 6 + address, [number, count])
            }
            Form::Fixed(..) => Ok(None),
            Form::Growing { at, .. } if !file.is_given(at) => Ok(None),
            Form::Growing {
                at,
                offset,
                own,
                least,
                direct,
                groups,
            } => {
                let lead = at.saturating_add(6 + address);
                let after = |at: u64, bytes: u64| at.saturating_add(bytes);
                let size = self.size as u64;
                let Some(number) = number.checked_sub(own) else {
                    return Ok(Some(after(lead, number * size)));
                };
                // Group n has 2^(n/2) data blocks of `least` * 2^((n+1)/2) entries.
                let group = u64::from((number / least).saturating_add(1).ilog2());
                let begin = ((1 << group) - 1) * least;
                let entries = least << group.div_ceil(2);
                let block = (number - begin) / entries;
                let blocks = |group: u64| 1_u64 << (group / 2);
                let pointers = after(lead, own * size);
                let number = (number - begin) % entries;
                let page = number / self.page;
                let mut pages = 0;
                let pointer = if group < groups {
                    let before: u64 = (0..group).map(blocks).sum();
                    after(pointers, (before + block) * address)
                } else {
                    let group_at = after(pointers, (direct + group - groups) * address);
                    let Some(group_at) = given(file, group_at)? else {
                        return Ok(None);
                    };
                    pages = entries / self.page;
                    let lead = after(group_at, 6 + address + offset);
                    let mut bits = 0;
                    if pages > 1 {
                        bits = pages.div_ceil(8).saturating_mul(blocks(group));
                        if !bit(file, lead, block * pages + page)? {
                            return Ok(None);
                        }
                    }
                    after(lead, bits.saturating_add(block * address))
                };
                let Some(block_at) = given(file, pointer)? else {
                    return Ok(None);
                };
                // A checksum stands above the pages and behind each.
                let sums = if pages > 1 { 4 * (page + 1) } else { 0 };
                let lead = after(block_at, 6 + address + offset);
                Ok(Some(after(lead, sums + number * size)))
            }
        }
    }

    /// Address of an entry in a block of a list of fixed length, which has a bit a page.
    fn within(
        &self,
        file: &File,
        block: u64,
        lead: u64,
        [number, count]: [u64; 2],
    ) -> Result<Option<u64>, RecordingError> {
        let begin = block.saturating_add(lead);
        let entries = number.saturating_mul(self.size as u64);
        if count <= self.page {
            return Ok(Some(begin.saturating_add(entries)));
        }
        let page = number / self.page;
        let written = bit(file, begin, page)?;
        let bits = count.div_ceil(self.page).div_ceil(8);
        // A checksum stands behind the bits and behind each page.
        let before = bits
            .saturating_add((page + 1).saturating_mul(4))
            .saturating_add(entries);
        Ok(written.then_some(begin.saturating_add(before)))
    }
}

/// A bit of a list of bits.
fn bit(file: &File, at: u64, number: u64) -> Result<bool, RecordingError> {
    let bits = file.read(at.saturating_add(number / 8), 1)?;
    Ok(bits
        .first()
        .is_some_and(|bits| bits & (0x80 >> (number % 8)) != 0))
}

/// The address that stands at an address, where one is given.
fn given(file: &File, at: u64) -> Result<Option<u64>, RecordingError> {
    let bytes = file.read(at, file.address as u64)?;
    let found = Cursor(&bytes).uint(file.address);
    Ok(found.filter(|found| file.is_given(*found)))
}

//! Items one behind the other in pages of flash, of which the newest whole one is valid.
//!
//! # Design
//!
//! Every item begins at a multiple of [`CELL`] bytes and is written from its front to its end:
//!
//! | bytes | hold |
//! | --- | --- |
//! | 0..2 | [`MARK`] |
//! | 2..4 | number of bytes of the contents |
//! | 4..8 | number of the item: greater than that of every item before it |
//! | 8..12 | CRC-32 of the contents |
//! | 12..16 | CRC-32 of bytes 0..12 |
//! | 16.. | contents, filled up with 0xFF to a multiple of [`CELL`] |
//!
//! Numbers are little-endian. An item is whole when both checksums are right.
//!
//! Three rules keep the newest whole item through any power cut:
//!
//! 1. The page that holds it is neither erased nor overwritten. A new item lies behind the last
//!    byte of that page that is not erased, or in another page.
//! 2. Another page is always erased before its first item is written, even if it seems erased:
//!    after an interrupted erase, bits anywhere in it may be unchanged.
//! 3. Pages have no state of their own. Items are found by reading every cell, so that no
//!    half-written mark can hide an item, and the remains of an interrupted write cannot run into
//!    the item behind them.
//!
//! Where no whole item can be read, the page that seems to hold the newest one is kept, and so is one
//! page at least until an item was written and read back: what cannot be read now may be read later.
//!
//! These rules assume that bytes read the same each time. A bit whose change was interrupted may
//! not, for a while: then an item interrupted at its last byte may be valid at first and not later.

use crate::wire::CRC32;
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Items begin at multiples of so many bytes; the head of an item is as long.
pub const CELL: usize = 16;
const CELL_SIZE: u32 = CELL as u32;
/// First bytes of an item of this form.
const MARK: [u8; 2] = *b"S1";
/// Attempts to write each page.
const TRIES: usize = 2;

/// The head of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Head {
    length: u16,
    number: u32,
    checksum: u32,
}

impl Head {
    fn to_cell(self) -> [u8; CELL] {
        let [m0, m1] = MARK;
        let [l0, l1] = self.length.to_le_bytes();
        let [n0, n1, n2, n3] = self.number.to_le_bytes();
        let [c0, c1, c2, c3] = self.checksum.to_le_bytes();
        let covered = [m0, m1, l0, l1, n0, n1, n2, n3, c0, c1, c2, c3];
        let [h0, h1, h2, h3] = CRC32.checksum(&covered).to_le_bytes();
        [
            m0, m1, l0, l1, n0, n1, n2, n3, c0, c1, c2, c3, h0, h1, h2, h3,
        ]
    }

    fn from_cell(cell: [u8; CELL]) -> Option<Self> {
        let [_, _, l0, l1, n0, n1, n2, n3, c0, c1, c2, c3, ..] = cell;
        let head = Self {
            length: u16::from_le_bytes([l0, l1]),
            number: u32::from_le_bytes([n0, n1, n2, n3]),
            checksum: u32::from_le_bytes([c0, c1, c2, c3]),
        };
        (head.to_cell() == cell).then_some(head)
    }

    /// Bytes from its beginning to where the next item may begin.
    const fn span(self) -> u32 {
        item_room(self.length as usize) as u32
    }
}

/// Bytes that an item with so many bytes of contents takes.
pub const fn item_room(length: usize) -> usize {
    CELL.saturating_add(length.div_ceil(CELL).saturating_mul(CELL))
}

/// The newest whole item.
#[derive(Clone, Copy, Debug)]
pub struct Newest {
    head: Head,
    at: u32,
    /// The page it lies in.
    page: u32,
    /// Address behind the last byte of that page that is not erased.
    free: u32,
}

impl Newest {
    /// Number of bytes of its contents.
    pub fn length(&self) -> usize {
        self.head.length.into()
    }
}

/// Content of the pages.
#[derive(Clone, Copy, Debug)]
pub struct Survey {
    /// The newest whole item.
    pub newest: Option<Newest>,
    /// `true` if all bits are set.
    pub is_erased: bool,
    /// Greatest number of an item, whole or not; zero without any.
    greatest: u32,
    /// The last page that is not erased, of those with the greatest number of an item: that number,
    /// and the page.
    last: Option<(u32, u32)>,
}

impl Survey {
    const ERASED: Self = Self {
        newest: None,
        is_erased: true,
        greatest: 0,
        last: None,
    };
}

/// Pages of a flash.
pub struct Journal<F> {
    flash: F,
    range: Range<u32>,
}

impl<F: NorFlash> Journal<F> {
    const PAGE: u32 = {
        assert!(F::ERASE_SIZE.is_multiple_of(CELL), "pages of whole cells");
        assert!(CELL.is_multiple_of(F::WRITE_SIZE), "cells can be written");
        assert!(CELL.is_multiple_of(F::READ_SIZE), "cells can be read");
        F::ERASE_SIZE as u32
    };

    /// Items in a range of addresses; `None` unless these are two whole pages of the flash or
    /// more.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        let pages = range.end.checked_sub(range.start)? / Self::PAGE;
        let is_whole = [range.start, range.end]
            .iter()
            .all(|edge| edge.is_multiple_of(Self::PAGE));
        let is_there = range.end as usize <= flash.capacity();
        (pages >= 2 && is_whole && is_there).then_some(Self { flash, range })
    }

    /// Returns the flash.
    pub fn release(self) -> F {
        self.flash
    }

    /// Most bytes that an item may take.
    pub const fn page_size() -> usize {
        Self::PAGE as usize
    }

    /// Reads every cell. Nothing is written.
    pub fn survey(&mut self) -> Result<Survey, F::Error> {
        let mut survey = Survey::ERASED;
        for page in self.range.clone().step_by(Self::PAGE as usize) {
            self.survey_page(page, &mut survey)?;
        }
        Ok(survey)
    }

    fn survey_page(&mut self, page: u32, survey: &mut Survey) -> Result<(), F::Error> {
        let end = page.saturating_add(Self::PAGE);
        let (mut at, mut free, mut found) = (page, page, None);
        let mut greatest = 0;
        while at < end {
            let cell = self.cell(at)?;
            let mut next = at.saturating_add(CELL_SIZE);
            if cell == [0xFF; CELL] {
                at = next;
                continue;
            }
            survey.is_erased = false;
            free = next;
            let head = Head::from_cell(cell);
            if let Some(head) = head.filter(|head| head.span() <= end.saturating_sub(at)) {
                greatest = head.number.max(greatest);
                // The contents of an incomplete item are not skipped: newer items may lie there.
                if self.checksum(next, head.length.into())? == head.checksum {
                    next = at.saturating_add(head.span());
                    free = next;
                    let newest: Option<Newest> = found.or(survey.newest);
                    if newest.is_none_or(|newest| newest.head.number < head.number) {
                        found = Some(Newest {
                            head,
                            at,
                            page,
                            free,
                        });
                    }
                }
            }
            at = next;
        }
        survey.greatest = survey.greatest.max(greatest);
        if free > page {
            survey.last = survey.last.max(Some((greatest, page)));
        }
        if let Some(found) = found {
            survey.newest = Some(Newest { free, ..found });
        }
        Ok(())
    }

    /// Reads the contents of an item, and the 0xFF behind them; `None` if `buffer` is shorter than
    /// whole cells of them.
    pub fn read<'b>(
        &mut self,
        item: &Newest,
        buffer: &'b mut [u8],
    ) -> Result<Option<&'b [u8]>, F::Error> {
        let filled = item_room(item.length()).saturating_sub(CELL);
        let Some(bytes) = buffer.get_mut(..filled) else {
            return Ok(None);
        };
        self.flash.read(item.at.saturating_add(CELL_SIZE), bytes)?;
        Ok(bytes.get(..item.length()))
    }

    /// Writes an item, whose contents take the first `length` bytes behind the first [`CELL`] of
    /// `item`, and reads it back. `item` has [`item_room`] bytes, not more than a page. `false` if
    /// it cannot be read; the newest item before is valid then.
    pub fn append(&mut self, item: &mut [u8], length: u16) -> Result<bool, F::Error> {
        let survey = self.survey()?;
        // No flash lasts for so many items: this is the data of another program.
        let is_over = survey.greatest == u32::MAX;
        let Some((head, contents)) = item.split_first_chunk_mut() else {
            return Ok(false);
        };
        let Some((contents, filling)) = contents.split_at_mut_checked(length.into()) else {
            return Ok(false);
        };
        filling.fill(0xFF);
        *head = Head {
            length,
            number: if is_over {
                1
            } else {
                survey.greatest.saturating_add(1)
            },
            checksum: CRC32.checksum(contents),
        }
        .to_cell();

        let Range { start, end } = self.range;
        let mut first = start;
        if let Some(newest) = survey.newest {
            first = newest.page.saturating_add(Self::PAGE);
            let room = first.saturating_sub(newest.free) as usize;
            if !is_over && item.len() <= room && self.write(newest.free, item)? {
                return Ok(true);
            }
        }
        let newest = survey.newest.map(|newest| newest.page);
        let kept = newest.or(survey.last.map(|(_, page)| page));
        for _ in 0..TRIES {
            let step = Self::PAGE as usize;
            let (behind, before) = ((first..end).step_by(step), (start..first).step_by(step));
            for page in behind.chain(before).filter(|page| Some(*page) != kept) {
                self.erase(page)?;
                if !self.write(page, item)? {
                    continue;
                }
                if is_over {
                    let others = (start..end).step_by(step).filter(|other| *other != page);
                    others.into_iter().try_for_each(|other| self.erase(other))?;
                }
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn erase(&mut self, page: u32) -> Result<(), F::Error> {
        self.flash.erase(page, page.saturating_add(Self::PAGE))
    }

    /// Writes whole cells. `true` if they can be read.
    fn write(&mut self, at: u32, cells: &[u8]) -> Result<bool, F::Error> {
        self.flash.write(at, cells)?;
        let places = (at..self.range.end).step_by(CELL);
        for (at, cell) in places.zip(cells.as_chunks().0) {
            if self.cell(at)? != *cell {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn cell(&mut self, at: u32) -> Result<[u8; CELL], F::Error> {
        let mut cell = [0; CELL];
        self.flash.read(at, &mut cell)?;
        Ok(cell)
    }

    /// CRC-32 of so many bytes.
    fn checksum(&mut self, from: u32, length: usize) -> Result<u32, F::Error> {
        let mut crc = CRC32.digest();
        let mut left = length;
        for at in (from..self.range.end).step_by(CELL) {
            let cell = self.cell(at)?;
            crc.update(cell.get(..left).unwrap_or(&cell));
            left = left.saturating_sub(CELL);
            if left == 0 {
                break;
            }
        }
        Ok(crc.finalize())
    }
}

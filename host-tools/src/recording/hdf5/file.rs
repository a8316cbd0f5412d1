//! The bytes of an HDF5 file: its superblock, and parts of the file by their addresses.

use crate::limits;
use crate::recording::bytes::{Bytes, Part};
use crate::recording::{Place, RecordingError};
use std::cell::Cell;
use std::io::Read;
use std::rc::Rc;

/// First bytes of a superblock.
pub(super) const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Bytes at which a superblock may begin: behind a user block, or with the file.
pub(super) const STARTS: [u64; 4] = [0, 512, 1024, 2048];
/// Most bytes of one part of the structure.
const PART: u64 = 16 << 20;

/// Numbers and texts one after the other; `None` where the bytes end.
#[derive(Clone, Copy)]
pub(super) struct Cursor<'a>(pub(super) &'a [u8]);

impl<'a> Cursor<'a> {
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (part, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(part)
    }

    /// A whole number of up to eight bytes, least significant byte first.
    pub(super) fn uint(&mut self, size: usize) -> Option<u64> {
        let mut raw = [0; 8];
        raw.get_mut(..size)?.copy_from_slice(self.take(size)?);
        Some(u64::from_le_bytes(raw))
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        self.take(1)?.first().copied()
    }

    /// Leaves out bytes up to a multiple of eight, counted from where `start` bytes were left.
    pub(super) fn pad(&mut self, start: usize) -> Option<()> {
        let read = start.checked_sub(self.0.len())?;
        self.take(read.next_multiple_of(8) - read).map(|_| ())
    }
}

/// An HDF5 file.
pub(super) struct File {
    pub(super) bytes: Rc<Bytes>,
    /// First byte of the superblock, from which addresses count.
    base: u64,
    /// Bytes of an address, and of a length.
    pub(super) address: usize,
    pub(super) length: usize,
    /// Address of the header of the root group.
    pub(super) root: u64,
    /// Bytes of the structure that may still be read.
    left: Cell<u64>,
}

impl File {
    /// Reads the superblock.
    ///
    /// # Errors
    /// [`RecordingError::Malformed`], [`RecordingError::Damaged`].
    pub(super) fn open(bytes: Rc<Bytes>) -> Result<Self, RecordingError> {
        let mut file = Self {
            bytes,
            base: 0,
            address: 8,
            length: 8,
            root: 0,
            left: Cell::new(limits::STRUCTURE),
        };
        for start in STARTS {
            if start + 8 <= file.bytes.len && file.read(start, 8)? == SIGNATURE {
                file.base = start;
                break;
            }
        }
        let size = (file.bytes.len - file.base).min(128);
        let block = file.read(0, size)?;
        let version = block.get(8).copied().unwrap_or(u8::MAX);
        let sizes = |file: &mut Self, cursor: &mut Cursor<'_>| {
            (file.address, file.length) = (cursor.byte()?.into(), cursor.byte()?.into());
            let sound = |size| matches!(size, 2 | 4 | 8);
            (sound(file.address) && sound(file.length)).then_some(())
        };
        let mut read = || -> Option<u64> {
            let mut cursor = Cursor(block.get(9..)?);
            if version <= 1 {
                cursor.take(4)?;
                sizes(&mut file, &mut cursor)?;
                cursor.take(if version == 1 { 13 } else { 9 } + 5 * file.address)?;
                return cursor.uint(file.address);
            }
            sizes(&mut file, &mut cursor)?;
            cursor.take(1 + 3 * file.address)?;
            cursor.uint(file.address)
        };
        let root = if version <= 3 { read() } else { None };
        match root {
            Some(root) => Ok(Self { root, ..file }),
            None => {
                let found = format!("a superblock of version {version}");
                Err(file.wrong(0, found, "one of version 0 to 3, whole"))
            }
        }
    }

    /// `true` if an address is given.
    pub(super) fn is_given(&self, at: u64) -> bool {
        at != u64::MAX >> (64 - 8 * self.address)
    }

    /// Reads a part of the structure.
    ///
    /// # Errors
    /// [`RecordingError::Malformed`] if it is beyond the end of the file or too long, or if the
    /// structure is; [`RecordingError::Damaged`].
    pub(super) fn read(&self, at: u64, size: u64) -> Result<Vec<u8>, RecordingError> {
        let mut part = self.part(at, size)?;
        // A short part costs a page as well.
        let left = self.left.get().checked_sub(size.saturating_add(64));
        let left = left.filter(|_| size <= PART);
        let Some(left) = left else {
            let found = format!("a structure of more than {} MiB", limits::STRUCTURE >> 20);
            return Err(self.wrong(at, found, "names and places of the channels"));
        };
        self.left.set(left);
        let mut bytes = vec![0; size as usize];
        let read = part.read_exact(&mut bytes);
        read.map_err(|e| self.bytes.damaged(self.base + at, &e))?;
        Ok(bytes)
    }

    /// Ends the count of the bytes of the structure, once it is known.
    pub(super) fn known(&self) {
        self.left.set(u64::MAX);
    }

    /// A part of the file.
    ///
    /// # Errors
    /// [`RecordingError::Malformed`] if the file ends before it does.
    pub(super) fn part(&self, at: u64, size: u64) -> Result<Part, RecordingError> {
        let begin = self.base.checked_add(at);
        let end = begin.and_then(|begin| begin.checked_add(size));
        match begin.zip(end) {
            Some((begin, end)) if end <= self.bytes.len => Ok(self.bytes.part(begin, end)),
            _ => {
                let found = format!("{size} bytes beyond the end of the file");
                Err(self.wrong(at, found, "bytes of the file, which was cut"))
            }
        }
    }

    /// First byte in the file of what has an address.
    pub(super) fn byte(&self, at: u64) -> u64 {
        self.base.saturating_add(at)
    }

    /// A structure that is not as the format has it.
    pub(super) fn wrong(
        &self,
        at: u64,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> RecordingError {
        let place = Place::Byte(self.byte(at));
        self.bytes.malformed(place, "", found, expected)
    }

    /// Reads a part that begins with a signature, and parses the bytes behind it.
    ///
    /// # Errors
    /// Those of [`File::read`]; [`RecordingError::Malformed`] if `parse` finds too few bytes.
    pub(super) fn parse<T>(
        &self,
        at: u64,
        size: u64,
        signature: &'static str,
        parse: impl FnOnce(Cursor<'_>) -> Option<T>,
    ) -> Result<T, RecordingError> {
        let bytes = self.read(at, size.min(self.bytes.len.saturating_sub(self.byte(at))))?;
        let body = bytes.strip_prefix(signature.as_bytes());
        body.and_then(|body| parse(Cursor(body)))
            .ok_or_else(|| self.wrong(at, "other bytes", format!("a whole `{signature}`")))
    }
}

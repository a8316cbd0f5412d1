//! Any part of a file, read in pages that are shared while somebody is in them.
//!
//! A file that has its channels one after the other is read at as many places as channels are
//! asked for. One that has them sample by sample is read at one place by all of them. Both take
//! one page a channel at most, however long the file is.

use super::{Mismatch, Place, RecordingError, input::Input};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::rc::{Rc, Weak};

/// Bytes of a page.
const PAGE: u64 = 32 << 10;

/// A file that is not compressed.
pub(super) struct Bytes {
    pub(super) file: PathBuf,
    pub(super) len: u64,
    opened: File,
    pages: RefCell<HashMap<u64, Weak<[u8]>>>,
}

impl Bytes {
    /// Opens the file of an input once more.
    ///
    /// # Errors
    /// [`RecordingError::OtherKind`] if it is compressed, [`RecordingError::Unreadable`].
    pub(super) fn open(input: Input, kind: &str) -> Result<Rc<Self>, RecordingError> {
        let file = input.file;
        if input.packed {
            return Err(RecordingError::OtherKind {
                file,
                kind: format!("{kind} compressed by gzip"),
                advice: "its channels lie one after the other, so that it cannot be read while it is unpacked: unpack it first",
            });
        }
        let unreadable = |source| RecordingError::Unreadable {
            file: file.clone(),
            source,
        };
        let opened = File::open(&file).map_err(unreadable)?;
        let len = opened.metadata().map_err(unreadable)?.len();
        Ok(Rc::new(Self {
            file,
            len,
            opened,
            pages: RefCell::default(),
        }))
    }

    fn page(&self, number: u64) -> io::Result<Rc<[u8]>> {
        let mut pages = self.pages.borrow_mut();
        if let Some(page) = pages.get(&number).and_then(Weak::upgrade) {
            return Ok(page);
        }
        let mut file = &self.opened;
        file.seek(SeekFrom::Start(number * PAGE))?;
        let mut page = Vec::with_capacity(PAGE as usize);
        file.take(PAGE).read_to_end(&mut page)?;
        let page: Rc<[u8]> = page.into();
        pages.retain(|_, page| page.strong_count() > 0);
        pages.insert(number, Rc::downgrade(&page));
        Ok(page)
    }

    /// The bytes from `at` to `end`, or to the end of the file.
    pub(super) fn part(self: &Rc<Self>, at: u64, end: u64) -> Part {
        Part {
            bytes: Rc::clone(self),
            at,
            end: end.min(self.len),
            page: None,
        }
    }

    /// The error of reading at a place.
    pub(super) fn damaged(&self, at: u64, error: &io::Error) -> RecordingError {
        RecordingError::Damaged {
            file: self.file.clone(),
            place: Place::Byte(at),
            reason: error.to_string(),
        }
    }

    /// A file that is not as its format has it.
    pub(super) fn malformed(
        &self,
        place: Place,
        channel: &str,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> RecordingError {
        RecordingError::Malformed {
            file: self.file.clone(),
            place: Some(place),
            mismatch: Box::new(Mismatch {
                channel: channel.to_owned(),
                found: found.into(),
                expected: expected.into(),
                advice: "the file is damaged, or a program wrote it that keeps to another description of the format: copy or export it again, or export it as CSV",
            }),
        }
    }
}

/// A part of a file, read from its beginning to its end.
pub(super) struct Part {
    bytes: Rc<Bytes>,
    pub(super) at: u64,
    pub(super) end: u64,
    page: Option<(u64, Rc<[u8]>)>,
}

impl BufRead for Part {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at >= self.end {
            return Ok(&[]);
        }
        let number = self.at / PAGE;
        if self.page.as_ref().is_none_or(|(own, _)| *own != number) {
            self.page = None;
            self.page = Some((number, self.bytes.page(number)?));
        }
        let page: &[u8] = self.page.as_ref().map_or(&[], |(_, page)| page);
        let begin = (self.at % PAGE) as usize;
        let end = (self.end - number * PAGE).min(page.len() as u64) as usize;
        Ok(page.get(begin..end).unwrap_or(&[]))
    }

    fn consume(&mut self, count: usize) {
        self.at += count as u64;
    }
}

impl Read for Part {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let found = self.fill_buf()?;
        let count = found.len().min(buffer.len());
        for (slot, byte) in buffer.iter_mut().zip(found) {
            *slot = *byte;
        }
        self.consume(count);
        Ok(count)
    }
}

//! Readings of a channel of a dataset, number by number.

use super::chunks::{Chunks, Stored};
use super::dataset::{Dataset, Place as Elements};
use super::file::File;
use crate::limits;
use crate::recording::bytes::Part;
use crate::recording::columns::Series;
use crate::recording::number::Coding;
use crate::recording::{Mismatch, Place, RecordingError};
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::io::Read;
use std::rc::{Rc, Weak};

/// A dataset of numbers that channels are read from; they share the chunks that they are in.
pub(super) struct Numbers {
    file: Rc<File>,
    dataset: Dataset,
    coding: Coding,
    /// Elements of a chunk along time, and along the channels.
    sides: [u64; 2],
    /// Dimension of time; with two dimensions the other one has the channels.
    time: usize,
    size: u64,
    chunks: Option<RefCell<Chunks>>,
    live: RefCell<HashMap<[u64; 2], Weak<Chunk>>>,
    /// Bytes of chunks that are held unpacked, of all datasets of the file.
    held: Rc<Cell<u64>>,
}

struct Chunk {
    numbers: Stock,
    held: Rc<Cell<u64>>,
}

enum Stock {
    /// At an address, up to another one.
    Stored(u64, u64),
    Unpacked(Vec<u8>),
    /// Never written.
    Missing,
}

impl Drop for Chunk {
    fn drop(&mut self) {
        if let Stock::Unpacked(bytes) = &self.numbers {
            self.held.set(self.held.get() - bytes.len() as u64);
        }
    }
}

impl Numbers {
    /// `time` is the dimension of time of a dataset of one or two dimensions, whose elements are
    /// numbers of `coding`.
    pub(super) fn new(
        file: &Rc<File>,
        dataset: Dataset,
        coding: Coding,
        time: usize,
        held: &Rc<Cell<u64>>,
    ) -> Self {
        let shape = &dataset.space.shape;
        let sides = match &dataset.place {
            Elements::Chunks(sides, _) => sides,
            _ => shape,
        };
        let side = |d: usize| sides.get(d).copied().unwrap_or(1).max(1);
        let across = if shape.len() > 1 { side(1 - time) } else { 1 };
        let sides_by_time = [side(time), across];
        let size = coding.kind.size() as u64;
        let size = sides_by_time
            .iter()
            .fold(size, |all, n| all.saturating_mul(*n));
        let filtered = !dataset.filters.is_empty();
        let chunks = match &dataset.place {
            Elements::Chunks(sides, index) => {
                let most = &dataset.space.most;
                let chunks = Chunks::new(index.clone(), sides, size, filtered, most);
                Some(RefCell::new(chunks))
            }
            _ => None,
        };
        Self {
            file: Rc::clone(file),
            coding,
            sides: sides_by_time,
            time,
            size,
            chunks,
            live: RefCell::default(),
            held: Rc::clone(held),
            dataset,
        }
    }

    /// The chunk at a place: chunks along time, and along the channels.
    fn chunk(&self, place: [u64; 2], label: &str) -> Result<Rc<Chunk>, RecordingError> {
        let mut live = self.live.borrow_mut();
        if let Some(chunk) = live.get(&place).and_then(Weak::upgrade) {
            return Ok(chunk);
        }
        let numbers = match &self.dataset.place {
            Elements::Inside(bytes) => {
                self.held.set(self.held.get() + bytes.len() as u64);
                Stock::Unpacked(bytes.clone())
            }
            Elements::Whole(None) => Stock::Missing,
            Elements::Whole(Some(at)) => self.stored(*at)?,
            Elements::Chunks(..) => {
                let by_dimension = match (self.dataset.space.shape.len(), self.time) {
                    (1, _) => &place[..1],
                    (_, 0) => &place[..],
                    _ => &[place[1], place[0]],
                };
                let chunks = self.chunks.as_ref().map(RefCell::borrow_mut);
                let found = chunks.map(|mut chunks| chunks.find(&self.file, by_dimension));
                match found.transpose()?.flatten() {
                    None => Stock::Missing,
                    Some(stored) if self.dataset.filters.is_empty() => self.stored(stored.at)?,
                    Some(stored) => Stock::Unpacked(self.unpacked(stored, label)?),
                }
            }
        };
        let chunk = Rc::new(Chunk {
            numbers,
            held: Rc::clone(&self.held),
        });
        live.retain(|_, chunk| chunk.strong_count() > 0);
        live.insert(place, Rc::downgrade(&chunk));
        Ok(chunk)
    }

    fn stored(&self, at: u64) -> Result<Stock, RecordingError> {
        let part = self.file.part(at, self.size)?;
        Ok(Stock::Stored(part.at, part.end))
    }

    fn unpacked(&self, stored: Stored, label: &str) -> Result<Vec<u8>, RecordingError> {
        let held = self.held.get().saturating_add(self.size);
        if held > limits::UNPACKED {
            let file = &self.file;
            return Err(RecordingError::Malformed {
                file: file.bytes.file.clone(),
                place: Some(Place::Byte(file.byte(self.dataset.at))),
                mismatch: Box::new(Mismatch {
                    channel: label.to_owned(),
                    found: format!("compressed chunks of {held} bytes at a time"),
                    expected: format!("{} MiB at most", limits::UNPACKED >> 20),
                    advice: "write it with smaller chunks or without compression: `h5repack -f NONE -l CONTI IN OUT`",
                }),
            });
        }
        // What cannot be compressed becomes a little longer.
        let most = self.size + self.size / 8 + 4096;
        let place = Place::Byte(self.file.byte(stored.at));
        let wrong = |found: String| {
            let expected = format!("the {} bytes of a chunk", self.size);
            self.file.bytes.malformed(place, label, found, expected)
        };
        if stored.size > most {
            return Err(wrong(format!("{} bytes, compressed", stored.size)));
        }
        let mut part = self.file.part(stored.at, stored.size)?;
        let mut bytes = Vec::with_capacity(stored.size as usize);
        let read = part.read_to_end(&mut bytes);
        read.map_err(|e| self.file.bytes.damaged(self.file.byte(stored.at), &e))?;
        let numbers = self
            .dataset
            .filters
            .undo(bytes, stored.mask, self.size as usize);
        let numbers = numbers.map_err(wrong)?;
        self.held.set(held);
        Ok(numbers)
    }
}

/// Readings of a channel.
pub(super) struct Readings {
    numbers: Rc<Numbers>,
    label: String,
    /// Number of the channel in its dataset.
    channel: u64,
    next: u64,
    chunk: Option<Rc<Chunk>>,
    /// Samples that the chunk still has; the place of the next one in it, and the distance to the
    /// one after it, bytes.
    left: u64,
    at: u64,
    step: u64,
    part: Part,
}

impl Readings {
    pub(super) fn new(numbers: &Rc<Numbers>, channel: u64, label: &str) -> Self {
        Self {
            label: label.to_owned(),
            channel,
            next: 0,
            chunk: None,
            left: 0,
            at: 0,
            step: 0,
            part: numbers.file.bytes.part(0, 0),
            numbers: Rc::clone(numbers),
        }
    }

    /// Goes on to the chunk that has the next sample.
    fn turn(&mut self) -> Result<(), RecordingError> {
        let numbers = &self.numbers;
        let [long, wide] = numbers.sides;
        let (within, across) = (self.next % long, self.channel % wide);
        // The old one goes before the new one is unpacked.
        self.chunk = None;
        let place = [self.next / long, self.channel / wide];
        self.chunk = Some(numbers.chunk(place, &self.label)?);
        let size = numbers.coding.kind.size() as u64;
        // The last dimension is the fast one.
        let [along, beside] = match (numbers.dataset.space.shape.len(), numbers.time) {
            (1, _) => [size, 0],
            (_, 0) => [size.saturating_mul(wide), size],
            _ => [size, size.saturating_mul(long)],
        };
        let before = within.saturating_mul(along);
        (self.step, self.at) = (along, before.saturating_add(across.saturating_mul(beside)));
        self.left = long - within;
        Ok(())
    }

    fn never_written(&self) -> RecordingError {
        RecordingError::Malformed {
            file: self.numbers.file.bytes.file.clone(),
            place: Some(Place::Sample(self.next + 1)),
            mismatch: Box::new(Mismatch {
                channel: self.label.clone(),
                found: "a sample that was never written".to_owned(),
                expected: "samples up to the end of the dataset".to_owned(),
                advice: "cut the recording before it, or record again",
            }),
        }
    }
}

impl Series for Readings {
    fn next(&mut self) -> Result<f64, RecordingError> {
        if self.left == 0 {
            self.turn()?;
        }
        let coding = self.numbers.coding;
        let size = coding.kind.size();
        let value = match self.chunk.as_deref().map(|chunk| &chunk.numbers) {
            Some(Stock::Unpacked(bytes)) => {
                coding.value(bytes.get(self.at as usize..).unwrap_or(&[]))
            }
            Some(&Stock::Stored(begin, end)) => {
                (self.part.at, self.part.end) = (begin.saturating_add(self.at), end);
                let mut raw = [0; 8];
                let raw = raw.get_mut(..size).unwrap_or(&mut []);
                let read = self.part.read_exact(raw);
                read.map_err(|e| {
                    self.numbers
                        .file
                        .bytes
                        .damaged(begin.saturating_add(self.at), &e)
                })?;
                coding.value(raw)
            }
            _ => return Err(self.never_written()),
        };
        if Some(value) == self.numbers.dataset.fill {
            return Err(self.never_written());
        }
        self.next += 1;
        self.left -= 1;
        self.at = self.at.saturating_add(self.step);
        Ok(value)
    }
}

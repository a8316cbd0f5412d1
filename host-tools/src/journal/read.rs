//! A journal that is read, past what is damaged in it.

use super::frame::{self, BEFORE, BEHIND, Found, Kind, LONGEST, MARK};
use crate::recording::{About, TrueRate};
use massline_firmware::wire::Health;
use std::io::{self, Read};

/// Bytes that are read at a time.
const PIECE: usize = 64 << 10;
/// Bytes that are looked at for the first frame of a journal.
const BEGINNING: u64 = (PIECE + LONGEST) as u64;

/// Part of a journal.
#[derive(Debug)]
pub(crate) enum Part<'a> {
    /// Facts about the recording.
    Head(Box<About>),
    /// The true rate as far as it was known.
    Rate(TrueRate),
    /// Rows from this number on, of so many readings each.
    Rows {
        first: u64,
        width: usize,
        content: &'a [u8],
    },
    /// Bytes that are no frame.
    Damage(Damage),
}

/// Bytes of a journal that are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Damage {
    /// Number of the first byte, from zero.
    pub(crate) at: u64,
    /// Number of bytes.
    pub(crate) bytes: u64,
    /// `true` if no frame comes behind them.
    pub(crate) is_end: bool,
}

/// `true` if some bytes begin like a journal: with a frame, which may come behind damage.
pub(crate) fn is_journal(file: impl Read) -> io::Result<bool> {
    let mut reader = Reader::new(file.take(BEGINNING));
    while let Some(part) = reader.next()? {
        if !matches!(part, Part::Damage(_)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The rows of a part, each with its faults.
pub(crate) fn rows(content: &[u8]) -> impl Iterator<Item = (Health, impl Iterator<Item = f32>)> {
    let rows = frame::rows(content).into_iter();
    rows.flat_map(|(_, rows)| rows).map(|(health, readings)| {
        let readings = readings.as_chunks().0.iter();
        (health, readings.map(|bytes| f32::from_le_bytes(*bytes)))
    })
}

/// Reads a journal from its beginning, in memory that does not grow with it.
pub(crate) struct Reader<R> {
    file: R,
    bytes: Vec<u8>,
    /// Bytes that were dealt with, and number of the first byte of `bytes` in the file.
    used: usize,
    before: u64,
    /// Bytes before `used` that are no frame and were not reported.
    damaged: u64,
    ended: bool,
}

impl<R: Read> Reader<R> {
    pub(crate) const fn new(file: R) -> Self {
        Self {
            file,
            bytes: Vec::new(),
            used: 0,
            before: 0,
            damaged: 0,
            ended: false,
        }
    }

    /// Reads on until there are so many bytes, if the file has them.
    fn fill(&mut self, wanted: usize) -> io::Result<()> {
        if self.bytes.len() - self.used >= wanted || self.ended {
            return Ok(());
        }
        self.bytes.drain(..self.used);
        self.before += self.used as u64;
        self.used = 0;
        let more = (wanted - self.bytes.len()).max(PIECE);
        let read = self.file.by_ref().take(more as u64);
        let read = { read }.read_to_end(&mut self.bytes)?;
        self.ended = read < more;
        Ok(())
    }

    fn rest(&self) -> &[u8] {
        self.bytes.get(self.used..).unwrap_or_default()
    }

    /// Passes over bytes that are no frame, to the next mark.
    fn pass(&mut self) {
        let rest = self.rest();
        let marks = rest.iter().enumerate().skip(1);
        let mut marks = marks.filter(|(_, byte)| **byte == MARK[0]);
        let next = marks.next().map_or(rest.len(), |(at, _)| at);
        self.used += next;
        self.damaged += next as u64;
    }

    fn damage(&mut self, is_end: bool) -> Damage {
        let bytes = std::mem::take(&mut self.damaged);
        Damage {
            at: self.before + self.used as u64 - bytes,
            bytes,
            is_end,
        }
    }

    /// The next part; `None` at the end.
    ///
    /// # Errors
    /// The file's.
    pub(crate) fn next(&mut self) -> io::Result<Option<Part<'_>>> {
        let mut wanted = BEFORE + BEHIND;
        loop {
            self.fill(wanted)?;
            if self.rest().is_empty() {
                let left = self.damaged > 0;
                return Ok(left.then(|| Part::Damage(self.damage(true))));
            }
            match frame::find(self.rest()) {
                Found::More(more) if !self.ended => wanted = more,
                Found::More(_) | Found::Nothing => {
                    self.pass();
                    wanted = BEFORE + BEHIND;
                }
                Found::Frame(found) => {
                    let length = BEFORE + found.content.len() + BEHIND;
                    let Some(part) = known(&found) else {
                        self.pass();
                        continue;
                    };
                    if self.damaged > 0 {
                        return Ok(Some(Part::Damage(self.damage(false))));
                    }
                    let at = self.used + BEFORE;
                    self.used += length;
                    let content = at..self.used - BEHIND;
                    return Ok(Some(match part {
                        Known::Head(about) => Part::Head(about),
                        Known::Rate(rate) => Part::Rate(rate),
                        Known::Rows(first, width) => Part::Rows {
                            first,
                            width,
                            content: self.bytes.get(content).unwrap_or_default(),
                        },
                    }));
                }
            }
        }
    }
}

/// A frame whose content is as it should be.
enum Known {
    Head(Box<About>),
    Rate(TrueRate),
    Rows(u64, usize),
}

fn known(frame: &frame::Frame<'_>) -> Option<Known> {
    match frame.kind {
        Kind::Head => About::read(frame.content).map(Box::new).map(Known::Head),
        Kind::Rate => serde_json::from_slice(frame.content).ok().map(Known::Rate),
        Kind::Rows => {
            let (width, _) = frame::rows(frame.content)?;
            Some(Known::Rows(frame.first, width))
        }
    }
}

//! A journal that grows.

use super::frame::{self, Kind};
use crate::recording::{About, TrueRate};
use massline_firmware::wire::Health;
use std::io::{self, Write};

/// Bytes of rows from which on a frame is ended.
const FULL: usize = 32 << 10;
/// Frames of rows from one copy of the head to the next.
const HEADS: u64 = 64;
/// Bytes that are handed on at a time: a buffered writer takes them as a whole or not at all.
const PIECE: usize = 4 << 10;

/// A journal that grows: rows to frames.
pub(crate) struct Journal {
    head: Vec<u8>,
    /// Content of the frame in the making, the number of its first row, and its rows.
    content: Vec<u8>,
    first: u64,
    rows: u64,
    /// Frames of rows so far.
    frames: u64,
    /// Whole frames that are to be written, and how many bytes of them were.
    pending: Vec<u8>,
    written: usize,
}

impl Journal {
    /// A journal of a recording. The head is repeated, so that a damaged place costs one copy of it.
    pub(crate) fn new(about: &About) -> Self {
        let mut head = Vec::new();
        frame::write(Kind::Head, 0, about.to_json().as_bytes(), &mut head);
        Self {
            pending: head.clone(),
            head,
            content: Vec::new(),
            first: 0,
            rows: 0,
            frames: 0,
            written: 0,
        }
    }

    /// Adds a row to the frame in the making.
    pub(crate) fn row(&mut self, si: &[f32], health: Health) {
        frame::add_row(si, health, &mut self.content);
        self.rows += 1;
    }

    /// `true` if the frame in the making is long enough to be written.
    pub(crate) fn is_full(&self) -> bool {
        self.content.len() >= FULL
    }

    /// Adds a frame of the true rate as far as it is known.
    pub(crate) fn rate(&mut self, rate: &TrueRate) {
        let text = serde_json::to_string(rate).unwrap_or_default();
        let next = self.first + self.rows;
        frame::write(Kind::Rate, next, text.as_bytes(), &mut self.pending);
    }

    /// Ends the frame in the making and writes all whole frames. After an error it goes on where it
    /// stopped.
    ///
    /// # Errors
    /// The writer's.
    pub(crate) fn write_to(&mut self, out: &mut dyn Write) -> io::Result<()> {
        if self.rows > 0 {
            if self.frames > 0 && self.frames.is_multiple_of(HEADS) {
                self.pending.extend_from_slice(&self.head);
            }
            frame::write(Kind::Rows, self.first, &self.content, &mut self.pending);
            self.frames += 1;
            self.first += self.rows;
            self.rows = 0;
            self.content.clear();
        }
        while let Some(piece) = self.pending.get(self.written..).filter(|p| !p.is_empty()) {
            let piece = piece.get(..PIECE).unwrap_or(piece);
            out.write_all(piece)?;
            self.written += piece.len();
        }
        self.pending.clear();
        self.written = 0;
        Ok(())
    }
}

//! Limit of the length of rows, and the end of the file.

use crate::limits;
use std::cell::Cell;
use std::io::{self, Read};
use std::rc::Rc;

/// State of the text that a recording's rows are read from.
#[derive(Debug, Default)]
pub(super) struct Gauge {
    /// Bytes that the present row may still take.
    left: Cell<u64>,
    /// `true` if a row was longer.
    exceeded: Cell<bool>,
    /// The byte read last.
    last: Cell<Option<u8>>,
}

impl Gauge {
    /// A row begins. The reader above looks ahead, by a few kilobytes, so that a row is that
    /// much longer at times.
    pub(super) fn begin_row(&self) {
        self.left.set(limits::ROW);
    }

    /// `true` if a row was longer than [`limits::ROW`].
    pub(super) fn exceeded(&self) -> bool {
        self.exceeded.get()
    }

    /// `true` if the text ends with the end of a line.
    pub(super) fn ends_a_line(&self) -> bool {
        matches!(self.last.get(), Some(b'\n' | b'\r'))
    }
}

/// A reader that keeps to a gauge.
pub(super) struct Gauged<R> {
    inner: R,
    gauge: Rc<Gauge>,
}

impl<R: Read> Gauged<R> {
    pub(super) fn new(inner: R, gauge: Rc<Gauge>) -> Self {
        Self { inner, gauge }
    }
}

impl<R: Read> Read for Gauged<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let gauge = &self.gauge;
        if gauge.left.get() == 0 {
            gauge.exceeded.set(true);
            return Err(io::Error::other("a row is too long"));
        }
        let count = self.inner.read(buffer)?;
        gauge
            .left
            .set(gauge.left.get().saturating_sub(count as u64));
        if let Some(&last) = buffer.get(..count).and_then(<[u8]>::last) {
            gauge.last.set(Some(last));
        }
        Ok(count)
    }
}

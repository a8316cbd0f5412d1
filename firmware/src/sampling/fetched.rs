//! Converters whose sample a lane has received already.

use crate::drivers::{Converter, Fault, Reading};

/// What a lane has received from a converter.
#[derive(Clone, Copy, Debug)]
pub(super) enum Received<'b> {
    /// Nothing: the driver reads.
    Nothing,
    /// A part, before the bus failed.
    Failed,
    /// All frames.
    Bytes(&'b [u8]),
}

/// A converter whose first read takes the bytes that were received; later ones use the bus.
pub(super) struct Fetched<'c> {
    converter: &'c mut dyn Converter,
    received: Received<'c>,
}

impl<'c> Fetched<'c> {
    pub(super) fn new(converter: &'c mut dyn Converter, received: Received<'c>) -> Self {
        Self {
            converter,
            received,
        }
    }
}

impl Converter for Fetched<'_> {
    fn channels(&self) -> usize {
        self.converter.channels()
    }

    fn choose(&mut self, rate: f64, gains: &[u8]) -> Result<(), Fault> {
        self.converter.choose(rate, gains)
    }

    fn prepare(&mut self) -> Result<(), Fault> {
        self.received = Received::Nothing;
        self.converter.prepare()
    }

    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        match core::mem::replace(&mut self.received, Received::Nothing) {
            Received::Nothing => self.converter.read(counts),
            Received::Failed => Err(Fault::Bus),
            Received::Bytes(bytes) => self.converter.decode(bytes, counts),
        }
    }
}

//! Converters whose sample a lane has received already.

use super::sequencer::Conversion;
use crate::acquisition::{Acquisition, Sample};
use crate::drivers::lanes::Lanes;
use crate::drivers::{Converter, Fault, Reading};
use core::cell::Cell;

/// Handles the edge of a conversion that was read over lanes: the sample, if any, as
/// [`Acquisition::edge`] returns it; and the bits of the converters whose buffers were emptied after
/// another edge, whose sample may be gone with that: [`Acquisition::doubt`] has to be told before it.
/// `is_waiting` is `true` if such an edge waits.
pub fn acquire<'a, const CHIPS: usize, const INPUTS: usize>(
    acquisition: &'a mut Acquisition<CHIPS, INPUTS>,
    converters: &mut [&mut dyn Converter; CHIPS],
    synchronise: &mut dyn FnMut(),
    conversion: &Conversion,
    lanes: &impl Lanes,
    is_waiting: bool,
) -> (Option<Sample<'a>>, u32) {
    let has_edge = || is_waiting || lanes.is_edge_noted();
    let emptied = Cell::new(0);
    let mut number = 0;
    let mut fetched = converters.each_mut().map(|converter| {
        let bit = 1_u32.wrapping_shl(number as u32);
        let received = if conversion.read & bit != 0 {
            Received::Bytes(lanes.received(number))
        } else if conversion.failed & bit != 0 {
            Received::Failed
        } else {
            Received::Nothing
        };
        number = usize::wrapping_add(number, 1);
        Fetched {
            converter: &mut **converter,
            received,
            bit,
            is_read: false,
            emptied: &emptied,
            has_edge: &has_edge,
        }
    });
    let mut all = fetched.each_mut().map(|f| -> &mut dyn Converter { f });
    let edge = conversion.edge;
    let sample = acquisition.edge(&mut all, synchronise, edge.ready, edge.at);
    (sample, emptied.get())
}

/// What a lane has received from a converter.
#[derive(Clone, Copy, Debug)]
enum Received<'b> {
    /// Nothing: the driver reads.
    Nothing,
    /// A part, before the bus failed.
    Failed,
    /// All frames.
    Bytes(&'b [u8]),
}

/// A converter whose first read takes the bytes that were received; later ones use the bus.
struct Fetched<'c> {
    converter: &'c mut dyn Converter,
    received: Received<'c>,
    bit: u32,
    is_read: bool,
    /// Bits of the converters that were read more than once while an edge waited.
    emptied: &'c Cell<u32>,
    /// `true` if an edge waits.
    has_edge: &'c dyn Fn() -> bool,
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
        let is_again = core::mem::replace(&mut self.is_read, true);
        match core::mem::replace(&mut self.received, Received::Nothing) {
            Received::Bytes(bytes) => self.converter.decode(bytes, counts),
            Received::Failed => Err(Fault::Bus),
            Received::Nothing => {
                let reading = self.converter.read(counts);
                if is_again && (self.has_edge)() {
                    self.emptied.set(self.emptied.get() | self.bit);
                }
                reading
            }
        }
    }
}

//! Converters whose sample a lane has received already.

use super::sequencer::Conversion;
use crate::acquisition::{Acquisition, Sample};
use crate::drivers::lanes::Lanes;
use crate::drivers::{Converter, Fault, Reading};
use core::cell::Cell;
use heapless::Vec;

/// Handles the edge of a conversion that was read over lanes: the sample, if any, as
/// [`Acquisition::edge`] returns it; and the bits of the converters whose buffers were emptied after
/// another edge, whose sample may be gone with that: [`Acquisition::doubt`] has to be told before it.
/// `is_waiting` is `true` if such an edge waits.
pub fn acquire<'a, L: Lanes, const CHIPS: usize, const INPUTS: usize>(
    acquisition: &'a mut Acquisition<CHIPS, INPUTS>,
    converters: &mut [&mut dyn Converter; CHIPS],
    synchronise: &mut dyn FnMut(),
    conversion: &Conversion,
    lanes: &L,
    is_waiting: bool,
) -> (Option<Sample<'a>>, u32) {
    let shared = Shared {
        conversion,
        lanes,
        is_waiting,
        read: Cell::new(0),
        emptied: Cell::new(0),
    };
    // Lists, and no maps of arrays: those are three times as slow where code is small.
    let mut fetched: Vec<Fetched<'_, L>, CHIPS> = Vec::new();
    for (number, converter) in (0..).zip(converters.iter_mut()) {
        // There is room for all.
        let _ = fetched.push(Fetched {
            converter: &mut **converter,
            shared: &shared,
            number,
        });
    }
    let mut all: Vec<&mut dyn Converter, CHIPS> = Vec::new();
    for converter in &mut fetched {
        let _ = all.push(converter);
    }
    let edge = conversion.edge;
    let sample = acquisition.edge(&mut all, synchronise, edge.ready, edge.at);
    (sample, shared.emptied.get())
}

/// What the converters of a conversion share.
struct Shared<'c, L> {
    conversion: &'c Conversion,
    lanes: &'c L,
    /// `true` if an edge waits.
    is_waiting: bool,
    /// Bits of the converters that were read once.
    read: Cell<u32>,
    /// Bits of those that were read again while an edge waited.
    emptied: Cell<u32>,
}

/// A converter whose first read takes the bytes that were received; later ones use the bus.
struct Fetched<'c, L> {
    converter: &'c mut dyn Converter,
    shared: &'c Shared<'c, L>,
    number: u32,
}

impl<L> Fetched<'_, L> {
    /// Notes a read in these bits: `true` if it is not the first one.
    fn note(&self, bits: &Cell<u32>) -> bool {
        let bit = 1_u32.wrapping_shl(self.number);
        bits.replace(bits.get() | bit) & bit != 0
    }
}

impl<L: Lanes> Converter for Fetched<'_, L> {
    fn channels(&self) -> usize {
        self.converter.channels()
    }

    fn choose(&mut self, rate: f64, gains: &[u8]) -> Result<(), Fault> {
        self.converter.choose(rate, gains)
    }

    fn prepare(&mut self) -> Result<(), Fault> {
        // What was received is from before.
        self.note(&self.shared.read);
        self.converter.prepare()
    }

    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        let Shared {
            conversion, lanes, ..
        } = self.shared;
        let bit = 1_u32.wrapping_shl(self.number);
        let is_again = self.note(&self.shared.read);
        if !is_again && conversion.read & bit != 0 {
            let bytes = lanes.received(self.number as usize);
            return self.converter.decode(bytes, counts);
        }
        if !is_again && conversion.failed & bit != 0 {
            return Err(Fault::Bus);
        }
        let reading = self.converter.read(counts);
        if is_again && (self.shared.is_waiting || lanes.is_edge_noted()) {
            self.note(&self.shared.emptied);
        }
        reading
    }
}

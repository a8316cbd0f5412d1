//! Samples that lanes have received already.

use super::sequencer::{Conversion, Edge};
use crate::acquisition::{Acquisition, Reads, Sample};
use crate::drivers::lanes::Lanes;
use crate::drivers::{Converter, Fault, Reading};

/// Reads of a conversion's converters: the first one of each takes the bytes that a lane has received, later ones
/// use its bus.
struct Fetched<'a, L> {
    conversion: &'a Conversion,
    lanes: &'a L,
    /// `true` if another edge waits.
    is_waiting: bool,
    /// Bit k: converter k was read.
    read: u32,
}

impl<L: Lanes> Reads for Fetched<'_, L> {
    #[inline]
    fn read(
        &mut self,
        number: usize,
        converter: &mut dyn Converter,
        counts: &mut [i32],
    ) -> Result<Reading, Fault> {
        let bit = 1_u32.wrapping_shl(number as u32);
        let is_again = self.read & bit != 0;
        self.read |= bit;
        if !is_again && self.conversion.read & bit != 0 {
            return converter.decode(self.lanes.received(number), counts);
        }
        if !is_again && self.conversion.failed & bit != 0 {
            return Err(Fault::Bus);
        }
        converter.read(counts)
    }

    fn is_late(&self) -> bool {
        self.is_waiting || self.lanes.is_edge_noted()
    }
}

/// Handles the edge of a conversion that was read over lanes, and returns the sample, if any, as
/// [`Acquisition::edge`] returns it. `is_waiting` is `true` if another edge waits.
pub fn acquire<'a, L: Lanes, const CHIPS: usize, const INPUTS: usize>(
    acquisition: &'a mut Acquisition<CHIPS, INPUTS>,
    converters: &mut [&mut dyn Converter; CHIPS],
    synchronise: &mut dyn FnMut(),
    conversion: &Conversion,
    lanes: &L,
    is_waiting: bool,
) -> Option<Sample<'a>> {
    let mut fetched = Fetched {
        conversion,
        lanes,
        is_waiting,
        read: 0,
    };
    let Edge { ready, at, .. } = conversion.edge;
    acquisition.edge_read_by(&mut fetched, converters, synchronise, ready, at)
}

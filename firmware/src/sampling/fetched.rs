//! Samples that lanes have received already.

use super::sequencer::{Conversion, Edge, Sequencer};
use crate::acquisition::{Acquisition, Sample};
use crate::drivers::lanes::Lanes;
use crate::drivers::{Converter, Fault};

/// Handles the edge of a conversion that was read over lanes: the first read of a converter takes the
/// bytes that were received, later ones use its bus. Returns the sample, if any, as
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
    let (mut read, mut emptied) = (0, 0);
    let mut fetch = |number: usize, converter: &mut dyn Converter, counts: &mut [i32]| {
        let bit = 1_u32.wrapping_shl(number as u32);
        let is_again = read & bit != 0;
        read |= bit;
        if !is_again && conversion.read & bit != 0 {
            return converter.decode(lanes.received(number), counts);
        }
        if !is_again && conversion.failed & bit != 0 {
            return Err(Fault::Bus);
        }
        let reading = converter.read(counts);
        if is_again && (is_waiting || lanes.is_edge_noted()) {
            emptied |= bit;
        }
        reading
    };
    let Edge { ready, at, .. } = conversion.edge;
    let sample = acquisition.edge_read_by(&mut fetch, converters, synchronise, ready, at);
    (sample, emptied)
}

/// Goes on with the edge that waits, if any, and doubts the converters that [`acquire`] has told of, by
/// bits, before it. `true` if its conversion is complete at once.
pub fn resume<const LANES: usize, const CHIPS: usize, const INPUTS: usize>(
    sequencer: &mut Sequencer<LANES>,
    acquisition: &mut Acquisition<CHIPS, INPUTS>,
    emptied: &mut u32,
    lanes: &mut impl Lanes,
) -> bool {
    let emptied = core::mem::take(emptied);
    if sequencer.is_waiting() {
        acquisition.doubt(emptied);
    }
    sequencer.resume(lanes)
}

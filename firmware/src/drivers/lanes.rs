//! Lanes: buses that exchange frames with their converters while the processor does other work.
//!
//! # Design
//!
//! A [`Lane`] lists the frames that one bus exchanges at a conversion, in their order. [`Lanes`] begins
//! a frame and ends it; which frame comes when is the sequencer's part (`sampling/sequencer.rs`). There
//! are three implementations.
//!
//! | implementation | where | a frame |
//! | --- | --- | --- |
//! | DMA streams | `board/lanes.rs` | runs by itself and ends in an interrupt |
//! | [`ByDrivers`] | emulators without DMA, patterns | is exchanged by the converter's driver, word by word |
//! | modelled buses | `models/lanes.rs` | ends when a test says so |

use serde::{Deserialize, Serialize};

/// A frame of a converter: a part of the bytes that read a sample, with a chip select of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Number of the converter.
    pub converter: u8,
    /// First byte in the converter's request, and in what is received from it.
    pub first: u8,
    /// Number of bytes.
    pub bytes: u8,
}

impl Step {
    /// Bit of the converter.
    #[must_use]
    #[inline]
    pub const fn bit(&self) -> u32 {
        1_u32.wrapping_shl(self.converter as u32)
    }
}

/// Clock of a lane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum BusClock {
    /// The usual clock.
    #[default]
    Usual,
    /// Half of it.
    Half,
    /// Twice as much.
    Double,
}

/// The frames of a bus at a conversion.
pub type Lane = &'static [Step];

/// Progress of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The frame is on its way.
    Running,
    /// All bytes have come, and the converter is no longer selected.
    Done,
    /// The bus has failed; the converter is no longer selected.
    Failed,
    /// The lane exchanges nothing: the converter's driver reads it.
    ByDriver,
}

/// Buses that exchange frames.
pub trait Lanes {
    /// Selects a converter and begins to exchange one of its frames, on a lane that is at rest.
    fn begin(&mut self, lane: usize, step: Step) -> Progress;

    /// Progress of the frame that was begun, after an interrupt of its lane. A frame whose bytes have
    /// all come is ended. It does not wait for bytes.
    fn progress(&mut self, lane: usize) -> Progress;

    /// Breaks the frame off that was begun. The lane is at rest then.
    fn abort(&mut self, lane: usize);

    /// `true` if an edge of the DRDY lines was noted that the sequencer has not seen.
    fn is_edge_noted(&self) -> bool;

    /// Notes edges of the DRDY lines of these converters only, by bits. Without edges nothing happens.
    fn watch_edges(&mut self, _converters: u32) {}

    /// Forgets an edge of the DRDY lines that was noted: the converters were restarted after it. Without
    /// such edges nothing happens.
    fn forget_edge(&mut self) {}

    /// Bytes that were received from a converter, at the places of their requests.
    fn received(&self, converter: usize) -> &[u8];

    /// Exchanges bytes while no converter is selected, on a lane that is at rest: each is replaced by
    /// the one that was received. `false` without such a lane, or if it does not move.
    fn exchange(&mut self, _lane: usize, _bytes: &mut [u8]) -> bool {
        false
    }

    /// Chooses the clock of the ADS131M08's lanes, which are at rest. Without clocks to choose from
    /// nothing happens.
    fn choose_clock(&mut self, _clock: BusClock) {}
}

/// Lanes that leave all frames to the converters' drivers.
#[derive(Clone, Copy, Debug, Default)]
pub struct ByDrivers;

impl Lanes for ByDrivers {
    fn begin(&mut self, _: usize, _: Step) -> Progress {
        Progress::ByDriver
    }

    fn progress(&mut self, _: usize) -> Progress {
        Progress::Done
    }

    fn abort(&mut self, _: usize) {}

    fn is_edge_noted(&self) -> bool {
        false
    }

    fn received(&self, _: usize) -> &[u8] {
        &[]
    }
}

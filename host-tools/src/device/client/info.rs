//! Identity of a box, kept beyond the frame that told it.

use crate::printable::printable;
use massline_firmware::wire::{Capacity, ClockSource, FaultCounters, Info, ResetReason, Storage};

/// Identity of a box: [`Info`] with texts of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoxInfo {
    /// The firmware's name.
    pub firmware: String,
    /// Its version.
    pub version: String,
    /// Source revision that it was built from.
    pub build: String,
    /// The chip.
    pub chip: String,
    /// The chip's serial number.
    pub serial: [u8; 12],
    /// Clock of the processor.
    pub clock: ClockSource,
    /// The core's clock, Hz.
    pub clock_hz: u32,
    /// Ticks per second of all tick counts.
    pub tick_hz: u32,
    /// Memory that keeps settings.
    pub storage: Storage,
    /// Why it started.
    pub reset: ResetReason,
    /// Resets since it was last switched on.
    pub resets: u32,
    /// Text of the last panic.
    pub panic: Option<String>,
    /// Faults since they were last forgotten.
    pub faults: FaultCounters,
    /// Capacities.
    pub capacity: Capacity,
}

impl From<&Info<'_>> for BoxInfo {
    /// Its texts show as they stand: see [`printable`].
    fn from(info: &Info<'_>) -> Self {
        let shown = |text: &str| printable(text).into_owned();
        Self {
            firmware: shown(info.firmware),
            version: shown(info.version),
            build: shown(info.build),
            chip: shown(info.chip),
            serial: info.serial,
            clock: info.clock,
            clock_hz: info.clock_hz,
            tick_hz: info.tick_hz,
            storage: info.storage,
            reset: info.reset,
            resets: info.resets,
            panic: info.panic.map(shown),
            faults: info.faults,
            capacity: info.capacity,
        }
    }
}

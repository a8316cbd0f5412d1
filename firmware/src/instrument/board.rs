//! What lies around the instrument: the hardware below it, and the way to the host.

use crate::wire::{
    ClockSource, Event, FaultCounters, Health, LinkCounters, Problem, Provoke, Reply, ResetReason,
    Setting, SettingKey, Storage,
};

/// Who the box is: what only the board knows of it, fixed from its start on. Texts are at
/// most [`crate::wire::NAME_MAX`] bytes; what is longer is cut.
#[derive(Clone, Copy, Debug)]
pub struct Identity<'m> {
    /// The firmware's name.
    pub firmware: &'m str,
    /// Its version.
    pub version: &'m str,
    /// What it was built from.
    pub build: &'m str,
    /// The chip.
    pub chip: &'m str,
    /// The chip's serial number.
    pub serial: [u8; 12],
    /// What drives the core.
    pub clock: ClockSource,
    /// The core's clock, Hz.
    pub clock_hz: u32,
    /// Ticks per second of [`Board::ticks`].
    pub tick_hz: u32,
    /// Where settings are kept.
    pub storage: Storage,
    /// Why it started.
    pub reset: ResetReason,
    /// Resets since it was last switched on.
    pub resets: u32,
    /// Text of the last panic, at most [`crate::wire::PANIC_MAX`] bytes.
    pub panic: Option<&'m str>,
    /// Channels of the box's own converters; 0 for a box without any.
    pub inputs: u8,
    /// Requests of [`crate::wire::Request::Samples`] that the link can hold unanswered.
    pub window: u8,
}

/// How the box fares, as the board sees it: what [`crate::wire::Telemetry`] says beyond
/// the instrument's own counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vitals {
    /// Deepest that the stack has ever been, bytes.
    pub stack_used: u32,
    /// Bytes there are for it.
    pub stack_size: u32,
    /// Share of the time since the last call that was not idle, in thousandths.
    pub load: u16,
    /// Frames to the host that found no room.
    pub dropped: u32,
    /// Bytes from the host that found no room.
    pub overrun: u32,
    /// What was seen of the host's frames.
    pub link: LinkCounters,
}

/// The hardware, as far as the instrument needs it. It is lent to each call.
pub trait Board {
    /// Ticks of [`Identity::tick_hz`] since the start. Never goes back.
    fn ticks(&self) -> u64;

    /// Samples of the box's own converters since the start.
    fn input_samples(&self) -> u64 {
        0
    }

    /// Faults since they were last forgotten.
    fn faults(&self) -> FaultCounters;

    /// Sets the fault counters to zero and throws the kept panic away.
    fn forget_faults(&mut self);

    /// How the box fares.
    fn vitals(&mut self) -> Vitals;

    /// Starts the box's own converters at `sample_rate` Hz; where they run already, does
    /// nothing. Their samples then come by [`super::Instrument::sample`].
    ///
    /// # Errors
    /// [`Problem`] if there are none, or none that run at this rate.
    fn start_inputs(&mut self, sample_rate: f64) -> Result<(), Problem>;

    /// Stops them.
    fn stop_inputs(&mut self);

    /// One setting.
    ///
    /// # Errors
    /// [`Problem`] if there is none of this key.
    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem>;

    /// Changes one setting, which then holds, but is not kept.
    ///
    /// # Errors
    /// [`Problem`] that names the value at fault; nothing is changed then.
    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem>;

    /// Keeps the settings, and says where.
    ///
    /// # Errors
    /// [`Problem::Storage`].
    fn save_settings(&mut self) -> Result<Storage, Problem>;

    /// Goes back to the settings the box was delivered with.
    fn reset_settings(&mut self);

    /// Whether settings were written that are not kept.
    fn unsaved(&self) -> bool;

    /// Starts afresh, once what was given to the transmit queue has left the box.
    fn reboot(&mut self);

    /// Fails on purpose, once what was given to the transmit queue has left the box, or feigns at
    /// once. `false` if the box cannot.
    fn provoke(&mut self, fault: Provoke) -> bool;
}

/// The way to the host.
pub trait Transmit {
    /// Sends the reply to the request of this id. It must not be lost for want of room:
    /// keep room for one reply per request that is on its way.
    fn reply(&mut self, request: u16, reply: &Reply<'_>);

    /// Sends an event, or gives it up if there is no room.
    fn event(&mut self, event: &Event<'_>);
}

/// One sample of the box's own converters, all inputs at the same instant.
#[derive(Clone, Copy, Debug)]
pub struct RawSample<'a> {
    /// Number of the sample since the converters' start: two neighbours that differ by
    /// more than one have lost samples between them.
    pub number: u64,
    /// Ticks of [`Board::ticks`] when it was taken.
    pub ticks: u64,
    /// Counts of all inputs.
    pub counts: &'a [i32],
    /// Faults of each input that the driver found; inputs beyond its end are good.
    pub health: &'a [Health],
}

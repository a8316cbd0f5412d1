//! Surroundings of the instrument: the hardware below it, and the link to the host.

use crate::drivers::Lowpass;
use crate::wire::{
    ClockSource, Conditions, Event, FaultCounters, Health, Item, LinkCounters, Probe, Probed,
    Problem, Provoke, Reply, ResetReason, Setting, SettingKey, Storage,
};

/// Identity of the box, fixed from its start on. Texts longer than [`crate::wire::NAME_MAX`]
/// bytes are cut.
#[derive(Clone, Copy, Debug)]
pub struct Identity<'m> {
    /// Name of the firmware.
    pub firmware: &'m str,
    /// Version of the firmware.
    pub version: &'m str,
    /// Identifier of the build, which distinguishes two builds of a version.
    pub build: &'m str,
    /// Name of the chip.
    pub chip: &'m str,
    /// Serial number of the chip.
    pub serial: [u8; 12],
    /// Clock source of the core.
    pub clock: ClockSource,
    /// Clock frequency of the core in Hz.
    pub clock_hz: u32,
    /// Ticks per second of [`Board::ticks`].
    pub tick_hz: u32,
    /// Memory in which settings are saved.
    pub storage: Storage,
    /// Reason of the last reset.
    pub reset: ResetReason,
    /// Resets since power-on.
    pub resets: u32,
    /// Text of the last panic, cut at [`crate::wire::PANIC_MAX`] bytes.
    pub panic: Option<&'m str>,
    /// Channels of the box's own converters; 0 for a box without any.
    pub inputs: u8,
    /// Largest number of unanswered [`crate::wire::Request::Samples`] that the link can hold.
    pub window: u8,
}

/// The board's part of [`crate::wire::Telemetry`]; the rest are the instrument's own counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vitals {
    /// Largest depth of the stack so far in bytes.
    pub stack_used: u32,
    /// Size of the stack in bytes.
    pub stack_size: u32,
    /// Processor load since the last call in thousandths.
    pub load: u16,
    /// Frames to the host that were dropped for want of room.
    pub dropped: u32,
    /// Bytes from the host that were lost for want of room.
    pub overrun: u32,
    /// Counts of the host's frames.
    pub link: LinkCounters,
}

/// The hardware, as far as the instrument needs it; each call borrows it.
pub trait Board {
    /// Ticks of [`Identity::tick_hz`] since the start, which never decrease.
    fn ticks(&self) -> u64;

    /// Samples of the box's own converters since the start.
    fn input_samples(&self) -> u64 {
        0
    }

    /// Faults since the counters were last reset.
    fn faults(&self) -> FaultCounters;

    /// Resets the fault counters and discards the text of the last panic.
    fn forget_faults(&mut self);

    /// The board's part of the telemetry.
    fn vitals(&mut self) -> Vitals;

    /// Starts the box's own converters at `sample_rate` Hz under these conditions, unless they run
    /// already. Their samples then come by [`super::Instrument::sample`].
    ///
    /// # Errors
    /// [`Problem`] if there are none, or none that run at this rate.
    fn start_inputs(&mut self, sample_rate: f64, conditions: Conditions) -> Result<(), Problem>;

    /// The filters of an input's converter at a sample rate, Hz; `None` if it has none, or none that is
    /// known: then its samples are taken to be in step with all others.
    fn lowpass(&self, _input: usize, _sample_rate: f64) -> Option<Lowpass> {
        None
    }

    /// Stops the converters.
    fn stop_inputs(&mut self);

    /// Reads one setting.
    ///
    /// # Errors
    /// [`Problem`] if there is no setting of this key.
    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem>;

    /// Changes one setting until the next reset; [`Self::save_settings`] makes it last.
    ///
    /// # Errors
    /// [`Problem`] that names the value at fault; nothing is changed then.
    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem>;

    /// Saves the settings; returns the memory in which they lie.
    ///
    /// # Errors
    /// [`Problem::Storage`].
    fn save_settings(&mut self) -> Result<Storage, Problem>;

    /// Restores the settings of delivery.
    fn reset_settings(&mut self);

    /// `true` if settings were written since they were last saved.
    fn unsaved(&self) -> bool;

    /// Resets the box, once the transmit queue is empty.
    fn reboot(&mut self);

    /// Provokes a fault, once the transmit queue is empty, or simulates it at once; `false` if
    /// the box cannot.
    fn provoke(&mut self, fault: Provoke) -> bool;

    /// Measures a part of the board; the inputs are not recorded meanwhile, except for
    /// [`Probe::Crystal`] and [`Probe::Skew`].
    ///
    /// # Errors
    /// [`Problem`] if the board has no such part, or cannot measure it.
    fn probe(&mut self, _: Probe) -> Result<Probed, Problem> {
        Err(Problem::Unsupported(Item::Probe))
    }
}

/// Sends replies and events to the host.
pub trait Transmit {
    /// Sends the reply to the request of this id. It must not be lost for want of room: reserve
    /// room for one reply per request that is on its way.
    fn reply(&mut self, request: u16, reply: &Reply<'_>);

    /// Sends an event, or drops it for want of room.
    fn event(&mut self, event: &Event<'_>);
}

/// One sample of the box's own converters, all inputs at the same instant.
#[derive(Clone, Copy, Debug)]
pub struct RawSample<'a> {
    /// Number of the sample since the converters' start; where two neighbours differ by more
    /// than one, samples between them are lost.
    pub number: u64,
    /// Time of the sample in ticks of [`Board::ticks`].
    pub ticks: u64,
    /// Counts of all inputs.
    pub counts: &'a [i32],
    /// Faults of each input that the driver found; inputs beyond the end of the list are good.
    pub health: &'a [Health],
}

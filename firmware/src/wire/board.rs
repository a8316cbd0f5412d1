//! The box itself: who it is, how it fares, and its self-test.

use super::{Health, LinkCounters, MethodSet, Pass, Source};
use serde::{Deserialize, Serialize};

/// Most bytes of a panic's text, UTF-8.
pub const PANIC_MAX: usize = 256;

/// Who answers. Texts are at most [`super::NAME_MAX`] bytes, unless they say otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Info<'a> {
    /// The firmware's name.
    pub firmware: &'a str,
    /// Its version.
    pub version: &'a str,
    /// What it was built from, so that a host can tell two builds of a version apart.
    pub build: &'a str,
    /// The chip.
    pub chip: &'a str,
    /// The chip's serial number.
    pub serial: [u8; 12],
    /// What drives the core.
    pub clock: ClockSource,
    /// The core's clock, Hz.
    pub clock_hz: u32,
    /// Ticks per second of all tick counts in the contract.
    pub tick_hz: u32,
    /// Where settings are kept.
    pub storage: Storage,
    /// Why it started.
    pub reset: ResetReason,
    /// Resets since it was last switched on.
    pub resets: u32,
    /// Text of the last panic, at most [`PANIC_MAX`] bytes. Told at every hello until
    /// [`super::Request::ForgetFaults`].
    pub panic: Option<&'a str>,
    /// Faults since they were last forgotten.
    pub faults: FaultCounters,
    /// What fits.
    pub capacity: Capacity,
}

/// What drives the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClockSource {
    /// The crystal, multiplied.
    CrystalPll,
    /// The internal oscillator, multiplied: no working crystal.
    InternalPll,
    /// The internal oscillator as it is.
    Internal,
}

/// Where settings are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Storage {
    /// In flash.
    Flash,
    /// In memory only: they are gone when the box is switched off.
    Volatile,
}

/// Why the box started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetReason {
    /// Switched on.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset pin.
    Pin,
    /// The watchdog: a task had not checked in.
    Watchdog,
    /// A panic.
    Panic,
    /// A fault of the processor.
    HardFault,
    /// The stack ran into its guard.
    StackOverflow,
    /// [`super::Request::Reboot`].
    Request,
    /// None of these.
    Other,
}

/// What went wrong, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultCounters {
    /// Resets by the watchdog.
    pub watchdog: u32,
    /// Resets by a sagging supply.
    pub brown_out: u32,
    /// Panics.
    pub panic: u32,
    /// Faults of the processor.
    pub hard_fault: u32,
    /// Stack overflows.
    pub stack_overflow: u32,
    /// Frames of a converter with a wrong checksum.
    pub converter_checksum: u32,
    /// Samples that a converter did not deliver in time.
    pub converter_missed: u32,
    /// Resets of a converter that nobody asked for.
    pub converter_reset: u32,
    /// Converters found out of step.
    pub out_of_step: u32,
    /// Samples that the box itself was too late for.
    pub overrun: u32,
    /// Writes or reads of settings that failed.
    pub storage: u32,
}

/// What fits into this box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capacity {
    /// Channels of a sample.
    pub channels: u8,
    /// Channels of its own converters.
    pub inputs: u8,
    /// Sensors of a set-up.
    pub sensors: u8,
    /// Stored runs.
    pub runs: u8,
    /// Lines of a run.
    pub lines: u16,
    /// Samples of a block.
    pub block_length: u32,
    /// Requests of [`super::Request::Samples`] that may be unanswered at a time.
    pub window: u8,
    /// Methods that the box can run.
    pub methods: MethodSet,
}

/// Asks for a sign of life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ping {
    /// Comes back as it is: the host's clock, for instance.
    pub stamp: u64,
}

/// A sign of life. From two of them the host knows the true sample rate by its own clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pong {
    /// That of the [`Ping`].
    pub stamp: u64,
    /// Ticks of [`Info::tick_hz`] since the start.
    pub ticks: u64,
    /// Samples of the box's own converters since the start.
    pub samples: u64,
}

/// What the box is doing, and what it holds: all that a host needs to take up the thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// What it is doing.
    pub state: State,
    /// Number of the request it is still working on, if any.
    pub busy: Option<u8>,
    /// [`super::Plan::fingerprint`] of the set-up, if there is one.
    pub fingerprint: Option<u32>,
    /// The run that is going on.
    pub running: Option<Running>,
    /// Runs whose lines are stored: bit k is run k.
    pub stored: u32,
    /// Runs that were surveyed.
    pub surveyed: u32,
    /// Whether there is an answer to read.
    pub answer: bool,
    /// Whether settings were written that are not saved.
    pub unsaved: bool,
}

/// What the box is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// It has no set-up.
    Empty,
    /// A set-up is coming in.
    SettingUp,
    /// It has a set-up.
    Ready,
    /// A run is going on.
    Running,
}

/// The run that is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Running {
    /// The run.
    pub run: u8,
    /// What it is for.
    pub pass: Pass,
    /// Where its samples come from.
    pub source: Source,
    /// Index of the sample that is expected next.
    pub next: u64,
    /// Blocks averaged.
    pub blocks: u32,
}

/// What the box sends without being asked. All of it is off at the start, except what
/// belongs to a run: blocks, channel health, the run's end, faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Subscription {
    /// Milliseconds between two [`super::Event::Telemetry`]; 0 for none.
    pub telemetry: u16,
    /// Milliseconds between two [`super::Event::Levels`]; 0 for none.
    pub levels: u16,
    /// The samples of the box's own converters, as [`super::Event::Recorded`] and
    /// [`super::Event::RecordedFaulty`].
    pub samples: Stream,
}

/// How samples are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stream {
    /// Not at all.
    #[default]
    Off,
    /// Calibrated, in SI.
    Readings,
    /// As counts.
    Counts,
}

/// How the box fares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Telemetry {
    /// Milliseconds since the start.
    pub uptime: u64,
    /// Deepest that the stack has ever been, bytes.
    pub stack_used: u32,
    /// Bytes there are for it.
    pub stack_size: u32,
    /// Share of the time since the last such event that was not idle, in thousandths.
    pub load: u16,
    /// Longest that a block took, ticks.
    pub block_ticks: u32,
    /// Frames to the host that found no room and were given up. The host knows them as
    /// lost, too.
    pub dropped: u32,
    /// Bytes from the host that found no room.
    pub overrun: u32,
    /// What the box has seen of the host's frames.
    pub link: LinkCounters,
    /// Faults since they were last forgotten.
    pub faults: FaultCounters,
}

/// The box has started. The first frame of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Started {
    /// Why.
    pub reset: ResetReason,
    /// Resets since it was last switched on.
    pub resets: u32,
}

/// Something that needs no request to be told: a fault of the box while it works.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// What.
    pub kind: FaultKind,
    /// Index of the sample at which it was noticed.
    pub sample: u64,
    /// Number of the converter, channel or task that it is about, where there is one.
    pub part: Option<u8>,
}

/// Kinds of faults that are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// The box was too late for a sample.
    Overrun,
    /// A converter does not answer.
    Converter,
    /// Settings cannot be read or written.
    Storage,
    /// The crystal failed after the start.
    Clock,
    /// The stack is close to its guard.
    Stack,
}

/// Has the box fail or feign on purpose, so that tests see what becomes of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Provoke {
    /// A panic with a text that is known.
    Panic,
    /// A stack overflow.
    StackOverflow,
    /// A task that does not check in with the watchdog.
    Hang,
    /// No failure: from now on a timer and a known pattern of counts stand in for the
    /// converters, so that sampling can be seen to go on whatever else the box is at.
    TestPattern,
}

/// Result of the self-test: the synthetic body's properties, found and true.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Selftest {
    /// Whether every check held.
    pub passed: bool,
    /// Mass, centre of gravity x, y, z, inertia about it xx, yy, zz, xy, xz, yz.
    pub checks: [Check; 10],
    /// Faults of channels that came up.
    pub health: Health,
}

/// One property in the self-test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// What the synthetic body has.
    pub truth: f64,
    /// What was identified; `None` if it was not observable.
    pub found: Option<f64>,
    /// Largest distance of the two that passes.
    pub bound: f64,
}

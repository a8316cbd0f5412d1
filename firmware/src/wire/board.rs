//! The box itself: its identity, its state, its faults and its self-test.

use super::{Conditions, Health, LinkCounters, MethodSet, Pass, Source};
use serde::{Deserialize, Serialize};

/// Largest length of a panic's text in UTF-8, bytes.
pub const PANIC_MAX: usize = 256;

/// Identity, state and capacity of the box. Texts are at most [`super::NAME_MAX`] bytes, unless
/// stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Info<'a> {
    /// Name of the firmware.
    pub firmware: &'a str,
    /// Version of the firmware.
    pub version: &'a str,
    /// Identifier of the build, which distinguishes two builds of a version.
    pub build: &'a str,
    /// Name of the chip.
    pub chip: &'a str,
    /// Serial number of the chip.
    pub serial: [u8; 12],
    /// Source of the core clock.
    pub clock: ClockSource,
    /// Core clock in Hz.
    pub clock_hz: u32,
    /// Ticks per second of all tick counts in the protocol.
    pub tick_hz: u32,
    /// Memory in which settings are stored.
    pub storage: Storage,
    /// Reason of the last start.
    pub reset: ResetReason,
    /// Number of resets since the box was switched on.
    pub resets: u32,
    /// Text of the last panic, at most [`PANIC_MAX`] bytes. Every hello returns it until
    /// [`super::Request::ForgetFaults`].
    pub panic: Option<&'a str>,
    /// Faults since the counters were last set to zero.
    pub faults: FaultCounters,
    /// Capacity of the box.
    pub capacity: Capacity,
}

/// Source of the core clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClockSource {
    /// The crystal drives the PLL.
    CrystalPll,
    /// The internal oscillator drives the PLL, since the crystal does not work.
    InternalPll,
    /// The internal oscillator is the clock, without the PLL.
    Internal,
}

/// Memory in which settings are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Storage {
    /// Flash memory.
    Flash,
    /// Volatile memory: settings are lost when the box is switched off.
    Volatile,
}

/// Reason of a start of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetReason {
    /// The box was switched on.
    PowerOn,
    /// The supply voltage was too low.
    BrownOut,
    /// The reset pin was pulled.
    Pin,
    /// The watchdog ran out, since a task had not reported to it.
    Watchdog,
    /// A panic occurred.
    Panic,
    /// A fault of the processor occurred.
    HardFault,
    /// The stack reached its guard.
    StackOverflow,
    /// [`super::Request::Reboot`] was received.
    Request,
    /// The reason is none of these.
    Other,
}

/// Counters of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultCounters {
    /// Resets by the watchdog.
    pub watchdog: u32,
    /// Resets by a low supply voltage.
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
    /// Unexpected resets of a converter.
    pub converter_reset: u32,
    /// Times that a converter was out of step with the others.
    pub out_of_step: u32,
    /// Samples that the box itself read too late.
    pub overrun: u32,
    /// Writes or reads of settings that failed.
    pub storage: u32,
}

/// Capacity of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capacity {
    /// Largest number of channels of a sample.
    pub channels: u8,
    /// Number of channels of its own converters.
    pub inputs: u8,
    /// Largest number of sensors of a set-up.
    pub sensors: u8,
    /// Largest number of stored runs.
    pub runs: u8,
    /// Largest number of lines of a run.
    pub lines: u16,
    /// Largest number of samples of a block.
    pub block_length: u32,
    /// Largest number of unanswered requests of [`super::Request::Samples`].
    pub window: u8,
    /// Methods that the box can run.
    pub methods: MethodSet,
}

/// Request for a sign of life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ping {
    /// Number that the reply returns unchanged, such as the time of the host's clock.
    pub stamp: u64,
}

/// A sign of life. Two of them give the host the true sample rate by its own clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pong {
    /// Number of the [`Ping`].
    pub stamp: u64,
    /// Time since the start, ticks of [`Info::tick_hz`].
    pub ticks: u64,
    /// Number of samples of the box's own converters since the start.
    pub samples: u64,
}

/// State of the box and of its stored data: all that a host which reconnects needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// State of the box.
    pub state: State,
    /// Number of the request that the box is still working on.
    pub busy: Option<u8>,
    /// [`super::Plan::fingerprint`] of the set-up; `None` without one.
    pub fingerprint: Option<u32>,
    /// The run that is going on.
    pub running: Option<Running>,
    /// Bit k is set if the lines of run k are stored.
    pub stored: u32,
    /// Bit k is set if run k was surveyed.
    pub surveyed: u32,
    /// `true` if there is an answer to read.
    pub answer: bool,
    /// `true` if settings were changed and not saved.
    pub unsaved: bool,
}

/// State of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// The box has no set-up.
    Empty,
    /// The box is receiving a set-up.
    SettingUp,
    /// The box has a set-up.
    Ready,
    /// A run is going on.
    Running,
}

/// The run that is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Running {
    /// Number of the run.
    pub run: u8,
    /// Purpose of the run.
    pub pass: Pass,
    /// Source of its samples.
    pub source: Source,
    /// Index of the next sample.
    pub next: u64,
    /// Number of averaged blocks.
    pub blocks: u32,
}

/// Events that the box sends besides those of a run, which are blocks, channel health, the end of
/// the run and faults. All of them are off at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Subscription {
    /// Period of [`super::Event::Telemetry`] in ms; 0 turns it off.
    pub telemetry: u16,
    /// Period of [`super::Event::Levels`] in ms; 0 turns it off.
    pub levels: u16,
    /// Form of the samples of the box's own converters, which are sent as
    /// [`super::Event::Recorded`] and [`super::Event::RecordedFaulty`].
    pub samples: Stream,
}

/// Form in which samples are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stream {
    /// No samples are sent.
    #[default]
    Off,
    /// Calibrated samples, SI.
    Readings,
    /// Raw counts.
    Counts,
    /// Raw counts under other conditions, which last until a subscription asks for another form. Not
    /// while running.
    Test(Conditions),
}

impl Stream {
    /// Conditions under which the samples are taken.
    #[must_use]
    pub fn conditions(self) -> Conditions {
        match self {
            Self::Test(conditions) => conditions,
            Self::Off | Self::Readings | Self::Counts => Conditions::default(),
        }
    }
}

/// Load, memory and counters of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Telemetry {
    /// Time since the start, ms.
    pub uptime: u64,
    /// Largest depth of the stack so far, bytes.
    pub stack_used: u32,
    /// Size of the stack, bytes.
    pub stack_size: u32,
    /// Share of the time since the last such event in which the core was busy, thousandths.
    pub load: u16,
    /// Longest computing time of a block, ticks.
    pub block_ticks: u32,
    /// Frames to the host that were dropped for want of room. The host counts them as lost.
    pub dropped: u32,
    /// Bytes from the host that were dropped for want of room.
    pub overrun: u32,
    /// Counters of the box's receiver.
    pub link: LinkCounters,
    /// Faults since the counters were last set to zero.
    pub faults: FaultCounters,
}

/// Start of the box, the first frame of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Started {
    /// Reason of the start.
    pub reset: ResetReason,
    /// Number of resets since the box was switched on.
    pub resets: u32,
}

/// A fault of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Index of the sample at which the fault was noticed.
    pub sample: u64,
    /// Number of the converter, channel or task at fault; `None` for others.
    pub part: Option<u8>,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// The box read a sample too late.
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

/// Deliberate fault, or test pattern, for tests of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Provoke {
    /// The box panics with a known text.
    Panic,
    /// The stack overflows.
    StackOverflow,
    /// A task stops reporting to the watchdog.
    Hang,
    /// A timer and a known pattern of counts replace the converters from now on, so that a test can
    /// check that sampling goes on whatever else the box does. This is not a fault.
    TestPattern,
}

/// Result of the self-test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Selftest {
    /// `true` if every check held.
    pub passed: bool,
    /// Checks of the mass, the centre of gravity x, y, z, and the inertia about it xx, yy, zz, xy,
    /// xz, yz.
    pub checks: [Check; 10],
    /// Faults of the channels during the test.
    pub health: Health,
}

/// One property of the synthetic body in the self-test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// True value, SI.
    pub truth: f64,
    /// Identified value, SI; `None` if it was not observable.
    pub found: Option<f64>,
    /// Largest distance of the two values that passes, SI.
    pub bound: f64,
}

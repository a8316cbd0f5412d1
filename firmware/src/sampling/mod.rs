//! The sampling task: commands in and samples out through queues, without waiting.
//!
//! # Design
//!
//! Sampling interrupts all tasks but the link's port and those that take microseconds (the task
//! watchdog, the time of an edge), and takes no lock. Its [`Command`]s come through a queue. The
//! task runs as soon as its interrupt is raised, so that the sender of a command has the outcome
//! when the call returns.
//!
//! Samples leave as [`RawFrame`]s through a queue that holds those that come while a block is
//! computed. A sample without room is dropped and counted as an overrun; the number of the next one
//! shows how many are missing.
//!
//! The converters of a box are listed in `bank`.
//!
//! The first samples after a start, while filters settle, are dropped.
//!
//! A converter that does not answer is left out if no input of it is in use, and an error
//! otherwise. The ADXL355 has no edge of its own here: it samples at the others' edges, and its
//! status is read then.

mod bank;
mod converters;
mod plan;
mod raw_frame;

pub use bank::{CHIPS, CLOCK_HZ, CONVERTERS, FASTEST_HZ, INPUTS};
pub use converters::Converters;
pub use plan::{Plan, problem};
pub use raw_frame::RawFrame;

use crate::acquisition::{Acquisition, SETTLING};
use crate::drivers::Fault;
use crate::wire::FaultCounters;
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;
use heapless::spsc::{Consumer, Producer, Queue};

/// Most samples in the queue: a block takes 3.8 ms, in which 16 samples come at 4096 samples/s.
pub const WAITING: usize = 32;
/// Checks for silent converters per second.
const WATCHES: u64 = 10;

/// Commands to the sampling task.
#[derive(Clone, Debug)]
pub enum Command {
    /// Prepare the converters and start sampling; the outcome is sent back.
    Start(Plan),
    /// Stop sampling.
    Stop,
    /// Set the fault counters to zero.
    ClearFaults,
    /// From the next start on, a test pattern stands in for the converters.
    TestPattern,
}

/// A failed start: number of the converter, and its fault.
pub type Failure = (u8, Fault);

/// The queues between the sampling task and the others.
pub struct Queues {
    commands: Queue<Command, 3>,
    outcomes: Queue<Result<(), Failure>, 3>,
    frames: Queue<RawFrame, WAITING>,
}

impl Queues {
    /// Empty queues.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            commands: Queue::new(),
            outcomes: Queue::new(),
            frames: Queue::new(),
        }
    }

    /// The ends of the sampling task, of the sender of commands and of the receiver of samples.
    pub fn split(&mut self) -> (Ends<'_>, Commands<'_>, Consumer<'_, RawFrame>) {
        let (sent, commands) = self.commands.split();
        let (done, outcomes) = self.outcomes.split();
        let (produced, frames) = self.frames.split();
        let ends = Ends {
            commands,
            outcomes: done,
            frames: produced,
        };
        let commands = Commands {
            queue: sent,
            outcomes,
        };
        (ends, commands, frames)
    }
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

/// The sampling task's ends of the queues.
pub struct Ends<'q> {
    commands: Consumer<'q, Command>,
    outcomes: Producer<'q, Result<(), Failure>>,
    frames: Producer<'q, RawFrame>,
}

/// The sender's ends of the queues of commands and outcomes.
pub struct Commands<'q> {
    queue: Producer<'q, Command>,
    outcomes: Consumer<'q, Result<(), Failure>>,
}

impl Commands<'_> {
    /// Sends a command; `call` makes the sampling task run at once. `false` if the queue is full.
    pub fn send(&mut self, command: Command, call: impl FnOnce()) -> bool {
        let is_sent = self.queue.enqueue(command).is_ok();
        call();
        is_sent
    }

    /// Starts sampling and returns the outcome; `None` if the sampling task was not called.
    pub fn start(&mut self, plan: Plan, call: impl FnOnce()) -> Option<Result<(), Failure>> {
        while self.outcomes.dequeue().is_some() {}
        self.send(Command::Start(plan), call);
        self.outcomes.dequeue()
    }
}

/// Counters of the sampling task, which other tasks read.
#[derive(Debug, Default)]
pub struct Counters {
    checksum: AtomicU32,
    missed: AtomicU32,
    reset: AtomicU32,
    out_of_step: AtomicU32,
    overrun: AtomicU32,
    /// Bit k: converter k has failed since the last [`Self::take_failed`].
    failed: AtomicU32,
}

impl Counters {
    /// Counters at zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            checksum: AtomicU32::new(0),
            missed: AtomicU32::new(0),
            reset: AtomicU32::new(0),
            out_of_step: AtomicU32::new(0),
            overrun: AtomicU32::new(0),
            failed: AtomicU32::new(0),
        }
    }

    /// Writes the counts of sampling into `faults`.
    pub fn read(&self, faults: &mut FaultCounters) {
        let count = |from: &AtomicU32| from.load(Ordering::Relaxed);
        faults.converter_checksum = count(&self.checksum);
        faults.converter_missed = count(&self.missed);
        faults.converter_reset = count(&self.reset);
        faults.out_of_step = count(&self.out_of_step);
        faults.overrun = count(&self.overrun);
    }

    /// A converter that has failed since the last call, if any.
    pub fn take_failed(&self) -> Option<u8> {
        let failed = self.failed.load(Ordering::Relaxed);
        let lowest = failed & failed.wrapping_neg();
        self.failed.fetch_and(!lowest, Ordering::Relaxed);
        (lowest != 0).then_some(lowest.trailing_zeros() as u8)
    }

    fn write(&self, faults: &FaultCounters, dropped: u32) {
        let count = |to: &AtomicU32, n| to.store(n, Ordering::Relaxed);
        count(&self.checksum, faults.converter_checksum);
        count(&self.missed, faults.converter_missed);
        count(&self.reset, faults.converter_reset);
        count(&self.out_of_step, faults.out_of_step);
        count(&self.overrun, faults.overrun.saturating_add(dropped));
    }
}

/// The sampling task.
pub struct Sampler<'q, A, D, P, T> {
    converters: Converters<A, D, P, T>,
    acquisition: Acquisition<CHIPS, INPUTS>,
    ends: Ends<'q>,
    counters: &'q Counters,
    running: bool,
    /// Samples dropped because the queue was full.
    dropped: u32,
    /// Ticks between two checks for silent converters, and time of the last one.
    watch: [u64; 2],
    /// Nominal ticks from sample to sample.
    period: u64,
}

impl<'q, A, D, P, T> Sampler<'q, A, D, P, T>
where
    A: SpiDevice,
    D: SpiDevice,
    P: OutputPin,
    T: DelayNs,
{
    /// A sampling task that waits for commands; `tick_hz` is the rate of all ticks.
    pub fn new(
        converters: Converters<A, D, P, T>,
        ends: Ends<'q>,
        counters: &'q Counters,
        tick_hz: u32,
    ) -> Self {
        Self {
            converters,
            acquisition: Acquisition::new(tick_hz as f32 / CLOCK_HZ as f32),
            ends,
            counters,
            running: false,
            dropped: 0,
            watch: [u64::from(tick_hz) / WATCHES, 0],
            period: 0,
        }
    }

    /// Executes commands, and checks for silent converters. To be called at every interrupt, and a
    /// hundred times a second.
    pub fn poll(&mut self, ticks: u64) {
        while let Some(command) = self.ends.commands.dequeue() {
            match command {
                Command::Start(plan) => {
                    let outcome = self.start(&plan);
                    self.running = outcome.is_ok();
                    self.watch[1] = ticks;
                    // There is room: the sender empties the queue before each start.
                    let _ = self.ends.outcomes.enqueue(outcome);
                }
                Command::Stop => self.running = false,
                Command::ClearFaults => {
                    self.acquisition.clear_faults();
                    self.dropped = 0;
                    self.counters.write(self.acquisition.faults(), 0);
                }
                Command::TestPattern => {
                    self.running = false;
                    self.converters.use_test_pattern();
                }
            }
        }
        let [every, last] = self.watch;
        let is_due = ticks.saturating_sub(last) >= every;
        if self.running && is_due && !self.converters.is_test_pattern() {
            self.watch[1] = ticks;
            let acquisition = &mut self.acquisition;
            self.converters
                .with(|all, synchronise| acquisition.watch(all, synchronise, ticks));
            self.report();
        }
    }

    /// Handles an edge of the DRDY lines at a time in ticks; bit k of `ready` is set if the line of
    /// ADS131M08 number k is low. `true` if there is a new sample.
    pub fn edge(&mut self, ready: u32, ticks: u64) -> bool {
        if !self.running {
            return false;
        }
        let Some(ready) = self.converters.with_followers(ready) else {
            return false;
        };
        let acquisition = &mut self.acquisition;
        let sample = self
            .converters
            .with(|all, synchronise| acquisition.edge(all, synchronise, ready, ticks));
        // The filters settle during the first samples after a start.
        let sample = sample.filter(|sample| sample.number > SETTLING.into());
        let is_new = sample.is_some();
        if let Some(frame) = sample.and_then(|sample| RawFrame::new(&sample, ticks))
            && self.ends.frames.enqueue(frame).is_err()
        {
            self.dropped = self.dropped.saturating_add(1);
        }
        self.report();
        is_new
    }

    /// Handles so many periods of the test pattern's clock. `true` if there is a new sample.
    ///
    /// Time is counted in periods: the emulator's timer is late at times, unlike a converter.
    pub fn test_pattern(&mut self, samples: u32) -> bool {
        let converted = self.converters.convert(samples);
        // Exact for periods below 2^32 ticks.
        let ticks = u64::from(converted).wrapping_mul(self.period);
        samples > 0 && self.edge(u32::MAX, ticks)
    }

    fn start(&mut self, plan: &Plan) -> Result<(), Failure> {
        let faults = *self.acquisition.faults();
        self.acquisition = Acquisition::new(plan.period).counting_from(faults);
        self.period = plan.period as u64;
        let left_out = self.converters.configure(plan)?;
        for chip in 0..CHIPS {
            if left_out >> chip & 1 != 0 {
                self.acquisition.leave_out(chip);
            }
        }
        let acquisition = &mut self.acquisition;
        self.converters
            .with(|all, synchronise| acquisition.start(all, synchronise))
    }

    fn report(&mut self) {
        self.counters.write(self.acquisition.faults(), self.dropped);
        if let Some(fault) = self.acquisition.take_fault()
            && let Some(part) = fault.part
        {
            let bit = 1_u32.wrapping_shl(part.into());
            self.counters.failed.fetch_or(bit, Ordering::Relaxed);
        }
    }
}

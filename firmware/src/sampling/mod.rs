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
//! Converters are read over lanes, which exchange frames while the processor does other work
//! (`sequencer`); what a frame says is decoded once those of all converters have come. Whatever is not
//! the common case, as the emptying of a converter's buffer or its preparation, is left to its driver,
//! word by word.
//!
//! The converters of a box are listed in `bank`, with their lanes.
//!
//! The first samples after a start, while filters settle, are dropped.
//!
//! Converters without an input in use are left out, which leaves time for faster rates: they are neither
//! read nor are their edges seen. If no input is in use at all, those that answer are read. The ADXL355 has
//! no edge of its own here: it samples at the others' edges, and its status is read then.

mod bank;
mod converters;
mod fetched;
mod plan;
mod queues;
mod raw_frame;
pub mod sequencer;

pub use bank::{CHIPS, CLOCK_HZ, CONVERTERS, INPUTS, LANES, ORDER, REQUESTS, fastest, lowpass};
pub use converters::Converters;
pub use fetched::acquire;
pub use plan::{Plan, problem, reported};
pub use queues::{Commands, Ends, Queues, WAITING};
pub use raw_frame::RawFrame;

use crate::acquisition::{Acquisition, SETTLING};
use crate::drivers::Fault;
use crate::drivers::lanes::Lanes;
use crate::wire::{FaultCounters, Looped};
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;
use heapless::spsc::{Consumer, Producer};
use sequencer::{Edge, Event, Sequencer};

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
    /// Exchange bytes over a bus, by the number of its lane, with no converter selected; the outcome is
    /// sent back. Sampling stops.
    Loop(u8),
    /// Prepare a converter, by its number; the outcome is sent back. Sampling stops.
    Prepare(u8),
}

/// Outcome of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Of [`Command::Start`].
    Started(Result<(), Failure>),
    /// Of [`Command::Loop`]: the comparison of the bytes, `None` without such a bus.
    Looped(Option<Looped>),
    /// Of [`Command::Prepare`].
    Prepared(Result<(), Fault>),
}

/// A failed start: number of the converter, and its fault.
pub type Failure = (u8, Fault);

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
pub struct Sampler<'q, A, D, P, T, L> {
    converters: Converters<A, D, P, T>,
    lanes: L,
    sequencer: Sequencer<LANES>,
    acquisition: Acquisition<CHIPS, INPUTS>,
    commands: Consumer<'q, Command>,
    outcomes: Producer<'q, Outcome>,
    out: Out<'q>,
    counters: &'q Counters,
    running: bool,
    /// Ticks between two checks for silent converters, and time of the last one.
    watch: [u64; 2],
    /// Nominal ticks from sample to sample.
    period: u64,
}

impl<'q, A, D, P, T, L> Sampler<'q, A, D, P, T, L>
where
    A: SpiDevice,
    D: SpiDevice,
    P: OutputPin,
    T: DelayNs,
    L: Lanes,
{
    /// A sampling task that waits for commands; `tick_hz` is the rate of all ticks.
    pub fn new(
        converters: Converters<A, D, P, T>,
        lanes: L,
        ends: Ends<'q>,
        counters: &'q Counters,
        tick_hz: u32,
    ) -> Self {
        Self {
            converters,
            lanes,
            sequencer: Sequencer::new(ORDER),
            acquisition: Acquisition::new(tick_hz as f32 / CLOCK_HZ as f32),
            commands: ends.commands,
            outcomes: ends.outcomes,
            out: Out {
                frames: ends.frames,
                is_starting: false,
                dropped: 0,
                is_dropping: false,
            },
            counters,
            running: false,
            watch: [u64::from(tick_hz) / WATCHES, 0],
            period: 0,
        }
    }

    /// Executes commands, and checks for silent converters. To be called at every interrupt, and a
    /// hundred times a second.
    pub fn poll(&mut self, ticks: u64) {
        while let Some(command) = self.commands.dequeue() {
            match command {
                Command::Start(plan) => {
                    self.break_off();
                    let outcome = self.start(&plan);
                    self.running = outcome.is_ok();
                    self.watch[1] = ticks;
                    // There is room: the sender empties the queue before each command with an outcome.
                    let _ = self.outcomes.enqueue(Outcome::Started(outcome));
                }
                Command::Stop => self.stop(),
                Command::Loop(lane) => {
                    self.stop();
                    let looped = looped(&mut self.lanes, lane);
                    let _ = self.outcomes.enqueue(Outcome::Looped(looped));
                }
                Command::Prepare(converter) => {
                    self.stop();
                    let prepared = self.converters.prepare(converter);
                    let _ = self.outcomes.enqueue(Outcome::Prepared(prepared));
                }
                Command::ClearFaults => {
                    self.acquisition.clear_faults();
                    self.out.dropped = 0;
                    self.counters.write(self.acquisition.faults(), 0);
                }
                Command::TestPattern => {
                    self.stop();
                    self.converters.use_test_pattern();
                }
            }
        }
        let [every, last] = self.watch;
        let is_due = ticks.saturating_sub(last) >= every;
        if self.running && is_due && !self.converters.is_test_pattern() {
            self.watch[1] = ticks;
            if self.acquisition.is_silent(ticks) {
                // A frame that has not ended in all that time never will.
                self.break_off();
            }
            let acquisition = &mut self.acquisition;
            self.converters
                .with(|all, synchronise| acquisition.watch(all, synchronise, ticks));
            self.forget_edges_before_restart();
            self.report();
        }
    }

    /// Handles an edge of the DRDY lines; bit k of its `ready` is set if the line of ADS131M08 number k
    /// is low. `true` if there is a new sample. To be followed by [`Self::resume`].
    pub fn edge(&mut self, edge: Edge) -> bool {
        if !self.running {
            return false;
        }
        let Some(ready) = self.converters.with_followers(edge.ready) else {
            return false;
        };
        let event = Event::Edge(Edge { ready, ..edge });
        self.sequencer.handle(event, &mut self.lanes) && self.hand_over()
    }

    /// Handles an interrupt of a lane. `true` if there is a new sample. To be followed by
    /// [`Self::resume`].
    pub fn lane(&mut self, lane: usize) -> bool {
        let lane = Event::Lane(lane);
        self.sequencer.handle(lane, &mut self.lanes) && self.hand_over()
    }

    /// Begins with the edge that came while another one was being read, if any; to be called after the
    /// edges that came meanwhile were handled, the newest of which counts. `true` if there is a new
    /// sample.
    pub fn resume(&mut self) -> bool {
        self.sequencer.resume(&mut self.lanes) && self.hand_over()
    }

    /// `true` while frames run: [`Self::resume`] has nothing to do.
    #[inline]
    pub fn is_reading(&self) -> bool {
        self.sequencer.is_reading()
    }

    /// Samples in the queue.
    pub fn waiting(&self) -> usize {
        self.out.frames.len()
    }

    /// The lanes.
    pub const fn lanes(&mut self) -> &mut L {
        &mut self.lanes
    }

    fn stop(&mut self) {
        self.break_off();
        self.running = false;
    }

    fn break_off(&mut self) {
        self.sequencer.handle(Event::Stop, &mut self.lanes);
    }

    /// Decodes the conversion that is complete, and passes the sample on. `true` if there is one.
    fn hand_over(&mut self) -> bool {
        let conversion = self.sequencer.conversion();
        let is_waiting = self.sequencer.is_waiting();
        let (acquisition, lanes) = (&mut self.acquisition, &self.lanes);
        let sample = self.converters.with(|all, synchronise| {
            acquire(acquisition, all, synchronise, conversion, lanes, is_waiting)
                .map(|sample| sample.is_settling)
        });
        let is_new = self.out.pass_on(sample, self.acquisition.frame());
        self.forget_edges_before_restart();
        self.report();
        is_new
    }

    /// Forgets edges from before a restart of the converters, if there was one: what was converted then is
    /// no sample, and must not set the grid.
    fn forget_edges_before_restart(&mut self) {
        if self.converters.take_restarted() {
            self.lanes.forget_edge();
            self.sequencer.forget_edge();
        }
    }

    /// Handles so many periods of the test pattern's clock. `true` if there is a new sample.
    ///
    /// Time is counted in periods: the emulator's timer is late at times, unlike a converter.
    pub fn test_pattern(&mut self, samples: u32) -> bool {
        let converted = self.converters.convert(samples);
        // Exact for periods below 2^32 ticks.
        let ticks = u64::from(converted).wrapping_mul(self.period);
        if samples == 0 || !self.running {
            return false;
        }
        let acquisition = &mut self.acquisition;
        let sample = self.converters.with(|all, synchronise| {
            let sample = acquisition.edge(all, synchronise, u32::MAX, ticks);
            sample.map(|sample| sample.is_settling)
        });
        let is_new = self.out.pass_on(sample, self.acquisition.frame());
        self.report();
        is_new
    }

    fn start(&mut self, plan: &Plan) -> Result<(), Failure> {
        let faults = *self.acquisition.faults();
        self.acquisition = Acquisition::new(plan.period).counting_from(faults);
        self.period = plan.period as u64;
        self.lanes.choose_clock(plan.conditions.bus);
        let left_out = self.converters.configure(plan)?;
        self.lanes.watch_edges(!left_out);
        for chip in 0..CHIPS {
            if left_out >> chip & 1 != 0 {
                self.acquisition.leave_out(chip);
            }
        }
        let acquisition = &mut self.acquisition;
        let started = self
            .converters
            .with(|all, synchronise| acquisition.start(all, synchronise));
        self.forget_edges_before_restart();
        self.out.is_starting = true;
        started
    }

    fn report(&mut self) {
        self.counters
            .write(self.acquisition.faults(), self.out.dropped);
        if let Some(fault) = self.acquisition.take_fault()
            && let Some(part) = fault.part
        {
            let bit = 1_u32.wrapping_shl(part.into());
            self.counters.failed.fetch_or(bit, Ordering::Relaxed);
        }
    }
}

/// Bytes that are sent over a bus to test it: no byte is the next one's, nor all ones or zeros, and
/// each bit has as many ones as zeros.
const PATTERN: [u8; 32] = {
    let mut pattern = [0; 32];
    let mut k = 0;
    while k < 16 {
        let byte = (0x1D_u8).wrapping_mul(2 * k as u8 + 1);
        pattern[2 * k] = byte;
        pattern[2 * k + 1] = !byte;
        k += 1;
    }
    pattern
};

/// Exchanges the pattern over a lane.
fn looped(lanes: &mut impl Lanes, lane: u8) -> Option<Looped> {
    let mut bytes = PATTERN;
    if !lanes.exchange(lane.into(), &mut bytes) {
        return None;
    }
    let mut found = Looped::default();
    for (sent, received) in PATTERN.iter().zip(bytes) {
        // Some hundred bits at the most.
        found.bits = found.bits.wrapping_add(8);
        found.wrong = found
            .wrong
            .wrapping_add((sent ^ received).count_ones() as u16);
        found.ones = found.ones.wrapping_add(received.count_ones() as u16);
    }
    Some(found)
}

/// The way of samples to the other tasks.
struct Out<'q> {
    frames: Producer<'q, RawFrame>,
    /// `true` from a start until its filters have settled.
    is_starting: bool,
    /// Samples dropped because the queue was full.
    dropped: u32,
    /// `true` from such a sample on until half of the queue is free: a gap costs whoever takes the samples far
    /// more than a sample, and one at every other sample would never end.
    is_dropping: bool,
}

impl Out<'_> {
    /// Puts the frame of a sample, if there is one, into the queue, or counts it as dropped: `true`. The sample
    /// says if filters settle.
    fn pass_on(&mut self, sample: Option<bool>, frame: &RawFrame) -> bool {
        let Some(is_settling) = sample else {
            return false;
        };
        // The filters settle during the first samples after a start.
        self.is_starting &= is_settling || frame.number <= SETTLING.into();
        if self.is_starting {
            return false;
        }
        let is_half_full = self.frames.len() >= WAITING / 2;
        let is_full = self.is_dropping && is_half_full || self.frames.enqueue(*frame).is_err();
        self.is_dropping = is_full;
        if is_full {
            self.dropped = self.dropped.saturating_add(1);
        }
        true
    }
}

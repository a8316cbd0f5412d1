//! The sampling task's work: orders in, samples out, by queues that nobody waits for.
//!
//! # Design
//!
//! Sampling interrupts all but the link's port and what takes microseconds (the roll call, the note
//! of an edge), and takes no lock. What it is to do comes by a queue of [`Order`]s; it looks at them
//! as soon as its interrupt is called, which is at once, so that whoever gives an order finds the
//! outcome when the call returns.
//!
//! Samples leave by a queue of [`Shot`]s that holds what comes while a block is computed. One
//! that finds no room is given up, and counted as an overrun: the next one's number tells how
//! many are missing.
//!
//! | inputs | converter |
//! | --- | --- |
//! | 0 to 31 | four ADS131M08, eight each |
//! | 32 to 34 | ADXL355: x, y, z |
//!
//! The first samples of a start, while filters settle, are not handed over.
//!
//! A converter that does not answer is left out if no input of it is in use, and an error
//! otherwise. The ADXL355 has no edge of its own here: it samples at the others' edges, and is
//! asked then whether it has.

mod converters;
mod plan;
mod shot;

pub use converters::Converters;
pub use plan::{Plan, problem};
pub use shot::Shot;

use crate::acquisition::{Acquisition, SETTLING};
use crate::drivers::Fault;
use crate::drivers::ads131m08::{CLOCK_HZ, registers};
use crate::wire::FaultCounters;
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;
use heapless::spsc::{Consumer, Producer, Queue};

/// ADS131M08 of a box.
pub const CONVERTERS: usize = 4;
/// Converters of a box, the accelerometer with them.
pub const CHIPS: usize = CONVERTERS + 1;
/// Inputs with a gain: those of the ADS131M08.
pub const GAINS: usize = CONVERTERS * registers::CHANNELS;
/// Inputs of a box.
pub const INPUTS: usize = GAINS + crate::drivers::adxl355::CHANNELS;

/// Samples that wait at most: a block takes 3.8 ms, in which 16 samples come at 4096 samples/s.
pub const WAITING: usize = 32;
/// Looks for converters that have fallen silent, in a second.
const WATCHES: u64 = 10;

/// What the sampling task is told to do.
#[derive(Clone, Debug)]
pub enum Order {
    /// Prepare the converters and begin; there is an outcome.
    Start(Plan),
    /// Stop.
    Stop,
    /// Count faults anew.
    Forget,
    /// From the next start on, a pattern stands in for the converters.
    Rehearse,
}

/// A start that has failed: number of the converter, and what it did.
pub type Failure = (u8, Fault);

/// The queues between the sampling task and the others.
pub struct Queues {
    orders: Queue<Order, 3>,
    outcomes: Queue<Result<(), Failure>, 3>,
    shots: Queue<Shot, WAITING>,
}

impl Queues {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            orders: Queue::new(),
            outcomes: Queue::new(),
            shots: Queue::new(),
        }
    }

    /// The ends: the sampling task's, and those of whoever gives orders and takes samples.
    pub fn split(&mut self) -> (Ends<'_>, Desk<'_>, Consumer<'_, Shot>) {
        let (orders, to_do) = self.orders.split();
        let (done, outcomes) = self.outcomes.split();
        let (taken, shots) = self.shots.split();
        let ends = Ends { to_do, done, taken };
        (ends, Desk { orders, outcomes }, shots)
    }
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

/// The sampling task's ends of the queues.
pub struct Ends<'q> {
    to_do: Consumer<'q, Order>,
    done: Producer<'q, Result<(), Failure>>,
    taken: Producer<'q, Shot>,
}

/// Where orders are given.
pub struct Desk<'q> {
    orders: Producer<'q, Order>,
    outcomes: Consumer<'q, Result<(), Failure>>,
}

impl Desk<'_> {
    /// Gives an order; `call` has the sampling task look at it at once. `false` if it has not
    /// looked at the ones before.
    pub fn give(&mut self, order: Order, call: impl FnOnce()) -> bool {
        let given = self.orders.enqueue(order).is_ok();
        call();
        given
    }

    /// Starts, and says how that went; `None` if the sampling task is not called.
    pub fn start(&mut self, plan: Plan, call: impl FnOnce()) -> Option<Result<(), Failure>> {
        while self.outcomes.dequeue().is_some() {}
        self.give(Order::Start(plan), call);
        self.outcomes.dequeue()
    }
}

/// What the sampling task counts, for all to read.
#[derive(Debug, Default)]
pub struct Tally {
    checksum: AtomicU32,
    missed: AtomicU32,
    reset: AtomicU32,
    out_of_step: AtomicU32,
    overrun: AtomicU32,
    /// Bit k: converter k has failed since somebody asked.
    failed: AtomicU32,
}

impl Tally {
    /// Nothing yet.
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

    /// A converter that has failed since it was asked for last, if any.
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
    tally: &'q Tally,
    running: bool,
    /// Samples that found no room.
    dropped: u32,
    /// Ticks between two looks, and at the last one.
    watch: [u64; 2],
    /// Ticks from sample to sample, nominally.
    period: u64,
}

impl<'q, A, D, P, T> Sampler<'q, A, D, P, T>
where
    A: SpiDevice,
    D: SpiDevice,
    P: OutputPin,
    T: DelayNs,
{
    /// One that waits for orders; `tick_hz` is the rate of all ticks.
    pub fn new(
        converters: Converters<A, D, P, T>,
        ends: Ends<'q>,
        tally: &'q Tally,
        tick_hz: u32,
    ) -> Self {
        Self {
            converters,
            acquisition: Acquisition::new(tick_hz as f32 / CLOCK_HZ as f32),
            ends,
            tally,
            running: false,
            dropped: 0,
            watch: [u64::from(tick_hz) / WATCHES, 0],
            period: 0,
        }
    }

    /// Does as it was told, and looks now and then whether the converters are silent. To be
    /// called at every interrupt, and some hundred times a second.
    pub fn attend(&mut self, ticks: u64) {
        while let Some(order) = self.ends.to_do.dequeue() {
            match order {
                Order::Start(plan) => {
                    let outcome = self.start(&plan);
                    self.running = outcome.is_ok();
                    self.watch[1] = ticks;
                    // Who asks takes the last outcome first.
                    let _ = self.ends.done.enqueue(outcome);
                }
                Order::Stop => self.running = false,
                Order::Forget => {
                    self.acquisition.forget_faults();
                    self.dropped = 0;
                    self.tally.write(self.acquisition.faults(), 0);
                }
                Order::Rehearse => {
                    self.running = false;
                    self.converters.rehearse();
                }
            }
        }
        let [every, last] = self.watch;
        let is_due = ticks.saturating_sub(last) >= every;
        if self.running && is_due && !self.converters.is_rehearsal() {
            self.watch[1] = ticks;
            let acquisition = &mut self.acquisition;
            self.converters
                .with(|all, synchronise| acquisition.watch(all, synchronise, ticks));
            self.report();
        }
    }

    /// Takes an edge of the DRDY lines: bits of `ready` are the ADS131M08 whose lines are low.
    /// Whether there is a new sample to be taken.
    pub fn edge(&mut self, ready: u32, ticks: u64) -> bool {
        if !self.running {
            return false;
        }
        let Some(ready) = self.converters.with_followers(ready) else {
            return false;
        };
        let acquisition = &mut self.acquisition;
        let taken = self
            .converters
            .with(|all, synchronise| acquisition.edge(all, synchronise, ready, ticks));
        // The first ones after a start are of filters that settle: they are nobody's.
        let taken = taken.filter(|sample| sample.number > SETTLING.into());
        let is_new = taken.is_some();
        if let Some(shot) = taken.and_then(|sample| Shot::new(&sample, ticks))
            && self.ends.taken.enqueue(shot).is_err()
        {
            self.dropped = self.dropped.saturating_add(1);
        }
        self.report();
        is_new
    }

    /// That many periods of a rehearsal have gone by; whether there is a new sample.
    ///
    /// Time is that of the beats, not the clock's: the emulator's timer beats late, which no
    /// converter does.
    pub fn rehearsed(&mut self, samples: u32) -> bool {
        let converted = self.converters.convert(samples);
        let ticks = u64::from(converted) * self.period;
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
        self.tally.write(self.acquisition.faults(), self.dropped);
        if let Some(fault) = self.acquisition.take_fault()
            && let Some(part) = fault.part
        {
            let bit = 1_u32.wrapping_shl(part.into());
            self.tally.failed.fetch_or(bit, Ordering::Relaxed);
        }
    }
}

//! What the instrument asks of the board.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use massline_firmware::instrument::{Board, Vitals};
use massline_firmware::retained::Cause;
use massline_firmware::sampling::{self, Desk, INPUTS, Order, Plan, Tally};
use massline_firmware::wire::{
    Exact, FaultCounters, Field, LinkCounters, Problem, Provoke, Request, Setting, SettingKey,
    Storage,
};

use crate::edges::Metronome;
use crate::keeping::Keeping;
use crate::{board, faults, link, stack, ticks};

/// What sampling counts.
pub static TALLY: Tally = Tally::new();

/// Deepest that the stack was when somebody last looked, bytes.
static STACK_USED: AtomicU32 = AtomicU32::new(0);
/// Ticks that the processor has slept.
static ASLEEP: AtomicU32 = AtomicU32::new(0);
/// Whether the block task is to hang.
static HANG: AtomicBool = AtomicBool::new(false);

/// Looks how deep the stack has been.
pub fn look_at_stack() {
    STACK_USED.store(stack::used(), Ordering::Relaxed);
}

/// Counts time that the processor slept. Only the idle loop calls it.
pub fn count_sleep(ticks: u32) {
    let before = ASLEEP.load(Ordering::Relaxed);
    ASLEEP.store(before.wrapping_add(ticks), Ordering::Relaxed);
}

/// Hangs if a hang was asked for.
pub fn hang_if_provoked() {
    while HANG.load(Ordering::Relaxed) {
        cortex_m::asm::nop();
    }
}

/// How the program is to end, once the host has its reply.
#[derive(Clone, Copy)]
enum Ending {
    Reboot,
    Provoked(Provoke),
}

/// The box's own inputs, as seen from the desk.
pub struct Inputs {
    /// Where the sampling task gets its orders.
    pub desk: Desk<'static>,
    /// What stands in for their clock in a rehearsal.
    pub metronome: Metronome,
    /// Rate of [`ticks`], Hz.
    pub tick_hz: u32,
}

/// The board, as the instrument sees it.
pub struct Services {
    inputs: Inputs,
    /// Sample rate at which they run, if they do.
    rate: Option<f64>,
    /// Inputs up to the last one in use.
    in_use: usize,
    /// What has failed before this start.
    faults: FaultCounters,
    is_rehearsal: bool,
    /// Number of the next sample.
    samples: u64,
    /// Samples that wait are nobody's.
    is_stale: bool,
    keeping: Keeping,
    ending: Option<Ending>,
    link: LinkCounters,
    dropped: u32,
    asked_at: u64,
    asleep: u32,
}

impl Services {
    /// At the start.
    pub fn new(inputs: Inputs, keeping: Keeping, faults: FaultCounters) -> Self {
        Self {
            inputs,
            rate: None,
            in_use: INPUTS,
            faults,
            is_rehearsal: false,
            samples: 0,
            is_stale: false,
            keeping,
            ending: None,
            link: LinkCounters::default(),
            dropped: 0,
            asked_at: 0,
            asleep: 0,
        }
    }

    /// Takes note of what the link has counted.
    pub fn note_link(&mut self, counters: &LinkCounters, dropped: u32) {
        self.link = *counters;
        self.dropped = dropped;
    }

    /// Whether the samples that wait are of before the last start or stop; asked for once.
    pub fn take_stale(&mut self) -> bool {
        core::mem::take(&mut self.is_stale)
    }

    /// Takes note of the number of a sample.
    pub fn note_sample(&mut self, number: u64) {
        self.samples = number + 1;
    }

    /// Inputs up to the last one in use: what is behind it is nobody's.
    pub fn inputs_in_use(&self) -> usize {
        self.in_use
    }

    /// Whether the program is about to end.
    pub fn is_ending(&self) -> bool {
        self.ending.is_some()
    }

    /// Ends as it was asked for. The replies have left.
    pub fn end(&mut self) {
        let Some(ending) = self.ending.take() else {
            return;
        };
        board::let_link_finish();
        match ending {
            Ending::Reboot => faults::end(Cause::Request, format_args!("")),
            Ending::Provoked(Provoke::Panic) => panic!("provoked by the host"),
            Ending::Provoked(Provoke::StackOverflow) => {
                descend(0);
            }
            Ending::Provoked(Provoke::Hang) => HANG.store(true, Ordering::Relaxed),
            Ending::Provoked(Provoke::TestPattern) => {}
        }
    }
}

/// Calls itself until there is no stack.
#[allow(unconditional_recursion, reason = "it is what was asked for")]
#[inline(never)]
fn descend(depth: u32) -> u32 {
    let frame = core::hint::black_box([depth; 16]);
    descend(depth + 1).wrapping_add(core::hint::black_box(frame)[0])
}

impl Board for Services {
    fn ticks(&self) -> u64 {
        ticks::now()
    }

    fn faults(&self) -> FaultCounters {
        let mut counts = self.faults;
        TALLY.read(&mut counts);
        counts.storage = self.keeping.failures();
        counts
    }

    fn forget_faults(&mut self) {
        faults::amend(|record| record.forget());
        self.faults = FaultCounters::default();
        self.inputs.desk.give(Order::Forget, board::call_sampling);
        self.keeping.forget_failures();
    }

    fn vitals(&mut self) -> Vitals {
        let (now, asleep) = (ticks::now(), ASLEEP.load(Ordering::Relaxed));
        let passed = now - self.asked_at;
        let slept = u64::from(asleep.wrapping_sub(self.asleep)).min(passed);
        (self.asked_at, self.asleep) = (now, asleep);
        let load = (passed - slept) * 1000 / passed.max(1);
        Vitals {
            stack_used: STACK_USED.load(Ordering::Relaxed),
            stack_size: stack::size(),
            load: load as u16,
            dropped: self.dropped,
            overrun: link::overrun(),
            link: self.link,
        }
    }

    fn start_inputs(&mut self, sample_rate: f64) -> Result<(), Problem> {
        match self.rate {
            Some(running) if running == sample_rate => return Ok(()),
            Some(running) => {
                return Err(Problem::Range {
                    field: Field::SampleRate,
                    index: 0,
                    found: Exact(sample_rate),
                    low: Exact(running),
                    high: Exact(running),
                });
            }
            None => {}
        }
        let inputs = &mut self.inputs;
        let plan = Plan::new(self.keeping.settings(), sample_rate, inputs.tick_hz)?;
        let (period, in_use) = (plan.period as u32, plan.inputs);
        self.is_stale = true;
        self.samples = 0;
        match inputs.desk.start(plan, board::call_sampling) {
            Some(outcome) => outcome.map_err(sampling::problem)?,
            // It is called at once, so this would be a mistake in the priorities.
            None => return Err(Problem::Busy(Request::Status.number())),
        }
        self.rate = Some(sample_rate);
        self.in_use = in_use;
        if self.is_rehearsal {
            inputs.metronome.start(period);
        }
        Ok(())
    }

    fn stop_inputs(&mut self) {
        self.rate = None;
        self.inputs.metronome.stop();
        self.inputs.desk.give(Order::Stop, board::call_sampling);
        self.is_stale = true;
    }

    fn input_samples(&self) -> u64 {
        self.samples
    }

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        self.keeping.settings().get(key)
    }

    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        self.keeping.write(setting)
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        self.keeping.save()
    }

    fn reset_settings(&mut self) {
        self.keeping.reset();
    }

    fn unsaved(&self) -> bool {
        self.keeping.unsaved()
    }

    fn reboot(&mut self) {
        self.ending = Some(Ending::Reboot);
    }

    fn provoke(&mut self, fault: Provoke) -> bool {
        if fault == Provoke::TestPattern {
            self.stop_inputs();
            self.is_rehearsal = true;
            return self.inputs.desk.give(Order::Rehearse, board::call_sampling);
        }
        self.ending = Some(Ending::Provoked(fault));
        true
    }
}

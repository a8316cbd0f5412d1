//! The services of the board that the instrument uses.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::interrupt::{self, Mutex};
use massline_firmware::drivers::Lowpass;
use massline_firmware::instrument::{Board, Vitals};
use massline_firmware::link::Rx;
use massline_firmware::retained::Cause;
use massline_firmware::sampling::{
    self, CHIPS, Command, Commands, Counters, INPUTS, LANES, Outcome, Plan,
};
use massline_firmware::wire::{
    Conditions, FaultCounters, Field, Item, LinkCounters, Probe, Probed, Problem, Provoke, Request,
    Setting, SettingKey, Storage,
};

use crate::board::edges::TestClock;
use crate::board::{self, edges, port, ticks};
use crate::settings_store::SettingsStore;
use crate::{faults, stack};

/// Counters of the sampling task.
pub static COUNTERS: Counters = Counters::new();

/// Deepest that the stack was at the last look, bytes.
static STACK_USED: AtomicU32 = AtomicU32::new(0);
/// Ticks that the processor has slept since its start.
static ASLEEP: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));
/// `true` if the block task is to hang.
static HANG: AtomicBool = AtomicBool::new(false);

/// `true` while converters run.
static SAMPLING: AtomicBool = AtomicBool::new(false);

/// `true` while converters run.
pub fn is_sampling() -> bool {
    SAMPLING.load(Ordering::Relaxed)
}

/// Faults of samples so far.
pub fn faulty_samples() -> u32 {
    let mut faults = FaultCounters::default();
    COUNTERS.read(&mut faults);
    [
        faults.converter_checksum,
        faults.converter_missed,
        faults.converter_reset,
        faults.out_of_step,
        faults.overrun,
    ]
    .into_iter()
    .fold(0, u32::wrapping_add)
}

/// Measures how deep the stack has been.
pub fn look_at_stack() {
    STACK_USED.store(stack::used(), Ordering::Relaxed);
}

/// Counts time that the processor slept. Only the idle loop calls it.
pub fn count_sleep(ticks: u32) {
    interrupt::free(|cs| {
        let asleep = ASLEEP.borrow(cs);
        asleep.set(asleep.get() + u64::from(ticks));
    });
}

/// Ticks that the processor has slept since its start.
fn asleep() -> u64 {
    interrupt::free(|cs| ASLEEP.borrow(cs).get())
}

/// Hangs if a hang was asked for.
pub fn hang_if_provoked() {
    while HANG.load(Ordering::Relaxed) {
        core::hint::spin_loop();
    }
}

/// The end of the program that waits for the host to have its reply.
#[derive(Clone, Copy)]
enum Ending {
    Reboot,
    Provoked(Provoke),
}

/// The box's own inputs, as the instrument's services use them.
pub struct Inputs {
    /// Commands to the sampling task.
    pub commands: Commands<'static>,
    /// Timer that stands in for the converters' clock in a test pattern.
    pub test_clock: TestClock,
    /// Rate of [`ticks`], Hz.
    pub tick_hz: u32,
    /// Frequency of the crystal by the internal oscillator, Hz, if it oscillates.
    pub crystal: Option<u32>,
}

/// The sampling task was not called: it is called at once, so this would be a mistake in the priorities.
const UNCALLED: Problem = Problem::Busy(Request::Status.number());

/// The board's services.
pub struct Services {
    inputs: Inputs,
    /// Sample rate of the inputs, Hz, while they run.
    rate: Option<f64>,
    /// Bits of the converters with an input in use, and inputs up to the last of those.
    in_use: (u32, usize),
    /// Faults before this start.
    faults: FaultCounters,
    is_test_pattern: bool,
    /// Number of the next sample.
    samples: u64,
    /// The samples that wait belong to a recording that was stopped.
    is_stale: bool,
    settings: SettingsStore,
    ending: Option<Ending>,
    link: LinkCounters,
    overruns: u32,
    dropped: u32,
    asked_at: u64,
    asleep: u64,
}

impl Services {
    /// The services at the start.
    pub fn new(inputs: Inputs, settings: SettingsStore, faults: FaultCounters) -> Self {
        Self {
            inputs,
            rate: None,
            in_use: (u32::MAX, INPUTS),
            faults,
            is_test_pattern: false,
            samples: 0,
            is_stale: false,
            settings,
            ending: None,
            link: LinkCounters::default(),
            overruns: 0,
            dropped: 0,
            asked_at: 0,
            asleep: 0,
        }
    }

    /// Notes the counters of the link.
    pub fn note_link(&mut self, receive: &Rx<'_>, dropped: u32) {
        self.link = *receive.counters();
        self.overruns = receive.overruns();
        self.dropped = dropped;
    }

    /// `true` once after each start or stop: the samples that wait came before it.
    pub fn take_stale(&mut self) -> bool {
        core::mem::take(&mut self.is_stale)
    }

    /// Notes the number of a sample.
    pub fn note_sample(&mut self, number: u64) {
        self.samples = number.saturating_add(1);
    }

    /// The bits of the converters with an input in use, and the number of inputs up to the last of those.
    pub fn inputs_in_use(&self) -> (u32, usize) {
        self.in_use
    }

    /// `true` if the program is about to end.
    pub fn is_ending(&self) -> bool {
        self.ending.is_some()
    }

    /// Ends the program as was requested. All replies have been sent.
    pub fn end(&mut self) {
        let Some(ending) = self.ending.take() else {
            return;
        };
        port::finish_sending();
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

/// Calls itself until the stack overflows.
#[allow(unconditional_recursion, reason = "the overflow was requested")]
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
        COUNTERS.read(&mut counts);
        counts.storage = self.settings.failures();
        counts
    }

    fn forget_faults(&mut self) {
        faults::amend(|record| record.clear_faults());
        self.faults = FaultCounters::default();
        self.inputs
            .commands
            .send(Command::ClearFaults, board::call_sampling);
        self.settings.forget_failures();
    }

    fn vitals(&mut self) -> Vitals {
        let (now, asleep) = (ticks::now(), asleep());
        let passed = now - self.asked_at;
        let slept = (asleep - self.asleep).min(passed);
        (self.asked_at, self.asleep) = (now, asleep);
        let load = (passed - slept) * 1000 / passed.max(1);
        Vitals {
            stack_used: STACK_USED.load(Ordering::Relaxed),
            stack_size: stack::size(),
            load: load as u16,
            dropped: self.dropped,
            overrun: self.overruns,
            link: self.link,
        }
    }

    fn start_inputs(&mut self, sample_rate: f64, conditions: Conditions) -> Result<(), Problem> {
        match self.rate {
            Some(running) if running == sample_rate => return Ok(()),
            Some(running) => {
                return Err(Problem::range(
                    Field::SampleRate,
                    0,
                    sample_rate,
                    [running, running],
                ));
            }
            None => {}
        }
        let inputs = &mut self.inputs;
        let settings = self.settings.settings();
        let plan = Plan::new(settings, sample_rate, conditions, inputs.tick_hz)?;
        let (period, in_use) = (plan.period as u32, (plan.needed(), plan.inputs));
        self.is_stale = true;
        self.samples = 0;
        let start = Command::Start(plan);
        match inputs.commands.ask(start, board::call_sampling) {
            Some(Outcome::Started(outcome)) => outcome.map_err(sampling::problem)?,
            _ => return Err(UNCALLED),
        }
        self.rate = Some(sample_rate);
        SAMPLING.store(true, Ordering::Relaxed);
        self.in_use = in_use;
        if self.is_test_pattern {
            inputs.test_clock.start(period);
        }
        Ok(())
    }

    fn lowpass(&self, input: usize, sample_rate: f64) -> Option<Lowpass> {
        sampling::lowpass(input, sample_rate)
    }

    fn stop_inputs(&mut self) {
        self.rate = None;
        SAMPLING.store(false, Ordering::Relaxed);
        self.inputs.test_clock.stop();
        self.inputs
            .commands
            .send(Command::Stop, board::call_sampling);
        self.is_stale = true;
    }

    fn input_samples(&self) -> u64 {
        self.samples
    }

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        self.settings.settings().get(key)
    }

    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        self.settings.write(setting)
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        self.settings.save()
    }

    fn reset_settings(&mut self) {
        self.settings.reset();
    }

    fn unsaved(&self) -> bool {
        self.settings.unsaved()
    }

    fn reboot(&mut self) {
        self.ending = Some(Ending::Reboot);
    }

    fn probe(&mut self, probe: Probe) -> Result<Probed, Problem> {
        let mut ask = |command| self.inputs.commands.ask(command, board::call_sampling);
        match probe {
            Probe::Crystal => Ok(Probed::Crystal(self.inputs.crystal)),
            Probe::Skew => Ok(Probed::Skew(edges::skews())),
            Probe::Loop(bus) if usize::from(bus) >= LANES => {
                Err(Problem::index(Item::Bus, bus.into(), LANES))
            }
            Probe::Loop(bus) => match ask(Command::Loop(bus)) {
                Some(Outcome::Looped(Some(looped))) => Ok(Probed::Loop(looped)),
                Some(Outcome::Looped(None)) => Err(Problem::Unsupported(Item::Bus)),
                _ => Err(UNCALLED),
            },
            Probe::Converter(number) if usize::from(number) >= CHIPS => {
                Err(Problem::index(Item::Converter, number.into(), CHIPS))
            }
            Probe::Converter(number) => match ask(Command::Prepare(number)) {
                Some(Outcome::Prepared(prepared)) => {
                    let fault = prepared.err().map(sampling::reported);
                    Ok(Probed::Converter(fault))
                }
                _ => Err(UNCALLED),
            },
        }
    }

    fn provoke(&mut self, fault: Provoke) -> bool {
        if fault == Provoke::TestPattern {
            self.stop_inputs();
            self.is_test_pattern = true;
            return self
                .inputs
                .commands
                .send(Command::TestPattern, board::call_sampling);
        }
        self.ending = Some(Ending::Provoked(fault));
        true
    }
}

//! What the instrument asks of the board.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use massline_core::instrument::{Board, Vitals};
use massline_core::wire::{
    FaultCounters, Item, LinkCounters, Problem, Provoke, Setting, SettingKey, Storage,
};
use massline_firmware::retained::Cause;

use crate::{board, faults, link, stack, ticks};

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

/// The board, as the instrument sees it.
pub struct Services {
    ending: Option<Ending>,
    link: LinkCounters,
    dropped: u32,
    asked_at: u64,
    asleep: u32,
}

impl Services {
    /// At the start.
    pub fn new() -> Self {
        Self {
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
        faults::record().faults
    }

    fn forget_faults(&mut self) {
        faults::amend(|record| record.forget());
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

    fn start_inputs(&mut self, _sample_rate: f64) -> Result<(), Problem> {
        Err(Problem::Unsupported(Item::Input))
    }

    fn stop_inputs(&mut self) {}

    fn setting(&self, _key: SettingKey) -> Result<Setting<'_>, Problem> {
        Err(Problem::Unsupported(Item::Setting))
    }

    fn write_setting(&mut self, _setting: &Setting<'_>) -> Result<(), Problem> {
        Err(Problem::Unsupported(Item::Setting))
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        Ok(Storage::Volatile)
    }

    fn reset_settings(&mut self) {}

    fn unsaved(&self) -> bool {
        false
    }

    fn reboot(&mut self) {
        self.ending = Some(Ending::Reboot);
    }

    fn provoke(&mut self, fault: Provoke) -> bool {
        self.ending = Some(Ending::Provoked(fault));
        true
    }
}

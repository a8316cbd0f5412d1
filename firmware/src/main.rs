//! The box next to the shaking table: `massline-core` on an STM32F405.
//!
//! This file holds the tasks and nothing else. Pins and peripherals are in [`board`], the choice
//! of clock in [`clocks`], the queues to the serial port in [`link`], what calls for a sample in
//! [`edges`], settings in [`keeping`], the instrument and its dealings in [`office`], what becomes
//! of a failure in [`faults`].
//!
//! # Tasks
//!
//! | priority | task | called by | works for | why there |
//! | --- | --- | --- | --- | --- |
//! | 6 | `roll_call` | SysTick, every 10 ms | microseconds | must see any other task hang |
//! | 6 | `edge` | DRDY lines | a microsecond | notes when a sample was taken |
//! | 6 | `beat` | TIM5, in a rehearsal | a microsecond | stands in for that |
//! | 5 | `link` | USART2 | a microsecond a byte | the port holds one byte, 11 µs long; it moves some bytes at a time, so that no traffic starves what is below |
//! | 4 | `sample` | `edge`, `beat`, `roll_call` | a sample of all inputs | a sample waits a period at the most, and takes no lock |
//! | 3 | `desk` | `link` at a frame's end | a message | answers while blocks are computed and jobs run |
//! | 2 | `block` | `sample`, `desk`, `roll_call` | a block | takes milliseconds, no one waits for it |
//! | 2 | `telemetry` | `roll_call`, every 100 ms | a look at the stack | so does this |
//! | 1 | `identify` | `desk` | a job of seconds | everything else goes on meanwhile |
//!
//! The chip is the only target on which this binary does its job:
//!
//! ```text
//! cargo build --release -p massline-firmware --target thumbv7em-none-eabihf
//! ```
//!
//! The very ELF this produces also boots in the emulator; `cargo xtask test` does that.

#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(missing_docs)]

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod build_id;
#[cfg(target_os = "none")]
mod bus;
#[cfg(target_os = "none")]
mod clocks;
#[cfg(target_os = "none")]
mod edges;
#[cfg(target_os = "none")]
mod faults;
#[cfg(target_os = "none")]
mod flash;
#[cfg(target_os = "none")]
mod keeping;
#[cfg(target_os = "none")]
mod link;
#[cfg(target_os = "none")]
mod memory;
#[cfg(target_os = "none")]
mod office;
#[cfg(target_os = "none")]
mod services;
#[cfg(target_os = "none")]
mod stack;
#[cfg(target_os = "none")]
mod ticks;

// Linked for what it defines: the log's transport.
#[cfg(target_os = "none")]
use defmt_rtt as _;

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac)]
mod app {
    use core::sync::atomic::{AtomicBool, Ordering};

    use massline_firmware::instrument::{Memory, Persistent, WorkingStorage};
    use massline_firmware::retained::Cause;
    use massline_firmware::roll_call::{Answers, RollCall};
    use massline_firmware::sampling;
    use massline_firmware::sampling::INPUTS;
    use massline_firmware::settings::Settings;
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    use crate::board::{self, Board, ROUNDS, Sampler};
    use crate::edges::{self, Edges};
    use crate::keeping::Keeping;
    use crate::link::{Port, Queues, has_more, open};
    use crate::office::{self, Office};
    use crate::services::{Inputs, Services, TALLY};
    use crate::{build_id, faults, flash, memory, services, ticks};

    /// Who is called at the roll call, in the order of priority: where several are missing, the
    /// first keeps the others from answering.
    const NAMES: [&str; 6] = ["link", "sample", "desk", "block", "telemetry", "identify"];
    const LINK: u8 = 0;
    const SAMPLE: u8 = 1;
    const DESK: u8 = 2;
    const BLOCK: u8 = 3;
    const TELEMETRY: u8 = 4;
    const IDENTIFY: u8 = 5;

    static ANSWERS: Answers = Answers::new();

    /// Calls of the block task's work that come one after the other, 8 samples each.
    const TOGETHER: usize = 16;
    /// Whether the block task has more to do, once all others had their turn.
    static MORE: AtomicBool = AtomicBool::new(false);

    #[shared]
    struct Shared {
        office: &'static mut Office,
    }

    #[local]
    struct Local {
        port: Port,
        sampler: Sampler,
        edges: Edges,
        roll: RollCall<6>,
        watchdog: IndependentWatchdog,
        rounds: u32,
    }

    #[init(local = [
        working: WorkingStorage = WorkingStorage::new(),
        persistent: Persistent = Persistent::new(),
        queues: Queues = Queues::new(),
        settings: Settings<INPUTS> = Settings::DELIVERED,
        samples: sampling::Queues = sampling::Queues::new(),
        rooms: Option<Office> = None,
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let flags = board::reset_flags(&cx.device.RCC);
        let (record, reset) = faults::start(flags);
        let (resets, session, counts) = (record.resets, record.session, record.faults);
        let mut kept = None;
        let settings = cx.local.settings;
        let started = Board::start(cx.device, |flash| {
            let keeping = kept.insert(Keeping::open(flash, settings));
            keeping.settings().link_baud()
        });
        let (mut board, keeping) = match (started, kept) {
            (Ok(board), Some(keeping)) => (board, keeping),
            (Err(fault), _) => board::halt(fault),
            (Ok(_), None) => panic!("the board has not asked for its settings"),
        };
        let record = cortex_m::singleton!(: massline_firmware::retained::Record = record);
        let build = cortex_m::singleton!(: heapless::String<16> = build_id::read());
        let identity = office::identity(
            &board.clock,
            board.ticks.raw(),
            build.map_or("", |text| text.as_str()),
            reset,
            resets,
            record.and_then(|record| record.words()),
            keeping.storage(),
        );
        let Some(runs) = memory::runs() else {
            panic!("the 64 KiB of core-coupled memory do not answer");
        };
        let storage = Memory {
            working: cx.local.working,
            runs,
            persistent: cx.local.persistent,
        };
        let (mut port, inbox, post) = open(board.link_rx, board.link_tx, session, cx.local.queues);
        port.start();
        let (ends, desk, shots) = cx.local.samples.split();
        let tick_hz = board.ticks.raw();
        let sampler = Sampler::new(board.converters, ends, &TALLY, tick_hz);
        let inputs = Inputs {
            desk,
            metronome: board.metronome,
            tick_hz,
        };
        let services = Services::new(inputs, keeping, counts);
        board::start_rounds(cx.core.SYST, board.clock.core);
        // The chip stands still while its flash is erased.
        board.watchdog.start((2 * flash::ERASE_MS).millis());
        board::pend_block();

        // Patience of the roll call. A job may take 15 s at the highest clock, twelve times its
        // budget; with a slower clock everything takes longer, so it is counted in cycles.
        let cycles = |seconds: u32| seconds * (168_000_000 / (board.clock.core.raw() / ROUNDS));
        // Telemetry is called in one of ten rounds, and must not be late before what hinders it.
        let second = cycles(1);
        let roll = RollCall::new([second, second, second, second, cycles(2), cycles(15)]);
        let office = Office::open(
            cx.local.rooms,
            storage,
            identity,
            services,
            shots,
            (inbox, post, board.link_rate),
        );
        (
            Shared { office },
            Local {
                port,
                sampler,
                edges: board.edges,
                roll,
                watchdog: board.watchdog,
                rounds: 0,
            },
        )
    }

    // Interrupts wake the processor though they are masked, so that sleep ends in the count
    // before the work that ended it begins.
    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::interrupt::free(|_| {
                let begin = ticks::low();
                cortex_m::asm::wfi();
                services::count_sleep(ticks::low().wrapping_sub(begin));
            });
        }
    }

    #[task(binds = SysTick, priority = 6, local = [roll, watchdog, rounds])]
    fn roll_call(cx: roll_call::Context) {
        ticks::now();
        match cx.local.roll.round(&ANSWERS) {
            Ok(()) => cx.local.watchdog.feed(),
            Err(task) => faults::end(
                Cause::Watchdog,
                format_args!(
                    "task {} did not answer the roll call",
                    NAMES[usize::from(task)]
                ),
            ),
        }
        *cx.local.rounds = cx.local.rounds.wrapping_add(1);
        if cx.local.rounds.is_multiple_of(ROUNDS / 10) {
            board::pend_telemetry();
        }
        board::pend_link();
        board::call_sampling();
        board::pend_desk();
        board::pend_block();
        board::pend_identify();
    }

    #[task(binds = USART2, priority = 5, local = [port])]
    fn link(cx: link::Context) {
        if cx.local.port.serve() {
            board::pend_desk();
        }
        ANSWERS.present(LINK);
    }

    #[task(binds = TIM5, priority = 6)]
    fn beat(_: beat::Context) {
        edges::beat();
    }

    #[task(binds = EXTI9_5, priority = 6, local = [edges])]
    fn edge(cx: edge::Context) {
        cx.local.edges.note();
    }

    #[task(binds = CAN1_TX, priority = 4, local = [sampler])]
    fn sample(cx: sample::Context) {
        let sampler = cx.local.sampler;
        let is_new = match (edges::take_beats(), edges::take()) {
            (beats @ 1.., _) => sampler.rehearsed(beats),
            (0, Some((ready, at))) => sampler.edge(ready, at),
            (0, None) => false,
        };
        sampler.attend(ticks::now());
        if is_new {
            board::pend_block();
        }
        ANSWERS.present(SAMPLE);
    }

    #[task(binds = CAN2_TX, priority = 3, shared = [office])]
    fn desk(mut cx: desk::Context) {
        while cx.shared.office.lock(|office| office.attend()) {
            board::pend_block();
            board::pend_identify();
        }
        if has_more() {
            board::pend_link();
        }
        ANSWERS.present(DESK);
    }

    #[task(binds = CAN2_RX0, priority = 2, shared = [office])]
    fn block(mut cx: block::Context) {
        services::hang_if_provoked();
        // A synthetic run without an end has always more to do.
        let is_more = (0..TOGETHER).all(|_| cx.shared.office.lock(|office| office.poll()));
        if is_more {
            MORE.store(true, Ordering::Relaxed);
            board::pend_identify();
        }
        ANSWERS.present(BLOCK);
    }

    #[task(binds = CAN2_RX1, priority = 2)]
    fn telemetry(_: telemetry::Context) {
        services::look_at_stack();
        ANSWERS.present(TELEMETRY);
    }

    #[task(binds = CAN2_SCE, priority = 1, shared = [office])]
    fn identify(mut cx: identify::Context) {
        let mut out = cx.shared.office.lock(|office| office.take_job());
        if let Some(job) = &mut out {
            job.run();
        }
        while let Some(job) = out {
            out = cx.shared.office.lock(|office| office.finish(job));
        }
        ANSWERS.present(IDENTIFY);
        if MORE.swap(false, Ordering::Relaxed) {
            board::pend_block();
        }
    }
}

/// Says how to build the firmware, since a host cannot run it.
#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    eprintln!(
        "massline-firmware runs on the STM32F405, not here.\n\
         build:    cargo build --release -p massline-firmware --target thumbv7em-none-eabihf\n\
         emulate:  cargo xtask test --only emulator"
    );
    std::process::ExitCode::from(2)
}

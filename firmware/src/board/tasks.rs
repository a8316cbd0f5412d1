//! The tasks: interrupts, priorities, and the calls of the application behind them.
//!
//! | priority | task | called by | works for | why there |
//! | --- | --- | --- | --- | --- |
//! | 6 | `watch_tasks` | SysTick, every 10 ms | microseconds | must see any other task hang |
//! | 6 | `first_edge`, `second_edge` | TIM3, TIM4: DRDY lines | a microsecond | note when a sample was taken |
//! | 6 | `test_clock` | TIM5, in a test pattern | a microsecond | stands in for that |
//! | 5 | `link` | USART2 | a microsecond a byte | the port holds one byte, 11 µs long; it moves some bytes at a time, so that no traffic starves what is below |
//! | 4 | `sample` | the edges, `test_clock`, `watch_tasks` | the begin of frames | a sample waits a period at the most, and takes no lock |
//! | 4 | `first_lane`, `second_lane`, `third_lane` | DMA, at the end of a frame | the next frame, or a sample of all inputs | the same task, by another interrupt |
//! | 3 | `requests` | `link` at a frame's end | a message | answers while blocks are computed and jobs run |
//! | 2 | `block` | `sample`, `requests`, `watch_tasks` | a block | takes milliseconds, no one waits for it |
//! | 2 | `telemetry` | `watch_tasks`, every 100 ms | a look at the stack | so does this |
//! | 1 | `identify` | `requests` | a job of seconds | everything else goes on meanwhile |

#[rtic::app(device = stm32f4xx_hal::pac)]
mod app {
    use core::sync::atomic::{AtomicBool, Ordering};

    use massline_firmware::instrument::{Memory, Persistent, WorkingStorage};
    use massline_firmware::link::Queues;
    use massline_firmware::retained::Cause;
    use massline_firmware::sampling;
    use massline_firmware::sampling::INPUTS;
    use massline_firmware::settings::Settings;
    use massline_firmware::status_light::{self, StatusLight};
    use massline_firmware::task_watchdog::{CheckIns, TaskWatchdog};
    use stm32f4xx_hal::gpio::{AnyPin, Output, PinState};
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    use crate::app::{self as application, App};
    use crate::board::edges::{self, Edges};
    use crate::board::port::{self, Port};
    use crate::board::{self, Board, ROUNDS, Sampler, flash, memory, ticks};
    use crate::services::{COUNTERS, Inputs, Services};
    use crate::settings_store::SettingsStore;
    use crate::{build_id, faults, services};

    /// Tasks in the order of priority: of several that are late, the first keeps the others from
    /// running.
    const NAMES: [&str; 6] = [
        "link",
        "sample",
        "requests",
        "block",
        "telemetry",
        "identify",
    ];
    const LINK: u8 = 0;
    const SAMPLE: u8 = 1;
    const REQUESTS: u8 = 2;
    const BLOCK: u8 = 3;
    const TELEMETRY: u8 = 4;
    const IDENTIFY: u8 = 5;

    static CHECK_INS: CheckIns = CheckIns::new();

    /// Samples that are handed over together; fewer wait for the next round of `watch_tasks`.
    const HANDED_OVER: usize = 8;
    /// Pieces of the block task's work that are done in a row, 8 samples each.
    const TOGETHER: usize = 16;
    /// `true` if the block task has more to do once the tasks of lower priority have run.
    static MORE: AtomicBool = AtomicBool::new(false);

    #[shared]
    struct Shared {
        app: &'static mut App,
        #[lock_free]
        sampler: Sampler,
        #[lock_free]
        edges: Edges,
    }

    #[local]
    struct Local {
        port: Port,
        task_watchdog: TaskWatchdog<6>,
        watchdog: IndependentWatchdog,
        rounds: u32,
        led: AnyPin<Output>,
        status_light: StatusLight,
    }

    #[init(local = [
        working: WorkingStorage = WorkingStorage::new(),
        persistent: Persistent = Persistent::new(),
        queues: Queues = Queues::new(),
        settings: Settings<INPUTS> = Settings::DELIVERED,
        samples: sampling::Queues = sampling::Queues::new(),
        app: Option<App> = None,
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let flags = board::reset_flags(&cx.device.RCC);
        let (record, reset) = faults::start(flags);
        let (resets, session, counts) = (record.resets, record.session, record.faults);
        let settings = cx.local.settings;
        let started = Board::start(cx.device, |flash| {
            let store = SettingsStore::open(flash, settings);
            let baud = store.settings().link_baud();
            (store, baud)
        });
        let (mut board, settings) = match started {
            Ok(started) => started,
            Err(fault) => board::halt(fault),
        };
        let record = cortex_m::singleton!(: massline_firmware::retained::Record = record);
        let build = cortex_m::singleton!(: heapless::String<16> = build_id::read());
        let identity = application::identity(
            &board.clock,
            board.ticks.raw(),
            build.map_or("", |text| text.as_str()),
            reset,
            resets,
            record.and_then(|record| record.message()),
            settings.storage(),
        );
        let Some(runs) = memory::runs() else {
            panic!("the 64 KiB of core-coupled memory do not answer");
        };
        let storage = Memory {
            working: cx.local.working,
            runs,
            persistent: cx.local.persistent,
        };
        let (ends, receive, transmit) = cx.local.queues.split(session, board::pend_link);
        let port = Port::new(board.link, ends);
        let (ends, commands, frames) = cx.local.samples.split();
        let tick_hz = board.ticks.raw();
        let sampler = Sampler::new(board.converters, board.lanes, ends, &COUNTERS, tick_hz);
        let inputs = Inputs {
            commands,
            test_clock: board.test_clock,
            tick_hz,
            crystal: board.clock.crystal,
        };
        let services = Services::new(inputs, settings, counts);
        board::start_rounds(cx.core.SYST, board.clock.core);
        // The chip stands still while its flash is erased.
        board.watchdog.start((2 * flash::ERASE_MS).millis());
        board::pend_block();

        // A job may take 15 s at the highest clock, a hundred times its budget; with a slower clock
        // everything takes longer, so these limits are counted in cycles.
        let cycles = |seconds: u32| seconds * (168_000_000 / (board.clock.core.raw() / ROUNDS));
        // Telemetry is called in one of ten rounds, and must not be late before what hinders it.
        let second = cycles(1);
        let task_watchdog =
            TaskWatchdog::new([second, second, second, second, cycles(2), cycles(15)]);
        let app = App::start(
            cx.local.app,
            storage,
            identity,
            services,
            frames,
            (receive, transmit, board.link_rate),
        );
        (
            Shared {
                app,
                sampler,
                edges: board.edges,
            },
            Local {
                port,
                task_watchdog,
                watchdog: board.watchdog,
                rounds: 0,
                led: board.led,
                status_light: StatusLight::new(),
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

    #[task(binds = SysTick, priority = 6, local = [task_watchdog, watchdog, rounds])]
    fn watch_tasks(cx: watch_tasks::Context) {
        ticks::now();
        match cx.local.task_watchdog.round(&CHECK_INS) {
            Ok(()) => cx.local.watchdog.feed(),
            Err(task) => faults::end(
                Cause::Watchdog,
                format_args!("task {} did not check in", NAMES[usize::from(task)]),
            ),
        }
        *cx.local.rounds = cx.local.rounds.wrapping_add(1);
        if cx
            .local
            .rounds
            .is_multiple_of(ROUNDS / status_light::ROUNDS)
        {
            board::pend_telemetry();
        }
        board::pend_link();
        board::call_sampling();
        board::pend_requests();
        board::pend_block();
        board::pend_identify();
    }

    #[task(binds = USART2, priority = 5, local = [port])]
    fn link(cx: link::Context) {
        if cx.local.port.serve() {
            board::pend_requests();
        }
        CHECK_INS.check_in(LINK);
    }

    #[task(binds = TIM5, priority = 6)]
    fn test_clock(_: test_clock::Context) {
        edges::test_clock_period();
    }

    #[task(binds = TIM3, priority = 6, shared = [edges])]
    fn first_edge(cx: first_edge::Context) {
        cx.shared.edges.note();
    }

    #[task(binds = TIM4, priority = 6, shared = [edges])]
    fn second_edge(cx: second_edge::Context) {
        cx.shared.edges.note();
    }

    #[task(binds = CAN1_TX, priority = 4, shared = [sampler])]
    fn sample(cx: sample::Context) {
        let sampler = cx.shared.sampler;
        let mut is_new = match edges::take_periods() {
            0 => false,
            periods => sampler.test_pattern(periods),
        };
        is_new |= see_edge(sampler) | sampler.resume();
        sampler.poll(ticks::now());
        hand_over(sampler, is_new);
        CHECK_INS.check_in(SAMPLE);
    }

    #[task(binds = DMA1_STREAM3, priority = 4, shared = [sampler])]
    fn first_lane(cx: first_lane::Context) {
        end_frame(cx.shared.sampler, 0);
    }

    #[task(binds = DMA1_STREAM0, priority = 4, shared = [sampler])]
    fn second_lane(cx: second_lane::Context) {
        end_frame(cx.shared.sampler, 1);
    }

    #[task(binds = DMA2_STREAM0, priority = 4, shared = [sampler])]
    fn third_lane(cx: third_lane::Context) {
        end_frame(cx.shared.sampler, 2);
    }

    /// Handles the interrupt of a lane.
    fn end_frame(sampler: &mut Sampler, lane: usize) {
        // An edge from before the end of the frame may have cost it its sample.
        let mut is_new = see_edge(sampler) | sampler.lane(lane);
        // At most ends of frames another one has begun.
        if !sampler.is_reading() {
            // A sample that was emptied from a buffer may have taken a while.
            is_new |= see_edge(sampler) | sampler.resume();
            hand_over(sampler, is_new);
        }
    }

    /// Calls the block task if there is a new sample, and enough of them.
    fn hand_over(sampler: &Sampler, is_new: bool) {
        if is_new && sampler.waiting() >= HANDED_OVER {
            board::pend_block();
        }
    }

    fn see_edge(sampler: &mut Sampler) -> bool {
        edges::take().is_some_and(|edge| sampler.edge(edge))
    }

    #[task(binds = CAN2_TX, priority = 3, shared = [app])]
    fn requests(mut cx: requests::Context) {
        while cx.shared.app.lock(|app| app.serve_request()) {
            board::pend_block();
            board::pend_identify();
        }
        if port::has_more() {
            board::pend_link();
        }
        CHECK_INS.check_in(REQUESTS);
    }

    #[task(binds = CAN2_RX0, priority = 2, shared = [app])]
    fn block(mut cx: block::Context) {
        services::hang_if_provoked();
        // A synthetic run without an end has always more to do.
        let is_more = (0..TOGETHER).all(|_| cx.shared.app.lock(|app| app.poll()));
        if is_more {
            MORE.store(true, Ordering::Relaxed);
            board::pend_identify();
        }
        CHECK_INS.check_in(BLOCK);
    }

    #[task(binds = CAN2_RX1, priority = 2, local = [led, status_light])]
    fn telemetry(cx: telemetry::Context) {
        services::look_at_stack();
        let light = cx.local.status_light;
        let is_lit = light.round(services::is_sampling(), services::faulty_samples());
        cx.local.led.set_state(PinState::from(!is_lit));
        CHECK_INS.check_in(TELEMETRY);
    }

    #[task(binds = CAN2_SCE, priority = 1, shared = [app])]
    fn identify(mut cx: identify::Context) {
        let mut out = cx.shared.app.lock(|app| app.take_job());
        if let Some(job) = &mut out {
            job.run();
        }
        while let Some(job) = out {
            out = cx.shared.app.lock(|app| app.finish(job));
        }
        CHECK_INS.check_in(IDENTIFY);
        if MORE.swap(false, Ordering::Relaxed) {
            board::pend_block();
        }
    }
}

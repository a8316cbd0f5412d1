//! Memory of the chip that the firmware takes, and cost of a block and of an identification there.
//!
//! With `-icount shift=0` every instruction takes a nanosecond of emulated time, and a tick is
//! one instruction, see `firmware/src/board/ticks.rs`.

use std::fmt::Write as _;
use std::fs;

use massline::device::firmware;
use massline_firmware::models::setup;
use massline_firmware::wire::{
    Accelerations, Event, FromBox, Gaps, Grid, Identified, Method, Outcome, Packed, Procedure,
    Processing, Provoke, Reply, Request, Samples, Setting, Source, Stream, Subscription, Telemetry,
    Values, Window,
};

use massline_tests::readme;
use massline_tests::xtask::image;

use crate::talk::Talk;

#[path = "../../../firmware/tests/instrument/shaken.rs"]
mod shaken;

// The budgets. A budget is lowered freely, and raised only with the reason in the commit.

/// Flash, bytes.
const FLASH: u64 = 420 << 10;
/// Worst stack, bytes. The nesting of interrupts during an identification is random: 13 000 to
/// 13 500 were measured. The table shows this budget instead.
const STACK: u32 = 16 << 10;
/// Static variables and the worst stack together, bytes: nine tenths of 192 KiB.
const MEMORY: u64 = (192 << 10) * 9 / 10;
/// A block of thirteen channels and 96 lines, instructions: a tenth above what was measured.
const BLOCK: u32 = 185_000;
/// Identifications by apparent mass over 39 lines and over 96, instructions: 0.09 and 0.12 s at 168 MHz.
const IDENTIFICATIONS: [u64; 2] = [15_000_000, 20_000_000];
/// The same from samples with noise, of a body with one mode and of one with two.
const WITH_NOISE: [[u64; 2]; 2] = [[15_000_000, 20_000_000], [20_000_000, 27_000_000]];

/// All methods, the recommended one first.
const METHODS: [Method; 8] = [
    Method::ApparentMass,
    Method::FrequencyResponses,
    Method::PowerSpectra,
    Method::PowerSpectraCholesky,
    Method::FreeResponses,
    Method::FreeResponsesSquared,
    Method::CurveFit,
    Method::Synthesis,
];
const ITERATIVE: Procedure = Procedure::Iterative {
    tolerance: 1e-6,
    limit: 50,
};

const RUNS: u8 = 6;
/// Samples of a run: those that fill the filters, one block, and two more that overlap.
const SAMPLES: u64 = 2400;
/// At 512 samples/s, 0.5 to 48 Hz in steps of half a hertz.
const LINES: u32 = 96;
/// Averaging bands of 39 lines, below the modes, and of all 96, Hz.
const BANDS: [[f64; 2]; 2] = [[1.0, 20.0], [0.5, 48.0]];
/// Samples with noise per second: few for the same lines, since the emulated port takes half a minute for a
/// megabyte.
const NOISY_RATE: f64 = 128.0;
const NOISY_BLOCK: u32 = 256;
/// Samples with noise of a run: three blocks that overlap by half.
const NOISY_SAMPLES: usize = 2 * NOISY_BLOCK as usize;

/// Requests of a set-up of six runs of thirteen channels and 96 lines, bands in Hz.
pub fn pieces(
    accelerations: Accelerations,
    sample_rate: f64,
    averaging_band: [f64; 2],
    send: impl FnMut(&Request<'_>),
) {
    let processing = Processing {
        sample_rate,
        window: Window::Rectangular,
        kept_band: [1, LINES].map(|line| f64::from(line) * sample_rate / 1024.0),
        averaging_band,
        accelerations,
        minimum_weight: 1.0,
        ..setup::PROCESSING
    };
    pieces_of(processing, 0.15, send);
}

/// Requests of a set-up of six runs whose sensors are at most `reach` m from either axis.
fn pieces_of(processing: Processing, reach: f64, mut send: impl FnMut(&Request<'_>)) {
    send(&Request::BeginSetup(setup::plan(RUNS, 0)));
    send(&Request::SetProcessing(processing));
    for sensor in setup::sensors(reach, 1.0) {
        send(&Request::SetSensor(sensor));
    }
    for run in 0..RUNS {
        send(&Request::SetRun(setup::run(run)));
    }
}

/// Sends these requests to the box.
pub fn set_up(
    talk: &mut Talk,
    accelerations: Accelerations,
    sample_rate: f64,
    averaging_band: [f64; 2],
) {
    pieces(accelerations, sample_rate, averaging_band, |request| {
        talk.done(request);
    });
    end_set_up(talk);
}

fn end_set_up(talk: &mut Talk) {
    let grid: Grid = talk.exchange(&Request::EndSetup, |reply| match reply {
        Reply::Grid(grid) => *grid,
        other => panic!("{other:?}"),
    });
    assert_eq!(grid.lines.count as u32, LINES);
}

/// Measures all runs, and returns the instructions of the costliest block.
fn measure(talk: &mut Talk) -> u32 {
    let mut costliest = 0;
    for run in 0..RUNS {
        let start = setup::start(run, Source::Synthetic, Gaps::Count, Some(SAMPLES));
        talk.done(&Request::Start(start));
        let summary = talk.event(|event| match event {
            Event::Block(block) => {
                assert!(block.health.is_good(), "{block:?}");
                costliest = costliest.max(block.ticks);
                None
            }
            Event::RunEnded(summary) => Some(*summary),
            _ => None,
        });
        assert_eq!((summary.run, summary.outcome), (run, Outcome::Limit));
        assert!(summary.blocks >= 2, "{summary:?}");
    }
    costliest
}

/// Sends all runs of a body with one or two modes and noise of each sensor.
fn send_noisy(talk: &mut Talk, modes: usize) {
    let masses = [1.0, if modes == 2 { 1.0 } else { 0.0 }];
    let together = Samples::fit(setup::CHANNELS as u8, size_of::<f32>());
    for run in 0..RUNS {
        let start = setup::start(run, Source::Host, Gaps::Refuse, None);
        talk.done(&Request::Start(start));
        let all = shaken::samples(run.into(), NOISY_RATE, NOISY_SAMPLES, masses);
        let mut first = 0;
        for some in all.chunks(together) {
            // The sensors, and the drive behind them.
            let values: Vec<f32> = some
                .iter()
                .flat_map(|s| s[..setup::SENSORS.into()].iter().chain(s.last()))
                .copied()
                .collect();
            let sent = talk.request(&Request::Samples(Samples {
                first,
                channels: setup::CHANNELS as u8,
                values: Values::Readings(Packed::new(&values)),
            }));
            talk.wait(|id, message| match message {
                FromBox::Event(Event::Block(block)) => {
                    assert!(block.health.is_good(), "{block:?}");
                    None
                }
                FromBox::Reply(reply) if id == sent => {
                    assert!(matches!(reply, Reply::Progress(_)), "{reply:?}");
                    Some(())
                }
                _ => None,
            });
            first += some.len() as u64;
        }
        talk.exchange(&Request::Stop, |reply| match reply {
            Reply::Summary(summary) => assert!(summary.blocks >= 2, "{summary:?}"),
            other => panic!("{other:?}"),
        });
    }
}

/// Instructions of identifications by apparent mass from samples with noise: a row for each number of
/// modes, a column for each averaging band.
fn with_noise(talk: &mut Talk) -> [[u64; 2]; 2] {
    [1, 2].map(|modes| {
        BANDS.map(|averaging_band| {
            let processing = Processing {
                sample_rate: NOISY_RATE,
                block_length: NOISY_BLOCK,
                kept_band: BANDS[1],
                averaging_band,
                minimum_weight: 1.0,
                ..setup::PROCESSING
            };
            pieces_of(processing, shaken::REACH, |request| talk.done(request));
            end_set_up(talk);
            send_noisy(talk, modes);
            let question = setup::question(Method::ApparentMass, Procedure::Direct, modes as u8);
            ask(talk, &Request::Identify(question), |found| {
                // Its cost is that of the modes that it finds.
                let poles = found.answer.findings.poles.iter().flatten().count();
                assert_eq!(poles, modes, "{found:?}");
            })
        })
    })
}

/// Instructions from request to answer.
fn identify(talk: &mut Talk, method: Method, procedure: Procedure) -> u64 {
    let question = Request::Identify(setup::question(method, procedure, 1));
    ask(talk, &question, |_| ())
}

/// Instructions from request to answer, which `look` sees.
fn ask(talk: &mut Talk, question: &Request<'_>, look: impl Fn(&Identified)) -> u64 {
    talk.exchange(question, |reply| match reply {
        Reply::Identified(found) => {
            let identification = found.answer.identification;
            assert!(identification.mass.is_some(), "{identification:?}");
            look(found);
            found.ticks
        }
        other => panic!("{question:?}: {other:?}"),
    })
}

/// Identifies while inputs are recorded and all telemetry is sent, for the depth of the stack.
fn all_at_once(talk: &mut Talk) {
    talk.done(&Request::Provoke(Provoke::TestPattern));
    talk.done(&Request::WriteSetting(Setting::SampleRate(256.0)));
    talk.done(&Request::Subscribe(Subscription {
        telemetry: 100,
        levels: 100,
        samples: Stream::Counts,
    }));
    identify(talk, Method::CurveFit, ITERATIVE);
    talk.done(&Request::Subscribe(Subscription::default()));
    talk.exchange(&Request::SaveSettings, |reply| {
        assert!(matches!(reply, Reply::Saved(_)), "{reply:?}");
    });
}

/// Telemetry with the worst stack. The box measures it every 100 ms, and reports the last value.
fn stack(talk: &mut Talk) -> Telemetry {
    let subscribe = |telemetry| {
        Request::Subscribe(Subscription {
            telemetry,
            ..Subscription::default()
        })
    };
    talk.done(&subscribe(150));
    let mut seen = 0;
    let telemetry = talk.event(|event| match event {
        Event::Telemetry(telemetry) => {
            seen += 1;
            (seen == 3).then_some(*telemetry)
        }
        _ => None,
    });
    talk.done(&subscribe(0));
    telemetry
}

/// Measured memory and instructions.
struct Found {
    flash: u64,
    /// Bytes of SRAM and core-coupled memory.
    ram: u64,
    stack: u32,
    block: u32,
    /// Instructions of each method: with the averaging band below the mode, and with all lines.
    methods: Vec<(Method, [u64; 2])>,
    /// Instructions of [`with_noise`].
    with_noise: [[u64; 2]; 2],
}

fn find_out() -> Found {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let bytes = fs::read(&elf).expect("the firmware can be read");
    let map = image::regions(include_str!("../../../memory.x"));
    let usages = image::usage(&bytes, &map).expect("an ELF for the chip");
    let used = |name: &str| -> u64 {
        let of_name = usages.iter().filter(|u| u.region.name == name);
        of_name.map(|u| u.used).sum()
    };
    let mut talk = Talk::boot_with(&["-icount", "shift=0"]);
    let mut block = 0;
    let mut methods: Vec<(Method, [u64; 2])> = Vec::new();
    for (column, band) in BANDS.into_iter().enumerate() {
        for (accelerations, group) in [
            (Accelerations::Interface, &METHODS[..1]),
            (Accelerations::All, &METHODS[1..]),
        ] {
            set_up(&mut talk, accelerations, 512.0, band);
            block = block.max(measure(&mut talk));
            for &method in group {
                let cost = identify(&mut talk, method, Procedure::Direct);
                // For the depth of the stack.
                identify(&mut talk, method, ITERATIVE);
                println!("{method:?} {cost} {}", stack(&mut talk).stack_used);
                match methods.iter_mut().find(|(m, _)| *m == method) {
                    Some((_, costs)) => costs[column] = cost,
                    None => methods.push((method, [cost, 0])),
                }
            }
        }
    }
    all_at_once(&mut talk);
    let stack = stack(&mut talk).stack_used;
    Found {
        flash: used("FLASH"),
        ram: used("RAM") + used("CCM"),
        stack,
        block,
        methods,
        // In a box of its own: the last one still takes inputs.
        with_noise: with_noise(&mut Talk::boot_with(&["-icount", "shift=0"])),
    }
}

fn table(found: &Found) -> String {
    let mut text = String::from("| what | found | budget |\n| --- | ---: | ---: |\n");
    let mut row = |what: &str, found: u64, budget: Option<u64>| {
        let budget = budget.map_or_else(|| "none".to_owned(), |b| b.to_string());
        let _ = writeln!(text, "| {what} | {found} | {budget} |");
    };
    let stack = u64::from(found.stack.max(STACK));
    row("flash, bytes", found.flash, Some(FLASH));
    row(
        "static variables in SRAM and core-coupled memory, bytes",
        found.ram,
        None,
    );
    row(
        "worst stack, no more than, bytes",
        stack,
        Some(STACK.into()),
    );
    row("both together, bytes", found.ram + stack, Some(MEMORY));
    row(
        "a block of 13 channels, 96 lines, instructions",
        found.block.into(),
        Some(BLOCK.into()),
    );
    for (method, costs) in &found.methods {
        let bands = ["39", "all 96"].into_iter().zip(IDENTIFICATIONS);
        for (cost, (band, budget)) in costs.iter().zip(bands) {
            let budget = (*method == Method::ApparentMass).then_some(budget);
            let what =
                format!("identification by {method:?}, averaged over {band} lines, instructions");
            row(&what, *cost, budget);
        }
    }
    let bodies = ["one mode", "two modes"].into_iter().zip(found.with_noise);
    for ((modes, costs), budgets) in bodies.zip(WITH_NOISE) {
        for ((band, cost), budget) in ["39", "all 96"].into_iter().zip(costs).zip(budgets) {
            let what = format!(
                "identification by ApparentMass with noise, {modes}, averaged over {band} lines, instructions"
            );
            row(&what, cost, Some(budget));
        }
    }
    text
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn memory_and_instructions_are_within_their_budgets() {
    let found = find_out();
    let report = table(&found);
    readme::compare("budgets", &report).unwrap_or_else(|error| panic!("{error}"));
    assert!(found.flash < FLASH, "{report}");
    assert!(found.stack <= STACK, "{report}");
    assert!(found.ram + u64::from(STACK) < MEMORY, "{report}");
    assert!(found.block <= BLOCK, "{report}");
    let (method, costs) = &found.methods[0];
    assert_eq!(*method, Method::ApparentMass);
    assert!(
        costs
            .iter()
            .zip(IDENTIFICATIONS)
            .all(|(cost, budget)| (1..=budget).contains(cost)),
        "{report}"
    );
    let noisy = found.with_noise.as_flattened();
    let mut pairs = noisy.iter().zip(WITH_NOISE.as_flattened());
    assert!(
        pairs.all(|(cost, budget)| (1..=*budget).contains(cost)),
        "{report}"
    );
}

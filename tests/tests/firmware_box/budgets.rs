//! Memory of the chip that the firmware takes, and cost of a block and of an identification there.
//!
//! With `-icount shift=0` every instruction takes a nanosecond of emulated time, and a tick is
//! one instruction, see `firmware/src/board/ticks.rs`.

use std::fmt::Write as _;
use std::fs;

use massline::device::firmware;
use massline_firmware::models::setup;
use massline_firmware::wire::{
    Accelerations, Event, FromBox, Gaps, Grid, Method, Packed, Procedure, Processing, Provoke,
    Reply, Request, Samples, Setting, Source, Stream, Subscription, Telemetry, Values,
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
/// A block of thirteen channels and 96 lines behind the window of Hann, instructions.
const BLOCK: u32 = 190_000;
/// Methods with so many modes that have a budget.
const BUDGETED: [(Method, usize); 2] = [(Method::ApparentMass, 1), (Method::ApparentMass, 2)];
/// Their identifications over 39 lines and over 96, instructions.
const IDENTIFICATIONS: [[u64; 2]; 2] = [[18_000_000, 23_000_000], [23_500_000, 30_000_000]];

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
/// Samples per second that the host sends: few, since the emulated port takes half a minute for a megabyte.
const RATE: f64 = 128.0;
/// Samples of a block, and of a run: three blocks that overlap by half.
const BLOCK_LENGTH: u32 = 256;
const SAMPLES: usize = 2 * BLOCK_LENGTH as usize;
/// At 512 samples/s and blocks of 1024, 0.5 to 48 Hz in steps of half a hertz.
const LINES: u32 = 96;

/// Requests of a set-up of six runs of thirteen channels and 96 lines, bands in Hz.
pub fn pieces(
    accelerations: Accelerations,
    sample_rate: f64,
    block_length: u32,
    averaging_band: [f64; 2],
    mut send: impl FnMut(&Request<'_>),
) {
    send(&Request::BeginSetup(setup::plan(RUNS, 0)));
    send(&Request::SetProcessing(Processing {
        sample_rate,
        block_length,
        kept_band: [1, LINES].map(|line| f64::from(line) * sample_rate / f64::from(block_length)),
        averaging_band,
        accelerations,
        minimum_weight: 1.0,
        ..setup::PROCESSING
    }));
    for sensor in setup::sensors(shaken::REACH, 1.0) {
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
    block_length: u32,
    averaging_band: [f64; 2],
) {
    pieces(
        accelerations,
        sample_rate,
        block_length,
        averaging_band,
        |request| talk.done(request),
    );
    let grid: Grid = talk.exchange(&Request::EndSetup, |reply| match reply {
        Reply::Grid(grid) => *grid,
        other => panic!("{other:?}"),
    });
    assert_eq!(grid.lines.count as u32, LINES);
}

/// Measures all runs of a body with one or two modes, and returns the instructions of the costliest block.
fn measure(talk: &mut Talk, modes: usize) -> u32 {
    let masses = [1.0, if modes == 2 { 1.0 } else { 0.0 }];
    let mut costliest = 0;
    let together = Samples::fit(setup::CHANNELS as u8, size_of::<f32>());
    for run in 0..RUNS {
        talk.done(&Request::Start(setup::start(
            run,
            Source::Host,
            Gaps::Refuse,
            None,
        )));
        let all = shaken::samples(run.into(), RATE, SAMPLES, masses);
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
                    costliest = costliest.max(block.ticks);
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
        let blocks = talk.exchange(&Request::Stop, |reply| match reply {
            Reply::Summary(summary) => summary.blocks,
            other => panic!("{other:?}"),
        });
        assert!(blocks >= 2, "run {run}: {blocks} blocks");
    }
    costliest
}

/// Instructions from request to answer.
fn identify(talk: &mut Talk, method: Method, procedure: Procedure, modes: usize) -> u64 {
    let question = Request::Identify(setup::question(method, procedure, modes as u8));
    talk.exchange(&question, |reply| match reply {
        Reply::Identified(found) => {
            let answer = &found.answer;
            assert!(answer.identification.mass.is_some(), "{answer:?}");
            if method == Method::ApparentMass {
                // Its cost is that of the modes that it finds.
                let poles = answer.findings.poles.iter().flatten().count();
                assert_eq!(poles, modes, "{answer:?}");
            }
            found.ticks
        }
        other => panic!("{method:?}: {other:?}"),
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
    identify(talk, Method::CurveFit, ITERATIVE, 1);
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
    /// Instructions of each method on a body with so many modes: with the averaging band below the modes, and
    /// with all lines.
    methods: Vec<(Method, usize, Vec<u64>)>,
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
    let mut methods: Vec<(Method, usize, Vec<u64>)> = Vec::new();
    // Only the recommended method can average over modes.
    let bands = [[1.0, 20.0], [0.5, 48.0]];
    let groups = [
        (1, Accelerations::Interface, &METHODS[..1], &bands[..]),
        (2, Accelerations::Interface, &METHODS[..1], &bands[..]),
        (1, Accelerations::All, &METHODS[1..], &bands[..1]),
    ];
    for (modes, accelerations, group, bands) in groups {
        for &band in bands {
            set_up(&mut talk, accelerations, RATE, BLOCK_LENGTH, band);
            block = block.max(measure(&mut talk, modes));
            for &method in group {
                let cost = identify(&mut talk, method, Procedure::Direct, modes);
                // For the depth of the stack.
                identify(&mut talk, method, ITERATIVE, modes);
                println!("{method:?} {modes} {cost} {}", stack(&mut talk).stack_used);
                match methods.iter_mut().find(|m| (m.0, m.1) == (method, modes)) {
                    Some((_, _, costs)) => costs.push(cost),
                    None => methods.push((method, modes, vec![cost])),
                }
            }
        }
    }
    all_at_once(&mut talk);
    Found {
        flash: used("FLASH"),
        ram: used("RAM") + used("CCM"),
        stack: stack(&mut talk).stack_used,
        block,
        methods,
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
    for (method, modes, costs) in &found.methods {
        for (column, (cost, band)) in costs.iter().zip(["39", "all 96"]).enumerate() {
            let number = match modes {
                1 => "a mode",
                _ => "two modes",
            };
            let what = format!(
                "identification by {method:?}, {number}, averaged over {band} lines, instructions"
            );
            let budget = BUDGETED.iter().position(|m| *m == (*method, *modes));
            row(&what, *cost, budget.map(|at| IDENTIFICATIONS[at][column]));
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
    for (budgeted, budgets) in BUDGETED.into_iter().zip(IDENTIFICATIONS) {
        let of = found.methods.iter().find(|m| (m.0, m.1) == budgeted);
        let (_, _, costs) = of.expect("it was measured");
        assert_eq!(costs.len(), budgets.len());
        let mut pairs = costs.iter().zip(budgets);
        assert!(
            pairs.all(|(cost, budget)| (1..=budget).contains(cost)),
            "{report}"
        );
    }
}

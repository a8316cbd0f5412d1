//! Cost of the costliest requests, each measured between two pings.
//!
//! An instruction is a tick. Between the answers of the pings lie the request's work, the bytes of
//! the request and of the second ping, at about 700 instructions each, and the emulator's waits for
//! its host. A long request is sent before the pings, so that it has arrived when they are
//! executed; and the shortest of several measurements counts. So the result is an upper bound of
//! the cost.

use std::fmt::Write as _;

use massline_firmware::models::setup;
use massline_firmware::wire::{
    Accelerations, ChannelRole, Count24, Event, FromBox, Gaps, Mount, Packed, Ping, Plan,
    Processing, Quantity, ReadLines, Reply, Request, Run, Samples, ScaleSource, Sensor, SensorKind,
    Source, Values,
};
use massline_tests::readme;

use crate::talk::Talk;

/// The costliest requests, with the most instructions for each: a million are 8 ms at 168 MHz, by
/// 1.3 cycles each. A budget is lowered freely, and raised only with the reason in the commit.
/// There is room for the arrival of bytes, which depends on the emulator's host: measured were
/// 0.07 million for `SetRun`, 14.8 for `EndSetup`, 4.4 for `Start`, 0.1 for `ReadLines`, 5.4 for
/// `Stop`, 4.2 and 4.9 for samples, and 0.03 for the gap.
const BUDGET: [(&str, u64); 8] = [
    (SET_RUN, 2_000_000),
    (END_SETUP, 20_000_000),
    (START, 10_000_000),
    (READ_LINES, 2_000_000),
    (STOP, 10_000_000),
    (BLOCKS_256, 6_000_000),
    (BLOCKS_64, 6_000_000),
    (GAP, 2_000_000),
];
const SET_RUN: &str = "SetRun of 48 channels";
const END_SETUP: &str = "EndSetup of 47 sensors and 6 runs";
const START: &str = "Start of a synthetic run";
const READ_LINES: &str = "ReadLines, as many as fit";
const STOP: &str = "Stop of a run of 100 lines";
const BLOCKS_256: &str = "Samples, the blocks of 256 that 109 of them complete";
const BLOCKS_64: &str = "Samples, the blocks of 64 that 109 of them complete";
const GAP: &str = "Samples, none, behind a gap of 2^60";
/// Number of measurements of each request.
const TIMES: usize = 5;
/// Sensors: all channels but the drive.
const SENSORS: u8 = 47;
/// Largest number of runs.
const RUNS: u8 = 6;

/// A set-up with the most checks, or one whose samples make the most blocks.
struct Setup {
    sensors: u8,
    runs: u8,
    block_length: u32,
    overlap: f64,
    kept_band: [f64; 2],
    averaging_band: [f64; 2],
}

/// The largest set-up.
const LARGEST: Setup = Setup {
    sensors: SENSORS,
    runs: RUNS,
    block_length: 1024,
    overlap: 0.5,
    kept_band: [0.5, 50.0],
    averaging_band: [1.0, 20.0],
};

/// A set-up of an accelerometer, a load cell and the drive, with the largest overlap of blocks.
const fn dense(block_length: u32, kept_band: [f64; 2]) -> Setup {
    Setup {
        sensors: 2,
        runs: 1,
        block_length,
        overlap: 0.95,
        kept_band,
        averaging_band: kept_band,
    }
}

fn send_pieces(talk: &mut Talk, setup: &Setup) {
    talk.done(&Request::BeginSetup(Plan {
        sensors: setup.sensors,
        ..setup::plan(setup.runs, 0)
    }));
    talk.done(&Request::SetProcessing(Processing {
        block_length: setup.block_length,
        overlap: setup.overlap,
        kept_band: setup.kept_band,
        averaging_band: setup.averaging_band,
        accelerations: Accelerations::All,
        minimum_weight: 1.0,
        ..setup::PROCESSING
    }));
    for sensor in 0..setup.sensors {
        let kind = match sensor % 2 {
            0 => SensorKind::Accelerometer(Mount::Structure),
            _ => SensorKind::LoadCell(Quantity::Force),
        };
        let place = f64::from(sensor / 2);
        talk.done(&Request::SetSensor(Sensor {
            sensor,
            name: "",
            kind,
            position: [0.1 * place, 0.3 - 0.05 * place, 0.01 * place * place],
            direction: [1.0, place - 3.0, 5.0 - place],
            scale: ScaleSource::Given {
                per_unit: 1.0,
                offset: 0.0,
            },
        }));
    }
    for number in 0..setup.runs.min(RUNS - 1) {
        talk.done(&Request::SetRun(run(number, &channels(setup))));
    }
}

fn channels(setup: &Setup) -> Vec<u8> {
    (0..setup.sensors)
        .chain([ChannelRole::Drive.code()])
        .collect()
}

fn run(number: u8, channels: &[u8]) -> Run<'_> {
    Run {
        rotation: [10.0 * f64::from(number), 5.0, 1.0],
        translation: [0.0, 0.1 * f64::from(number), 0.0],
        channels,
        ..setup::run(number)
    }
}

fn start(source: Source, limit: Option<u64>) -> Request<'static> {
    Request::Start(setup::start(0, source, Gaps::Count, limit))
}

/// Sends a request between two pings, behind `before`, and returns the instructions between the
/// pings. The request must not be refused.
fn cost(talk: &mut Talk, before: &[&Request<'_>], request: &Request<'_>) -> u64 {
    let mut bytes = Vec::new();
    for one in before {
        bytes.extend(talk.frame(one).1);
    }
    let ping = |stamp| Request::Ping(Ping { stamp });
    let ids = [&ping(0), request, &ping(1)].map(|one| {
        let (id, frame) = talk.frame(one);
        bytes.extend(frame);
        id
    });
    talk.send(&bytes);
    let mut begun = 0;
    talk.wait(|id, message| match message {
        FromBox::Reply(Reply::Pong(pong)) if id == ids[0] => {
            begun = pong.ticks;
            None
        }
        FromBox::Reply(Reply::Pong(pong)) if id == ids[2] => Some(pong.ticks - begun),
        FromBox::Reply(Reply::Error(refused)) if id == ids[1] => {
            panic!("{request:?}: {refused:?}")
        }
        _ => None,
    })
}

/// Sends samples, and returns the instructions of all the blocks that they complete, as counted by
/// the box: the emulated link takes longer for a thousand bytes.
fn blocks_of(talk: &mut Talk, samples: &Request<'_>) -> u64 {
    let sent = talk.request(samples);
    let mut instructions = 0;
    talk.wait(|id, message| match message {
        FromBox::Event(Event::Block(block)) => {
            instructions += u64::from(block.ticks);
            None
        }
        FromBox::Reply(reply) if id == sent => {
            assert!(matches!(reply, Reply::Progress(_)), "{reply:?}");
            Some(instructions)
        }
        _ => None,
    })
}

/// The costliest requests, with their descriptions.
fn measure(talk: &mut Talk) -> Vec<(&'static str, u64)> {
    let mut found: Vec<(&'static str, u64)> = Vec::new();
    let mut note = |what: &'static str, cost: u64| match found.iter_mut().find(|f| f.0 == what) {
        Some((_, least)) => *least = cost.min(*least),
        None => found.push((what, cost)),
    };
    for _ in 0..TIMES {
        // Without the last run, the box checks all others at the end of the set-up.
        let channels = channels(&LARGEST);
        let last = Request::SetRun(run(RUNS - 1, &channels));
        let begin = start(Source::Synthetic, Some(2400));
        let end = &Request::EndSetup;
        send_pieces(talk, &LARGEST);
        note(SET_RUN, cost(talk, &[end], &last));
        send_pieces(talk, &LARGEST);
        note(
            "EndSetup of 47 sensors and 6 runs",
            cost(talk, &[end, &last], end),
        );
        send_pieces(talk, &LARGEST);
        let begun = cost(talk, &[end, &last, end], &begin);
        note(START, begun);
        talk.event(|event| matches!(event, Event::RunEnded(_)).then_some(()));
        let read = Request::ReadLines(ReadLines {
            run: 0,
            first: 0,
            count: u16::MAX,
        });
        note(READ_LINES, cost(talk, &[], &read));
        talk.done(&start(Source::Synthetic, None));
        let mut blocks = 0;
        talk.event(|event| {
            blocks += u32::from(matches!(event, Event::Block(_)));
            (blocks == 3).then_some(())
        });
        note(
            "Stop of a run of 100 lines",
            cost(talk, &[], &Request::Stop),
        );
        for (what, setup) in [
            (BLOCKS_256, dense(256, [2.0, 200.0])),
            (BLOCKS_64, dense(64, [8.0, 224.0])),
        ] {
            send_pieces(talk, &setup);
            talk.exchange(&Request::EndSetup, |reply| {
                assert!(matches!(reply, Reply::Grid(_)), "{reply:?}");
            });
            talk.done(&start(Source::Host, None));
            let together = Samples::fit(3, 3);
            let mut number = 0_i32;
            let values: Vec<Count24> = (0..4 * 3 * together as i32)
                .map(|k| {
                    number = number.wrapping_mul(1_103_515_245).wrapping_add(12_345 + k);
                    Count24::nearest(number >> 8)
                })
                .collect();
            let message = |n: usize| {
                Request::Samples(Samples {
                    first: (n * together) as u64,
                    channels: 3,
                    values: Values::Counts24(Packed::new(
                        &values[3 * n * together..3 * (n + 1) * together],
                    )),
                })
            };
            // Blocks are complete once the first one is full.
            for n in 0..3 {
                talk.exchange(&message(n), |reply| {
                    assert!(matches!(reply, Reply::Progress(_)))
                });
            }
            note(what, blocks_of(talk, &message(3)));
            let far = Request::Samples(Samples {
                first: 1 << 60,
                channels: 3,
                values: Values::Counts24(Packed::new(&[])),
            });
            note(GAP, cost(talk, &[], &far));
            talk.done(&Request::Abort);
        }
    }
    found
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn no_request_costs_more_than_its_budget() {
    let mut talk = Talk::boot_with(&["-icount", "shift=0"]);
    let found = measure(&mut talk);
    let mut text = String::from("| request | instructions, at most |\n| --- | ---: |\n");
    for (what, most) in BUDGET {
        let cost = found.iter().find(|(name, _)| *name == what);
        let cost = cost.map_or(0, |(_, cost)| *cost);
        println!("{what} {cost}");
        assert!(
            (1..=most).contains(&cost),
            "{what}: {cost}, {most} are allowed"
        );
        let _ = writeln!(text, "| {what} | {most} |");
    }
    readme::compare("requests", &text).unwrap_or_else(|error| panic!("{error}"));
}

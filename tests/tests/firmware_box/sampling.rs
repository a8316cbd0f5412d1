//! Sampling continues under any traffic on the link.
//!
//! The emulator has no converters. In a test pattern a timer replaces their edges, and a known
//! pattern their counts; everything else is the code that samples on the board: the interrupt, the
//! acquisition, the queues, the instrument. With `-icount shift=0` an instruction takes a
//! nanosecond, and a period has 62 500 of them, as at 2700 samples/s on the board. A sample that is
//! not read in a period is lost. The emulated port takes a byte every 700 instructions or so, the
//! real one every 1800 cycles.

use massline_firmware::calibration::Preset;
use massline_firmware::models::{self, pattern};
use massline_firmware::wire::{
    Accelerations, Event, FaultCounters, FromBox, Gaps, Health, Input, Outcome, Ping, Problem,
    Provoke, Reply, Request, Samples, Setting, Source, Stream, Subscription, Summary, Values,
};

use crate::budgets::set_up;
use crate::talk::Talk;

/// Samples per second of the emulator's timer, whose second has 16 million ticks.
pub const RATE: f64 = 256.0;
/// Inputs that are wired, as many as the run has channels.
pub const INPUTS: u8 = 13;
/// Samples of the run: ten blocks, and those that fill the filters.
const SAMPLES: u64 = 6200;
/// Pings in flight: as many as the queue from the host holds, so that with bytes without end only
/// the box itself delays them.
const FLOOD: usize = 100;

/// Boots a box in which an instruction takes a nanosecond.
pub fn boot() -> Talk {
    Talk::boot_with(&["-icount", "shift=0,sleep=off"])
}

fn start() -> Request<'static> {
    Request::Start(models::setup::start(
        0,
        Source::Inputs,
        Gaps::Count,
        Some(SAMPLES),
    ))
}

/// Checks counts of recorded samples against the pattern; returns their number.
fn check(samples: &Samples<'_>) -> usize {
    let channels = usize::from(samples.channels);
    let of = |k: usize| match samples.values {
        Values::Counts(list) => list.get(k),
        Values::Counts24(list) => list.get(k).map(|count| count.get()),
        Values::Readings(_) => None,
    };
    let count = samples.count().expect("whole samples");
    for k in 0..count {
        let number = samples.first as u32 + k as u32;
        for input in 0..channels {
            let found = of(k * channels + input);
            let expected = pattern::count(number, input);
            assert_eq!(found, Some(expected), "sample {number}, input {input}");
        }
    }
    count
}

fn faults(talk: &mut Talk) -> FaultCounters {
    talk.hello(|info| info.faults)
}

/// Settings of the wired inputs.
pub fn inputs() -> impl Iterator<Item = Input<'static>> {
    let preset = Preset::bridge(500.0, 2e-3, 2.5).unwrap();
    (0..INPUTS).map(move |input| preset.input(input, "LC", "K", None, 1e-3))
}

/// Wires the inputs.
pub fn wire(talk: &mut Talk) {
    talk.done(&Request::WriteSetting(Setting::SampleRate(RATE)));
    for input in inputs() {
        talk.done(&Request::WriteSetting(Setting::Input(input)));
    }
}

/// A run of the inputs with this traffic beside it, until it has ended.
fn run(talk: &mut Talk, mut traffic: impl FnMut(&mut Talk) -> Option<u16>) -> (Summary, usize) {
    talk.done(&Request::Provoke(Provoke::TestPattern));
    wire(talk);
    set_up(talk, Accelerations::Interface, RATE, [1.0, 20.0]);
    talk.done(&Request::Subscribe(Subscription {
        telemetry: 100,
        levels: 100,
        samples: Stream::Counts,
    }));
    talk.done(&start());
    let mut recorded = 0;
    let mut last = traffic(talk);
    let summary = loop {
        let ended = talk.wait(|request, message| match message {
            FromBox::Event(Event::Recorded(samples)) => {
                recorded += check(samples);
                None
            }
            FromBox::Event(Event::RunEnded(summary)) => Some(Some(*summary)),
            FromBox::Reply(_) if Some(request) == last => Some(None),
            _ => None,
        });
        match ended {
            Some(summary) => break summary,
            None => last = traffic(talk),
        }
    };
    talk.done(&Request::Subscribe(Subscription::default()));
    (summary, recorded)
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn no_traffic_delays_a_sample() {
    let mut talk = boot();
    let mut pings = 0;
    let (summary, recorded) = run(&mut talk, |talk| {
        let mut bytes = Vec::new();
        let mut last = None;
        for _ in 0..FLOOD {
            pings += 1;
            let (id, frame) = talk.frame(&Request::Ping(Ping { stamp: pings }));
            bytes.extend(frame);
            // The costliest request, which a box with a run refuses at once.
            bytes.extend(talk.frame(&Request::EndSetup).1);
            // Half of the bytes are noise.
            bytes.extend((0..40_u8).map(|k| k.wrapping_mul(37) | 1));
            bytes.push(0);
            last = Some(id);
        }
        talk.send(&bytes);
        last
    });
    let taken = (summary.samples, summary.missing, summary.rejected);
    assert_eq!(taken, (SAMPLES, 0, 0), "{summary:?}");
    assert_eq!(summary.outcome, Outcome::Limit);
    assert!(summary.blocks >= 10);
    // The average of a run is concluded in 3 million instructions, 18 ms on the board and about 90
    // periods here. The samples meanwhile are not part of the run: those without room are counted.
    let counted = FaultCounters {
        overrun: 0,
        ..faults(&mut talk)
    };
    assert_eq!(counted, FaultCounters::default());
    println!("{SAMPLES} samples, {recorded} of them recorded, beside {pings} pings");
    // Their number depends on this machine, since the emulator runs as fast as it can: about a
    // thousand.
    assert!(pings >= 2 * FLOOD as u64, "{pings}");
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn every_recorded_sample_is_the_one_of_its_number() {
    let mut talk = boot();
    let (summary, recorded) = run(&mut talk, |_| None);
    assert_eq!((summary.samples, summary.missing), (SAMPLES, 0));
    assert_eq!(summary.health, Health::GOOD);
    // An event holds 840 bytes, 21 samples of thirteen channels with three bytes each; the last one
    // may come behind the end.
    assert!(recorded as u64 > SAMPLES - 21, "{recorded}");
    // By the clock of the test pattern, in whole ticks.
    let rate = summary.sample_rate.expect("the box has measured it");
    assert_eq!(rate, RATE);
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn a_box_without_converters_reports_it() {
    let mut talk = boot();
    wire(&mut talk);
    set_up(&mut talk, Accelerations::Interface, RATE, [1.0, 20.0]);
    let problem = talk.exchange(&start(), |reply| match reply {
        Reply::Error(refused) => refused.problem,
        other => panic!("{other:?}"),
    });
    let Problem::Converter { converter, .. } = problem else {
        panic!("{problem:?}");
    };
    assert_eq!(converter, 0);
}

//! A hostile host against the firmware: a run of the inputs continues under any frames but those
//! that are documented to end it, and has the same results, to the last bit, as an instrument on
//! this machine with the same samples and no other frames.
//!
//! The emulated port takes some 20 kB/s, so that the short form sends a few thousand frames. The
//! long one, after `cargo xtask test --only firmware` has built the ELF (a quarter of an hour):
//!
//! ```text
//! MASSLINE_FRAMES=100_000 cargo test --release --test firmware_box -- --ignored --nocapture hostile
//! ```

use massline_firmware::acquisition::SETTLING;
use massline_firmware::calibration::Certificate;
use massline_firmware::models::pattern;
use massline_firmware::wire::{
    Accelerations, Direction, Event, FromBox, Gaps, Header, Line, Lines, Outcome, Ping, Problem,
    Provoke, ReadLines, Reply, Request, Samples, Source, Status, Stream, Subscription, Summary,
    ToBox, Values,
};

use crate::bench::{self, Bench, Said};
use crate::budgets::pieces;
use crate::frames::{Piece, corpus, damage, piece};
use crate::random::{Random, wanted};
use crate::reference;
use crate::sampling::{INPUTS, RATE, boot, inputs, wire};
use crate::talk::Talk;

/// Frames between two pings: fewer bytes than the box's buffer, so that no ping is lost.
const TOGETHER: u64 = 20;
/// The averaging band, Hz.
const BAND: [f64; 2] = [1.0, 20.0];

fn start(source: Source) -> Request<'static> {
    Request::Start(bench::start(0, source, Gaps::Count, None))
}

/// `true` if a piece is a request that is documented to end a run.
fn is_documented(piece: &Piece, header: &Header) -> bool {
    match ToBox::read(header, &piece.payload) {
        Ok(Request::Stop | Request::Abort | Request::Reboot) => true,
        Ok(Request::Provoke(fault)) => fault != Provoke::TestPattern,
        _ => false,
    }
}

/// Requests that fit the box's state: subscriptions, starts, and samples of as many channels.
fn fitting(random: &mut Random, keep: &mut dyn FnMut(&Request<'_>)) {
    let counts = [7; 2 * INPUTS as usize];
    let count = random.index(3);
    keep(&Request::Samples(Samples {
        first: random.pick(&[0, 1000, 1 << 60, u64::MAX]),
        channels: INPUTS,
        values: Values::Counts(massline_firmware::wire::Packed::new(
            &counts[..count * usize::from(INPUTS)],
        )),
    }));
    for source in [Source::Host, Source::Inputs, Source::Synthetic] {
        keep(&start(source));
    }
    keep(&Request::Subscribe(Subscription {
        telemetry: 1,
        levels: 1,
        samples: random.pick(&[Stream::Off, Stream::Readings, Stream::Counts]),
    }));
    for input in inputs() {
        keep(&Request::WriteSetting(
            massline_firmware::wire::Setting::Input(input),
        ));
    }
}

/// Waits for the answer to a ping; no run may end before, and the box must not restart.
fn wait_for(talk: &mut Talk, ping: u16) {
    talk.wait(|request, message| match message {
        FromBox::Event(event @ (Event::RunEnded(_) | Event::Started(_) | Event::Fault(_))) => {
            panic!("{event:?}")
        }
        FromBox::Reply(Reply::Pong(_)) if request == ping => Some(()),
        _ => None,
    });
}

fn attack(talk: &mut Talk, frames: u64) {
    let mut random = Random::new(5);
    let corpus = corpus(&mut random, fitting);
    let mut sent = 0;
    while sent < frames {
        let mut bytes = Vec::new();
        for _ in 0..TOGETHER {
            let piece = piece(&corpus, &mut random);
            // The header is that of this host's next frame, except for its kind.
            let (id, envelope) = talk.frame(&Request::Hello);
            let body = reference::unstuffed(&envelope[1..envelope.len() - 1]);
            let body = body.expect("whole groups");
            let mut header = *body.first_chunk().expect("a header");
            header[1] = piece.number;
            let read = Header {
                version: header[0],
                number: piece.number,
                session: 0,
                sequence: 0,
                request: id,
            };
            if is_documented(&piece, &read) {
                continue;
            }
            let mut frame = reference::frame(&header, &piece.payload);
            damage(&mut frame, &mut random);
            bytes.extend(frame);
            sent += 1;
        }
        let (ping, frame) = talk.frame(&Request::Ping(Ping { stamp: sent }));
        bytes.extend(frame);
        talk.send(&bytes);
        wait_for(talk, ping);
    }
}

fn status(talk: &mut Talk) -> Status {
    talk.exchange(&Request::Status, |reply| match reply {
        Reply::Status(status) => *status,
        other => panic!("{other:?}"),
    })
}

fn stop(talk: &mut Talk) -> Summary {
    talk.exchange(&Request::Stop, |reply| match reply {
        Reply::Summary(summary) => *summary,
        other => panic!("{other:?}"),
    })
}

fn lines(talk: &mut Talk) -> Vec<Line> {
    let mut all = Vec::new();
    loop {
        let read = ReadLines {
            run: 0,
            first: all.len() as u16,
            count: Lines::FIT as u16,
        };
        let more = talk.exchange(&Request::ReadLines(read), |reply| match reply {
            Reply::Lines(lines) => Some(lines.lines.iter().collect::<Vec<_>>()),
            Reply::Error(refused) => {
                assert!(matches!(refused.problem, Problem::Index { .. }));
                None
            }
            other => panic!("{other:?}"),
        });
        match more {
            Some(more) => all.extend(more),
            None => return all,
        }
    }
}

/// Results of an instrument on this machine for the first samples of the pattern.
fn undisturbed(bench: &mut Bench, samples: u64) -> (Summary, Vec<Line>) {
    pieces(Accelerations::Interface, RATE, BAND, |request| {
        bench.done(request);
    });
    let said = bench.ask(&Request::EndSetup);
    assert!(matches!(said, Said::Grid(_)), "{said:?}");
    bench.done(&start(Source::Inputs));
    for n in 0..samples {
        let number = u64::from(SETTLING) + 1 + n;
        let counts: Vec<i32> = (0..usize::from(INPUTS))
            .map(|input| pattern::count(number as u32, input))
            .collect();
        bench.convert(number, &counts, &[]);
        bench.events();
    }
    let summary = bench.stop();
    (summary, bench.lines(0))
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn hostile_frames_neither_stop_a_run_nor_change_its_numbers() {
    let mut talk = boot();
    talk.done(&Request::Provoke(Provoke::TestPattern));
    wire(&mut talk);
    crate::budgets::set_up(&mut talk, Accelerations::Interface, RATE, BAND);
    talk.done(&start(Source::Inputs));
    attack(&mut talk, wanted("MASSLINE_FRAMES", 3000));
    // Enough for some blocks, at any speed of the emulator.
    while status(&mut talk).running.expect("the run goes on").blocks < 3 {}
    let summary = stop(&mut talk);
    let found = lines(&mut talk);
    println!("{} samples, {} blocks", summary.samples, summary.blocks);
    let certificates = inputs().map(|input| Certificate::new(&input).expect("it is sound"));
    let mut bench = Bench::with_inputs(&certificates.collect::<Vec<_>>());
    let (expected, expected_lines) = undisturbed(&mut bench, summary.samples);
    let expected = Summary {
        // Each by its own clock, which count differently.
        sample_rate: summary.sample_rate,
        ..expected
    };
    assert_eq!((summary.outcome, summary.missing), (Outcome::Stopped, 0));
    assert_eq!(summary, expected);
    assert_eq!(found, expected_lines);
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn a_run_without_an_end_leaves_every_task_its_turn() {
    let mut talk = boot();
    crate::budgets::set_up(&mut talk, Accelerations::Interface, 512.0, BAND);
    talk.done(&start(Source::Synthetic));
    talk.done(&Request::Subscribe(Subscription {
        telemetry: 10_000,
        ..Subscription::default()
    }));
    // Most tasks must answer once a second of 168 million cycles, which the emulator takes for a
    // thousand million instructions. By the box's clock of 16 MHz ten seconds are 160 million of
    // them, and twelve such times two thousand million: one second, and nearly another.
    let mut told = 0;
    talk.wait(|_, message| match message {
        FromBox::Event(Event::Telemetry(_)) => {
            told += 1;
            (told == 12).then_some(())
        }
        FromBox::Event(event @ (Event::Started(_) | Event::RunEnded(_))) => panic!("{event:?}"),
        _ => None,
    });
    assert_eq!(stop(&mut talk).outcome, Outcome::Stopped);
    talk.hello(|info| assert_eq!((info.resets, info.panic), (0, None)));
}

//! A host that means harm: whatever frames it sends short of those that are documented to end a
//! run, the run goes on and its numbers are those of a run that was left alone.
//!
//! The short form runs with all tests. The long one, with overflow checks, and with its numbers
//! shown:
//!
//! ```text
//! MASSLINE_FRAMES=10_000_000 cargo test --profile checked -p massline-firmware --test protocol -- --nocapture hostile
//! ```

use crate::bench::{Bench, INPUTS, MILLISECOND, Said, start};
use crate::frames::{Piece, corpus, damage, piece};
use crate::plan::{CHANNELS, Pieces, counts, ready};
use crate::random::{Random, wanted};
use crate::reference;
use massline_firmware::wire::*;

/// Samples of a run: the filters, one block, and four that overlap.
const SAMPLES: u64 = 4000;
/// Frames of a run, spread over it.
const FRAMES: u64 = 100_000;

const SOURCES: [Source; 3] = [Source::Inputs, Source::Host, Source::Synthetic];

/// Requests that fit the box as it is: samples of as many channels, ahead and behind, many, few
/// and none, and the pieces of its set-up.
fn fitting(random: &mut Random, keep: &mut dyn FnMut(&Request<'_>)) {
    let pieces = Pieces::new();
    let first = random.index(2 * SAMPLES as usize) as u64;
    let values: Vec<i32> = (0..random.index(4))
        .flat_map(|n| counts(n as u64))
        .collect();
    keep(&Request::Samples(Samples {
        first: random.pick(&[first, 1 << 60, u64::MAX]),
        channels: CHANNELS as u8,
        values: Values::Counts(Packed::new(&values)),
    }));
    let run = random.index(3) as u8;
    for source in SOURCES {
        keep(&Request::Start(start(run, source, Gaps::Count, None)));
    }
    keep(&Request::BeginSetup(pieces.plan));
    keep(&Request::SetRun(pieces.run(run)));
    keep(&Request::SetSensor(random.pick(&pieces.sensors)));
    keep(&Request::Subscribe(Subscription {
        telemetry: 1,
        levels: 1,
        samples: random.pick(&[
            Stream::Off,
            Stream::Readings,
            Stream::Counts,
            Stream::Test(Conditions::default()),
        ]),
    }));
}

/// `true` for a request that is documented to end a run, or has the very samples that a run of
/// the host's waits for, which begin with number `next`.
fn is_documented(request: &Request<'_>, source: Source, next: u64) -> bool {
    match request {
        Request::Stop | Request::Abort | Request::Reboot => true,
        Request::Provoke(fault) => *fault != Provoke::TestPattern,
        Request::Samples(samples) => {
            let count = samples.count().unwrap_or(0) as u64;
            let end = samples.first.saturating_add(count);
            source == Source::Host && samples.first <= next && next < end
        }
        _ => false,
    }
}

/// Counts of frames of each kind.
#[derive(Debug, Default)]
struct Tally {
    frames: u64,
    /// Sound, new and in order.
    taken: u64,
    requests: u64,
    done: u64,
    documented: u64,
}

struct Hostile<'c> {
    corpus: &'c [Piece],
    random: Random,
    session: u16,
    sequence: u32,
    tally: Tally,
}

impl Hostile<'_> {
    /// The next frame, now and then of another session, or with any number.
    fn frame(&mut self) -> Vec<u8> {
        let random = &mut self.random;
        let Piece { number, payload } = piece(self.corpus, random);
        self.sequence = self.sequence.wrapping_add(1);
        let mut header = reference::header(number, self.sequence, 1 + random.index(60_000) as u16);
        header[2..4].copy_from_slice(&self.session.to_le_bytes());
        if random.once_in(32) {
            let at = random.index(HEADER);
            header[at] = random.bits() as u8;
            // Whoever hears of another session or of a number far ahead takes no more of these.
            self.session = self.session.wrapping_add(1);
            self.sequence = random.bits() as u32;
        }
        let mut frame = reference::frame(&header, &payload);
        damage(&mut frame, random);
        frame
    }

    fn attack(
        &mut self,
        receiver: &mut Receiver<'_, ToBox>,
        bench: &mut Bench,
        (source, next): (Source, u64),
        frames: u64,
    ) {
        for _ in 0..frames {
            self.tally.frames += 1;
            let bytes = self.frame();
            let mut rest = &bytes[..];
            while let Some(received) = receiver.next(&mut rest) {
                self.tally.taken += 1;
                let Received::Message(header, request) = received else {
                    continue;
                };
                if is_documented(&request, source, next) {
                    self.tally.documented += 1;
                    continue;
                }
                self.tally.requests += 1;
                bench.hear(header.request, &request);
                let replies = core::mem::take(&mut bench.host.replies);
                let [(id, said)] = replies.as_slice() else {
                    panic!("{request:?} had {} replies", replies.len());
                };
                assert_eq!(*id, header.request);
                self.tally.done += u64::from(!matches!(said, Said::Refused(_)));
            }
            if self.random.once_in(64) {
                bench.hardware.ticks += MILLISECOND;
                bench.host.events.clear();
            }
        }
    }
}

/// A run that is attacked by so many frames, or left alone.
fn run(
    bench: &mut Bench,
    source: Source,
    hostile: Option<(&mut Hostile<'_>, u64)>,
) -> (Summary, Vec<Line>) {
    bench.start(0, source, Gaps::Refuse, None);
    bench.hardware.ticks = 0;
    let mut body = [0; BODY_MAX];
    let mut receiver = Receiver::new(&mut body);
    let (mut hostile, frames) = match hostile {
        Some((hostile, frames)) => (Some(hostile), frames),
        None => (None, 0),
    };
    let mut sent = 0;
    for n in 0..SAMPLES {
        if let Some(hostile) = &mut hostile {
            let due = frames * (n + 1) / SAMPLES;
            hostile.attack(&mut receiver, bench, (source, n), due - sent);
            sent = due;
        }
        bench.hardware.ticks = 2 * n * MILLISECOND;
        match source {
            Source::Inputs => {
                let mut all = [0; INPUTS as usize];
                all[..CHANNELS].copy_from_slice(&counts(n));
                let health = [Health(u16::from(n == 1000)); INPUTS as usize];
                bench.convert(7 + n + u64::from(n > 2000), &all, &health);
            }
            Source::Host => {
                let said = crate::plan::feed(bench, n, n + 1);
                let taken = Progress {
                    next: n + 1,
                    missing: 0,
                };
                assert_eq!(said, Said::Progress(taken));
            }
            Source::Synthetic => {
                // Eight samples a call.
                if n % 8 == 0 {
                    bench.poll();
                }
            }
        }
        bench.events();
    }
    let running = bench.status().running.expect("the run goes on");
    assert!(running.next >= SAMPLES, "{running:?}");
    let summary = bench.stop();
    (summary, bench.lines(0))
}

#[test]
fn hostile_frames_neither_stop_a_run_nor_change_its_numbers() {
    let all = wanted("MASSLINE_FRAMES", 300_000);
    let mut random = Random::new(9);
    let corpus = corpus(&mut random, fitting);
    let mut hostile = Hostile {
        corpus: &corpus,
        random,
        session: 1,
        sequence: 0,
        tally: Tally::default(),
    };
    let mut bench = ready();
    let left_alone = SOURCES.map(|source| run(&mut bench, source, None));
    for (summary, lines) in &left_alone {
        assert!(summary.blocks >= 2 && !lines.is_empty(), "{summary:?}");
    }
    let settings = bench.hardware.settings.clone();
    while hostile.tally.frames < all {
        for (source, expected) in SOURCES.into_iter().zip(&left_alone) {
            let frames = (all / 3).clamp(1, FRAMES);
            let found = run(&mut bench, source, Some((&mut hostile, frames)));
            assert_eq!(found, *expected, "{source:?}");
            assert_eq!(bench.hardware.settings, settings);
        }
    }
    let tally = hostile.tally;
    println!("{tally:?}");
    // The attack is what it claims to be: most frames are sound, many are requests, and some are
    // even granted.
    assert!(2 * tally.taken > tally.frames, "{tally:?}");
    assert!(5 * tally.requests > tally.frames, "{tally:?}");
    assert!(20 * tally.done > tally.frames, "{tally:?}");
    assert_eq!(
        (bench.hardware.resets, bench.hardware.test_patterns),
        (0, 0)
    );
}

//! A run from start to stop, what it says on its way, and what it leaves.

use crate::bench::{Bench, Heard, MILLISECOND, Said};
use crate::plan::{CHANNELS, assert_same_shares, feed, ready};
use massline_firmware::wire::*;

fn blocks(events: &[Heard]) -> Vec<Block> {
    let block = |e: &Heard| match e {
        Heard::Block(block) => Some(*block),
        _ => None,
    };
    events.iter().filter_map(block).collect()
}

/// The reply to samples.
fn taken(next: u64, missing: u64) -> Said {
    Said::Progress(Progress { next, missing })
}

#[test]
fn blocks_are_told_as_they_come_and_the_summary_counts_them() {
    let mut bench = ready();
    bench.start(1, Source::Host, Gaps::Refuse, None);
    assert_eq!(feed(&mut bench, 0, 4000), taken(4000, 0));
    let running = bench.status().running.unwrap();
    let told = blocks(&bench.events());
    assert!(told.len() >= 5);
    assert_eq!((running.next, running.blocks), (4000, told.len() as u32));
    for (n, block) in told.iter().enumerate() {
        assert_eq!(
            (block.run, block.block, block.averaged),
            (1, n as u32, n as u32 + 1)
        );
        assert!(block.health.is_good());
        // One block always agrees with itself.
        assert_eq!(block.coherence.is_some(), n > 0);
    }
    let [first, second] = [told[0].first, told[1].first];
    assert_eq!(second - first, 512);
    // Every channel is a share of the drive.
    let coherence = told[4].coherence.unwrap();
    assert!(coherence.iter().all(|c| *c > 0.999_99), "{coherence:?}");
    let summary = bench.stop();
    assert_eq!(summary.outcome, Outcome::Stopped);
    assert_eq!((summary.samples, summary.missing), (4000, 0));
    assert_eq!((summary.blocks, summary.rejected), (told.len() as u32, 0));
    assert!(summary.noise.is_some());
    // Asked again, it says the same.
    assert_eq!(bench.ask(&Request::Stop), Said::Summary(summary));
    assert_eq!(bench.ask(&Request::ReadSummary(1)), Said::Summary(summary));
    assert_eq!(bench.status().stored, 1 << 1);
    assert_eq!(bench.lines(1).len(), 80);
}

#[test]
fn a_run_ends_by_itself_at_its_limit() {
    let mut bench = ready();
    bench.start(0, Source::Host, Gaps::Refuse, Some(3000));
    assert_eq!(feed(&mut bench, 0, 3000), taken(3000, 0));
    let events = bench.events();
    let Some(Heard::RunEnded(summary)) = events.last() else {
        panic!("{:?}", events.last());
    };
    assert_eq!((summary.outcome, summary.samples), (Outcome::Limit, 3000));
    assert_eq!(bench.status().state, State::Ready);
    // The last request, sent again because its reply was lost.
    assert_eq!(feed(&mut bench, 2999, 3000), taken(3000, 0));
    assert_eq!(bench.ask(&Request::Stop), Said::Summary(*summary));
}

#[test]
fn an_aborted_run_leaves_nothing() {
    let mut bench = ready();
    bench.start(0, Source::Host, Gaps::Refuse, None);
    feed(&mut bench, 0, 3000);
    bench.done(&Request::Abort);
    assert_eq!(bench.status().stored, 0);
    let missing = Problem::missing(Item::Summary, 0);
    assert_eq!(bench.refused(&Request::ReadSummary(0)), missing);
}

#[test]
fn samples_that_come_twice_count_once() {
    let mut all = Vec::new();
    for back in [0, 300] {
        let mut bench = ready();
        bench.start(0, Source::Host, Gaps::Refuse, None);
        feed(&mut bench, 0, 2000);
        feed(&mut bench, 2000 - back, 3500);
        let summary = bench.ask(&Request::Stop);
        all.push((summary, bench.lines(0)));
    }
    assert_eq!(all[0], all[1]);
}

#[test]
fn a_gap_is_refused_where_the_host_can_send_again() {
    let mut bench = ready();
    bench.start(0, Source::Host, Gaps::Refuse, None);
    feed(&mut bench, 0, 100);
    let gap = Problem::Gap {
        found: 101,
        expected: 100,
    };
    assert_eq!(feed(&mut bench, 101, 102), Said::Refused(gap));
    assert_eq!(feed(&mut bench, 100, 101), taken(101, 0));
    // Half a sample would shift every channel behind it.
    let values = [1, 2, 3, 4, 5, 6, 7];
    for channels in [CHANNELS as u8, 7] {
        let problem = bench.refused(&Request::Samples(Samples {
            first: 101,
            channels,
            values: Values::Counts(Packed::new(&values)),
        }));
        assert!(matches!(
            problem,
            Problem::Count {
                item: Item::Channel,
                ..
            }
        ));
    }
}

#[test]
fn a_gap_that_is_counted_costs_its_block_and_shifts_no_channel() {
    let mut bench = ready();
    bench.start(0, Source::Host, Gaps::Count, None);
    feed(&mut bench, 0, 6000);
    let whole = bench.stop();
    let expected = bench.lines(0);
    bench.events();
    bench.start(1, Source::Host, Gaps::Count, None);
    feed(&mut bench, 0, 2100);
    // Of a number of samples that no number of channels divides.
    assert_eq!(feed(&mut bench, 2117, 2118), taken(2118, 17));
    feed(&mut bench, 2118, 6000);
    let told = blocks(&bench.events());
    let bad: Vec<&Block> = told.iter().filter(|b| !b.health.is_good()).collect();
    let [bad] = bad.as_slice() else {
        panic!("{bad:?}");
    };
    assert_eq!(bad.health, Health::MISSING);
    let after = told[bad.block as usize + 1];
    assert!(after.first >= 2117 && after.health.is_good());
    let summary = bench.stop();
    assert_eq!((summary.missing, summary.samples), (17, 6000 - 17));
    assert_eq!((summary.rejected, summary.rejected_by[1]), (1, 1));
    assert_eq!(summary.health, Health::MISSING);
    assert!(summary.blocks < whole.blocks);
    // Each resultant still is the same share of the drive.
    assert_same_shares(&expected, &bench.lines(1));
}

/// An empty message of that number.
fn nothing(first: u64) -> Request<'static> {
    Request::Samples(Samples {
        first,
        channels: CHANNELS as u8,
        values: Values::Counts(Packed::new(&[])),
    })
}

#[test]
fn a_message_without_samples_is_a_gap_like_any_other() {
    let mut bench = ready();
    bench.start(0, Source::Host, Gaps::Refuse, None);
    feed(&mut bench, 0, 100);
    // Where the run is, or behind it, there is nothing to do.
    for first in [0, 99, 100] {
        assert_eq!(bench.ask(&nothing(first)), taken(100, 0));
    }
    for ahead in [1, 1000, 1 << 60, u64::MAX - 100] {
        let found = 100 + ahead;
        let expected = 100;
        let gap = Problem::Gap { found, expected };
        assert_eq!(bench.refused(&nothing(found)), gap);
    }
    assert_eq!(bench.status().running.unwrap().next, 100);
    bench.done(&Request::Abort);
    // Where gaps are counted, one of any length is one block that is thrown away.
    bench.start(0, Source::Host, Gaps::Count, None);
    feed(&mut bench, 0, 100);
    bench.events();
    let far = [101, 5000, 1 << 60, u64::MAX - 1, u64::MAX];
    for first in far {
        assert_eq!(bench.ask(&nothing(first)), taken(first, first - 100));
    }
    assert_eq!(blocks(&bench.events()).len(), far.len());
    // There is no number behind the last one.
    let beyond = feed(&mut bench, u64::MAX, u64::MAX);
    assert_eq!(beyond, Said::Done, "nothing was sent");
    let one = Request::Samples(Samples {
        first: u64::MAX,
        channels: CHANNELS as u8,
        values: Values::Counts(Packed::new(&[1; CHANNELS])),
    });
    assert!(matches!(
        bench.refused(&one),
        Problem::Range {
            field: Field::Limit,
            ..
        }
    ));
    let summary = bench.stop();
    assert_eq!((summary.samples, summary.missing), (100, u64::MAX - 100));
    assert_eq!(summary.rejected, far.len() as u32);
}

#[test]
fn a_gap_beyond_the_limit_ends_the_run_and_may_be_told_again() {
    let mut bench = ready();
    let limit = Some(3000);
    bench.start(0, Source::Host, Gaps::Count, limit);
    feed(&mut bench, 0, 2990);
    for _ in 0..2 {
        assert_eq!(bench.ask(&nothing(1 << 60)), taken(3000, 10));
        assert_eq!(bench.status().state, State::Ready);
    }
    let summary = bench.stop();
    assert_eq!((summary.outcome, summary.samples), (Outcome::Limit, 2990));
    // The same of a message that has samples on both sides of the limit.
    bench.start(1, Source::Host, Gaps::Refuse, limit);
    feed(&mut bench, 0, 2990);
    let values: Vec<i32> = (2980..3010).flat_map(crate::plan::counts).collect();
    let across = Request::Samples(Samples {
        first: 2980,
        channels: CHANNELS as u8,
        values: Values::Counts(Packed::new(&values)),
    });
    for _ in 0..2 {
        assert_eq!(bench.ask(&across), taken(3000, 0));
    }
    let summary = bench.summary(&Request::ReadSummary(1));
    assert_eq!((summary.missing, summary.samples), (0, 3000));
    assert!(matches!(
        bench.refused(&nothing(3001)),
        Problem::State { .. }
    ));
}

#[test]
fn telemetry_comes_as_often_as_it_was_asked_for() {
    let mut bench = Bench::switch_on();
    bench.done(&Request::Subscribe(Subscription {
        telemetry: 100,
        ..Subscription::default()
    }));
    bench.poll();
    bench.events();
    let tenth = 100 * MILLISECOND;
    for (ticks, told) in [
        (1, 0),
        (tenth - 2, 0),
        (1, 1),
        (0, 0),
        (tenth - 1, 0),
        (9, 1),
    ] {
        bench.hardware.ticks += ticks;
        bench.poll();
        let events = bench.events();
        let telemetry = events.iter().filter(|e| matches!(e, Heard::Telemetry));
        assert_eq!(telemetry.count(), told, "at {}", bench.hardware.ticks);
    }
}

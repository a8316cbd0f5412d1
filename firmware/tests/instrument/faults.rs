//! A bad sample never reaches an average, and every result says what was left out.

use crate::bench::{Bench, Heard, INPUTS, Said};
use crate::plan::{CHANNELS, SENSORS, assert_same_shares, counts, ready};
use massline_firmware::models::setup::question;
use massline_firmware::wire::*;

const KINDS: [Health; Health::KINDS] = [
    Health::OVERLOAD,
    Health::MISSING,
    Health::CHECKSUM,
    Health::OPEN,
    Health::STUCK,
    Health::OUT_OF_STEP,
    Health::CONVERTER_RESET,
    Health::NOT_FINITE,
];

/// A run on the box's converters; `change` has the counts and faults of a sample in hand.
fn run(
    bench: &mut Bench,
    run: u8,
    mut change: impl FnMut(u64, &mut [i32], &mut [Health]) -> bool,
) -> Summary {
    bench.start(run, Source::Inputs, Gaps::Count, None);
    assert_eq!(bench.hardware.converting, Some(512.0));
    for n in 0..6000 {
        let mut all = [0; INPUTS as usize];
        all[..CHANNELS].copy_from_slice(&counts(n));
        let mut health = [Health::GOOD; INPUTS as usize];
        if change(n, &mut all, &mut health) {
            // The converters have run since long before.
            bench.convert(70_000 + n, &all, &health);
        }
    }
    bench.stop()
}

/// Indices of the first samples of rejected blocks, with the reasons.
fn rejected(bench: &mut Bench) -> Vec<(u64, Health)> {
    let events = bench.events();
    let block = |e: &Heard| match e {
        Heard::Block(b) if !b.health.is_good() => Some((b.first, b.health)),
        _ => None,
    };
    events.iter().filter_map(block).collect()
}

#[test]
fn each_fault_costs_the_blocks_it_lies_in_and_is_told_by_its_name() {
    let mut bench = ready();
    let whole = run(&mut bench, 0, |_, _, _| true);
    let expected = bench.lines(0);
    assert_eq!((whole.rejected, whole.samples), (0, 6000));
    for (k, kind) in KINDS.into_iter().enumerate() {
        bench.events();
        // A reading that would be seen from afar if it got into an average.
        let summary = run(&mut bench, 1, |n, counts, health| {
            if n == 3000 {
                counts[4] = 8_000_000;
                health[4] = kind;
            }
            true
        });
        let bad = rejected(&mut bench);
        assert!(
            !bad.is_empty()
                && bad.iter().all(|(first, why)| {
                    // A filter remembers, so that a block begins before its first window sample.
                    (*first..first + 2048).contains(&3000) && *why == kind
                }),
            "{kind:?}: {bad:?}"
        );
        assert_eq!(summary.rejected, bad.len() as u32);
        assert_eq!(summary.blocks + summary.rejected, whole.blocks);
        let mut by = [0; Health::KINDS];
        by[k] = summary.rejected;
        assert_eq!((summary.rejected_by, summary.health), (by, kind));
        assert_eq!(summary.overloads, u64::from(kind == Health::OVERLOAD));
        assert_same_shares(&expected, &bench.lines(1));
    }
}

#[test]
fn every_answer_says_what_was_rejected_and_why() {
    let mut bench = ready();
    run(&mut bench, 0, |n, _, health| {
        if n == 2000 {
            health[0] = Health::CHECKSUM;
        }
        true
    });
    let other = run(&mut bench, 1, |n, _, health| {
        if n == 2500 {
            health[SENSORS] = Health::CHECKSUM.union(Health::OUT_OF_STEP);
        }
        n != 4000
    });
    // Interface accelerometers alone are none of method a's runs.
    let unfit = question(Method::FrequencyResponses, Procedure::Direct, 0);
    let refused = bench.refused(&Request::Identify(unfit));
    assert!(
        matches!(refused, Problem::Accelerations { run: 0, .. }),
        "{refused:?}"
    );
    let found = bench.identify(question(Method::ApparentMass, Procedure::Direct, 0));
    let quality = found.answer.quality;
    let first = bench.summary(&Request::ReadSummary(0));
    assert_eq!(quality.blocks, first.blocks + other.blocks);
    assert_eq!(quality.rejected, first.rejected + other.rejected);
    assert_eq!((quality.missing, other.missing), (1, 1));
    for (k, by) in quality.rejected_by.iter().enumerate() {
        assert_eq!(*by, first.rejected_by[k] + other.rejected_by[k]);
    }
    let [missing, checksum, step] = [1, 2, 5].map(|k| quality.rejected_by[k]);
    assert!(missing == 1 && checksum > step && step > 0, "{quality:?}");
    let all = Health::CHECKSUM.union(Health::OUT_OF_STEP);
    assert_eq!(quality.health, all.union(Health::MISSING));
    // It can be read again.
    assert_eq!(bench.ask(&Request::ReadAnswer), Said::Identified(found));
}

#[test]
fn a_count_at_its_limit_is_an_overload_until_the_hold_off_is_over() {
    let mut bench = ready();
    let summary = run(&mut bench, 0, |n, counts, _| {
        if n == 3000 {
            counts[2] = (1 << 23) - 1;
        }
        true
    });
    // The sample itself and 50 ms after it, 25.6 samples.
    assert_eq!(summary.overloads, 27);
    assert_eq!(summary.health, Health::OVERLOAD);
    let events = bench.events();
    let changes: Vec<(u64, u16)> = events
        .iter()
        .filter_map(|e| match e {
            Heard::Health(sample, health) => Some((*sample, health[2])),
            _ => None,
        })
        .collect();
    assert_eq!(changes, [(3000, Health::OVERLOAD.0), (3027, 0)]);
}

#[test]
fn a_channel_that_nobody_wants_has_no_faults() {
    let mut bench = ready();
    let summary = run(&mut bench, 0, |_, _, health| {
        health[CHANNELS..].fill(Health::OPEN);
        true
    });
    assert_eq!((summary.rejected, summary.health), (0, Health::GOOD));
}

#[test]
fn lost_samples_of_the_converters_shift_nothing() {
    let mut bench = ready();
    run(&mut bench, 0, |_, _, _| true);
    let expected = bench.lines(0);
    let summary = run(&mut bench, 1, |n, _, _| !(2500..2511).contains(&n));
    assert_eq!((summary.missing, summary.samples), (11, 6000 - 11));
    assert_eq!((summary.rejected, summary.rejected_by[1]), (1, 1));
    // By the bench's clock, 2 ms a sample that has come.
    let rate = summary.sample_rate.unwrap();
    assert!((rate - 500.0 * 5999.0 / 5988.0).abs() < 1e-9, "{rate}");
    assert_same_shares(&expected, &bench.lines(1));
}

#[test]
fn a_converter_that_falls_silent_ends_the_run_and_keeps_what_there_is() {
    let mut bench = ready();
    bench.start(0, Source::Inputs, Gaps::Count, None);
    for n in 0..4000 {
        bench.convert(n, &counts(n), &[]);
    }
    bench.events();
    let (kind, part) = (FaultKind::Converter, Some(1));
    bench
        .instrument
        .fault(kind, part, &mut bench.hardware, &mut bench.host);
    let events = bench.events();
    let [Heard::Fault(fault), Heard::RunEnded(summary)] = events.as_slice() else {
        panic!("{events:?}");
    };
    assert_eq!(
        *fault,
        Fault {
            kind,
            sample: 4000,
            part
        }
    );
    assert_eq!(summary.outcome, Outcome::Fault);
    assert!(summary.blocks > 3);
    assert_eq!(bench.hardware.converting, None);
    let status = bench.status();
    assert_eq!((status.state, status.stored), (State::Ready, 1));
}

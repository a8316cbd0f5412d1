//! Replays of the fork's recordings, and the conditions of an identical one.

// Each test program uses a part of this.
#![allow(dead_code)]

use massline::device::{Client, ClientMemory, Port};
use massline::replay::{Order, Outcome, ReplayError, replay};
use massline::setup::Setup;
use massline_core::masslines::Method;

/// The fork's recordings and their set-up.
pub fn fork() -> Setup {
    Setup::read(&massline_tests::fixture("fork/setup.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// An order of some blocks of each run, solved once and without weights.
pub fn order(methods: &[Method], blocks: u32) -> Order {
    Order {
        methods: methods.to_vec(),
        iterative: false,
        weighted: false,
        blocks: Some(blocks),
        flip: None,
        resume: false,
    }
}

/// Replays a set-up over a port.
pub fn over(port: impl Port, setup: &Setup, order: &Order) -> Result<Outcome, ReplayError> {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(port, &mut memory);
    replay(&mut client, setup, order, &mut |_| ())
}

/// Every comparison holds, and every method found an answer to compare.
pub fn assert_identical(outcome: &Outcome) {
    assert!(!outcome.bases.is_empty());
    for base in &outcome.bases {
        assert!(!base.runs.is_empty() && !base.answers.is_empty());
    }
    for (what, comparison) in outcome.comparisons() {
        assert!(comparison.identical(), "{what}: {:?}", comparison.first);
    }
    assert!(outcome.identical());
    for answer in outcome.bases.iter().flat_map(|b| &b.answers) {
        assert_eq!(answer.no_answer, None, "{}", answer.method.name());
    }
}

/// Every run was compared to the last number of its last line, after so many blocks.
pub fn assert_complete(outcome: &Outcome, blocks: u32) {
    for run in outcome.bases.iter().flat_map(|b| &b.runs) {
        assert_eq!(run.blocks, blocks);
        // Samples, missing, blocks, rejected with reasons, number of lines; the drive and two parts
        // of twelve resultants a line; the noise of twelve, and its flag.
        assert_eq!(run.comparison.numbers, 6 + 25 * run.lines + 13);
    }
}

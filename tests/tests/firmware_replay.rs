//! The fork's recordings through the firmware in the emulator: the same bits as this machine's.
//!
//! An excerpt of some blocks a run: the emulated port transfers 20 to 35 kB/s. The whole recordings
//! are compared by `massline replay tests/fixtures/fork/setup.toml --emulator --method all`.

mod identical;

use identical::{assert_complete, assert_identical, fork, order, over};
use massline::device::{Emulator, HostBox, HostBoxMemory, firmware};
use massline::replay::{Flip, Order, Outcome};
use massline::setup::Setup;
use massline_core::masslines::Method;
use massline_firmware::wire::Capacity;

fn replayed(setup: &Setup, order: &Order) -> Outcome {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let emulator = Emulator::start(&elf).unwrap_or_else(|error| panic!("{error}"));
    over(emulator, setup, order).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn the_apparent_mass_has_the_same_bits_on_the_chip() {
    let outcome = replayed(&fork(), &order(&[Method::ApparentMass], 2));
    assert_identical(&outcome);
    assert_complete(&outcome, 2);
    assert_eq!(outcome.device.chip, "STM32F405");
    // Checks of a set-up with `--host` must hold for the chip, too.
    let mut memory = HostBoxMemory::new();
    let host = over(
        HostBox::new(&mut memory, 1),
        &fork(),
        &order(&[Method::ApparentMass], 2),
    );
    let capacity = Capacity {
        inputs: outcome.device.capacity.inputs,
        ..host.unwrap_or_else(|e| panic!("{e}")).device.capacity
    };
    assert_eq!(outcome.device.capacity, capacity);
    assert_eq!(outcome.link.received.lost, 0);
}

// With fewer blocks noise hides the third run, which methods b and c need.
#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn methods_a_b_and_c_have_the_same_bits_on_the_chip() {
    let methods = [
        Method::FrequencyResponses,
        Method::PowerSpectra,
        Method::FreeResponsesSquared,
    ];
    let outcome = replayed(&fork(), &order(&methods, 6));
    assert_identical(&outcome);
    assert_complete(&outcome, 6);
    assert_eq!(outcome.bases[0].answers.len(), 3);
}

// Two groups of accelerometers are surveyed in turn, and each needs two blocks.
#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn weighted_and_iterated_have_the_same_bits_on_the_chip() {
    let outcome = replayed(
        &fork(),
        &Order {
            iterative: true,
            weighted: true,
            ..order(&[Method::FrequencyResponses], 4)
        },
    );
    assert_identical(&outcome);
    assert_complete(&outcome, 4);
    // A peak and a weight of each of 15 accelerometers and 3 load cells in three runs, and
    // the lengths of the lists.
    let weights = outcome.bases[0].weights.as_ref().unwrap();
    assert_eq!(weights.numbers, 2 * 3 * (18 + 1));
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn one_flipped_bit_is_noticed_on_the_chip() {
    let mut setup = fork();
    setup.runs.truncate(1);
    // The lowest bit of a reading along the motion.
    let flip = Flip::parse("1:1200:a1:0", &setup).unwrap();
    let flipped = Order {
        flip: Some(flip),
        ..order(&[Method::ApparentMass], 2)
    };
    let outcome = replayed(&setup, &flipped);
    assert!(!outcome.identical());
    let run = &outcome.bases[0].runs[0].comparison;
    let first = run.first.as_ref().unwrap().to_string();
    assert!(first.starts_with("line "), "{first}");
}

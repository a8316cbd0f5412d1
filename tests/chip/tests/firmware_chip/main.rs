//! The ELF that is flashed, on the chip's registers: clocks, settings through cuts of the supply, and
//! samples from voltages to the link, and the fork from voltages to its ten numbers.
//!
//! Tests named `firmware_*` need the firmware; `cargo xtask test` builds it and runs them.

mod accelerometer;
mod bringup;
mod clocks;
mod faults;
mod fork;
mod load;
mod sampling;
mod settings;
#[path = "../../../tests/stand_in/mod.rs"]
mod stand_in;
mod status_light;

use std::time::Duration;

use massline::device::{Client, firmware};
use massline_chip::SECOND;
use massline_chip::bench::{Bench, Signal};
use massline_chip::flash::Cells;
use massline_chip::machine::{Machine, Parts};
use massline_chip::rcc::Oscillators;
use massline_firmware::settings::LINK_BAUD;

/// A board as it is built: a crystal of 12 MHz.
const GOOD: Oscillators = Oscillators {
    crystal: Some(12_000_000),
    pll: true,
};

/// Time within which the chip has started, ps: a dead crystal is waited for 0.3 s.
const START: u64 = SECOND;

/// Boots the firmware, up to its first byte on the link.
fn boot(oscillators: Oscillators, cells: Cells, signal: Signal, seed: u64) -> Machine {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let mut machine = Machine::start(Parts {
        elf: &elf,
        cells,
        oscillators,
        bench: Bench::new(signal),
        baud: LINK_BAUD,
        seed,
    });
    let has_spoken = machine.run_until(START, Machine::has_bytes);
    assert!(
        has_spoken,
        "{oscillators:?}, silent: {:?}",
        machine.forbidden()
    );
    machine
}

/// Lets a time of the chip pass, ps, which does not depend on how fast this machine is.
fn pass(client: &mut Client<'_, &mut Machine>, time: u64) {
    let end = client.port().time() + time;
    while client.port().time() < end {
        client.listen(Duration::from_millis(20)).unwrap();
    }
}

/// No voltage anywhere.
fn silence() -> Signal {
    Box::new(|_, _| 0.0)
}

/// Asserts that nothing was done that the manual forbids.
#[track_caller]
fn clean(machine: &Machine) {
    assert_eq!(machine.forbidden(), Vec::<String>::new());
}

/// Asserts the same, and that no byte from the host was lost, as they may while the flash is written.
#[track_caller]
fn lossless(machine: &mut Machine) {
    clean(machine);
    assert_eq!(machine.chip().usart.lost, 0, "bytes");
}

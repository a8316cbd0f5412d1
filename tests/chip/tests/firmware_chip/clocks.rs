//! Every clock that the chip may run on, and what it says of it.

use massline::device::{Client, ClientMemory};
use massline_chip::flash::Cells;
use massline_chip::machine::Machine;
use massline_chip::rcc::Oscillators;
use massline_chip::{SECOND, counted};
use massline_firmware::wire::ClockSource;

use crate::{boot, clean, silence};

/// Ticks of the box, by its own count.
fn ticks(machine: &mut Machine) -> u64 {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(machine, &mut memory);
    client.ping(1).unwrap().ticks
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn every_crystal_makes_168_mhz_and_without_one_the_box_answers() {
    use ClockSource::{CrystalPll, InternalPll};
    for (crystal, source, hz) in [
        (Some(8_000_000), CrystalPll, 168_000_000),
        (Some(12_000_000), CrystalPll, 168_000_000),
        (Some(16_000_000), CrystalPll, 168_000_000),
        // An unknown one is not trusted, and a dead one is not waited for.
        (Some(25_000_000), InternalPll, 166_000_000),
        (None, InternalPll, 166_000_000),
    ] {
        let oscillators = Oscillators { crystal, pll: true };
        let mut machine = boot(oscillators, Cells::default(), silence(), 1);
        let mut memory = ClientMemory::new();
        let info = Client::new(&mut machine, &mut memory).hello().unwrap();
        assert_eq!((info.clock, info.clock_hz), (source, hz), "{oscillators:?}");
        assert_eq!((info.resets, machine.chip().core_hz()), (0, hz));
        // The ticks are those of a clock of the rate that it tells.
        let (first, begin) = (ticks(&mut machine), machine.time());
        machine.run(SECOND / 20);
        let (second, end) = (ticks(&mut machine), machine.time());
        let (told, passed) = (second - first, counted(end - begin, info.tick_hz));
        // Each answer took less than a millisecond to come.
        let off = told.abs_diff(passed);
        assert!(off < u64::from(info.tick_hz) / 1000, "{told}, {passed}");
        clean(&machine);
    }
}

/// Without a PLL there are 17 cycles a bit: the box tells that it has started, goes on, and loses bytes
/// of requests. On a board that is a broken chip.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn without_a_pll_the_box_tells_that_it_has_started() {
    for crystal in [Some(12_000_000), None] {
        let oscillators = Oscillators {
            crystal,
            pll: false,
        };
        let mut machine = boot(oscillators, Cells::default(), silence(), 1);
        machine.run(SECOND / 2);
        assert_eq!(machine.chip().core_hz(), 16_000_000);
        assert_eq!(machine.resets.len(), 1, "{:?}", machine.resets);
        clean(&machine);
    }
}

//! The modelled captures of the timers: which edges they take, and their flags (RM0090, 18).

use massline_chip::rcc::Clocks;
use massline_chip::timers::Timer;
use massline_chip::{Moment, SECOND};

/// Clock of the timer, Hz: a tick is a microsecond.
const CLOCK: u32 = 1_000_000;
const TICK: u64 = SECOND / CLOCK as u64;
const CLOCKS: Clocks = Clocks {
    core: 2 * CLOCK,
    apb1: CLOCK,
    apb2: CLOCK,
    timers1: CLOCK,
    timers2: CLOCK,
    divided_crystal: None,
};

const CR1: u32 = 0x00;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;
/// Flags of channel 2: captured, and captured again; those of the other channels, which compare.
const CAPTURED: u32 = 1 << 2;
const AGAIN: u32 = 1 << 10;
const COMPARED: u32 = 0b1_1010;

fn write(timer: &mut Timer, register: u32, value: u32) {
    let mut at = Moment {
        now: 0,
        clocks: CLOCKS,
        forbidden: &mut Vec::new(),
    };
    timer.write(register, value, &mut at);
}

fn read(timer: &mut Timer, register: u32) -> u32 {
    let at = Moment {
        now: 0,
        clocks: CLOCKS,
        forbidden: &mut Vec::new(),
    };
    timer.read(register, CLOCK, &at)
}

/// A timer of 16 bits that captures the falling edges of channel 2, and is on from zero on.
fn capturing() -> Timer {
    let mut timer = Timer::new(0xFFFF);
    for (register, value) in [(CCMR1, 0x0100), (CCER, 0x0030), (DIER, 1 << 2), (CR1, 1)] {
        write(&mut timer, register, value);
    }
    timer
}

#[test]
fn a_falling_edge_is_captured_until_it_is_read() {
    let mut timer = capturing();
    timer.edge(1, true, 10 * TICK, CLOCK);
    assert!(!timer.asks(), "a rising edge");
    timer.edge(0, false, 20 * TICK, CLOCK);
    assert!(!timer.asks(), "another channel's edge");
    // The counter has come round once.
    timer.edge(1, false, (0x1_0000 + 30) * TICK, CLOCK);
    assert!(timer.asks());
    assert_eq!(read(&mut timer, SR), CAPTURED | COMPARED);
    assert_eq!(read(&mut timer, CCR1), 0);
    assert!(timer.asks(), "another channel was read");
    assert_eq!(read(&mut timer, CCR2), 30);
    assert!(!timer.asks() && read(&mut timer, SR) == COMPARED);
}

#[test]
fn an_edge_before_the_last_one_was_read_is_flagged() {
    let mut timer = capturing();
    timer.edge(1, false, 30 * TICK, CLOCK);
    timer.edge(1, false, 90 * TICK, CLOCK);
    assert_eq!(read(&mut timer, SR), CAPTURED | AGAIN | COMPARED);
    assert_eq!(read(&mut timer, CCR2), 90);
    assert_eq!(
        read(&mut timer, SR),
        AGAIN | COMPARED,
        "it lasts until it is cleared"
    );
    write(&mut timer, SR, !AGAIN);
    assert_eq!(read(&mut timer, SR), COMPARED);
}

#[test]
fn a_timer_that_is_not_set_up_captures_nothing() {
    for (register, value) in [
        (CCMR1, 0),
        (CCMR1, 0x0200),
        (CCER, 0),
        (CCER, 0x0010),
        (CR1, 0),
    ] {
        let mut timer = capturing();
        write(&mut timer, register, value);
        timer.edge(1, false, 30 * TICK, CLOCK);
        assert!(!timer.asks(), "{register:#x} is {value:#x}");
    }
    let mut silent = capturing();
    write(&mut silent, DIER, 0);
    silent.edge(1, false, 30 * TICK, CLOCK);
    assert!(!silent.asks() && read(&mut silent, SR) == CAPTURED | COMPARED);
}

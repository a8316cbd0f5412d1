//! The interrupts that call the sampling task: the converters' DRDY lines, or a timer in a test
//! pattern.
//!
//! An edge is noted by an interrupt of the highest priority, which takes a microsecond: samples
//! are numbered by the time of their edge, and that must not depend on what else the box is at.

use core::sync::atomic::{AtomicU32, Ordering};

use massline_firmware::sampling::CONVERTERS;
use massline_firmware::sampling::sequencer::Edge;
use stm32f4xx_hal::gpio::{AnyPin, Input};
use stm32f4xx_hal::pac::{EXTI, TIM5};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::ticks;
use crate::board;

/// EXTI lines of the DRDY pins, by bits.
pub const EXTI_LINES: u32 = 0b11_1100_0000;

/// The DRDY lines of the ADS131M08.
pub struct Edges {
    exti: EXTI,
    lines: [AnyPin<Input>; CONVERTERS],
    /// Cycles of the core in a microsecond.
    microsecond: u32,
}

impl Edges {
    /// DRDY lines on pins that are set up as interrupts.
    pub const fn new(exti: EXTI, lines: [AnyPin<Input>; CONVERTERS], microsecond: u32) -> Self {
        Self {
            exti,
            lines,
            microsecond,
        }
    }

    /// Handles the interrupt of the lines: notes the time of the edge, and the lines that are low
    /// a microsecond later.
    pub fn note(&mut self) {
        let at = ticks::low();
        let fallen = self.exti.pr().read().bits() & EXTI_LINES;
        if fallen == 0 {
            return;
        }
        cortex_m::asm::delay(self.microsecond);
        // Those that fell meanwhile belong to the same sample: writing ones clears them.
        // SAFETY: the register has a bit for each of these lines.
        self.exti.pr().write(|w| unsafe { w.bits(EXTI_LINES) });
        let low = (0..).zip(&self.lines).filter(|(_, pin)| pin.is_low());
        let ready = low.fold(NOTED, |bits, (k, _): (u32, _)| bits | 1 << k);
        AT.store(at, Ordering::Relaxed);
        let is_unseen = READY.load(Ordering::Relaxed) & NOTED != 0;
        let merged = if is_unseen { MERGED } else { 0 };
        READY.store(ready | merged, Ordering::Relaxed);
        board::call_sampling();
    }
}

/// Bit of [`READY`]: there is an edge that the sampling task has not seen yet.
const NOTED: u32 = 1 << 31;
/// Bit of [`READY`]: there was another edge before, which it has not seen either.
const MERGED: u32 = 1 << 30;
/// Lines that were low after the last edge, by bits.
static READY: AtomicU32 = AtomicU32::new(0);
/// [`ticks::low`] at that edge.
static AT: AtomicU32 = AtomicU32::new(0);

/// `true` if there is an edge that the sampling task has not seen yet.
#[inline]
pub fn is_noted() -> bool {
    READY.load(Ordering::Relaxed) != 0
}

/// The last edge since the last call, with the lines that were low a microsecond later.
#[inline]
pub fn take() -> Option<Edge> {
    // At most ends of frames there is none.
    if is_noted() { take_noted() } else { None }
}

fn take_noted() -> Option<Edge> {
    let (noted, at) = cortex_m::interrupt::free(|_| {
        (READY.swap(0, Ordering::Relaxed), AT.load(Ordering::Relaxed))
    });
    if noted == 0 {
        return None;
    }
    let now = ticks::now();
    let since = (now as u32).wrapping_sub(at);
    Some(Edge {
        ready: noted & !(NOTED | MERGED),
        at: now - u64::from(since),
        is_merged: noted & MERGED != 0,
    })
}

/// Periods of the test clock that the sampling task has not seen yet.
static PERIODS: AtomicU32 = AtomicU32::new(0);

/// TIM5, which stands in for the DRDY lines in a test pattern.
pub struct TestClock(TIM5);

impl TestClock {
    /// A stopped timer.
    pub fn new(tim: TIM5, rcc: &mut Rcc) -> Self {
        TIM5::enable(rcc);
        TIM5::reset(rcc);
        Self(tim)
    }

    /// Interrupts every `period` ticks; its clock is that of [`super::ticks`].
    ///
    /// It counts down, so that a new period holds from where the counter is: setting the counter
    /// puts the emulator's alarm off.
    pub fn start(&mut self, period: u32) {
        PERIODS.store(0, Ordering::Relaxed);
        self.0.cr1().write(|w| w.dir().set_bit());
        self.0
            .arr()
            .write(|w| w.arr().set(period.saturating_sub(1)));
        self.0.sr().write(|w| w.uif().clear_bit());
        self.0.dier().write(|w| w.uie().set_bit());
        self.0.cr1().modify(|_, w| w.cen().set_bit());
    }

    /// Stops the timer.
    pub fn stop(&mut self) {
        self.0.cr1().write(|w| w.cen().clear_bit());
        self.0.dier().write(|w| w.uie().clear_bit());
    }
}

/// Handles the interrupt of the test clock.
pub fn test_clock_period() {
    // SAFETY: one write to the status register, which belongs to this interrupt while it is
    // enabled.
    unsafe { (*TIM5::ptr()).sr().write(|w| w.uif().clear_bit()) };
    PERIODS.fetch_add(1, Ordering::Relaxed);
    board::call_sampling();
}

/// Periods of the test clock since the last call.
pub fn take_periods() -> u32 {
    PERIODS.swap(0, Ordering::Relaxed)
}

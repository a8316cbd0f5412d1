//! The interrupts that call the sampling task: the converters' DRDY lines, or a timer in a test
//! pattern.
//!
//! Two timers capture the falling edges of the lines (RM0090, 18.3.5), so that the time of a sample
//! does not depend on what else the box is at, and the converters' skew is known to a tick. Their
//! interrupts, of the highest priority, take a microsecond.
//!
//! | line | pin | captured by |
//! | --- | --- | --- |
//! | 0, 1 | PC6, PC7 | TIM3, channels 1 and 2 |
//! | 2, 3 | PB8, PB9 | TIM4, channels 3 and 4 |

use core::hint::black_box;
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use massline_firmware::sampling::CONVERTERS;
use massline_firmware::sampling::sequencer::Edge;
use stm32f4xx_hal::pac::tim3::RegisterBlock;
use stm32f4xx_hal::pac::{GPIOB, GPIOC, Interrupt, NVIC, TIM3, TIM4, TIM5};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::ticks;
use crate::board;

/// Flags of the captures in DIER and SR, of the first timer's channels and of the second one's. The other
/// channels of both compare, whose flags are set at each round of the counter (18.4.5). Flags of an edge
/// that came before the one before it was read are [`AGAIN`] bits higher.
const FIRST: u32 = 0b0_0110;
const SECOND: u32 = 0b1_1000;
const AGAIN: u32 = 8;
/// Bits of the first channel in CCER: it is on, at falling edges. A channel has four.
const FALLING: u32 = 0b0011;
/// Ticks in place of those of a line without an edge.
const NO_EDGE: u16 = u16::MAX;

/// The timers on the DRDY lines of the ADS131M08. Their clock is that of [`ticks`].
pub struct Edges {
    first: TIM3,
    second: TIM4,
    /// Ticks by which the second counter is ahead of the first.
    ahead: u16,
    /// Ticks in a microsecond.
    microsecond: u16,
}

impl Edges {
    /// Starts the captures, on pins that lead to the timers.
    pub fn start(first: TIM3, second: TIM4, rcc: &mut Rcc) -> Self {
        TIM3::enable(rcc);
        TIM3::reset(rcc);
        TIM4::enable(rcc);
        TIM4::reset(rcc);
        first.ccmr1_input().write(|w| w.cc1s().ti1().cc2s().ti2());
        second.ccmr2_input().write(|w| w.cc3s().ti3().cc4s().ti4());
        capture_falling(&first, FALLING | FALLING << 4, FIRST);
        capture_falling(&second, FALLING << 8 | FALLING << 12, SECOND);
        let ahead = ahead(&first, &second);
        Self {
            first,
            second,
            ahead,
            microsecond: rcc.clocks.timclk1().to_MHz() as u16,
        }
    }

    /// Handles the interrupt of either timer: notes the time of the first edge, and the lines that
    /// are low once all of them have fallen, or a microsecond later.
    pub fn note(&mut self) {
        let (first, second) = (&self.first, &self.second);
        let watched = [first.dier().read().bits(), second.dier().read().bits()];
        let seen = watched.map(|lines| lines | lines << AGAIN);
        let flags = || {
            [
                first.sr().read().bits() & seen[0],
                second.sr().read().bits() & seen[1],
            ]
        };
        if flags() == [0; 2] {
            return;
        }
        let count = || first.cnt().read().cnt().bits();
        let begin = count();
        let flags = loop {
            let seen = flags();
            let waited = count().wrapping_sub(begin);
            let are_all = (watched[0] | watched[1]) & !(seen[0] | seen[1]) == 0;
            if are_all || waited >= self.microsecond {
                break seen;
            }
        };
        let captured = [
            first.ccr1().read().ccr().bits(),
            first.ccr2().read().ccr().bits(),
            second.ccr3().read().ccr().bits(),
            second.ccr4().read().ccr().bits(),
        ];
        // Read behind the captures, so that none of them is younger. Those older than 2^16 ticks, after a
        // stall of the flash, are taken for younger ones.
        let at = ticks::low();
        let count = count();
        let age = |timer: usize, line: usize, count: u16| {
            let is_there = flags[timer] & 1 << (line + 1) != 0;
            is_there.then(|| count.wrapping_sub(captured[line]))
        };
        let ahead = count.wrapping_add(self.ahead);
        let ages: [Option<u16>; CONVERTERS] = [
            age(0, 0, count),
            age(0, 1, count),
            age(1, 2, ahead),
            age(1, 3, ahead),
        ];
        // What is zero is cleared, and nothing else.
        clear(first, flags[0]);
        clear(second, flags[1]);
        // The other timer's edges were seen too.
        NVIC::unpend(Interrupt::TIM3);
        NVIC::unpend(Interrupt::TIM4);
        let oldest = ages.iter().flatten().max().copied().unwrap_or(0);
        for (slot, age) in AFTER.iter().zip(ages) {
            let after = age.map_or(NO_EDGE, |age| oldest.wrapping_sub(age));
            slot.store(after, Ordering::Relaxed);
        }
        let at = at.wrapping_sub(oldest.into());
        let is_again = (flags[0] | flags[1]) >> AGAIN != 0;
        AT.store(at, Ordering::Relaxed);
        let is_unseen = READY.load(Ordering::Relaxed) & NOTED != 0;
        let merged = if is_unseen || is_again { MERGED } else { 0 };
        READY.store(low_lines() | NOTED | merged, Ordering::Relaxed);
        board::call_sampling();
    }
}

/// Has channels of a timer capture and interrupt, by their bits of CCER and DIER.
fn capture_falling(timer: &RegisterBlock, edges: u32, interrupts: u32) {
    // SAFETY: bits of CCER, with the meaning that the manual gives them (18.4.9).
    timer.ccer().write(|w| unsafe { w.bits(edges) });
    // SAFETY: the same of DIER (18.4.4).
    timer.dier().write(|w| unsafe { w.bits(interrupts) });
    timer.cr1().write(|w| w.cen().set_bit());
}

/// Ticks by which the second counter is ahead of the first: between two looks at the first one.
fn ahead(first: &RegisterBlock, second: &RegisterBlock) -> u16 {
    let count = |timer: &RegisterBlock| timer.cnt().read().cnt().bits();
    // Addresses that are constants would be made between the looks, which are to be as far apart.
    let (first, second) = (black_box(first), black_box(second));
    let [a, b, c] = cortex_m::interrupt::free(move |_| [count(first), count(second), count(first)]);
    let half = c.wrapping_sub(a).div_ceil(2);
    b.wrapping_sub(a).wrapping_sub(half)
}

/// Clears these flags of a timer.
fn clear(timer: &RegisterBlock, flags: u32) {
    // SAFETY: zeros clear flags, ones leave them (18.4.5).
    timer.sr().write(|w| unsafe { w.bits(!flags) });
}

/// Bits of the DRDY lines that are low.
fn low_lines() -> u32 {
    // SAFETY: reads of two registers that have no effect.
    let (b, c) = unsafe { ((*GPIOB::ptr()).idr().read(), (*GPIOC::ptr()).idr().read()) };
    !(c.bits() >> 6 & 0b11 | b.bits() >> 6 & 0b1100) & 0b1111
}

/// Bit of [`READY`]: there is an edge that the sampling task has not seen yet.
const NOTED: u32 = 1 << 31;
/// Bit of [`READY`]: there was another edge before, which it has not seen either.
const MERGED: u32 = 1 << 30;
/// Lines that were low after the last edge, by bits.
static READY: AtomicU32 = AtomicU32::new(0);
/// Time of that edge, as of [`ticks::low`].
static AT: AtomicU32 = AtomicU32::new(0);
/// Ticks from it to the edge of each line, or [`NO_EDGE`].
static AFTER: [AtomicU16; CONVERTERS] = [const { AtomicU16::new(NO_EDGE) }; CONVERTERS];

/// Ticks from the first edge of the newest sample to that of each line; `None` for a line without.
pub fn skews() -> [Option<u16>; CONVERTERS] {
    cortex_m::interrupt::free(|_| {
        AFTER.each_ref().map(|after| {
            let after = after.load(Ordering::Relaxed);
            (after != NO_EDGE).then_some(after)
        })
    })
}

/// `true` if there is an edge that the sampling task has not seen yet.
#[inline]
pub fn is_noted() -> bool {
    READY.load(Ordering::Relaxed) != 0
}

/// Has the lines of these converters interrupt, by bits, and no others.
pub fn watch(converters: u32) {
    // The bit of a line is one higher than that of its converter.
    let lines = converters << 1;
    // SAFETY: one write each to the registers of the interrupts, which no one else writes after the start, with
    // the meaning that the manual gives the bits (18.4.4).
    unsafe {
        (*TIM3::ptr()).dier().write(|w| w.bits(lines & FIRST));
        (*TIM4::ptr()).dier().write(|w| w.bits(lines & SECOND));
    }
}

/// Forgets an edge that the sampling task has not seen yet.
pub fn forget() {
    READY.store(0, Ordering::Relaxed);
}

/// The last edge since the last call, with the lines that were low then.
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
        at: now.wrapping_sub(since.into()),
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

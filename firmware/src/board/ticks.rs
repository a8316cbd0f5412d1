//! The clock of all tick counts: TIM2, which runs freely through its 32 bits.
//!
//! Not the cycle counter of the processor, which stands still in the emulator. There TIM2 runs
//! at 1 GHz of emulated time whatever its prescaler's input is said to be, so with
//! `-icount shift=0`, which gives every instruction a nanosecond, a tick is one instruction.

use core::cell::Cell;

use cortex_m::interrupt::Mutex;
use stm32f4xx_hal::pac::TIM2;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};
use stm32f4xx_hal::time::Hertz;

/// The latest result of [`now`].
static LATEST: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Starts the clock; its rate.
pub fn start(tim: TIM2, rcc: &mut Rcc) -> Hertz {
    TIM2::enable(rcc);
    TIM2::reset(rcc);
    tim.psc().write(|w| w.psc().set(0));
    tim.arr().write(|w| w.arr().set(u32::MAX));
    // Takes over prescaler and limit, and begins at zero.
    tim.egr().write(|w| w.ug().set_bit());
    tim.cr1().write(|w| w.cen().set_bit());
    rcc.clocks.timclk1()
}

/// The low 32 bits, which come round after 51 s at 84 MHz: for differences.
pub fn low() -> u32 {
    // SAFETY: one atomic read of a register that has no effect on anything.
    unsafe { (*TIM2::ptr()).cnt().read().cnt().bits() }
}

/// Ticks since the start. Has to be called at least once in each round of the counter; the task
/// watchdog does.
pub fn now() -> u64 {
    cortex_m::interrupt::free(|cs| {
        let latest = LATEST.borrow(cs);
        let before = latest.get();
        let passed = low().wrapping_sub(before as u32);
        let now = before + u64::from(passed);
        latest.set(now);
        now
    })
}

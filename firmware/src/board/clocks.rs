//! The clock that runs the chip, chosen by bounded waits.
//!
//! # Design
//!
//! The HAL switches to whatever it is told to and waits for it without end. A box with a cracked
//! crystal would then be silent, and so would the emulator, whose clock controller raises neither
//! "crystal ready" nor "PLL locked". Both are therefore tried here first, each for a bounded
//! number of polls, and only what answered is given to the HAL:
//!
//! | crystal | PLL | runs on | core clock | bit rate error at 921600 baud |
//! | --- | --- | --- | --- | --- |
//! | starts, is known | locks | crystal + PLL | 168 MHz | -0.93 % |
//! | dead, or another | locks | internal RC + PLL | 166 MHz | +0.07 % and the RC's own error |
//! | any | dead | internal RC | 16 MHz | +2.1 % and the RC's own error |
//!
//! Without its crystal the box stays as fast as it was, so that acquisition keeps up (the
//! converters have a clock of their own, sample rates do not depend on this choice). The internal
//! oscillator is only good to 1 % at room temperature, though, and 8N1 bears about 3 % between
//! the two ends: 166 MHz instead of 168 MHz makes APB1 41.5 MHz, 45.03 clocks a bit, and leaves
//! that budget to the oscillator. The third row is the emulator's, where baud rates do not exist;
//! on a board it means broken silicon and a link that may or may not be readable.
//!
//! Boards carry crystals of 8 or 12 MHz and more: factors for the one would have the PLL run 504 MHz
//! on the other. The crystal is measured against the internal oscillator before the PLL is
//! switched on ([`crystal`]).
//!
//! The polls are counted, not timed: before the choice is made there is no clock to trust, and
//! the cycle counter stands still in the emulator.

use core::fmt;

use massline_firmware::crystal;
use stm32f4xx_hal::pac::{RCC, TIM11};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, HSI, Rcc};
use stm32f4xx_hal::time::Hertz;

/// Core clock with a crystal: the chip's maximum.
const SYSCLK_FROM_CRYSTAL: Hertz = Hertz::MHz(168);
/// Core clock from the internal oscillator, chosen for the link's bit rate (see the table above).
const SYSCLK_FROM_INTERNAL: Hertz = Hertz::MHz(166);

/// Polls until the crystal counts as dead.
///
/// A poll is a bus read, a test and a branch: at least 4 cycles of the 16 MHz the chip wakes up
/// with, so this is 100 ms or more. Crystals start within a few milliseconds, and 100 ms is what
/// the chip's maker allows them.
const CRYSTAL_POLLS: u32 = 400_000;
/// The crystal's clock is divided by so many on its way to the timer that measures it.
const DIVIDED: u8 = 31;
/// The timer captures every so many periods of that.
const CAPTURED: u32 = 8;
/// Polls until a capture is given up: 1 ms or more; a crystal of 4 MHz makes one in 62 µs.
const CAPTURE_POLLS: u32 = 4_000;
/// Polls until the PLL counts as dead: 4 ms or more by the same reckoning; it locks in 0.3 ms.
const PLL_POLLS: u32 = 16_000;

/// Sources of the core clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Source {
    /// The crystal, multiplied by the PLL.
    CrystalPll,
    /// The internal RC oscillator, multiplied by the PLL: there is no working crystal.
    InternalPll,
    /// The internal RC oscillator as it is: not even the PLL works, as in the emulator.
    Internal,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Source::CrystalPll => "hse+pll",
            Source::InternalPll => "hsi+pll",
            Source::Internal => "hsi",
        })
    }
}

/// The clock that runs, for the greeting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    /// Its source.
    pub source: Source,
    /// Frequency of the core, as far as the source keeps its nominal one.
    pub core: Hertz,
    /// Frequency of the crystal by the internal oscillator, Hz, if it oscillates.
    pub crystal: Option<u32>,
}

/// Starts the best clock that works, and returns it.
pub fn start(rcc: RCC, timer: &TIM11) -> (Rcc, Clock) {
    let crystal = if crystal_starts(&rcc) {
        crystal_hz(&rcc, timer)
    } else {
        None
    };
    let nominal = crystal.and_then(crystal::nominal);
    let (source, config) = match (pll_locks(&rcc), nominal) {
        (true, Some(crystal)) => (
            Source::CrystalPll,
            Config::hse(crystal.Hz()).sysclk(SYSCLK_FROM_CRYSTAL),
        ),
        (true, None) => (
            Source::InternalPll,
            Config::hsi().sysclk(SYSCLK_FROM_INTERNAL),
        ),
        (false, _) => (Source::Internal, Config::hsi()),
    };
    if source != Source::CrystalPll {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    let rcc = rcc.freeze(config);
    let core = rcc.clocks.sysclk();
    defmt::info!("clock {} {=u32} Hz", source, core.raw());
    let clock = Clock {
        source,
        core,
        crystal,
    };
    (rcc, clock)
}

/// Turns the crystal oscillator on, and leaves it on, to see whether it starts.
fn crystal_starts(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    poll(CRYSTAL_POLLS, || rcc.cr().read().hserdy().bit_is_set())
}

/// Measures the crystal: TIM11 captures its divided clock, and counts the internal oscillator's, on
/// which the chip runs until the PLL is on. `None` if there is no edge.
fn crystal_hz(rcc: &RCC, timer: &TIM11) -> Option<u32> {
    rcc.cfgr().modify(|_, w| w.rtcpre().set(DIVIDED));
    rcc.apb2enr().modify(|_, w| w.tim11en().set_bit());
    // SAFETY: two bits, whose value 2 leads the divided crystal to the capture input.
    timer.or().write(|w| unsafe { w.rmp().bits(2) });
    timer
        .ccmr1_input()
        .write(|w| w.cc1s().ti1().ic1psc().eight_events());
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
    let capture = || {
        let is_there = poll(CAPTURE_POLLS, || timer.sr().read().cc1if().bit_is_set());
        is_there.then(|| timer.ccr1().read().ccr().bits())
    };
    // The first capture may be of fewer periods.
    let _ = capture();
    let first = capture();
    let second = capture();
    timer.cr1().write(|w| w.cen().clear_bit());
    rcc.apb2enr().modify(|_, w| w.tim11en().clear_bit());
    rcc.cfgr().modify(|_, w| w.rtcpre().set(0));
    let ticks = second?.wrapping_sub(first?);
    let hz = crystal::measured(ticks.into(), CAPTURED * u32::from(DIVIDED), HSI);
    defmt::info!("{=u16} ticks of the crystal: {} Hz", ticks, hz);
    hz
}

/// Turns the PLL on to see whether it locks, and off again.
///
/// It runs as reset leaves it, 16 MHz / 16 * 192 from the internal oscillator, a valid setting
/// that needs no other clock. The HAL writes its own factors afterwards, which the silicon
/// accepts only while the PLL is off, and must not take the old "locked" for its own: so "off"
/// is waited for, too, and a PLL that would not go off counts as one that does not lock.
fn pll_locks(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    let locked = poll(PLL_POLLS, || rcc.cr().read().pllrdy().bit_is_set());
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    let released = poll(PLL_POLLS, || rcc.cr().read().pllrdy().bit_is_clear());
    locked && released
}

/// Asks up to `polls` times and says whether the answer was ever yes.
fn poll(polls: u32, mut is_ready: impl FnMut() -> bool) -> bool {
    (0..polls).any(|_| is_ready())
}

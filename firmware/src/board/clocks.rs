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
//! | starts | locks | crystal + PLL | 168 MHz | -0.93 % |
//! | dead | locks | internal RC + PLL | 166 MHz | +0.07 % and the RC's own error |
//! | any | dead | internal RC | 16 MHz | +2.1 % and the RC's own error |
//!
//! Without its crystal the box stays as fast as it was, so that acquisition keeps up (the
//! converters have a clock of their own, sample rates do not depend on this choice). The internal
//! oscillator is only good to 1 % at room temperature, though, and 8N1 bears about 3 % between
//! the two ends: 166 MHz instead of 168 MHz makes APB1 41.5 MHz, 45.03 clocks a bit, and leaves
//! that budget to the oscillator. The third row is the emulator's, where baud rates do not exist;
//! on a board it means broken silicon and a link that may or may not be readable.
//!
//! The polls are counted, not timed: before the choice is made there is no clock to trust, and
//! the cycle counter stands still in the emulator.

use core::fmt;

use stm32f4xx_hal::pac::RCC;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};
use stm32f4xx_hal::time::Hertz;

/// Frequency of the crystal the board is expected to carry.
const CRYSTAL: Hertz = Hertz::MHz(8);
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
}

/// Starts the best clock that works, and returns it.
pub fn start(rcc: RCC) -> (Rcc, Clock) {
    let source = match (pll_locks(&rcc), crystal_starts(&rcc)) {
        (true, true) => Source::CrystalPll,
        (true, false) => Source::InternalPll,
        (false, _) => Source::Internal,
    };
    if source != Source::CrystalPll {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    let config = match source {
        Source::CrystalPll => Config::hse(CRYSTAL).sysclk(SYSCLK_FROM_CRYSTAL),
        Source::InternalPll => Config::hsi().sysclk(SYSCLK_FROM_INTERNAL),
        Source::Internal => Config::hsi(),
    };
    let rcc = rcc.freeze(config);
    let core = rcc.clocks.sysclk();
    defmt::info!("clock {} {=u32} Hz", source, core.raw());
    (rcc, Clock { source, core })
}

/// Turns the crystal oscillator on, and leaves it on, to see whether it starts.
fn crystal_starts(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    poll(CRYSTAL_POLLS, || rcc.cr().read().hserdy().bit_is_set())
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

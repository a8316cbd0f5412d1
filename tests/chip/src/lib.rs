//! The STM32F405 around its processor, register by register, with what is wired to it: the ELF that
//! is flashed runs on it inside a test.
//!
//! QEMU's machine has neither the clocks, the flash controller nor the SPI of this chip, and forgives
//! every access to what it has. Here an access that the reference manual (RM0090) forbids is noted, and
//! a test that finds one fails: a peripheral whose clock is off, a PLL that is written while it
//! runs, a pin without its function, a bus beyond its device's clock, a chip select that rises within
//! a word.
//!
//! | module | content | RM0090 |
//! | --- | --- | --- |
//! | [`machine`] | processor, memories, time, resets, and the link as a [`Port`](massline::device::Port) | 2, 3 |
//! | [`bus`] | registers by their addresses, interrupts, forbidden accesses | 2.3, 12 |
//! | [`rcc`] | oscillators, PLL, clocks and resets of the peripherals | 7 |
//! | [`flash`] | keys, programming, erasing, cache of data, option bytes | 3 |
//! | [`gpio`] | pins, and their functions | 8 |
//! | [`timers`] | TIM2 to TIM5, TIM11 | 18, 19 |
//! | [`watchdog`] | IWDG | 21 |
//! | [`spi`] | SPI1, SPI2, SPI3 | 28 |
//! | [`dma`] | DMA1, DMA2 | 10 |
//! | [`usart`] | USART2 | 30 |
//! | [`mod@bench`] | converters, accelerometer, and crystals | |
//!
//! Time is that of the processor's cycles as the emulator charges them, which are no measurement:
//! order and values of accesses are what this shows. What a data sheet was misread for is misread
//! here, too.

#![forbid(unsafe_code)]

pub mod bench;
pub mod bus;
pub mod dma;
pub mod flash;
pub mod gpio;
pub mod machine;
pub mod rcc;
pub mod spi;
pub mod timers;
pub mod usart;
pub mod watchdog;

/// Picoseconds of a second: time is counted in picoseconds since the supply came.
pub const SECOND: u64 = 1_000_000_000_000;

/// An access to registers: its time, the clocks, and what it must not do.
pub struct Moment<'a> {
    /// Time, ps.
    pub now: u64,
    /// Clocks of the chip.
    pub clocks: rcc::Clocks,
    /// Accesses that the manual forbids, in words.
    pub forbidden: &'a mut Vec<String>,
}

impl Moment<'_> {
    /// Notes what the manual forbids.
    pub fn forbid(&mut self, words: impl Into<String>) {
        /// More would be the same ones again.
        const MOST: usize = 100;
        if self.forbidden.len() < MOST {
            self.forbidden.push(words.into());
        }
    }
}

/// Registers by their offsets, as they were written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words<const N: usize>([u32; N]);

impl<const N: usize> Default for Words<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

impl<const N: usize> Words<N> {
    /// The register at an offset; 0 beyond the last one.
    #[must_use]
    pub fn get(&self, offset: u32) -> u32 {
        self.0.get(offset as usize / 4).copied().unwrap_or(0)
    }

    /// Sets the register at an offset; nothing beyond the last one.
    pub fn set(&mut self, offset: u32, value: u32) {
        if let Some(word) = self.0.get_mut(offset as usize / 4) {
            *word = value;
        }
    }
}

/// A bit, or zero.
#[must_use]
pub const fn flag(bit: u32, is_set: bool) -> u32 {
    if is_set { bit } else { 0 }
}

/// Time of so many periods of a clock, ps.
#[must_use]
pub fn periods(count: u64, hz: u32) -> u64 {
    (u128::from(count) * u128::from(SECOND) / u128::from(hz.max(1))) as u64
}

/// Whole periods of a clock in a time in ps.
#[must_use]
pub fn counted(time: u64, hz: u32) -> u64 {
    (u128::from(time) * u128::from(hz) / u128::from(SECOND)) as u64
}

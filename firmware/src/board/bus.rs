//! The converters' buses: the ADS131M08's takes two bytes at a time.
//!
//! Samples come by DMA (`lanes`); this exchanges what sets converters up, and samples where there is no
//! DMA. The HAL exchanges a byte, tests four flags and exchanges the next. At 10.5 MHz a byte takes 128
//! cycles of the core, and what lies between two of them a fourth as much. Here it lies between
//! two words of 16 bits. One word is on its way at a time, so that an interrupt in between only
//! makes the bus wait. The HAL does not wait for the end of the last bit (`flush`), at which the
//! chip select may rise.

use core::fmt;
use core::ops::Deref;

use embedded_hal::spi::{Error, ErrorKind, ErrorType, Mode, Phase, Polarity, SpiBus};
use stm32f4xx_hal::pac::spi1::RegisterBlock;

/// Looks at a flag until the bus counts as dead: a word takes 256 cycles at 10.5 MHz, and 16 times
/// as many at the slowest clock.
const LOOKS: u32 = 4096;

/// Registers of an SPI, which the drivers' bus and a lane of DMA use in turn.
#[derive(Clone, Copy)]
pub struct Registers(*const RegisterBlock);

// SAFETY: a pointer to registers, which are where they are for every task. One task has both users.
unsafe impl Send for Registers {}

impl Deref for Registers {
    type Target = RegisterBlock;

    fn deref(&self) -> &RegisterBlock {
        // SAFETY: registers of the chip, at the address that the HAL gives.
        unsafe { &*self.0 }
    }
}

impl Registers {
    /// Sets an SPI up as master of bytes, whose clock is on and which is as a reset leaves it: the
    /// fastest clock up to `most`, Hz, by a power of two from that of its bus.
    pub fn start(spi: *const RegisterBlock, mode: Mode, clock: u32, most: u32) -> Self {
        // Code k divides by 2^(k + 1), k up to 7.
        let fits = |code: &u8| clock.wrapping_shr(u32::from(*code)) / 2 <= most;
        let divider = (0..7).find(fits).unwrap_or(7);
        let bus = Self(spi);
        bus.cr1().write(|w| {
            w.cpol().bit(mode.polarity == Polarity::IdleHigh);
            w.cpha().bit(mode.phase == Phase::CaptureOnSecondTransition);
            // The chip selects are pins of their own.
            w.mstr().set_bit().ssm().set_bit().ssi().set_bit();
            w.br().set(divider)
        });
        bus.cr1().modify(|_, w| w.spe().set_bit());
        bus
    }

    /// Code of the clock: it divides that of the bus by 2^(code + 1).
    pub fn divider(&self) -> u8 {
        self.cr1().read().br().bits()
    }

    /// Sets the code of the clock, while no word is on its way.
    pub fn set_divider(&self, code: u8) {
        self.cr1().modify(|_, w| w.br().set(code));
    }

    /// Address of the data register, for DMA.
    pub fn data(&self) -> u32 {
        self.dr().as_ptr().expose_provenance() as u32
    }

    /// Chooses between words of 8 and 16 bits, which the chip allows only while it is off.
    pub fn set_wide(&self, is_wide: bool) {
        if self.cr1().read().dff().bit() == is_wide {
            return;
        }
        self.cr1().modify(|_, w| w.spe().clear_bit());
        self.cr1().modify(|_, w| w.dff().bit(is_wide));
        self.cr1().modify(|_, w| w.spe().set_bit());
    }

    /// Waits until all words are out and the clock has come to rest, `false` if it does not.
    pub fn rest(&self) -> bool {
        let is_at_rest = || {
            let status = self.sr().read();
            status.txe().bit_is_set() && status.bsy().bit_is_clear()
        };
        within_reason(is_at_rest).is_ok()
    }

    /// Takes what was received and not read.
    pub fn forget(&self) {
        let _ = self.dr().read();
        let _ = self.sr().read();
    }
}

/// The bus, word by word.
pub struct Bus {
    spi: Registers,
    /// `true` if frames are one transfer each, which may be as wide as it likes.
    may_widen: bool,
}

impl Bus {
    /// A bus whose frames are one transfer each.
    pub const fn of_frames(spi: Registers) -> Self {
        Self {
            spi,
            may_widen: true,
        }
    }

    /// The same for frames of several transfers.
    pub const fn of_bytes(spi: Registers) -> Self {
        Self {
            spi,
            may_widen: false,
        }
    }

    #[inline(always)]
    fn exchange(&self, word: u16) -> Result<u16, Dead> {
        let spi = &self.spi;
        // There is room: the word before has come back.
        spi.dr().write(|w| w.dr().set(word));
        within_reason(|| spi.sr().read().rxne().bit_is_set())?;
        Ok(spi.dr().read().dr().bits())
    }

    fn exchange_byte(&mut self, byte: u8) -> Result<u8, Dead> {
        self.spi.set_wide(false);
        // Eight bits came; the others are zero.
        self.exchange(byte.into()).map(|word| word as u8)
    }
}

#[inline(always)]
fn within_reason(mut is_so: impl FnMut() -> bool) -> Result<(), Dead> {
    let mut looks = LOOKS;
    while !is_so() {
        looks -= 1;
        if looks == 0 {
            return Err(Dead);
        }
    }
    Ok(())
}

/// The bus does not move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dead;

impl fmt::Display for Dead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the SPI bus does not move")
    }
}

impl core::error::Error for Dead {}

impl Error for Dead {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ErrorType for Bus {
    type Error = Dead;
}

impl SpiBus for Bus {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Dead> {
        words.fill(0);
        self.transfer_in_place(words)
    }

    fn write(&mut self, words: &[u8]) -> Result<(), Dead> {
        words
            .iter()
            .try_for_each(|byte| self.exchange_byte(*byte).map(drop))
    }

    fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), Dead> {
        for k in 0..read.len().max(write.len()) {
            let byte = self.exchange_byte(write.get(k).copied().unwrap_or(0))?;
            if let Some(slot) = read.get_mut(k) {
                *slot = byte;
            }
        }
        Ok(())
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), Dead> {
        // The width changes between frames only: while the bus is off its clock line is not driven.
        if let (pairs, []) = words.as_chunks_mut::<2>()
            && self.may_widen
        {
            self.spi.set_wide(true);
            for pair in pairs {
                *pair = self.exchange(u16::from_be_bytes(*pair))?.to_be_bytes();
            }
            return Ok(());
        }
        for byte in words {
            *byte = self.exchange_byte(*byte)?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), Dead> {
        if self.spi.rest() { Ok(()) } else { Err(Dead) }
    }
}

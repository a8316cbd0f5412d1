//! The converters' buses: the ADS131M08's takes two bytes at a time.
//!
//! The HAL exchanges a byte, tests four flags and exchanges the next. At 10.5 MHz a byte takes 128
//! cycles of the core, and what lies between two of them a fourth as much. Here it lies between
//! two words of 16 bits. One word is on its way at a time, so that an interrupt in between only
//! makes the bus wait. The HAL does not wait for the end of the last bit (`flush`), at which the
//! chip select may rise.

use core::fmt;

use embedded_hal::spi::{Error, ErrorKind, ErrorType, SpiBus};
use stm32f4xx_hal::spi::{Instance, Spi};

/// Looks at a flag until the bus counts as dead: a word takes 256 cycles at 10.5 MHz, and 16 times
/// as many at the slowest clock that the HAL would choose.
const LOOKS: u32 = 4096;

/// The bus, set up by the HAL.
pub struct Bus<SPI> {
    spi: SPI,
    is_wide: bool,
    /// `true` if frames are one transfer each, which may be as wide as it likes.
    may_widen: bool,
}

impl<SPI: Instance> Bus<SPI> {
    /// Takes over what the HAL has set up; the pins keep their function. Frames are one transfer
    /// each.
    pub fn of_frames(spi: Spi<SPI>) -> Self {
        Self {
            may_widen: true,
            ..Self::of_bytes(spi)
        }
    }

    /// The same for frames of several transfers.
    pub fn of_bytes(spi: Spi<SPI>) -> Self {
        let (spi, _) = spi.release();
        Self {
            spi,
            is_wide: false,
            may_widen: false,
        }
    }

    /// Chooses between words of 8 and 16 bits, which the chip allows only while it is off.
    fn set_wide(&mut self, is_wide: bool) {
        if self.is_wide == is_wide {
            return;
        }
        self.is_wide = is_wide;
        self.spi.cr1().modify(|_, w| w.spe().clear_bit());
        self.spi.cr1().modify(|_, w| w.dff().bit(is_wide));
        self.spi.cr1().modify(|_, w| w.spe().set_bit());
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
        self.set_wide(false);
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

impl<SPI: Instance> ErrorType for Bus<SPI> {
    type Error = Dead;
}

impl<SPI: Instance> SpiBus for Bus<SPI> {
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
            self.set_wide(true);
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
        within_reason(|| self.spi.sr().read().bsy().bit_is_clear())
    }
}

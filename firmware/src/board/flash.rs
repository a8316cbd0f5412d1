//! The flash where settings are kept: the chip's last two sectors of 128 KiB.
//!
//! In an emulator there is a flash but nothing to write it with. Then settings hold until the
//! box is switched off, and it says so.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32f4xx_hal::flash::FlashExt;
use stm32f4xx_hal::pac::FLASH;

/// Place of the settings, from the beginning of the flash. `memory.x` keeps the program out of it.
pub const SETTINGS: core::ops::Range<u32> = 0xC_0000..0x10_0000;

/// The longest that the chip may stand still while a sector is erased, as its maker has it for
/// eight bits at a time, ms.
pub const ERASE_MS: u32 = 4_000;

/// The chip's flash.
pub struct Flash(FLASH);

impl Flash {
    /// `None` where it cannot be written.
    pub fn new(flash: FLASH) -> Option<Self> {
        // It is locked from the reset on. Nothing but an emulator says that it is not.
        let is_locked = flash.cr().read().lock().bit_is_set();
        is_locked.then_some(Self(flash))
    }

    fn part(&self, offset: u32, length: usize) -> Option<&[u8]> {
        let from = offset as usize;
        FlashExt::read(&self.0).get(from..from.checked_add(length)?)
    }
}

/// Why the flash failed: the HAL's reason has been logged.
#[derive(Clone, Copy, Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl From<stm32f4xx_hal::flash::Error> for Failed {
    fn from(error: stm32f4xx_hal::flash::Error) -> Self {
        defmt::error!("flash: {}", defmt::Debug2Format(&error));
        Self(error.kind())
    }
}

impl ErrorType for Flash {
    type Error = Failed;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let part = self.part(offset, bytes.len());
        bytes.copy_from_slice(part.ok_or(Failed(NorFlashErrorKind::OutOfBounds))?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SETTINGS.end as usize
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = 128 << 10;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        let erased = NorFlash::erase(&mut self.0.unlocked(), from, to);
        // Programming goes through the cache of data, erasing does not: what was read before would
        // be read again. The cache is emptied only while it is off.
        let is_on = self.0.acr().read().dcen().bit();
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().bit(is_on));
        Ok(erased?)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        self.part(offset, bytes.len())
            .ok_or(Failed(NorFlashErrorKind::OutOfBounds))?;
        Ok(NorFlash::write(&mut self.0.unlocked(), offset, bytes)?)
    }
}

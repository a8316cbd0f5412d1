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

/// Value of `BOR_LEV` for a reset below 2.8 V, the highest level (RM0090, 3.9.10). The names that
/// the register's description in Rust has for the values are in the wrong order.
const BROWN_OUT: u8 = 0b00;

impl Flash {
    /// `None` where it cannot be written.
    pub fn new(flash: FLASH) -> Option<Self> {
        // It is locked from the reset on. Nothing but an emulator says that it is not.
        let is_locked = flash.cr().read().lock().bit_is_set();
        is_locked.then(|| {
            let flash = Self(flash);
            flash.watch_supply();
            flash
        })
    }

    /// Has the chip reset below 2.8 V, once for good: chips are delivered with a limit of 1.7 V, at
    /// which converters and flash have failed long since.
    fn watch_supply(&self) {
        let flash = &self.0;
        if flash.optcr().read().bor_lev().bits() == BROWN_OUT {
            return;
        }
        self.settle();
        for key in [0x0819_2A3B, 0x4C5D_6E7F] {
            flash.optkeyr().write(|w| w.optkeyr().set(key));
        }
        // SAFETY: every value of the two bits is a level.
        flash
            .optcr()
            .modify(|_, w| unsafe { w.bor_lev().bits(BROWN_OUT) });
        flash.optcr().modify(|_, w| w.optstrt().set_bit());
        self.settle();
        flash.optcr().modify(|_, w| w.optlock().set_bit());
        defmt::info!("the level of the supply's watch was set");
    }

    /// Waits for the operation that is going on, and clears the flags of those before: with one of them
    /// set the next one would not begin, or be reported as failed.
    fn settle(&self) {
        while self.0.sr().read().bsy().bit_is_set() {}
        // SAFETY: ones clear the flags EOP, OPERR, WRPERR, PGAERR, PGPERR and PGSERR.
        self.0.sr().write(|w| unsafe { w.bits(0b1111_0011) });
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
        self.settle();
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
        self.settle();
        Ok(NorFlash::write(&mut self.0.unlocked(), offset, bytes)?)
    }
}

//! A NOR flash with power cuts, wrong bits and worn bytes.
//!
//! Programming clears bits, byte by byte; erasing sets them, all of a page at the same time.

use super::random::Random;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// A fault at a byte that is programmed or erased, counted from the start of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No fault.
    None,
    /// Power is lost at this byte. A byte that is programmed has some of its bits changed, and the
    /// bytes behind it are unchanged. A page that is erased has bits set all over, in proportion to
    /// the progress of the erase: its first and last bytes may be erased while others are not.
    Cut(u64),
    /// This byte is written with a wrong bit.
    Flip(u64, u8),
    /// The byte at this address is worn out and does not change.
    Worn(usize),
}

/// A flash of `PAGES` pages of `PAGE` bytes.
#[derive(Clone, Debug)]
pub struct Flash<const PAGE: usize, const PAGES: usize> {
    bytes: [[u8; PAGE]; PAGES],
    /// Bytes programmed or erased so far.
    worked: u64,
    fault: Fault,
    is_on: bool,
    random: Random,
}

/// Error of the flash: its power is cut, or the address is out of bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError(NorFlashErrorKind);

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl<const PAGE: usize, const PAGES: usize> Flash<PAGE, PAGES> {
    /// An erased flash.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self {
            bytes: [[0xFF; PAGE]; PAGES],
            worked: 0,
            fault: Fault::None,
            is_on: true,
            random: Random::new(seed),
        }
    }

    /// Sets the fault to come.
    pub const fn inject(&mut self, fault: Fault) {
        self.fault = fault;
    }

    /// Bytes programmed or erased so far.
    #[must_use]
    pub const fn worked(&self) -> u64 {
        self.worked
    }

    /// `true` if power is cut.
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        !self.is_on
    }

    /// Switches power on again, without a fault to come.
    pub const fn switch_on(&mut self) {
        self.is_on = true;
        self.fault = Fault::None;
    }

    /// Flips a stored bit.
    pub fn flip(&mut self, address: usize, bit: u8) {
        if let Some(byte) = self.bytes.as_flattened_mut().get_mut(address) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// Changes a byte to `to`, unless a fault prevents it.
    fn change(&mut self, address: usize, to: u8) -> Result<(), FlashError> {
        let now = self.worked;
        self.worked += 1;
        let fault = self.fault;
        let some = self.random.bits() as u8;
        let byte = self.bytes.as_flattened_mut().get_mut(address);
        let byte = byte.ok_or(FlashError(NorFlashErrorKind::OutOfBounds))?;
        match fault {
            Fault::Cut(at) if at == now => {
                // Some of the bits that differ have changed.
                *byte ^= (*byte ^ to) & some;
                self.is_on = false;
                Err(FlashError(NorFlashErrorKind::Other))
            }
            Fault::Flip(at, bit) if at == now => {
                *byte = to ^ (1 << (bit % 8));
                Ok(())
            }
            Fault::Worn(worn) if worn == address => Ok(()),
            _ => {
                *byte = to;
                Ok(())
            }
        }
    }

    /// Sets each bit of the page at `from` with a probability of `done` / `PAGE`.
    fn erase_in_part(&mut self, from: usize, done: u64) {
        let page = self.bytes.as_flattened_mut().iter_mut();
        for byte in page.skip(from).take(PAGE) {
            let chances = self.random.bits().to_le_bytes();
            for (bit, chance) in chances.into_iter().enumerate() {
                let is_set = u64::from(chance) * (PAGE as u64) < done * 256;
                *byte |= u8::from(is_set) << bit;
            }
        }
    }

    const fn check(&self) -> Result<(), FlashError> {
        if self.is_on {
            Ok(())
        } else {
            Err(FlashError(NorFlashErrorKind::Other))
        }
    }
}

impl<const PAGE: usize, const PAGES: usize> ErrorType for Flash<PAGE, PAGES> {
    type Error = FlashError;
}

impl<const PAGE: usize, const PAGES: usize> ReadNorFlash for Flash<PAGE, PAGES> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.check()?;
        let from = offset as usize;
        let found = self.bytes.as_flattened().get(from..from + bytes.len());
        bytes.copy_from_slice(found.ok_or(FlashError(NorFlashErrorKind::OutOfBounds))?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        PAGE * PAGES
    }
}

impl<const PAGE: usize, const PAGES: usize> NorFlash for Flash<PAGE, PAGES> {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.check()?;
        for address in from as usize..to as usize {
            let done = self.worked;
            if let Fault::Cut(at) = self.fault
                && address % PAGE == 0
                && (done..done + PAGE as u64).contains(&at)
            {
                self.erase_in_part(address, at - done);
                self.worked = at + 1;
                self.is_on = false;
                return Err(FlashError(NorFlashErrorKind::Other));
            }
            self.change(address, 0xFF)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.check()?;
        for (address, &byte) in (offset as usize..).zip(bytes) {
            let old = self.bytes.as_flattened().get(address).copied().unwrap_or(0);
            // Bits can only be cleared.
            self.change(address, old & byte)?;
        }
        Ok(())
    }
}

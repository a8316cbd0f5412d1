//! Settings in flash, safe from power cuts.
//!
//! # Design
//!
//! All settings are one item, so that a cut leaves the old ones or the new ones and never some of
//! each. `journal` places items in the pages, and reads each back after writing it; this file
//! converts items to settings.
//!
//! On the STM32F405 the pages are the last two sectors of 128 KiB. Erasing one stops the chip for
//! one second, two at the worst, since program and settings share one bank: save between runs.
//! The largest settings of 32 inputs take 4 KiB, so that a sector is erased at the first and at
//! every thirtieth save.

use super::Settings;
use super::journal::{CELL, Journal, item_room};
use super::layout::{self, LayoutError};
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Bytes of the buffer to load and save the settings of a box with that many inputs.
#[must_use]
pub const fn room(inputs: usize) -> usize {
    item_room(layout::room(inputs))
}

/// Content of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loaded {
    /// Settings, written by this version of the layout.
    Settings(u16),
    /// No settings: the flash is as delivered.
    Nothing,
}

/// Error of reading or writing settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The range is not made of two or more whole pages.
    Range,
    /// The flash failed.
    Flash,
    /// The flash is not empty, but holds no valid settings. A save makes it usable again.
    Corrupted,
    /// The buffer or a page is too small for the settings.
    Room,
    /// The settings are in an unknown layout.
    Layout(LayoutError),
    /// The bytes read back are not those written.
    Verify,
}

impl core::fmt::Display for StoreError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Range => f.write_str("settings need two whole pages of flash or more"),
            Self::Flash => f.write_str("the flash failed"),
            Self::Corrupted => f.write_str("the flash holds no settings that can be read"),
            Self::Room => f.write_str("there is no room for the settings"),
            Self::Layout(LayoutError::Newer { found }) => write!(
                f,
                "settings of version {found} come from a later firmware; the latest known here is {}",
                layout::VERSION
            ),
            Self::Layout(LayoutError::Malformed) => {
                f.write_str("the settings in the flash cannot be read")
            }
            Self::Verify => f.write_str("the flash does not hold the bytes that were written"),
        }
    }
}

impl core::error::Error for StoreError {}

/// A part of a flash that holds settings.
pub struct Store<F>(Journal<F>);

impl<F: NorFlash> Store<F> {
    /// Settings in a range of addresses of a flash: two pages or more.
    ///
    /// # Errors
    ///
    /// [`StoreError::Range`].
    pub fn new(flash: F, range: Range<u32>) -> Result<Self, StoreError> {
        let journal = Journal::new(flash, range);
        journal.map(Self).ok_or(StoreError::Range)
    }

    /// Returns the flash.
    pub fn release(self) -> F {
        self.0.release()
    }

    /// Reads the last settings that were written completely; without any, `settings` are as
    /// delivered. `buffer` has [`room`] bytes. Nothing is written.
    ///
    /// # Errors
    ///
    /// [`StoreError`]; `settings` are as delivered then. [`StoreError::Corrupted`] includes a power
    /// cut during the first save, and the journal of an earlier firmware.
    pub fn load<const INPUTS: usize>(
        &mut self,
        settings: &mut Settings<INPUTS>,
        buffer: &mut [u8],
    ) -> Result<Loaded, StoreError> {
        settings.deliver();
        let survey = self.0.survey().map_err(|_| StoreError::Flash)?;
        let Some(newest) = survey.newest else {
            return if survey.is_erased {
                Ok(Loaded::Nothing)
            } else {
                Err(StoreError::Corrupted)
            };
        };
        let read = self.0.read(&newest, buffer);
        let bytes = read.map_err(|_| StoreError::Flash)?;
        let bytes = bytes.ok_or(StoreError::Room)?;
        let version = layout::read(bytes, settings).map_err(StoreError::Layout)?;
        Ok(Loaded::Settings(version))
    }

    /// Saves settings. After a return without an error they survive any power cut; if power fails
    /// before, these or the last ones do. `buffer` has [`room`] bytes.
    ///
    /// # Errors
    ///
    /// [`StoreError`]; the flash then holds these or the last ones.
    pub fn save<const INPUTS: usize>(
        &mut self,
        settings: &Settings<INPUTS>,
        buffer: &mut [u8],
    ) -> Result<(), StoreError> {
        let contents = buffer.get_mut(CELL..).ok_or(StoreError::Room)?;
        let length = layout::write(settings, contents).ok_or(StoreError::Room)?;
        let item = buffer.get_mut(..item_room(length));
        let item = item.filter(|item| item.len() <= Journal::<F>::page_size());
        let item = item.ok_or(StoreError::Room)?;
        let length = u16::try_from(length).map_err(|_| StoreError::Room)?;
        match self.0.append(item, length) {
            Ok(true) => Ok(()),
            Ok(false) => Err(StoreError::Verify),
            Err(_) => Err(StoreError::Flash),
        }
    }
}

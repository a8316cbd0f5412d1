//! Settings in flash, safe from power cuts.
//!
//! # Design
//!
//! All settings are one item, so that a cut leaves the old ones or the new ones and never some of
//! each. Items are appended, each with its checksums, over two or more pages in turn; the last
//! whole one counts. A page is erased only when a later one holds a whole item. That is
//! `sequential-storage`'s work; this file lends it a flash that does not wait, and reads back
//! what was written before it says that it is kept.
//!
//! On the STM32F405 the pages are the last two sectors of 128 KiB. Erasing one stops the chip for
//! one second, two at the worst, since program and settings share one bank: save between runs.
//! The largest settings of 32 inputs take 4 KiB, so that a sector is erased every thirtieth time.

use super::Settings;
use super::layout::{self, LayoutError};
use core::future::Future;
use core::ops::Range;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, ReadNorFlash};
use embedded_storage_async::nor_flash as waiting;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage, SerializationError, Value};

/// The only key.
const KEY: u8 = 0;
/// Times that a write is tried.
const TRIES: usize = 2;

/// What was found in the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loaded {
    /// Settings, written by this version of the layout.
    Settings(u16),
    /// Nothing: the box is as it was delivered.
    Nothing,
}

/// Why settings were not read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The range is not made of whole pages, or of fewer than two.
    Range,
    /// The flash failed.
    Flash,
    /// The flash holds nothing that can be read, but is not empty. Saving makes it usable again.
    Corrupted,
    /// The buffer has no room for the settings, or a page has none.
    Room,
    /// They are kept in a layout that this firmware does not know.
    Layout(LayoutError),
    /// What was read back is not what was written.
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
                "settings of version {found} come from a later firmware, this one knows {}",
                layout::VERSION
            ),
            Self::Layout(LayoutError::Malformed) => {
                f.write_str("the settings in the flash make no sense")
            }
            Self::Verify => f.write_str("the flash does not keep what is written"),
        }
    }
}

impl core::error::Error for StoreError {}

/// A part of a flash that keeps settings.
pub struct Store<F: NorFlash> {
    map: MapStorage<u8, Prompt<F>, Cache<Uncached, Uncached, Uncached, u8>>,
}

impl<F: NorFlash> Store<F> {
    /// Settings in a range of addresses of a flash: two pages or more.
    ///
    /// # Errors
    ///
    /// [`StoreError::Range`].
    pub fn new(flash: F, range: Range<u32>) -> Result<Self, StoreError> {
        let config = MapConfig::try_new(range).map_err(|_| StoreError::Range)?;
        Ok(Self {
            map: MapStorage::new(Prompt(flash), config, Cache::new_uncached()),
        })
    }

    /// Gives the flash back.
    pub fn release(self) -> F {
        self.map.destroy().0.0
    }

    /// Reads the last settings that were written whole; where there are none, `settings` become
    /// those as delivered. `buffer` has [`layout::room`] bytes and some ten more.
    ///
    /// # Errors
    ///
    /// [`StoreError`]; the box then goes on as delivered, and says so.
    pub fn load<const INPUTS: usize>(
        &mut self,
        settings: &mut Settings<INPUTS>,
        buffer: &mut [u8],
    ) -> Result<Loaded, StoreError> {
        *settings = Settings::DELIVERED;
        let found = prompt(self.map.fetch_item::<&[u8]>(buffer, &KEY))?;
        let Some(bytes) = found else {
            return Ok(Loaded::Nothing);
        };
        let version = layout::read(bytes, settings).map_err(StoreError::Layout)?;
        Ok(Loaded::Settings(version))
    }

    /// Keeps settings. When this has returned without an error, they survive anything but a
    /// broken flash; if power fails before, these or the last ones do.
    ///
    /// # Errors
    ///
    /// [`StoreError`]; the flash then holds these or the last ones.
    pub fn save<const INPUTS: usize>(
        &mut self,
        settings: &Settings<INPUTS>,
        buffer: &mut [u8],
    ) -> Result<(), StoreError> {
        for _ in 0..TRIES {
            match self.save_once(settings, buffer) {
                // Bits that had flipped in what should be erased: another place may do.
                Err(StoreError::Verify | StoreError::Corrupted) => {}
                other => return other,
            }
        }
        // Only a flash whose contents have changed by themselves comes here. It is worth less
        // than the settings that are at hand.
        prompt(self.map.erase_all())?;
        self.save_once(settings, buffer)
    }

    fn save_once<const INPUTS: usize>(
        &mut self,
        settings: &Settings<INPUTS>,
        buffer: &mut [u8],
    ) -> Result<(), StoreError> {
        prompt(self.map.store_item(buffer, &KEY, &Image(settings)))?;
        match prompt(self.map.fetch_item::<&[u8]>(buffer, &KEY))? {
            Some(kept) if layout::holds(kept, settings) => Ok(()),
            _ => Err(StoreError::Verify),
        }
    }
}

/// Settings on their way into an item.
struct Image<'s, const INPUTS: usize>(&'s Settings<INPUTS>);

impl<'a, const INPUTS: usize> Value<'a> for Image<'_, INPUTS> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        layout::write(self.0, buffer).ok_or(SerializationError::BufferTooSmall)
    }

    fn deserialize_from(_: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        // It refers to settings that are elsewhere; bytes are read as bytes.
        Err(SerializationError::InvalidFormat)
    }
}

/// A flash that is ready when it returns, behind the trait of those one waits for.
struct Prompt<F>(F);

impl<F: ErrorType> ErrorType for Prompt<F> {
    type Error = F::Error;
}

impl<F: ReadNorFlash> waiting::ReadNorFlash for Prompt<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<F: NorFlash> waiting::NorFlash for Prompt<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        self.0.erase(from, to)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        self.0.write(offset, bytes)
    }
}

/// Runs to the end what never waits.
fn prompt<T, E: NorFlashError>(
    future: impl Future<Output = Result<T, sequential_storage::Error<E>>>,
) -> Result<T, StoreError> {
    use sequential_storage::Error;

    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    let result = loop {
        if let Poll::Ready(result) = future.as_mut().poll(&mut context) {
            break result;
        }
    };
    result.map_err(|error| match error {
        Error::Storage { .. } => StoreError::Flash,
        // There is one key: pages that have no room for its item are full of what was not
        // written here.
        Error::Corrupted { .. } | Error::LogicBug { .. } | Error::FullStorage => {
            StoreError::Corrupted
        }
        Error::BufferTooSmall(_) | Error::ItemTooBig => StoreError::Room,
        Error::SerializationError(SerializationError::BufferTooSmall) => StoreError::Room,
        _ => StoreError::Corrupted,
    })
}

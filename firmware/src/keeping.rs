//! The box's settings, and where they are kept.

use massline_firmware::sampling::INPUTS;
use massline_firmware::settings::{Settings, Store, store};
use massline_firmware::wire::{Problem, Setting, SettingKey, Storage};
use stm32f4xx_hal::pac::FLASH;

use crate::flash::{self, Flash};

/// Bytes that settings take at most on their way from and to the flash.
const ROOM: usize = store::room(INPUTS);

/// The settings.
pub struct Keeping {
    settings: &'static mut Settings<INPUTS>,
    store: Option<Store<Flash>>,
    is_unsaved: bool,
    failures: u32,
}

impl Keeping {
    /// Reads what the flash holds into `settings`; where that fails, the box is as it was
    /// delivered, and the failure is counted.
    pub fn open(flash: FLASH, settings: &'static mut Settings<INPUTS>) -> Self {
        let store = Flash::new(flash).and_then(|flash| Store::new(flash, flash::SETTINGS).ok());
        let mut keeping = Self {
            settings,
            store,
            is_unsaved: false,
            failures: 0,
        };
        keeping.load();
        keeping
    }

    #[inline(never)] // The buffer leaves the stack before anything else is done.
    fn load(&mut self) {
        let Some(store) = &mut self.store else {
            return;
        };
        let mut buffer = [0; ROOM];
        if let Err(error) = store.load(self.settings, &mut buffer) {
            defmt::error!("settings: {}", defmt::Display2Format(&error));
            self.failures += 1;
        }
    }

    /// Where they are kept.
    pub const fn storage(&self) -> Storage {
        match self.store {
            Some(_) => Storage::Flash,
            None => Storage::Volatile,
        }
    }

    /// The settings.
    pub const fn settings(&self) -> &Settings<INPUTS> {
        self.settings
    }

    /// Changes one.
    ///
    /// # Errors
    ///
    /// As [`Settings::set`].
    pub fn write(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        self.settings.set(setting)?;
        self.is_unsaved = true;
        Ok(())
    }

    /// Keeps them; says where. It takes a second now and then, in which the chip stands still.
    ///
    /// # Errors
    ///
    /// [`Problem::Storage`].
    #[inline(never)] // The buffer is on the stack only meanwhile.
    pub fn save(&mut self) -> Result<Storage, Problem> {
        if let Some(store) = &mut self.store {
            let mut buffer = [0; ROOM];
            if let Err(error) = store.save(self.settings, &mut buffer) {
                defmt::error!("settings: {}", defmt::Display2Format(&error));
                self.failures = self.failures.saturating_add(1);
                return Err(Problem::Storage(SettingKey::Name));
            }
        }
        self.is_unsaved = false;
        Ok(self.storage())
    }

    /// Back to those the box was delivered with.
    pub fn reset(&mut self) {
        *self.settings = Settings::DELIVERED;
        self.is_unsaved = true;
    }

    /// Whether some are not kept.
    pub const fn unsaved(&self) -> bool {
        self.is_unsaved
    }

    /// Reads and writes that failed.
    pub const fn failures(&self) -> u32 {
        self.failures
    }

    /// Counts them anew.
    pub const fn forget_failures(&mut self) {
        self.failures = 0;
    }
}

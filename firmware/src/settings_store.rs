//! The box's settings in use, and their copy in flash.

use massline_firmware::sampling::INPUTS;
use massline_firmware::settings::{Settings, Store, store};
use massline_firmware::wire::{Problem, Setting, SettingKey, Storage};

use crate::board::flash::{self, Flash};

/// Most bytes of encoded settings.
const ROOM: usize = store::room(INPUTS);

/// The settings in use, and the store that keeps them over a restart.
pub struct SettingsStore {
    settings: &'static mut Settings<INPUTS>,
    store: Option<Store<Flash>>,
    is_unsaved: bool,
    failures: u32,
}

impl SettingsStore {
    /// Reads the flash into `settings`. Where that fails, the settings are those of delivery, and
    /// the failure is counted; without a `flash` that can be written they last until the box is
    /// switched off.
    pub fn open(flash: Option<Flash>, settings: &'static mut Settings<INPUTS>) -> Self {
        let store = flash.and_then(|flash| Store::new(flash, flash::SETTINGS).ok());
        let mut opened = Self {
            settings,
            store,
            is_unsaved: false,
            failures: 0,
        };
        opened.load();
        opened
    }

    #[inline(never)] // The buffer leaves the stack before anything else is done.
    fn load(&mut self) {
        let Some(store) = &mut self.store else {
            return;
        };
        let mut buffer = [0; ROOM];
        if let Err(error) = store.load(self.settings, &mut buffer) {
            defmt::error!("settings: {}", defmt::Display2Format(&error));
            self.failures = self.failures.saturating_add(1);
        }
    }

    /// The place where settings are saved.
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

    /// Changes one setting in use.
    ///
    /// # Errors
    ///
    /// As [`Settings::set`].
    pub fn write(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        self.settings.set(setting)?;
        self.is_unsaved = true;
        Ok(())
    }

    /// Saves the settings and returns the place. It takes a second now and then, in which the chip
    /// stands still.
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

    /// Sets the settings in use to those of delivery.
    pub fn reset(&mut self) {
        self.settings.deliver();
        self.is_unsaved = true;
    }

    /// `true` if settings were changed and not saved.
    pub const fn unsaved(&self) -> bool {
        self.is_unsaved
    }

    /// Number of reads and writes that failed.
    pub const fn failures(&self) -> u32 {
        self.failures
    }

    /// Sets that number to zero.
    pub const fn forget_failures(&mut self) {
        self.failures = 0;
    }
}

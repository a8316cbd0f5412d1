//! A board without hardware: its clock is set by hand, and its settings last as long as it does.

use crate::drivers::Lowpass;
use crate::instrument::{Board, Identity, Vitals};
use crate::sampling::{self, INPUTS, Plan};
use crate::settings::Settings;
use crate::wire::{
    ClockSource, Conditions, DRDY_LINES, FaultCounters, Field, Item, Probe, Probed, Problem,
    Provoke, ResetReason, Setting, SettingKey, Storage,
};

/// Ticks per second.
pub const TICK_HZ: u32 = 1_000_000;

/// Identity of a box with this board.
pub const IDENTITY: Identity<'static> = Identity {
    firmware: "model",
    version: "0",
    build: "host",
    chip: "none",
    serial: [0; 12],
    clock: ClockSource::Internal,
    clock_hz: TICK_HZ,
    tick_hz: TICK_HZ,
    storage: Storage::Volatile,
    reset: ResetReason::PowerOn,
    resets: 0,
    panic: None,
    inputs: INPUTS as u8,
    window: 8,
};

/// The board.
#[derive(Clone, Debug)]
pub struct ModelBoard {
    /// Time, ticks.
    pub ticks: u64,
    /// Sample rate of the running converters, Hz.
    pub converting: Option<f64>,
    /// Number of the converters' next sample.
    pub samples: u64,
    /// The settings.
    pub settings: Settings<INPUTS>,
    /// The settings that were saved last.
    pub saved: Settings<INPUTS>,
    /// The settings as delivered.
    pub delivered: Settings<INPUTS>,
    /// Number of resets, those by a provoked fault included.
    pub resets: u32,
    /// Number of requested test patterns.
    pub test_patterns: u32,
}

impl ModelBoard {
    /// A board with these settings as delivered.
    #[must_use]
    pub fn new(delivered: Settings<INPUTS>) -> Self {
        Self {
            ticks: 0,
            converting: None,
            samples: 0,
            settings: delivered.clone(),
            saved: delivered.clone(),
            delivered,
            resets: 0,
            test_patterns: 0,
        }
    }
}

impl Board for ModelBoard {
    fn ticks(&self) -> u64 {
        self.ticks
    }

    fn input_samples(&self) -> u64 {
        self.samples
    }

    fn faults(&self) -> FaultCounters {
        FaultCounters::default()
    }

    fn forget_faults(&mut self) {}

    fn vitals(&mut self) -> Vitals {
        Vitals::default()
    }

    fn start_inputs(&mut self, sample_rate: f64, conditions: Conditions) -> Result<(), Problem> {
        match self.converting {
            Some(running) if running != sample_rate => {
                return Err(Problem::range(
                    Field::SampleRate,
                    0,
                    sample_rate,
                    [running; 2],
                ));
            }
            Some(_) => {}
            None => {
                Plan::new(&self.settings, sample_rate, conditions, TICK_HZ)?;
                self.converting = Some(sample_rate);
                self.samples = 0;
            }
        }
        Ok(())
    }

    fn lowpass(&self, input: usize, sample_rate: f64) -> Option<Lowpass> {
        sampling::lowpass(input, sample_rate)
    }

    fn stop_inputs(&mut self) {
        self.converting = None;
    }

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        self.settings.get(key)
    }

    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        self.settings.set(setting)
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        self.saved = self.settings.clone();
        Ok(Storage::Volatile)
    }

    fn reset_settings(&mut self) {
        self.settings = self.delivered.clone();
    }

    fn unsaved(&self) -> bool {
        self.settings != self.saved
    }

    fn reboot(&mut self) {
        self.resets += 1;
    }

    /// All converters are sound; no line has had an edge; there are no buses and no crystal.
    fn probe(&mut self, probe: Probe) -> Result<Probed, Problem> {
        match probe {
            Probe::Skew => Ok(Probed::Skew([None; DRDY_LINES])),
            Probe::Converter(_) => Ok(Probed::Converter(None)),
            Probe::Crystal | Probe::Loop(_) => Err(Problem::Unsupported(Item::Probe)),
        }
    }

    fn provoke(&mut self, fault: Provoke) -> bool {
        match fault {
            Provoke::TestPattern => self.test_patterns += 1,
            _ => self.resets += 1,
        }
        true
    }
}

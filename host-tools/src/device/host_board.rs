//! The board around the instrument in this program: a clock, settings that last
//! as long as the program, and modelled converters where something is wired to them.

use crate::rig::{CHIPS, Chain, Inputs, RigError};
use crate::simulate::Stream;
use massline_firmware::acquisition::SETTLING;
use massline_firmware::instrument::{Board, Vitals};
use massline_firmware::sampling::{INPUTS, Plan};
use massline_firmware::settings::Settings;
use massline_firmware::wire::{
    Conditions, ConverterFault, FaultCounters, Health, Item, LinkCounters, Problem, Provoke,
    Setting, SettingKey, Storage,
};
use std::rc::Rc;
use std::time::Instant;

/// Ticks are microseconds here.
pub(super) const TICK_HZ: u32 = 1_000_000;
/// Crystals keep to this share: this computer's against the converters'.
const CRYSTAL: f64 = 20e-6;

/// The board.
pub(super) struct HostBoard {
    pub(super) link: LinkCounters,
    started: Instant,
    /// By how much time runs ahead of this computer's, s: what the inputs' samples took.
    ahead: f64,
    kept: Box<Settings<INPUTS>>,
    settings: Box<Settings<INPUTS>>,
    delivered: Box<Settings<INPUTS>>,
    inputs: Option<Inputs>,
    running: Option<Running>,
    /// Times that they were started.
    starts: u64,
    /// By how much the converters are too fast, relative.
    fast: f64,
    /// Faults of converters that no longer run.
    faults: FaultCounters,
}

/// Inputs that run.
struct Running {
    chain: Chain<Rc<[Vec<f32>]>>,
    /// Inputs up to the last one that something is wired to: no others are handed over.
    inputs: usize,
    /// When they were started, s.
    since: f64,
}

impl HostBoard {
    pub(super) fn new(inputs: Option<Inputs>) -> Self {
        let mut delivered = Box::new(Settings::DELIVERED);
        // Both are within their bounds.
        let _ = delivered.set(&Setting::Name("massline"));
        let mut fast = 0.0;
        if let Some(inputs) = &inputs {
            for (number, certificate) in (0..).zip(inputs.certificates()) {
                // It is one that was checked when it was made.
                let _ = delivered.set(&Setting::Input(certificate.input(number)));
            }
            fast = CRYSTAL * Stream::new(inputs.seed(), &["crystal"]).signed();
        }
        Self {
            link: LinkCounters::default(),
            started: Instant::now(),
            ahead: 0.0,
            kept: delivered.clone(),
            settings: delivered.clone(),
            delivered,
            inputs,
            running: None,
            starts: 0,
            fast,
            faults: FaultCounters::default(),
        }
    }

    /// Time since the start, s: while the inputs run, that of their samples.
    pub(super) fn seconds(&self) -> f64 {
        match &self.running {
            Some(running) => running.since + running.chain.seconds() / (1.0 + self.fast),
            None => self.started.elapsed().as_secs_f64() + self.ahead,
        }
    }

    /// Has the inputs take a sample, if they run: its number. Counts and faults go into the
    /// lists.
    pub(super) fn convert(
        &mut self,
        counts: &mut Vec<i32>,
        health: &mut Vec<Health>,
    ) -> Option<u64> {
        let running = self.running.as_mut()?;
        counts.clear();
        health.clear();
        // The first ones after a start are of filters that settle: they are nobody's.
        let number = loop {
            let taken = running.chain.step(|sample| {
                let settled = sample.number > SETTLING.into();
                settled.then(|| {
                    counts.extend_from_slice(sample.counts);
                    health.extend_from_slice(sample.health);
                    sample.number
                })
            });
            if let Some(number) = taken {
                break number;
            }
        };
        // The accelerometer is left out.
        counts.resize(running.inputs, 0);
        health.resize(running.inputs, Health::MISSING);
        Some(number)
    }

    /// Refuses an input of a box that has none.
    fn check(&self, input: u8) -> Result<(), Problem> {
        if self.inputs.is_some() {
            return Ok(());
        }
        Err(Problem::Index {
            item: Item::Input,
            found: u32::from(input),
            limit: 0,
        })
    }
}

impl Board for HostBoard {
    fn ticks(&self) -> u64 {
        (self.seconds() * f64::from(TICK_HZ)) as u64
    }

    fn input_samples(&self) -> u64 {
        self.running.as_ref().map_or(0, |r| r.chain.number())
    }

    fn faults(&self) -> FaultCounters {
        match &self.running {
            Some(running) => *running.chain.faults(),
            None => self.faults,
        }
    }

    fn forget_faults(&mut self) {
        self.faults = FaultCounters::default();
        if let Some(running) = &mut self.running {
            running.chain.forget_faults();
        }
    }

    fn vitals(&mut self) -> Vitals {
        Vitals {
            link: self.link,
            ..Vitals::default()
        }
    }

    fn start_inputs(&mut self, sample_rate: f64, conditions: Conditions) -> Result<(), Problem> {
        let inputs = self.inputs.as_ref();
        let inputs = inputs.ok_or(Problem::Unsupported(Item::Input))?;
        if self.running.is_some() {
            return Ok(());
        }
        let plan = Plan::new(&self.settings, sample_rate, conditions, TICK_HZ)?;
        let no_answer = |converter| Problem::Converter {
            converter,
            fault: ConverterFault::Stuck,
        };
        // There is no model of the accelerometer's bus here.
        if plan.used >> CHIPS & 1 == 1 {
            return Err(no_answer(CHIPS as u8));
        }
        let chain = inputs.chain(sample_rate, &plan.gains, conditions.signal, self.starts);
        let chain = chain.map_err(|error| match error {
            RigError::Start { number, .. } => no_answer(number),
            // The plan has seen to the rest.
            _ => Problem::Unsupported(Item::Input),
        })?;
        self.starts += 1;
        let since = self.seconds();
        self.running = Some(Running {
            chain,
            inputs: plan.inputs,
            since,
        });
        Ok(())
    }

    fn stop_inputs(&mut self) {
        let now = self.seconds();
        if let Some(running) = self.running.take() {
            self.faults = *running.chain.faults();
            self.ahead = now - self.started.elapsed().as_secs_f64();
        }
    }

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        if let SettingKey::Input(input) = key {
            self.check(input)?;
        }
        self.settings.get(key)
    }

    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        if let Setting::Input(input) = setting {
            self.check(input.input)?;
        }
        self.settings.set(setting)
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        self.kept = self.settings.clone();
        Ok(Storage::Volatile)
    }

    fn reset_settings(&mut self) {
        self.settings = self.delivered.clone();
    }

    fn unsaved(&self) -> bool {
        self.settings != self.kept
    }

    fn reboot(&mut self) {}

    fn provoke(&mut self, _: Provoke) -> bool {
        false
    }
}

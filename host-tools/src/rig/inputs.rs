//! Sensors that are wired to the inputs of a box in this program.

use super::{Chain, Felt, Outfit, RigError, Troubles};
use crate::setup::Setup;
use crate::simulate::{Model, Options, Recording, simulate};
use massline_firmware::calibration::Certificate;
use massline_firmware::drivers::Signal;
use std::cell::Cell;
use std::rc::Rc;

/// Length of the shaking that is felt over and over, s.
const SHAKING: f64 = 120.0;

/// Sensors at the inputs of a box, which feel a simulated recording over and over.
#[derive(Clone, Debug)]
pub struct Inputs {
    outfit: Outfit,
    recordings: Rc<[Recording]>,
    felt: Vec<Rc<[Vec<f32>]>>,
    shaker: Shaker,
    troubles: Troubles,
}

/// Decides which of the recordings the sensors feel.
#[derive(Clone, Debug)]
pub struct Shaker {
    recordings: Rc<[Recording]>,
    runs: Vec<String>,
    at: Rc<Cell<usize>>,
}

impl Shaker {
    /// From the next start of the converters on it shakes as in a run; as before if it knows
    /// none of that name.
    pub fn shake(&self, run: &str) {
        if let Some(at) = self.runs.iter().position(|name| name == run) {
            self.at.set(at);
        }
    }

    /// Names of the channels, input by input.
    #[must_use]
    pub fn channels(&self) -> &[String] {
        self.recordings.first().map_or(&[], |r| &r.channels)
    }
}

impl Inputs {
    /// The sensors of a setup, which feel one of its recordings: its first channel at the
    /// first input, and so on. Faults are those of `troubles`, whose seed decides what the
    /// converters do by chance as well.
    ///
    /// # Errors
    /// [`RigError`].
    pub fn new(setup: &Setup, recording: &Recording, troubles: Troubles) -> Result<Self, RigError> {
        Self::of(setup, vec![recording.clone()], troubles)
    }

    fn of(setup: &Setup, recordings: Vec<Recording>, troubles: Troubles) -> Result<Self, RigError> {
        let recordings: Rc<[Recording]> = recordings.into();
        let felt = recordings.iter().map(|r| r.samples.clone().into());
        Ok(Self {
            outfit: Outfit::new(setup, &recordings)?,
            felt: felt.collect(),
            shaker: Shaker {
                recordings: Rc::clone(&recordings),
                runs: setup.runs.iter().map(|run| run.name.clone()).collect(),
                at: Rc::new(Cell::new(0)),
            },
            recordings,
            troubles,
        })
    }

    /// The tuning fork under lateral shaking: its drive at the first input, its sensors in the
    /// order of the setup behind it.
    ///
    /// # Errors
    /// The error of the simulation.
    pub fn fork(troubles: Troubles) -> Result<Self, Box<dyn std::error::Error>> {
        Self::fork_runs(troubles, 1)
    }

    /// The same with its first `runs` runs, for [`Shaker::shake`] to choose from.
    ///
    /// # Errors
    /// The error of the simulation.
    pub fn fork_runs(troubles: Troubles, runs: usize) -> Result<Self, Box<dyn std::error::Error>> {
        let mut model = Model::fork()?;
        model.runs.truncate(runs.max(1));
        let options = Options {
            noise: Some(0.01),
            duration: Some(SHAKING),
            ..Options::default()
        };
        let simulation = simulate(&model, &options, &mut |_| ())?;
        Ok(Self::of(
            &simulation.setup,
            simulation.recordings,
            troubles,
        )?)
    }

    /// Decides what the sensors feel.
    #[must_use]
    pub fn shaker(&self) -> Shaker {
        self.shaker.clone()
    }

    fn recording(&self) -> (&Recording, &Rc<[Vec<f32>]>) {
        let at = self.shaker.at.get();
        (&self.recordings[at], &self.felt[at])
    }

    /// Names of the channels, input by input.
    #[must_use]
    pub fn channels(&self) -> &[String] {
        &self.recording().0.channels
    }

    /// Certificates of the inputs in the box's settings, in their order.
    #[must_use]
    pub fn certificates(&self) -> Vec<Certificate> {
        self.outfit.certificates(self.recording().0)
    }

    /// The converters and all before them, as they are when the box has started them for the
    /// `start`-th time, with these gains, and this signal in place of the pins' where it is another.
    ///
    /// # Errors
    /// [`RigError`].
    pub fn chain(
        &self,
        sample_rate: f64,
        gains: &[u8],
        signal: Signal,
        start: u64,
    ) -> Result<Chain<Rc<[Vec<f32>]>>, RigError> {
        let (recording, felt) = self.recording();
        let felt = Felt {
            samples: Rc::clone(felt),
            rate: recording.sample_rate.unwrap_or(sample_rate),
            repeats: true,
        };
        let sensors = self.outfit.of(recording);
        let seed = self.troubles.seed.wrapping_add(start);
        Chain::new(
            &sensors,
            (gains, signal),
            felt,
            sample_rate,
            &self.troubles,
            seed,
        )
    }

    /// Seed of all that happens by chance.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.troubles.seed
    }
}

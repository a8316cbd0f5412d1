//! What is wired to the inputs of a box in this program.

use super::{Chain, Felt, Outfit, RigError, Troubles};
use crate::setup::Setup;
use crate::simulate::{Model, Options, Recording, simulate};
use massline_core::calibration::Certificate;
use std::rc::Rc;

/// Length of the shaking that is felt over and over, s.
const SHAKING: f64 = 120.0;

/// Sensors at the inputs of a box, which feel a simulated recording over and over.
#[derive(Clone, Debug)]
pub struct Inputs {
    outfit: Outfit,
    recording: Recording,
    felt: Rc<[Vec<f32>]>,
    troubles: Troubles,
}

impl Inputs {
    /// The sensors of a setup, which feel one of its recordings: its first channel at the
    /// first input, and so on. Faults are those of `troubles`, whose seed decides what the
    /// converters do by chance as well.
    ///
    /// # Errors
    /// [`RigError`].
    pub fn new(setup: &Setup, recording: &Recording, troubles: Troubles) -> Result<Self, RigError> {
        let outfit = Outfit::new(setup, std::slice::from_ref(recording))?;
        Ok(Self {
            outfit,
            felt: recording.samples.clone().into(),
            recording: recording.clone(),
            troubles,
        })
    }

    /// The tuning fork under lateral shaking: its drive at the first input, its sensors in the
    /// order of the setup behind it.
    ///
    /// # Errors
    /// What the simulation says.
    pub fn fork(troubles: Troubles) -> Result<Self, Box<dyn std::error::Error>> {
        let mut model = Model::fork()?;
        model.runs.truncate(1);
        let options = Options {
            noise: Some(0.01),
            duration: Some(SHAKING),
            ..Options::default()
        };
        let simulation = simulate(&model, &options, &mut |_| ())?;
        let recording = simulation.recordings.first();
        let recording = recording.ok_or("the fork has no run")?;
        Ok(Self::new(&simulation.setup, recording, troubles)?)
    }

    /// Names of the channels, input by input.
    #[must_use]
    pub fn channels(&self) -> &[String] {
        &self.recording.channels
    }

    /// What the box's settings hold for the inputs, in their order.
    #[must_use]
    pub fn certificates(&self) -> Vec<Certificate> {
        self.outfit.certificates(&self.recording)
    }

    /// The converters and all before them, as they are when the box has started them for the
    /// `start`-th time, with these gains.
    ///
    /// # Errors
    /// [`RigError`].
    pub fn chain(
        &self,
        sample_rate: f64,
        gains: &[u8],
        start: u64,
    ) -> Result<Chain<Rc<[Vec<f32>]>>, RigError> {
        let felt = Felt {
            samples: Rc::clone(&self.felt),
            rate: self.recording.sample_rate.unwrap_or(sample_rate),
            repeats: true,
        };
        let sensors = self.outfit.of(&self.recording);
        let seed = self.troubles.seed.wrapping_add(start);
        Chain::new(&sensors, gains, felt, sample_rate, &self.troubles, seed)
    }

    /// Seed of all that happens by chance.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.troubles.seed
    }
}

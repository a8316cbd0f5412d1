//! The question, and the ten numbers that answer it.

use super::{Accelerations, Health};
use massline_core::identify::{self, Identification, IdentifyError};
use massline_core::masslines::{ApparentMass, FreeModes, MasslineError, Method};
use massline_core::modes::{MAX_MODES, Pole};
use serde::{Deserialize, Serialize};

/// A question about the stored runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// Method that condenses the runs to masslines.
    pub method: Method,
    /// Known mass and procedure of the identification.
    pub identify: identify::Question,
    /// Largest number of elastic modes that methods d and e fit.
    pub modes: u8,
    /// Lowest and highest frequency of the lines in which modes are sought, Hz; all kept lines
    /// if `None`.
    pub fit_band: Option<[f64; 2]>,
    /// Bit k selects run k; zero selects all stored runs.
    pub runs: u32,
}

/// A set of methods: bit k stands for method k of [`Method::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MethodSet(pub u16);

impl MethodSet {
    /// The set of these methods.
    #[must_use]
    pub fn of(methods: &[Method]) -> Self {
        Self(methods.iter().fold(0, |bits, method| bits | bit(*method)))
    }

    /// `true` if the set has this method.
    #[must_use]
    pub fn contains(self, method: Method) -> bool {
        self.0 & bit(method) != 0
    }
}

fn bit(method: Method) -> u16 {
    let place = Method::ALL.iter().position(|listed| *listed == method);
    place.map_or(0, |k| 1 << k)
}

/// The answer and its computing time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identified {
    /// Ticks of [`super::Info::tick_hz`] from question to answer.
    pub ticks: u64,
    /// The answer.
    pub answer: Answer,
}

/// The ten numbers with their error bars, and their origin.
///
/// A box and a host that compute the same answer send the same bytes: every floating-point
/// number is encoded by its bits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The question, with the runs that were used.
    pub question: Question,
    /// Accelerometers that gave the base acceleration.
    pub accelerations: Accelerations,
    /// Blocks, losses and faults of the runs that were used.
    pub quality: Quality,
    /// The ten numbers.
    pub identification: Identification,
    /// Excitation and poles, as far as the method determines them.
    pub findings: Findings,
}

/// Results of condensing the runs besides the masslines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Number of independent directions of base acceleration that the runs excite; `None` for
    /// methods that do not count them.
    pub excited: Option<u8>,
    /// Ratio of power to noise of the weakest of these directions.
    pub weakest_excitation: Option<f64>,
    /// Poles that the method fits, in ascending order of frequency.
    pub poles: [Option<Pole>; MAX_MODES],
}

impl Findings {
    /// No findings.
    pub const NONE: Self = Self {
        excited: None,
        weakest_excitation: None,
        poles: [None; MAX_MODES],
    };

    /// Adds the fit of one group of runs. The least excited group counts.
    pub fn add_fit(&mut self, fit: &ApparentMass) {
        let excited = fit.excited as u8;
        self.excited = Some(self.excited.map_or(excited, |e| e.min(excited)));
        let weakest = fit.weakest_excitation;
        self.weakest_excitation = Some(self.weakest_excitation.map_or(weakest, |w| w.min(weakest)));
        self.add_poles(&fit.poles);
    }

    /// Adds the free modes of one group of runs.
    pub fn add_modes(&mut self, modes: &FreeModes) {
        self.add_poles(&modes.poles);
    }

    /// Keeps the poles of the group that has most of them.
    fn add_poles(&mut self, poles: &[Pole]) {
        let known = self.poles.iter().flatten();
        if poles.len() > known.fold(0, |count: usize, _| count.saturating_add(1)) {
            self.poles = core::array::from_fn(|k| poles.get(k).copied());
        }
    }
}

/// Blocks, losses and faults of all runs behind an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Quality {
    /// Number of averaged blocks.
    pub blocks: u32,
    /// Number of rejected blocks.
    pub rejected: u32,
    /// Number of blocks rejected for each fault, by the bits of [`Health`]; a block with two
    /// faults counts twice.
    pub rejected_by: [u32; Health::KINDS],
    /// Number of missing samples.
    pub missing: u64,
    /// Union of the faults for which blocks were rejected.
    pub health: Health,
}

/// Reason why the stored runs give no answer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum NoAnswer {
    /// The runs give no masslines.
    Masslines(MasslineError),
    /// The masslines give no rigid-body properties.
    Identify(IdentifyError),
}

impl From<MasslineError> for NoAnswer {
    fn from(error: MasslineError) -> Self {
        Self::Masslines(error)
    }
}

impl From<IdentifyError> for NoAnswer {
    fn from(error: IdentifyError) -> Self {
        Self::Identify(error)
    }
}

impl core::fmt::Display for NoAnswer {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Masslines(error) => error.fmt(f),
            Self::Identify(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for NoAnswer {}

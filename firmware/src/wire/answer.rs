//! The question, and the ten numbers that answer it.
//!
//! Everything the box computed is [`Exact`]: the host runs the same core on the same
//! samples and compares bits.

use super::{Accelerations, Exact, Health};
use serde::{Deserialize, Serialize};

/// Most poles in an answer.
pub const POLES_MAX: usize = 4;

/// What is asked of the stored runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// The way to masslines.
    pub method: Method,
    /// The weighed mass, kg; then the indicator Δ is estimated in its place.
    pub known_mass: Option<f64>,
    /// Direct or iterative.
    pub procedure: Procedure,
    /// Most elastic modes that methods d and e take account of.
    pub modes: u8,
    /// Lowest and highest frequency of the lines in which modes are looked for, Hz; all that
    /// are kept if it is not given.
    pub fit_band: Option<[f64; 2]>,
    /// The runs to be used: bit k is run k. Zero: all that are stored.
    pub runs: u32,
}

/// The ways to masslines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Method {
    /// Apparent mass with elastic terms.
    ApparentMass,
    /// Method a.
    FrequencyResponses,
    /// Method b.
    PowerSpectra,
    /// Method b with Cholesky factorisation.
    PowerSpectraCholesky,
    /// Method c.
    FreeResponses,
    /// Method c with a term in ω².
    FreeResponsesSquared,
    /// Method d.
    CurveFit,
    /// Method e.
    Synthesis,
}

impl Method {
    /// Its bit in [`super::Capacity::methods`].
    #[must_use]
    pub const fn bit(self) -> u16 {
        1 << self as u16
    }
}

/// Direct, or iterative.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Procedure {
    /// Solve once about the given reference point.
    Direct,
    /// Move the reference point to the identified centre of gravity until both coincide.
    Iterative {
        /// Distance at which that ends, m.
        tolerance: f64,
        /// Most iterations.
        limit: u32,
    },
}

/// The answer, with what it cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identified {
    /// Ticks of [`super::Info::tick_hz`] from question to answer. Not a part of the
    /// comparison.
    pub ticks: u64,
    /// The answer.
    pub answer: Answer,
}

/// The ten numbers with their error bars, and how they were come by. SI; `None` is *not
/// observable from this test*, never zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The question that this answers, with the runs that were used.
    pub question: Question,
    /// The accelerometers that gave the base acceleration.
    pub accelerations: Accelerations,
    /// What the runs that were used suffered.
    pub quality: Quality,
    /// The reference point A, m.
    pub reference: [Exact<f64>; 3],
    /// Overall mass, kg.
    pub mass: Option<Estimate>,
    /// Δ, if the mass was known.
    pub indicator: Option<Estimate>,
    /// Centre of gravity, m.
    pub centre_of_gravity: [Option<Estimate>; 3],
    /// Inertia about A, kg m²: xx, yy, zz, xy, xz, yz; products as ∫ x y dm.
    pub inertia_reference: [Option<Estimate>; 6],
    /// Inertia about the centre of gravity.
    pub inertia_cg: [Option<Estimate>; 6],
    /// Principal moments and axes, if all of the inertia is known.
    pub principal: Option<Principal>,
    /// Bit k: unknown k of equation (6) or (7) is determined by the data.
    pub observable: u16,
    /// Condition number of the column-equilibrated normal equations.
    pub condition_number: Exact<f64>,
    /// Iterations done; one for the direct procedure.
    pub iterations: u32,
    /// Residual over expected residual of the masslines, if it can be told.
    pub consistency: Option<Exact<f64>>,
    /// Share of the masslines' forces that a rigid body leaves.
    pub misfit: Exact<f64>,
    /// Largest share of an error bar's variance that noise of the accelerations has.
    pub attenuation: Exact<f64>,
    /// Degrees of freedom of the estimate of noise behind the error bars; infinite where the
    /// noise is known.
    pub freedom: Exact<f64>,
    /// Whether such a body could exist.
    pub plausibility: Plausibility,
    /// Independent directions of base acceleration that the runs excite, where the
    /// method counts them.
    pub excited: Option<u8>,
    /// Power over noise of the weakest of them.
    pub weakest_excitation: Option<Exact<f64>>,
    /// Poles that the method took account of, ascending.
    pub poles: [Option<Pole>; POLES_MAX],
}

/// What the runs behind an answer suffered, all together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Quality {
    /// Blocks averaged.
    pub blocks: u32,
    /// Blocks rejected.
    pub rejected: u32,
    /// Blocks rejected for each fault, by the bits of [`Health`]; a block with two faults
    /// counts twice.
    pub rejected_by: [u32; Health::KINDS],
    /// Samples that were missing.
    pub missing: u64,
    /// Every fault that a block was rejected for.
    pub health: Health,
}

/// A value with its standard deviation, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: Exact<f64>,
    /// One standard deviation.
    pub std: Exact<f64>,
}

/// Principal moments and axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Principal {
    /// Ascending, kg m².
    pub moments: [Exact<f64>; 3],
    /// Their unit vectors in the same order.
    pub axes: [[Exact<f64>; 3]; 3],
}

/// How far the conditions that every body obeys are from being violated; `None` could not be
/// checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plausibility {
    /// Positive mass.
    pub mass: Option<Margin>,
    /// Positive definite inertia about the centre of gravity.
    pub positive_definite: Option<Margin>,
    /// Triangle inequality of the principal moments.
    pub triangle: Option<Margin>,
}

/// A condition's margin, relative to the quantity it is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Margin {
    /// The margin; negative is violated.
    pub relative: Exact<f64>,
    /// Half of its 95 % interval.
    pub uncertainty: Exact<f64>,
}

/// A mode's natural frequency and damping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pole {
    /// Hz.
    pub frequency: Exact<f64>,
    /// Share of critical damping.
    pub damping: Exact<f64>,
}

/// Why the data give no answer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum NoAnswer {
    /// The averaging band holds fewer lines than the method needs; the number found.
    TooFewLines(u32),
    /// No direction of base acceleration rises above its noise.
    NoExcitation,
    /// The load cells complete no equation of motion.
    NoResultant,
    /// More masslines than the core holds.
    TooManyPairs,
    /// Spectra that are not finite, or a matrix that cannot be factorised.
    Singular,
    /// The method needs a drive channel.
    NoReference,
    /// The method needs more independent runs.
    TooFewRuns {
        /// Runs needed.
        needed: u8,
        /// Runs found.
        found: u8,
    },
    /// The method needs elastic modes, and found none.
    NoMode,
    /// There are no masslines.
    NoMasslines,
    /// None of the ten can be told from noise.
    NothingObservable,
    /// The known mass is not positive, kg.
    KnownMass(f64),
    /// The iteration moves away; its last step, m.
    Diverged(f64),
    /// The iteration did not end within its limit; its last step, m.
    NotConverged(f64),
    /// Masslines that are not finite.
    NotFinite,
    /// More lines or runs than the method has room for.
    Room {
        /// Places needed.
        needed: u32,
        /// Places there are.
        given: u32,
    },
}

impl core::fmt::Display for NoAnswer {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooFewLines(n) => write!(f, "only {n} lines in the averaging band"),
            Self::NoExcitation => {
                f.write_str("no direction of base acceleration rises above its noise")
            }
            Self::NoResultant => f.write_str("the load cells complete no equation of motion"),
            Self::TooManyPairs => f.write_str("too many masslines"),
            Self::Singular => f.write_str("the averaged spectra are not finite"),
            Self::NoReference => f.write_str("the method needs a drive channel"),
            Self::TooFewRuns { needed, found } => {
                write!(
                    f,
                    "the method needs {needed} independent runs, found {found}"
                )
            }
            Self::NoMode => f.write_str("no elastic mode in the lines"),
            Self::NoMasslines => f.write_str("no masslines"),
            Self::NothingObservable => f.write_str("none of the ten can be told from noise"),
            Self::KnownMass(m) => write!(f, "a known mass of {m} kg"),
            Self::Diverged(d) => write!(f, "the iteration moves away, at last by {d} m"),
            Self::NotConverged(d) => {
                write!(f, "the iteration has not ended, the last step was {d} m")
            }
            Self::NotFinite => f.write_str("the masslines are not finite"),
            Self::Room { needed, given } => {
                write!(
                    f,
                    "room for {given} lines or runs, but {needed} are asked for"
                )
            }
        }
    }
}

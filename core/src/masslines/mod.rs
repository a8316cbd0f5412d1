//! Masslines: rigid-body accelerations and the forces that go with them (chapter 6).
//!
//! Every method condenses a band of lines, or a set of static poses, to the same thing:
//! a few [`Massline`] pairs that obey `M a = f` with the rigid-body mass matrix of
//! equation (1). What differs is how much of the structure's elasticity and of the
//! sensors' noise gets into them.
//!
//! | file | content |
//! | --- | --- |
//! | `methods` | the list of methods, and one file each |
//! | `bands` | lines that a method works on, weights of its equations |
//! | `condense` | averaged lines in, masslines out, by any method |
//! | `fixed_modes` | effective masses of the fixed structure, close modes among them |
//! | `static_poses` | masslines of a DC-coupled measurement |
//! | `lines`, `moments` | averaged spectra as the methods read them, second moments at a line |
//! | `drive_lines`, `cross_lines`, `sine`, `moved` | lines by drive, without drive, of a sine, moved |
//! | `driven` | exact sums over lines by drive, in whole numbers and single precision |
//! | `regression`, `averaging`, `free_system` | estimators that several methods share |
//! | `excitation` | directions that rise above their noise |
//! | `run_powers` | powers of each run over a band |
//! | `samples` | runs for tests |
//! | `workspace` | lent memory, none of which is on a small stack |

mod averaging;
mod bands;
mod condense;
mod cross_lines;
mod drive_lines;
mod driven;
mod excitation;
mod fixed_modes;
mod free_system;
mod lines;
mod methods;
mod moments;
mod moved;
mod regression;
mod run_powers;
#[cfg(test)]
mod samples;
mod sine;
mod static_poses;
mod workspace;

pub use averaging::MIN_LINES;
pub use bands::{Bands, EquationWeights};
pub use condense::{Condensed, condense, condense_into};
pub use cross_lines::CrossLines;
use cross_lines::MAX_RUNS;
pub use drive_lines::DriveLines;
pub(crate) use excitation::EXCITED;
use excitation::Excitation;
pub use excitation::excited_directions;
pub use fixed_modes::{FixedMode, fixed_modes};
pub use free_system::FreeModes;
use free_system::FreeSystem;
pub use lines::{Lines, lines_between};
pub use methods::Method;
pub use methods::apparent_mass::ApparentMass;
pub use moments::Moments;
use moments::{Complex6, Powers, Squares};
pub use sine::{SineLines, SineRun};
pub use static_poses::{StaticFit, StaticPoses};
pub use workspace::Workspace;

use crate::geometry::{Equations, move_accelerations, resultants_at, transfer};
use nalgebra::{Matrix6, Vector3, Vector6};

/// Most pairs in one set: one a direction, or with method a one a run.
pub(crate) const MAX_PAIRS: usize = 24;

/// Reason why a method gives no masslines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MasslineError {
    /// The averaging band holds fewer than three lines; the number found.
    TooFewLines(usize),
    /// No direction of base acceleration rises above its noise.
    NoExcitation,
    /// No resultant is measured.
    NoResultant,
    /// More pairs than the set has room for.
    TooManyPairs {
        /// Most pairs.
        limit: usize,
        /// Pairs there would be, as far as they were counted.
        found: usize,
    },
    /// Numbers that are not finite, or a matrix that cannot be factorised.
    Singular,
    /// The method needs frequency responses: a drive channel or a stepped sine.
    NoReference,
    /// The method needs as many independent runs as resultants are measured.
    TooFewRuns {
        /// Independent runs needed.
        needed: usize,
        /// Independent runs found.
        found: usize,
    },
    /// The method fits elastic modes, and none was found in the lines.
    NoMode,
    /// A band was chosen from other lines than these.
    OtherLines {
        /// Number of lines it was chosen from.
        band: usize,
        /// Number of lines there are.
        lines: usize,
    },
    /// Lent working memory is too small.
    Work {
        /// Elements needed.
        needed: usize,
        /// Elements given.
        given: usize,
    },
    /// More runs than can be weighed against each other.
    TooManyRuns {
        /// Most runs.
        limit: usize,
        /// Runs there are.
        found: usize,
    },
    /// Static poses are as many as the unknowns of a resultant, so that nothing is left to tell
    /// their noise.
    TooFewPoses {
        /// Poses needed.
        needed: usize,
        /// Poses found.
        found: usize,
    },
    /// A run has too few blocks to tell its noise from its signal.
    TooFewBlocks {
        /// Blocks needed.
        needed: u32,
        /// Blocks found.
        found: u32,
    },
}

impl core::fmt::Display for MasslineError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooFewLines(n) => {
                write!(
                    f,
                    "the averaging band holds {n} lines; at least 3 are needed"
                )
            }
            Self::NoExcitation => f.write_str(
                "no direction of base acceleration rises above the accelerometers' noise",
            ),
            Self::NoResultant => f.write_str("the load cells complete no equation of motion"),
            Self::TooManyPairs { limit, found } => write!(
                f,
                "{found} or more masslines, but there is room for {limit}"
            ),
            Self::Singular => f.write_str("the averaged spectra are not finite"),
            Self::NoReference => f.write_str(
                "this method needs responses referred to a drive channel or a stepped sine",
            ),
            Self::TooFewRuns { needed, found } => write!(
                f,
                "this method needs {needed} independent runs, as many as resultants are measured; found {found}"
            ),
            Self::NoMode => f.write_str("no elastic mode was found in the lines"),
            Self::OtherLines { band, lines } => {
                write!(f, "a band chosen from {band} lines, but there are {lines}")
            }
            Self::Work { needed, given } => write!(
                f,
                "working memory of {given} elements, but {needed} are needed, two a line"
            ),
            Self::TooManyRuns { limit, found } => write!(
                f,
                "{found} runs, of which at most {limit} can be weighed against each other"
            ),
            Self::TooFewPoses { needed, found } => write!(
                f,
                "{found} poses; at least {needed} are needed to tell their noise from what they weigh"
            ),
            Self::TooFewBlocks { needed, found } => write!(
                f,
                "a run has {found} blocks; at least {needed} are needed to tell its noise from its signal"
            ),
        }
    }
}

impl core::error::Error for MasslineError {}

/// A rigid-body acceleration and the force that goes with it, both about the reference
/// point of their set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Massline {
    /// Acceleration of A: m/s² and rad/s², or a pseudo acceleration in other units.
    pub acceleration: Vector6<f64>,
    /// Resultants at A: N and N m, or the pseudo force in matching units.
    pub force: Vector6<f64>,
    /// Variance of each of the set's equations for this pair, in the units of
    /// `equations.rows() * force` squared.
    pub variance: Vector6<f64>,
}

/// Up to `PAIRS` masslines (24 where nothing else is said) that share a reference point and the
/// equations that hold for them.
#[derive(Clone, Debug, PartialEq)]
pub struct Masslines<const PAIRS: usize = MAX_PAIRS> {
    /// The reference point A, m.
    pub(crate) reference: Vector3<f64>,
    /// The combinations of the rows of `M a = f` that were measured.
    pub(crate) equations: Equations,
    /// The pairs.
    pub(crate) pairs: heapless::Vec<Massline, PAIRS>,
    /// Second moments that noise alone would give the accelerations of the pairs, were each
    /// direction as noisy as one line: an excitation that does not exceed them by
    /// [`EXCITED`] is none.
    pub(crate) noise: Matrix6<f64>,
    /// Second moments that noise really adds to those of the pairs. They pull what the
    /// accelerations multiply towards zero.
    pub(crate) pull: Matrix6<f64>,
    /// Effective number of independent lines (or poses) over which the noise along directions that are not excited
    /// averages out in each pair; it may be less than one.
    pub(crate) lines: f32,
    /// Degrees of freedom of the variances of the pairs; infinite where they are known.
    pub(crate) freedom: f32,
}

impl Masslines {
    /// Exact pairs, without noise: for a mass matrix that is known line by line.
    ///
    /// # Errors
    /// [`MasslineError::TooManyPairs`], [`MasslineError::Singular`] for a number that is not
    /// finite.
    pub fn exact(
        reference: Vector3<f64>,
        pairs: impl IntoIterator<Item = (Vector6<f64>, Vector6<f64>)>,
    ) -> Result<Self, MasslineError> {
        let exact = |(acceleration, force)| (acceleration, force, Vector6::zeros());
        Self::with_variances(reference, pairs.into_iter().map(exact))
    }

    /// Pairs of acceleration and force, each with the known variance of its six resultants, N²
    /// and N² m².
    ///
    /// # Errors
    /// [`MasslineError::TooManyPairs`], [`MasslineError::Singular`] for a number that is not
    /// finite or a variance below zero.
    pub fn with_variances(
        reference: Vector3<f64>,
        pairs: impl IntoIterator<Item = (Vector6<f64>, Vector6<f64>, Vector6<f64>)>,
    ) -> Result<Self, MasslineError> {
        let mut set = Self::new(reference, Equations::all());
        for (acceleration, force, variance) in pairs {
            if variance.min() < 0.0 {
                return Err(MasslineError::Singular);
            }
            set.push(acceleration, force, variance)?;
        }
        Ok(set)
    }
}

impl<const PAIRS: usize> Masslines<PAIRS> {
    /// No pairs yet.
    #[must_use]
    pub fn new(reference: Vector3<f64>, equations: Equations) -> Self {
        Self {
            reference,
            equations,
            pairs: heapless::Vec::new(),
            noise: Matrix6::zeros(),
            pull: Matrix6::zeros(),
            lines: 1.0,
            freedom: f32::INFINITY,
        }
    }

    /// The reference point A, m.
    pub(crate) fn reference(&self) -> &Vector3<f64> {
        &self.reference
    }

    /// The combinations of the rows of `M a = f` that were measured.
    #[must_use]
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// The pairs.
    #[must_use]
    pub fn pairs(&self) -> &[Massline] {
        &self.pairs
    }

    /// Second moments of noise that an excitation is held against.
    pub(crate) fn noise(&self) -> &Matrix6<f64> {
        &self.noise
    }

    /// Second moments of the noise in the pairs.
    pub(crate) fn pull(&self) -> &Matrix6<f64> {
        &self.pull
    }

    /// Independent lines (or poses) that went into each pair.
    pub(crate) fn lines(&self) -> f64 {
        f64::from(self.lines)
    }

    /// Degrees of freedom of the variances of the pairs.
    pub(crate) fn freedom(&self) -> f64 {
        f64::from(self.freedom)
    }

    pub(crate) fn push(
        &mut self,
        acceleration: Vector6<f64>,
        force: Vector6<f64>,
        variance: Vector6<f64>,
    ) -> Result<(), MasslineError> {
        let finite = |v: &Vector6<f64>| v.iter().all(|x| x.is_finite());
        if !(finite(&acceleration) && finite(&force) && finite(&variance)) {
            return Err(MasslineError::Singular);
        }
        self.pairs
            .push(Massline {
                acceleration,
                force,
                variance,
            })
            .map_err(|_| MasslineError::TooManyPairs {
                limit: PAIRS,
                found: PAIRS + 1,
            })
    }

    /// Sets the noise of pairs that are means over independent lines, from what it would be
    /// if they were single lines. It averages out of them.
    pub(crate) fn set_averaged_noise(&mut self, of_lines: &Matrix6<f64>) {
        let lines = f64::from(core::mem::replace(&mut self.lines, 1.0));
        self.noise = of_lines / lines.max(1.0);
        self.pull = self.noise;
    }

    /// Moves the reference point by `shift`, m: exact, nothing is averaged again (figure 4).
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(crate) fn move_by(&mut self, shift: &Vector3<f64>) {
        let t = transfer(shift);
        self.reference += shift;
        self.equations = self.equations.at(shift);
        move_accelerations(&mut self.noise, shift);
        move_accelerations(&mut self.pull, shift);
        for pair in &mut self.pairs {
            pair.acceleration = t * pair.acceleration;
            pair.force = resultants_at(shift, &pair.force);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigid_body::{Inertia, RigidBody};

    #[test]
    fn moving_masslines_is_exact() {
        let body = RigidBody {
            mass: 3.0,
            centre_of_gravity: Vector3::new(0.1, -0.2, 0.3),
            inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
        };
        let a = Vector6::new(1.0, -2.0, 0.5, 0.3, 0.7, -0.9);
        let f = body.mass_matrix(&Vector3::zeros()) * a;
        let there = Vector3::new(0.4, 0.7, -0.2);
        let mut moved = Masslines::exact(Vector3::zeros(), [(a, f)]).unwrap();
        moved.move_by(&there);
        let pair = moved.pairs()[0];
        assert_eq!(pair.acceleration, transfer(&there) * a);
        assert_eq!(pair.force, resultants_at(&there, &f));
        // A dozen roundings of numbers below ten.
        assert!((body.mass_matrix(&there) * pair.acceleration - pair.force).norm() < 1e-14);
    }

    #[test]
    fn a_full_set_says_how_many_it_takes() {
        let pair = (Vector6::zeros(), Vector6::zeros());
        let refused = Masslines::exact(Vector3::zeros(), [pair; MAX_PAIRS + 1]);
        let (limit, found) = (MAX_PAIRS, MAX_PAIRS + 1);
        let expected = MasslineError::TooManyPairs { limit, found };
        assert_eq!(refused.unwrap_err(), expected);
    }
}

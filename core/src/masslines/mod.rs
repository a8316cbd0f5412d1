//! Masslines: rigid-body accelerations and the forces that go with them (chapter 6).
//!
//! Every method condenses a band of lines, or a set of static poses, to the same thing:
//! a few [`Massline`] pairs that obey `M a = f` with the rigid-body mass matrix of
//! equation (1). What differs is how much of the structure's elasticity and of the
//! sensors' noise gets into them.
//!
//! | file | method |
//! | --- | --- |
//! | `power_spectra` | b, averaged power spectra, with and without Cholesky |
//! | `apparent_mass` | apparent mass with elastic terms, the recommended one |
//! | `static_poses` | poses of a DC-coupled measurement |

mod apparent_mass;
mod averaging;
mod excitation;
mod lines;
mod power_spectra;
mod regression;
mod static_poses;

pub use apparent_mass::{ApparentMass, apparent_mass};
pub use excitation::Excitation;
pub use lines::{Complex6, CrossLines, DriveLines, Lines, MAX_CROSS_RUNS, Moments};
pub use power_spectra::{Factorisation, power_spectra};
pub use static_poses::{StaticFit, StaticPoses};

use crate::geometry::{Equations, resultants_at, transfer};
use nalgebra::{Matrix6, Vector3, Vector6};

/// The ways to masslines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Apparent mass with elastic terms.
    #[default]
    ApparentMass,
    /// Method b, averaged power spectra.
    PowerSpectra,
    /// Method b with Cholesky factorisation.
    PowerSpectraCholesky,
}

impl Method {
    /// All of them, the recommended one first.
    pub const ALL: [Self; 3] = [
        Self::ApparentMass,
        Self::PowerSpectra,
        Self::PowerSpectraCholesky,
    ];

    /// Short name, as typed on a command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ApparentMass => "apparent-mass",
            Self::PowerSpectra => "b",
            Self::PowerSpectraCholesky => "b-cholesky",
        }
    }

    /// What it does, in one line.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::ApparentMass => {
                "apparent mass with elastic terms, base acceleration from the interface"
            }
            Self::PowerSpectra => "averaged power spectra (method b)",
            Self::PowerSpectraCholesky => {
                "averaged power spectra with Cholesky factorisation (method b)"
            }
        }
    }

    /// Whether the base acceleration comes from the interface accelerometers alone. The
    /// paper's methods use all accelerometers, equation (4).
    #[must_use]
    pub const fn interface_only(self) -> bool {
        matches!(self, Self::ApparentMass)
    }
}

/// Most pairs in one set.
pub const MAX_PAIRS: usize = 36;

/// What keeps a method from giving masslines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MasslineError {
    /// The averaging band holds fewer than three lines; the number found.
    TooFewLines(usize),
    /// No direction of base acceleration rises above its noise.
    NoExcitation,
    /// No resultant is measured.
    NoResultant,
    /// More pairs than [`MAX_PAIRS`].
    TooManyPairs,
    /// Numbers that are not finite, or a matrix that cannot be factorised.
    Singular,
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
            Self::TooManyPairs => write!(f, "more than {MAX_PAIRS} masslines"),
            Self::Singular => f.write_str("the averaged spectra are not finite"),
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

/// Masslines that share a reference point and the equations that hold for them.
#[derive(Clone, Debug, PartialEq)]
pub struct Masslines {
    /// The reference point A, m.
    pub reference: Vector3<f64>,
    /// The combinations of the rows of `M a = f` that were measured.
    pub equations: Equations,
    /// The pairs.
    pub pairs: heapless::Vec<Massline, MAX_PAIRS>,
    /// What the accelerations would contain if there were nothing but noise: columns
    /// are pseudo accelerations whose second moments add up to the noise in `pairs`.
    pub noise: Matrix6<f64>,
}

impl Masslines {
    /// No pairs yet.
    #[must_use]
    pub fn new(reference: Vector3<f64>, equations: Equations) -> Self {
        Self {
            reference,
            equations,
            pairs: heapless::Vec::new(),
            noise: Matrix6::zeros(),
        }
    }

    /// Exact pairs, without noise: for a mass matrix that is known line by line.
    ///
    /// # Errors
    /// [`MasslineError::TooManyPairs`].
    pub fn exact(
        reference: Vector3<f64>,
        pairs: impl IntoIterator<Item = (Vector6<f64>, Vector6<f64>)>,
    ) -> Result<Self, MasslineError> {
        let mut set = Self::new(reference, Equations::all());
        for (acceleration, force) in pairs {
            set.push(acceleration, force, Vector6::zeros())?;
        }
        Ok(set)
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
            .map_err(|_| MasslineError::TooManyPairs)
    }

    /// The same masslines about another reference point (m): exact, nothing is
    /// averaged again (figure 4).
    #[must_use]
    pub fn at(&self, reference: &Vector3<f64>) -> Self {
        let shift = reference - self.reference;
        let t = transfer(&shift);
        let mut moved = self.clone();
        moved.reference = *reference;
        moved.equations = self.equations.at(&shift);
        moved.noise = t * self.noise;
        for pair in &mut moved.pairs {
            pair.acceleration = t * pair.acceleration;
            pair.force = resultants_at(&shift, &pair.force);
        }
        moved
    }
}

//! From masslines to ten numbers: equations (6) to (11), chapters 4 and 5.
//!
//! | file | does |
//! | --- | --- |
//! | `measurement` | the rows of B, equation (8) |
//! | `weighed` | weights of the equations of a set |
//! | `normal` | stacking (9), normal equations (10) |
//! | `determined` | observability |
//! | `bounded` | what a body may hold of what is not observable |
//! | `derived` | CG, inertia about A and S with their error bars |
//! | `student` | 95 % intervals for the degrees of freedom behind the error bars |
//!
//! Observability is decided by rank: uniaxial tests (11), plane problems and too few runs all come out
//! of one rule. Mass and centre of gravity are told, too, where the inertia that the rank leaves open
//! bends them by little.

mod bounded;
mod derived;
mod determined;
mod measurement;
mod normal;
mod student;
mod weighed;

pub use derived::{Covariance, Estimate, InertiaEstimate};
pub use normal::Workspace;
pub use student::half_width_95;

use crate::cells::seen;
use crate::geometry::least_translation;
use crate::masslines::Masslines;
use crate::rigid_body::{
    Bounded, Inertia, Moments, Parameter, Plausibility, PrincipalInertia, check,
};
use nalgebra::Vector3;

/// Direct, or iterative as in figure 4.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Procedure {
    /// Solve once at the given reference point; Θ about S by the parallel-axis rule.
    #[default]
    Direct,
    /// Move the reference point to the identified S and solve again, until both
    /// coincide.
    Iterative {
        /// Distance of S from A at which the iteration ends, m.
        tolerance: f64,
        /// Most iterations.
        limit: u32,
    },
}

impl Procedure {
    /// Iterative with a tolerance of a tenth of a micrometre and at most 50 steps. The
    /// paper's data converge in two or three.
    pub const ITERATIVE: Self = Self::Iterative {
        tolerance: 1e-7,
        limit: 50,
    };
}

/// The question: known mass and procedure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Question {
    /// The weighed mass, kg; then the indicator Δ is estimated in its place (7).
    pub known_mass: Option<f64>,
    /// Direct or iterative.
    pub procedure: Procedure,
}

impl Question {
    /// The question for the ten numbers by a procedure, and, with the weighed mass (kg), for the
    /// indicator Δ in place of the mass.
    #[must_use]
    pub const fn new(known_mass: Option<f64>, procedure: Procedure) -> Self {
        Self {
            known_mass,
            procedure,
        }
    }
}

/// Why there is no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum IdentifyError {
    /// No masslines were given.
    NoMasslines,
    /// Nothing that could be told from noise.
    NothingObservable,
    /// The known mass is not positive.
    KnownMass(f64),
    /// The iteration moves away; the distance between S and A at the last step, m.
    Diverged(f64),
    /// The iteration did not end within its limit; the last distance, m.
    NotConverged(f64),
    /// A number that is not finite: in the masslines, or in what follows from them.
    NotFinite,
}

impl core::fmt::Display for IdentifyError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoMasslines => f.write_str("there are no masslines to identify from"),
            Self::NothingObservable => {
                f.write_str("none of the ten rigid-body properties can be told from noise")
            }
            Self::KnownMass(m) => write!(f, "a known mass of {m} kg; it must be positive"),
            Self::Diverged(d) => {
                write!(f, "the iteration moves away from the CG, at last by {d} m")
            }
            Self::NotConverged(d) => {
                write!(f, "the iteration has not ended, the last step was {d} m")
            }
            Self::NotFinite => f.write_str(
                "the masslines hold numbers that are not finite, or too large or small to compute with",
            ),
        }
    }
}

impl core::error::Error for IdentifyError {}

/// The ten numbers with their error bars, and how they were come by.
///
/// All are SI, in the frame of the sensors. `None` is *not observable from this test*,
/// never zero.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Identification {
    /// The reference point A that was asked for, m.
    pub reference: Vector3<f64>,
    /// Overall mass, kg. A known mass is exact.
    pub mass: Option<Estimate>,
    /// Δ, if the mass was known: ideally one.
    pub indicator: Option<Estimate>,
    /// Centre of gravity S, m.
    pub centre_of_gravity: [Option<Estimate>; 3],
    /// Inertia about A, kg m²: xx, yy, zz, xy, xz, yz; products as ∫ x y dm.
    pub inertia_reference: InertiaEstimate,
    /// Inertia about S, kg m².
    pub inertia_cg: InertiaEstimate,
    /// Principal moments and axes about S, if all of it is known.
    pub principal: Option<PrincipalInertia>,
    /// `true` for those of the ten that the data determine.
    pub observable: [bool; 10],
    /// Condition number of the column-equilibrated normal equations of those.
    pub condition_number: f64,
    /// Iterations done; one for the direct procedure.
    pub iterations: u32,
    /// Residual over expected residual of the masslines, 1 where a rigid body explains
    /// them to within their noise. Above one the error bars were widened with its root.
    pub consistency: Option<f64>,
    /// Share of the masslines' forces that a rigid body leaves, root mean square over root
    /// mean square: 0 for a rigid body without noise, 1 for forces that have nothing to do
    /// with the accelerations.
    pub misfit: f64,
    /// Largest share of an error bar's variance that the pull of acceleration noise has.
    pub attenuation: f64,
    /// Effective degrees of freedom of the estimate of noise behind the error bars; infinite
    /// where the noise is known. [`Estimate::interval`] makes 95 % intervals of it.
    pub freedom: f64,
    /// Margins of the conditions that every body of positive mass density meets.
    pub plausibility: Plausibility,
}

impl Identification {
    /// The parameters that this test does not determine.
    pub fn unobservable(&self) -> impl Iterator<Item = Parameter> + '_ {
        let flags = Parameter::ALL.into_iter().zip(self.observable);
        flags.filter_map(|(p, seen)| (!seen).then_some(p))
    }

    /// `true` if every number that is given is finite.
    #[inline(never)] // Not on the stack of what else its caller does.
    fn is_finite(&self) -> bool {
        let estimates = [self.mass, self.indicator]
            .into_iter()
            .chain(self.centre_of_gravity)
            .chain(self.inertia_reference)
            .chain(self.inertia_cg);
        let principal = self.principal.iter();
        let mut others = principal.flat_map(|p| p.moments.iter().chain(&p.axes));
        estimates.flatten().all(|estimate| estimate.is_finite())
            && others.all(|x| x.is_finite())
            && self.reference.iter().all(|x| x.is_finite())
            && self.condition_number.is_finite()
            && self.consistency.is_none_or(f64::is_finite)
            && self.attenuation.is_finite()
    }
}

impl Workspace {
    /// Covariance of the ten numbers of the last identification in this workspace: mass (or Δ
    /// where the mass was known), three coordinates of the CG, and the six terms of inertia
    /// about S. It is of the first order, so that a derivative carries it to any point; the standard deviations of the
    /// inertia about S have the second order of the CG's errors, too.
    #[must_use]
    pub fn covariance(&self) -> Covariance {
        derived::Body::new(self).covariance()
    }
}

/// Identifies the rigid body behind `masslines`, with respect to their first set's
/// reference point. Sets may stand at different points; they are moved. For stacks of some
/// 16 KiB or more; see [`identify_in`].
///
/// # Errors
/// [`IdentifyError`].
pub fn identify<const PAIRS: usize>(
    masslines: &[Masslines<PAIRS>],
    question: &Question,
) -> Result<Identification, IdentifyError> {
    identify_in(masslines, question, &mut { Workspace::EMPTY })
}

/// As [`identify`], working in `space`.
///
/// # Errors
/// [`IdentifyError`].
#[inline(never)] // Not on the stack of what else its caller does.
pub fn identify_in<const PAIRS: usize>(
    masslines: &[Masslines<PAIRS>],
    question: &Question,
    space: &mut Workspace,
) -> Result<Identification, IdentifyError> {
    let first = masslines.first().ok_or(IdentifyError::NoMasslines)?;
    if let Some(m) = question.known_mass
        && !(m > 0.0 && m.is_finite())
    {
        return Err(IdentifyError::KnownMass(m));
    }
    let reference = *first.reference();
    // Equations that carry the weights of the noise give the same body from every point, so
    // they are solved where rounding is least. Others are those of the paper, about A.
    let mut point = reference;
    if masslines.iter().all(|set| set.equations().is_whitened()) {
        point += least_translation(first.noise());
    }
    normal::solve(masslines, &point, question.known_mass, space)?;
    let mut iterations = 1;
    if let Procedure::Iterative { tolerance, limit } = question.procedure {
        let mut before = f64::INFINITY;
        let mut away = 0;
        loop {
            let step = space.solved.step();
            let distance = step.norm();
            if distance <= tolerance {
                break;
            }
            // A single longer step may happen on the way; two in a row do not return.
            away = if distance > before { away + 1 } else { 0 };
            if away >= 2 {
                return Err(IdentifyError::Diverged(distance));
            }
            if iterations >= limit {
                return Err(IdentifyError::NotConverged(distance));
            }
            before = distance;
            let point = space.solved.point + step;
            normal::solve(masslines, &point, question.known_mass, space)?;
            iterations += 1;
        }
    }
    let found = assemble(space, reference, iterations);
    if !found.observable.contains(&true) {
        return Err(IdentifyError::NothingObservable);
    }
    // Numbers near the ends of their range overflow on the way.
    if found.is_finite() {
        Ok(found)
    } else {
        Err(IdentifyError::NotFinite)
    }
}

#[inline(never)] // Not on the stack while equations are solved.
fn assemble(space: &Workspace, reference: Vector3<f64>, iterations: u32) -> Identification {
    let solved = &space.solved;
    let body = derived::Body::new(space);
    let inertia_reference = body.inertia_about(&reference);
    let centre_of_gravity = body.centre_of_gravity();
    let inertia_cg = body.inertia_about_cg();
    let all: Option<heapless::Vec<f64, 6>> =
        inertia_cg.iter().map(|t| t.map(|t| t.value)).collect();
    let full = all.and_then(|v| Some(Inertia::from_terms(v.into_array().ok()?)));
    let principal = full.map(|i| i.principal());
    let mass = body.mass();
    let freedom = solved.freedom;
    let bounded = |e: Estimate| Bounded {
        value: e.value,
        half_width: e.interval(freedom),
    };
    // A weighed mass is positive; the mass that the data say is Δ times as much.
    let indicator = body.indicator();
    let measured = match (mass, indicator) {
        (Some(mass), Some(delta)) => Some(Estimate {
            value: mass.value * delta.value,
            std: mass.value * delta.std,
        }),
        _ => mass,
    };
    let moments = match &principal {
        Some(principal) => Moments::Principal(principal),
        None => {
            let [xx, yy, zz, ..] = inertia_cg;
            Moments::Some([xx, yy, zz].map(|term| term.map(bounded)))
        }
    };
    let plausibility = check(measured.map(bounded), &moments, |weights| {
        let std = body.deviation_about_cg(weights);
        Estimate { value: 0.0, std }.interval(freedom)
    });
    Identification {
        reference,
        mass,
        indicator,
        centre_of_gravity,
        inertia_reference,
        inertia_cg,
        principal,
        observable: core::array::from_fn(|j| match j {
            0 => solved.observable[0],
            1..4 => seen(&centre_of_gravity[..])[j - 1].is_some(),
            _ => {
                let about = [&inertia_reference, &inertia_cg];
                about
                    .into_iter()
                    .any(|terms| seen(&terms[..])[j - 4].is_some())
            }
        }),
        condition_number: solved.condition_number,
        iterations,
        consistency: solved.consistency,
        misfit: solved.misfit,
        attenuation: solved.attenuation,
        freedom,
        plausibility,
    }
}

//! What the core found, as the contract tells it. The host turns its own results into the
//! same form, and compares them with a box's to the last bit.

use crate::wire::{
    self, Accelerations, Answer, Exact, Method, NoAnswer, POLES_MAX, Plausibility, Principal,
    Procedure, Quality, Question,
};
use massline_core::identify::{self, Estimate, Identification, IdentifyError};
use massline_core::masslines::{self, ApparentMass, FreeModes, MasslineError};
use massline_core::modes::Pole;
use massline_core::rigid_body::Margin;
use nalgebra::Vector3;

/// What condensing the groups of runs says beside the masslines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Findings {
    excited: Option<u8>,
    weakest: Option<f64>,
    poles: [Option<Pole>; POLES_MAX],
}

impl Findings {
    /// Nothing.
    pub(super) const NONE: Self = Self {
        excited: None,
        weakest: None,
        poles: [None; POLES_MAX],
    };

    /// Adds the fit of a group of runs.
    pub fn add_fit(&mut self, fit: &ApparentMass) {
        let excited = fit.excited as u8;
        self.excited = Some(self.excited.map_or(excited, |e| e.min(excited)));
        let weakest = fit.weakest_excitation;
        self.weakest = Some(self.weakest.map_or(weakest, |w| w.min(weakest)));
        self.add_poles(&fit.poles);
    }

    /// Adds the free modes of a group of runs.
    pub fn add_modes(&mut self, modes: &FreeModes) {
        self.add_poles(&modes.poles);
    }

    /// The group that shows most poles speaks for all.
    fn add_poles(&mut self, poles: &[Pole]) {
        if poles.len() > self.poles.iter().flatten().count() {
            self.poles = core::array::from_fn(|k| poles.get(k).copied());
        }
    }
}

/// The answer to a question, as the box tells it.
#[must_use]
pub fn answer(
    question: Question,
    accelerations: Accelerations,
    quality: Quality,
    identification: &Identification,
    findings: &Findings,
) -> Answer {
    let i = identification;
    let point = |v: &Vector3<f64>| [Exact(v.x), Exact(v.y), Exact(v.z)];
    let estimate = |e: Option<Estimate>| {
        e.map(|e| wire::Estimate {
            value: Exact(e.value),
            std: Exact(e.std),
        })
    };
    let margin = |m: Option<Margin>| {
        m.map(|m| wire::Margin {
            relative: Exact(m.relative),
            uncertainty: Exact(m.uncertainty),
        })
    };
    Answer {
        question,
        accelerations,
        quality,
        reference: point(&i.reference),
        mass: estimate(i.mass),
        indicator: estimate(i.indicator),
        centre_of_gravity: i.centre_of_gravity.map(estimate),
        inertia_reference: i.inertia_reference.map(estimate),
        inertia_cg: i.inertia_cg.map(estimate),
        principal: i.principal.map(|p| Principal {
            moments: point(&p.moments),
            axes: [0, 1, 2].map(|k| point(&p.axes.column(k).into())),
        }),
        observable: super::setup::mask(i.observable) as u16,
        condition_number: Exact(i.condition_number),
        iterations: i.iterations,
        consistency: i.consistency.map(Exact),
        misfit: Exact(i.misfit),
        attenuation: Exact(i.attenuation),
        freedom: Exact(i.freedom),
        plausibility: Plausibility {
            mass: margin(i.plausibility.mass),
            positive_definite: margin(i.plausibility.positive_definite),
            triangle: margin(i.plausibility.triangle),
        },
        excited: findings.excited,
        weakest_excitation: findings.weakest.map(Exact),
        poles: findings.poles.map(|pole| {
            pole.map(|p| wire::Pole {
                frequency: Exact(p.frequency),
                damping: Exact(p.damping),
            })
        }),
    }
}

impl From<Method> for masslines::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::ApparentMass => Self::ApparentMass,
            Method::FrequencyResponses => Self::FrequencyResponses,
            Method::PowerSpectra => Self::PowerSpectra,
            Method::PowerSpectraCholesky => Self::PowerSpectraCholesky,
            Method::FreeResponses => Self::FreeResponses,
            Method::FreeResponsesSquared => Self::FreeResponsesSquared,
            Method::CurveFit => Self::CurveFit,
            Method::Synthesis => Self::Synthesis,
        }
    }
}

impl From<masslines::Method> for Method {
    fn from(method: masslines::Method) -> Self {
        use masslines::Method as From;
        match method {
            From::ApparentMass => Self::ApparentMass,
            From::FrequencyResponses => Self::FrequencyResponses,
            From::PowerSpectra => Self::PowerSpectra,
            From::PowerSpectraCholesky => Self::PowerSpectraCholesky,
            From::FreeResponses => Self::FreeResponses,
            From::FreeResponsesSquared => Self::FreeResponsesSquared,
            From::CurveFit => Self::CurveFit,
            From::Synthesis => Self::Synthesis,
            // A method that the box does not know is none of its list.
            _ => Self::ApparentMass,
        }
    }
}

impl From<Procedure> for identify::Procedure {
    fn from(procedure: Procedure) -> Self {
        match procedure {
            Procedure::Direct => Self::Direct,
            Procedure::Iterative { tolerance, limit } => Self::Iterative { tolerance, limit },
        }
    }
}

impl From<MasslineError> for NoAnswer {
    fn from(error: MasslineError) -> Self {
        match error {
            MasslineError::TooFewLines(n) => Self::TooFewLines(n as u32),
            MasslineError::NoExcitation => Self::NoExcitation,
            MasslineError::NoResultant => Self::NoResultant,
            MasslineError::TooManyPairs { .. } => Self::TooManyPairs,
            MasslineError::Singular => Self::Singular,
            MasslineError::NoReference => Self::NoReference,
            MasslineError::TooFewRuns { needed, found } => Self::TooFewRuns {
                needed: needed as u8,
                found: found as u8,
            },
            MasslineError::NoMode => Self::NoMode,
            MasslineError::OtherLines { band, lines } => Self::Room {
                needed: band as u32,
                given: lines as u32,
            },
            MasslineError::Work { needed, given } => Self::Room {
                needed: needed as u32,
                given: given as u32,
            },
            MasslineError::TooManyRuns { limit, found } => Self::Room {
                needed: found as u32,
                given: limit as u32,
            },
            // The box refers every run to a drive, and has no poses.
            _ => Self::NoExcitation,
        }
    }
}

impl From<IdentifyError> for NoAnswer {
    fn from(error: IdentifyError) -> Self {
        match error {
            IdentifyError::NoMasslines => Self::NoMasslines,
            IdentifyError::NothingObservable => Self::NothingObservable,
            IdentifyError::KnownMass(m) => Self::KnownMass(m),
            IdentifyError::Diverged(d) => Self::Diverged(d),
            IdentifyError::NotConverged(d) => Self::NotConverged(d),
            _ => Self::NotFinite,
        }
    }
}

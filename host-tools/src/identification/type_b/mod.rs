//! Type B uncertainty: what the ten numbers owe to errors of calibrations, places and
//! directions, which no scatter of the data shows (GUM, JCGM 100:2008, 4.3 and 5.1).
//!
//! # Design
//!
//! * **Derivative of the whole chain.** Spectra of every channel are kept, and for each error
//!   resultants, masslines and numbers are computed anew with a hundredth of it up and down; the
//!   difference tells what one standard uncertainty contributes (5.1.3). So every method has it,
//!   iterative or not, whatever it does in between.
//! * **Small steps.** One sensor that is off by all of its uncertainty may stand out of the noise
//!   by far; the fit, which weighs equations by what is left of them, would then leave that
//!   sensor out, which it does not where all of them are off by as much.
//! * **Choices of a method stay as they are.** How many elastic terms are fitted and what is
//!   observable may not change between up and down: then the step is made smaller.
//! * **Errors are independent**, and normal with infinitely many degrees of freedom. Channels of
//!   one place are one block, whose position and direction they share.
//! * **Kept apart from type A.** Both meet in the combined standard uncertainty, whose degrees
//!   of freedom are those of Welch and Satterthwaite (G.4).
//! * **Cost**: one more pass over random recordings with a transform for each channel, then two
//!   identifications for each error, on all processors.

mod left;
mod sources;

use super::{AnswerError, Consistency, Found, OnProgress, Session, WARNED, identify_from};
use crate::measure::{
    self, Accelerations, Added, Channels, ForceGain, MeasureError, Measurement, RunGeometry,
};
use crate::parallel;
use crate::setup::Setup;
use left::Effect;
use massline_core::geometry::RESULTANTS;
use massline_core::identify::{Covariance, Estimate, Identification, Procedure};
use massline_core::masslines::Method;
use nalgebra::DVector;
use sources::{Error, Source, of_gains, of_weighed, sources, usual};

/// Numbers of an identification: mass, Δ, three of the centre of gravity, six of inertia about
/// A, six about S.
pub const NUMBERS: usize = 17;

/// Places among the [`NUMBERS`].
pub mod number {
    /// Place of the mass.
    pub const MASS: usize = 0;
    /// Place of the indicator Δ.
    pub const INDICATOR: usize = 1;
    /// Place of x of the centre of gravity; y and z follow.
    pub const CENTRE: usize = 2;
    /// Place of Θxx about A; yy, zz, xy, xz, yz follow.
    pub const INERTIA_REFERENCE: usize = 5;
    /// Place of Θxx about S; yy, zz, xy, xz, yz follow.
    pub const INERTIA_CG: usize = 11;
}

/// Contribution of one error.
#[derive(Clone, Debug, PartialEq)]
pub struct Contribution {
    /// The error in words.
    pub source: String,
    /// Change of each number by one standard uncertainty of the error, SI; `None` where the number
    /// is not observable.
    pub numbers: [Option<f64>; NUMBERS],
}

/// Type B uncertainty of the ten numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeB {
    /// Those of stated errors, one a source in the order of the channels, then those that the data tell, of which
    /// several may be one source.
    pub contributions: Vec<Contribution>,
    /// Times by which the errors of sensors exceed usual ones, by what a rigid body leaves; `None` where noise explains
    /// that.
    pub times_usual: Option<f64>,
}

/// A standard uncertainty that is combined of type A and type B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Combined {
    /// Type B alone, SI.
    pub type_b: f64,
    /// Combined standard uncertainty, SI.
    pub std: f64,
    /// Half of the 95 % interval that covers both, SI.
    pub interval: f64,
    /// Its effective degrees of freedom.
    pub freedom: f64,
}

impl TypeB {
    /// Standard uncertainty of a number, SI; `None` where it is not observable.
    #[must_use]
    pub fn std(&self, number: usize) -> Option<f64> {
        let squares = self.contributions.iter().map(|c| {
            let contribution = c.numbers.get(number).copied().flatten()?;
            Some(contribution * contribution)
        });
        squares.sum::<Option<f64>>().map(f64::sqrt)
    }

    /// The source that contributes most to a number, and its share of the variance.
    #[must_use]
    pub fn dominant(&self, number: usize) -> Option<(&str, f64)> {
        let variance = self.std(number)?.powi(2);
        let mut sources: Vec<(&str, f64)> = Vec::new();
        for contribution in &self.contributions {
            let square = contribution.numbers.get(number).copied().flatten()?.powi(2);
            let same = |(source, _): &&mut (&str, f64)| *source == contribution.source;
            match sources.iter_mut().find(same) {
                Some((_, sum)) => *sum += square,
                None => sources.push((&contribution.source, square)),
            }
        }
        let (source, square) = sources.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let share = square / variance;
        // Without any contribution nothing dominates.
        (share > 0.0).then_some((source, share))
    }

    /// Both types together, of a number whose type A has so many degrees of freedom.
    #[must_use]
    pub fn combined(&self, number: usize, type_a: &Estimate, freedom: f64) -> Option<Combined> {
        let type_b = self.std(number)?;
        let (std, freedom) = together(type_a.std, type_b, freedom);
        let both = Estimate { std, ..*type_a };
        Some(Combined {
            type_b,
            std,
            interval: both.interval(freedom),
            freedom,
        })
    }

    /// A warning that names the errors that could not be carried through: numbers that they touch
    /// have no type B uncertainty.
    pub(super) fn gaps(&self, i: &Identification) -> Option<String> {
        let all = estimates(i);
        let lost = |c: &&Contribution| {
            let mut pairs = all.iter().zip(&c.numbers);
            pairs.any(|(estimate, number)| estimate.is_some() && number.is_none())
        };
        let lost = self.contributions.iter().filter(lost);
        let mut names: Vec<&str> = lost.map(|c| &*c.source).collect();
        names.dedup();
        (!names.is_empty()).then(|| {
            format!(
                "the stated uncertainty is more than this test can be carried through with: {}; numbers that it touches have no type B uncertainty",
                names.join("; ")
            )
        })
    }

    /// Covariance of mass (or Δ), centre of gravity and inertia about S.
    #[must_use]
    pub fn covariance(&self, mass_known: bool) -> Covariance {
        let first = if mass_known {
            number::INDICATOR
        } else {
            number::MASS
        };
        let place = |i: usize| match i {
            0 => first,
            1..4 => number::CENTRE + i - 1,
            _ => number::INERTIA_CG + i - 4,
        };
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let products = self.contributions.iter().map(|c| {
                    let of = |i: usize| c.numbers.get(place(i)).copied().flatten();
                    Some(of(i)? * of(j)?)
                });
                products.sum()
            })
        })
    }
}

/// Estimates of an identification by their [`number`].
#[must_use]
pub fn estimates(i: &Identification) -> [Option<Estimate>; NUMBERS] {
    let mut all = [None; NUMBERS];
    let list = [i.mass, i.indicator].into_iter();
    let list = list
        .chain(i.centre_of_gravity)
        .chain(i.inertia_reference)
        .chain(i.inertia_cg);
    for (slot, estimate) in all.iter_mut().zip(list) {
        *slot = estimate;
    }
    all
}

impl Session<'_> {
    /// Type B uncertainty of an answer; `None` where the setup and the certificates state
    /// nothing, no gains change within a run, no force is distorted, the data say the weighed mass, and noise explains what a
    /// rigid body leaves.
    ///
    /// # Errors
    /// [`AnswerError`] if the recordings cannot be read once more.
    pub(super) fn type_b(
        &self,
        method: Method,
        procedure: Procedure,
        (accelerations, measurement): (&Accelerations, &Measurement),
        (nominal, [changing, distorted]): (&Found, [Vec<ForceGain>; 2]),
        progress: OnProgress<'_>,
    ) -> Result<Option<TypeB>, AnswerError> {
        let mut sources = sources(self.setup, measurement);
        sources.extend(of_gains("forces that change within a run", changing));
        sources.extend(of_gains("distortion of forces", distorted));
        sources.extend(of_weighed(self.setup, &nominal.identification));
        let told = sources.len();
        let doubtful = |test: &Consistency| test.probability < WARNED;
        let left = nominal.consistency.filter(doubtful);
        let left = left.and_then(|_| left::residuals(&nominal.sets));
        if left.is_some() {
            sources.extend(usual(self.setup, method.interface_only()));
        }
        if sources.is_empty() {
            return Ok(None);
        }
        let of_sensors = |source: &Source| matches!(source.error, Error::Sensors(_));
        let channels = if sources.iter().any(of_sensors) {
            let limit = self.limit;
            Some(measure::channels(self.setup, measurement, limit, progress)?)
        } else {
            None
        };
        let chain = Chain {
            setup: self.setup,
            method,
            procedure,
            accelerations,
            measurement,
            channels,
            nominal: Choices::of(nominal),
            observable: estimates(&nominal.identification).map(|e| e.is_some()),
        };
        let (effects, _) = parallel::each(
            sources.len(),
            None,
            &|k| chain.effect(&sources[k]),
            &mut |done, _| {
                progress(measure::Progress {
                    work: measure::Work::Reading,
                    run: done,
                    runs: sources.len(),
                    name: "uncertainty",
                    share: 0.0,
                });
            },
        )?;
        let mut effects: Vec<Effect> = effects;
        let usual = effects.split_off(told);
        let contribution = |(source, effect): (&Source, Effect)| Contribution {
            source: source.name.clone(),
            numbers: effect.numbers,
        };
        let mut found = TypeB {
            contributions: sources.iter().zip(effects).map(contribution).collect(),
            times_usual: None,
        };
        if let Some((contributions, times)) =
            left.and_then(|left| left::contributions(&left, &usual, &chain.observable))
        {
            found.contributions.extend(contributions);
            found.times_usual = Some(times);
        }
        Ok((!found.contributions.is_empty()).then_some(found))
    }
}

/// Standard uncertainty of both types together, and its degrees of freedom by Welch and
/// Satterthwaite: type A has `freedom` of them, type B infinitely many.
pub(super) fn together(type_a: f64, type_b: f64, freedom: f64) -> (f64, f64) {
    let std = type_a.hypot(type_b);
    let freedom = if type_b == 0.0 {
        freedom
    } else if type_a == 0.0 {
        f64::INFINITY
    } else {
        freedom * (std / type_a).powi(4)
    };
    (std, freedom)
}

/// All that an identification is computed anew from.
struct Chain<'a> {
    setup: &'a Setup,
    method: Method,
    procedure: Procedure,
    accelerations: &'a Accelerations,
    measurement: &'a Measurement,
    /// Those of all runs, if errors of sensors are among the sources.
    channels: Option<Channels>,
    nominal: Choices,
    observable: [bool; NUMBERS],
}

/// Discrete choices of a method.
#[derive(Clone, Debug, PartialEq)]
struct Choices {
    observable: [bool; 10],
    /// Number of poles, terms, and number of excited directions of each fit.
    fits: Vec<(usize, Vec<bool>, usize)>,
}

impl Choices {
    fn of(found: &Found) -> Self {
        let fits = found.fits.iter().map(|fit| {
            let beyond = [fit.pseudo_mode.is_some(), fit.upper.is_some()];
            let elastic = fit.elastic.iter().map(Option::is_some);
            let terms = elastic.chain(beyond).collect();
            (fit.poles.len(), terms, fit.excited)
        });
        Self {
            observable: found.identification.observable,
            fits: fits.collect(),
        }
    }
}

/// Steps in standard uncertainties, of which the first is taken that changes no choice. Single
/// precision of responses, 2e-8 a line, is below a hundredth of the smallest of them for an
/// uncertainty of 1e-3.
const STEPS: [f64; 2] = [0.01, 0.002];

impl Chain<'_> {
    fn effect(&self, source: &Source) -> Result<Effect, AnswerError> {
        let added = match &source.error {
            Error::Sensors(changes) => self.added(changes)?,
            Error::Mass(_) | Error::Weighed(_) | Error::Forces(_) => Vec::new(),
        };
        let mut numbers = [None; NUMBERS];
        let mut residuals = DVector::zeros(0);
        for step in STEPS {
            // Where up or down the data allow no answer, nearer they do.
            let side = |factor: f64| self.identify(source, &added, factor).ok();
            let (Some(up), Some(down)) = (side(step), side(-step)) else {
                continue;
            };
            let (above, below) = (
                estimates(&up.identification),
                estimates(&down.identification),
            );
            for (slot, (above, below)) in numbers.iter_mut().zip(above.into_iter().zip(below)) {
                *slot = above
                    .zip(below)
                    .map(|(a, b)| (a.value - b.value) / (2.0 * step));
            }
            let left = left::residuals(&up.sets).zip(left::residuals(&down.sets));
            if let Some((up, down)) = left.filter(|(up, down)| up.len() == down.len()) {
                residuals = (up - down) / (2.0 * step);
            }
            if Choices::of(&up) == self.nominal && Choices::of(&down) == self.nominal {
                break;
            }
        }
        for (number, observable) in numbers.iter_mut().zip(self.observable) {
            *number = number.filter(|x| observable && x.is_finite());
        }
        // Δ says how far the masses are apart, and is judged by what it is known to.
        if let (Error::Weighed(_), Some(delta)) = (&source.error, &mut numbers[number::INDICATOR]) {
            *delta = 0.0;
        }
        Ok(Effect { numbers, residuals })
    }

    fn added(&self, changes: &[measure::Change]) -> Result<Vec<Added>, MeasureError> {
        let runs = self.setup.runs.iter().enumerate();
        runs.map(|(number, run)| {
            let geometry = RunGeometry::new(self.setup, number, self.accelerations)?;
            let mut sum: Added = vec![[0.0; RESULTANTS]; geometry.columns.len()];
            for change in changes {
                let added = geometry
                    .changed_columns(self.setup, number, self.accelerations, change)
                    .map_err(|source| MeasureError::Geometry {
                        run: run.name.clone(),
                        source,
                    })?;
                for (sum, added) in sum.iter_mut().flatten().zip(added.iter().flatten()) {
                    *sum += added;
                }
            }
            Ok(sum)
        })
        .collect()
    }

    fn identify(&self, source: &Source, added: &[Added], step: f64) -> Result<Found, AnswerError> {
        let from =
            |changed: Measurement| identify_from(self.setup, self.method, self.procedure, &changed);
        match &source.error {
            Error::Sensors(_) => from(match &self.channels {
                Some(channels) => channels.with_columns(self.measurement, added, step),
                None => self.measurement.clone(),
            }),
            Error::Forces(gains) => from(self.measurement.with_gains(gains, step)),
            Error::Mass(by) | Error::Weighed(by) => {
                let known_mass = self.setup.known_mass.map(|mass| mass + by * step);
                let setup = Setup {
                    known_mass,
                    ..self.setup.clone()
                };
                identify_from(&setup, self.method, self.procedure, self.measurement)
            }
        }
    }
}

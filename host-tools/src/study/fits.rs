//! Maximum likelihood fits of recordings under noise, beside the band's method on the same draws and the bound
//! of Cramér and Rao.

use super::errors::Errors;
use super::estimate::{Numbers, Outcome, Solution};
use super::{Options, StudyError, Twin};
use crate::identification::{self, Choice, Session, fit_records, widest_band};
use crate::measure::{Accelerations, measure_samples, sampled_records};
use crate::prediction;
use crate::simulate::{self, Bound};
use massline_core::identify::{Estimate, Identification};
use massline_core::masslines::Method;
use std::rc::Rc;

/// One draw.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Numbers of the fit, or of the band where it steps back.
    fit: Outcome,
    /// Their standard deviations, per cent of the true numbers.
    claimed: [f64; Numbers::COUNT],
    /// Numbers of the apparent mass in averaging range II, with its equations weighed by their noise.
    band: Outcome,
    /// Their standard deviations, likewise.
    band_claimed: [f64; Numbers::COUNT],
    /// Least standard deviations, likewise.
    bound: [f64; Numbers::COUNT],
    /// `true` if the numbers are those of the band.
    back: bool,
}

/// Fits over the draws of a level of noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Fits {
    /// Errors of the maximum likelihood fit.
    pub fit: Errors,
    /// Root mean square of the standard deviations that it claims, per cent.
    pub claimed: [f64; Numbers::COUNT],
    /// Errors of the apparent mass in averaging range II on the same draws.
    pub band: Errors,
    /// Root mean square of the standard deviations that it claims, per cent.
    pub band_claimed: [f64; Numbers::COUNT],
    /// Bound of Cramér and Rao, per cent.
    pub bound: [f64; Numbers::COUNT],
    /// Draws that have the band's numbers, since the fit does not pass its tests.
    pub stepped_back: usize,
}

impl Fits {
    /// Name of the row of the fit.
    pub const NAME: &str = "maximum likelihood";
    /// Name of the row of the bound.
    pub const BOUND: &str = "Cramér-Rao bound";

    pub(super) fn over(draws: &[Fitted], exact: &Numbers) -> Self {
        let rms = |of: &dyn Fn(&Fitted) -> [f64; Numbers::COUNT]| {
            core::array::from_fn(|i| {
                let squares: f64 = draws.iter().map(|d| of(d)[i].powi(2)).sum();
                (squares / draws.len() as f64).sqrt()
            })
        };
        Self {
            fit: Errors::over(draws.iter().map(|d| &d.fit), exact),
            claimed: rms(&|d| d.claimed),
            band: Errors::over(draws.iter().map(|d| &d.band), exact),
            band_claimed: rms(&|d| d.band_claimed),
            bound: rms(&|d| d.bound),
            stepped_back: draws.iter().filter(|d| d.back).count(),
        }
    }
}

/// Recordings with white noise of `level` times each channel's RMS, fitted through the resonances.
pub(super) fn fitted(
    twin: &Twin,
    options: &Options,
    level: f64,
    seed: u64,
) -> Result<Fitted, StudyError> {
    let simulated = simulate::Options {
        noise: Some(level),
        seed,
        weighed: true,
        ..simulate::Options::default()
    };
    let mut simulation = simulate::without_errors(&twin.model, &simulated, &mut |_| ())?;
    let bounds = prediction::bounds(&twin.model.specimen, &simulation, level);
    simulation.disturb(&twin.model, &simulated)?;
    let exact = Numbers::exact(twin);
    let bound = bounds.last().map_or([f64::NAN; Numbers::COUNT], |bound| {
        percent(&deviations(bound, twin), &exact)
    });
    let setup = &simulation.setup;
    let samples = prediction::samples(&simulation);
    let accelerations = Accelerations::Interface;
    let measured = measure_samples(setup, &accelerations, &samples)?;
    let measurements = vec![(accelerations.clone(), Rc::new(measured))];
    let mut session = Session::of_measurements(setup, measurements);
    let choice = Choice::default();
    let answer = session.answer_with(Method::ApparentMass, &choice, &accelerations, &mut |_| ());
    let none = |why: String| Fitted {
        fit: Err(why.clone()),
        claimed: [f64::NAN; Numbers::COUNT],
        band: Err(why),
        band_claimed: [f64::NAN; Numbers::COUNT],
        bound,
        back: false,
    };
    let band = match answer {
        Ok(answer) => answer.identification,
        Err(why) => return Ok(none(why.to_string())),
    };
    let widest = widest_band(setup).unwrap_or([options.spacing, options.highest]);
    let records = match sampled_records(setup, widest, &samples, &mut Vec::new()) {
        Ok(records) => records,
        Err(why) => return Ok(none(why.to_string())),
    };
    let mut found = fit_records(&records, &widest, &band, 1, &mut |_| ());
    let numbers = found.numbers(&band, setup.known_mass, None);
    let fit = numbers.map_or(band, |(identification, _)| identification);
    Ok(Fitted {
        claimed: percent(&claimed(&fit), &exact),
        fit: outcome(&fit),
        band: outcome(&band),
        band_claimed: percent(&claimed(&band), &exact),
        bound,
        back: !found.is_used(),
    })
}

fn outcome(identification: &Identification) -> Outcome {
    Numbers::of(identification)
        .map(|numbers| Solution {
            numbers,
            iterations: identification.iterations,
        })
        .ok_or_else(|| "not all of x, z, Θ and Δ are observable".to_owned())
}

/// Standard deviations of the numbers, in their order.
fn claimed(identification: &Identification) -> [f64; Numbers::COUNT] {
    let std = |number: usize| {
        let found: Option<Estimate> = identification::estimates(identification)[number];
        found.map_or(f64::NAN, |e| e.std)
    };
    use identification::number;
    [
        std(number::CENTRE),
        std(number::CENTRE + 2),
        std(number::INERTIA_REFERENCE + 1),
        std(number::INERTIA_CG + 1),
        std(number::INDICATOR),
    ]
}

/// Least standard deviations of the numbers, in their order.
fn deviations(bound: &Bound, twin: &Twin) -> [f64; Numbers::COUNT] {
    let known = |x: Option<f64>| x.unwrap_or(f64::NAN);
    [
        known(bound.centre_of_gravity[0]),
        known(bound.centre_of_gravity[2]),
        known(bound.inertia_reference.yy),
        known(bound.inertia_cg.yy),
        known(bound.mass) / twin.truth.mass,
    ]
}

fn percent(deviations: &[f64; Numbers::COUNT], exact: &Numbers) -> [f64; Numbers::COUNT] {
    let exact = exact.list();
    core::array::from_fn(|i| 100.0 * deviations[i] / exact[i].abs())
}

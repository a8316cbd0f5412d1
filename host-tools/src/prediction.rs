//! Least error bars of a simulated test: the Cramér-Rao bound of the specimen that was simulated.

use crate::identification::{Choice, Session, told_of, widest_band};
use crate::likelihood::{
    Covariance10, FittedMode, Model as Fitted, RIGID, bound, numbers, sigma_of,
};
use crate::measure::{Accelerations, Samples, measure_samples, sampled_records};
use crate::setup::{Excitation, Setup};
use crate::simulate::{Bound, InertiaTruth, Simulation, Specimen};
use massline_core::masslines::Method;
use nalgebra::{Matrix6, Vector3};
use std::rc::Rc;

/// Modes up to so many times the highest line have parameters of their own.
const AS_MODES: f64 = 2.0;

/// Model of the fit that a specimen follows, about the point `reference` (m), for lines up to
/// `highest` (Hz) of so many runs. Modes above `as_modes` (Hz) are in its matrix E.
#[must_use]
pub fn fitted(
    specimen: &Specimen,
    reference: &Vector3<f64>,
    (highest, as_modes): (f64, f64),
    runs: usize,
) -> Fitted {
    let specimen = specimen.about(reference);
    let mut model = Fitted::rigid(sigma_of(&specimen.mass_matrix), highest, runs);
    let mut rest = None;
    for mode in &specimen.modes {
        if mode.frequency <= as_modes {
            let fitted = FittedMode::new(mode.frequency, mode.damping, mode.participation);
            model.push(FittedMode {
                exponent: mode.exponent,
                ..fitted
            });
        } else {
            let share = highest / mode.frequency;
            let effective = mode.participation * mode.participation.transpose();
            *rest.get_or_insert_with(Matrix6::zeros) += effective * (share * share);
        }
    }
    if let Some(rest) = rest {
        model.set_upper_matrix(&rest);
    }
    model
}

/// Bounds of a test that was simulated without noise, for white noise of each sensor that is a share
/// `noise` of its RMS: of the averaging band, and of all lines that method `ml` fits. Empty without
/// noise, and where that method has no records.
#[must_use]
pub fn bounds(specimen: &Specimen, clean: &Simulation, noise: f64) -> Vec<Bound> {
    let setup = &clean.setup;
    let random = |r: &crate::setup::Run| r.excitation == Excitation::Random;
    if noise <= 0.0 || !setup.runs.iter().all(random) {
        return Vec::new();
    }
    let (Some(told), Some(widest), Some(p)) = (told(clean), widest_band(setup), &setup.processing)
    else {
        return Vec::new();
    };
    let noisy = with_stated_noise(clean, noise);
    let reference = Vector3::from(setup.reference_point);
    let of = |band: [f64; 2]| {
        let samples = samples(clean);
        let read = sampled_records(&noisy, band, &samples, &mut Vec::new()).ok()?;
        let model = fitted(
            specimen,
            &reference,
            (band[1], AS_MODES * band[1]),
            setup.runs.len(),
        );
        let found = bound::bound(&read.records, &model, told).ok()?;
        Some(document(setup, &model, &found, (band, told)))
    };
    let mut bands = vec![p.averaging_band];
    bands.extend((p.averaging_band != widest).then_some(widest));
    bands.into_iter().filter_map(of).collect()
}

/// Sensors and drive of each run.
pub(crate) fn samples(simulation: &Simulation) -> Vec<Samples<'_>> {
    let runs = simulation.setup.runs.iter().zip(&simulation.recordings);
    runs.map(|(run, recording)| {
        let lead = usize::from(!run.references.is_empty());
        Samples {
            sensors: recording.samples.get(lead..).unwrap_or_default(),
            drive: recording.samples.first().map_or(&[], Vec::as_slice),
        }
    })
    .collect()
}

/// Parameters σ that the test tells.
fn told(clean: &Simulation) -> Option<[bool; RIGID]> {
    let accelerations = Accelerations::Interface;
    let measured = measure_samples(&clean.setup, &accelerations, &samples(clean)).ok()?;
    let measurements = vec![(accelerations.clone(), Rc::new(measured))];
    let mut session = Session::of_measurements(&clean.setup, measurements);
    let method = Method::ApparentMass;
    let choice = Choice::default();
    let answer = session.answer_with(method, &choice, &accelerations, &mut |_| ());
    Some(told_of(&answer.ok()?.identification))
}

/// The setup with each sensor's noise stated, and without the drives that would tell it.
fn with_stated_noise(clean: &Simulation, noise: f64) -> Setup {
    let mut setup = clean.setup.clone();
    let level = |channel: &str| Some(noise * clean.rms(channel));
    for sensor in &mut setup.accelerometers {
        sensor.uncertainty.noise = level(&sensor.channel);
    }
    for cell in &mut setup.load_cells {
        cell.uncertainty.noise = level(&cell.channel);
    }
    for run in &mut setup.runs {
        run.references.clear();
    }
    setup
}

/// Least standard deviations of the numbers that the test tells; CG and inertia about it are those of
/// a weighed mass where the setup has one.
fn document(
    setup: &Setup,
    model: &Fitted,
    found: &Covariance10,
    (band, told): ([f64; 2], [bool; RIGID]),
) -> Bound {
    let (_, slopes) = numbers(&model.rigid, &Vector3::zeros(), setup.known_mass);
    let about_cg = slopes * found * slopes.transpose();
    let std = |c: &Covariance10, i: usize| told[i].then(|| c[(i, i)].max(0.0).sqrt());
    Bound {
        band,
        mass: std(found, 0),
        centre_of_gravity: core::array::from_fn(|i| std(&about_cg, 1 + i)),
        inertia_reference: InertiaTruth::from_terms(core::array::from_fn(|i| std(found, 4 + i))),
        inertia_cg: InertiaTruth::from_terms(core::array::from_fn(|i| std(&about_cg, 4 + i))),
    }
}

//! One draw: a random structure, its test, its bound, both answers.

use super::{Axes, Case, Disturbance, Drawn, NUMBERS, Options, Scored};
use crate::identification::fit_records;
use crate::likelihood::{Covariance10, Model as Fitted, Record, bound, numbers};
use crate::prediction;
use crate::simulate::{Measurement, Model, Plan, Shaking, Table};
use crate::study::chance::Chance;
use crate::study::structures::{Structure, add_modes, elastic, load_cells, motion_sensors, rigid};
use crate::study::trial::{Conditions, Trial, TrialError};
use massline_core::identify::{Estimate, Identification};
use massline_core::masslines::Method;
use std::time::Instant;

/// Samples per second, Hz.
const RATE: f64 = 512.0;
/// Lowest line, Hz.
const LOWEST: f64 = 1.0;
/// Highest line over the second mode.
const HIGHEST: f64 = 1.2;
/// Integers that f64 counts without gaps.
const SEEDS: f64 = 9_007_199_254_740_992.0;
/// End of the averaging band over the first mode.
const BAND: f64 = 0.45;

/// Couplings of a table that rotates a little, shares of its translations.
const COUPLED: [f64; 2] = [1e-5, 1e-2];

/// Modes of the case of many, and how far they lie apart.
const MANY: (usize, [f64; 2]) = (20, [1.02, 1.08]);
/// Highest line over the last of many modes.
const BEYOND_MANY: f64 = 1.05;

/// The test of a draw, and its highest line in Hz.
fn model(case: &Case, options: &Options, chance: &mut Chance) -> (Model, f64) {
    let first = 20.0 * chance.between(2.0, 3.0);
    let mut structure = if case.disturbance == Disturbance::Many {
        let mut structure = rigid(chance);
        add_modes(chance, &mut structure, first, MANY);
        structure
    } else {
        elastic(chance, first)
    };
    let modes = &mut structure.specimen.modes;
    match case.disturbance {
        Disturbance::Structural => {
            for mode in modes.iter_mut() {
                mode.exponent = 0.0;
            }
        }
        Disturbance::JustBeyond => {
            let beyond = modes[1].frequency * HIGHEST * 1.005;
            let rise = beyond / modes[2].frequency;
            for mode in &mut modes[2..] {
                mode.frequency *= rise;
            }
        }
        Disturbance::Pair => modes[1].frequency = modes[0].frequency * 1.003,
        Disturbance::None | Disturbance::Moved | Disturbance::Many => {}
    }
    let first = modes[0].frequency;
    let highest = match case.disturbance {
        Disturbance::Many => modes[MANY.0 - 1].frequency * BEYOND_MANY,
        _ => HIGHEST * modes[1].frequency,
    };
    (test(case, options, chance, &structure, first), highest)
}

fn test(
    case: &Case,
    options: &Options,
    chance: &mut Chance,
    structure: &Structure,
    first: f64,
) -> Model {
    let radius = structure.size * chance.between(0.3, 0.5);
    let level = chance.between(0.5, 3.0);
    let rotation = |chance: &mut Chance| level / radius * chance.between(0.5, 1.5);
    let axes: [[f64; 6]; 3] = std::array::from_fn(|axis| match case.axes {
        Axes::Rotations => about(axis, rotation(chance), radius, chance),
        _ => [0.0; 6],
    });
    let runs = (0..6)
        .map(|run| {
            let mut motion = [0.0; 6];
            match case.axes {
                Axes::Rotations => motion = axes[run % 3],
                Axes::All if run >= 3 => motion[run] = rotation(chance),
                Axes::All | Axes::Translations | Axes::Coupled => motion[run % 3] = level,
            }
            let name = format!("run {}", run + 1);
            Plan::new(name, Shaking::random(motion, case.drive))
        })
        .collect();
    let cross_talk = match case.axes {
        Axes::All => chance.between(0.0, 0.05),
        Axes::Coupled => chance.by_ratio(COUPLED[0], COUPLED[1]),
        Axes::Translations | Axes::Rotations => 0.0,
    };
    Model {
        title: "Random elastic structure".to_owned(),
        reference_point: [0.0; 3],
        specimen: structure.specimen.clone(),
        accelerometers: motion_sensors(chance, structure, radius),
        load_cells: load_cells(chance, radius),
        table: Table {
            cross_talk,
            lever_arm: radius,
            internal_forces: 0.1,
            ..Table::default()
        },
        measurement: Measurement {
            sample_rate: RATE,
            duration: options.duration,
            noise: 0.0,
            dc_offset: 0.0,
            block_length: 1024,
            overlap: 0.5,
            averaging_band: [LOWEST, BAND * first],
            mode_band: Some([0.85 * first, 2.0 * first]),
            rigid_up_to: None,
        },
        runs,
    }
}

/// Acceleration of A by a rotation (rad/s²) about an axis along one of the three, which passes A at up to `radius`.
fn about(axis: usize, rotation: f64, radius: f64, chance: &mut Chance) -> [f64; 6] {
    let [second, third] = [(axis + 1) % 3, (axis + 2) % 3];
    let mut motion = [0.0; 6];
    motion[3 + axis] = rotation;
    // α x r, from the axis to A.
    motion[third] = rotation * chance.between(-radius, radius);
    motion[second] = -rotation * chance.between(-radius, radius);
    motion
}

/// All levels of noise of one draw.
pub(super) fn draw(case: &Case, options: &Options, seed: u64) -> Result<Vec<Drawn>, TrialError> {
    let mut chance = Chance::new(seed, &["likelihood", case.name]);
    // Each case has noise and excitation of its own.
    let seed = chance.between(0.0, SEEDS) as u64;
    let (model, highest) = model(case, options, &mut chance);
    let first = model.specimen.modes.first().map_or(1.0, |m| m.frequency);
    let mut conditions = Conditions::default();
    if case.disturbance == Disturbance::Moved {
        conditions.moved = Some(0.995);
    }
    let trial = Trial::new(model, seed, &conditions)?;
    let specimen = &trial.model().specimen;
    let origin = nalgebra::Vector3::from(trial.model().reference_point);
    let bands = (highest, f64::INFINITY);
    let truth = prediction::fitted(specimen, &origin, bands, trial.setup.runs.len());
    let clean = trial.lines(None, [LOWEST, highest])?.records;
    let below = specimen
        .modes
        .iter()
        .filter(|m| m.frequency <= highest)
        .count();
    // Translations tell mass and centre of gravity.
    let told = core::array::from_fn(|i| i < 4 || case.axes != Axes::Translations);
    let mut all = Vec::with_capacity(options.noise.len());
    for &level in &options.noise {
        let noise = trial.resultant_noise(level)?;
        let bounded = |highest: f64| {
            let records: Vec<Record> = clean
                .iter()
                .map(|r| Record {
                    noise,
                    level: Vec::new(),
                    ..r.thinned(0, 1, highest)
                })
                .collect();
            bound::bound(&records, &truth, told).ok()
        };
        all.push(one(
            &trial,
            (level, highest),
            (&truth, below),
            [bounded(highest), bounded(BAND * first)],
        )?);
    }
    Ok(all)
}

fn one(
    trial: &Trial,
    (level, highest): (f64, f64),
    (truth, below): (&Fitted, usize),
    bounds: [Option<Covariance10>; 2],
) -> Result<Drawn, TrialError> {
    let mut drawn = Drawn::default();
    let origin = nalgebra::Vector3::from(trial.model().reference_point);
    let (values, slopes) = numbers(&truth.rigid, &origin, None);
    let [whole, band] = bounds.map(|b| b.map(|b| slopes * b * slopes.transpose()));
    let Some(whole) = whole else {
        return Ok(drawn);
    };
    let answers = trial.whole_answers(level, &[Some(Method::ApparentMass)])?;
    let today = answers.into_iter().next().and_then(Result::ok);
    let Some(today) = today.map(|a| a.identification) else {
        drawn.stepped_back = Some("the band's method has no answer".to_owned());
        return Ok(drawn);
    };
    let began = Instant::now();
    let read = trial.lines(Some(level), [LOWEST, highest]);
    let found = read.map(|read| fit_records(&read, &[LOWEST, highest], &today, 1, &mut |_| ()));
    drawn.work = began.elapsed();
    let mut given = today;
    match found {
        Ok(mut found) => {
            drawn.narrower = !found.rejected.is_empty();
            if let Some((fitted, _)) = found.numbers(&today, None, None) {
                given = fitted;
                let modes = found.fit.map_or(0, |fit| fit.model.modes.len());
                drawn.surplus = modes as i64 - below as i64;
            }
            drawn.stepped_back = found.stepped_back;
        }
        Err(reason) => drawn.stepped_back = Some(reason.to_string()),
    }
    for i in 0..NUMBERS {
        // A number that this test does not tell has no bound.
        if number(&today, i).is_none() {
            continue;
        }
        let bound = whole[(i, i)].max(0.0).sqrt();
        let score = |found: &Identification| {
            number(found, i).map(|e| Scored {
                error: (e.value - values[i]) / bound,
                claim: e.std / bound,
                holds: (e.value - values[i]).abs() <= e.interval(found.freedom),
            })
        };
        drawn.likelihood[i] = score(&given);
        drawn.band[i] = score(&today);
        drawn.band_bound[i] = band.map(|b| b[(i, i)].max(0.0).sqrt() / bound);
    }
    Ok(drawn)
}

fn number(found: &Identification, i: usize) -> Option<Estimate> {
    match i {
        0 => found.mass,
        1..4 => found.centre_of_gravity[i - 1],
        _ => found.inertia_cg[i - 4],
    }
}

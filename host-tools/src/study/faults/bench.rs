//! Random set-ups: structures, sensors, runs, noise.

use crate::setup::Setup;
use crate::simulate::{Model, Shaking};
use crate::study::chance::Chance;
use crate::study::coverage::{CaseError, elastic_structure, fork, remounted, satellite};
use crate::study::trial::{Conditions, Trial, TrialError};
use nalgebra::Vector3;

/// A kind of set-up.
pub(super) struct Bench {
    /// As given to `--case`.
    pub(super) name: &'static str,
    model: fn(&mut Chance) -> Result<Model, CaseError>,
}

/// All kinds.
pub(super) const BENCHES: [Bench; 5] = [
    Bench {
        name: "satellite",
        model: |chance| Ok(satellite(chance)?.0),
    },
    Bench {
        name: "fork",
        model: |chance| Ok(fork(chance)?.0),
    },
    Bench {
        name: "random",
        model: |chance| Ok(elastic_structure(chance)?.0),
    },
    Bench {
        name: "uniaxial",
        model: |chance| Ok(remounted(chance)?.0),
    },
    Bench {
        name: "translations",
        model: translations,
    },
];

fn translations(chance: &mut Chance) -> Result<Model, CaseError> {
    let mut model = elastic_structure(chance)?.0;
    model.runs.truncate(3);
    model.table.cross_talk = 0.0;
    Ok(model)
}

/// Differences between sensors and what a set-up says of them, root mean square: gain; direction,
/// rad; position, m.
const DIFFERENCES: [f64; 3] = [0.003, 0.0052, 0.0005];

impl Bench {
    /// A test of this kind and its noise, a share of each channel's RMS.
    pub(super) fn draw(
        &self,
        chance: &mut Chance,
        seed: u64,
    ) -> Result<Result<(Trial, f64), TrialError>, CaseError> {
        let mut model = (self.model)(chance)?;
        let driven = chance.happens(0.7);
        for run in &mut model.runs {
            if let Shaking::Random { drive, .. } = &mut run.excitation {
                *drive = driven;
            }
        }
        let level = chance.by_ratio(1e-3, 3e-2);
        let share = chance.between(0.0, 1.0);
        let conditions = Conditions {
            weighed: chance.happens(0.3),
            ..Conditions::default()
        };
        Ok(Trial::new(model, seed, &conditions).map(|mut trial| {
            differ(&mut trial.setup, chance, share);
            (trial, level)
        }))
    }
}

/// Lets the set-up differ from the sensors, by so much of the usual differences. Channels at one place
/// are one sensor, which sits elsewhere as a whole.
fn differ(setup: &mut Setup, chance: &mut Chance, share: f64) {
    let [gain, turn, shift] = DIFFERENCES.map(|d| d * share);
    let mut places: Vec<([f64; 3], Vector3<f64>)> = Vec::new();
    let mut one = |scale: &mut f64, direction: &mut [f64; 3], position: &mut [f64; 3]| {
        *scale *= 1.0 + gain * chance.normal();
        let turned = Vector3::from(*direction).map(|x| x + turn * chance.normal());
        *direction = turned.normalize().into();
        let known = places.iter().find(|(place, _)| place == position);
        let moved = known.map_or_else(
            || Vector3::from(*position).map(|x| x + shift * chance.normal()),
            |(_, moved)| *moved,
        );
        places.push((*position, moved));
        *position = moved.into();
    };
    for a in &mut setup.accelerometers {
        one(&mut a.scale, &mut a.direction, &mut a.position);
    }
    for c in &mut setup.load_cells {
        one(&mut c.scale, &mut c.direction, &mut c.position);
    }
}

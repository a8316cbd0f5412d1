//! Step 5: faults that all sensors share. They contradict nothing, so that only a body that cannot
//! be, its density, and a weighed mass speak against them.

use nalgebra::Vector3;

use super::evidence::{OUTLYING, middle, spread};
use super::hypothesis::FACTORS;
use super::search::{CONTRADICTS, Candidate, Found};
use super::sensor::Sensor;
use crate::format::plain;
use crate::setup::{AccelerometerEntry, Measured, Setup, Units};

/// Density over the cube that the sensors span, kg/m³, below which positions are not in metres.
const LIGHTEST: f64 = 0.01;
/// Density above which the unit of the accelerations is asked for: few structures are as dense as
/// water over such a cube.
const DENSE: f64 = 1000.0;
/// Distance of the reference point from the sensors over the largest between these, above which
/// the point is taken for a mistake.
const FAR: f64 = 10.0;
/// Agreement of a ratio of masses with a usual factor.
const NEAR: f64 = 0.03;

/// Kind of a fault that many sensors share, or of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WholeFault {
    /// The reference point lies far away.
    ReferencePoint,
    /// Single positions lie far away.
    Outlying,
    /// All load cells or all accelerometers have the other sign.
    Reversed,
    /// All accelerations are in g, since the mass is known.
    InG,
    /// All load cells or all accelerations are in another unit.
    Unit,
    /// All positions are in millimetres.
    Millimetres,
    /// The question if all accelerations are in g, since the body would be dense.
    PerhapsInG,
    /// The same question where nothing states a unit.
    NoUnit,
}

impl WholeFault {
    /// The kind as one word of the documents.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ReferencePoint => "reference-point",
            Self::Outlying => "outlying",
            Self::Reversed => "all-reversed",
            Self::InG => "all-in-g",
            Self::Unit => "unit-of-all",
            Self::Millimetres => "all-in-mm",
            Self::PerhapsInG => "perhaps-all-in-g",
            Self::NoUnit => "no-unit",
        }
    }
}

/// A fault that many sensors share, or a question.
#[derive(Clone, Debug, PartialEq)]
pub struct Whole {
    /// Its kind.
    pub fault: WholeFault,
    /// The channels, where it is not all of them.
    pub channels: Vec<usize>,
    /// The evidence and the remedy in words.
    pub text: String,
}

/// Faults of the whole set-up and questions.
pub(super) fn judge(setup: &Setup, found: &Found, units_in_recordings: bool) -> Vec<Whole> {
    let mut all: Vec<Whole> = Vec::new();
    let mut say = |fault, text| {
        all.push(Whole {
            fault,
            channels: Vec::new(),
            text,
        })
    };
    let reference = Vector3::from(setup.reference_point);
    let nearest = found
        .sensors
        .iter()
        .map(|s| (s.position - reference).norm())
        .fold(f64::INFINITY, f64::min);
    let farthest = found
        .sensors
        .iter()
        .map(|s| (s.position - found.sensors[0].position).norm())
        .fold(0.0, f64::max);
    if farthest > 0.0 && nearest > FAR * farthest {
        say(
            WholeFault::ReferencePoint,
            format!(
                "`reference_point` is {} m away from the nearest sensor, {} times the distance between the sensors: it is probably in millimetres",
                plain(nearest, 3),
                plain(nearest / farthest, 2)
            ),
        );
    }
    let (middle, spread) = (middle(&found.sensors), spread(&found.sensors));
    let far = |i: &usize| (found.sensors[*i].position - middle).norm() > OUTLYING * spread;
    let channels: Vec<usize> = (0..found.sensors.len()).filter(far).collect();
    let away: Vec<String> = channels
        .iter()
        .map(|&i| format!("`{}`", found.sensors[i].channel))
        .collect();
    if !away.is_empty() {
        say(
            WholeFault::Outlying,
            format!(
                "the position of {} is more than {OUTLYING} times as far from the middle of the sensors as most of them are: it is probably in millimetres",
                away.join(", ")
            ),
        );
    }
    if let Some(outlying) = all.last_mut().filter(|w| w.fault == WholeFault::Outlying) {
        outlying.channels = channels;
    }
    let mut say = |fault, text| {
        all.push(Whole {
            fault,
            channels: Vec::new(),
            text,
        })
    };
    let Some(body) = found.after.body else {
        return all;
    };
    // Where the data do not tell which load cell is wrong, they do not tell the mass.
    let cell = |c: &usize| found.sensors[*c].kind.is_cell();
    let vague =
        |named: &Vec<Candidate>| named.len() > 1 && named[0].fault.channels().iter().any(cell);
    if found.named.iter().any(vague) {
        return all;
    }
    // Sensors that contradict each other leave no mass to judge by.
    if found.after.ratio() > CONTRADICTS {
        return all;
    }
    let mass = body[0];
    if mass < 0.0 {
        // One sign for all of them leaves no contradiction: what does is the fault of some.
        if found.before.ratio() > CONTRADICTS {
            return all;
        }
        say(
            WholeFault::Reversed,
            format!(
                "all load cells, or all accelerometers, have the other sign: the mass is {} kg. Turn the `direction` of all load cells if they measure the force that the structure exerts on the table",
                plain(mass, 4)
            ),
        );
        return all;
    }
    if let Some(known) = setup.known_mass {
        let ratio = mass / known;
        let factor = FACTORS.iter().find(|f| (ratio / **f - 1.0).abs() < NEAR);
        if let Some(factor) = factor {
            let (fault, unit) = if (factor - 9.806_65).abs() < 0.1 {
                let unit = format!("the accelerometers are in g: {}", in_g(setup));
                (WholeFault::InG, unit)
            } else {
                let unit = "a unit of all load cells or of all accelerometers is wrong";
                (WholeFault::Unit, unit.to_owned())
            };
            say(
                fault,
                format!(
                    "the mass is {} times the weighed one: {unit}",
                    plain(ratio, 4)
                ),
            );
        }
    }
    let Some(volume) = volume(&found.sensors) else {
        return all;
    };
    let density = mass / volume;
    if density < LIGHTEST {
        say(
            WholeFault::Millimetres,
            format!(
                "positions are in millimetres: {} kg in the cube that the sensors span are {} kg/m³. Write `length_unit = \"mm\"` at the top of the setup",
                plain(mass, 4),
                plain(density, 2)
            ),
        );
    } else if setup.known_mass.is_none() && density > DENSE {
        say(
            WholeFault::PerhapsInG,
            format!(
                "are the accelerometers in g? {} kg in the cube that the sensors span are {} kg/m³. If so, {}; `known_mass` would decide it",
                plain(mass, 4),
                plain(density, 2),
                in_g(setup)
            ),
        );
    } else if setup.known_mass.is_none()
        && !units_in_recordings
        && setup.accelerometers.iter().all(states_nothing)
    {
        say(
            WholeFault::NoUnit,
            format!(
                "no unit of the accelerations is stated, so that they are taken to be in m/s² and the mass is {} kg; if they are in g it is {} kg, and {}",
                plain(mass, 4),
                plain(mass / 9.806_65, 4),
                in_g(setup)
            ),
        );
    }
    all
}

/// `true` if the set-up does not say what unit the readings of a sensor are in.
fn states_nothing(a: &AccelerometerEntry) -> bool {
    a.units == Units::default() && (a.scale.abs() - 1.0).abs() < NEAR
}

/// The remedy where all accelerations are in g.
fn in_g(setup: &Setup) -> String {
    let g = |a: &AccelerometerEntry| {
        let total = a.scale * 9.806_65;
        a.units.plainest(Measured::Acceleration, total) == Some("g")
    };
    if setup.accelerometers.iter().all(g) {
        "write `unit = \"g\"` into every [[accelerometer]]".to_owned()
    } else {
        "multiply the `scale` of every [[accelerometer]] by 9.80665".to_owned()
    }
}

/// Volume of the cube whose half side is the sensors' median distance from their middle, m³: a single
/// position that is wrong does not change it.
fn volume(sensors: &[Sensor]) -> Option<f64> {
    let volume = 8.0 * spread(sensors).powi(3);
    (volume > 0.0 && volume.is_finite()).then_some(volume)
}

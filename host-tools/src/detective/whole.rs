//! Step 5: faults that all sensors share. They contradict nothing, so that only a body that cannot
//! be and its density speak against them.

use nalgebra::Vector3;

use super::evidence::{Evidence, OUTLYING, middle, sensors, spread};
use super::model::Mass;
use super::search::{CONTRADICTS, Candidate, Found};
use super::sensor::Sensor;
use super::wording;
use crate::format::plain;
use crate::setup::{AccelerometerEntry, Measured, STANDARD_GRAVITY, Setup, Units};

/// Density over the cube that the sensors span, kg/m³, below which positions are not in metres.
const LIGHTEST: f64 = 0.01;
/// Density above which the unit of the accelerations is asked for: few structures are as dense as
/// water over such a cube.
const DENSE: f64 = 1000.0;
/// Density above which positions are too small, kg/m³: osmium, weighed in accelerations that are in g.
const HEAVIEST: f64 = 22_590.0 * STANDARD_GRAVITY;
/// Density below which no body is as light, kg/m³: the densest, weighed in accelerations that are in g and with positions in mm.
const LIGHTER_THAN_ANY: f64 = HEAVIEST * 1e-9;
/// Density above which no interface is as small under a body, kg/m³: load cells and accelerometers 5 cm apart under a tonne
/// make a tenth of that, and a body of 1 kg/m³ whose positions are in km makes ten times that.
const DENSER_THAN_ANY: f64 = 1e8;
/// Distance of the reference point from the sensors over the largest between these, above which
/// the point is taken for a mistake.
const FAR: f64 = 10.0;
/// Share of 1 up to which a scale states no unit.
const NEAR: f64 = 0.03;
/// Standard deviation of a mass, as a share of it, above which it says nothing of density.
const UNTOLD: f64 = 0.3;

/// Kind of a fault that many sensors share, or of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WholeFault {
    /// The reference point lies far away.
    ReferencePoint,
    /// Single positions lie far away.
    Outlying,
    /// All positions are in millimetres.
    Millimetres,
    /// All positions are too small.
    TooSmall,
    /// The question if all accelerations are in g, since the body would be dense.
    PerhapsInG,
    /// The same question where nothing states a unit.
    NoUnit,
    /// The weighed mass contradicts sensors that agree without it.
    Weighed,
    /// One run contradicts all others, which agree without it.
    RunApart,
}

impl WholeFault {
    /// The kind as one word of the documents.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ReferencePoint => "reference-point",
            Self::Outlying => "outlying",
            Self::Millimetres => "all-in-mm",
            Self::TooSmall => "all-too-small",
            Self::PerhapsInG => "perhaps-all-in-g",
            Self::NoUnit => "no-unit",
            Self::Weighed => "weighed",
            Self::RunApart => "run-apart",
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
    /// Lines of the set-up that mend it; empty where none do.
    pub repair: Vec<String>,
    /// `true` if no body can be as the set-up says, so that its numbers must not be believed.
    pub impossible: bool,
}

impl Whole {
    pub(super) fn new(fault: WholeFault, text: String) -> Self {
        Self {
            fault,
            channels: Vec::new(),
            text,
            repair: Vec::new(),
            impossible: false,
        }
    }
}

/// Faults of the whole set-up and questions.
pub(super) fn judge(
    setup: &Setup,
    evidence: &Evidence,
    found: &Found,
    units_in_recordings: bool,
) -> Vec<Whole> {
    let mut all: Vec<Whole> = Vec::new();
    all.extend(reference(setup, &found.sensors));
    all.extend(outlying(&found.sensors));
    // Where the data do not tell which load cell is wrong, they do not tell the mass.
    let cell = |c: &usize| found.sensors[*c].kind.is_cell();
    let vague =
        |named: &Vec<Candidate>| named.len() > 1 && named[0].fault.channels().iter().any(cell);
    // Sensors that contradict each other leave no mass to judge by.
    if found.named.iter().any(vague) || found.after.ratio() > CONTRADICTS {
        return all;
    }
    let told = |mass: &Mass| mass.error < UNTOLD * mass.value;
    let Some(mass) = found.after.mass.filter(told).map(|m| m.value) else {
        return all;
    };
    let Some(volume) = volume(&found.sensors) else {
        return all;
    };
    let density = mass / volume;
    if density < LIGHTEST {
        all.push(Whole {
            repair: vec!["length_unit = \"mm\"".to_owned()],
            impossible: density < LIGHTER_THAN_ANY,
            ..Whole::new(
                WholeFault::Millimetres,
                format!(
                    "positions are in millimetres: {} kg in the cube that the sensors span are {} kg/m³. Write `length_unit = \"mm\"` at the top of the setup",
                    plain(mass, 4),
                    plain(density, 2)
                ),
            )
        });
    } else if density > HEAVIEST {
        all.push(Whole {
            impossible: density > DENSER_THAN_ANY,
            ..Whole::new(
                WholeFault::TooSmall,
                format!(
                    "positions are too small: {} kg in the cube that the sensors span are {} kg/m³, more than any matter has, also if the accelerometers were in g. Are they in m, and `length_unit` says another unit?",
                    plain(mass, 4),
                    plain(density, 2)
                ),
            )
        });
    } else if setup.known_mass.is_none() && density > DENSE {
        let lines = |c| wording::scaled(setup, evidence, c, STANDARD_GRAVITY);
        all.push(Whole {
            repair: (0..setup.accelerometers.len()).flat_map(lines).collect(),
            ..Whole::new(
                WholeFault::PerhapsInG,
                format!(
                    "are the accelerometers in g? {} kg in the cube that the sensors span are {} kg/m³. If so, {}; `known_mass` would decide it",
                    plain(mass, 4),
                    plain(density, 2),
                    in_g(setup)
                ),
            )
        });
    } else if setup.known_mass.is_none()
        && !units_in_recordings
        && setup.accelerometers.iter().all(states_nothing)
    {
        all.push(Whole::new(
            WholeFault::NoUnit,
            format!(
                "no unit of the accelerations is stated, so that they are taken to be in m/s² and the mass is {} kg; if they are in g, it is {} kg: then {}",
                plain(mass, 4),
                plain(mass / STANDARD_GRAVITY, 4),
                in_g(setup)
            ),
        ));
    }
    all
}

/// The weighed mass, where it alone contradicts the set-up: `alone` are the findings without it. With `explained`,
/// a change of the sensors mends it, too.
pub(super) fn weighed(setup: &Setup, alone: &Found, explained: bool) -> Option<Whole> {
    let (weighed, told) = (setup.known_mass?, alone.after.mass?.value);
    let both = format!(
        "it is {} kg, and the data say {} kg",
        plain(weighed, 5),
        plain(told, 4)
    );
    let text = if explained {
        format!(
            "or `known_mass` is wrong, without which nothing contradicts the setup: {both}; weigh again"
        )
    } else {
        format!(
            "nothing but `known_mass` contradicts the setup: {both}; weigh again, or leave it out"
        )
    };
    Some(Whole::new(WholeFault::Weighed, text))
}

/// `true` if the size, the density or the mass of a body that was identified says that a set-up has to be
/// examined, though nothing contradicts it.
pub(crate) fn is_doubtful(setup: &Setup, mass: Option<f64>) -> bool {
    let sensors = sensors(setup);
    let density = mass
        .zip(volume(&sensors))
        .map(|(mass, volume)| mass / volume);
    let strange = |density: f64| !(LIGHTEST..=DENSE).contains(&density);
    reference(setup, &sensors).is_some()
        || outlying(&sensors).is_some()
        || density.is_some_and(strange)
}

/// A reference point that lies far away from all sensors.
fn reference(setup: &Setup, sensors: &[Sensor]) -> Option<Whole> {
    let reference = Vector3::from(setup.reference_point);
    let distances = |from: Vector3<f64>| sensors.iter().map(move |s| (s.position - from).norm());
    let nearest = distances(reference).fold(f64::INFINITY, f64::min);
    let farthest = distances(sensors.first()?.position).fold(0.0, f64::max);
    if farthest <= 0.0 || nearest <= FAR * farthest {
        return None;
    }
    let metres = reference * 0.001;
    let near = distances(metres).fold(f64::INFINITY, f64::min) <= FAR * farthest;
    let line = format!("reference_point = {}", wording::metres(&metres));
    Some(Whole {
        repair: near.then_some(line).into_iter().collect(),
        ..Whole::new(
            WholeFault::ReferencePoint,
            format!(
                "`reference_point` is {} m away from the nearest sensor, {} times the distance between the sensors: it is probably in millimetres",
                plain(nearest, 3),
                plain(nearest / farthest, 2)
            ),
        )
    })
}

/// Single positions that lie far away.
fn outlying(sensors: &[Sensor]) -> Option<Whole> {
    let (middle, spread) = (middle(sensors), spread(sensors));
    let far = |i: &usize| (sensors[*i].position - middle).norm() > OUTLYING * spread;
    let channels: Vec<usize> = (0..sensors.len()).filter(far).collect();
    let name = |&i: &usize| format!("`{}`", sensors[i].channel);
    let away: Vec<String> = channels.iter().map(name).collect();
    (!away.is_empty()).then(|| Whole {
        channels,
        ..Whole::new(
            WholeFault::Outlying,
            format!(
                "the position of {} is more than {OUTLYING} times as far from the middle of the sensors as most of them are: it is probably in millimetres",
                away.join(", ")
            ),
        )
    })
}

/// `true` if the set-up does not say what unit the readings of a sensor are in.
fn states_nothing(a: &AccelerometerEntry) -> bool {
    a.units == Units::default() && (a.scale.abs() - 1.0).abs() < NEAR
}

/// The remedy where all accelerations are in g.
fn in_g(setup: &Setup) -> String {
    let g = |a: &AccelerometerEntry| {
        let total = a.scale * STANDARD_GRAVITY;
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

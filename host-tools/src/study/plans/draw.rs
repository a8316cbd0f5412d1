//! Random test plans.

use super::tell::Excited;
use crate::frame::shift;
use crate::setup::{AccelerometerEntry, LoadCellEntry, Mount, Quantity};
use crate::simulate::{
    Measurement, Model, MotionSensor, Plan, Shaking, Table, motion_row, motions,
};
use crate::study::chance::Chance;
use crate::study::structures::{Structure, elastic, load_cells, rigid, ring, triad};
use crate::study::trial::{Conditions, Trial};
use nalgebra::{DMatrix, Matrix6, Vector3, Vector6};

/// A plan before it is simulated.
pub(super) struct Drawn {
    pub(super) model: Model,
    pub(super) conditions: Conditions,
    /// Noise, a share of each channel's RMS.
    pub(super) noise: f64,
    /// Plan in words.
    pub(super) what: String,
    /// Combinations of the resultants at the interface's origin that its load cells measure.
    measured: Vec<usize>,
    size: f64,
}

/// Motion of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Family {
    /// One axis a run, all different.
    Axes,
    /// Translations only, along axes or in random directions.
    Translations,
    /// The same axis in every run.
    Uniaxial,
    /// x, z and the rotation about y.
    Plane,
    /// One rotation about a fixed point in every run.
    OneRotation,
    /// Random directions among all axes.
    Mixed,
    /// One axis, specimen mounted in several ways.
    Remounted,
    /// Several drives at once, none recorded.
    Together,
}

const FAMILIES: [Family; 8] = [
    Family::Axes,
    Family::Translations,
    Family::Uniaxial,
    Family::Plane,
    Family::OneRotation,
    Family::Mixed,
    Family::Remounted,
    Family::Together,
];

/// Accelerometers on the interface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sensors {
    /// Three or four triaxial ones on a ring.
    Ring,
    /// Three or four that look along z.
    Upright,
    /// One along x, two along z.
    Plane,
    /// One triaxial one at the origin.
    Single,
}

/// Load cells of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cells {
    /// Three or four triaxial ones on a ring.
    Ring,
    /// One of six components at the origin.
    Six,
    /// Three or four that look along z.
    Upright,
    /// Forces along x and z and the moment about y at the origin.
    Plane,
    /// One of three forces at the origin.
    Single,
}

/// Excitation and recording.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Driven,
    Undriven,
    Sine,
    Poses,
}

const RATE: f64 = 256.0;
const BLOCK: usize = 512;
const BAND: [f64; 2] = [2.0, 20.0];

/// The plan that the choices stand for.
pub(super) fn draw(chance: &mut Chance) -> Drawn {
    let flexible = chance.happens(0.5);
    let kind = match chance.whole(1, 10) {
        1..=5 => Kind::Driven,
        6..=7 => Kind::Undriven,
        8..=9 => Kind::Sine,
        _ => Kind::Poses,
    };
    let family = match kind {
        Kind::Undriven => FAMILIES[chance.whole(0, 7)],
        Kind::Poses => Family::Translations,
        _ => FAMILIES[chance.whole(0, 6)],
    };
    let sensors = match chance.whole(1, 10) {
        1..=7 => Sensors::Ring,
        8 => Sensors::Upright,
        9 => Sensors::Plane,
        _ => Sensors::Single,
    };
    // Poses turn gravity into every direction, as a re-mounted specimen turns the table's.
    let sensors = match (kind, family) {
        (Kind::Poses, _) if sensors != Sensors::Single => Sensors::Ring,
        (_, Family::OneRotation | Family::Together) => Sensors::Ring,
        _ => sensors,
    };
    let cells = match chance.whole(1, 10) {
        1..=4 => Cells::Ring,
        5..=6 => Cells::Six,
        7..=8 => Cells::Upright,
        9 => Cells::Plane,
        _ => Cells::Single,
    };
    let structure = if flexible && kind != Kind::Poses {
        let first = BAND[1] * chance.between(2.0, 3.0);
        elastic(chance, first)
    } else {
        rigid(chance)
    };
    let radius = structure.size * chance.between(0.3, 0.5);
    let level = chance.between(0.5, 3.0);
    let (runs, together, shaken) = runs(chance, kind, family, sensors, level, radius);
    let noise = chance.by_ratio(1e-4, 3e-2);
    let weighed = chance.happens(0.2);
    let modes = structure.specimen.modes.iter().map(|m| m.frequency);
    let mode_band = modes.reduce(f64::min).map(|f| [0.85 * f, 100.0]);
    let what = format!(
        "{kind:?}, {shaken} ({family:?}), sensors {sensors:?}, cells {cells:?}, {}, noise {:.2} %{}",
        if structure.specimen.modes.is_empty() {
            "rigid"
        } else {
            "elastic"
        },
        100.0 * noise,
        if weighed { ", weighed" } else { "" }
    )
    .to_lowercase();
    let full = matches!(cells, Cells::Ring | Cells::Six);
    let reference = if full && sensors == Sensors::Ring && chance.happens(0.5) {
        chance.direction() * structure.size * chance.between(0.0, 1.5)
    } else {
        Vector3::zeros()
    };
    let (load_cells, measured) = cell_entries(chance, cells, radius);
    Drawn {
        model: Model {
            title: "Random test plan".to_owned(),
            reference_point: reference.into(),
            accelerometers: accelerometers(chance, sensors, &structure, radius),
            load_cells,
            table: Table {
                lever_arm: radius,
                // The pivot of rotations; translations do not mind.
                reference_point: if sensors == Sensors::Ring && chance.happens(0.5) {
                    (chance.direction() * radius).into()
                } else {
                    [0.0; 3]
                },
                ..Table::default()
            },
            measurement: Measurement {
                sample_rate: RATE,
                duration: chance.between(16.0, 30.0),
                noise: 0.0,
                dc_offset: if kind == Kind::Poses { 0.02 } else { 0.0 },
                block_length: BLOCK,
                overlap: 0.5,
                averaging_band: BAND,
                mode_band,
                rigid_up_to: None,
            },
            runs,
            specimen: structure.specimen,
        },
        conditions: Conditions {
            unlike: 4.0,
            sines: if kind == Kind::Sine {
                (4..=200).map(|k| 0.5 * f64::from(k)).collect()
            } else {
                Vec::new()
            },
            weighed,
            together,
            moved: None,
        },
        noise,
        what,
        measured,
        size: structure.size,
    }
}

/// The axes that the table may move along without an accelerometer missing it.
fn allowed(sensors: Sensors) -> &'static [usize] {
    match sensors {
        Sensors::Ring => &[0, 1, 2, 3, 4, 5],
        Sensors::Upright => &[2, 3, 4],
        Sensors::Plane => &[0, 2, 4],
        Sensors::Single => &[0, 1, 2],
    }
}

/// Runs, which of them are shaken at once, and what they do in words.
fn runs(
    chance: &mut Chance,
    kind: Kind,
    family: Family,
    sensors: Sensors,
    level: f64,
    radius: f64,
) -> (Vec<Plan>, Vec<usize>, String) {
    let amplitude = |chance: &mut Chance, axis: usize| match axis {
        0..3 => level * chance.between(0.7, 1.4),
        _ => level / radius * chance.between(0.7, 1.4),
    };
    let mut axes: Vec<usize> = allowed(sensors).to_vec();
    match family {
        Family::Translations => axes.retain(|&axis| axis < 3),
        Family::Plane => axes.retain(|axis| [0, 2, 4].contains(axis)),
        Family::OneRotation => axes.retain(|&axis| axis >= 3),
        Family::Remounted => axes.retain(|&axis| axis == 2),
        _ => (),
    }
    shuffle(chance, &mut axes);
    if matches!(family, Family::Uniaxial | Family::OneRotation) {
        axes.truncate(1);
    }
    if kind == Kind::Poses {
        // Four tell all that translations can, and leave nothing that would tell their noise.
        let count = chance.whole(5, 24);
        // Turned about one axis only, gravity stays in a plane.
        let axis = chance.happens(0.3).then(|| chance.direction());
        let what = match axis {
            Some(_) => format!("{count} poses about one axis"),
            None => format!("{count} poses"),
        };
        let tilt = |chance: &mut Chance| {
            let axis = axis.unwrap_or_else(|| chance.direction());
            (axis * chance.between(20.0, 340.0)).into()
        };
        let tilts = (0..count).map(|_| tilt(chance)).collect();
        return (
            vec![Plan::new("poses", Shaking::Poses(tilts))],
            Vec::new(),
            what,
        );
    }
    let random = |motion| Shaking::random(motion, kind == Kind::Driven);
    let mut plans = Vec::new();
    let mut together = Vec::new();
    let most = match family {
        Family::Axes => axes.len(),
        Family::Remounted => 4,
        Family::Together => 2,
        _ => 6,
    };
    let count = chance.whole(1, most);
    let blends = match family {
        Family::Mixed => true,
        Family::Translations | Family::Plane => chance.happens(0.5),
        _ => false,
    };
    for number in 0..count {
        let mut motion = [0.0; 6];
        if family == Family::Together {
            for axis in axes.iter().take(chance.whole(1, axes.len())) {
                let mut motion = [0.0; 6];
                motion[*axis] = amplitude(chance, *axis);
                let name = format!("run {} drive {}", number + 1, axis + 1);
                plans.push(Plan::new(name, random(motion)));
                together.push(number);
            }
            continue;
        }
        if blends {
            for &axis in &axes {
                motion[axis] = amplitude(chance, axis) * chance.normal();
            }
        } else {
            let axis = axes[number % axes.len()];
            motion[axis] = amplitude(chance, axis);
        }
        let mut plan = Plan::new(format!("run {}", number + 1), random(motion));
        if family == Family::Remounted && number > 0 {
            plan.rotation = (chance.direction() * chance.between(40.0, 140.0)).into();
            plan.translation = (chance.direction() * radius).into();
        }
        plans.push(plan);
    }
    let what = format!("{count} runs");
    (plans, together, what)
}

fn shuffle(chance: &mut Chance, list: &mut [usize]) {
    for last in (1..list.len()).rev() {
        list.swap(last, chance.whole(0, last));
    }
}

fn accelerometers(
    chance: &mut Chance,
    sensors: Sensors,
    structure: &Structure,
    radius: f64,
) -> Vec<MotionSensor> {
    let [x, z] = [Vector3::x(), Vector3::z()];
    let entries: Vec<(Vector3<f64>, Vector3<f64>)> = match sensors {
        Sensors::Ring => {
            let count = chance.whole(3, 4);
            let mut entries = Vec::new();
            for position in ring(chance, count, radius) {
                entries.extend(triad(chance).map(|direction| (position, direction)));
            }
            entries
        }
        Sensors::Upright => {
            let count = chance.whole(3, 4);
            let places = ring(chance, count, radius);
            places.into_iter().map(|position| (position, z)).collect()
        }
        Sensors::Plane => vec![(Vector3::zeros(), x), (x * radius, z), (x * -radius, z)],
        Sensors::Single => {
            let axes = triad(chance);
            axes.map(|direction| (Vector3::zeros(), direction)).into()
        }
    };
    let sensors = entries.into_iter().enumerate();
    sensors
        .map(|(number, (position, direction))| MotionSensor {
            entry: AccelerometerEntry::new(
                format!("a{}", number + 1),
                position,
                direction,
                Mount::Interface,
            ),
            shape: vec![0.0; structure.specimen.modes.len()],
        })
        .collect()
}

/// Load cells, and which of the six resultants at the interface's origin they measure.
fn cell_entries(
    chance: &mut Chance,
    cells: Cells,
    radius: f64,
) -> (Vec<LoadCellEntry>, Vec<usize>) {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let origin = |axis: usize| {
        let quantity = if axis < 3 {
            Quantity::Force
        } else {
            Quantity::Moment
        };
        let channel = format!("f{}", axis + 1);
        LoadCellEntry::new(channel, Vector3::zeros(), axes[axis % 3], quantity)
    };
    let measured = match cells {
        Cells::Ring => return (load_cells(chance, radius), (0..6).collect()),
        Cells::Upright => {
            let count = chance.whole(3, 4);
            let mut places = ring(chance, count, radius);
            // At one height, so that unmeasured lateral forces turn nothing about it.
            places.iter_mut().for_each(|p| p.z = 0.0);
            let places = places.into_iter().enumerate();
            let cells = places.map(|(n, position)| {
                let channel = format!("f{}", n + 1);
                LoadCellEntry::new(channel, position, axes[2], Quantity::Force)
            });
            return (cells.collect(), vec![2, 3, 4]);
        }
        Cells::Six => vec![0, 1, 2, 3, 4, 5],
        Cells::Plane => vec![0, 2, 4],
        Cells::Single => vec![0, 1, 2],
    };
    (
        measured.iter().map(|&axis| origin(axis)).collect(),
        measured,
    )
}

/// Excited directions and measured resultants of a simulated plan's runs, about its reference
/// point.
pub(super) fn excited(drawn: &Drawn, trial: &Trial, seed: u64) -> Vec<Excited> {
    let model = trial.model();
    let to_reference = shift(&Vector3::from(model.reference_point));
    let noise = trial.noise(drawn.noise);
    let sensors = model.accelerometers.len();
    let row = |position: [f64; 3], direction: [f64; 3]| {
        motion_row(&Vector3::from(position), &Vector3::from(direction))
    };
    let motion = DMatrix::from_fn(sensors, 6, |i, j| {
        let entry = &model.accelerometers[i].entry;
        row(entry.position, entry.direction)[j]
    });
    let forces = DMatrix::from_fn(model.load_cells.len(), 6, |i, j| {
        let cell = &model.load_cells[i];
        match cell.quantity {
            Quantity::Force => row(cell.position, cell.direction)[j],
            Quantity::Moment if j >= 3 => cell.direction[j - 3],
            Quantity::Moment => 0.0,
        }
    });
    // Accelerations by least squares, resultants by summation: (4) and (5).
    let Ok(inverse) = motion.pseudo_inverse(1e-9) else {
        return Vec::new();
    };
    let spread = |map: &DMatrix<f64>, noise: &[f64]| {
        Matrix6::from_fn(|i, j| {
            let terms = noise.iter().enumerate();
            terms.map(|(k, s)| map[(i, k)] * map[(j, k)] * s * s).sum()
        })
    };
    let acceleration_noise = spread(&inverse, &noise[..sensors]);
    let force_noise = spread(&forces.transpose(), &noise[sensors..]);
    let m = &model.measurement;
    let samples = libm::round(m.duration * m.sample_rate);
    let blocks = (2.0 * samples / BLOCK as f64 - 2.0).max(1.0);
    let lines = (BAND[1] - BAND[0]) * BLOCK as f64 / RATE;
    let mut runs: Vec<(usize, Excited)> = Vec::new();
    for number in 0..model.runs.len() {
        let Some((carry, mut accelerations)) = motions(model, number, seed) else {
            continue;
        };
        let carry = to_reference * carry;
        let poses = matches!(model.runs[number].excitation, Shaking::Poses(_));
        let (readings, gain) = if poses {
            // Offsets take the mean away.
            let count = accelerations.len() as f64;
            let mean: Vector6<f64> = accelerations.iter().sum::<Vector6<f64>>() / count;
            accelerations.iter_mut().for_each(|a| *a -= mean);
            (1.0, 1.0 / count)
        } else if !drawn.conditions.sines.is_empty() {
            (lines, 1.0)
        } else if model_is_driven(model, number) {
            (0.5 * blocks * lines, blocks)
        } else {
            (0.5 * blocks * lines, 1.0)
        };
        let group = drawn.conditions.together.get(number).copied();
        let group = group.unwrap_or(number);
        let accelerations: Vec<Vector6<f64>> = accelerations.iter().map(|a| carry * a).collect();
        if let Some((_, run)) = runs.iter_mut().find(|(n, _)| *n == group) {
            run.accelerations.extend(accelerations);
            continue;
        }
        let unit = |axis: usize| Vector6::from_fn(|i, _| f64::from(u8::from(i == axis)));
        let resultants = carry.transpose().try_inverse().unwrap_or_default();
        runs.push((
            group,
            Excited {
                accelerations,
                // w · f at the interface's origin is (T w) · f at A, where f_I = Tᵀ f_A.
                equations: drawn.measured.iter().map(|&a| carry * unit(a)).collect(),
                acceleration_noise: carry * acceleration_noise * carry.transpose(),
                force_noise: resultants * force_noise * resultants.transpose(),
                readings,
                gain,
            },
        ));
    }
    runs.into_iter().map(|(_, run)| run).collect()
}

fn model_is_driven(model: &Model, run: usize) -> bool {
    let driven = |plan: &Plan| matches!(plan.excitation, Shaking::Random { drive: true, .. });
    model.runs.get(run).is_some_and(driven)
}

impl Drawn {
    /// Edge of a cube of the body's mass and density, m.
    pub(super) fn size(&self) -> f64 {
        self.size
    }
}

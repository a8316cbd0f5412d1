//! Random structures on random interfaces: what a test may have on its table.

use super::chance::Chance;
use crate::frame::shift;
use crate::setup::{AccelerometerEntry, LoadCellEntry, Mount, Quantity};
use crate::simulate::{Mode, MotionSensor, Specimen};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// A structure and how large it is.
pub(super) struct Structure {
    /// As the simulator takes it.
    pub(super) specimen: Specimen,
    /// Edge of a cube of the same mass and density, m.
    pub(super) size: f64,
    /// kg.
    pub(super) mass: f64,
}

/// A structure of 5 to 500 kg and 100 to 1000 kg/m³ without modes. Its centre of gravity lies
/// off the axis and above the interface; its inertia is that of a random ellipsoid of mass,
/// turned at random, and so is always a body's.
pub(super) fn rigid(chance: &mut Chance) -> Structure {
    let mass = chance.by_ratio(5.0, 500.0);
    let size = libm::cbrt(mass / chance.by_ratio(100.0, 1000.0));
    let centre = Vector3::new(
        size * chance.between(-0.15, 0.15),
        size * chance.between(-0.15, 0.15),
        size * chance.between(0.2, 0.7),
    );
    // Second moments ∫x² dm along the ellipsoid's axes; a cube has m size²/12.
    let second = Vector3::from_fn(|_, _| mass * size * size * chance.between(0.03, 0.12));
    let turn = chance.turn();
    let moments = turn * Matrix3::from_diagonal(&second) * turn.transpose();
    let inertia = Matrix3::identity() * moments.trace() - moments;
    let mut own = Matrix6::zeros();
    own.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(Matrix3::identity() * mass));
    own.fixed_view_mut::<3, 3>(3, 3).copy_from(&inertia);
    let carry = shift(&centre);
    let matrix = carry.tr_mul(&(own * carry));
    Structure {
        specimen: Specimen {
            mass_matrix: (matrix + matrix.transpose()) * 0.5,
            modes: Vec::new(),
            plane: false,
        },
        size,
        mass,
    }
}

/// The same with three to five fixed-base modes, the first at `first` Hz and each next one 1.05
/// to 1.4 times higher. With the mass matrix M = C Cᵀ, the participations are L = √s C u with
/// random unit vectors u and shares s that add up to at most 0.7: ΣLᵀL then never exceeds M,
/// as in every structure.
pub(super) fn elastic(chance: &mut Chance, first: f64) -> Structure {
    let mut structure = rigid(chance);
    let count = chance.whole(3, 5);
    add_modes(chance, &mut structure, first, (count, [1.05, 1.4]));
    structure
}

/// Adds so many modes to a structure, each next one higher by a ratio within `apart`.
pub(super) fn add_modes(
    chance: &mut Chance,
    structure: &mut Structure,
    first: f64,
    (count, apart): (usize, [f64; 2]),
) {
    let Some(root) = structure.specimen.mass_matrix.cholesky() else {
        return;
    };
    let total = chance.between(0.3, 0.7);
    let parts: Vec<f64> = (0..count).map(|_| chance.between(0.2, 1.0)).collect();
    let sum: f64 = parts.iter().sum();
    let mut frequency = first;
    for (number, part) in parts.into_iter().enumerate() {
        let direction = Vector6::from_fn(|_, _| chance.normal()).normalize();
        structure.specimen.modes.push(Mode {
            name: format!("mode {}", number + 1),
            frequency,
            damping: chance.between(0.005, 0.02),
            exponent: 1.0,
            participation: root.l() * direction * libm::sqrt(total * part / sum),
        });
        frequency *= chance.between(apart[0], apart[1]);
    }
}

/// Readings of the modes by a sensor on the structure: one random gain each, as large as where a
/// mode with 30 % of the mass moves.
pub(super) fn shapes(chance: &mut Chance, structure: &Structure) -> Vec<f64> {
    let gain = 1.0 / libm::sqrt(0.3 * structure.mass);
    let modes = structure.specimen.modes.iter();
    modes.map(|_| chance.normal() * gain).collect()
}

/// Points around a ring of about `radius` (m) at height zero: evenly, but for a fifth of a
/// radian, a fifth of the radius and a tenth of it in height.
pub(super) fn ring(chance: &mut Chance, count: usize, radius: f64) -> Vec<Vector3<f64>> {
    let start = chance.between(0.0, 2.0 * std::f64::consts::PI);
    let step = 2.0 * std::f64::consts::PI / count as f64;
    (0..count)
        .map(|k| {
            let angle = start + step * k as f64 + chance.between(-0.2, 0.2);
            let reach = radius * chance.between(0.8, 1.2);
            let (sin, cos) = libm::sincos(angle);
            let height = radius * chance.between(-0.1, 0.1);
            Vector3::new(reach * cos, reach * sin, height)
        })
        .collect()
}

/// Three axes at right angles, turned about the vertical.
pub(super) fn triad(chance: &mut Chance) -> [Vector3<f64>; 3] {
    let (sin, cos) = libm::sincos(chance.between(0.0, 2.0 * std::f64::consts::PI));
    [
        Vector3::new(cos, sin, 0.0),
        Vector3::new(-sin, cos, 0.0),
        Vector3::z(),
    ]
}

/// Three or four triaxial accelerometers on the interface, and two to four single ones on the
/// structure.
pub(super) fn motion_sensors(
    chance: &mut Chance,
    structure: &Structure,
    radius: f64,
) -> Vec<MotionSensor> {
    let mut sensors = Vec::new();
    let count = chance.whole(3, 4);
    for (number, position) in ring(chance, count, radius).into_iter().enumerate() {
        for (axis, direction) in ["x", "y", "z"].iter().zip(triad(chance)) {
            sensors.push(MotionSensor {
                entry: AccelerometerEntry::new(
                    format!("base{}.{axis}", number + 1),
                    position,
                    direction,
                    Mount::Interface,
                ),
                shape: vec![0.0; structure.specimen.modes.len()],
            });
        }
    }
    for number in 0..chance.whole(2, 4) {
        let half = 0.5 * structure.size;
        let position = Vector3::new(
            chance.between(-half, half),
            chance.between(-half, half),
            chance.between(0.0, structure.size),
        );
        sensors.push(MotionSensor {
            entry: AccelerometerEntry::new(
                format!("top{}", number + 1),
                position,
                chance.direction(),
                Mount::Structure,
            ),
            shape: shapes(chance, structure),
        });
    }
    sensors
}

/// Three or four triaxial load cells between table and structure.
pub(super) fn load_cells(chance: &mut Chance, radius: f64) -> Vec<LoadCellEntry> {
    let count = chance.whole(3, 4);
    let mut cells = Vec::new();
    for (number, position) in ring(chance, count, radius).into_iter().enumerate() {
        for (axis, direction) in ["x", "y", "z"].iter().zip(triad(chance)) {
            let channel = format!("cell{}.{axis}", number + 1);
            cells.push(LoadCellEntry::new(
                channel,
                position,
                direction,
                Quantity::Force,
            ));
        }
    }
    cells
}

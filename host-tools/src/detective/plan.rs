//! Faults that a test cannot show, from the set-up alone: before anything is recorded.
//!
//! # Design
//!
//! Readings are those of a rigid body on a rigid table without noise: the body is as heavy as it was
//! weighed, or any other, sits in the middle of the sensors on the structure, and is about as large as
//! they span. Its load is shared by the load cells as by springs of unlike stiffness. Then each fault is put
//! into the set-up, and those are said that contradict nothing.

use nalgebra::{Complex, DMatrix, Matrix3, Matrix6, Vector3, Vector6};

use super::evidence::{self, Evidence, Mounted, middle, spread};
use super::sensor::{Kind, Sensor};
use super::table::Line;
use super::untold::Untold;
use super::{Undecided, wording};
use crate::setup::{Excitation, Setup};
use massline_core::geometry::Placement;

/// Axis along or about which the table is shaken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Axis {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// About x.
    Rx,
    /// About y.
    Ry,
    /// About z.
    Rz,
}

/// Mass of a body that was not weighed, kg: the answer does not depend on it.
const MASS: f64 = 100.0;

/// Equations of a channel: so many that noise is none.
const EQUATIONS: usize = 1000;

/// Faults that runs along and about these axes would not show, in words: nothing in the recordings will
/// contradict them. Static poses turn the table about all axes.
///
/// # Errors
/// [`Undecided`] without accelerometers on the interface, load cells that measure nothing, or runs.
pub fn foresee(setup: &Setup, axes: &[Axis]) -> Result<Vec<String>, Undecided> {
    let sensors = evidence::sensors(setup);
    if !sensors.iter().any(|s| s.kind == Kind::Interface) {
        return Err(Undecided::NoInterface);
    }
    let mut ways: Vec<([f64; 3], [f64; 3], bool)> = Vec::new();
    for run in &setup.runs {
        let still = run.excitation == Excitation::Static;
        let way = (run.rotation, run.translation, still);
        if !ways.contains(&way) {
            ways.push(way);
        }
    }
    let mut mountings = Vec::new();
    for (rotation, translation, still) in ways {
        let translation = Vector3::from(translation);
        let rotation = Placement::new(Vector3::from(rotation), translation)
            .map_err(|_| Undecided::Placement)?
            .rotation();
        let axes = match still {
            true => &[Axis::X, Axis::Y, Axis::Z],
            false => axes,
        };
        let readings =
            readings(setup, &sensors, (rotation, translation), axes).ok_or(Undecided::NoMotion)?;
        let products = &readings * readings.transpose();
        mountings.push(Mounted {
            lines: vec![Line {
                frequency: if still { 0.0 } else { 1.0 },
                products: products.map(|x| Complex::new(x, 0.0)),
            }],
            equations: EQUATIONS,
            quiet: Vec::new(),
            rotation,
            translation,
        });
    }
    if mountings.is_empty() {
        return Err(Undecided::NoRun);
    }
    let evidence = Evidence::of_mountings(sensors, mountings, setup.known_mass);
    let (state, bench) = evidence
        .state(&evidence.sensors, &[])
        .ok_or(Undecided::NoMotion)?;
    let mut untold = Untold::of(&bench, &state, 1.0).ok_or(Undecided::NoMotion)?;
    // Channels that read nothing at all.
    for channel in (0..state.sensors.len()).filter(|&i| !state.is_live(i)) {
        untold.signs.push(channel);
        untold.gains.push(channel);
    }
    untold.signs.sort_unstable();
    untold.gains.sort_unstable();
    Ok(wording::untold(setup, &untold))
}

/// Readings of all channels, a column for each axis, in one mounting.
fn readings(
    setup: &Setup,
    sensors: &[Sensor],
    (rotation, translation): (Matrix3<f64>, Vector3<f64>),
    axes: &[Axis],
) -> Option<DMatrix<f64>> {
    let length = spread(sensors);
    // In the specimen's frame.
    let on = |kind: fn(Kind) -> bool| -> Vec<Sensor> {
        sensors.iter().filter(|s| kind(s.kind)).cloned().collect()
    };
    let structure = on(|kind| kind == Kind::Structure);
    let centre = match structure.is_empty() {
        // Half a length above the table.
        true => {
            rotation.transpose() * (middle(sensors) + Vector3::z() * (0.5 * length) - translation)
        }
        false => middle(&structure),
    };
    let centre = rotation * centre + translation;
    let mass = setup.known_mass.unwrap_or(MASS);
    // About the axes of the specimen, with unlike moments: no symmetry hides a fault.
    let moments = Vector3::new(0.8, 1.0, 1.3) * (mass * 0.25 * length * length);
    let about_centre = rotation * Matrix3::from_diagonal(&moments) * rotation.transpose();
    let cross = centre.cross_matrix();
    let mut body = Matrix6::<f64>::zeros();
    (0..3).for_each(|i| body[(i, i)] = mass);
    body.fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&(-cross * mass));
    body.fixed_view_mut::<3, 3>(3, 0).copy_from(&(cross * mass));
    body.fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&(about_centre - cross * cross * mass));
    // Moments of the load cells count like forces at the length.
    let cells: Vec<usize> = (0..sensors.len())
        .filter(|&i| sensors[i].kind.is_cell())
        .collect();
    let mut shares = DMatrix::zeros(cells.len(), 6);
    if !cells.is_empty() {
        let x = DMatrix::from_fn(6, cells.len(), |i, k| {
            sensors[cells[k]].rigid()[i] / if i < 3 { 1.0 } else { length }
        });
        // A third around the mean, no two alike, by the golden ratio.
        let stiffness = DMatrix::from_fn(cells.len(), cells.len(), |i, k| match i == k {
            true => 0.67 + 0.66 * (i as f64 * 0.618_034).fract(),
            false => 0.0,
        });
        let springs = &stiffness * x.transpose();
        shares = &springs * (x * &springs).pseudo_inverse(1e-9).ok()?;
    }
    let mut all = DMatrix::zeros(sensors.len(), axes.len());
    for (column, axis) in axes.iter().enumerate() {
        let mut motion = Vector6::<f64>::zeros();
        motion[*axis as usize] = if (*axis as usize) < 3 {
            1.0
        } else {
            1.0 / length
        };
        let mut load = body * motion;
        load.fixed_rows_mut::<3>(3).scale_mut(1.0 / length);
        let loads = &shares * DMatrix::from_column_slice(6, 1, load.as_slice());
        for (i, sensor) in sensors.iter().enumerate() {
            all[(i, column)] = match sensor.kind {
                Kind::Cell(_) => loads[cells.iter().position(|&c| c == i)?],
                Kind::Interface => sensor.rigid().dot(&motion),
                Kind::Structure => {
                    let mut turned = sensor.clone();
                    turned.position = rotation * sensor.position + translation;
                    turned.direction = rotation * sensor.direction;
                    turned.rigid().dot(&motion)
                }
            };
        }
    }
    Some(all)
}

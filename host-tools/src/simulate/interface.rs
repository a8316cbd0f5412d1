//! The table: how a specimen stands on it, how it moves, and how load cells share forces.

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};

use super::model::Table;
use super::random::Stream;
use super::specimen::{motion_row, stack};
use crate::frame::shift;
use crate::setup::{LoadCellEntry, Quantity};

/// The rotation by the vector's length in degrees about its direction (Rodrigues).
pub(super) fn rotation_matrix(degrees: &[f64; 3]) -> Matrix3<f64> {
    let vector = Vector3::from(*degrees) * (std::f64::consts::PI / 180.0);
    let angle = vector.norm();
    if angle == 0.0 {
        return Matrix3::identity();
    }
    let axis = vector / angle;
    let cross = axis.cross_matrix();
    let (sin, cos) = libm::sincos(angle);
    Matrix3::identity() + cross * sin + cross * cross * (1.0 - cos)
}

/// The transform from the motion of the interface's origin, interface axes, to the motion
/// of the specimen's origin, specimen axes, where x_interface = R x_specimen + t (m). Its
/// transpose carries resultants of the specimen into the interface frame.
pub(crate) fn mounting(rotation: &[f64; 3], translation: &[f64; 3]) -> Matrix6<f64> {
    let to_specimen = rotation_matrix(rotation).transpose();
    let mut turn = Matrix6::zeros();
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(&to_specimen);
    turn.fixed_view_mut::<3, 3>(3, 3).copy_from(&to_specimen);
    turn * shift(&Vector3::from(*translation))
}

/// Acceleration of the interface's origin per unit of drive signal:
/// `steady + resonant · ρ(ω)` with ρ of [`super::synthesis::table_resonance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TableMotion {
    pub(super) steady: Vector6<f64>,
    pub(super) resonant: Vector6<f64>,
}

/// True motion of the table when a run asks for `motion` (m/s² and rad/s²).
///
/// Cross-talk couples the axes by two constant random matrices with entries up to the
/// given level and an empty diagonal: one acts at all frequencies, the other grows towards
/// the table's resonance. An angular acceleration counts as the linear one at the end of
/// the lever arm. The matrices belong to the table and are the same in all runs.
pub(super) fn table_motion(table: &Table, motion: &[f64; 6], seed: u64) -> TableMotion {
    let mut stream = Stream::new(seed, &["cross-talk"]);
    // Drawn in full whatever the axes, so that freeing an axis leaves the others alone.
    let mut draw = || Matrix6::from_fn(|_, _| stream.signed() * table.cross_talk);
    let mut couplings = [draw(), draw()];
    if table.resonance.is_none() {
        couplings[1].fill(0.0);
    }
    let arm = table.lever_arm;
    let scale = Vector6::new(1.0, 1.0, 1.0, 1.0 / arm, 1.0 / arm, 1.0 / arm);
    for coupling in &mut couplings {
        for row in 0..6 {
            for column in 0..6 {
                if row == column || !table.axes[row] {
                    coupling[(row, column)] = 0.0;
                } else {
                    coupling[(row, column)] *= scale[row] / scale[column];
                }
            }
        }
    }
    let asked = Vector6::from(*motion);
    // The motion is given at the table's reference point P; the origin is at -P from it.
    let to_origin = shift(&-Vector3::from(table.reference_point));
    TableMotion {
        steady: to_origin * (asked + couplings[0] * asked),
        resonant: to_origin * (couplings[1] * asked),
    }
}

/// One row per load cell: its readings of the six resultants at the interface's origin.
///
/// The cells share a resultant about their centre in the way of least norm, and lock in internal
/// forces on top: random combinations that have no resultant, proportional to the load, `internal`
/// times as large as the shared forces. A force that no cell measures passes through their centre,
/// as where resultants are taken from the cells (equation (5)).
pub(super) fn load_paths(cells: &[LoadCellEntry], internal: f64, seed: u64) -> DMatrix<f64> {
    let centre = centre(cells);
    let geometry = geometry(cells, &centre);
    let about_centre = least_norm(&geometry);
    let to_centre = shift(&-centre).transpose();
    let shared = &about_centre * DMatrix::from_fn(6, 6, |i, j| to_centre[(i, j)]);

    let mut stream = Stream::new(seed, &["internal forces"]);
    let random = DMatrix::from_fn(cells.len(), 6, |_, _| stream.normal().re);
    // What is left after its resultants are taken out produces none.
    let locked = &random - &about_centre * geometry.tr_mul(&random);
    let mut paths = shared.clone();
    for axis in 0..6 {
        let size = locked.column(axis).norm();
        // With six cells or fewer nothing is statically indeterminate; what is left is
        // rounding and must not be blown up.
        if size > 1e-9 * random.column(axis).norm() {
            let level = internal * shared.column(axis).norm() / size;
            let added = locked.column(axis) * level;
            let mut column = paths.column_mut(axis);
            column += added;
        }
    }
    paths
}

/// Mean position of the cells, m.
fn centre(cells: &[LoadCellEntry]) -> Vector3<f64> {
    let sum: Vector3<f64> = cells.iter().map(|cell| Vector3::from(cell.position)).sum();
    sum / (cells.len() as f64).max(1.0)
}

/// X_f of eq (5) about `centre`, q x 6.
fn geometry(cells: &[LoadCellEntry], centre: &Vector3<f64>) -> DMatrix<f64> {
    let rows: Vec<_> = cells
        .iter()
        .map(|cell| {
            let direction = Vector3::from(cell.direction);
            match cell.quantity {
                Quantity::Force => motion_row(&(Vector3::from(cell.position) - centre), &direction),
                Quantity::Moment => stack(&Vector3::zeros(), &direction),
            }
        })
        .collect();
    DMatrix::from_fn(cells.len(), 6, |cell, axis| rows[cell][axis])
}

/// The Moore-Penrose inverse of X_fᵀ, that is X_f (X_fᵀ X_f)⁺, q x 6.
fn least_norm(geometry: &DMatrix<f64>) -> DMatrix<f64> {
    // The eigenvalues are squares: a load that moves the cells a million times less than
    // the best one is not measured. Rounding reaches a few ε of the largest.
    const RANK: f64 = 1e-12;
    let normal = geometry.tr_mul(geometry);
    let eigen = normal.symmetric_eigen();
    let limit = eigen.eigenvalues.amax() * RANK;
    let mut inverse = DMatrix::zeros(6, 6);
    for (index, value) in eigen.eigenvalues.iter().enumerate() {
        if *value > limit {
            let vector = eigen.eigenvectors.column(index);
            inverse += vector * vector.transpose() / *value;
        }
    }
    geometry * inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::keys::unit;

    fn cells() -> Vec<LoadCellEntry> {
        let mut cells = Vec::new();
        for position in [
            [0.5, 0.4, 0.0],
            [-0.5, 0.4, 0.1],
            [-0.5, -0.4, 0.0],
            [0.5, -0.4, 0.0],
        ] {
            for direction in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.0, 1.0]] {
                let direction = unit(direction).unwrap();
                let cell = LoadCellEntry::new(String::new(), position, direction, Quantity::Force);
                cells.push(cell);
            }
        }
        cells
    }

    #[test]
    fn cells_carry_the_resultants_whatever_they_lock_in() {
        let cells = cells();
        for internal in [0.0, 0.5] {
            let paths = load_paths(&cells, internal, 1);
            let carried = geometry(&cells, &Vector3::zeros()).tr_mul(&paths);
            // Condition of X_fᵀ X_f is about 10, twelve terms a sum: below 100 ε.
            assert!((carried - DMatrix::identity(6, 6)).amax() < 100.0 * f64::EPSILON);
        }
        let (plain, locked) = (load_paths(&cells, 0.0, 1), load_paths(&cells, 0.5, 1));
        for axis in 0..6 {
            let added = (locked.column(axis) - plain.column(axis)).norm();
            let ratio = added / plain.column(axis).norm();
            assert!((ratio - 0.5).abs() < 1e-12, "{ratio}");
        }
    }

    #[test]
    fn unmeasured_resultants_are_left_out() {
        // Three vertical cells: fz, tx and ty only.
        let cells: Vec<_> = cells().into_iter().skip(2).step_by(3).collect();
        let upright: Vec<_> = cells
            .into_iter()
            .map(|mut cell| {
                cell.direction = [0.0, 0.0, 1.0];
                cell
            })
            .collect();
        let paths = load_paths(&upright, 0.0, 1);
        let height = 0.3;
        let lowered: Vec<_> = upright
            .iter()
            .cloned()
            .map(|mut cell| {
                cell.position[2] -= height;
                cell
            })
            .collect();
        let centre = centre(&upright);
        let carried = geometry(&upright, &centre).tr_mul(&paths);
        for (axis, expected) in [0.0, 0.0, 1.0, 1.0, 1.0, 0.0].iter().enumerate() {
            assert!((carried[(axis, axis)] - expected).abs() < 1e-12);
        }
        // A force along x that no cell measures passes through their centre: below it, it has a moment.
        let lower = load_paths(&lowered, 0.0, 1);
        let moment = |paths: &DMatrix<f64>| geometry(&upright, &Vector3::zeros()).tr_mul(paths);
        let more = moment(&lower)[(4, 0)] - moment(&paths)[(4, 0)];
        assert!((more - height).abs() < 1e-12, "{more}");
    }

    #[test]
    fn a_quarter_turn_about_z_carries_x_to_y() {
        let turned = rotation_matrix(&[0.0, 0.0, 90.0]) * Vector3::x();
        assert!((turned - Vector3::y()).amax() < 1e-15);
    }

    #[test]
    fn a_remounted_specimen_feels_the_same_table() {
        // Specimen on its side: its z axis along the interface's x, its origin at t.
        let (rotation, translation) = ([0.0, 90.0, 0.0], [0.1, 0.2, 0.3]);
        let carry = mounting(&rotation, &translation);
        let table = stack(&Vector3::new(1.0, 2.0, 3.0), &Vector3::new(0.4, -0.5, 0.6));
        let specimen = carry * table;
        // Closed form for one point: go to interface coordinates and turn the result.
        let r = Vector3::new(-0.7, 0.8, 0.9);
        let turn = rotation_matrix(&rotation);
        let at = turn * r + Vector3::from(translation);
        for direction in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let in_specimen = motion_row(&r, &direction).dot(&specimen);
            let in_interface = motion_row(&at, &(turn * direction)).dot(&table);
            assert!((in_specimen - in_interface).abs() < 1e-14);
        }
    }

    #[test]
    fn cross_talk_stays_on_the_tables_axes() {
        let mut table = Table {
            axes: [true, true, true, false, false, false],
            cross_talk: 0.02,
            ..Table::default()
        };
        let motion = table_motion(&table, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 5);
        assert_eq!(motion.steady[0], 1.0);
        assert!(motion.steady[1] != 0.0 && motion.steady[1].abs() <= 0.02);
        assert_eq!(motion.steady[4], 0.0);
        assert_eq!(motion.resonant, Vector6::zeros());

        table.cross_talk = 0.0;
        table.axes = [true; 6];
        table.reference_point = [0.0, 0.0, 0.5];
        let motion = table_motion(&table, &[0.0, 0.0, 0.0, 0.0, 2.0, 0.0], 5);
        // Turning about a point 0.5 m above it, the origin moves along -x.
        assert_eq!(motion.steady[0], -1.0);
    }
}

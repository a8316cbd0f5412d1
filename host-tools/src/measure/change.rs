//! Change of the resultants of a run by changes of its sensors.
//!
//! # Design
//!
//! Resultants are a linear map C of the channels, and C follows from positions, directions and
//! scales. A small change of these changes C by
//!
//! * `g c` in the column c of a channel whose sensitivity is off by the share g;
//! * the change of its row of `Xf` in the column of a load cell (5);
//! * `-C δX C + G δXᵀ W (1 - X C)` for accelerometers, with `G = (Xaᵀ W Xa)⁻¹`: the derivative
//!   of the weighted least squares (4). G is `Σ c cᵀ / w` over the columns, which holds where
//!   the sensors see some directions only, too: those that they do not see stay out of it.
//!   To compute C anew from changed places would not do: a plane set-up whose sensor is turned
//!   out of the plane by a hair would see the third direction all of a sudden.
//!
//! The equations that load cells complete stay what they are for the same reason.

use super::geometry::{Accelerations, RunGeometry, accelerometer, load_cell};
use crate::setup::{Mount, Quantity, Setup};
use massline_core::geometry::{GeometryError, Placement, RESULTANTS};
use nalgebra::{Matrix6, Vector3, Vector6};

/// A change of what is said of sensors, given by their numbers among the channels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Change {
    /// The sensitivity of a channel is off by this share.
    Gain(usize, f64),
    /// These channels sit further along a vector (m): in the table's frame, or in the
    /// specimen's for what is mounted on it.
    Position(Vec<usize>, Vector3<f64>),
    /// These channels are turned by a small rotation vector (rad) in the same frame.
    Direction(Vec<usize>, Vector3<f64>),
}

impl RunGeometry {
    /// Difference that the change makes to [`RunGeometry::columns`] in run `number` of the setup.
    ///
    /// # Errors
    /// [`GeometryError`] for a setup that has no geometry.
    pub(crate) fn changed_columns(
        &self,
        setup: &Setup,
        number: usize,
        accelerations: &Accelerations,
        change: &Change,
    ) -> Result<Vec<[f64; RESULTANTS]>, GeometryError> {
        let mut added = vec![[0.0; RESULTANTS]; self.columns.len()];
        let (channels, by, turn) = match change {
            Change::Gain(channel, share) => {
                if let (Some(slot), Some(column)) =
                    (added.get_mut(*channel), self.columns.get(*channel))
                {
                    *slot = column.map(|x| x * share);
                }
                return Ok(added);
            }
            Change::Position(channels, by) => (channels, by, false),
            Change::Direction(channels, by) => (channels, by, true),
        };
        let run = &setup.runs[number];
        let placement = Placement::new(run.rotation.into(), run.translation.into())?;
        let sensors = setup.accelerometers.len();
        let column = |k: usize| {
            let (scale, columns) = (setup.accelerometers[k].scale, &self.columns[k]);
            Vector6::from_fn(|j, _| columns[j] / scale)
        };
        let weight = |k: usize| {
            let mount = accelerometer(&setup.accelerometers[k]).map(|a| a.mount);
            mount.map(|mount| accelerations.weight(number, k, mount))
        };
        let mut inverse = Matrix6::zeros();
        for k in 0..sensors {
            let (c, w) = (column(k), weight(k)?);
            if w > 0.0 {
                inverse.ger(1.0 / w, &c, &c, 1.0);
            }
        }
        for &channel in channels {
            let (position, direction, moves) =
                if let Some(entry) = setup.accelerometers.get(channel) {
                    let placed = placement.accelerometer(&accelerometer(entry)?);
                    let table = entry.mount == Mount::Interface;
                    (placed.position(), placed.direction(), (true, table))
                } else if let Some(entry) = setup.load_cells.get(channel - sensors) {
                    let placed = placement.load_cell(&load_cell(entry)?);
                    let force = entry.quantity == Quantity::Force;
                    (placed.position(), placed.direction(), (force, true))
                } else {
                    continue;
                };
            let (force, table) = moves;
            let by = if table {
                placement.rotation().tr_mul(by)
            } else {
                *by
            };
            let arm = position - self.reference;
            let (along, about) = match (turn, force) {
                (false, true) => (Vector3::zeros(), by.cross(&direction)),
                (false, false) => continue,
                (true, true) => (by.cross(&direction), arm.cross(&by.cross(&direction))),
                (true, false) => (Vector3::zeros(), by.cross(&direction)),
            };
            let row = Vector6::new(along.x, along.y, along.z, about.x, about.y, about.z);
            if channel >= sensors {
                let scale = setup.load_cells[channel - sensors].scale;
                for j in 0..6 {
                    added[channel][6 + j] += row[j] * scale;
                }
                continue;
            }
            let own = Vector6::new(
                direction.x,
                direction.y,
                direction.z,
                arm.cross(&direction).x,
                arm.cross(&direction).y,
                arm.cross(&direction).z,
            );
            let (c, turned) = (column(channel), inverse * row * weight(channel)?);
            for (k, added) in added.iter_mut().enumerate().take(sensors) {
                let other = column(k);
                let left = f64::from(u8::from(k == channel)) - own.dot(&other);
                let sum = (turned * left - c * row.dot(&other)) * setup.accelerometers[k].scale;
                for j in 0..6 {
                    added[j] += sum[j];
                }
            }
        }
        Ok(added)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Six accelerometers on the table and three on the structure, load cells of both kinds,
    /// and a specimen that stands otherwise.
    fn setup() -> Setup {
        let mut text = String::from(
            "reference_point = [0.1, 0.2, -0.1]\n[processing]\naveraging_band = [2, 20]\n",
        );
        let places = [[0.5, 0.1, 0.0], [-0.4, 0.4, 0.1], [0.1, -0.5, 0.05]];
        for (n, [x, y, z]) in places.into_iter().enumerate() {
            for (k, d) in ["[1, 0, 0.2]", "[0, 1, 0]", "[0.1, 0, 1]"]
                .iter()
                .enumerate()
            {
                let scale = 2 - n;
                text += &format!(
                    "[[accelerometer]]\nchannel = \"a{n}{k}\"\nposition = [{x}, {y}, {z}]\ndirection = {d}\nscale = {}\nmount = \"{}\"\n",
                    f64::from(u8::try_from(scale).unwrap()) + 0.5,
                    if n < 2 { "interface" } else { "structure" },
                );
                text += &format!(
                    "[[load_cell]]\nchannel = \"f{n}{k}\"\nposition = [{y}, {x}, {z}]\ndirection = {d}\nquantity = \"{}\"\n",
                    if n == 2 { "moment" } else { "force" },
                );
            }
        }
        text += "[[run]]\nname = \"x\"\nrecording = \"x.csv\"\nrotation = [10, 80, -30]\ntranslation = [0.1, 0.3, 0.2]\n";
        Setup::from_str(&text, Path::new("setup.toml")).unwrap()
    }

    /// The derivative beside the difference of geometries that are computed anew.
    #[test]
    fn columns_change_as_those_of_a_changed_setup() {
        let setup = setup();
        let weights = (0..9).map(|k| 0.3 + 0.07 * f64::from(k)).collect();
        let all = Accelerations::All(Some(vec![weights]));
        let before = RunGeometry::new(&setup, 0, &all).unwrap();
        let by = Vector3::new(0.3, -0.5, 0.8);
        let step = 1e-5;
        let moved = |channels: &[usize], sign: f64, turn: bool| {
            let mut setup = setup.clone();
            let by = by * (sign * step);
            for &c in channels {
                let (position, direction) = if c < 9 {
                    let a = &mut setup.accelerometers[c];
                    (&mut a.position, &mut a.direction)
                } else {
                    let a = &mut setup.load_cells[c - 9];
                    (&mut a.position, &mut a.direction)
                };
                if turn {
                    let d = Vector3::from(*direction);
                    *direction = (d + by.cross(&d)).into();
                } else {
                    *position = (Vector3::from(*position) + by).into();
                }
            }
            RunGeometry::new(&setup, 0, &all).unwrap().columns
        };
        for channels in [vec![0, 1, 2], vec![4], vec![6, 7, 8], vec![9], vec![15, 16]] {
            for turn in [false, true] {
                let change = if turn {
                    Change::Direction(channels.clone(), by)
                } else {
                    Change::Position(channels.clone(), by)
                };
                let ours = before.changed_columns(&setup, 0, &all, &change).unwrap();
                let (above, below) = (moved(&channels, 1.0, turn), moved(&channels, -1.0, turn));
                let largest = ours.iter().flatten().fold(0.0_f64, |a, x| a.max(x.abs()));
                // A moment does not depend on where it is measured.
                assert_eq!(largest == 0.0, channels[0] == 15 && !turn);
                for (ours, (a, b)) in ours.iter().zip(above.iter().zip(&below)) {
                    for j in 0..RESULTANTS {
                        let difference = (a[j] - b[j]) / (2.0 * step);
                        // The third derivative times step² / 6, and rounding over the step.
                        assert!(
                            (ours[j] - difference).abs() < 1e-8 * largest.max(1.0),
                            "{channels:?} {turn} {j}: {} {difference}",
                            ours[j]
                        );
                    }
                }
            }
        }
    }

    /// A component that a plane set-up does not see stays unseen when a sensor is turned out of the
    /// plane.
    #[test]
    fn no_direction_is_seen_of_a_sudden() {
        let mut text = String::from("[processing]\naveraging_band = [2, 20]\n");
        for (k, (place, d)) in [
            ("0.0", "[1, 0, 0]"),
            ("0.2", "[0, 0, 1]"),
            ("-0.3", "[0, 0, 1]"),
        ]
        .into_iter()
        .enumerate()
        {
            text += &format!(
                "[[accelerometer]]\nchannel = \"a{k}\"\nposition = [{place}, 0.0, 0.1]\ndirection = {d}\nmount = \"interface\"\n"
            );
        }
        text += "[[load_cell]]\nchannel = \"f\"\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\n[[run]]\nname = \"x\"\nrecording = \"x.csv\"\n";
        let setup = Setup::from_str(&text, Path::new("setup.toml")).unwrap();
        let plane = Accelerations::Interface;
        let geometry = RunGeometry::new(&setup, 0, &plane).unwrap();
        let change = Change::Direction(vec![1], Vector3::new(1.0, 1.0, 1.0));
        let added = geometry
            .changed_columns(&setup, 0, &plane, &change)
            .unwrap();
        for added in &added {
            for j in [1, 3, 5] {
                assert_eq!(added[j], 0.0, "{added:?}");
            }
        }
        // Turned about y, sensor 1 reads d'x = 1 of what moves along x: β changes by that over
        // the 0.5 m between both, for each m/s² that a0 reads.
        assert!((added[0][4].abs() - 2.0).abs() < 1e-12, "{added:?}");
    }
}

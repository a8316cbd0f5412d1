//! The objects that are drawn, in metres and in the frame of the results.

use crate::report::TrueBody;
use crate::result::{Number, ResultDocument};
use crate::setup::{self, Setup};
use massline_core::geometry::{Accelerometer, LoadCell, Mount, Placement, Quantity};
use nalgebra::{Matrix3, Vector3};

/// Kind of the sensors at a spot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    LoadCell,
    Interface,
    Structure,
}

impl Kind {
    pub fn words(self) -> &'static str {
        match self {
            Self::LoadCell => "load cell",
            Self::Interface => "accelerometer on the interface",
            Self::Structure => "accelerometer on the structure",
        }
    }

    pub fn class(self) -> &'static str {
        match self {
            Self::LoadCell => "cell",
            Self::Interface => "base",
            Self::Structure => "structure",
        }
    }
}

/// A measured direction.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub channel: String,
    pub direction: Vector3<f64>,
    pub moment: bool,
}

/// Sensors of one kind at one place: a tri-axial one is a spot with three axes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spot {
    pub kind: Kind,
    pub position: Vector3<f64>,
    pub axes: Vec<Axis>,
}

/// The ellipsoid of uniform density with the body's mass and inertia.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ellipsoid {
    pub centre: Vector3<f64>,
    /// Semi-axes, m.
    pub radii: Vector3<f64>,
    /// Their directions as columns.
    pub axes: Matrix3<f64>,
}

impl Ellipsoid {
    /// The matrix whose projections are the ellipsoid's outlines.
    pub fn shape(&self) -> Matrix3<f64> {
        let squares = Matrix3::from_diagonal(&self.radii.component_mul(&self.radii));
        self.axes * squares * self.axes.transpose()
    }
}

/// Everything.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scene {
    pub spots: Vec<Spot>,
    pub reference: Vector3<f64>,
    pub centre: [Number; 3],
    pub true_centre: [Option<f64>; 3],
    /// Or why there is none.
    pub ellipsoid: Result<Ellipsoid, &'static str>,
    /// Sensors whose place is not finite.
    pub left_out: usize,
}

impl Scene {
    pub fn new(setup: &Setup, result: &ResultDocument, truth: Option<&TrueBody>) -> Self {
        Self {
            reference: result.reference_point.into(),
            centre: result.centre_of_gravity.clone(),
            true_centre: truth.map_or([None; 3], |t| t.centre_of_gravity),
            ellipsoid: ellipsoid(result),
            ..Self::of(setup)
        }
    }

    /// The sensors and the reference point of a setup without a result.
    pub fn of(setup: &Setup) -> Self {
        let unknown = Number {
            value: None,
            std: None,
            interval: None,
            observable: false,
            type_b: None,
            combined: None,
        };
        let placement = setup
            .runs
            .first()
            .and_then(|r| Placement::new(r.rotation.into(), r.translation.into()).ok())
            .unwrap_or_default();
        let mut scene = Self {
            spots: Vec::new(),
            reference: setup.reference_point.into(),
            centre: [unknown.clone(), unknown.clone(), unknown],
            true_centre: [None; 3],
            ellipsoid: Err("No result."),
            left_out: 0,
        };
        for entry in &setup.load_cells {
            scene.add(&entry.channel, load_cell(entry, &placement));
        }
        for entry in &setup.accelerometers {
            scene.add(&entry.channel, accelerometer(entry, &placement));
        }
        scene
    }

    fn add(&mut self, channel: &str, sensor: Option<(Kind, Vector3<f64>, Vector3<f64>, bool)>) {
        // A micrometre apart is the same place.
        const SAME: f64 = 1e-6;
        let Some((kind, position, direction, moment)) = sensor else {
            self.left_out += 1;
            return;
        };
        let axis = Axis {
            channel: channel.to_owned(),
            direction,
            moment,
        };
        let here = |s: &&mut Spot| s.kind == kind && (s.position - position).norm() < SAME;
        match self.spots.iter_mut().find(here) {
            Some(spot) => spot.axes.push(axis),
            None => self.spots.push(Spot {
                kind,
                position,
                axes: vec![axis],
            }),
        }
    }

    /// The centre of gravity seen along one axis, if both other coordinates are known.
    pub fn centre_in(&self, u: usize, v: usize) -> Option<[f64; 2]> {
        let finite = |axis: usize| self.centre[axis].value.filter(|x: &f64| x.is_finite());
        Some([finite(u)?, finite(v)?])
    }

    /// Lowest and highest coordinate of everything along one axis.
    pub fn extent(&self, axis: usize) -> [f64; 2] {
        let mut low = self.reference[axis];
        let mut high = low;
        let mut see = |x: f64| {
            if x.is_finite() {
                low = low.min(x);
                high = high.max(x);
            }
        };
        self.spots.iter().for_each(|s| see(s.position[axis]));
        if let Some(x) = self.centre[axis].value {
            see(x);
        }
        if let Ok(e) = &self.ellipsoid {
            let half = e.shape()[(axis, axis)].max(0.0).sqrt();
            see(e.centre[axis] - half);
            see(e.centre[axis] + half);
        }
        [low, high]
    }

    /// The longest of the three extents, m.
    pub fn longest(&self) -> f64 {
        (0..3)
            .map(|axis| {
                let [low, high] = self.extent(axis);
                high - low
            })
            .fold(0.0, f64::max)
    }
}

fn load_cell(
    entry: &setup::LoadCellEntry,
    placement: &Placement,
) -> Option<(Kind, Vector3<f64>, Vector3<f64>, bool)> {
    let (position, direction) = (entry.position.into(), entry.direction.into());
    let cell = LoadCell::new(position, direction, entry.quantity).ok()?;
    let cell = placement.load_cell(&cell);
    let moment = entry.quantity == Quantity::Moment;
    Some((Kind::LoadCell, cell.position(), cell.direction(), moment))
}

fn accelerometer(
    entry: &setup::AccelerometerEntry,
    placement: &Placement,
) -> Option<(Kind, Vector3<f64>, Vector3<f64>, bool)> {
    let kind = match entry.mount {
        Mount::Interface => Kind::Interface,
        Mount::Structure => Kind::Structure,
    };
    let (position, direction) = (entry.position.into(), entry.direction.into());
    let sensor = Accelerometer::new(position, direction, entry.mount).ok()?;
    let sensor = placement.accelerometer(&sensor);
    Some((kind, sensor.position(), sensor.direction(), false))
}

/// A solid ellipsoid of mass m has `Θ_1 = m (b² + c²) / 5`, so that
/// `a² = 5 (Θ_2 + Θ_3 - Θ_1) / 2 m`.
fn ellipsoid(result: &ResultDocument) -> Result<Ellipsoid, &'static str> {
    const INCOMPLETE: &str =
        "No ellipsoid of inertia is drawn: it needs all six terms of inertia about S.";
    const IMPOSSIBLE: &str =
        "No ellipsoid of inertia is drawn: no body has the principal moments found.";
    let principal = result.principal_moments.zip(result.principal_axes);
    let (moments, axes) = principal.ok_or(INCOMPLETE)?;
    let (moments, axes) = (Vector3::from(moments), axes.map(Vector3::from));
    let mass = result.mass.value.ok_or(INCOMPLETE)?;
    let [Some(x), Some(y), Some(z)] = result.centre_of_gravity.each_ref().map(|n| n.value) else {
        return Err(INCOMPLETE);
    };
    let sum: f64 = moments.sum();
    let largest = moments.amax();
    let mut radii = Vector3::zeros();
    for k in 0..3 {
        let square = 2.5 / mass * (sum - 2.0 * moments[k]);
        // A flat body has a zero here, give or take its rounding.
        let rounding = 1e-9 * largest / mass.abs();
        if !(square.is_finite() && square >= -rounding) {
            return Err(IMPOSSIBLE);
        }
        radii[k] = square.max(0.0).sqrt();
    }
    Ok(Ellipsoid {
        centre: Vector3::new(x, y, z),
        radii,
        axes: Matrix3::from_columns(&axes),
    })
}

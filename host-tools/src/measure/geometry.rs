//! The setup's sensors as the core's geometry, for one run.

use super::MeasureError;
use crate::setup::{self, Run, Setup};
use massline_core::geometry::{
    self, ACCELERATION_NAMES, Accelerometer, Equations, GeometryError, LoadCell, MAX_CHANNELS,
    Mount, Placement, Quantity, RESULTANT_NAMES, RESULTANTS, ResultantMap, RunSensor,
};
use nalgebra::Vector3;

/// Accelerometers from which the base acceleration comes.
#[derive(Clone, Debug, PartialEq)]
pub enum Accelerations {
    /// Accelerometers on the interface: exact however elastic the structure is.
    Interface,
    /// All of them, equation (4), with one weight a run and accelerometer, in the order
    /// of the setup; `None` for equal weights.
    All(Option<Vec<Vec<f64>>>),
}

impl Accelerations {
    /// Weight of accelerometer `sensor` in run number `run`.
    pub(super) fn weight(&self, run: usize, sensor: usize, mount: Mount) -> f64 {
        match self {
            Self::Interface => f64::from(u8::from(mount == Mount::Interface)),
            Self::All(None) => 1.0,
            Self::All(Some(weights)) => weights
                .get(run)
                .and_then(|w| w.get(sensor))
                .copied()
                .unwrap_or(1.0),
        }
    }
}

/// Geometry of one run in the specimen's frame.
#[derive(Clone, Debug)]
pub struct RunGeometry {
    /// The reference point A, m.
    pub reference: Vector3<f64>,
    /// The channels of the map, in its order.
    pub channels: Vec<String>,
    /// SI per recorded unit of each channel.
    scales: Vec<f32>,
    /// Number of accelerometers, which are the first channels.
    accelerometers: usize,
    /// SI samples of the channels to the twelve resultants, in single precision.
    pub map: ResultantMap,
    /// From recorded units to resultants in double precision: what one unit of each channel
    /// adds.
    pub columns: Vec<[f64; RESULTANTS]>,
    /// The equations the load cells complete.
    pub equations: Equations,
    /// Share of each acceleration component that the accelerometers determine.
    determined: [f64; 6],
}

/// The channels of a run in the order in which its samples are read: accelerometers,
/// load cells, drives.
pub(crate) fn channel_names<'a>(setup: &'a Setup, run: &'a Run) -> Vec<&'a str> {
    let sensors = setup.accelerometers.iter().map(|a| a.channel.as_str());
    let cells = setup.load_cells.iter().map(|c| c.channel.as_str());
    sensors
        .chain(cells)
        .chain(run.references.iter().map(String::as_str))
        .collect()
}

/// Share from which a component counts as told in full: what rounding leaves of one.
const WHOLE: f64 = 1.0 - 1e-6;

/// Quantity and direction of a channel.
#[derive(Clone, Copy)]
pub(super) struct Axis<'a> {
    pub(super) channel: &'a str,
    kind: u8,
    direction: Vector3<f64>,
}

impl Axis<'_> {
    /// `true` if both see the same motion, or load, to at least one half.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.channel != other.channel
            && self.direction.dot(&other.direction).abs() > 0.5
    }
}

/// The axes of all sensors of a setup.
pub(super) fn axes(setup: &Setup) -> Vec<Axis<'_>> {
    let sensors = setup.accelerometers.iter().map(|a| Axis {
        channel: &a.channel,
        // What is re-mounted with the specimen turns away from what stays.
        kind: if a.mount == Mount::Interface { 0 } else { 3 },
        direction: a.direction.into(),
    });
    let cells = setup.load_cells.iter().map(|c| Axis {
        channel: &c.channel,
        kind: if c.quantity == Quantity::Force { 1 } else { 2 },
        direction: c.direction.into(),
    });
    sensors.chain(cells).collect()
}

pub(super) fn accelerometer(
    entry: &setup::AccelerometerEntry,
) -> Result<Accelerometer, GeometryError> {
    Accelerometer::new(entry.position.into(), entry.direction.into(), entry.mount)
}

pub(super) fn load_cell(entry: &setup::LoadCellEntry) -> Result<LoadCell, GeometryError> {
    LoadCell::new(
        entry.position.into(),
        entry.direction.into(),
        entry.quantity,
    )
}

/// Place of the specimen in a run.
fn placement(run: &Run) -> Result<Placement, MeasureError> {
    let placed = Placement::new(run.rotation.into(), run.translation.into());
    placed.map_err(|source| MeasureError::Geometry {
        run: run.name.clone(),
        source,
    })
}

/// Mean position of the accelerometers on the interface over all runs, in the specimen's frame, m.
pub(super) fn middle_of_interface(setup: &Setup) -> Result<Vector3<f64>, MeasureError> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for run in &setup.runs {
        let placement = placement(run)?;
        for entry in &setup.accelerometers {
            if entry.mount != Mount::Interface {
                continue;
            }
            let sensor = accelerometer(entry).map_err(|source| MeasureError::Geometry {
                run: run.name.clone(),
                source,
            })?;
            sum += placement.accelerometer(&sensor).position();
            count += 1.0;
        }
    }
    Ok(sum / f64::max(count, 1.0))
}

impl RunGeometry {
    /// Builds the geometry of run `number` of the setup.
    ///
    /// # Errors
    /// [`MeasureError::Geometry`] or [`MeasureError::NoInterface`].
    pub fn new(
        setup: &Setup,
        number: usize,
        accelerations: &Accelerations,
    ) -> Result<Self, MeasureError> {
        let reference = Vector3::from(setup.reference_point);
        Self::about(setup, number, accelerations, reference)
    }

    /// The same about a point of the specimen, m.
    ///
    /// # Errors
    /// As of [`RunGeometry::new`].
    pub(super) fn about(
        setup: &Setup,
        number: usize,
        accelerations: &Accelerations,
        reference: Vector3<f64>,
    ) -> Result<Self, MeasureError> {
        let run = &setup.runs[number];
        let wrong = |source| MeasureError::Geometry {
            run: run.name.clone(),
            source,
        };
        let placement = placement(run)?;
        let mut sensors = Vec::new();
        let mut channels = Vec::new();
        let mut scales = Vec::new();
        for (index, entry) in setup.accelerometers.iter().enumerate() {
            let sensor = accelerometer(entry).map_err(wrong)?;
            let weight = accelerations.weight(number, index, sensor.mount);
            sensors.push(RunSensor::Accelerometer(sensor, weight));
            channels.push(entry.channel.clone());
            scales.push(entry.scale);
        }
        let unweighted = |s: &RunSensor| matches!(s, RunSensor::Accelerometer(_, w) if *w == 0.0);
        if sensors.iter().all(unweighted) {
            return Err(MeasureError::NoInterface {
                run: run.name.clone(),
            });
        }
        for entry in &setup.load_cells {
            sensors.push(RunSensor::LoadCell(load_cell(entry).map_err(wrong)?));
            channels.push(entry.channel.clone());
            scales.push(entry.scale);
        }
        let mut columns: Vec<[f64; RESULTANTS]> = Vec::new();
        let mut geometry = geometry::RunGeometry::empty();
        let column = |column: [f64; RESULTANTS]| {
            let scale = scales[columns.len()];
            columns.push(column.map(|x| x * scale));
        };
        let described = geometry.describe(sensors, &placement, &reference, column);
        described.map_err(wrong)?;
        Ok(Self {
            reference,
            channels,
            scales: scales.iter().map(|&s| s as f32).collect(),
            accelerometers: setup.accelerometers.len(),
            map: geometry.map,
            columns,
            equations: geometry.equations,
            determined: geometry.determined,
        })
    }

    /// One sample of all channels, in recorded units, to the twelve resultants: by way of SI,
    /// as the box does it.
    #[must_use]
    pub fn resultants(&self, sample: &[f32]) -> [f32; RESULTANTS] {
        // Most tests have few channels, and an array takes time to be cleared.
        if self.scales.len() <= MAX_CHANNELS / 2 {
            self.mapped::<{ MAX_CHANNELS / 2 }>(sample)
        } else {
            self.mapped::<MAX_CHANNELS>(sample)
        }
    }

    /// SI per recorded unit of each channel.
    pub(super) fn scales(&self) -> &[f32] {
        &self.scales
    }

    /// Number of accelerometers; the channels behind them are load cells.
    pub(super) fn accelerometers(&self) -> usize {
        self.accelerometers
    }

    fn mapped<const ROOM: usize>(&self, sample: &[f32]) -> [f32; RESULTANTS] {
        let mut si = [0.0; ROOM];
        for ((si, x), scale) in si.iter_mut().zip(sample).zip(&self.scales) {
            *si = x * scale;
        }
        self.map.apply(&si)
    }

    /// Share of each acceleration component that the accelerometers determine, 0 to 1.
    #[must_use]
    pub fn determined(&self) -> [f64; 6] {
        self.determined
    }

    /// `true` if the sensors tell all twelve resultants in full.
    pub(super) fn is_complete(&self) -> bool {
        let (accelerations, resultants) = self.seen();
        accelerations.len() + resultants.len() == RESULTANTS
    }

    /// Names of the accelerations and of the resultants that the sensors tell in full.
    #[must_use]
    pub fn seen(&self) -> (Vec<&'static str>, Vec<&'static str>) {
        let names = |names: &[&'static str; 6], share: &dyn Fn(usize) -> f64| {
            let whole = (0..6).filter(|&j| share(j) >= WHOLE);
            whole.map(|j| names[j]).collect()
        };
        (
            names(&ACCELERATION_NAMES, &|j| self.determined[j]),
            names(&RESULTANT_NAMES, &|j| self.equations.measured(j)),
        )
    }

    /// Says what is taken as zero and which equations are left out.
    pub(super) fn warn(&self, warnings: &mut Vec<String>) {
        let missing = |names: &[&str; 6], share: &dyn Fn(usize) -> f64| {
            let list: Vec<&str> = (0..6)
                .filter(|&j| share(j) < WHOLE)
                .map(|j| names[j])
                .collect();
            (!list.is_empty()).then(|| list.join(", "))
        };
        if let Some(list) = missing(&ACCELERATION_NAMES, &|j| self.determined[j]) {
            warnings.push(format!(
                "the accelerometers do not observe {list} of the reference point; taken as zero"
            ));
        }
        if let Some(list) = missing(&RESULTANT_NAMES, &|j| self.equations.measured(j)) {
            warnings.push(format!(
                "the load cells do not measure {list}; the equations that need them are left out"
            ));
        }
    }
}

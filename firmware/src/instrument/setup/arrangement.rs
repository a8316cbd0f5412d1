//! The arrangement: the sensors, and the placement of the specimen in each run.

use crate::calibration;
use crate::capacity::{CHANNELS, RUNS, SENSORS};
use crate::instrument::limits::{below, finite, fits};
use crate::wire::{
    ChannelRole, Excitation, Field, Item, NAME_MAX, Plan, Problem, Run, Sensor, SensorKind,
};
use massline_core::geometry::{
    Accelerometer, GeometryError, LoadCell, Mount, Placement, RunGeometry, RunSensor,
};
use nalgebra::Vector3;

const NO_PLAN: Plan = Plan {
    sensors: 0,
    runs: 0,
    reference_point: [0.0; 3],
    fingerprint: 0,
};

/// A sensor as it was sent.
#[derive(Clone, Copy, Debug)]
struct SensorPiece {
    kind: SensorKind,
    position: [f64; 3],
    direction: [f64; 3],
    /// Conversion to SI; `None` if the input has it stored.
    scale: Option<calibration::Scale>,
}

impl SensorPiece {
    fn accelerometer(&self) -> Option<Mount> {
        match self.kind {
            SensorKind::Accelerometer(mount) => Some(mount),
            SensorKind::LoadCell(_) => None,
        }
    }

    fn geometry(&self, weight: f64) -> Result<RunSensor, GeometryError> {
        let (position, direction) = (self.position.into(), self.direction.into());
        Ok(match self.kind {
            SensorKind::Accelerometer(mount) => {
                let sensor = Accelerometer::new(position, direction, mount)?;
                RunSensor::Accelerometer(sensor, weight)
            }
            SensorKind::LoadCell(quantity) => {
                RunSensor::LoadCell(LoadCell::new(position, direction, quantity)?)
            }
        })
    }
}

/// A run as it was sent. Its placement is computed on demand, which takes half of the memory.
#[derive(Clone, Debug)]
struct RunPiece {
    rotation: [f64; 3],
    translation: [f64; 3],
    channels: heapless::Vec<u8, CHANNELS, u8>,
}

impl RunPiece {
    fn placement(&self) -> Result<Placement, GeometryError> {
        Placement::new(self.rotation.into(), self.translation.into())
    }
}

/// Sensors, runs and the reference point.
#[derive(Debug)]
pub(in crate::instrument) struct Arrangement {
    plan: Plan,
    sensors: [Option<SensorPiece>; SENSORS],
    runs: [Option<RunPiece>; RUNS],
}

impl Arrangement {
    /// Creates an arrangement without pieces.
    pub(super) const fn new() -> Self {
        Self {
            plan: NO_PLAN,
            sensors: [const { None }; SENSORS],
            runs: [const { None }; RUNS],
        }
    }

    /// Deletes all pieces and begins anew; without a plan, no piece is accepted.
    pub(super) fn begin(&mut self, plan: Option<&Plan>) {
        self.plan = plan.copied().unwrap_or(NO_PLAN);
        self.sensors.fill(None);
        for run in &mut self.runs {
            *run = None;
        }
    }

    pub(super) fn fingerprint(&self) -> u32 {
        self.plan.fingerprint
    }

    /// The reference point A, m.
    pub(in crate::instrument) fn reference(&self) -> Vector3<f64> {
        self.plan.reference_point.into()
    }

    /// Number of sensors.
    pub(in crate::instrument) fn sensors(&self) -> usize {
        usize::from(self.plan.sensors)
    }

    /// Number of runs.
    pub(super) fn runs(&self) -> usize {
        usize::from(self.plan.runs)
    }

    pub(super) fn set_sensor(&mut self, sensor: &Sensor<'_>) -> Result<(), Problem> {
        let at = below(Item::Sensor, sensor.sensor, self.plan.sensors)?;
        let index = u32::from(sensor.sensor);
        fits(Item::Byte, sensor.name.len(), NAME_MAX)?;
        for x in sensor.position {
            finite(Field::Position, index, x)?;
        }
        let length = Vector3::from(sensor.direction).norm();
        if !(length > 0.0 && length.is_finite()) {
            let (low, high) = (f64::MIN_POSITIVE, f64::MAX);
            return Err(Problem::range(Field::Direction, index, length, [low, high]));
        }
        let scale = calibration::Scale::given(&sensor.scale);
        let scale = scale.map_err(|problem| problem.about(index))?;
        let piece = SensorPiece {
            kind: sensor.kind,
            position: sensor.position,
            direction: sensor.direction,
            scale,
        };
        if let Some(slot) = self.sensors.get_mut(at) {
            *slot = Some(piece);
        }
        Ok(())
    }

    pub(super) fn set_run(&mut self, run: &Run<'_>) -> Result<(), Problem> {
        let at = below(Item::Run, run.run, self.plan.runs)?;
        let index = u32::from(run.run);
        fits(Item::Byte, run.name.len(), NAME_MAX)?;
        if run.excitation != Excitation::Random {
            return Err(Problem::Unsupported(Item::Excitation));
        }
        for x in run.rotation {
            finite(Field::Rotation, index, x)?;
        }
        for x in run.translation {
            finite(Field::Translation, index, x)?;
        }
        fits(Item::Channel, run.channels.len(), CHANNELS)?;
        for carried in run.channel_roles() {
            match carried {
                ChannelRole::Sensor(sensor) => {
                    below(Item::Sensor, sensor, self.plan.sensors)?;
                    once(run, carried, Item::Sensor)?;
                }
                ChannelRole::Drive => once(run, carried, Item::Drive)?,
                ChannelRole::Unused => {}
            }
        }
        if !run
            .channel_roles()
            .any(|carried| carried == ChannelRole::Drive)
        {
            // The cross-spectral matrix of 100 lines would take 112 KiB a run.
            return Err(Problem::missing(Item::Drive, at));
        }
        let piece = RunPiece {
            rotation: run.rotation,
            translation: run.translation,
            channels: heapless::Vec::from_slice(run.channels).unwrap_or_default(),
        };
        if piece.placement().is_err() {
            return Err(Problem::range(
                Field::Rotation,
                index,
                f64::NAN,
                [f64::MIN, f64::MAX],
            ));
        }
        if let Some(slot) = self.runs.get_mut(at) {
            *slot = Some(piece);
        }
        Ok(())
    }

    /// Checks that all sensors were sent.
    pub(super) fn check_sensors(&self) -> Result<(), Problem> {
        for sensor in 0..self.sensors() {
            self.piece(sensor)
                .ok_or(Problem::missing(Item::Sensor, sensor))?;
        }
        Ok(())
    }

    /// Checks that a run was sent, and that it has a channel for each sensor.
    pub(super) fn check_run(&self, run: usize) -> Result<(), Problem> {
        let piece = self.run(run).ok_or(Problem::missing(Item::Run, run))?;
        for sensor in 0..self.sensors() {
            let carried = piece.channels.iter().any(|&c| usize::from(c) == sensor);
            if !carried {
                return Err(Problem::missing(Item::Channel, sensor));
            }
        }
        Ok(())
    }

    fn piece(&self, sensor: usize) -> Option<&SensorPiece> {
        self.sensors.get(sensor)?.as_ref()
    }

    fn run(&self, run: usize) -> Option<&RunPiece> {
        self.runs.get(run)?.as_ref()
    }

    /// Number of a run of this set-up as an index.
    pub(super) fn run_index(&self, run: u8) -> Result<usize, Problem> {
        below(Item::Run, run, self.plan.runs)
    }

    /// Codes of the [`ChannelRole`] of each channel of a run.
    pub(in crate::instrument) fn channels(&self, run: usize) -> &[u8] {
        self.run(run).map_or(&[], |r| &r.channels)
    }

    /// Geometry of a sensor, with weight one.
    pub(in crate::instrument) fn sensor(&self, sensor: usize) -> Option<RunSensor> {
        self.piece(sensor)?.geometry(1.0).ok()
    }

    /// Placement of the specimen in a run.
    pub(in crate::instrument) fn placement(&self, run: usize) -> Placement {
        let placement = self.run(run).map(RunPiece::placement);
        placement.and_then(Result::ok).unwrap_or_default()
    }

    /// Conversion of a sensor's readings to SI; `None` if its input has it stored.
    pub(in crate::instrument) fn scale(&self, sensor: usize) -> Option<calibration::Scale> {
        self.piece(sensor)
            .map_or(Some(calibration::Scale::ONE), |p| p.scale)
    }

    /// `true` if a sensor is an accelerometer; `None` if it was not sent.
    pub(super) fn accelerates(&self, sensor: usize) -> Option<bool> {
        self.piece(sensor).map(|p| p.accelerometer().is_some())
    }

    /// Numbers of the accelerometers, ascending.
    pub(in crate::instrument) fn accelerometers(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        (0..self.sensors()).filter(|sensor| self.accelerates(*sensor) == Some(true))
    }

    /// The geometry of a run with the weight of each sensor, by its number and, if it is an
    /// accelerometer, its mount.
    pub(super) fn geometry(
        &self,
        run: usize,
        weight: impl Fn(usize, Option<Mount>) -> f64 + Clone,
        into: &mut RunGeometry,
    ) -> Result<(), Problem> {
        let sensors = (0..self.sensors()).filter_map(|sensor| {
            let piece = self.piece(sensor)?;
            // Each was checked when it came.
            let weight = weight(sensor, piece.accelerometer());
            piece.geometry(weight).ok()
        });
        let placement = self.placement(run);
        let index = run as u32;
        let found = into.describe(sensors, &placement, &self.reference(), |_| ());
        found.map_err(|e| match e {
            GeometryError::NoAccelerometer => Problem::missing(Item::Accelerometer, run),
            GeometryError::NoLoadCell => Problem::missing(Item::LoadCell, run),
            GeometryError::Weight => {
                Problem::range(Field::Weight, index, f64::NAN, [0.0, f64::MAX])
            }
            GeometryError::TooManyChannels => {
                Problem::capacity(Item::Sensor, self.sensors(), SENSORS)
            }
            _ => Problem::range(
                Field::Direction,
                index,
                f64::NAN,
                [f64::MIN_POSITIVE, f64::MAX],
            ),
        })
    }
}

/// Checks that a sensor or the drive has exactly one channel.
fn once(run: &Run<'_>, carried: ChannelRole, item: Item) -> Result<(), Problem> {
    let same = run.channel_roles().filter(|c| *c == carried);
    match same.fold(0_usize, |found, _| found.saturating_add(1)) {
        1 => Ok(()),
        found => Err(Problem::count(item, found, 1)),
    }
}

//! The load cells of all runs: what decides which equations of motion hold.

use super::Arrangement;
use crate::capacity::{RUNS, SENSORS};
use massline_core::geometry::{Equations, LoadCell, Placement, RunGeometry, RunSensor};
use nalgebra::Vector3;

/// The load cells, and how the specimen stands above them in each run. A job takes them
/// along and finds the equations of its runs, rather than that these are kept with every
/// run, at 300 bytes each.
#[derive(Debug)]
pub(in crate::instrument) struct LoadCells {
    reference: Vector3<f64>,
    cells: heapless::Vec<LoadCell, SENSORS>,
    placements: heapless::Vec<Placement, RUNS>,
}

impl LoadCells {
    /// None, all zero.
    pub(in crate::instrument) const ZERO: Self = Self {
        reference: Vector3::new(0.0, 0.0, 0.0),
        cells: heapless::Vec::new(),
        placements: heapless::Vec::new(),
    };

    /// Takes over those of an arrangement.
    pub(in crate::instrument) fn take_from(&mut self, arrangement: &Arrangement) {
        self.reference = arrangement.reference();
        self.cells.clear();
        for sensor in 0..arrangement.sensors() {
            if let Some(RunSensor::LoadCell(cell)) = arrangement.sensor(sensor) {
                // There is room for every sensor.
                let _ = self.cells.push(cell);
            }
        }
        self.placements.clear();
        for run in 0..arrangement.runs() {
            let _ = self.placements.push(arrangement.placement(run));
        }
    }

    /// The point to which they are referred, m.
    pub(in crate::instrument) fn reference(&self) -> Vector3<f64> {
        self.reference
    }

    /// The equations of motion of each run, as [`RunGeometry`] has them.
    pub(in crate::instrument) fn equations(&self, into: &mut [Equations; RUNS]) {
        for (run, placement) in self.placements.iter().enumerate() {
            let (before, rest) = into.split_at_mut(run.min(RUNS));
            let Some(slot) = rest.first_mut() else { break };
            let same = self.placements.iter().position(|p| p == placement);
            *slot = match same.and_then(|first| before.get(first)) {
                Some(known) => *known,
                None => self.equations_of(placement),
            };
        }
    }

    #[inline(never)] // One step's matrices at a time.
    fn equations_of(&self, placement: &Placement) -> Equations {
        let sensors = self.cells.iter().map(|cell| RunSensor::LoadCell(*cell));
        let equations = RunGeometry::equations_of(sensors, placement, &self.reference);
        equations.unwrap_or(Equations::none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{
        ChannelRole, Excitation, Mount, Plan, Quantity, Run, ScaleSource, Sensor, SensorKind,
    };

    /// Three vertical load cells and an accelerometer; the specimen is turned in the second
    /// run, and in the third it stands as in the first.
    fn arrangement() -> Arrangement {
        let mut arrangement = Arrangement::new();
        arrangement.begin(Some(&Plan {
            sensors: 4,
            runs: 3,
            reference_point: [0.1, -0.2, 0.3],
            fingerprint: 0,
        }));
        for (number, position) in [
            [0.3, 0.0, 0.0],
            [-0.1, 0.2, 0.0],
            [-0.2, -0.3, 0.0],
            [0.0; 3],
        ]
        .into_iter()
        .enumerate()
        {
            let kind = match number {
                3 => SensorKind::Accelerometer(Mount::Interface),
                _ => SensorKind::LoadCell(Quantity::Force),
            };
            let sensor = Sensor {
                sensor: number as u8,
                name: "",
                kind,
                position,
                direction: [0.0, 0.0, 2.0],
                scale: ScaleSource::Stored,
            };
            arrangement.set_sensor(&sensor).unwrap();
        }
        for (number, turned) in [0.0, 25.0, 0.0].into_iter().enumerate() {
            let run = Run {
                run: number as u8,
                name: "",
                excitation: Excitation::Random,
                rotation: [turned, 0.0, 0.5 * turned],
                translation: [0.0, 0.01 * turned, 0.0],
                channels: &[0, 1, 2, 3, ChannelRole::Drive.code()],
            };
            arrangement.set_run(&run).unwrap();
        }
        arrangement
    }

    #[test]
    fn equations_are_those_of_the_runs_to_the_last_bit() {
        let arrangement = arrangement();
        let mut cells = LoadCells::ZERO;
        cells.take_from(&arrangement);
        let mut found = [Equations::none(); RUNS];
        cells.equations(&mut found);
        for (run, found) in found.iter().enumerate().take(3) {
            let mut geometry = RunGeometry::empty();
            arrangement
                .geometry(run, |_, _| 1.0, &mut geometry)
                .unwrap();
            assert_eq!(found.count(), 3);
            assert_eq!(*found, geometry.equations, "run {run}");
        }
        assert_eq!(found[0], found[2]);
        assert_ne!(found[0], found[1]);
    }
}

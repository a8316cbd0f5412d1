//! The set-up: its pieces as they are received, and the checked whole.
//!
//! | file | holds |
//! | --- | --- |
//! | `arrangement` | sensors, runs, and the placement of the specimen in each |
//! | `load_cells` | the load cells and placements, which decide the equations of motion that hold |
//! | `lines` | settings of the spectral analysis |
//! | `weighing` | weights, and the peaks from which they follow |

mod arrangement;
mod lines;
mod load_cells;
mod weighing;

pub(super) use arrangement::Arrangement;
pub(super) use lines::{DECIMATIONS, Lines, TRANSFORM, lines_of};
pub(super) use load_cells::LoadCells;

use super::limits::{finite, fits, within};
use crate::capacity::{RUNS, SENSORS};
use crate::wire::{
    Accelerations, Field, Item, Plan, Problem, Processing, Run, Sensor, Weighting, Weights,
};
use massline_core::geometry::{Mount, RunGeometry};
use weighing::Weighing;

/// A set-up.
#[derive(Debug)]
pub(super) struct SetUp {
    arrangement: Arrangement,
    processing: Option<Processing>,
    weighing: Weighing,
}

impl SetUp {
    /// Creates a set-up without pieces.
    pub(super) const fn new() -> Self {
        Self {
            arrangement: Arrangement::new(),
            processing: None,
            weighing: Weighing::new(),
        }
    }

    /// Deletes all pieces and begins anew.
    pub(super) fn begin(&mut self, plan: &Plan) -> Result<(), Problem> {
        fits(Item::Sensor, usize::from(plan.sensors), SENSORS)?;
        fits(Item::Run, usize::from(plan.runs), RUNS)?;
        for x in plan.reference_point {
            finite(Field::ReferencePoint, 0, x)?;
        }
        self.clear();
        self.arrangement.begin(Some(plan));
        Ok(())
    }

    /// Deletes all pieces.
    pub(super) fn clear(&mut self) {
        self.arrangement.begin(None);
        self.processing = None;
        self.weighing.clear();
    }

    pub(super) fn fingerprint(&self) -> u32 {
        self.arrangement.fingerprint()
    }

    /// Sensors and runs.
    pub(super) fn arrangement(&self) -> &Arrangement {
        &self.arrangement
    }

    pub(super) fn set_processing(&mut self, p: &Processing) -> Result<(), Problem> {
        Lines::new(p)?;
        within(Field::MinimumWeight, 0, p.minimum_weight, 0.0, 1.0)?;
        self.processing = Some(*p);
        Ok(())
    }

    pub(super) fn set_sensor(&mut self, sensor: &Sensor<'_>) -> Result<(), Problem> {
        self.arrangement.set_sensor(sensor)
    }

    pub(super) fn set_run(&mut self, run: &Run<'_>) -> Result<(), Problem> {
        self.arrangement.set_run(run)
    }

    pub(super) fn set_weights(&mut self, weights: &Weights<'_>) -> Result<(), Problem> {
        let at = self.run_index(weights.run)?;
        let (found, expected) = (weights.weights.len(), self.arrangement.sensors());
        if found != expected {
            return Err(Problem::count(Item::Weight, found, expected));
        }
        for (sensor, weight) in weights.weights.iter().enumerate() {
            if self.arrangement.accelerates(sensor).unwrap_or(true) {
                within(Field::Weight, sensor as u32, weight, 0.0, f64::MAX)?;
            }
        }
        self.weighing.give(at, weights.weights.iter());
        Ok(())
    }

    /// Checks the whole set-up. `geometry` is scratch memory.
    pub(super) fn end(&self, geometry: &mut RunGeometry) -> Result<Lines, Problem> {
        let processing = self
            .processing
            .ok_or(Problem::missing(Item::Processing, 0))?;
        self.arrangement.check_sensors()?;
        for run in 0..self.arrangement.runs() {
            self.arrangement.check_run(run)?;
            self.geometry(run, processing.accelerations, geometry)?;
        }
        if self.arrangement.runs() == 0 {
            return Err(Problem::missing(Item::Run, 0));
        }
        Lines::new(&processing)
    }

    /// Index of the run of this number.
    pub(super) fn run_index(&self, run: u8) -> Result<usize, Problem> {
        self.arrangement.run_index(run)
    }

    /// The accelerometers that a measuring pass uses.
    pub(super) fn accelerations(&self) -> Accelerations {
        self.processing
            .map_or(Accelerations::Interface, |p| p.accelerations)
    }

    /// Sample rate in Hz.
    pub(super) fn sample_rate(&self) -> f64 {
        self.processing.map_or(0.0, |p| p.sample_rate)
    }

    /// Geometry of a run with its present weights.
    pub(super) fn geometry(
        &self,
        run: usize,
        accelerations: Accelerations,
        into: &mut RunGeometry,
    ) -> Result<(), Problem> {
        let weights = self.weighing.weights(run);
        let weight = |sensor: usize, mount: Option<Mount>| match accelerations {
            Accelerations::Interface => f64::from(u8::from(mount == Some(Mount::Interface))),
            Accelerations::All => 1.0,
            Accelerations::Weighted => weights.get(sensor).copied().unwrap_or(1.0),
        };
        self.arrangement.geometry(run, weight, into)
    }

    /// Checks that a run may be measured: its weights are known, if they count.
    pub(super) fn may_measure(&self, run: usize) -> Result<(), Problem> {
        let needs = self.processing.is_some_and(|p| {
            p.accelerations == Accelerations::Weighted && p.weighting != Weighting::Given
        });
        if needs && !self.weighing.are_known(run) {
            return Err(Problem::missing(Item::Survey, run));
        }
        Ok(())
    }

    /// Weights of a run, one for each sensor.
    pub(super) fn weights(&self, run: usize) -> &[f64] {
        let all = self.weighing.weights(run);
        all.get(..self.arrangement.sensors()).unwrap_or(all)
    }

    /// Peaks of a run by its survey, one for each sensor; `None` before the survey.
    pub(super) fn peaks(&self, run: usize) -> Option<&[f64]> {
        self.weighing.peaks(run)?.get(..self.arrangement.sensors())
    }

    /// Bit k is set if run k was surveyed.
    pub(super) fn surveyed(&self) -> u32 {
        self.weighing.surveyed()
    }

    /// Stores the peaks of a survey, and sets weights from them as the processing says.
    pub(super) fn set_peaks(&mut self, run: usize, peaks: &[f64; SENSORS]) {
        self.weighing
            .set_peaks(run, peaks, self.processing.as_ref(), &self.arrangement);
    }
}

/// The bit of a run or another item of this number; zero beyond 32.
pub(super) const fn bit(number: u32) -> u32 {
    match 1_u32.checked_shl(number) {
        Some(bit) => bit,
        None => 0,
    }
}

/// Bit k is set if flag k is.
pub(super) fn mask(flags: impl IntoIterator<Item = bool>) -> u32 {
    let bits = (0..u32::BITS).map(bit);
    bits.zip(flags)
        .filter(|(_, flag)| *flag)
        .fold(0, |all, (bit, _)| all | bit)
}

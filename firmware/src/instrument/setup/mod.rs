//! The set-up: pieces as they come in, and the whole once it has been checked.
//!
//! | file | holds |
//! | --- | --- |
//! | `arrangement` | sensors, runs, and how the specimen stands in each |
//! | `load_cells` | what of that decides which equations of motion hold |
//! | `lines` | how samples become lines |
//! | `weighing` | weights, and the peaks that they are found by |

mod arrangement;
mod lines;
mod load_cells;
mod weighing;

pub(super) use arrangement::Arrangement;
pub(super) use lines::{Lines, lines_of};
pub(super) use load_cells::LoadCells;

use super::limits::missing;
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
    /// None of its pieces are there yet.
    pub(super) const fn new() -> Self {
        Self {
            arrangement: Arrangement::new(),
            processing: None,
            weighing: Weighing::new(),
        }
    }

    /// Forgets all pieces, and begins anew.
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

    /// Forgets all pieces.
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
            return Err(Problem::Count {
                item: Item::Weight,
                found: found as u32,
                expected: expected as u32,
            });
        }
        for (sensor, weight) in weights.weights.iter().enumerate() {
            if self.arrangement.accelerates(sensor).unwrap_or(true) {
                within(Field::Weight, sensor as u32, weight, 0.0, f64::MAX)?;
            }
        }
        self.weighing.give(at, weights.weights.iter());
        Ok(())
    }

    /// Checks the whole. `geometry` serves for trying.
    pub(super) fn end(&self, geometry: &mut RunGeometry) -> Result<Lines, Problem> {
        let processing = self.processing.ok_or(missing(Item::Processing, 0))?;
        self.arrangement.check_sensors()?;
        for run in 0..self.arrangement.runs() {
            self.arrangement.check_run(run)?;
            self.geometry(run, processing.accelerations, geometry)?;
        }
        if self.arrangement.runs() == 0 {
            return Err(missing(Item::Run, 0));
        }
        Lines::new(&processing)
    }

    /// Number of a run of this set-up as an index.
    pub(super) fn run_index(&self, run: u8) -> Result<usize, Problem> {
        self.arrangement.run_index(run)
    }

    /// The accelerometers that a measuring pass uses.
    pub(super) fn accelerations(&self) -> Accelerations {
        self.processing
            .map_or(Accelerations::Interface, |p| p.accelerations)
    }

    /// Hz.
    pub(super) fn sample_rate(&self) -> f64 {
        self.processing.map_or(0.0, |p| p.sample_rate)
    }

    /// The geometry of a run with the weights as they are now.
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

    /// Whether a run may be measured: its weights are known, where they count.
    pub(super) fn may_measure(&self, run: usize) -> Result<(), Problem> {
        let needs = self.processing.is_some_and(|p| {
            p.accelerations == Accelerations::Weighted && p.weighting != Weighting::Given
        });
        if needs && !self.weighing.are_known(run) {
            return Err(missing(Item::Survey, run));
        }
        Ok(())
    }

    /// Weights of a run, one a sensor.
    pub(super) fn weights(&self, run: usize) -> &[f64] {
        let all = self.weighing.weights(run);
        all.get(..self.arrangement.sensors()).unwrap_or(all)
    }

    /// What the survey of a run found, one number a sensor; `None` before it.
    pub(super) fn peaks(&self, run: usize) -> Option<&[f64]> {
        self.weighing.peaks(run)?.get(..self.arrangement.sensors())
    }

    /// Bit k: run k was surveyed.
    pub(super) fn surveyed(&self) -> u32 {
        self.weighing.surveyed()
    }

    /// Keeps what a survey found, and sets weights by it as the processing says.
    pub(super) fn set_peaks(&mut self, run: usize, peaks: &[f64; SENSORS]) {
        self.weighing
            .set_peaks(run, peaks, self.processing.as_ref(), &self.arrangement);
    }
}

/// The bit of a run or another thing of this number; none beyond 32.
pub(super) const fn bit(number: u32) -> u32 {
    match 1_u32.checked_shl(number) {
        Some(bit) => bit,
        None => 0,
    }
}

/// Bits of the flags that are set.
pub(super) fn mask(flags: impl IntoIterator<Item = bool>) -> u32 {
    let bits = (0..u32::BITS).map(bit);
    bits.zip(flags)
        .filter(|(_, flag)| *flag)
        .fold(0, |all, (bit, _)| all | bit)
}

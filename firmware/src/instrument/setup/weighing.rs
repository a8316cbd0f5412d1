//! Weights of the accelerometers in each run, and the peaks that surveys have found.

use super::{Arrangement, mask};
use crate::capacity::{RUNS, SENSORS};
use crate::wire::{Processing, Weighting};
use core::ops::Range;
use massline_core::weighting::{join_peaks, weights_from_peaks};

/// Weights and peaks of all runs.
#[derive(Debug)]
pub(super) struct Weighing {
    weights: [[f64; SENSORS]; RUNS],
    /// Runs whose weights were given, or found by a survey.
    weighted: [bool; RUNS],
    peaks: [[f64; SENSORS]; RUNS],
    surveyed: [bool; RUNS],
}

impl Weighing {
    /// Creates weights of one, without surveys.
    pub(super) const fn new() -> Self {
        Self {
            weights: [[1.0; SENSORS]; RUNS],
            weighted: [false; RUNS],
            peaks: [[0.0; SENSORS]; RUNS],
            surveyed: [false; RUNS],
        }
    }

    /// Sets all weights to one and deletes all peaks.
    pub(super) fn clear(&mut self) {
        self.weights.as_flattened_mut().fill(1.0);
        self.weighted = [false; RUNS];
        self.peaks.as_flattened_mut().fill(0.0);
        self.surveyed = [false; RUNS];
    }

    /// Sets the weights of a run, one for each sensor.
    pub(super) fn give(&mut self, run: usize, weights: impl Iterator<Item = f64>) {
        if let Some(all) = self.weights.get_mut(run) {
            for (slot, weight) in all.iter_mut().zip(weights) {
                *slot = weight;
            }
        }
        if let Some(known) = self.weighted.get_mut(run) {
            *known = true;
        }
    }

    /// `true` if the weights of a run were given, or found by a survey.
    pub(super) fn are_known(&self, run: usize) -> bool {
        self.weighted.get(run).copied().unwrap_or(false)
    }

    /// Weights of a run, one for each possible sensor.
    pub(super) fn weights(&self, run: usize) -> &[f64] {
        self.weights.get(run).map_or(&[], |weights| weights)
    }

    /// Peaks of a run by its survey, one for each possible sensor; `None` before the survey.
    pub(super) fn peaks(&self, run: usize) -> Option<&[f64]> {
        if !*self.surveyed.get(run)? {
            return None;
        }
        Some(self.peaks.get(run)?)
    }

    /// Bit k is set if run k was surveyed.
    pub(super) fn surveyed(&self) -> u32 {
        mask(self.surveyed)
    }

    /// Stores the peaks of a survey, and sets weights from them as the processing says.
    pub(super) fn set_peaks(
        &mut self,
        run: usize,
        peaks: &[f64; SENSORS],
        processing: Option<&Processing>,
        arrangement: &Arrangement,
    ) {
        let (Some(slot), Some(surveyed)) = (self.peaks.get_mut(run), self.surveyed.get_mut(run))
        else {
            return;
        };
        *slot = *peaks;
        *surveyed = true;
        let Some(processing) = processing else {
            return;
        };
        let minimum = processing.minimum_weight;
        match processing.weighting {
            Weighting::Given => {}
            Weighting::EachRun => self.weigh(run..run + 1, peaks, minimum, arrangement),
            Weighting::Joined => {
                let mut joined = [0.0; SENSORS];
                let found = self.peaks.iter().zip(&self.surveyed);
                for (peaks, _) in found.filter(|(_, surveyed)| **surveyed) {
                    join_peaks(&mut joined, peaks);
                }
                self.weigh(0..arrangement.runs(), &joined, minimum, arrangement);
            }
        }
    }

    /// Sets the weights of `runs` from peaks by sensor number.
    fn weigh(
        &mut self,
        runs: Range<usize>,
        peaks: &[f64; SENSORS],
        minimum: f64,
        arrangement: &Arrangement,
    ) {
        let mut list: heapless::Vec<f64, SENSORS> = arrangement
            .accelerometers()
            .filter_map(|s| peaks.get(s).copied())
            .collect();
        weights_from_peaks(&mut list, minimum);
        let mut weights = [1.0; SENSORS];
        for (sensor, weight) in arrangement.accelerometers().zip(list) {
            if let Some(slot) = weights.get_mut(sensor) {
                *slot = weight;
            }
        }
        for run in runs {
            if let (Some(slot), Some(known)) =
                (self.weights.get_mut(run), self.weighted.get_mut(run))
            {
                *slot = weights;
                *known = true;
            }
        }
    }
}

//! Runs whose drives explain little of what the accelerations explain.

use super::MeasureError;
use super::drives::DrivesAverage;
use super::geometry::{RunGeometry, channel_names};
use super::stream::stream;
use crate::setup::{Run, Setup};
use massline_core::geometry::{RESULTANT_NAMES, RESULTANTS};
use massline_core::spectra::{Average, BlockSettings, LineRange};

/// A run whose drives may explain little of it.
pub(super) struct Unexplained<'a> {
    pub(super) setup: &'a Setup,
    pub(super) run: &'a Run,
    pub(super) geometry: &'a RunGeometry,
    pub(super) settings: &'a BlockSettings,
    pub(super) band: LineRange,
    pub(super) coherence: &'a [[f32; RESULTANTS]],
    /// Columns of the recording that nothing reads.
    pub(super) unused: &'a str,
}

/// Share of a resultant's power below which its drives explain little of it.
const LITTLE: f64 = 0.5;
/// Share from which the accelerations explain it nevertheless.
const MOVED: f64 = 0.9;

impl Unexplained<'_> {
    /// A warning where the drives explain little of forces that the accelerations do explain:
    /// something else has moved the table. The recording is read once more only where the first
    /// of the two is so.
    pub(super) fn warning(&self, limit: Option<u64>) -> Result<Option<String>, MeasureError> {
        let mean = |c: usize| {
            let lines = self.coherence.get(self.band.indices()).unwrap_or_default();
            lines.iter().map(|l| f64::from(l[c])).sum::<f64>() / lines.len().max(1) as f64
        };
        let little = |c: &usize| mean(*c) < LITTLE && self.geometry.equations.measured(c - 6) > 0.5;
        let suspects: Vec<usize> = (6..RESULTANTS).filter(little).collect();
        if suspects.is_empty() {
            return Ok(None);
        }
        let names = channel_names(self.setup, self.run);
        let mut recording = self.setup.open_recording(self.run, &names)?;
        recording.limit(limit);
        recording.settle_rate(self.setup.processing.as_ref().and_then(|p| p.sample_rate))?;
        // The six accelerations in place of the drives.
        let mut average = DrivesAverage::new(self.settings, 6, 6);
        let resultants = |sample: &[f32], into: &mut [f32]| {
            into.copy_from_slice(&self.geometry.resultants(sample));
        };
        stream(
            &mut recording,
            self.settings,
            &[],
            RESULTANTS,
            &resultants,
            &mut average,
            &mut |_| {},
            &mut |_| {},
        )?;
        if average.blocks() < 12 {
            // Six accelerations explain anything in so few blocks.
            return Ok(None);
        }
        let parts = average.parts(self.band.indices());
        let moved = |c: &&usize| {
            let lines = parts.coherence.get(self.band.indices()).unwrap_or_default();
            lines.iter().map(|l| l[**c - 6]).sum::<f64>() > MOVED * lines.len() as f64
        };
        let driven_otherwise: Vec<&str> = suspects
            .iter()
            .filter(moved)
            .map(|&c| RESULTANT_NAMES[c - 6])
            .collect();
        if driven_otherwise.is_empty() {
            return Ok(None);
        }
        let named = self.run.references.join(", ");
        let advice = if self.unused.is_empty() {
            "record the other drives' signals, or leave `reference` out".to_owned()
        } else {
            format!(
                "name every drive, as in `reference = [\"a\", \"b\"]`; columns that nothing reads yet: {}",
                self.unused
            )
        };
        Ok(Some(format!(
            "run \"{}\": `reference` ({named}) explains less than half of {}, which the accelerations explain: something else moves the table, too, and what it moves is thrown away as noise; {advice}",
            self.run.name,
            driven_otherwise.join(", ")
        )))
    }
}

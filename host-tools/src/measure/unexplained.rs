//! Runs whose drives explain little of what the accelerations explain.

use super::drives::DrivesAverage;
use super::geometry::RunGeometry;
use crate::setup::Run;
use massline_core::geometry::{RESULTANT_NAMES, RESULTANTS};
use massline_core::spectra::{Average, LineRange};

/// A run whose drives may explain little of it.
pub(super) struct Unexplained<'a> {
    pub(super) run: &'a Run,
    pub(super) geometry: &'a RunGeometry,
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
    /// A warning where the drives explain little of forces that the accelerations do explain, by sums that have the six
    /// accelerations in place of drives and whose first channels are the forces, over the averaging band:
    /// something else has moved the table.
    pub(super) fn warning(&self, average: &DrivesAverage) -> Option<String> {
        let mean = |c: usize| {
            let lines = self.coherence.get(self.band.indices()).unwrap_or_default();
            lines.iter().map(|l| f64::from(l[c])).sum::<f64>() / lines.len().max(1) as f64
        };
        let little = |c: &usize| mean(*c) < LITTLE && self.geometry.equations.measured(c - 6) > 0.5;
        let suspects: Vec<usize> = (6..RESULTANTS).filter(little).collect();
        if suspects.is_empty() {
            return None;
        }
        if average.blocks() < 12 {
            // Six accelerations explain anything in so few blocks.
            return None;
        }
        let lines = average.parts(0..self.band.indices().len()).coherence;
        let moved =
            |c: &&usize| lines.iter().map(|l| l[**c - 6]).sum::<f64>() > MOVED * lines.len() as f64;
        let driven_otherwise: Vec<&str> = suspects
            .iter()
            .filter(moved)
            .map(|&c| RESULTANT_NAMES[c - 6])
            .collect();
        if driven_otherwise.is_empty() {
            return None;
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
        Some(format!(
            "run \"{}\": `reference` ({named}) explains less than half of {}, which the accelerations explain: something else moves the table, too, and what it moves is thrown away as noise; {advice}",
            self.run.name,
            driven_otherwise.join(", ")
        ))
    }
}

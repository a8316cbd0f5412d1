//! Recordings through blocks into averages.

use super::MeasureError;
use super::rejected::{Gate, Rejected};
use crate::recording::Recording;
use massline_core::spectra::{Average, BlockSettings, Blocks, Complex32};

/// Rows between two reports of progress.
const REPORT_ROWS: u64 = 4096;

/// Streams a recording through blocks into an average. `transform` turns a sample of all
/// channels into the `channels` numbers that are averaged; the drives, whose columns are given,
/// come before them. A block with a faulty sample goes nowhere, and `watch` sees
/// good samples only.
#[allow(clippy::too_many_arguments)]
pub(super) fn stream(
    recording: &mut Recording,
    settings: &BlockSettings,
    drives: &[usize],
    channels: usize,
    transform: &dyn Fn(&[f32], &mut [f32]),
    average: &mut dyn Average,
    watch: &mut dyn FnMut(&[f32]),
    progress: &mut dyn FnMut(f64),
) -> Result<Rejected, MeasureError> {
    let lead = drives.len();
    let zero = Complex32::new(0.0, 0.0);
    let mut history = vec![0.0; settings.history_len(lead + channels)];
    let mut work = vec![zero; settings.block_length()];
    let mut lines = vec![zero; settings.lines_len(lead + channels)];
    let blocks = Blocks::new(
        *settings,
        lead + channels,
        &mut history,
        &mut work,
        &mut lines,
    );
    let mut blocks = blocks.map_err(|source| MeasureError::Spectra {
        file: recording.file().to_owned(),
        source,
    })?;
    let mut sample = vec![0.0_f32; recording.channels()];
    let mut input = vec![0.0_f32; lead + channels];
    let mut gate = Gate::new(settings);
    while recording.next_row(&mut sample)? {
        gate.sample(recording.health());
        if recording.health().is_good() {
            watch(&sample);
        }
        let (head, tail) = input.split_at_mut(lead);
        for (slot, at) in head.iter_mut().zip(drives) {
            *slot = sample.get(*at).copied().unwrap_or(0.0);
        }
        transform(&sample, tail);
        if let Some(block) = blocks.push(&input)
            && gate.admits()
        {
            average.add(&block);
        }
        if recording.rows().is_multiple_of(REPORT_ROWS) {
            progress(recording.progress());
        }
    }
    Ok(gate.rejected)
}

//! Recordings through blocks into averages.

use super::geometry::RunGeometry;
use super::rejected::{Gate, Rejected};
use super::{BlockStorage, MeasureError};
use crate::recording::Recording;
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{BlockSettings, BlockSpectra};

/// Rows between two reports of progress.
const REPORT_ROWS: u64 = 4096;

/// A consumer of a recording: channels made of each sample, and their spectra block by block.
pub(super) trait Sink {
    /// Number of channels, behind the drives.
    fn channels(&self) -> usize;

    /// Geometry of the resultants that are among its channels.
    fn geometry(&self) -> Option<&RunGeometry>;

    /// Turns a sample of all channels of the recording, and its resultants by that geometry, into this consumer's
    /// channels.
    fn transform(&self, sample: &[f32], resultants: &[f32; RESULTANTS], into: &mut [f32]);

    /// Takes a block without faults: the drives, then the channels.
    fn add(&mut self, block: &BlockSpectra<'_>);
}

/// Streams a recording through blocks into all of its consumers, in one pass. The drives, whose columns
/// are given, come first in the blocks. A block with a faulty sample goes nowhere, and `watch` sees
/// good samples only.
pub(super) fn stream(
    recording: &mut Recording,
    settings: &BlockSettings,
    drives: &[usize],
    sinks: &mut [&mut dyn Sink],
    watch: &mut dyn FnMut(&[f32]),
    progress: &mut dyn FnMut(f64),
) -> Result<Rejected, MeasureError> {
    let lead = drives.len();
    let store = |sink: &&mut dyn Sink| {
        let channels = lead + sink.channels();
        (channels, BlockStorage::new(*settings, channels))
    };
    let mut stores: Vec<_> = sinks.iter().map(store).collect();
    let mut feeds = Vec::with_capacity(stores.len());
    for ((channels, storage), sink) in stores.iter_mut().zip(sinks) {
        let blocks = storage.blocks().map_err(|source| MeasureError::Spectra {
            file: recording.file().to_owned(),
            source,
        })?;
        feeds.push((blocks, vec![0.0_f32; *channels], sink));
    }
    // A consumer of the geometry of the one before it shares its resultants.
    let is_new: Vec<bool> = (0..feeds.len())
        .map(|i| {
            let of = |i: usize| feeds.get(i).and_then(|(.., sink)| sink.geometry());
            let before = i.checked_sub(1).and_then(of);
            !matches!((before, of(i)), (Some(a), Some(b)) if std::ptr::eq(a, b))
        })
        .collect();
    let mut resultants = [0.0; RESULTANTS];
    let mut sample = vec![0.0_f32; recording.channels()];
    let mut gate = Gate::new(settings);
    while recording.next_row(&mut sample)? {
        gate.sample(recording.health());
        if recording.health().is_good() {
            watch(&sample);
        }
        // All complete their blocks with the same sample.
        let mut admitted = None;
        for ((blocks, input, sink), is_new) in feeds.iter_mut().zip(&is_new) {
            if let Some(geometry) = sink.geometry().filter(|_| *is_new) {
                resultants = geometry.resultants(&sample);
            }
            let (head, tail) = input.split_at_mut(lead);
            for (slot, at) in head.iter_mut().zip(drives) {
                *slot = sample.get(*at).copied().unwrap_or(0.0);
            }
            sink.transform(&sample, &resultants, tail);
            if let Some(block) = blocks.push(input)
                && *admitted.get_or_insert_with(|| gate.admits())
            {
                sink.add(&block);
            }
        }
        if recording.rows().is_multiple_of(REPORT_ROWS) {
            progress(recording.progress());
        }
    }
    Ok(gate.rejected)
}

//! Recordings to the box.

use super::{Flip, ReplayError};
use crate::device::{Client, Port};
use crate::measure::channel_names;
use crate::setup::Setup;
use massline_firmware::wire::{Gaps, Pass, Request, Source, Start, Summary};
use std::cell::Cell;

/// Data that all runs of a replay share.
pub(super) struct Feed<'s> {
    pub(super) setup: &'s Setup,
    /// Samples of each run; `None` for all there are.
    pub(super) limit: Option<u64>,
    pub(super) flip: Option<Flip>,
    /// Requests of samples that the box takes ahead.
    pub(super) window: u8,
}

impl Feed<'_> {
    /// Has the box take a run, from sample `from` on if it is at that one already. Tells
    /// `progress` the share of the recording.
    pub(super) fn run<P: Port>(
        &self,
        client: &mut Client<'_, P>,
        number: usize,
        pass: Pass,
        from: Option<u64>,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Summary, ReplayError> {
        let run = &self.setup.runs[number];
        let names = channel_names(self.setup, run);
        let mut recording = self.setup.open_recording(run, &names)?;
        recording.limit(self.limit);
        let rate = self.setup.processing.as_ref().and_then(|p| p.sample_rate);
        recording.settle_rate(rate)?;
        let mut index = 0;
        let read = Cell::new(0.0);
        let mut next = |sample: &mut [f32]| {
            let more = recording.next_row(sample)?;
            // The box has no other way to hear of it: what is no number is a faulty sample
            // that keeps its place in time.
            if !recording.health().is_good() {
                sample.fill(f32::NAN);
            }
            if let Some(flip) = &self.flip {
                flip.apply(number, index, sample);
            }
            index += 1;
            read.set(recording.progress());
            Ok(more)
        };
        match from {
            None => client.tell(&Request::Start(Start {
                run: number as u8,
                pass,
                source: Source::Host,
                gaps: Gaps::Refuse,
                limit: None,
            }))?,
            Some(from) => {
                let mut skipped = vec![0.0; names.len()];
                for sample in 0..from {
                    if !next(&mut skipped)? {
                        return Err(ReplayError::Beyond {
                            run: run.name.clone(),
                            found: from,
                            samples: sample,
                        });
                    }
                }
            }
        }
        let channels = names.len() as u8;
        let first = from.unwrap_or(0);
        client.stream(channels, first, self.window, &mut next, &mut |_| {
            progress(read.get());
        })?;
        Ok(client.stop()?)
    }
}

//! Recordings to the box, lines and weights back.

use super::{Flip, ReplayError};
use crate::device::{Client, ClientError, Port};
use crate::measure::channel_names;
use crate::setup::Setup;
use massline_firmware::wire::{
    Gaps, Line, Lines, Packed, Pass, ReadLines, Reply, Request, Source, Start, Summary, Weights,
};
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

/// The lines of a stored run.
pub(super) fn lines<P: Port>(
    client: &mut Client<'_, P>,
    run: usize,
    count: usize,
) -> Result<Vec<Line>, ClientError> {
    let mut all: Vec<Line> = Vec::with_capacity(count);
    while all.len() < count {
        let wanted = ReadLines {
            run: run as u8,
            first: all.len() as u16,
            count: (count - all.len()).min(Lines::FIT) as u16,
        };
        let some = client.ask(&Request::ReadLines(wanted), |reply| match reply {
            Reply::Lines(lines)
                if lines.first == wanted.first
                    && (1..=usize::from(wanted.count)).contains(&lines.lines.len()) =>
            {
                Some(lines.lines.iter().collect::<Vec<_>>())
            }
            _ => None,
        })?;
        all.extend(some);
    }
    Ok(all)
}

/// Peaks that the survey of a run found, one number a sensor.
pub(crate) fn peaks<P: Port>(
    client: &mut Client<'_, P>,
    run: usize,
) -> Result<Vec<f64>, ClientError> {
    client.ask(&Request::ReadPeaks(run as u8), |reply| match reply {
        Reply::Peaks(peaks) => Some(peaks.peaks.iter().collect()),
        _ => None,
    })
}

/// The weights of a run, one a sensor.
pub(crate) fn weights<P: Port>(
    client: &mut Client<'_, P>,
    run: usize,
) -> Result<Vec<f64>, ClientError> {
    client.ask(&Request::ReadWeights(run as u8), |reply| match reply {
        Reply::Weights(weights) => Some(weights.weights.iter().collect()),
        _ => None,
    })
}

/// Overrules the weights of a run, one a sensor, by those that the set-up gives by hand.
pub(crate) fn weigh_by_hand<P: Port>(
    client: &mut Client<'_, P>,
    setup: &Setup,
    number: usize,
    weights: &mut [f64],
) -> Result<(), ClientError> {
    let given = setup.runs.get(number).map(|run| &run.weights);
    let Some(given) = given.filter(|given| !given.is_empty()) else {
        return Ok(());
    };
    for (entry, weight) in setup.accelerometers.iter().zip(weights.iter_mut()) {
        if let Some(given) = given.get(&entry.channel) {
            *weight = *given;
        }
    }
    client.tell(&Request::SetWeights(Weights {
        run: number as u8,
        weights: Packed::new(weights),
    }))
}

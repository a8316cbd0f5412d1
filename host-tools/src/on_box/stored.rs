//! Results that a box has stored.

use crate::device::{Client, ClientError, Port};
use massline_firmware::wire::{Line, Lines, ReadLines, Reply, Request};

/// The lines of a stored run.
pub(crate) fn lines<P: Port>(
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

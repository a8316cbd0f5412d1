//! The passes of a test over the runs: surveys, weights, measurements.

use super::{Base, stored};
use crate::device::{Client, ClientError, Port};
use crate::setup::Setup;
use massline_firmware::wire::{Item, Packed, Pass, Problem, Refused, Request, Summary, Weights};

/// The end of a test from which the box gets its samples: recordings that are sent to it, or its
/// own inputs.
pub(crate) trait End<P: Port> {
    /// Error of a pass.
    type Error: From<ClientError>;

    /// Has the box take one pass over a run.
    ///
    /// # Errors
    /// If the samples do not come, or the box refuses them.
    fn pass(
        &mut self,
        client: &mut Client<'_, P>,
        run: usize,
        pass: Pass,
    ) -> Result<Summary, Self::Error>;

    /// The error of a survey that has no result.
    fn no_survey(&self, run: usize) -> Self::Error;
}

/// Has the box survey a run; the peaks that it found, one a sensor.
///
/// # Errors
/// The end's own; [`End::no_survey`] where the box has no result.
pub(crate) fn survey<P: Port, E: End<P>>(
    client: &mut Client<'_, P>,
    run: usize,
    end: &mut E,
) -> Result<Vec<f64>, E::Error> {
    end.pass(client, run, Pass::Survey)?;
    stored::peaks(client, run).map_err(|error| match error {
        ClientError::Refused(Refused {
            problem: Problem::Missing {
                item: Item::Survey, ..
            },
            ..
        }) => end.no_survey(run),
        error => error.into(),
    })
}

/// The weights of a run, one a sensor: the box's own, overruled by those that the set-up gives by
/// hand, of which the box is told. `None` where the base has no weights.
///
/// # Errors
/// [`ClientError`] if the box has none.
pub(crate) fn weigh<P: Port>(
    client: &mut Client<'_, P>,
    setup: &Setup,
    base: Base,
    run: usize,
) -> Result<Option<Vec<f64>>, ClientError> {
    if !base.is_weighted() {
        return Ok(None);
    }
    let mut weights = stored::weights(client, run)?;
    weigh_by_hand(client, setup, run, &mut weights)?;
    Ok(Some(weights))
}

/// Overrules the weights of a run, one a sensor, by those that the set-up gives by hand.
fn weigh_by_hand<P: Port>(
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

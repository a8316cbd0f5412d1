//! The method that is used: the one that is named, else the one that suits set-up and data best.

use super::{Answer, AnswerError, Choice, Likelihood, OnProgress, Session};
use crate::setup::{AccelerometerEntry, Mount, Setup};
use massline_core::masslines::Method;

/// Reason why the maximum likelihood fit is recommended.
pub const LIKELIHOOD_PASSES: &str =
    "its residuals are noise and its low lines agree, so that lines through the resonances count";

/// Most samples of all runs that are fitted without having been asked to: a minute of work.
const MOST_SAMPLES: u64 = 1 << 20;

/// The method that is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wanted {
    /// The recommended one.
    #[default]
    Recommended,
    /// Maximum likelihood.
    Likelihood,
    /// One of those that the box has, too.
    Band(Method),
}

/// The recommended method for a setup among those that the box has, too, and why it is.
#[must_use]
pub fn recommended(setup: &Setup) -> (Method, &'static str) {
    let interface = |m: &AccelerometerEntry| m.mount == Mount::Interface;
    if setup.accelerometers.iter().any(interface) {
        (
            Method::ApparentMass,
            "its base acceleration comes from the interface, so the structure's elasticity does not bias it",
        )
    } else {
        (
            Method::FreeResponsesSquared,
            "no accelerometer is marked `mount = \"interface\"`, which the apparent mass would need",
        )
    }
}

impl Session<'_> {
    /// The answer of the method that is wanted, with procedure and weights of `choice`. Recommended is the
    /// maximum likelihood fit where it suits the data and passes its tests, else the method of
    /// [`recommended`].
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn wanted_answer(
        &mut self,
        wanted: Wanted,
        choice: &Choice,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let method = match wanted {
            Wanted::Likelihood => return self.answer_by_likelihood(choice, progress),
            Wanted::Band(method) => Some(method),
            Wanted::Recommended => None,
        };
        let answer = self.answer(&Choice { method, ..*choice }, progress)?;
        if wanted != Wanted::Recommended || !suits(&answer, choice) {
            return Ok(answer);
        }
        let samples: u64 = answer.measurement.runs.iter().map(|r| r.samples).sum();
        if samples > MOST_SAMPLES {
            return Ok(Answer {
                likelihood: Some(Likelihood::stepped_back(format!(
                    "the runs have {samples} samples, and more than {MOST_SAMPLES} are fitted by `--method ml` only"
                ))),
                ..answer
            });
        }
        let mut answer = self.fitted(answer, progress)?;
        if answer.likelihood.as_ref().is_some_and(Likelihood::is_used) {
            answer.why = Some(LIKELIHOOD_PASSES);
        }
        Ok(answer)
    }
}

/// `true` if the maximum likelihood fit may better an answer: random runs alone, the interface's own
/// acceleration, nothing that contradicts a rigid body, and no steps of a reference point, which it does
/// without.
fn suits(answer: &Answer, choice: &Choice) -> bool {
    let measurement = &answer.measurement;
    let random = !measurement.runs.is_empty()
        && measurement.sines.is_empty()
        && measurement.poses.is_empty();
    random && answer.method == Method::ApparentMass && answer.refused.is_none() && !choice.iterative
}

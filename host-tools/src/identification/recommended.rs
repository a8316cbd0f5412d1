//! The method that is used: the one that is named, else the one that suits set-up and data best.

use super::consistency::WARNED;
use super::likelihood::{LeftOut, widest_band};
use super::{Answer, AnswerError, Choice, Likelihood, OnProgress, Session};
use crate::measure::{MeasuredRun, Measurement};
use crate::setup::{AccelerometerEntry, Mount, Setup};
use massline_core::masslines::Method;

/// Reason why the maximum likelihood fit is recommended.
pub const LIKELIHOOD_PASSES: &str =
    "its residuals are noise and its low lines agree, so that lines through the resonances count";

/// Most lines of all runs that are fitted without having been asked to: half a minute of a processor with four modes.
const MOST_LINES: f64 = 150_000.0;
/// Most samples of a run that are held in memory without having been asked to: 220 MB of one with a drive.
const MOST_SAMPLES: u64 = 1 << 22;

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
        if let Some(test) = answer.consistency
            && test.probability < WARNED
        {
            return Ok(Answer {
                likelihood: Some(Likelihood::stepped_back(format!(
                    "a rigid body leaves {:.1} times more in the averaging band than the noise explains, which more lines do not mend",
                    test.ratio.sqrt()
                ))),
                ..answer
            });
        }
        let mut answer = match quick(&answer.measurement, self.setup()) {
            Err(reason) => {
                return Ok(Answer {
                    likelihood: Some(Likelihood::stepped_back(reason)),
                    ..answer
                });
            }
            Ok(left_out) => self.fitted(answer, left_out, progress)?,
        };
        if answer.likelihood.as_ref().is_some_and(Likelihood::is_used) {
            answer.why = Some(LIKELIHOOD_PASSES);
        }
        Ok(answer)
    }
}

/// The lines that a fit leaves out to be quick, if any; otherwise the reason why none is.
fn quick(measurement: &Measurement, setup: &Setup) -> Result<Option<LeftOut>, String> {
    // A run with several drives has an average for each.
    let mut runs: Vec<&MeasuredRun> = measurement.runs.iter().collect();
    runs.dedup_by_key(|run| run.number);
    if let Some(run) = runs.iter().find(|run| run.samples > MOST_SAMPLES) {
        return Err(format!(
            "run \"{}\" has {} samples, and more than {MOST_SAMPLES} are fitted by `--method ml` only",
            run.name, run.samples
        ));
    }
    let seconds = runs.iter().map(|run| run.seconds()).sum();
    match (widest_band(setup), &setup.processing) {
        (Some(band), Some(p)) => within(band, p.averaging_band[1], seconds),
        _ => Ok(None),
    }
}

/// The same for lines in `band` (Hz) of records of `seconds` together, which are to reach beyond `averaged` (Hz).
fn within([low, high]: [f64; 2], averaged: f64, seconds: f64) -> Result<Option<LeftOut>, String> {
    let lines = (high - low) * seconds;
    if lines <= MOST_LINES {
        return Ok(None);
    }
    let reason =
        format!("they are {lines:.0}, and more than {MOST_LINES} are fitted by `--method ml` only");
    let beyond = low + MOST_LINES / seconds;
    if beyond > averaged {
        Ok(Some(LeftOut { beyond, reason }))
    } else {
        Err(format!("of the lines up to {high:.1} Hz {reason}"))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Model, Options, simulate};

    /// The fork with lines to 60 Hz of 195: a fit of those, sharper than the band's, that says so.
    #[test]
    fn lines_that_are_left_out_are_said() {
        let options = Options {
            noise: Some(0.01),
            duration: Some(20.0),
            ..Options::default()
        };
        let simulation = simulate(&Model::fork().unwrap(), &options, &mut |_| ()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = simulation.write(folder.path()).unwrap();
        let setup = Setup::read(&path).unwrap();
        let mut session = Session::new(&setup);
        let band = session.answer(&Choice::default(), &mut |_| ()).unwrap();
        let seconds: f64 = band.measurement.runs.iter().map(MeasuredRun::seconds).sum();
        assert!((seconds - 20.0 * setup.runs.len() as f64).abs() < 0.1);
        assert_eq!(quick(&band.measurement, &setup), Ok(None));
        let sharp = band.identification.mass.unwrap().std;
        let left_out = LeftOut {
            beyond: 60.0,
            reason: "of a reason".to_owned(),
        };
        let answer = session.fitted(band, Some(left_out), &mut |_| ()).unwrap();
        assert!(answer.likelihood.as_ref().unwrap().is_used());
        assert!(answer.identification.mass.unwrap().std < sharp);
        let fit = answer.likelihood.unwrap().fit.unwrap();
        assert!(fit.band[1] <= 60.0 && fit.band[1] > 59.9, "{:?}", fit.band);
        let highest = widest_band(&setup).unwrap()[1];
        let said = format!("method ml: lines up to {highest:.1} Hz were not used: of a reason");
        assert!(answer.warnings.contains(&said), "{:?}", answer.warnings);
    }

    /// Six minutes at 75 Hz are fitted whole, at whatever sample rate; an hour as far as its share of the lines goes;
    /// ten days not at all, since fewer lines than the averaging band's would be left.
    #[test]
    fn lines_are_what_makes_a_fit_slow() {
        assert_eq!(within([2.0, 75.0], 20.0, 360.0), Ok(None));
        assert_eq!(within([2.0, 75.0], 20.0, 150_000.0 / 73.0), Ok(None));
        let hour = within([2.0, 75.0], 20.0, 3600.0).unwrap().unwrap();
        assert!((hour.beyond - (2.0 + 150_000.0 / 3600.0)).abs() < 1e-9);
        assert_eq!(
            hour.reason,
            "they are 262800, and more than 150000 are fitted by `--method ml` only"
        );
        let days = within([2.0, 75.0], 20.0, 864_000.0).unwrap_err();
        assert!(days.starts_with("of the lines up to 75.0 Hz they are 63072000"));
    }
}

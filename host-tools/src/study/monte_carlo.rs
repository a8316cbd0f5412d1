//! The same rows under noise: root mean square errors over many draws.

use super::estimate::{Answer, Numbers, Outcome};
use super::fits::{self, Fits, Fitted};
use super::{NoiseKind, Options, Recordings, Responses, Row, StudyError, Twin};
use crate::parallel;
use serde::{Serialize, Serializer};

/// All rows at one level of noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Share of each channel's RMS over all runs. Zero: what the averaging of finite
    /// recordings does by itself.
    pub noise: f64,
    /// In the order of [`Row::all`].
    pub rows: Vec<RowErrors>,
    /// Maximum likelihood fits of the first draws; `None` without noise, and where none were wanted.
    pub fits: Option<Fits>,
}

/// Errors of one row over the draws.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RowErrors {
    /// Solved once at A.
    pub direct: Errors,
    /// With A moved to S.
    pub iterative: Errors,
}

/// Relative errors over the draws, per cent, in the order of [`Numbers`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Root mean square; not a number where no draw gave an answer.
    #[serde(rename = "rms_percent", serialize_with = "by_name")]
    pub rms: [f64; Numbers::COUNT],
    /// Mean: the systematic part.
    #[serde(rename = "mean_percent", serialize_with = "by_name")]
    pub mean: [f64; Numbers::COUNT],
    /// Draws that gave an answer.
    pub answered: usize,
    /// Draws that gave none.
    pub failed: usize,
    /// Why the first of them gave none.
    pub reason: Option<String>,
}

pub(super) fn by_name<S: Serializer>(
    list: &[f64; Numbers::COUNT],
    to: S,
) -> Result<S::Ok, S::Error> {
    Numbers::from(*list).serialize(to)
}

/// Told now and then which share of all draws is done.
pub type OnProgress<'a> = &'a mut dyn FnMut(f64);

/// Levels 0 and those of the options, each with all its draws. Draws run on all
/// processors; a draw depends on its seed alone, so that the result does not.
///
/// # Errors
/// [`StudyError`] if the options do not suit the recordings.
pub fn levels(options: &Options, progress: OnProgress<'_>) -> Result<Vec<Level>, StudyError> {
    let twin = Twin::new(options, options.noise_rotation)?;
    let exact = Responses::exact(&twin, options);
    let mut shares = vec![0.0];
    shares.extend(&options.noise);
    let draws = options.draws.max(1);
    let count = shares.len() * draws;
    let draw = |job: usize| -> Result<(Vec<Answer>, Option<Fitted>), StudyError> {
        let (level, number) = (shares[job / draws], job % draws);
        let seed = options.seed.wrapping_add(number as u64);
        let recorded = options.noise_kind == NoiseKind::Recordings;
        // Without noise there is nothing that a misfit could be weighed by.
        let fitted = if recorded && level > 0.0 && number < options.fits.unwrap_or(draws) {
            Some(fits::fitted(&twin, options, level, seed)?)
        } else {
            None
        };
        let answers = match options.noise_kind {
            NoiseKind::Recordings => {
                Recordings::simulate(&twin, options, level, seed)?.answers(&twin, options)
            }
            NoiseKind::Responses if level == 0.0 => exact.answers(&twin, options),
            NoiseKind::Responses => exact.with_noise(level, seed).answers(&twin, options),
        }?;
        Ok((answers, fitted))
    };
    let (found, _) = parallel::each(count, None, &draw, &mut |done, _| {
        progress(done as f64 / count as f64);
    })?;
    let exact = Numbers::exact(&twin);
    let levels = shares
        .iter()
        .zip(found.chunks(draws))
        .map(|(&noise, draws)| Level {
            noise,
            fits: {
                let fitted = draws.iter().filter_map(|(_, fitted)| fitted.clone());
                let fitted: Vec<Fitted> = fitted.collect();
                (!fitted.is_empty()).then(|| Fits::over(&fitted, &exact))
            },
            rows: (0..Row::all().len())
                .map(|row| {
                    let answers = || draws.iter().filter_map(|(answers, _)| answers.get(row));
                    RowErrors {
                        direct: Errors::over(answers().map(|a| &a.direct), &exact),
                        iterative: Errors::over(answers().map(|a| &a.iterative), &exact),
                    }
                })
                .collect(),
        });
    Ok(levels.collect())
}

impl Errors {
    pub(super) fn over<'a>(outcomes: impl Iterator<Item = &'a Outcome>, exact: &Numbers) -> Self {
        let mut errors = Self::default();
        for outcome in outcomes {
            match outcome {
                Ok(solution) => {
                    errors.answered += 1;
                    let of_draw = solution.numbers.errors(exact);
                    for (i, e) in of_draw.into_iter().enumerate() {
                        errors.rms[i] += e * e;
                        errors.mean[i] += e;
                    }
                }
                Err(reason) => {
                    errors.failed += 1;
                    errors.reason.get_or_insert_with(|| reason.clone());
                }
            }
        }
        // Zero over zero is not a number, which is what it should be.
        let count = errors.answered as f64;
        errors.rms = errors.rms.map(|sum| (sum / count).sqrt());
        errors.mean = errors.mean.map(|sum| sum / count);
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::super::estimate::Solution;
    use super::*;

    #[test]
    fn errors_over_draws_are_rms_and_mean_of_those_that_answered() {
        let exact = Numbers {
            x: 1.0,
            z: 2.0,
            theta_a: 1.0,
            theta_s: 1.0,
            indicator: 1.0,
        };
        let draw = |x: f64| {
            Ok(Solution {
                numbers: Numbers { x, ..exact },
                iterations: 1,
            })
        };
        let outcomes: [Outcome; 3] = [draw(1.03), draw(0.99), Err("no mode".to_owned())];
        let errors = Errors::over(outcomes.iter(), &exact);
        // +3 % and -1 %: √5 and 1.
        assert!((errors.rms[0] - 5.0_f64.sqrt()).abs() < 1e-12);
        assert!((errors.mean[0] - 1.0).abs() < 1e-12);
        assert_eq!((errors.answered, errors.failed), (2, 1));
        assert_eq!(errors.reason.as_deref(), Some("no mode"));
        assert!(Errors::over([].iter(), &exact).rms[0].is_nan());
    }
}

//! The same rows under noise: root mean square errors over many draws.

use super::errors::Errors;
use super::estimate::{Answer, Numbers};
use super::fits::{self, Fits, Fitted};
use super::{NoiseKind, Options, Recordings, Responses, Row, StudyError, Twin};
use crate::parallel;
use serde::Serialize;

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

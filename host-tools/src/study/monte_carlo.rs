//! The same rows under noise: root mean square errors over many draws.

use super::estimate::{Answer, Numbers, Outcome};
use super::{NoiseKind, Options, Recordings, Responses, Row, StudyError, Twin};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// All rows at one level of noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Share of each channel's RMS over all runs. Zero: what the averaging of finite
    /// recordings does by itself.
    pub noise: f64,
    /// In the order of [`Row::all`].
    pub rows: Vec<RowErrors>,
}

/// Errors of one row over the draws.
#[derive(Clone, Debug, PartialEq)]
pub struct RowErrors {
    /// Solved once at A.
    pub direct: Errors,
    /// With A moved to S.
    pub iterative: Errors,
}

/// Relative errors over the draws, per cent, in the order of [`Numbers`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// Root mean square; not a number where no draw gave an answer.
    pub rms: [f64; Numbers::COUNT],
    /// Mean: the systematic part.
    pub mean: [f64; Numbers::COUNT],
    /// Draws that gave an answer.
    pub answered: usize,
    /// Draws that gave none.
    pub failed: usize,
    /// Why the first of them gave none.
    pub reason: Option<String>,
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
    let jobs: Vec<(usize, u64)> = (0..shares.len())
        .flat_map(|level| (0..options.draws as u64).map(move |draw| (level, draw)))
        .collect();
    let draw = |level: f64, seed: u64| match options.noise_kind {
        NoiseKind::Recordings => {
            Recordings::simulate(&twin, options, level, seed)?.answers(&twin, options)
        }
        NoiseKind::Responses if level == 0.0 => exact.answers(&twin, options),
        NoiseKind::Responses => exact.with_noise(level, seed).answers(&twin, options),
    };
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let mut found: Vec<Vec<Option<Vec<Answer>>>> = vec![vec![None; options.draws]; shares.len()];
    std::thread::scope(|scope| {
        for _ in 0..workers.min(jobs.len()) {
            let (sender, next, jobs, shares, draw) = (sender.clone(), &next, &jobs, &shares, &draw);
            scope.spawn(move || {
                while let Some(&(level, number)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let answers = draw(shares[level], options.seed.wrapping_add(number));
                    // Nobody listens any more after a failure elsewhere.
                    if sender.send((level, number as usize, answers)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for (done, (level, number, answers)) in receiver.iter().enumerate() {
            found[level][number] = Some(answers?);
            progress((done + 1) as f64 / jobs.len() as f64);
        }
        Ok::<(), StudyError>(())
    })?;
    let exact = Numbers::exact(&twin);
    let levels = shares.iter().zip(&found).map(|(&noise, draws)| Level {
        noise,
        rows: (0..Row::all().len())
            .map(|row| {
                let answers = || draws.iter().flatten().filter_map(|a| a.get(row));
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
    fn over<'a>(outcomes: impl Iterator<Item = &'a Outcome>, exact: &Numbers) -> Self {
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

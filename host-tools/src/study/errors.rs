//! Root mean square and mean errors over draws.

use super::estimate::{Numbers, Outcome};
use serde::{Serialize, Serializer};

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

fn by_name<S: Serializer>(list: &[f64; Numbers::COUNT], to: S) -> Result<S::Ok, S::Error> {
    Numbers::from(*list).serialize(to)
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

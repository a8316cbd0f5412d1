//! Chapter 7: how much each accelerometer counts.

use super::{AnswerError, OnProgress, Session};
use crate::measure::Accelerations;
use massline_core::masslines::Method;

impl Session<'_> {
    /// Weights by the strategy of chapter 7, overruled by those given by hand.
    pub(super) fn weighted(
        &mut self,
        method: Method,
        warnings: &mut Vec<String>,
        progress: OnProgress<'_>,
    ) -> Result<Accelerations, AnswerError> {
        let by_hand = self.setup.runs.iter().any(|r| !r.weights.is_empty());
        let mode_band = self.setup.processing.as_ref().and_then(|p| p.mode_band);
        let mut weights = match mode_band {
            Some(band) => {
                let survey = self.survey(progress)?;
                let key = "mode_band";
                let minimum = self.setup.estimation.minimum_weight;
                if survey.runs.is_empty() {
                    None
                } else {
                    let lines = survey.lines(band);
                    let lines = lines.map_err(|source| AnswerError::Band { key, source })?;
                    Some(if method == Method::FrequencyResponses {
                        survey.weights_per_run(self.setup, lines, minimum)
                    } else {
                        survey.weights_joined(self.setup, lines, minimum)
                    })
                }
            }
            None => {
                warnings.push(
                    "all accelerometers weigh alike: give `mode_band`, where the structure first rings, to weigh them by how much they see of it".to_owned(),
                );
                None
            }
        };
        if by_hand {
            let alike = || vec![vec![1.0; self.setup.accelerometers.len()]; self.setup.runs.len()];
            let all = weights.get_or_insert_with(alike);
            for (run, weights) in self.setup.runs.iter().zip(all) {
                for (entry, weight) in self.setup.accelerometers.iter().zip(weights) {
                    if let Some(given) = run.weights.get(&entry.channel) {
                        *weight = *given;
                    }
                }
            }
        }
        Ok(Accelerations::All(weights))
    }
}

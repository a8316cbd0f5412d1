//! The answer of the box, and the result document made of it.

use crate::frame::Frame;
use crate::identification::{Consistency, Judged, refusal};
use crate::measure::blocks_by_word;
use crate::recording::{Traceability, TrueRate};
use crate::result::{Origin, ResultDocument, RunQuality};
use massline_core::masslines::Method;
use massline_firmware::wire::{Answer, Summary};
use std::collections::BTreeMap;

/// Answer of a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Method of the identification.
    pub method: Method,
    /// `true` if accelerometers were weighted.
    pub weighted: bool,
    /// `true` if the reference point was iterated to the CG.
    pub iterative: bool,
    /// The ten numbers, and the question that they answer.
    pub answer: Answer,
    /// Computing time by the clock of the box, s.
    pub seconds: f64,
    /// The runs behind the answer.
    pub runs: Vec<StoredRun>,
    /// Names of the runs of the set-up that the box does not hold.
    pub unmeasured: Vec<String>,
}

/// A run that the box has measured.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRun {
    /// Name of the run.
    pub name: String,
    /// Summary of the box.
    pub summary: Summary,
    /// Calibrations of its channels, by channel.
    pub calibration: BTreeMap<String, Traceability>,
}

impl StoredRun {
    /// Sample rate by the clock of the box. Converters that are restarted leave their grid by half
    /// a
    /// period at most at either end, so that the rate is uncertain by one sample of the run.
    #[must_use]
    pub fn sample_rate(&self) -> Option<TrueRate> {
        let value = self.summary.sample_rate?;
        let samples = self.summary.samples + self.summary.missing;
        Some(TrueRate {
            value,
            uncertainty: value / samples.max(1) as f64,
            clock: "box".to_owned(),
        })
    }

    /// Samples and blocks of the run, for the result document.
    fn quality(&self) -> RunQuality {
        let s = &self.summary;
        RunQuality {
            run: self.name.clone(),
            samples: s.samples,
            blocks: s.blocks,
            rejected: s.rejected,
            rejected_by: blocks_by_word(s.rejected_by),
            faulty_samples: None,
            missing_samples: s.missing,
            true_sample_rate: self.sample_rate(),
            calibration: self.calibration.clone(),
        }
    }
}

impl Found {
    /// Reason to reject the numbers, and advice; `None` if they are accepted.
    #[must_use]
    pub fn refused(&self) -> Option<String> {
        refusal(&self.judged()).map(|refused| refused.to_string())
    }

    /// Grounds on which the answer is refused or warned of.
    pub(crate) fn judged(&self) -> Judged<'_> {
        let identification = &self.answer.identification;
        Judged {
            identification,
            type_b: None,
            // The box does not send its masslines.
            consistency: Consistency::bound(identification),
            widened: true,
        }
    }

    /// The result document in a frame, without the parts that a box does not send.
    #[must_use]
    pub fn document(
        &self,
        title: &str,
        why: Option<&'static str>,
        frame: Option<&Frame>,
    ) -> ResultDocument {
        let origin = Origin {
            title,
            method: self.method.name(),
            why,
            iterative: self.iterative,
            weighted: self.weighted,
        };
        ResultDocument {
            refused: self.refused(),
            runs: self.runs.iter().map(StoredRun::quality).collect(),
            ..ResultDocument::in_frame(&origin, &self.answer.identification, frame)
        }
    }
}

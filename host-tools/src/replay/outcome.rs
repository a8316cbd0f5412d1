//! Outcome of a replay.

use super::Comparison;
use crate::device::{BoxInfo, LinkReport};
use crate::on_box::Base;
use massline_core::masslines::Method;

/// Outcome of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The box that was asked.
    pub device: BoxInfo,
    /// Samples of each run, if not all.
    pub limit: Option<u64>,
    /// Comparisons, base by base.
    pub bases: Vec<BaseOutcome>,
    /// Frames of the link.
    pub link: LinkReport,
}

impl Outcome {
    /// `true` if all that was compared is the same.
    #[must_use]
    pub fn identical(&self) -> bool {
        !self.bases.is_empty() && self.comparisons().all(|(_, c)| c.identical())
    }

    /// All that was compared, each with what it is about.
    pub fn comparisons(&self) -> impl Iterator<Item = (String, &Comparison)> {
        self.bases.iter().flat_map(|b| {
            let grid = ("lines".to_owned(), &b.grid);
            let weights = b.weights.iter().map(|c| ("weights".to_owned(), c));
            let runs = b.runs.iter();
            let runs = runs.map(|r| (format!("run \"{}\"", r.name), &r.comparison));
            let answers = b.answers.iter();
            let answers = answers.map(|a| (a.method.name().to_owned(), &a.comparison));
            std::iter::once(grid)
                .chain(weights)
                .chain(runs)
                .chain(answers)
        })
    }
}

/// Runs that were measured alike, and the answers from them.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseOutcome {
    /// Origin of the base acceleration of the runs.
    pub base: Base,
    /// The lines that follow from the set-up.
    pub grid: Comparison,
    /// Peaks and weights of the surveys.
    pub weights: Option<Comparison>,
    /// The runs.
    pub runs: Vec<RunOutcome>,
    /// The answers.
    pub answers: Vec<AnswerOutcome>,
}

/// One run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunOutcome {
    /// Its name.
    pub name: String,
    /// Samples that the box took.
    pub samples: u64,
    /// Blocks that it averaged.
    pub blocks: u32,
    /// Samples that the recording calls faulty.
    pub faulty: u64,
    /// Blocks that the box left out.
    pub rejected: u32,
    /// Lines compared.
    pub lines: usize,
    /// Samples, blocks, noise and lines.
    pub comparison: Comparison,
}

/// One method's answer.
#[derive(Clone, Debug, PartialEq)]
pub struct AnswerOutcome {
    /// The method.
    pub method: Method,
    /// Why neither side has an answer, if so.
    pub no_answer: Option<String>,
    /// Time that the box took, s, by its own clock.
    pub seconds: Option<f64>,
    /// The answer's numbers.
    pub comparison: Comparison,
}

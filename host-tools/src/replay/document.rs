//! The replay's document, `massline/replay/1`.

use super::{Comparison, Outcome};
use crate::device::BoxInfo;
use crate::result::DeviceEntry;
use serde::Serialize;

/// Version of the document's form.
pub const SCHEMA: &str = "massline/replay/1";

/// Outcome of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct ReplayDocument {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Title of the setup.
    pub title: String,
    /// `true` if all numbers are the same.
    pub identical: bool,
    /// The box that was asked.
    #[serde(rename = "box")]
    pub device: DeviceEntry,
    /// Samples of each run, if not all.
    pub samples_per_run: Option<u64>,
    /// Comparisons.
    pub compared: Vec<ComparisonEntry>,
    /// Frames of the link.
    pub link: LinkEntry,
}

impl From<&BoxInfo> for DeviceEntry {
    fn from(info: &BoxInfo) -> Self {
        Self {
            firmware: info.firmware.clone(),
            version: info.version.clone(),
            build: info.build.clone(),
            chip: info.chip.clone(),
        }
    }
}

/// Something that was compared.
#[derive(Clone, Debug, Serialize)]
pub struct ComparisonEntry {
    /// Accelerometers from which the base acceleration came.
    pub base: &'static str,
    /// `grid`, `weights`, `run` or `answer`.
    pub kind: &'static str,
    /// The run's or the method's name.
    pub name: Option<String>,
    /// Samples that the box took.
    pub samples: Option<u64>,
    /// Blocks that it averaged.
    pub blocks: Option<u32>,
    /// Samples that the recording calls faulty.
    pub faulty_samples: Option<u64>,
    /// Blocks that the box left out.
    pub rejected: Option<u32>,
    /// Lines that were compared.
    pub lines: Option<usize>,
    /// Time that the box took for the answer, s, by its own clock.
    pub seconds: Option<f64>,
    /// Why neither side has an answer.
    pub no_answer: Option<String>,
    /// Numbers compared.
    pub numbers: usize,
    /// Numbers that differ.
    pub different: usize,
    /// Place and bit patterns of the first difference.
    pub first: Option<String>,
}

impl ComparisonEntry {
    fn new(base: &'static str, kind: &'static str, comparison: &Comparison) -> Self {
        Self {
            base,
            kind,
            name: None,
            samples: None,
            blocks: None,
            faulty_samples: None,
            rejected: None,
            lines: None,
            seconds: None,
            no_answer: None,
            numbers: comparison.numbers,
            different: comparison.different,
            first: comparison.first.as_ref().map(ToString::to_string),
        }
    }
}

/// Frames of the link.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LinkEntry {
    /// Frames that were sent.
    pub sent: u32,
    /// Frames that were sent again.
    pub resent: u32,
    /// Frames that came.
    pub received: u32,
    /// Frames of the box that were lost.
    pub lost: u64,
}

impl ReplayDocument {
    /// The document of an outcome.
    #[must_use]
    pub fn new(title: &str, outcome: &Outcome) -> Self {
        let mut compared = Vec::new();
        for of_base in &outcome.bases {
            let entry = |kind, comparison| {
                ComparisonEntry::new(of_base.base.description(), kind, comparison)
            };
            compared.push(entry("grid", &of_base.grid));
            compared.extend(of_base.weights.iter().map(|c| entry("weights", c)));
            compared.extend(of_base.runs.iter().map(|run| ComparisonEntry {
                name: Some(run.name.clone()),
                samples: Some(run.samples),
                blocks: Some(run.blocks),
                faulty_samples: Some(run.faulty),
                rejected: Some(run.rejected),
                lines: Some(run.lines),
                ..entry("run", &run.comparison)
            }));
            compared.extend(of_base.answers.iter().map(|answer| ComparisonEntry {
                name: Some(answer.method.name().to_owned()),
                seconds: answer.seconds,
                no_answer: answer.no_answer.clone(),
                ..entry("answer", &answer.comparison)
            }));
        }
        Self {
            schema: SCHEMA,
            title: title.to_owned(),
            identical: outcome.identical(),
            device: (&outcome.device).into(),
            samples_per_run: outcome.limit,
            compared,
            link: LinkEntry {
                sent: outcome.link.sent,
                resent: outcome.link.resent,
                received: outcome.link.received.frames,
                lost: outcome.link.received.lost,
            },
        }
    }
}

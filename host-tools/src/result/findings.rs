//! Findings of the examination of the sensors, as a part of the document.

use crate::detective::{Explanation, Fault, Findings, WholeFault};
use crate::setup::Setup;
use serde::{Deserialize, Serialize};

/// One explanation of what the data contradict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExplanationDocument {
    /// Channels that have the fault; empty where all sensors share it.
    pub sensors: Vec<String>,
    /// Kind of the fault in one word.
    pub fault: String,
    /// The fault in words.
    pub text: String,
    /// Lines of the setup that mend it; empty where none do.
    pub repair: Vec<String>,
}

/// A fault of the setup, or several of which the data do not tell which one it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FindingDocument {
    /// The best explanation.
    #[serde(flatten)]
    pub explanation: ExplanationDocument,
    /// Explanations that are as good.
    pub ties: Vec<ExplanationDocument>,
    /// The evidence in words.
    pub evidence: String,
}

impl Fault {
    /// The kind in one word, as documents have it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Inverted { .. } => "inverted",
            Self::Factor { .. } => "factor",
            Self::Swapped { .. } => "exchanged",
            Self::PlacesExchanged { .. } => "places-exchanged",
            Self::Turned { .. } => "turned",
            Self::Position { .. } => "position",
            Self::Gain { .. } => "gain",
            Self::CrossTalk { .. } => "cross-talk",
            Self::Dead { .. } => "dead",
            Self::Delayed { .. } => "delayed",
            Self::Reversed { .. } => "all-reversed",
            Self::Unit { .. } => "unit-of-all",
            Self::Datum { .. } => "datum",
            Self::Unlisted { .. } => "unlisted",
        }
    }
}

fn names(setup: &Setup, channels: &[usize]) -> Vec<String> {
    let all: Vec<&str> = setup.sensor_channels().collect();
    let name = |c: &usize| all.get(*c).map(|name| (*name).to_owned());
    channels.iter().filter_map(name).collect()
}

fn explanation(setup: &Setup, found: &Explanation) -> ExplanationDocument {
    ExplanationDocument {
        sensors: names(setup, &found.fault.channels()),
        fault: found.fault.name().to_owned(),
        text: found.text.clone(),
        repair: found.repair.clone(),
    }
}

/// The findings of a setup as a part of its result.
#[must_use]
pub fn findings(setup: &Setup, found: &Findings) -> Vec<FindingDocument> {
    let mut all = Vec::new();
    for suspect in &found.suspects {
        let mut explanations = suspect.explanations.iter().map(|e| explanation(setup, e));
        if let Some(best) = explanations.next() {
            all.push(FindingDocument {
                explanation: best,
                ties: explanations.collect(),
                evidence: found.evidence(),
            });
        }
    }
    let whole = found.whole.iter().filter(|w| w.fault != WholeFault::NoUnit);
    all.extend(whole.map(|w| FindingDocument {
        explanation: ExplanationDocument {
            sensors: names(setup, &w.channels),
            fault: w.fault.name().to_owned(),
            text: w.text.clone(),
            repair: w.repair.clone(),
        },
        ties: Vec::new(),
        evidence: w.text.clone(),
    }));
    if found.suspects.is_empty() && found.more_is_wrong() {
        all.push(FindingDocument {
            explanation: ExplanationDocument {
                sensors: Vec::new(),
                fault: "more-is-wrong".to_owned(),
                text: "the sensors contradict each other, and no single fault explains it"
                    .to_owned(),
                repair: Vec::new(),
            },
            ties: Vec::new(),
            evidence: found.evidence(),
        });
    }
    all
}

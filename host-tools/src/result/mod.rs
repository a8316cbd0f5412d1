//! The result document, `massline/result/2`: an answer in numbers and words, of which the
//! terminal's table, the JSON document, the numbers of the report and all exports are made.
//!
//! | file | holds |
//! | --- | --- |
//! | `document` | the form of the document |
//! | `findings` | what the recordings contradict in the setup |
//! | `number` | a number with its error bar |
//! | `answer` | the document of an answer |
//! | `framed` | numbers and covariances in the frame that a setup states |
//! | `property` | the numbers of a document by name, with their units |
//! | `read` | reading a document back |

mod answer;
mod document;
mod findings;
mod framed;
mod number;
mod property;
mod read;
#[cfg(test)]
pub(crate) mod tests;

pub use answer::Origin;
pub use document::{
    ComparisonDocument, ConsistencyDocument, CovarianceDocument, Deflection, DeviceEntry,
    FailedMethod, FixedModeDocument, FreeModeDocument, LikelihoodDocument, LikelihoodMode,
    NoiseDocument, Offsets, Plausible, RejectedBand, ResultDocument, RunQuality,
};
pub use findings::{ExplanationDocument, FindingDocument, findings};
pub use number::{CombinedDocument, InertiaTerms, Number, TypeBDocument};
pub use property::{About, Property};
pub use read::ReadError;

/// Version of the document's form.
pub const SCHEMA: &str = "massline/result/2";
/// Version of the form of several methods side by side.
pub const COMPARISON_SCHEMA: &str = "massline/comparison/1";

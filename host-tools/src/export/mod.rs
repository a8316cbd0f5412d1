//! Result exports: one file a format, behind the trait [`Export`].
//!
//! A new format is a file in this folder with a type that implements [`Export`], its two lines in
//! this one (`mod` and [`FORMATS`]) and its row in the manual. The command, its help and its
//! completions read the list.

mod csv;
mod json;

use crate::result::ResultDocument;
use std::io::{self, Write};

/// A format that results are exported to.
pub trait Export: Sync {
    /// Name of the format, as `--to` has it.
    fn name(&self) -> &'static str;

    /// Content of a file of this format, in a few words.
    fn description(&self) -> &'static str;

    /// Ending of the names of such files, without its point.
    fn extension(&self) -> &'static str;

    /// Writes a result.
    ///
    /// # Errors
    /// [`ExportError::Unsuitable`] if the format cannot hold this result,
    /// [`ExportError::Write`] if the writer fails.
    fn write(&self, result: &ResultDocument, out: &mut dyn Write) -> Result<(), ExportError>;
}

/// All formats, in the order in which the help lists them.
pub const FORMATS: [&dyn Export; 2] = [&json::Json, &csv::Csv];

/// Reason why a result is not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The format cannot hold this result, as where it needs a number that the test does not
    /// determine.
    #[error("{reason}")]
    Unsuitable {
        /// The reason, and what to do.
        reason: String,
    },
    /// The writer failed.
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// The format with this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static dyn Export> {
    FORMATS.into_iter().find(|format| format.name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_the_manual_has_every_format() {
        let names: BTreeSet<&str> = FORMATS.iter().map(|f| f.name()).collect();
        assert_eq!(names.len(), FORMATS.len());
        let manual = include_str!("../../README.md");
        for format in FORMATS {
            let row = format!(
                "| `{}` | `.{}` | {} |",
                format.name(),
                format.extension(),
                format.description()
            );
            assert!(manual.contains(&row), "{row}");
            assert!(find(format.name()).is_some_and(|f| f.name() == format.name()));
        }
        assert!(find("doc").is_none());
    }
}

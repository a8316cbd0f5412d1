//! The result document itself.

use super::{Export, ExportError};
use crate::printable::printable_json;
use crate::result::ResultDocument;
use std::io::{self, Write};

/// The format `json`.
pub(super) struct Json;

impl Export for Json {
    fn name(&self) -> &'static str {
        "json"
    }

    fn description(&self) -> &'static str {
        "the result document as `identify --json` prints it"
    }

    fn extension(&self) -> &'static str {
        "json"
    }

    fn write(&self, result: &ResultDocument, out: &mut dyn Write) -> Result<(), ExportError> {
        let text = serde_json::to_string_pretty(result).map_err(io::Error::from)?;
        writeln!(out, "{}", printable_json(&text))?;
        Ok(())
    }
}

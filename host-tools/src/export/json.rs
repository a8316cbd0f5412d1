//! The result document itself.

use super::{Export, ExportError, Form, Kind, View};
use crate::printable::printable_json;
use crate::result::ResultDocument;
use std::io::{self, Write};
use std::path::Path;

/// The format `json`.
#[derive(Debug)]
pub(super) struct Json;

impl Export for Json {
    fn form(&self) -> Form {
        Form {
            name: "json",
            description: "the result document as `identify --json` prints it",
            extension: "json",
            kind: Kind::Table,
        }
    }

    fn write(
        &self,
        result: &ResultDocument,
        _: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let text = serde_json::to_string_pretty(result).map_err(io::Error::from)?;
        writeln!(out, "{}", printable_json(&text))?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, _: &View, bytes: &[u8]) -> Result<(), String> {
        let read = ResultDocument::parse(bytes, Path::new(self.form().name));
        let read = read.map_err(|e| e.to_string())?;
        if read == *result {
            return Ok(());
        }
        Err("a key of the document".to_owned())
    }
}

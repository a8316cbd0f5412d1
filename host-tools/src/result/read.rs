//! Reading a result document back, from the file that `identify --json` wrote.
//!
//! Keys that this program does not know are skipped: later versions add keys without a new
//! [`SCHEMA`], and `demo --json` has the truth beside the result. Keys that it knows have to be
//! there and to agree with each other.

use super::{COMPARISON_SCHEMA, ComparisonDocument, Number, ResultDocument, SCHEMA};
use crate::limits;
use crate::printable::quoted;
use crate::setup::{DocumentError, read_document_of};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Reason why a file is not a result document that can be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] DocumentError),
    /// The text is not JSON, or a key is missing or has a value of another kind.
    #[error("{}, line {line}, column {column}: {reason}; expected the document of `massline identify --json`", file.display())]
    Form {
        /// The file.
        file: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one; zero before the first character.
        column: usize,
        /// Reason of the JSON reader.
        reason: String,
    },
    /// The JSON document is none of this program's results.
    #[error("{}: its `schema` is {found}, expected \"{SCHEMA}\"; give the document of `massline identify --json`", file.display())]
    OtherDocument {
        /// The file.
        file: PathBuf,
        /// Its schema, quoted, or `missing`.
        found: String,
    },
    /// The document has another version of the form.
    #[error("{}: it is a result of the form \"{found}\", this program reads \"{SCHEMA}\"; identify again with this program, or export with the version that wrote it", file.display())]
    OtherVersion {
        /// The file.
        file: PathBuf,
        /// Its schema.
        found: String,
    },
    /// The document holds the results of several methods.
    #[error("{}: it holds the results of several methods, and one is exported at a time; name it by --method: {choices}", file.display())]
    Comparison {
        /// The file.
        file: PathBuf,
        /// Names of the methods, the recommended one marked.
        choices: String,
    },
    /// The document does not hold the result of the method that was asked for.
    #[error("{}: it holds no result of the method \"{wanted}\"; it has {choices}", file.display())]
    OtherMethod {
        /// The file.
        file: PathBuf,
        /// The method that was asked for.
        wanted: String,
        /// Names of the methods, the recommended one marked.
        choices: String,
    },
    /// The parts of a number contradict each other.
    #[error("{}, `{property}`: {found}, expected {expected}; the document was changed after it was written: identify again", file.display())]
    Contradiction {
        /// The file.
        file: PathBuf,
        /// Name of the property, as in [`super::Property::name`].
        property: &'static str,
        /// The contradiction that was found.
        found: &'static str,
        /// The form that a number has.
        expected: &'static str,
    },
}

/// The key that every document of this program has.
#[derive(Deserialize)]
struct Head {
    schema: Option<String>,
}

impl ResultDocument {
    /// Reads a document of at most [`limits::RESULT`] bytes: the result of a method, which has to be
    /// named where there are several.
    ///
    /// # Errors
    /// [`ReadError`] with the file and the place in it.
    pub fn read(file: &Path, method: Option<&str>) -> Result<Self, ReadError> {
        Self::parse_one(&read_document_of(file, limits::RESULT)?, method, file)
    }

    /// Reads the bytes of a document of one result; `file` is named in errors.
    ///
    /// # Errors
    /// [`ReadError`] with the file and the place in it.
    pub fn parse(bytes: &[u8], file: &Path) -> Result<Self, ReadError> {
        Self::parse_one(bytes, None, file)
    }

    fn parse_one(bytes: &[u8], method: Option<&str>, file: &Path) -> Result<Self, ReadError> {
        let form = |error: &serde_json::Error| {
            let (line, column) = (error.line(), error.column());
            let text = error.to_string();
            let place = format!(" at line {line} column {column}");
            ReadError::Form {
                file: file.to_owned(),
                line,
                column,
                reason: text.strip_suffix(&place).unwrap_or(&text).to_owned(),
            }
        };
        let head: Head = serde_json::from_slice(bytes).map_err(|e| form(&e))?;
        let file = || file.to_owned();
        match head.schema.as_deref() {
            Some(SCHEMA) => {}
            Some(COMPARISON_SCHEMA) => {
                let all: ComparisonDocument =
                    serde_json::from_slice(bytes).map_err(|e| form(&e))?;
                let choices = choices(&all);
                let Some(wanted) = method else {
                    let file = file();
                    return Err(ReadError::Comparison { file, choices });
                };
                let found = all.results.into_iter().find(|r| r.method == wanted);
                let found = found.ok_or_else(|| ReadError::OtherMethod {
                    file: file(),
                    wanted: quoted(wanted),
                    choices,
                })?;
                return found.sound(file());
            }
            Some(other) if other.starts_with("massline/result/") => {
                return Err(ReadError::OtherVersion {
                    file: file(),
                    found: quoted(other),
                });
            }
            other => {
                return Err(ReadError::OtherDocument {
                    file: file(),
                    found: other.map_or_else(
                        || "missing".to_owned(),
                        |other| format!("\"{}\"", quoted(other)),
                    ),
                });
            }
        }
        let document: Self = serde_json::from_slice(bytes).map_err(|e| form(&e))?;
        if let Some(wanted) = method.filter(|wanted| *wanted != document.method) {
            return Err(ReadError::OtherMethod {
                file: file(),
                wanted: quoted(wanted),
                choices: quoted(&document.method),
            });
        }
        document.sound(file())
    }

    /// The document, if its numbers do not contradict themselves.
    fn sound(self, file: PathBuf) -> Result<Self, ReadError> {
        for property in self.properties() {
            if let Some((found, expected)) = contradiction(property.number) {
                return Err(ReadError::Contradiction {
                    file,
                    property: property.name,
                    found,
                    expected,
                });
            }
        }
        Ok(self)
    }
}

/// Names of the methods with a result, the recommended one marked.
fn choices(all: &ComparisonDocument) -> String {
    let names = all.results.iter().map(|result| {
        let mark = ["", " (recommended)"][usize::from(result.method == all.recommended)];
        format!("{}{mark}", quoted(&result.method))
    });
    names.collect::<Vec<_>>().join(", ")
}

/// The contradiction within a number, and the form that it should have.
fn contradiction(number: &Number) -> Option<(&'static str, &'static str)> {
    let Number {
        value,
        std,
        interval,
        observable,
        type_b,
        combined,
    } = number;
    if *observable != value.is_some() {
        return Some((
            "`observable` and `value` disagree",
            "a value where the number is observable, else null",
        ));
    }
    if value.is_some() != std.is_some() || (value.is_none() && interval.is_some()) {
        return Some((
            "an error bar without a value or a value without one",
            "both or neither",
        ));
    }
    let deviations = [*std, *interval].into_iter().flatten();
    let deviations = deviations
        .chain(type_b.iter().map(|b| b.std))
        .chain(combined.iter().map(|c| c.std))
        .chain(combined.iter().filter_map(|c| c.interval));
    if deviations.into_iter().any(|deviation| deviation < 0.0) {
        return Some(("a negative error bar", "zero or more"));
    }
    None
}

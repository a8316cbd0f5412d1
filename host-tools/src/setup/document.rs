//! A TOML file read key by key, so that every complaint names file, line and section.
//!
//! Serde would stop at "invalid type: string, expected f64"; an engineer with forty
//! sensor entries needs to hear which entry, on which line, and what to write instead.
//! Setup files and structural models are both read through here.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{DocumentError, Place};
use crate::printable::{quoted, steers};

/// Numbers beyond this are typing errors; below it, products of three of them, mass times
/// length squared, stay finite.
const LARGEST: f64 = 1e100;

/// The text of a file, kept for its line numbers.
pub(crate) struct Source {
    pub(crate) file: PathBuf,
    text: String,
}

impl Source {
    pub(crate) fn read(file: &Path) -> Result<Self, DocumentError> {
        let bytes = super::file::read(file)?;
        let text = String::from_utf8(bytes).map_err(|e| DocumentError::NotText {
            file: file.to_owned(),
            offset: e.utf8_error().valid_up_to(),
        })?;
        Ok(Self::new(&text, file))
    }

    pub(crate) fn new(text: &str, file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            text: text.to_owned(),
        }
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn parse(&self) -> Result<Spanned<DeTable<'_>>, DocumentError> {
        DeTable::parse(&self.text).map_err(|e| DocumentError::Syntax {
            place: Box::new(Place {
                file: self.file.clone(),
                line: e.span().map(|span| self.line(span.start)),
                section: String::new(),
            }),
            message: quoted(e.message()),
        })
    }

    fn line(&self, offset: usize) -> usize {
        let end = offset.min(self.text.len());
        1 + self.text.as_bytes()[..end]
            .iter()
            .filter(|&&byte| byte == b'\n')
            .count()
    }
}

/// One table of the file: its top, a `[section]`, or one of `[[sections]]`.
pub(crate) struct Section<'a> {
    source: &'a Source,
    table: &'a DeTable<'a>,
    span: Range<usize>,
    /// Name in messages; empty for the top of the file.
    pub(crate) title: String,
}

impl<'a> Section<'a> {
    pub(crate) fn root(source: &'a Source, table: &'a Spanned<DeTable<'a>>) -> Self {
        Self {
            source,
            table: table.get_ref(),
            span: 0..0,
            title: String::new(),
        }
    }

    /// Place at which this section starts.
    pub(crate) fn place(&self) -> Box<Place> {
        self.place_at(&self.span)
    }

    /// Place of a key of it, or of the section itself when the key is absent.
    pub(crate) fn place_of(&self, key: &str) -> Box<Place> {
        self.place_at(&self.span_of(key).unwrap_or_else(|| self.span.clone()))
    }

    fn place_at(&self, span: &Range<usize>) -> Box<Place> {
        let whole_file = self.title.is_empty() && *span == (0..0);
        Box::new(Place {
            file: self.source.file.clone(),
            line: (!whole_file).then(|| self.source.line(span.start)),
            section: self.title.clone(),
        })
    }

    fn span_of(&self, key: &str) -> Option<Range<usize>> {
        self.table.get_key_value(key).map(|(name, _)| name.span())
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Refuses every key that is not in the list.
    pub(crate) fn only(&self, known: &[&str]) -> Result<(), DocumentError> {
        for name in self.table.keys() {
            if !known.contains(&name.get_ref().as_ref()) {
                return Err(DocumentError::UnknownKey {
                    place: self.place_at(&name.span()),
                    key: quoted(name.get_ref()),
                    hint: nearest(name.get_ref(), known.iter().copied()),
                });
            }
        }
        Ok(())
    }

    fn value(&self, key: &str) -> Option<&'a DeValue<'a>> {
        self.table.get(key).map(Spanned::get_ref)
    }

    pub(crate) fn unexpected(
        &self,
        key: &str,
        found: impl fmt::Display,
        expected: impl fmt::Display,
    ) -> DocumentError {
        DocumentError::Unexpected {
            place: self.place_of(key),
            key: key.to_owned(),
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }

    pub(crate) fn missing(&self, key: &'static str, expected: &'static str) -> DocumentError {
        DocumentError::Missing {
            place: self.place(),
            key,
            expected,
        }
    }

    /// A finite number; integers are numbers too.
    pub(crate) fn number(&self, key: &str) -> Result<Option<f64>, DocumentError> {
        self.value(key)
            .map(|value| self.finite(key, value, "a number"))
            .transpose()
    }

    /// A number that must satisfy a condition, described by `expected`.
    pub(crate) fn number_where(
        &self,
        key: &str,
        expected: &str,
        allowed: impl Fn(f64) -> bool,
    ) -> Result<Option<f64>, DocumentError> {
        match self.number(key)? {
            Some(found) if !allowed(found) => Err(self.unexpected(key, found, expected)),
            found => Ok(found),
        }
    }

    fn finite(&self, key: &str, value: &DeValue<'_>, expected: &str) -> Result<f64, DocumentError> {
        match number_of(value) {
            Some(number) if number.abs() <= LARGEST => Ok(number),
            Some(number) if number.is_finite() => {
                Err(self.unexpected(key, number, format!("{expected} of a size that exists")))
            }
            Some(number) => Err(self.unexpected(key, number, format!("{expected} that is finite"))),
            None => Err(self.unexpected(key, describe(value), expected)),
        }
    }

    /// A list of exactly `N` finite numbers.
    pub(crate) fn vector<const N: usize>(
        &self,
        key: &str,
    ) -> Result<Option<[f64; N]>, DocumentError> {
        let expected = format!("a list of {N} numbers");
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let DeValue::Array(list) = value else {
            return Err(self.unexpected(key, describe(value), expected));
        };
        if list.len() != N {
            let found = format!("a list of {} values", list.len());
            return Err(self.unexpected(key, found, expected));
        }
        let mut vector = [0.0; N];
        for (slot, item) in vector.iter_mut().zip(list.iter()) {
            *slot = self.finite(key, item.get_ref(), &expected)?;
        }
        Ok(Some(vector))
    }

    /// A list of any number of 3-vectors.
    pub(crate) fn vectors(&self, key: &str) -> Result<Option<Vec<[f64; 3]>>, DocumentError> {
        const EXPECTED: &str = "a list of lists of 3 numbers";
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let DeValue::Array(list) = value else {
            return Err(self.unexpected(key, describe(value), EXPECTED));
        };
        let mut vectors = Vec::with_capacity(list.len());
        for item in list.iter() {
            let DeValue::Array(inner) = item.get_ref() else {
                return Err(self.unexpected(key, describe(item.get_ref()), EXPECTED));
            };
            if inner.len() != 3 {
                let found = format!("a list that holds one of {} values", inner.len());
                return Err(self.unexpected(key, found, EXPECTED));
            }
            let mut vector = [0.0; 3];
            for (slot, number) in vector.iter_mut().zip(inner.iter()) {
                *slot = self.finite(key, number.get_ref(), EXPECTED)?;
            }
            vectors.push(vector);
        }
        Ok(Some(vectors))
    }

    /// Number of the `[[key]]` tables.
    pub(crate) fn count(&self, key: &str) -> usize {
        match self.value(key) {
            Some(DeValue::Array(list)) => list.len(),
            _ => 0,
        }
    }

    /// Text that is not blank, of one line, and shows as it stands wherever it is printed.
    pub(crate) fn text(&self, key: &str) -> Result<Option<String>, DocumentError> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::String(text)) if text.trim().is_empty() => {
                Err(self.unexpected(key, "empty", "a name"))
            }
            Some(value @ DeValue::String(text)) if text.contains(steers) => {
                let expected = "text of one line without control characters";
                Err(self.unexpected(key, describe(value), expected))
            }
            Some(DeValue::String(text)) => Ok(Some(text.to_string())),
            Some(other) => Err(self.unexpected(key, describe(other), "text in quotes")),
        }
    }

    /// One text or a list of them, none of them blank.
    pub(crate) fn texts(&self, key: &str) -> Result<Vec<String>, DocumentError> {
        const EXPECTED: &str = "text in quotes, or a list of such texts";
        let Some(DeValue::Array(list)) = self.value(key) else {
            return Ok(self.text(key)?.into_iter().collect());
        };
        if list.is_empty() {
            return Err(self.unexpected(key, "an empty list", EXPECTED));
        }
        let text = |entry: &DeValue<'_>| match entry {
            DeValue::String(text) if !text.trim().is_empty() => Ok(text.to_string()),
            DeValue::String(_) => Err(self.unexpected(key, "empty", "names")),
            other => Err(self.unexpected(key, describe(other), EXPECTED)),
        };
        list.iter().map(|entry| text(entry.get_ref())).collect()
    }

    pub(crate) fn flag(&self, key: &str) -> Result<Option<bool>, DocumentError> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::Boolean(flag)) => Ok(Some(*flag)),
            Some(other) => Err(self.unexpected(key, describe(other), "true or false")),
        }
    }

    /// One of a few words.
    pub(crate) fn choice<T: Copy>(
        &self,
        key: &str,
        words: &[(&str, T)],
    ) -> Result<Option<T>, DocumentError> {
        let Some(text) = self.text(key)? else {
            return Ok(None);
        };
        match words.iter().find(|(word, _)| *word == text) {
            Some((_, value)) => Ok(Some(*value)),
            None => {
                let words: Vec<String> = words.iter().map(|(w, _)| format!("\"{w}\"")).collect();
                Err(self.unexpected(key, format!("\"{}\"", quoted(&text)), words.join(" or ")))
            }
        }
    }

    /// A list of words.
    pub(crate) fn words(&self, key: &str) -> Result<Option<Vec<String>>, DocumentError> {
        const EXPECTED: &str = "a list of texts in quotes";
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::Array(list)) => list
                .iter()
                .map(|item| match item.get_ref() {
                    DeValue::String(word) if !word.contains(steers) => Ok(word.to_string()),
                    other => Err(self.unexpected(key, describe(other), EXPECTED)),
                })
                .collect::<Result<_, _>>()
                .map(Some),
            Some(other) => Err(self.unexpected(key, describe(other), EXPECTED)),
        }
    }

    /// The `[key]` table, or an inline one.
    pub(crate) fn section(&self, key: &str) -> Result<Option<Section<'a>>, DocumentError> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::Table(table)) => Ok(Some(Section {
                source: self.source,
                table,
                span: self.span_of(key).unwrap_or_else(|| self.span.clone()),
                title: match self.title.as_str() {
                    "" => format!("[{key}]"),
                    outer => format!("{outer}, `{key}`"),
                },
            })),
            Some(other) => Err(self.unexpected(key, describe(other), "a table")),
        }
    }

    /// The `[[key]]` tables; none is an empty list. Titles are numbered from one
    /// and carry the value of the naming key where there is one.
    pub(crate) fn sections(
        &self,
        key: &str,
        naming: &str,
    ) -> Result<Vec<Section<'a>>, DocumentError> {
        let expected = format!("a list of tables, each headed [[{key}]]");
        let list = match self.value(key) {
            None => return Ok(Vec::new()),
            Some(DeValue::Array(list)) => list,
            Some(other) => return Err(self.unexpected(key, describe(other), expected)),
        };
        list.iter()
            .enumerate()
            .map(|(index, item)| match item.get_ref() {
                DeValue::Table(table) => {
                    let number = index + 1;
                    let name = match table.get(naming).map(Spanned::get_ref) {
                        Some(DeValue::String(name)) => {
                            format!(" ({naming} \"{}\")", quoted(name))
                        }
                        _ => String::new(),
                    };
                    Ok(Section {
                        source: self.source,
                        table,
                        span: item.span(),
                        title: format!("[[{key}]] {number}{name}"),
                    })
                }
                other => Err(self.unexpected(key, describe(other), &expected)),
            })
            .collect()
    }

    /// Every key of this section with its finite number, in the order of the keys.
    pub(crate) fn numbers(&self) -> Result<Vec<(String, f64)>, DocumentError> {
        self.table
            .iter()
            .map(|(name, value)| {
                let number = self.finite(name.get_ref(), value.get_ref(), "a number")?;
                Ok((name.get_ref().to_string(), number))
            })
            .collect()
    }
}

fn number_of(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .map(|integer| integer as f64),
        _ => None,
    }
}

fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{}\"", quoted(text)),
        DeValue::Integer(number) => format!("the integer {}", quoted(&number.to_string())),
        DeValue::Float(number) => format!("the number {}", quoted(&number.to_string())),
        DeValue::Boolean(flag) => format!("{flag}"),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// "did you mean …?", or all that is known when nothing is near.
pub(crate) fn nearest<'k>(wrong: &str, known: impl Iterator<Item = &'k str> + Clone) -> String {
    // Below this similarity a guess is more often wrong than helpful: "gain" would
    // be answered with "channel".
    const NEAR: f64 = 0.75;
    let best = known
        .clone()
        .map(|word| (strsim::jaro_winkler(wrong, word), word))
        .filter(|(similarity, _)| *similarity >= NEAR)
        .max_by(|(a, _), (b, _)| a.total_cmp(b));
    match best {
        Some((_, word)) => format!("did you mean `{word}`?"),
        None => {
            let all: Vec<String> = known.map(|word| format!("`{word}`")).collect();
            format!("known are {}", all.join(", "))
        }
    }
}

//! A TOML document through serde, and what is wrong with it in the words of the user: file, line,
//! section and key, the value that was found, and the values that are expected.
//!
//! serde knows the keys of each table, `toml` the span of each error. Line, section and key follow
//! from the span. The sentences are this module's and those of the functions in `keys`: "invalid
//! type: string, expected f64" leaves an engineer with forty sensors to search.

use std::fmt::Display;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{DocumentError, Place};
use crate::printable::quoted;

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

    fn line(&self, offset: usize) -> usize {
        let end = offset.min(self.text.len());
        let before = &self.text.as_bytes()[..end];
        1 + before.iter().filter(|&&byte| byte == b'\n').count()
    }
}

impl Source {
    /// The remedy for a value at this byte that is a word without quotes.
    fn without_quotes(&self, offset: usize) -> Option<String> {
        let bytes = self.text.as_bytes();
        let before = bytes.get(..offset)?.iter().rposition(|b| *b == b'\n');
        let begin = before.map_or(0, |end| end + 1);
        let line = self.text.get(begin..)?.lines().next()?;
        let (key, value) = line.split_once('=')?;
        let value = value.split('#').next().unwrap_or(value).trim();
        let is_word = |c: char| c.is_alphanumeric() || " _.-/:+".contains(c);
        let is_text = value.starts_with(char::is_alphabetic) && value.chars().all(is_word);
        is_text.then(|| {
            format!(
                "text stands in quotes, `{} = \"{}\"`",
                quoted(key.trim()),
                quoted(value)
            )
        })
    }
}

/// The keys of a document.
pub(crate) trait Keys: DeserializeOwned {
    /// Keys that cannot be left out, each with what to write.
    const REQUIRED: &'static [(&'static str, &'static str)];
}

/// A document without errors of syntax, with the spans of its keys.
pub(crate) struct Document<'a> {
    source: &'a Source,
    table: Spanned<DeTable<'a>>,
}

impl<'a> Document<'a> {
    pub(crate) fn new(source: &'a Source) -> Result<Self, DocumentError> {
        let table = DeTable::parse(&source.text).map_err(|e| {
            let start = e.span().map(|span| span.start);
            let hint = start.and_then(|start| source.without_quotes(start));
            DocumentError::Syntax {
                place: Box::new(Place {
                    file: source.file.clone(),
                    line: start.map(|start| source.line(start)),
                    section: String::new(),
                }),
                message: hint.unwrap_or_else(|| quoted(e.message())),
            }
        })?;
        Ok(Self { source, table })
    }

    /// The values of its keys.
    pub(crate) fn read<T: Keys>(&self) -> Result<T, DocumentError> {
        toml::from_str(&self.source.text).map_err(|e| self.explain(&e, T::REQUIRED))
    }

    /// Number of the `[[list]]` tables.
    pub(crate) fn count(&self, list: &str) -> usize {
        match self.table.get_ref().get(list).map(Spanned::get_ref) {
            Some(DeValue::Array(list)) => list.len(),
            _ => 0,
        }
    }

    /// Its top.
    pub(crate) fn top(&self) -> Section<'_> {
        Section {
            source: self.source,
            table: self.table.get_ref(),
            span: 0..0,
            title: String::new(),
        }
    }

    /// Its `[key]` table, or all of its `[[key]]` tables.
    pub(crate) fn sections(&self, key: &str) -> Vec<Section<'_>> {
        let top = self.top();
        let entry = top.table.get_key_value(key);
        entry.map_or_else(Vec::new, |(key, value)| top.below(key, value))
    }

    /// Its `[key]` table, or number `index` (from zero) of its `[[key]]` tables; its top if there
    /// is none. For one table only: the others are looked through.
    pub(crate) fn section(&self, key: &str, index: usize) -> Section<'_> {
        let found = self.sections(key).into_iter().nth(index);
        found.unwrap_or_else(|| self.top())
    }

    fn explain(&self, error: &toml::de::Error, required: &[(&str, &'static str)]) -> DocumentError {
        let message = error.message();
        let found = error.span().and_then(|span| self.top().find(span.start));
        if let Some(key) = message.strip_prefix("missing field `") {
            let key = key.trim_end_matches('`');
            let table = found.map_or_else(|| self.top(), |found| found.table);
            let hint = required.iter().find(|(name, _)| *name == key);
            return table.missing(key, hint.map_or("its value", |(_, hint)| hint));
        }
        let Some(Found {
            section,
            key,
            value,
            ..
        }) = found
        else {
            return DocumentError::Syntax {
                place: self.top().place(),
                message: quoted(message),
            };
        };
        if message.starts_with("unknown field `") {
            let known = message.rsplit_once(", expected ").map_or("", |(_, k)| k);
            let known = known.split('`').skip(1).step_by(2);
            return section.unknown(key, known);
        }
        // Of the functions in `keys`, with the value or without it; then serde's own.
        if let Some(message) = message.strip_prefix("is ")
            && let Some((found, expected)) = message.rsplit_once("; expected ")
        {
            return section.unexpected(key, found, expected);
        }
        let expected = match message.rsplit_once("expected ") {
            Some((_, "a sequence")) => format!("a list of tables, each headed [[{key}]]"),
            Some((_, "a boolean")) => "true or false".to_owned(),
            Some((_, expected)) => expected.to_owned(),
            None => format!("a value that can be read ({})", quoted(message)),
        };
        section.unexpected(key, describe(value), expected)
    }
}

/// One table of a document: its top, a `[section]`, or one of `[[sections]]`.
#[derive(Clone)]
pub(crate) struct Section<'a> {
    source: &'a Source,
    table: &'a DeTable<'a>,
    span: Range<usize>,
    /// Name in messages; empty for the top of the document.
    pub(crate) title: String,
}

/// The key or the table at a place of the text.
struct Found<'a> {
    /// Table of the key.
    section: Section<'a>,
    key: &'a str,
    value: &'a DeValue<'a>,
    /// The value, where it is a table; otherwise as `section`.
    table: Section<'a>,
}

impl<'a> Section<'a> {
    /// Place at which this section starts.
    pub(crate) fn place(&self) -> Box<Place> {
        self.place_at(&self.span)
    }

    /// Place of a key of it, or of the section itself when the key is absent.
    pub(crate) fn place_of(&self, key: &str) -> Box<Place> {
        let key = self.table.get_key_value(key);
        self.place_at(&key.map_or_else(|| self.span.clone(), |(key, _)| key.span()))
    }

    fn place_at(&self, span: &Range<usize>) -> Box<Place> {
        let whole_file = self.title.is_empty() && *span == (0..0);
        Box::new(Place {
            file: self.source.file.clone(),
            line: (!whole_file).then(|| self.source.line(span.start)),
            section: self.title.clone(),
        })
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Refuses every key that is not in the list, where the keys depend on a value.
    pub(crate) fn only(&self, known: &[&str]) -> Result<(), DocumentError> {
        let is_known = |key: &&str| known.contains(key);
        match self
            .table
            .keys()
            .map(|key| key.get_ref().as_ref())
            .find(|key| !is_known(key))
        {
            Some(key) => Err(self.unknown(key, known.iter().copied())),
            None => Ok(()),
        }
    }

    fn unknown<'k>(
        &self,
        key: &str,
        known: impl Iterator<Item = &'k str> + Clone,
    ) -> DocumentError {
        DocumentError::UnknownKey {
            place: self.place_of(key),
            key: quoted(key),
            hint: nearest(key, known),
        }
    }

    pub(crate) fn unexpected(
        &self,
        key: &str,
        found: impl Display,
        expected: impl Display,
    ) -> DocumentError {
        DocumentError::Unexpected {
            place: self.place_of(key),
            key: key.to_owned(),
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }

    pub(crate) fn missing(&self, key: &str, expected: impl Into<String>) -> DocumentError {
        DocumentError::Missing {
            place: self.place(),
            key: key.to_owned(),
            expected: expected.into(),
        }
    }

    /// The tables that a key of this one holds. Those of a list are numbered from one and carry
    /// their name or channel.
    fn below(&self, key: &Spanned<impl AsRef<str>>, value: &'a Spanned<DeValue<'a>>) -> Vec<Self> {
        let name = key.get_ref().as_ref();
        let section = |table, span, title| Section {
            source: self.source,
            table,
            span,
            title,
        };
        match value.get_ref() {
            DeValue::Table(table) => {
                let title = match self.title.as_str() {
                    "" => format!("[{name}]"),
                    outer => format!("{outer}, `{name}`"),
                };
                vec![section(table, key.span(), title)]
            }
            DeValue::Array(list) => (1..)
                .zip(list.iter())
                .filter_map(|(number, item)| {
                    let DeValue::Table(table) = item.get_ref() else {
                        return None;
                    };
                    let own = ["name", "channel", "triaxial"]
                        .into_iter()
                        .find_map(|naming| {
                            let own = table.get(naming)?.get_ref().as_str()?;
                            Some(format!(" ({naming} \"{}\")", quoted(own)))
                        });
                    let title = format!("[[{name}]] {number}{}", own.unwrap_or_default());
                    Some(section(table, item.span(), title))
                })
                .collect(),
            _ => Vec::new(),
        }
    }

    /// The key, the value or the table that stands at an offset of the text.
    fn find(&self, at: usize) -> Option<Found<'a>> {
        for (key, value) in self.table {
            let below = self.below(key, value);
            let own = |table: &Self| Found {
                section: self.clone(),
                key: key.get_ref(),
                value: value.get_ref(),
                table: table.clone(),
            };
            if key.span().start == at || (below.is_empty() && value.span().contains(&at)) {
                return Some(own(self));
            }
            let within = |table: &Self| match table.span.start == at || value.span().start == at {
                true => Some(own(table)),
                false => table.find(at),
            };
            if let Some(found) = below.iter().find_map(within) {
                return Some(found);
            }
        }
        None
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

//! The first line of a recording: which channel stands in which column.

use super::RecordingError;
use crate::setup::quoted;
use csv::ByteRecord;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// The names in a recording's first line.
#[derive(Debug, Default)]
pub(super) struct Header {
    names: Vec<String>,
}

/// A CSV field, quoted only where it must be.
pub(crate) fn field(name: &str) -> String {
    if name.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

/// Names shown before a list is cut off.
const SHOWN: usize = 30;

/// The first names of a list, fit for a message.
pub(crate) fn some_of<'n>(names: impl ExactSizeIterator<Item = &'n String>) -> String {
    let more = if names.len() > SHOWN { ", …" } else { "" };
    let some: Vec<String> = names.take(SHOWN).map(|name| quoted(name)).collect();
    some.join(", ") + more
}

/// Typing errors between two names that still count as the same word.
const TYPOS: usize = 2;

impl Header {
    /// Reads the names, and tells a header from what is none.
    pub(super) fn read(record: &ByteRecord, file: &Path) -> Result<Self, RecordingError> {
        let mut names = Vec::with_capacity(record.len());
        for field in record {
            let name = std::str::from_utf8(field)
                .ok()
                .map(|name| name.trim_start_matches('\u{feff}').trim())
                .filter(|name| !name.contains(|c: char| c.is_control() && c != '\t'))
                .ok_or_else(|| RecordingError::NoText {
                    file: file.to_owned(),
                    advice: advice(record.as_slice()),
                })?;
            names.push(name.to_owned());
        }
        if let [only] = names.as_slice()
            && only.contains([';', '\t'])
        {
            return Err(RecordingError::OtherSeparator {
                file: file.to_owned(),
                found: if only.contains(';') {
                    "semicolons"
                } else {
                    "tabs"
                },
            });
        }
        if names.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(RecordingError::NoHeader {
                file: file.to_owned(),
                found: quoted(names.first().map_or("", String::as_str)),
            });
        }
        let mut columns = HashMap::with_capacity(names.len());
        for (i, name) in names.iter().enumerate() {
            if let Some(first) = columns.insert(name.as_str(), i) {
                return Err(RecordingError::DuplicateChannel {
                    file: file.to_owned(),
                    channel: quoted(name),
                    first: first + 1,
                    second: i + 1,
                });
            }
        }
        Ok(Self { names })
    }

    /// Number of columns.
    pub(super) fn len(&self) -> usize {
        self.names.len()
    }

    /// The names, column by column.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The column of a channel; `wanted` are all channels that are looked for.
    pub(super) fn column(
        &self,
        channel: &str,
        wanted: &[String],
        file: &Path,
    ) -> Result<usize, RecordingError> {
        self.names
            .iter()
            .position(|name| name == channel)
            .ok_or_else(|| RecordingError::MissingChannel {
                file: file.to_owned(),
                channel: channel.to_owned(),
                hint: self.hint(channel, wanted),
            })
    }

    /// The column that is meant, if one is near that no other sensor claims.
    fn hint(&self, channel: &str, wanted: &[String]) -> String {
        let wanted: HashSet<&String> = wanted.iter().collect();
        let free: Vec<&String> = self.names.iter().filter(|n| !wanted.contains(n)).collect();
        let length = channel.chars().count();
        // The distance of two texts takes time and memory by the product of their lengths.
        let alike = |name: &&&String| name.chars().count().abs_diff(length) <= TYPOS;
        let near = free
            .iter()
            .filter(alike)
            .map(|name| (strsim::damerau_levenshtein(channel, name), name))
            .filter(|(typos, name)| *typos <= TYPOS && *typos < name.chars().count())
            .min();
        if let Some((_, name)) = near {
            return format!("did you mean `{}`?", quoted(name));
        }
        let (which, list) = if free.is_empty() {
            ("the file has", self.names.iter().collect())
        } else {
            ("columns without a sensor are", free)
        };
        let list = some_of(list.into_iter());
        format!("{which} {list}; correct `channel` in the setup or the column's name")
    }
}

/// What bytes that are no text may be.
fn advice(start: &[u8]) -> &'static str {
    match start {
        [0x1f, 0x8b, ..] => "it is compressed by gzip: let its name end in .csv.gz",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "it is UTF-16: save it as UTF-8",
        _ => "export the recording as CSV in UTF-8",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(names: &[&str]) -> Header {
        Header::read(&ByteRecord::from(names.to_vec()), Path::new("x.csv")).unwrap()
    }

    fn hint(names: &[&str], channel: &str, wanted: &[&str]) -> String {
        let wanted: Vec<String> = wanted.iter().map(|&w| w.to_owned()).collect();
        let found = header(names).column(channel, &wanted, Path::new("x.csv"));
        found.unwrap_err().to_string()
    }

    #[test]
    fn only_columns_without_a_sensor_are_suggested() {
        let text = hint(&["a1", "a2", "A3"], "a3", &["a1", "a2", "a3"]);
        assert!(text.contains("did you mean `A3`?"), "{text}");
        let text = hint(&["a1", "a2", "left"], "a3", &["a1", "a2", "a3"]);
        assert!(
            text.contains("columns without a sensor are left;"),
            "{text}"
        );
        let text = hint(&["a1", "a2"], "a3", &["a1", "a2", "a3"]);
        assert!(text.contains("the file has a1, a2;"), "{text}");
    }

    #[test]
    fn what_is_no_header_is_named() {
        let text = |bytes: &[&[u8]]| {
            Header::read(&ByteRecord::from(bytes.to_vec()), Path::new("x.csv"))
                .unwrap_err()
                .to_string()
        };
        assert!(text(&[b"0.1", b"2e3"]).contains("line 1"));
        assert!(text(&[b"a1;a2;a3"]).contains("semicolons"));
        assert!(text(&[&[0x1f, 0x8b, 8, 0]]).contains(".csv.gz"));
        assert!(text(&[&[0xff, 0xfe, b'a', 0]]).contains("UTF-16"));
        assert!(text(&[&[7, 8, 9]]).contains("CSV"));
    }
}

//! The first line of a CSV recording: the names of its columns.

use super::decode;
use crate::printable::quoted;
use crate::recording::RecordingError;
use csv::ByteRecord;
use std::path::Path;

/// A CSV field, quoted only where it must be.
pub(crate) fn field(name: &str) -> String {
    if name.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

/// Reads the names, and tells a header from what is none.
pub(super) fn names(record: &ByteRecord, file: &Path) -> Result<Vec<String>, RecordingError> {
    let mut names = Vec::with_capacity(record.len());
    for field in record {
        let name = decode::text(field);
        let name = name.trim_start_matches('\u{feff}').trim();
        // A name of two lines is one of one line.
        let name = name.replace(['\n', '\r', '\t'], " ");
        if name.contains(char::is_control) {
            return Err(RecordingError::NoText {
                file: file.to_owned(),
                advice: advice(record.as_slice()),
            });
        }
        names.push(name);
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(RecordingError::NoHeader {
            file: file.to_owned(),
            found: quoted(names.first().map_or("", String::as_str)),
        });
    }
    Ok(names)
}

/// Advice on bytes that are no text.
fn advice(start: &[u8]) -> &'static str {
    match start {
        [0x1f, 0x8b, ..] => "it is compressed by gzip twice: unpack it once",
        start if start.contains(&0) => {
            "it may be UTF-16 without its mark, or no text at all: save it as CSV in UTF-8"
        }
        _ => "export the recording as CSV in UTF-8",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_header_is_named() {
        let text = |bytes: &[&[u8]]| {
            names(&ByteRecord::from(bytes.to_vec()), Path::new("x.csv"))
                .unwrap_err()
                .to_string()
        };
        assert!(text(&[b"0.1", b"2e3"]).contains("line 1"));
        assert!(text(&[&[0x1f, 0x8b, 8, 0]]).contains("gzip twice"));
        assert!(text(&[&[b'a', 0, b'1', 0]]).contains("UTF-16"));
        assert!(text(&[&[7, 8, 9]]).contains("CSV"));
    }
}

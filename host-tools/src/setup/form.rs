//! The section `[recording]`: the form of text recordings, where it is not to be guessed.

use serde::{Deserialize, Deserializer};

use super::keys::{self, outside};
use crate::printable::quoted;
use crate::recording::Form;

/// The keys as they are written.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
struct FormKeys {
    #[serde(deserialize_with = "delimiter")]
    delimiter: Option<u8>,
    #[serde(deserialize_with = "decimal")]
    decimal: Option<u8>,
    #[serde(deserialize_with = "line")]
    header: Option<u64>,
    #[serde(deserialize_with = "line")]
    first_row: Option<u64>,
    #[serde(deserialize_with = "time")]
    time: Option<String>,
}

pub(super) fn read<'de, D: Deserializer<'de>>(value: D) -> Result<Form, D::Error> {
    let keys = FormKeys::deserialize(value)?;
    Ok(Form {
        delimiter: keys.delimiter,
        decimal: keys.decimal,
        header: keys.header,
        first_row: keys.first_row,
        time: keys.time,
    })
}

fn delimiter<'de, D: Deserializer<'de>>(value: D) -> Result<Option<u8>, D::Error> {
    let text = keys::plain(value, EXPECTED)?;
    let sound = |c: &u8| (b' '..=b'~').contains(c) || *c == b'\t';
    let number = |c: &u8| c.is_ascii_alphanumeric() || b"\"#+-.".contains(c);
    let found = text.as_bytes();
    match found {
        [c] if sound(c) && !number(c) => Ok(Some(*c)),
        _ => Err(outside(format_args!("\"{}\"", quoted(&text)), EXPECTED)),
    }
}

const EXPECTED: &str = "the character between two fields: \",\", \";\", \"\\t\", \" \" or another one that is neither letter nor digit";

fn decimal<'de, D: Deserializer<'de>>(value: D) -> Result<Option<u8>, D::Error> {
    keys::word(value, &[(".", b'.'), (",", b',')]).map(Some)
}

fn line<'de, D: Deserializer<'de>>(value: D) -> Result<Option<u64>, D::Error> {
    let expected = "the number of a line from 1 to 65535";
    keys::whole(value, expected, |line| line > 0).map(Some)
}

fn time<'de, D: Deserializer<'de>>(value: D) -> Result<Option<String>, D::Error> {
    let expected = "the name of the column of time in quotes, or \"\" for none";
    let name = keys::plain(value, expected)?;
    Ok(Some(name))
}

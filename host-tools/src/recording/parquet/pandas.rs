//! The note that pandas leaves in a file: its index, and times that have no type in Parquet.

use super::footer::{Footer, Meaning, Values};
use serde::Deserialize;
use serde_json::Value;

#[derive(Default, Deserialize)]
#[serde(default)]
struct Note {
    index_columns: Vec<Value>,
    columns: Vec<Described>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Described {
    field_name: Option<String>,
    numpy_type: Option<String>,
}

/// Gives time steps their unit. Names of the columns of the index that are numbers: an index of
/// numbers with fractions is time in seconds, one of whole numbers counts rows.
pub(super) fn describe(note: &str, footer: &mut Footer) -> Vec<String> {
    let note: Note = serde_json::from_str(note).unwrap_or_default();
    for described in &note.columns {
        let unit = described.numpy_type.as_deref().and_then(step);
        let name = described.field_name.as_deref();
        for column in &mut footer.columns {
            if let (Some(unit), Some(Values::Int64(Meaning::Signed))) = (unit, column.values)
                && name == Some(&column.name)
            {
                column.values = Some(Values::Int64(Meaning::Time(unit)));
            }
        }
    }
    let names = note.index_columns.iter().filter_map(Value::as_str);
    let fractions = |name: &&str| {
        let mut columns = footer.columns.iter();
        let column = columns.find(|column| column.name == *name);
        column.is_some_and(|c| matches!(c.values, Some(Values::Float | Values::Double)))
    };
    names.filter(fractions).map(str::to_owned).collect()
}

/// Seconds of the unit of a type such as `timedelta64[ns]`.
fn step(kind: &str) -> Option<f64> {
    let unit = kind.strip_prefix("timedelta64[")?.strip_suffix(']')?;
    match unit {
        "s" => Some(1.0),
        "ms" => Some(1e-3),
        "us" => Some(1e-6),
        "ns" => Some(1e-9),
        _ => None,
    }
}

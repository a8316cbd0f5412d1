//! The ten parameters, their error bars and their covariance as one row of Parquet, so that the results
//! of a campaign are one table.

use super::covariance::rows;
use super::{Export, ExportError, Form, Kind, View};
use crate::result::ResultDocument;
use ::parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use ::parquet::errors::{ParquetError, Result};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::record::Field;
use ::parquet::schema::types::Type;
use bytes::Bytes;
use std::io::{self, Write};
use std::sync::Arc;

/// The format `parquet`.
#[derive(Debug)]
pub(super) struct Parquet;

/// A column with its only value.
#[derive(Debug, PartialEq)]
enum Cell {
    Text(String),
    Number(Option<f64>),
}

impl Export for Parquet {
    fn form(&self) -> Form {
        Form {
            name: "parquet",
            description: "a table of one row: title, method, refusal, then mass (or Δ), centre of gravity and inertia about it, each with standard deviation and half of the 95 % interval, and their covariance; types A and B together where B is stated",
            extension: "parquet",
            kind: Kind::Table,
        }
    }

    fn write(
        &self,
        result: &ResultDocument,
        _: &View,
        out: &mut dyn Write,
    ) -> std::result::Result<(), ExportError> {
        let cells = cells(result).ok_or_else(super::covariance::unsuitable)?;
        let bytes = written(&cells).map_err(io::Error::other)?;
        Ok(out.write_all(&bytes)?)
    }

    fn compare(
        &self,
        result: &ResultDocument,
        _: &View,
        bytes: &[u8],
    ) -> std::result::Result<(), String> {
        let was = cells(result).unwrap_or_default();
        let is = read(bytes).map_err(|e| e.to_string())?;
        match was.iter().zip(&is).find(|(was, is)| was != is) {
            Some((was, _)) => Err(format!("the column `{}`", was.0)),
            None if was.len() == is.len() => Ok(()),
            None => Err(format!("{} columns, not {}", is.len(), was.len())),
        }
    }
}

/// The columns with their names; `None` where the document has no covariance.
fn cells(result: &ResultDocument) -> Option<Vec<(String, Cell)>> {
    let rows = rows(result)?;
    // Points in names stand for structures.
    let names: Vec<String> = rows.iter().map(|row| row.0.replace('.', "_")).collect();
    let refused = result.refused.clone().unwrap_or_default();
    let texts = [
        ("title", result.title.clone()),
        ("method", result.method.clone()),
        ("refused", refused),
    ];
    let texts = texts.map(|(name, text)| (name.to_owned(), Cell::Text(text)));
    let mut cells = Vec::from(texts);
    let mut number = |name: String, number| cells.push((name, Cell::Number(number)));
    for (name, row) in names.iter().zip(&rows) {
        number(name.clone(), row.2);
        number(format!("{name}_std"), row.3);
        number(format!("{name}_interval_95"), row.4);
    }
    for (i, (name, row)) in names.iter().zip(&rows).enumerate() {
        for (other, covariance) in names.iter().zip(&row.5).skip(i) {
            number(format!("covariance_{name}_{other}"), *covariance);
        }
    }
    Some(cells)
}

fn written(cells: &[(String, Cell)]) -> Result<Vec<u8>> {
    let column = |(name, cell): &(String, Cell)| -> Result<Arc<Type>> {
        let (kind, logical) = match cell {
            Cell::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Cell::Number(_) => (Physical::DOUBLE, None),
        };
        let column = Type::primitive_type_builder(name, kind);
        let column = column.with_repetition(Repetition::OPTIONAL);
        Ok(Arc::new(column.with_logical_type(logical).build()?))
    };
    let columns = cells.iter().map(column).collect::<Result<_>>()?;
    let schema = Type::group_type_builder("result").with_fields(columns);
    let properties = WriterProperties::builder()
        .set_created_by(format!("massline {}", env!("CARGO_PKG_VERSION")))
        .set_compression(Compression::UNCOMPRESSED);
    let schema = Arc::new(schema.build()?);
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties.build()))?;
    let mut group = file.next_row_group()?;
    for (_, cell) in cells {
        let Some(mut column) = group.next_column()? else {
            return Err(ParquetError::General("one column too many".to_owned()));
        };
        match cell {
            Cell::Text(text) => {
                let text = ByteArray::from(text.as_str());
                column
                    .typed::<ByteArrayType>()
                    .write_batch(&[text], Some(&[1]), None)?;
            }
            Cell::Number(number) => {
                let there = i16::from(number.is_some());
                let number = number.as_slice();
                column
                    .typed::<DoubleType>()
                    .write_batch(number, Some(&[there]), None)?;
            }
        }
        column.close()?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// The columns of the first row.
fn read(bytes: &[u8]) -> Result<Vec<(String, Cell)>> {
    let file = SerializedFileReader::new(Bytes::copy_from_slice(bytes))?;
    let mut rows = file.get_row_iter(None)?;
    let none = || ParquetError::General("no row".to_owned());
    let row = rows.next().transpose()?.ok_or_else(none)?;
    let cell = |(name, field): (&String, &Field)| {
        let cell = match field {
            Field::Double(number) => Cell::Number(Some(*number)),
            Field::Str(text) => Cell::Text(text.clone()),
            _ => Cell::Number(None),
        };
        (name.clone(), cell)
    };
    let cells = row.get_column_iter().map(cell).collect();
    match rows.next() {
        None => Ok(cells),
        Some(_) => Err(ParquetError::General("more than one row".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::tests::FORK;

    #[test]
    fn every_cell_is_compared() {
        let view = View::OF_THE_RESULT;
        let cells = cells(&FORK).unwrap();
        assert_eq!(cells.len(), 3 + 30 + 55);
        assert!(
            Parquet
                .compare(&FORK, &view, &written(&cells).unwrap())
                .is_ok()
        );
        for k in 0..cells.len() {
            let mut other = super::cells(&FORK).unwrap();
            other[k].1 = match &other[k].1 {
                Cell::Text(text) => Cell::Text(format!("{text}.")),
                Cell::Number(None) => Cell::Number(Some(0.0)),
                Cell::Number(Some(x)) => Cell::Number(Some(f64::from_bits(x.to_bits() ^ 1))),
            };
            let difference = Parquet.compare(&FORK, &view, &written(&other).unwrap());
            assert_eq!(difference, Err(format!("the column `{}`", cells[k].0)));
        }
        assert!(Parquet.compare(&FORK, &view, b"PAR1").is_err());
    }
}

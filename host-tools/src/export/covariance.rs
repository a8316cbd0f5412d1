//! The ten parameters with their covariance matrix as a table.

use super::{Export, ExportError, Form, Kind, View};
use crate::result::{CovarianceDocument, Number, ResultDocument};
use std::io::Write;

/// The format `covariance`.
#[derive(Debug)]
pub(super) struct Covariance;

/// One row: parameter, unit, value, standard deviation, half of the 95 % interval, and the row of
/// the matrix.
pub(super) type Row = (
    String,
    String,
    Option<f64>,
    Option<f64>,
    Option<f64>,
    [Option<f64>; 10],
);

impl Export for Covariance {
    fn form(&self) -> Form {
        Form {
            name: "covariance",
            description: "a table: mass (or Δ), centre of gravity and inertia about it with standard deviation, half of the 95 % interval and covariance matrix; types A and B together where B is stated",
            extension: "csv",
            kind: Kind::Table,
        }
    }

    fn write(
        &self,
        result: &ResultDocument,
        _: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let rows = rows(result).ok_or_else(unsuitable)?;
        let mut table = csv::Writer::from_writer(out);
        let head = ["parameter", "unit", "value", "std", "interval_95"];
        let names = rows.iter().map(|row| &*row.0);
        table
            .write_record(head.into_iter().chain(names))
            .map_err(std::io::Error::from)?;
        for row in &rows {
            table.serialize(row).map_err(std::io::Error::from)?;
        }
        table.flush()?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, _: &View, bytes: &[u8]) -> Result<(), String> {
        let was = rows(result).unwrap_or_default();
        let mut table = csv::Reader::from_reader(bytes);
        let is: Result<Vec<Row>, _> = table.deserialize().collect();
        let is = is.map_err(|e| e.to_string())?;
        match was.iter().zip(&is).find(|(was, is)| was != is) {
            Some((was, _)) => Err(format!("the row of `{}`", was.0)),
            None if was.len() == is.len() => Ok(()),
            None => Err(format!("{} rows, not {}", is.len(), was.len())),
        }
    }
}

/// The error of a document that has no covariance.
pub(super) fn unsuitable() -> ExportError {
    ExportError::Unsuitable {
        reason: "a box sends no covariance; identify its recordings by `massline identify`, or export the table `csv`".to_owned(),
    }
}

/// The rows; `None` where the document has no covariance.
pub(super) fn rows(result: &ResultDocument) -> Option<Vec<Row>> {
    let CovarianceDocument { units, matrix, .. } = result.covariance.as_ref()?;
    let properties = result.properties();
    let first = usize::from(result.indicator.is_some());
    // The mass, or Δ in its place, the centre of gravity, the six terms about it.
    let places = (first..=first)
        .chain(first + 1..first + 4)
        .chain(first + 10..first + 16);
    let rows = places.enumerate().filter_map(|(i, place)| {
        let property = properties.get(place)?;
        let (std, interval) = bars(property.number, result.covariance_type_b.is_some());
        let row = std::array::from_fn(|j| {
            let type_b = result
                .covariance_type_b
                .as_ref()
                .map_or(Some(0.0), |b| b.matrix[i][j]);
            // Errors that could not be carried through leave no covariance of both.
            matrix[i][j].zip(type_b).map(|(a, b)| a + b)
        });
        let name = property.name.to_owned();
        Some((
            name,
            units[i].clone(),
            property.number.value,
            std,
            interval,
            row,
        ))
    });
    Some(rows.collect())
}

/// Standard deviation and half of the 95 % interval, of both types where type B is stated; none
/// where its errors could not be carried through.
fn bars(number: &Number, type_b: bool) -> (Option<f64>, Option<f64>) {
    match &number.combined {
        Some(both) => (Some(both.std), both.interval),
        None if type_b => (None, None),
        None => (number.std, number.interval),
    }
}

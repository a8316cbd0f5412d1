//! The 6x6 mass matrix of equation (1) as a table.

use super::body::Body;
use super::{Export, ExportError, Form, Kind, View};
use crate::result::ResultDocument;
use nalgebra::Matrix6;
use std::io::Write;

/// The format `mass-matrix`.
#[derive(Debug)]
pub(super) struct MassMatrix;

const COLUMNS: [&str; 7] = ["resultant", "ax", "ay", "az", "alpha", "beta", "gamma"];
const ROWS: [&str; 6] = ["fx", "fy", "fz", "tx", "ty", "tz"];

impl Export for MassMatrix {
    fn form(&self) -> Form {
        Form {
            name: "mass-matrix",
            description: "a table: the 6x6 mass matrix of equation (1), forces and moments per acceleration; kg, kg m, kg m²",
            extension: "csv",
            kind: Kind::Body,
        }
    }

    fn write(
        &self,
        result: &ResultDocument,
        view: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let matrix = Body::of(result, view)?.mass_matrix();
        for remark in Body::remarks(result, view) {
            writeln!(out, "# {remark}")?;
        }
        let mut table = csv::Writer::from_writer(out);
        table.write_record(COLUMNS).map_err(std::io::Error::from)?;
        for (name, row) in ROWS.into_iter().zip(matrix.row_iter()) {
            // A zero has no sign.
            let row: Vec<f64> = row.iter().map(|x| x + 0.0).collect();
            table.serialize((name, row)).map_err(std::io::Error::from)?;
        }
        table.flush()?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let was = Body::of(result, view)
            .map_err(|e| e.to_string())?
            .mass_matrix();
        let mut table = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .from_reader(bytes);
        let mut is = Matrix6::repeat(f64::NAN);
        for (i, row) in table.deserialize().enumerate() {
            let (name, row): (String, [f64; 6]) = row.map_err(|e| e.to_string())?;
            if ROWS.get(i) != Some(&&*name) {
                return Err(format!("row {i} is `{name}`"));
            }
            is.set_row(i, &row.into());
        }
        if is == was {
            return Ok(());
        }
        Err("an entry of the matrix".to_owned())
    }
}

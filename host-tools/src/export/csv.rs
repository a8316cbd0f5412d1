//! A table with one row a property, for spreadsheets and scripts.

use super::{Export, ExportError, Form, Kind, View};
use crate::result::{About, Property, ResultDocument};
use serde::{Deserialize, Serialize};
use std::io::Write;

/// The format `csv`.
#[derive(Debug)]
pub(super) struct Csv;

/// One row; its fields are the columns. Numbers have as many digits as it takes to read them
/// back to the last bit; a field is empty where there is no number.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    parameter: String,
    unit: String,
    value: Option<f64>,
    /// One standard deviation.
    std: Option<f64>,
    /// Half of the 95 % interval.
    interval_95: Option<f64>,
    /// The same with type B uncertainty, where it is stated.
    combined_std: Option<f64>,
    combined_interval_95: Option<f64>,
    /// The point that the number refers to: `origin`, `A`, `S`.
    point: String,
    point_x_m: Option<f64>,
    point_y_m: Option<f64>,
    point_z_m: Option<f64>,
    /// `ok`, `not observable`, `refused`.
    status: String,
}

impl Export for Csv {
    fn form(&self) -> Form {
        Form {
            name: "csv",
            description: "a table: parameter, unit, value, standard deviation, half of the 95 % interval, both with type B, reference point, status",
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
        let mut table = csv::Writer::from_writer(out);
        for property in result.properties() {
            table
                .serialize(row(&property, result))
                .map_err(std::io::Error::from)?;
        }
        table.flush()?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, _: &View, bytes: &[u8]) -> Result<(), String> {
        let mut rows = csv::Reader::from_reader(bytes).into_deserialize();
        for property in result.properties() {
            let read: Option<Row> = rows.next().transpose().map_err(|e| e.to_string())?;
            if read != Some(row(&property, result)) {
                return Err(format!("the row of `{}`", property.name));
            }
        }
        Ok(())
    }
}

fn row(property: &Property<'_>, result: &ResultDocument) -> Row {
    let number = property.number;
    let (point, coordinates) = match property.about {
        About::Nothing => ("", [None; 3]),
        About::Origin => ("origin", [Some(0.0); 3]),
        About::Reference => ("A", result.reference_point.map(Some)),
        About::CentreOfGravity => ("S", result.centre_of_gravity.each_ref().map(|n| n.value)),
    };
    let combined = number.combined.as_ref();
    Row {
        parameter: property.name.to_owned(),
        unit: property.unit.to_owned(),
        value: number.value,
        std: number.std,
        interval_95: number.interval,
        combined_std: combined.map(|c| c.std),
        combined_interval_95: combined.and_then(|c| c.interval),
        point: point.to_owned(),
        point_x_m: coordinates[0],
        point_y_m: coordinates[1],
        point_z_m: coordinates[2],
        status: match (number.observable, &result.refused) {
            (false, _) => "not observable",
            (true, Some(_)) => "refused",
            (true, None) => "ok",
        }
        .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::tests::FORK;
    use std::collections::BTreeMap;

    /// The fork's weighed result with type B: combined error bars and the point of each number.
    #[test]
    fn rows_have_the_combined_error_bars_and_the_point_of_their_number() {
        let mut text = Vec::new();
        Csv.write(&FORK, &View::OF_THE_RESULT, &mut text).unwrap();
        let mut rows = csv::Reader::from_reader(&*text);
        let rows: Vec<BTreeMap<String, String>> = rows.deserialize().map(Result::unwrap).collect();
        let row = |name: &str| rows.iter().find(|row| row["parameter"] == name).unwrap();
        let numbers = |row: &BTreeMap<String, String>, keys: &[&str]| -> Vec<Option<f64>> {
            keys.iter().map(|key| row[*key].parse().ok()).collect()
        };
        let combined = ["combined_std", "combined_interval_95"];
        let both = FORK.inertia_cg.yy.combined.unwrap();
        assert!(both.interval > Some(both.std));
        let found = numbers(row("inertia_cg.yy"), &combined);
        assert_eq!(found, [Some(both.std), both.interval]);
        assert_eq!(numbers(row("inertia_cg.xx"), &combined), [None, None]);
        let [x, _, z] = FORK.centre_of_gravity.each_ref().map(|n| n.value);
        let points = [
            ("indicator", "", [None; 3]),
            ("centre_of_gravity.x", "origin", [Some(0.0); 3]),
            ("inertia_reference.yy", "A", FORK.reference_point.map(Some)),
            // Across its plane the fork's centre of gravity is not observable.
            ("inertia_cg.yy", "S", [x, None, z]),
        ];
        for (name, point, coordinates) in points {
            assert_eq!(row(name)["point"], point);
            let keys = ["point_x_m", "point_y_m", "point_z_m"];
            assert_eq!(numbers(row(name), &keys), coordinates, "{name}");
        }
    }
}

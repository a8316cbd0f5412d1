//! SDFormat: the `<inertial>` of a link.

use super::body::{Body, number};
use super::{Export, ExportError, Kind, View, xml};
use crate::result::ResultDocument;
use std::io::Write;

/// The format `sdf`. Its `ixy` is an entry of the tensor, which is `-∫ x y dm`.
#[derive(Debug)]
pub(super) struct Sdf;

const KEYS: [&str; 6] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];

impl Export for Sdf {
    fn name(&self) -> &'static str {
        "sdf"
    }

    fn description(&self) -> &'static str {
        "SDFormat: a link with `<inertial>`, whose `ixy` is an entry of the tensor, −∫ x y dm"
    }

    fn extension(&self) -> &'static str {
        "sdf"
    }

    fn kind(&self) -> Kind {
        Kind::Body
    }

    fn write(
        &self,
        result: &ResultDocument,
        view: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let body = Body::of(result, view)?;
        let mut remarks = Body::remarks(result, view);
        remarks.push("ixy is an entry of the inertia tensor: minus the integral of x y dm".into());
        let entries = KEYS.iter().zip(body.entries());
        let entries: Vec<String> = entries
            .map(|(key, entry)| format!("          <{key}>{}</{key}>\n", number(entry)))
            .collect();
        let (centre, mass) = (xml::numbers(body.centre), number(body.mass));
        let (comment, entries) = (xml::comment(&remarks), entries.concat());
        write!(
            out,
            "<?xml version=\"1.0\"?>\n{comment}<sdf version=\"1.7\">\n  <model name=\"body\">\n    <link name=\"body\">\n      <inertial>\n        <pose>{centre} 0 0 0</pose>\n        <mass>{mass}</mass>\n        <inertia>\n{entries}        </inertia>\n      </inertial>\n    </link>\n  </model>\n</sdf>\n"
        )?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let body = Body::of(result, view).map_err(|e| e.to_string())?;
        let read = xml::read(bytes, |root| {
            let inertial = xml::find(root, "inertial")?;
            let text = |element: &str| xml::find(inertial, element)?.text().map(str::to_owned);
            let mut entries = [0.0; 6];
            for (entry, key) in entries.iter_mut().zip(KEYS) {
                *entry = text(key)?.parse().ok()?;
            }
            let [x, y, z, turn @ ..]: [f64; 6] = xml::parse(&text("pose")?)?;
            let mass = text("mass")?.parse().ok()?;
            (turn == [0.0; 3]).then(|| Body::of_entries(mass, [x, y, z], entries))
        })?;
        body.difference(&read, 0.0)
    }
}

//! URDF: the `<inertial>` of a link.

use super::body::{Body, number};
use super::{Export, ExportError, Kind, View, xml};
use crate::result::ResultDocument;
use std::io::Write;

/// The format `urdf`. Its `ixy` is an entry of the tensor, which is `-∫ x y dm`.
#[derive(Debug)]
pub(super) struct Urdf;

const KEYS: [&str; 6] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];

impl Export for Urdf {
    fn name(&self) -> &'static str {
        "urdf"
    }

    fn description(&self) -> &'static str {
        "URDF: a link with `<inertial>`, whose `ixy` is an entry of the tensor, −∫ x y dm"
    }

    fn extension(&self) -> &'static str {
        "urdf"
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
            .map(|(key, entry)| format!("{key}=\"{}\"", number(entry)))
            .collect();
        let (centre, mass) = (xml::numbers(body.centre), number(body.mass));
        let (comment, entries) = (xml::comment(&remarks), entries.join(" "));
        write!(
            out,
            "<?xml version=\"1.0\"?>\n{comment}<robot name=\"body\">\n  <link name=\"body\">\n    <inertial>\n      <origin xyz=\"{centre}\" rpy=\"0 0 0\"/>\n      <mass value=\"{mass}\"/>\n      <inertia {entries}/>\n    </inertial>\n  </link>\n</robot>\n"
        )?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let body = Body::of(result, view).map_err(|e| e.to_string())?;
        let read = xml::read(bytes, |root| {
            let inertial = xml::find(root, "inertial")?;
            let attribute = |element: &str, key: &str| {
                xml::find(inertial, element)?
                    .attribute(key)
                    .map(str::to_owned)
            };
            let mut entries = [0.0; 6];
            for (entry, key) in entries.iter_mut().zip(KEYS) {
                *entry = attribute("inertia", key)?.parse().ok()?;
            }
            let mass = attribute("mass", "value")?.parse().ok()?;
            let centre = xml::parse(&attribute("origin", "xyz")?)?;
            let turn: [f64; 3] = xml::parse(&attribute("origin", "rpy")?)?;
            (turn == [0.0; 3]).then(|| Body::of_entries(mass, centre, entries))
        })?;
        body.difference(&read, 0.0)
    }
}

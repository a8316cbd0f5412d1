//! MJCF, the format of MuJoCo: a free body with `<inertial>`.

use super::body::{Body, number};
use super::{Export, ExportError, Kind, View, xml};
use crate::result::ResultDocument;
use std::io::Write;

/// The format `mjcf`. `fullinertia` has entries of the tensor, so that its products are
/// `-∫ x y dm`.
#[derive(Debug)]
pub(super) struct Mjcf;

impl Export for Mjcf {
    fn name(&self) -> &'static str {
        "mjcf"
    }

    fn description(&self) -> &'static str {
        "MuJoCo: a free body with `<inertial fullinertia>`, entries of the tensor, −∫ x y dm"
    }

    fn extension(&self) -> &'static str {
        "xml"
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
        remarks.push(
            "fullinertia: xx yy zz xy xz yz of the tensor, products are minus the integral of x y dm"
                .into(),
        );
        let (centre, mass) = (xml::numbers(body.centre), number(body.mass));
        let (comment, entries) = (xml::comment(&remarks), xml::numbers(body.entries()));
        write!(
            out,
            "{comment}<mujoco model=\"body\">\n  <worldbody>\n    <body name=\"body\">\n      <freejoint/>\n      <inertial pos=\"{centre}\" mass=\"{mass}\" fullinertia=\"{entries}\"/>\n    </body>\n  </worldbody>\n</mujoco>\n"
        )?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let body = Body::of(result, view).map_err(|e| e.to_string())?;
        let read = xml::read(bytes, |root| {
            let inertial = xml::find(root, "inertial")?;
            Some(Body::of_entries(
                inertial.attribute("mass")?.parse().ok()?,
                xml::parse(inertial.attribute("pos")?)?,
                xml::parse(inertial.attribute("fullinertia")?)?,
            ))
        })?;
        body.difference(&read, 0.0)
    }
}

//! MJCF, the format of MuJoCo: a free body with `<inertial>`.

use super::body::{Body, number};
use super::xml::{self, Xml};
use super::{Form, Kind};
use roxmltree::Node;

/// The format `mjcf`.
pub(super) const MJCF: Xml = Xml {
    form: Form {
        name: "mjcf",
        description: "MuJoCo: a free body with `<inertial fullinertia>`, entries of the tensor, −∫ x y dm",
        extension: "xml",
        kind: Kind::Body,
    },
    products: "fullinertia: xx yy zz xy xz yz of the tensor, products are minus the integral of x y dm",
    text,
    read,
};

fn text(body: &Body) -> String {
    format!(
        "<mujoco model=\"body\">\n  <worldbody>\n    <body name=\"body\">\n      <freejoint/>\n      <inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>\n    </body>\n  </worldbody>\n</mujoco>\n",
        xml::numbers(body.centre),
        number(body.mass),
        xml::numbers(body.entries())
    )
}

fn read(inertial: Node<'_, '_>) -> Option<Body> {
    Some(Body::of_entries(
        inertial.attribute("mass")?.parse().ok()?,
        xml::parse(inertial.attribute("pos")?)?,
        xml::parse(inertial.attribute("fullinertia")?)?,
    ))
}

//! URDF: the `<inertial>` of a link.

use super::body::{Body, number};
use super::xml::{self, Xml};
use super::{Form, Kind};
use roxmltree::Node;

/// The format `urdf`.
pub(super) const URDF: Xml = Xml {
    form: Form {
        name: "urdf",
        description: "URDF: a link with `<inertial>`, whose `ixy` is an entry of the tensor, −∫ x y dm",
        extension: "urdf",
        kind: Kind::Body,
    },
    products: "ixy is an entry of the inertia tensor: minus the integral of x y dm",
    text,
    read,
};

fn text(body: &Body) -> String {
    let entries = xml::ENTRIES.iter().zip(body.entries());
    let entries: Vec<String> = entries
        .map(|(key, entry)| format!("{key}=\"{}\"", number(entry)))
        .collect();
    format!(
        "<robot name=\"body\">\n  <link name=\"body\">\n    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass value=\"{}\"/>\n      <inertia {}/>\n    </inertial>\n  </link>\n</robot>\n",
        xml::numbers(body.centre),
        number(body.mass),
        entries.join(" ")
    )
}

fn read(inertial: Node<'_, '_>) -> Option<Body> {
    let attribute = |element: &str, key: &str| {
        let element = xml::find(inertial, element)?;
        element.attribute(key).map(str::to_owned)
    };
    let entries = xml::entries(|key| attribute("inertia", key))?;
    let mass = attribute("mass", "value")?.parse().ok()?;
    let centre = xml::parse(&attribute("origin", "xyz")?)?;
    let turn: [f64; 3] = xml::parse(&attribute("origin", "rpy")?)?;
    (turn == [0.0; 3]).then(|| Body::of_entries(mass, centre, entries))
}

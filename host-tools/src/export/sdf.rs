//! SDFormat: the `<inertial>` of a link.

use super::body::{Body, number};
use super::xml::{self, Xml};
use super::{Form, Kind};
use roxmltree::Node;

/// The format `sdf`.
pub(super) const SDF: Xml = Xml {
    form: Form {
        name: "sdf",
        description: "SDFormat: a link with `<inertial>`, whose `ixy` is an entry of the tensor, −∫ x y dm",
        extension: "sdf",
        kind: Kind::Body,
    },
    products: "ixy is an entry of the inertia tensor: minus the integral of x y dm",
    text,
    read,
};

fn text(body: &Body) -> String {
    let entries = xml::ENTRIES.iter().zip(body.entries());
    let entries: String = entries
        .map(|(key, entry)| format!("          <{key}>{}</{key}>\n", number(entry)))
        .collect();
    format!(
        "<sdf version=\"1.7\">\n  <model name=\"body\">\n    <link name=\"body\">\n      <inertial>\n        <pose>{} 0 0 0</pose>\n        <mass>{}</mass>\n        <inertia>\n{entries}        </inertia>\n      </inertial>\n    </link>\n  </model>\n</sdf>\n",
        xml::numbers(body.centre),
        number(body.mass)
    )
}

fn read(inertial: Node<'_, '_>) -> Option<Body> {
    let text = |element: &str| xml::find(inertial, element)?.text().map(str::to_owned);
    let entries = xml::entries(text)?;
    let [x, y, z, turn @ ..]: [f64; 6] = xml::parse(&text("pose")?)?;
    let mass = text("mass")?.parse().ok()?;
    (turn == [0.0; 3]).then(|| Body::of_entries(mass, [x, y, z], entries))
}

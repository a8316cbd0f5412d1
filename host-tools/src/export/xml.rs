//! Formats in XML that hold the inertia of a link, by their text and the way back.

use super::body::{Body, number};
use super::{Export, ExportError, Form, View};
use crate::result::ResultDocument;
use roxmltree::{Document, Node};
use std::io::Write;

/// A format in XML. Its products are entries of the tensor, `-∫ x y dm`.
#[derive(Debug)]
pub(super) struct Xml {
    pub(super) form: Form,
    /// The sign of the products, for the comment.
    pub(super) products: &'static str,
    /// The elements of a body.
    pub(super) text: fn(&Body) -> String,
    /// The body of an element `inertial`.
    pub(super) read: fn(Node<'_, '_>) -> Option<Body>,
}

impl Export for Xml {
    fn form(&self) -> Form {
        self.form
    }

    fn write(
        &self,
        result: &ResultDocument,
        view: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let body = Body::of(result, view)?;
        let mut remarks = Body::remarks(result, view);
        remarks.push(self.products.to_owned());
        let comment: String = remarks.iter().map(|line| format!("  {line}\n")).collect();
        let text = (self.text)(&body);
        write!(out, "<?xml version=\"1.0\"?>\n<!--\n{comment}-->\n{text}")?;
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let body = Body::of(result, view).map_err(|e| e.to_string())?;
        let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
        let document = Document::parse(text).map_err(|e| e.to_string())?;
        let inertial = find(document.root(), "inertial");
        let read = inertial.and_then(self.read);
        let read = read.ok_or("an element or a number is missing")?;
        body.difference(&read, 0.0)
    }
}

/// Keys of the entries of the tensor, in URDF and SDFormat.
pub(super) const ENTRIES: [&str; 6] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];

/// Entries of the tensor, by their keys.
pub(super) fn entries(mut text: impl FnMut(&str) -> Option<String>) -> Option<[f64; 6]> {
    let mut entries = [0.0; 6];
    for (entry, key) in entries.iter_mut().zip(ENTRIES) {
        *entry = text(key)?.parse().ok()?;
    }
    Some(entries)
}

/// Numbers between blanks.
pub(super) fn numbers<const N: usize>(values: [f64; N]) -> String {
    values.map(number).join(" ")
}

/// The first element of this name below a node.
pub(super) fn find<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.descendants().find(|n| n.has_tag_name(name))
}

/// Exactly `N` numbers of a text.
pub(super) fn parse<const N: usize>(text: &str) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = text.split_whitespace().map(|t| t.parse().ok()).collect();
    values?.try_into().ok()
}

//! XML of three formats: comments, and numbers read back.

use roxmltree::{Document, Node};

/// Remarks as one comment.
pub(super) fn comment(remarks: &[String]) -> String {
    let lines: Vec<String> = remarks.iter().map(|line| format!("  {line}\n")).collect();
    format!("<!--\n{}-->\n", lines.concat())
}

/// Numbers between blanks.
pub(super) fn numbers<const N: usize>(values: [f64; N]) -> String {
    values.map(super::body::number).join(" ")
}

/// Reads an export and hands its root over.
pub(super) fn read<T>(
    bytes: &[u8],
    of: impl FnOnce(Node<'_, '_>) -> Option<T>,
) -> Result<T, String> {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let document = Document::parse(text).map_err(|e| e.to_string())?;
    of(document.root()).ok_or_else(|| "an element or a number is missing".to_owned())
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

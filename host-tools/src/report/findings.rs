//! The section on sensors that the recordings contradict, with the lines that mend the setup.

use super::markup::escape;
use super::page::Section;
use super::verdict::{capitalised, with_code};
use crate::result::{ExplanationDocument, ResultDocument};
use std::fmt::Write;

/// The section; `None` where nothing was found.
pub(super) fn section(result: &ResultDocument) -> Option<Section> {
    let last = result.findings.last()?;
    let mut html = String::new();
    for finding in &result.findings {
        if finding.ties.is_empty() {
            html.push_str(&explanation(&finding.explanation));
            continue;
        }
        html.push_str("<p>One of these, which the data do not tell apart:</p>");
        for one in std::iter::once(&finding.explanation).chain(&finding.ties) {
            html.push_str(&explanation(one));
        }
    }
    if last.evidence != last.explanation.text {
        let _ = write!(
            html,
            "<p class=\"small\">{}. Nothing was repaired: the numbers are those of the setup as it is.</p>",
            with_code(&capitalised(&last.evidence))
        );
    }
    Some(Section::new("findings", "What contradicts the setup", html))
}

fn explanation(found: &ExplanationDocument) -> String {
    let mut html = format!("<p>{}.</p>", with_code(&capitalised(&found.text)));
    if !found.repair.is_empty() {
        let lines: Vec<String> = found.repair.iter().map(|line| escape(line)).collect();
        let _ = write!(html, "<pre>{}</pre>", lines.join("\n"));
    }
    html
}

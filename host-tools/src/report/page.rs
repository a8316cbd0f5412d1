//! A page: one file, nothing fetched, no script, well-formed as XML as well.

use super::markup::escape;
use std::fmt::Write;

/// The style sheet, for screens light and dark and for paper.
pub(super) const STYLE: &str = include_str!("style.css");

/// By this a page is known as one that this program made, and may be replaced by the next.
pub(crate) const MADE_BY: &str = "<meta name=\"generator\" content=\"massline\"/>";

/// A part of the page with a heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Target of links.
    pub id: &'static str,
    /// Its heading, plain text.
    pub heading: &'static str,
    /// Content, HTML.
    pub html: String,
}

impl Section {
    /// A section.
    #[must_use]
    pub fn new(id: &'static str, heading: &'static str, html: String) -> Self {
        Self { id, heading, html }
    }
}

/// A whole page. `title` is plain text, `header` and `footer` are HTML.
#[must_use]
pub fn page(title: &str, header: &str, sections: &[Section], footer: &str) -> String {
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         {MADE_BY}\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
         <meta name=\"color-scheme\" content=\"light dark\"/>\
         <title>{}</title>\n<style>\n{STYLE}</style></head>\n<body><main>\n{header}\n",
        escape(title)
    );
    if sections.len() > 2 {
        html.push_str("<nav aria-label=\"Sections\">");
        for s in sections {
            let _ = write!(html, "<a href=\"#{}\">{}</a> ", s.id, escape(s.heading));
        }
        html.push_str("</nav>\n");
    }
    for s in sections {
        let _ = writeln!(
            html,
            "<section id=\"{}\"><h2>{}</h2>{}</section>",
            s.id,
            escape(s.heading),
            s.html
        );
    }
    let _ = writeln!(html, "</main><footer>{footer}</footer></body></html>");
    html
}

/// Charts side by side, as many as fit.
#[must_use]
pub fn panels(charts: impl IntoIterator<Item = String>) -> String {
    let mut html = String::from("<div class=\"panels\">");
    for chart in charts {
        if chart.starts_with("<figure") {
            html.push_str(&chart);
        } else {
            let _ = write!(html, "<figure>{chart}</figure>");
        }
    }
    html.push_str("</div>");
    html
}

/// A chart with a sentence below it; `caption` is HTML.
#[must_use]
pub fn captioned(chart: String, caption: &str) -> String {
    format!("<figure>{chart}<figcaption>{caption}</figcaption></figure>")
}

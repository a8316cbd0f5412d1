//! Tables 1 to 4 and the rows under noise.

use crate::report::markup::{escape, push_number};
use crate::report::number::{MINUS, NO_NUMBER, fixed};
use crate::study::errors::Errors;
use crate::study::estimate::{Numbers, Outcome};
use crate::study::fits::Fits;
use crate::study::monte_carlo::Level;
use crate::study::paper::{self, Printed};
use crate::study::{NAMES, Row, Study, percent};
use massline_core::masslines::Method;
use std::fmt::Write;

/// Text with proper minus signs and indices.
pub(super) fn typeset(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let digit = rest.peek().is_some_and(char::is_ascii_digit);
        let sign = c == '-' && digit && matches!(before, ' ' | 'e');
        out.push(if sign { MINUS } else { c });
        before = c;
    }
    indexed(&escape(&out))
}

/// The moments of inertia about A and S with their index set low.
pub(super) fn indexed(html: &str) -> String {
    html.replace("Θ_A", "Θ<sub>A</sub>")
        .replace("Θ_S", "Θ<sub>S</sub>")
}

/// An error in per cent, without the sign of per cent.
fn error(e: f64) -> String {
    if e.is_finite() {
        typeset(&percent::text(e))
    } else {
        NO_NUMBER.to_owned()
    }
}

/// The head of a table: groups of columns above columns.
fn head(html: &mut String, first: &str, groups: &[(&str, &[&str])]) {
    let _ = write!(
        html,
        "<div class=\"wide\"><table class=\"plain\"><thead><tr>\
         <th scope=\"col\" rowspan=\"2\">{first}</th>"
    );
    for (name, columns) in groups {
        let _ = write!(
            html,
            "<th class=\"over\" colspan=\"{}\">{name}</th>",
            columns.len()
        );
    }
    html.push_str("</tr><tr>");
    for column in groups.iter().flat_map(|(_, columns)| *columns) {
        let column = indexed(column);
        let _ = write!(html, "<th scope=\"col\" class=\"num\">{column}</th>");
    }
    html.push_str("</tr></thead><tbody>");
}

const END: &str = "</tbody></table></div>";

/// Tables 1 and 2.
pub(super) fn frequencies(study: &Study) -> String {
    let mut html = String::new();
    let titles = ["Table 1: fixed system", "Table 2: free system"];
    for (title, table) in titles.iter().zip(study.tables()) {
        let _ = write!(
            html,
            "<h3>{title}</h3><div class=\"wide\"><table class=\"plain\"><thead><tr>"
        );
        for column in [
            "Mode",
            "Paper, Hz",
            "Twin, Hz",
            "Differs, %",
            "Identified, Hz",
            "Damping, %",
        ] {
            let _ = write!(html, "<th scope=\"col\" class=\"num\">{column}</th>");
        }
        html.push_str("</tr></thead><tbody>");
        for mode in &table {
            html.push_str("<tr>");
            push_number(&mut html, &mode.number.to_string());
            push_number(&mut html, &fixed(mode.paper, 2));
            push_number(&mut html, &fixed(mode.twin, 3));
            push_number(&mut html, &error(mode.difference));
            let number = |x: Option<f64>| x.map_or_else(|| NO_NUMBER.to_owned(), |x| fixed(x, 3));
            push_number(&mut html, &number(mode.identified));
            push_number(
                &mut html,
                &number(mode.damping.map(|damping| 100.0 * damping)),
            );
            html.push_str("</tr>");
        }
        html.push_str(END);
    }
    html.push_str(
        "<p class=\"small\">Twin: from its model, an eigenvalue problem. Identified: poles \
         of the noise-free frequency responses, where the mode lies in the lines that were \
         fitted; those of the fixed system belong to the apparent mass, those of the free system \
         to method e.</p>",
    );
    html
}

/// Columns of table 3 that the paper has, and with Θ about S those of the twin.
const PRINTED: [usize; 4] = [0, 1, 2, 4];
const DIRECT: [usize; 5] = [0, 1, 2, 3, 4];
const ITERATIVE: [usize; 3] = [0, 1, 3];
const UNITS: [&str; Numbers::COUNT] = ["x, mm", "z, mm", "Θ_A, g m²", "Θ_S, g m²", "Δ, %"];

fn value(numbers: &[f64; Numbers::COUNT], at: usize) -> String {
    match at {
        4 => fixed(100.0 * numbers[at], 2),
        2 | 3 => fixed(1e3 * numbers[at], 3),
        _ => fixed(1e3 * numbers[at], 2),
    }
}

/// Table 3 and the rows that the paper lacks.
pub(super) fn direct(study: &Study) -> String {
    let mut html = String::from(
        "<p>Values, and below them errors in per cent. The published numbers are those of \
         other sensors and another excitation: judge by the pattern.</p>",
    );
    let ours = DIRECT.map(|c| UNITS[c]);
    let theirs = PRINTED.map(|c| UNITS[c]);
    head(&mut html, "Row", &[("Twin", &ours), ("Paper", &theirs)]);
    let exact = study.exact.list();
    html.push_str("<tr><td>exact</td>");
    for c in DIRECT {
        push_number(&mut html, &value(&exact, c));
    }
    for v in paper::IDEAL.values {
        push_number(&mut html, &fixed(v, 2));
    }
    html.push_str("</tr>");
    for (row, answer) in study.rows() {
        if row == Row::beyond_the_paper()[0] {
            html.push_str(
                "<tr class=\"group\"><th scope=\"rowgroup\" colspan=\"10\">Rows that the paper \
                 lacks</th></tr>",
            );
        }
        let note = if paper::contradicts_itself(&row) {
            " *"
        } else {
            ""
        };
        let _ = write!(html, "<tr><td>{}{note}</td>", escape(&row.name()));
        outcome(&mut html, &answer.direct, study, &DIRECT);
        printed(&mut html, paper::table_3(&row), PRINTED.len());
        html.push_str("</tr>");
    }
    let _ = write!(
        html,
        "{END}<p class=\"small\">* {}.</p>",
        escape(paper::FOOTNOTE)
    );
    html
}

/// Table 4, with the rows that the paper lacks.
pub(super) fn iterative(study: &Study) -> String {
    let mut html = String::from(
        "<p>Range I, weighted where weights have a place; errors in per cent below the values. The iteration moves A to the \
         identified centre of gravity until both coincide; the direct procedure takes the \
         inertia there by the parallel-axis rule.</p>",
    );
    let columns = ITERATIVE.map(|c| UNITS[c]);
    head(&mut html, "Row", &[("Twin", &columns), ("Paper", &columns)]);
    for (row, modes, answer) in study.iterated() {
        let (name, theirs) = match modes {
            None => (row.method_name().to_owned(), paper::table_4(&row)),
            Some(modes) => (format!("{} with {modes} modes", row.method_name()), None),
        };
        let [direct, iterative] = theirs.map_or([None; 2], |pair| pair.map(Some));
        let _ = write!(html, "<tr><td>{}, direct</td>", escape(&name));
        outcome(&mut html, &answer.direct, study, &ITERATIVE);
        printed(&mut html, direct, ITERATIVE.len());
        let steps = match &answer.iterative {
            Ok(solution) => format!("{} solutions", solution.iterations),
            Err(_) => "iterative".to_owned(),
        };
        let _ = write!(html, "</tr><tr><td>{}, {steps}</td>", escape(&name));
        outcome(&mut html, &answer.iterative, study, &ITERATIVE);
        printed(&mut html, iterative, ITERATIVE.len());
        html.push_str("</tr>");
    }
    html.push_str(END);
    html.push_str(
        "<p class=\"small\">With all modes method e leaves nothing for the iteration to \
         improve; the last rows show it with a modal analysis that misses the highest mode in \
         the lines.</p>",
    );
    html
}

/// A value, and its error below it.
fn two(html: &mut String, value: &str, error: &str) {
    let _ = write!(
        html,
        "<td class=\"num\">{value}<br/><span class=\"unit\">{error}</span></td>"
    );
}

/// Values with their errors, or why there are none.
fn outcome(html: &mut String, outcome: &Outcome, study: &Study, columns: &[usize]) {
    match outcome {
        Ok(solution) => {
            let found = solution.numbers.list();
            let off = solution.numbers.errors(&study.exact);
            for &c in columns {
                // Δ is a percentage itself.
                let below = if c == 4 { String::new() } else { error(off[c]) };
                two(html, &value(&found, c), &below);
            }
        }
        Err(reason) => {
            let _ = write!(
                html,
                "<td class=\"wrap none\" colspan=\"{}\">{}</td>",
                columns.len(),
                escape(reason)
            );
        }
    }
}

fn printed(html: &mut String, theirs: Option<Printed>, columns: usize) {
    match theirs {
        Some(printed) => {
            for (i, v) in printed.values.iter().take(columns).enumerate() {
                let below = printed.errors.get(i).map(|e| fixed(*e, 2));
                two(html, &fixed(*v, 2), &below.unwrap_or_default());
            }
        }
        None => {
            let _ = write!(html, "<td colspan=\"{columns}\"></td>");
        }
    }
}

/// Levels of noise beside each other.
const LEVELS: usize = 2;

/// Root mean square errors, direct and iterative.
pub(super) fn noise(study: &Study) -> String {
    let mut html = String::new();
    let rows: Vec<usize> = (0..Row::all().len()).collect();
    let iterated: Vec<usize> = rows
        .iter()
        .copied()
        .filter(|&at| Row::iterated().contains(&Row::all()[at]))
        .collect();
    html.push_str("<h3>Direct</h3>");
    for levels in study.levels.chunks(LEVELS) {
        html.push_str(&level_table(levels, &rows, true, |l, at| {
            &l.rows[at].direct
        }));
    }
    html.push_str("<h3>Iterative, range I</h3>");
    for levels in study.levels.chunks(LEVELS) {
        html.push_str(&level_table(levels, &iterated, false, |l, at| {
            &l.rows[at].iterative
        }));
    }
    html.push_str(&failures(study));
    html
}

fn level_table<'s>(
    levels: &'s [Level],
    rows: &[usize],
    with_fits: bool,
    errors: impl Fn(&'s Level, usize) -> &'s Errors,
) -> String {
    let mut html = String::new();
    let names: Vec<String> = levels.iter().map(|l| level_name(l.noise)).collect();
    let groups: Vec<(&str, &[&str])> = names.iter().map(|n| (n.as_str(), &NAMES[..4])).collect();
    head(&mut html, "Row", &groups);
    let all = Row::all();
    for &at in rows {
        let recommended = all[at].method == Method::ApparentMass;
        let mark = |text: &str| {
            if recommended {
                format!("<b>{text}</b>")
            } else {
                text.to_owned()
            }
        };
        let _ = write!(html, "<tr><td>{}</td>", mark(&escape(&all[at].name())));
        for level in levels {
            let e = errors(level, at);
            let star = if e.failed > 0 { "* " } else { "" };
            for rms in &e.rms[..4] {
                push_number(&mut html, &mark(&format!("{star}{}", error(*rms))));
            }
        }
        html.push_str("</tr>");
    }
    if with_fits && levels.iter().any(|level| level.fits.is_some()) {
        fits_of(&mut html, levels);
    }
    html.push_str(END);
    html
}

/// The rows of the fits, below those of the methods.
fn fits_of(html: &mut String, levels: &[Level]) {
    let mut row = |name: &str, of: &dyn Fn(&Fits) -> [f64; Numbers::COUNT]| {
        let _ = write!(html, "<tr><td>{name}</td>");
        for level in levels {
            let found = level.fits.as_ref().map(of);
            for i in 0..4 {
                push_number(html, &error(found.map_or(f64::NAN, |all| all[i])));
            }
        }
        html.push_str("</tr>");
    };
    row(Fits::NAME, &|fits| fits.fit.rms);
    row(Fits::BOUND, &|fits| fits.bound);
}

pub(super) fn level_name(noise: f64) -> String {
    if noise == 0.0 {
        "no noise".to_owned()
    } else {
        format!(
            "{}\u{202f}% noise",
            crate::report::number::exact(100.0 * noise)
        )
    }
}

/// Rows that did not always answer, and why.
fn failures(study: &Study) -> String {
    let mut items = String::new();
    for f in study.failures() {
        let _ = write!(
            items,
            "<li>{} at {}: no answer in {} of {} draws: {}</li>",
            escape(&f.row.name()),
            level_name(f.noise),
            f.failed,
            f.draws,
            escape(f.reason)
        );
    }
    if items.is_empty() {
        items
    } else {
        format!(
            "<p class=\"small\">* not all draws gave an answer; errors are of those that did.</p><ul class=\"small\">{items}</ul>"
        )
    }
}

//! The counts on a terminal, in a Markdown page and as JSON.

use super::tally::{Count, NAMES, Tally};
use super::{Cell, Coverage};
use anstyle::{AnsiColor, Style};
use massline_core::masslines::Method;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{Result, Write};

const BOLD: Style = Style::new().bold();
const DIM: Style = Style::new().dimmed();
const BAD: Style = AnsiColor::Red.on_default().bold();

/// Columns of single numbers: the ten; those about A follow as one range.
const TEN: [&str; 10] = ["m", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"];

fn method_name(method: Option<Method>) -> &'static str {
    method.map_or("recommended", Method::name)
}

fn percent(share: f64) -> String {
    format!("{:.0}", 100.0 * share)
}

fn tenths(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

/// Lowest and highest share about A, and whether either is outside.
fn about_a(tally: &Tally) -> Option<(String, bool)> {
    let counts = &tally.numbers[10..];
    let shares = counts.iter().filter_map(Count::share);
    let low = shares.clone().reduce(f64::min)?;
    let high = shares.reduce(f64::max)?;
    let text = if percent(low) == percent(high) {
        percent(low)
    } else {
        format!("{}–{}", percent(low), percent(high))
    };
    Some((text, counts.iter().any(Tally::is_outside)))
}

/// Lowest and highest RMS error over standard deviation of the ten.
fn ratios(tally: &Tally) -> Option<String> {
    let ratios = tally.numbers[..10].iter().filter_map(Count::ratio);
    let low = ratios.clone().reduce(f64::min)?;
    let high = ratios.reduce(f64::max)?;
    Some(format!("{low:.2}–{high:.2}"))
}

/// Least share of draws in which a number was given that is given in some, 0 to 1.
fn least_given(tally: &Tally) -> Option<f64> {
    let answered = tally.draws - tally.refused;
    let given = tally.numbers[..10].iter().map(|c| c.given);
    let least = given.filter(|&n| n > 0).min()?;
    (answered > 0).then(|| least as f64 / answered as f64)
}

/// One row as text: every cell with whether it is to be marked.
fn row(cell: &Cell) -> Vec<(String, bool)> {
    let t = &cell.tally;
    let dash = || ("-".to_owned(), false);
    let mut texts = vec![
        (cell.case.to_owned(), false),
        (format!("{} %", trimmed(100.0 * cell.noise)), false),
        (method_name(cell.method).to_owned(), false),
    ];
    texts.push(t.ten.share().map_or_else(dash, |s| (tenths(s), false)));
    for count in &t.numbers[..10] {
        let text = count
            .share()
            .map(|s| (percent(s), Tally::is_outside(count)));
        texts.push(text.unwrap_or_else(dash));
    }
    texts.push(about_a(t).unwrap_or_else(dash));
    texts.push(ratios(t).map_or_else(dash, |r| (r, false)));
    let refused = t.refused as f64 / t.draws.max(1) as f64;
    texts.push((percent(refused), false));
    let missing = least_given(t).map(|least| percent(1.0 - least));
    texts.push(missing.map_or_else(dash, |m| (m, false)));
    texts
}

fn trimmed(number: f64) -> String {
    let text = format!("{number:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn heads() -> Vec<&'static str> {
    let mut heads = vec!["case", "noise", "method", "all"];
    heads.extend(TEN);
    heads.extend(["about A", "error/bar", "refused", "missing"]);
    heads
}

/// Why the shares of a cell are outside, number by number: bias or scatter, in standard
/// deviations; `None` where none is outside.
fn causes(cell: &Cell) -> Option<String> {
    let numbers = NAMES.iter().zip(&cell.tally.numbers);
    let list: Vec<String> = numbers
        .filter(|(_, count)| Tally::is_outside(count))
        .filter_map(|(name, count)| {
            let (bias, scatter) = (count.bias()?, count.scatter()?);
            Some(format!("{name} {bias:+.1} / {scatter:.1}"))
        })
        .collect();
    (!list.is_empty()).then(|| {
        format!(
            "{} at {} %, {}: {}",
            cell.case,
            trimmed(100.0 * cell.noise),
            method_name(cell.method),
            list.join(", ")
        )
    })
}

/// Number of shares of single numbers that are outside, and of all of them.
fn outside(coverage: &Coverage) -> (usize, usize) {
    let counts = coverage.cells.iter().flat_map(|c| c.tally.numbers.iter());
    let given: Vec<&Count> = counts.filter(|c| c.given > 0).collect();
    let bad = given.iter().filter(|c| Tally::is_outside(c)).count();
    (bad, given.len())
}

/// The sums below the table: a name, all cells of it together.
fn sums(coverage: &Coverage) -> Vec<(String, Tally)> {
    let mut sums = Vec::new();
    for method in [
        None,
        Some(Method::FreeResponsesSquared),
        Some(Method::Synthesis),
    ] {
        let name = format!("all, {}", method_name(method));
        sums.push((name, coverage.over(|c| c.method == method)));
    }
    for &noise in &coverage.options.noise {
        let name = format!("all, {} % noise", trimmed(100.0 * noise));
        sums.push((name, coverage.over(|c| c.noise == noise)));
    }
    sums.push(("all together".to_owned(), coverage.total()));
    sums.retain(|(_, tally)| tally.ten.given > 0);
    sums
}

/// Prints the table, the sums, and why draws were refused.
///
/// # Errors
/// If the terminal is gone.
pub fn print(out: &mut dyn Write, coverage: &Coverage) -> Result<()> {
    writeln!(
        out,
        "{BOLD}Share of draws whose 95 % interval holds the truth, %{BOLD:#}"
    )?;
    writeln!(
        out,
        "{DIM}{} draws a cell, seed {}; a number outside 92 to 98 % (at fewer than 300 draws: outside chance) has a !{DIM:#}",
        coverage.options.draws, coverage.options.seed
    )?;
    let heads = heads();
    let rows: Vec<Vec<(String, bool)>> = coverage.cells.iter().map(row).collect();
    let width = |column: usize| {
        let cells = rows.iter().map(|r| r[column].0.chars().count() + 1);
        cells
            .chain([heads[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..heads.len()).map(width).collect();
    let mut line = String::new();
    for (column, (head, &width)) in heads.iter().zip(&widths).enumerate() {
        let _ = match column {
            0..3 => write!(line, "{head:<width$} "),
            _ => write!(line, "{head:>width$} "),
        };
    }
    writeln!(out, "\n{BOLD}{}{BOLD:#}", line.trim_end())?;
    for row in &rows {
        for (column, ((text, bad), &width)) in row.iter().zip(&widths).enumerate() {
            let style = if *bad { BAD } else { Style::new() };
            let marked = if *bad {
                format!("{text}!")
            } else {
                text.clone()
            };
            match column {
                0..3 => write!(out, "{marked:<width$} ")?,
                _ => write!(out, "{style}{marked:>width$}{style:#} ")?,
            }
        }
        writeln!(out)?;
    }
    writeln!(out)?;
    for (name, tally) in sums(coverage) {
        let share = tally.ten.share().unwrap_or(0.0);
        writeln!(
            out,
            "{name:<24} {:>5} ± {:.1} % of {} intervals; error/bar {:.2}; {} of {} draws refused",
            tenths(share),
            196.0 * tally.uncertainty(),
            tally.ten.given,
            tally.ten.ratio().unwrap_or(0.0),
            tally.refused,
            tally.draws
        )?;
    }
    let (bad, all) = outside(coverage);
    writeln!(out, "{bad} of {all} numbers are outside")?;
    if coverage.total().total_is_outside() {
        writeln!(out, "{BAD}all together are outside 94 to 96 %{BAD:#}")?;
    }
    let causes: Vec<String> = coverage.cells.iter().filter_map(causes).collect();
    if !causes.is_empty() {
        writeln!(
            out,
            "{DIM}mean / scatter of their errors, in standard deviations (0 / 1 where bars are right):{DIM:#}"
        )?;
    }
    for cause in causes {
        writeln!(out, "  {cause}")?;
    }
    for cell in coverage.cells.iter().filter(|c| c.tally.refused > 0) {
        writeln!(
            out,
            "{} at {} %, {}: {} refused: {}",
            cell.case,
            trimmed(100.0 * cell.noise),
            method_name(cell.method),
            cell.tally.refused,
            cell.tally.reason.as_deref().unwrap_or("")
        )?;
    }
    writeln!(
        out,
        "{DIM}{:.0} s of work over all threads{DIM:#}",
        coverage.work.as_secs_f64()
    )
}

/// The table as a section of a Markdown page.
#[must_use]
pub fn markdown(coverage: &Coverage) -> String {
    let mut text = String::new();
    let heads = heads();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{} draws a cell, seed {}. {:.0} s of work over all threads.\n",
        coverage.options.draws,
        coverage.options.seed,
        coverage.work.as_secs_f64()
    );
    let _ = writeln!(text, "| {} |", heads.join(" | "));
    let _ = writeln!(text, "|{}", " --- |".repeat(heads.len()));
    for cell in &coverage.cells {
        let texts: Vec<String> = row(cell)
            .into_iter()
            .map(|(text, bad)| if bad { format!("**{text}**") } else { text })
            .collect();
        let _ = writeln!(text, "| {} |", texts.join(" | "));
    }
    text.push_str("\n| together | intervals | hold the truth | error/bar | draws refused |\n");
    text.push_str("| --- | --- | --- | --- | --- |\n");
    for (name, tally) in sums(coverage) {
        let share = tenths(tally.ten.share().unwrap_or(0.0));
        let mark = if tally.total_is_outside() { "**" } else { "" };
        let _ = writeln!(
            text,
            "| {name} | {} | {mark}{share} %{mark} ± {:.1} | {:.2} | {} of {} |",
            tally.ten.given,
            196.0 * tally.uncertainty(),
            tally.ten.ratio().unwrap_or(0.0),
            tally.refused,
            tally.draws
        );
    }
    let (bad, all) = outside(coverage);
    let _ = writeln!(text, "\n{bad} of {all} numbers are outside 92 to 98 %.\n");
    for (name, what) in &coverage.cases {
        let _ = writeln!(text, "* **{name}**: {what}.");
    }
    let causes: Vec<String> = coverage.cells.iter().filter_map(causes).collect();
    if !causes.is_empty() {
        text.push_str(
            "\nMean and scatter of the errors of the numbers outside, in standard deviations: 0 and 1\n\
             where bars are right. A mean far from zero is a bias of the method.\n\n",
        );
    }
    for cause in causes {
        let _ = writeln!(text, "* {cause}");
    }
    let mut reasons = String::new();
    for cell in coverage.cells.iter().filter(|c| c.tally.refused > 0) {
        let _ = writeln!(
            reasons,
            "* {} at {} %, {}: {}",
            cell.case,
            trimmed(100.0 * cell.noise),
            method_name(cell.method),
            cell.tally.reason.as_deref().unwrap_or("")
        );
    }
    if !reasons.is_empty() {
        let _ = write!(
            text,
            "\nWhy the first refused draw of a cell was refused:\n\n{reasons}"
        );
    }
    text
}

/// The counts as one JSON document, `massline/coverage/1`.
#[derive(Debug, Serialize)]
pub struct Document {
    schema: &'static str,
    draws: usize,
    seed: u64,
    /// Over all threads.
    seconds_of_work: f64,
    numbers_outside: usize,
    numbers: usize,
    cases: Vec<CaseDocument>,
    cells: Vec<CellDocument>,
    together: Vec<SumDocument>,
}

#[derive(Debug, Serialize)]
struct CaseDocument {
    name: &'static str,
    what: &'static str,
}

#[derive(Debug, Serialize)]
struct CellDocument {
    case: &'static str,
    noise: f64,
    method: &'static str,
    draws: usize,
    refused: usize,
    reason: Option<String>,
    /// Share of intervals of the ten numbers that hold the truth.
    held: Option<f64>,
    numbers: Vec<NumberDocument>,
}

#[derive(Debug, Serialize)]
struct NumberDocument {
    name: &'static str,
    /// Draws that gave a number.
    given: usize,
    /// Share of these whose interval holds the truth.
    held: Option<f64>,
    /// Root mean square of error over standard deviation.
    error_over_std: Option<f64>,
    /// Mean of error over standard deviation.
    bias_over_std: Option<f64>,
    outside: bool,
}

#[derive(Debug, Serialize)]
struct SumDocument {
    name: String,
    intervals: usize,
    held: Option<f64>,
    /// Standard deviation of `held`, from draw to draw.
    uncertainty: f64,
    error_over_std: Option<f64>,
    outside: bool,
}

impl Document {
    /// The document of these counts.
    #[must_use]
    pub fn new(coverage: &Coverage) -> Self {
        let (numbers_outside, numbers) = outside(coverage);
        let finite = |x: Option<f64>| x.filter(|x| x.is_finite());
        let cell = |cell: &Cell| CellDocument {
            case: cell.case,
            noise: cell.noise,
            method: method_name(cell.method),
            draws: cell.tally.draws,
            refused: cell.tally.refused,
            reason: cell.tally.reason.clone(),
            held: cell.tally.ten.share(),
            numbers: (NAMES.iter().zip(&cell.tally.numbers))
                .map(|(name, count)| NumberDocument {
                    name,
                    given: count.given,
                    held: count.share(),
                    error_over_std: finite(count.ratio()),
                    bias_over_std: finite(count.bias()),
                    outside: Tally::is_outside(count),
                })
                .collect(),
        };
        let sum = |(name, tally): (String, Tally)| SumDocument {
            name,
            intervals: tally.ten.given,
            held: tally.ten.share(),
            uncertainty: tally.uncertainty(),
            error_over_std: finite(tally.ten.ratio()),
            outside: tally.total_is_outside(),
        };
        let cases = coverage.cases.iter();
        Self {
            schema: "massline/coverage/1",
            draws: coverage.options.draws,
            seed: coverage.options.seed,
            seconds_of_work: coverage.work.as_secs_f64(),
            numbers_outside,
            numbers,
            cases: cases
                .map(|&(name, what)| CaseDocument { name, what })
                .collect(),
            cells: coverage.cells.iter().map(cell).collect(),
            together: sums(coverage).into_iter().map(sum).collect(),
        }
    }
}

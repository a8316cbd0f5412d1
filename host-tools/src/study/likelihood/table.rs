//! The rows on a terminal and as JSON.

use super::{Drawn, Found, NUMBERS, Row, Scored};
use anstyle::Style;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{Result, Write};

const BOLD: Style = Style::new().bold();
const DIM: Style = Style::new().dimmed();
/// Names of the numbers.
const NAMES: [&str; NUMBERS] = ["m", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"];

/// One of the two answers of a draw.
type Of = fn(&Drawn) -> &[Option<Scored>; NUMBERS];

fn likelihood(drawn: &Drawn) -> &[Option<Scored>; NUMBERS] {
    &drawn.likelihood
}

fn band(drawn: &Drawn) -> &[Option<Scored>; NUMBERS] {
    &drawn.band
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for x in values {
        sum += x * x;
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// Figures of one answer over all draws of a row.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Figures {
    /// Root mean square error over the bound, all numbers.
    error: Option<f64>,
    /// Root mean square standard deviation over the bound, all numbers.
    claim: Option<f64>,
    /// Share of intervals that hold the truth.
    coverage: Option<f64>,
    /// Intervals.
    intervals: usize,
    /// Root mean square error over the bound of each number.
    errors: [Option<f64>; NUMBERS],
    /// Root mean square standard deviation over the bound of each number.
    claims: [Option<f64>; NUMBERS],
}

impl Figures {
    fn new(row: &Row, of: Of) -> Self {
        let all = || row.draws.iter().flat_map(|d| of(d).iter().flatten());
        let each = |i: usize| row.draws.iter().filter_map(move |d| of(d)[i]);
        let intervals = all().count();
        let held = all().filter(|s| s.holds).count();
        Self {
            error: root_mean_square(all().map(|s| s.error)),
            claim: root_mean_square(all().map(|s| s.claim)),
            coverage: (intervals > 0).then(|| held as f64 / intervals as f64),
            intervals,
            errors: core::array::from_fn(|i| root_mean_square(each(i).map(|s| s.error))),
            claims: core::array::from_fn(|i| root_mean_square(each(i).map(|s| s.claim))),
        }
    }
}

/// A row as a document.
#[derive(Clone, Debug, Serialize)]
struct RowDocument {
    case: &'static str,
    noise: f64,
    draws: usize,
    likelihood: Figures,
    band: Figures,
    /// Median over draws and numbers of the bound of the averaging band over that of all lines.
    band_bound: Option<f64>,
    stepped_back: usize,
    narrower: usize,
    /// Draws with more modes than lie below the last line and one beyond it.
    surplus_modes: usize,
    seconds_each: f64,
    reasons: Vec<String>,
}

impl RowDocument {
    fn new(row: &Row) -> Self {
        let mut bounds: Vec<f64> = row
            .draws
            .iter()
            .flat_map(|d| d.band_bound.iter().flatten().copied())
            .collect();
        bounds.sort_by(f64::total_cmp);
        let count = |of: fn(&Drawn) -> bool| row.draws.iter().filter(|d| of(d)).count();
        let work: f64 = row.draws.iter().map(|d| d.work.as_secs_f64()).sum();
        let reasons = row.draws.iter().filter_map(|d| d.stepped_back.clone());
        Self {
            case: row.case.name,
            noise: row.noise,
            draws: row.draws.len(),
            likelihood: Figures::new(row, likelihood),
            band: Figures::new(row, band),
            band_bound: bounds.get(bounds.len() / 2).copied(),
            stepped_back: count(|d| d.stepped_back.is_some()),
            narrower: count(|d| d.narrower && d.stepped_back.is_none()),
            surplus_modes: count(|d| d.surplus > 1),
            seconds_each: work / row.draws.len().max(1) as f64,
            reasons: reasons.collect(),
        }
    }
}

/// All rows as one JSON document, `massline/likelihood/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Document {
    schema: &'static str,
    structures: usize,
    duration: f64,
    seed: u64,
    seconds_of_work: f64,
    rows: Vec<RowDocument>,
}

impl Document {
    /// The document of these rows.
    #[must_use]
    pub fn new(found: &Found) -> Self {
        Self {
            schema: "massline/likelihood/1",
            structures: found.options.structures,
            duration: found.options.duration,
            seed: found.options.seed,
            seconds_of_work: found.work.as_secs_f64(),
            rows: found.rows.iter().map(RowDocument::new).collect(),
        }
    }
}

/// The rows as Markdown.
#[must_use]
pub fn markdown(found: &Found) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{} structures a row, six runs of {} s, seed {}. {:.0} s of work over all threads.\n",
        found.options.structures,
        found.options.duration,
        found.options.seed,
        found.work.as_secs_f64()
    );
    let heads = [
        "case",
        "noise",
        "error",
        "error bars",
        "held",
        "`apparent-mass`: error",
        "error bars",
        "held",
        "bound of the band",
        "stepped back",
        "fewer lines",
        "s a fit",
    ];
    let _ = writeln!(text, "| {} |", heads.join(" | "));
    let _ = writeln!(text, "|{}", " --- |".repeat(heads.len()));
    for row in &found.rows {
        let d = RowDocument::new(row);
        let _ = write!(text, "| `{}` | {} %", d.case, 100.0 * d.noise);
        for figures in [&d.likelihood, &d.band] {
            let held = figures.coverage.map(|c| format!("{:.1} %", 100.0 * c));
            let _ = write!(
                text,
                " | {} | {} | {}",
                cell(figures.error),
                cell(figures.claim),
                held.unwrap_or_else(|| "-".to_owned())
            );
        }
        let _ = writeln!(
            text,
            " | {} | {} | {} | {:.1} |",
            cell(d.band_bound),
            d.stepped_back,
            d.narrower,
            d.seconds_each
        );
    }
    text
}

fn cell(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"))
}

/// Prints the table.
///
/// # Errors
/// If the terminal is gone.
pub fn print(out: &mut dyn Write, found: &Found) -> Result<()> {
    writeln!(
        out,
        "{BOLD}Errors and error bars over the Cramér-Rao bound of all lines up to 1.2 times the second mode{BOLD:#}"
    )?;
    writeln!(
        out,
        "{DIM}{} structures a row, six runs of {} s, seed {}; root mean square over draws; `band` is apparent-mass in the averaging band{DIM:#}",
        found.options.structures, found.options.duration, found.options.seed
    )?;
    write!(
        out,
        "\n{BOLD}{:<22} {:>6} {:<5} {:>6} {:>6} {:>6}",
        "case", "noise", "by", "error", "bars", "held"
    )?;
    for name in NAMES {
        write!(out, " {name:>5}")?;
    }
    writeln!(out, "  back fewer  s{BOLD:#}")?;
    for row in &found.rows {
        let d = RowDocument::new(row);
        for (by, figures) in [("ml", &d.likelihood), ("band", &d.band)] {
            let held = figures.coverage.map(|c| 100.0 * c);
            write!(
                out,
                "{:<22} {:>6} {by:<5} {:>6} {:>6} {:>6}",
                d.case,
                format!("{} %", 100.0 * d.noise),
                cell(figures.error),
                cell(figures.claim),
                held.map_or_else(|| "-".to_owned(), |h| format!("{h:.1}")),
            )?;
            for error in figures.errors {
                write!(out, " {:>5}", cell(error))?;
            }
            if by == "ml" {
                writeln!(
                    out,
                    "  {:>4} {:>5}  {:.1}",
                    d.stepped_back, d.narrower, d.seconds_each
                )?;
            } else {
                writeln!(
                    out,
                    "  {DIM}bound of the band {}{DIM:#}",
                    cell(d.band_bound)
                )?;
            }
        }
    }
    for row in &found.rows {
        let d = RowDocument::new(row);
        if let Some(reason) = d.reasons.first() {
            writeln!(
                out,
                "{} at {} %: {} of {} stepped back, the first one since {reason}",
                d.case,
                100.0 * d.noise,
                d.stepped_back,
                d.draws
            )?;
        }
    }
    writeln!(
        out,
        "{DIM}error and bars: ml and band over the same bound; held: 95 % intervals that hold the truth, %; back: draws with the band's numbers; fewer: draws with fewer lines; s: processor time of a fit; {:.0} s of work over all threads{DIM:#}",
        found.work.as_secs_f64()
    )
}

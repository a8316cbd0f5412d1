//! The study on a terminal of a hundred columns.

use super::errors::Errors;
use super::estimate::{Numbers, Outcome};
use super::fits::Fits;
use super::monte_carlo::Level;
use super::paper::{self, Printed};
use super::rows::{Range, Row};
use super::{NAMES, NoiseKind, Study, percent};
use anstyle::{AnsiColor, Style};
use std::io::{Result, Write};

/// Width of the first column: the longest name of a row, and air.
const NAME: usize = 23;
/// Width of a column with a number.
const CELL: usize = 9;
/// Numbers shown of a level of noise.
const SHOWN: usize = 4;
/// Levels of noise beside each other.
const LEVELS: usize = 2;

const BOLD: Style = Style::new().bold();
const DIM: Style = Style::new().dimmed();

/// Prints all of it.
///
/// # Errors
/// If the terminal is gone.
pub fn print(out: &mut dyn Write, study: &Study) -> Result<()> {
    writeln!(
        out,
        "{BOLD}The paper's tuning fork, row by row on its numerical twin{BOLD:#}"
    )?;
    conditions(out, study)?;
    frequencies(out, study)?;
    table_3(out, study)?;
    table_4(out, study)?;
    if !study.levels.is_empty() {
        noise(out, study)?;
    }
    checks(out, study)
}

fn conditions(out: &mut dyn Write, study: &Study) -> Result<()> {
    let o = &study.options;
    let [_, first] = study.range(Range::I);
    let [_, second] = study.range(Range::II);
    let count = study.responses.frequencies.len();
    let rules = [
        format!(
            "noise-free rows: runs X and Z at {} m/s², rotation at {} rad/s²; mass {} g weighed",
            o.translation,
            o.rotation,
            format_args!("{:.2}", 1e3 * study.twin.truth.mass)
        ),
        format!(
            "{count} lines from {} to {} Hz; range I up to {first} Hz, II up to {second} Hz",
            o.spacing, o.highest
        ),
        format!(
            "weights W down to {} from the lines {} to {} Hz; errors in per cent",
            o.minimum_weight, o.mode_band[0], o.mode_band[1]
        ),
    ];
    for rule in rules {
        writeln!(out, "{DIM}{rule}{DIM:#}")?;
    }
    Ok(())
}

fn frequencies(out: &mut dyn Write, study: &Study) -> Result<()> {
    let titles = [
        "Table 1: natural frequencies of the fixed system, Hz",
        "Table 2: natural frequencies of the free system, Hz",
    ];
    for (title, table) in titles.iter().zip(study.tables()) {
        writeln!(out, "\n{BOLD}{title}{BOLD:#}")?;
        let columns = ["mode", "paper", "twin", "differs", "identified", "damping"];
        write!(out, "{DIM}{:<6}", columns[0])?;
        for column in &columns[1..] {
            write!(out, "{column:>11}")?;
        }
        writeln!(out, "{DIM:#}")?;
        for mode in &table {
            let (number, paper, twin) = (mode.number, mode.paper, mode.twin);
            let difference = percent::text(mode.difference);
            write!(out, "{number:<6}{paper:>11.2}{twin:>11.3}{difference:>9} %")?;
            match (mode.identified, mode.damping) {
                (Some(frequency), Some(damping)) => {
                    writeln!(out, "{frequency:>11.3}{:>9.3} %", 100.0 * damping)?;
                }
                _ => writeln!(out, "{:>11}{:>11}", "-", "-")?,
            }
        }
    }
    Ok(())
}

fn table_3(out: &mut dyn Write, study: &Study) -> Result<()> {
    writeln!(
        out,
        "\n{BOLD}Table 3: direct estimation{BOLD:#}{DIM}, errors in per cent below{DIM:#}"
    )?;
    heading(out, &["x mm", "z mm", "Θ_A g m²", "Δ %"], true)?;
    let exact = study.exact.list();
    let shown = [0, 1, 2, 4];
    line(
        out,
        "exact",
        &values(&exact, &shown),
        &printed(&paper::IDEAL, 4),
    )?;
    for (row, answer) in study.rows() {
        if row == Row::beyond_the_paper()[0] {
            writeln!(out, "\n{BOLD}The rows that the paper lacks{BOLD:#}")?;
            heading(out, &["x mm", "z mm", "Θ_A g m²", "Δ %", "Θ_S g m²"], false)?;
        }
        let theirs = paper::table_3(&row);
        let columns: &[usize] = if theirs.is_some() {
            &shown
        } else {
            &[0, 1, 2, 4, 3]
        };
        let star = if paper::contradicts_itself(&row) {
            " *"
        } else {
            ""
        };
        let name = format!("{}{star}", row.name());
        entry(out, &name, &answer.direct, study, columns, theirs, 4)?;
    }
    writeln!(out, "{DIM}{}{DIM:#}", wrapped(paper::FOOTNOTE, "* "))
}

fn table_4(out: &mut dyn Write, study: &Study) -> Result<()> {
    writeln!(
        out,
        "\n{BOLD}Table 4: direct and iterative, range I, weighted{BOLD:#}"
    )?;
    heading(out, &["x mm", "z mm", "Θ_S g m²"], true)?;
    let shown = [0, 1, 3];
    let ideal = Printed {
        values: [
            paper::IDEAL.values[0],
            paper::IDEAL.values[1],
            paper::IDEAL_THETA_S,
            0.0,
        ],
        ..paper::IDEAL
    };
    line(
        out,
        "exact",
        &values(&study.exact.list(), &shown),
        &printed(&ideal, 3),
    )?;
    for (row, modes, answer) in study.iterated() {
        let (name, theirs) = match modes {
            None => (row.method_name().to_owned(), paper::table_4(&row)),
            Some(modes) => (format!("{}, {modes} modes", row.method_name()), None),
        };
        let [direct, iterative] = theirs.map_or([None; 2], |pair| pair.map(Some));
        let steps = match &answer.iterative {
            Ok(solution) => format!("iterative ({})", solution.iterations),
            Err(_) => "iterative".to_owned(),
        };
        let name_direct = format!("{name:<NAME_OF_METHOD$}direct");
        entry(out, &name_direct, &answer.direct, study, &shown, direct, 3)?;
        let indent = format!("{:>NAME_OF_METHOD$}{steps}", "");
        entry(out, &indent, &answer.iterative, study, &shown, iterative, 3)?;
    }
    Ok(())
}

/// Room for a method in the first column of table 4.
const NAME_OF_METHOD: usize = 14;

fn heading(out: &mut dyn Write, columns: &[&str], with_paper: bool) -> Result<()> {
    let width = columns.len() * CELL;
    if with_paper {
        writeln!(
            out,
            "{DIM}{:<NAME$}{:>width$}   {:>width$}{DIM:#}",
            "", "twin", "paper"
        )?;
    }
    write!(out, "{DIM}{:<NAME$}", "")?;
    for column in columns {
        write!(out, "{column:>CELL$}")?;
    }
    if with_paper {
        write!(out, "   ")?;
        for column in columns {
            write!(out, "{column:>CELL$}")?;
        }
    }
    writeln!(out, "{DIM:#}")
}

/// Values, and below them the errors: one row as the paper prints it.
fn entry(
    out: &mut dyn Write,
    name: &str,
    outcome: &Outcome,
    study: &Study,
    columns: &[usize],
    theirs: Option<Printed>,
    printed_columns: usize,
) -> Result<()> {
    let (values, errors) = match outcome {
        Ok(solution) => {
            let errors = solution.numbers.errors(&study.exact);
            let shown = columns.iter().map(|&c| match c {
                // Δ is a percentage itself.
                4 => String::new(),
                _ => percent::text(errors[c]),
            });
            (
                values(&solution.numbers.list(), columns),
                shown.collect::<Vec<_>>(),
            )
        }
        Err(reason) => {
            return writeln!(out, "{name:<NAME$}{DIM}{reason}{DIM:#}");
        }
    };
    let (paper_values, paper_errors) = match &theirs {
        Some(p) => {
            let errors = p.errors.map(|e| format!("{e:.2}"));
            (printed(p, printed_columns), errors.to_vec())
        }
        None => (Vec::new(), Vec::new()),
    };
    line(out, name, &values, &paper_values)?;
    write!(out, "{DIM}")?;
    cells(out, "", &errors, &paper_errors)?;
    writeln!(out, "{DIM:#}")
}

fn line(out: &mut dyn Write, name: &str, ours: &[String], theirs: &[String]) -> Result<()> {
    cells(out, name, ours, theirs)?;
    writeln!(out)
}

fn cells(out: &mut dyn Write, name: &str, ours: &[String], theirs: &[String]) -> Result<()> {
    let mut text = format!("{name:<NAME$}");
    for cell in ours {
        text.push_str(&format!("{cell:>CELL$}"));
    }
    if !theirs.is_empty() {
        text.push_str("   ");
    }
    for cell in theirs {
        text.push_str(&format!("{cell:>CELL$}"));
    }
    write!(out, "{}", text.trim_end())
}

/// In the paper's units.
fn values(numbers: &[f64; Numbers::COUNT], columns: &[usize]) -> Vec<String> {
    let shown = columns.iter().map(|&c| match c {
        4 => format!("{:.2}", 100.0 * numbers[c]),
        2 | 3 => format!("{:.3}", 1e3 * numbers[c]),
        _ => format!("{:.2}", 1e3 * numbers[c]),
    });
    shown.collect()
}

fn printed(printed: &Printed, count: usize) -> Vec<String> {
    let values = printed.values.iter().take(count);
    values.map(|v| format!("{v:.2}")).collect()
}

fn noise(out: &mut dyn Write, study: &Study) -> Result<()> {
    let o = &study.options;
    writeln!(
        out,
        "\n{BOLD}Under noise: root mean square errors of {} draws, per cent{BOLD:#}",
        o.draws
    )?;
    let how = match o.noise_kind {
        NoiseKind::Recordings => format!(
            "white noise on recordings of {} s, averaged as a measurement would be; rotation at {} rad/s²",
            o.duration, o.noise_rotation
        ),
        NoiseKind::Responses => format!(
            "complex Gaussian noise on every line of the exact responses; rotation at {} rad/s²",
            o.noise_rotation
        ),
    };
    writeln!(out, "{DIM}{how}{DIM:#}")?;
    let rows = Row::all();
    let every: Vec<usize> = (0..rows.len()).collect();
    for pair in study.levels.chunks(LEVELS) {
        noise_table(out, pair, &every, "direct", |level, at| {
            &level.rows[at].direct
        })?;
        fits_of(out, pair)?;
    }
    let iterated: Vec<usize> = every
        .iter()
        .copied()
        .filter(|&at| Row::iterated().contains(&rows[at]))
        .collect();
    for pair in study.levels.chunks(LEVELS) {
        noise_table(out, pair, &iterated, "iterative", |level, at| {
            &level.rows[at].iterative
        })?;
    }
    let yellow = AnsiColor::Yellow.on_default();
    for (number, f) in study.failures().enumerate() {
        if number == 0 {
            writeln!(out)?;
        }
        let (row, level, failed, draws) = (f.row.name(), share(f.noise), f.failed, f.draws);
        let text = format!(
            "{row} at {level}: no answer in {failed} of {draws} draws: {}",
            f.reason
        );
        writeln!(out, "{yellow}{}{yellow:#}", wrapped(&text, "* "))?;
    }
    Ok(())
}

fn noise_table<'s>(
    out: &mut dyn Write,
    levels: &'s [Level],
    rows: &[usize],
    procedure: &str,
    errors: impl Fn(&'s Level, usize) -> &'s Errors,
) -> Result<()> {
    let width = SHOWN * CELL;
    write!(out, "\n{DIM}{procedure:<NAME$}")?;
    for level in levels {
        write!(out, "{:>width$}", share(level.noise))?;
    }
    write!(out, "\n{:<NAME$}", "")?;
    for _ in levels {
        for name in &NAMES[..SHOWN] {
            write!(out, "{name:>CELL$}")?;
        }
    }
    writeln!(out, "{DIM:#}")?;
    let all = Row::all();
    // The best of each column stands out.
    let best = |level: &'s Level, i: usize| {
        let rms = rows.iter().map(|&at| errors(level, at).rms[i]);
        rms.filter(|x| x.is_finite()).fold(f64::INFINITY, f64::min)
    };
    let green = AnsiColor::Green.on_default().bold();
    for &at in rows {
        write!(out, "{:<NAME$}", all[at].name())?;
        for level in levels {
            let e = errors(level, at);
            let star = if e.failed > 0 { "*" } else { "" };
            for (i, rms) in e.rms.iter().enumerate().take(SHOWN) {
                let text = format!("{:>CELL$}", format!("{star}{}", percent::text(*rms)));
                if *rms <= best(level, i) {
                    write!(out, "{green}{text}{green:#}")?;
                } else {
                    write!(out, "{text}")?;
                }
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The rows of the fits, below those of the methods.
fn fits_of(out: &mut dyn Write, levels: &[Level]) -> Result<()> {
    let mut line = |name: &str, of: &dyn Fn(&Fits) -> [f64; Numbers::COUNT]| {
        write!(out, "{name:<NAME$}")?;
        for level in levels {
            let found = level.fits.as_ref().map(of);
            for i in 0..SHOWN {
                let x = found.map_or(f64::NAN, |all| all[i]);
                write!(out, "{:>CELL$}", percent::text(x))?;
            }
        }
        writeln!(out)
    };
    if levels.iter().any(|level| level.fits.is_some()) {
        line(Fits::NAME, &|fits| fits.fit.rms)?;
        line(Fits::BOUND, &|fits| fits.bound)?;
    }
    let fewer = levels.iter().find_map(|level| {
        let (fits, rows) = (level.fits.as_ref()?, level.rows.first()?);
        let (fitted, drawn) = (&fits.fit, &rows.direct);
        let fitted = fitted.answered + fitted.failed;
        (fitted < drawn.answered + drawn.failed).then_some(fitted)
    });
    if let Some(fewer) = fewer {
        writeln!(
            out,
            "{DIM}{} of the first {fewer} draws alone{DIM:#}",
            Fits::NAME
        )?;
    }
    Ok(())
}

fn share(noise: f64) -> String {
    if noise == 0.0 {
        "no noise".to_owned()
    } else {
        format!("{} % noise", percent_of(noise))
    }
}

/// `0.001` as `0.1`, without the rounding of a binary fraction.
pub(super) fn percent_of(share: f64) -> String {
    let text = format!("{:.6}", 100.0 * share);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn checks(out: &mut dyn Write, study: &Study) -> Result<()> {
    writeln!(out, "\n{BOLD}The pattern{BOLD:#}")?;
    let (yes, no) = (AnsiColor::Green.on_default(), AnsiColor::Red.on_default());
    for check in &study.checks {
        let (style, word) = if check.holds {
            (yes, "yes")
        } else {
            (no, "no ")
        };
        writeln!(
            out,
            "{style}{word}{style:#}  {}",
            wrapped(&check.claim, "     ").trim_start()
        )?;
        writeln!(out, "{DIM}{}{DIM:#}", wrapped(&check.measured, "     "))?;
    }
    Ok(())
}

/// Lines of a hundred columns, each after `indent`.
fn wrapped(text: &str, indent: &str) -> String {
    const WIDTH: usize = 100;
    let mut lines: Vec<String> = Vec::new();
    let mut current = indent.to_owned();
    let blank = " ".repeat(indent.chars().count());
    for word in text.split_whitespace() {
        let fits = current.chars().count() + 1 + word.chars().count() <= WIDTH;
        let empty = current.trim().is_empty() || current == indent;
        if !fits && !empty {
            lines.push(std::mem::replace(&mut current, blank.clone()));
        } else if !empty {
            current.push(' ');
        }
        current.push_str(word);
    }
    lines.push(current);
    lines.join("\n")
}

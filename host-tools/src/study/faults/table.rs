//! The draws on a terminal, as Markdown and as JSON.

use super::{Drawn, Found, Outcome};
use anstyle::Style;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{Result, Write};

const BOLD: Style = Style::new().bold();
const DIM: Style = Style::new().dimmed();

/// Set-ups of one kind, counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
struct Counts {
    setups: usize,
    named: usize,
    equal: usize,
    tied: usize,
    by_size: usize,
    asked: usize,
    half: usize,
    sensor: usize,
    unnamed: usize,
    silent: usize,
    wrong: usize,
}

impl Counts {
    fn add(&mut self, outcome: Outcome) {
        self.setups += 1;
        let slot = match outcome {
            Outcome::Named => &mut self.named,
            Outcome::Equal => &mut self.equal,
            Outcome::Tied => &mut self.tied,
            Outcome::BySize => &mut self.by_size,
            Outcome::Asked => &mut self.asked,
            Outcome::Half => &mut self.half,
            Outcome::Sensor => &mut self.sensor,
            Outcome::Unnamed => &mut self.unnamed,
            Outcome::Silent => &mut self.silent,
            Outcome::Wrong => &mut self.wrong,
        };
        *slot += 1;
    }

    /// Faults that are named, or told by size.
    fn told(&self) -> usize {
        self.named + self.equal + self.tied + self.by_size
    }

    fn of<'d>(draws: impl Iterator<Item = &'d Drawn>) -> Self {
        let mut counts = Self::default();
        draws.for_each(|d| counts.add(d.outcome));
        counts
    }

    fn all(&self) -> [usize; 11] {
        [
            self.setups,
            self.named,
            self.equal,
            self.tied,
            self.by_size,
            self.asked,
            self.half,
            self.sensor,
            self.unnamed,
            self.silent,
            self.wrong,
        ]
    }
}

const HEADS: [&str; 11] = [
    "set-ups", "named", "equal", "in a tie", "by size", "asked", "half", "sensor", "unnamed",
    "silent", "wrongly",
];

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Row {
    case: String,
    /// Faults that exact data contradict.
    visible: Counts,
    /// Faults that they do not.
    invisible: Counts,
    /// Clean set-ups, and those of them in which something is accused.
    clean: usize,
    accused: usize,
}

/// One draw of the document.
#[derive(Clone, Debug, Serialize)]
struct DrawDocument<'f> {
    case: &'static str,
    seed: u64,
    faults: &'f [String],
    /// Null where only size tells the fault.
    trace: Option<f64>,
    invisible: bool,
    outcome: &'static str,
    said: &'f [String],
    foretold: bool,
}

/// All draws as one JSON document, `massline/faults/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Document<'f> {
    schema: &'static str,
    setups: usize,
    clean: usize,
    faults: usize,
    seed: u64,
    seconds_of_work: f64,
    rows: Vec<Row>,
    draws: Vec<DrawDocument<'f>>,
}

impl<'f> Document<'f> {
    /// The document of these draws.
    #[must_use]
    pub fn new(found: &'f Found) -> Self {
        let draw = |d: &'f Drawn| DrawDocument {
            case: d.case,
            seed: d.seed,
            faults: &d.faults,
            trace: d.trace.is_finite().then_some(d.trace),
            invisible: d.is_invisible(),
            outcome: word(d.outcome),
            said: &d.said,
            foretold: d.foretold,
        };
        Self {
            schema: "massline/faults/1",
            setups: found.options.setups,
            clean: found.options.clean,
            faults: found.options.faults,
            seed: found.options.seed,
            seconds_of_work: found.work.as_secs_f64(),
            rows: rows(found),
            draws: found.draws.iter().map(draw).collect(),
        }
    }
}

/// A row for each kind of set-up, and one for all.
fn rows(found: &Found) -> Vec<Row> {
    let mut names: Vec<&str> = Vec::new();
    for d in &found.draws {
        if !names.contains(&d.case) {
            names.push(d.case);
        }
    }
    let row = |name: &str, of: &dyn Fn(&Drawn) -> bool| {
        let draws = || found.draws.iter().filter(|d| of(d));
        let spoilt = || draws().filter(|d| !d.faults.is_empty());
        let clean = || draws().filter(|d| d.faults.is_empty());
        Row {
            case: name.to_owned(),
            visible: Counts::of(spoilt().filter(|d| !d.is_invisible())),
            invisible: Counts::of(spoilt().filter(|d| d.is_invisible())),
            clean: clean().count(),
            accused: clean().filter(|d| d.outcome == Outcome::Wrong).count(),
        }
    };
    let mut rows: Vec<Row> = names
        .iter()
        .map(|name| row(name, &|d| d.case == *name))
        .collect();
    rows.push(row("all", &|_| true));
    rows
}

/// The rows as Markdown.
#[must_use]
pub fn markdown(found: &Found) -> String {
    let mut text = String::new();
    let o = &found.options;
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{} set-ups with {}, {} without any, seed {}. {:.0} s of work over all threads.\n",
        o.setups,
        if o.faults == 1 {
            "one fault"
        } else {
            "two faults"
        },
        o.clean,
        o.seed,
        found.work.as_secs_f64()
    );
    let mut heads = vec!["set-up"];
    heads.extend(HEADS);
    heads.extend([
        "invisible",
        "of these told",
        "asked",
        "wrongly",
        "clean",
        "accused",
    ]);
    let _ = writeln!(text, "| {} |", heads.join(" | "));
    let _ = writeln!(text, "|{}", " --- |".repeat(heads.len()));
    for row in rows(found) {
        let _ = write!(text, "| `{}`", row.case);
        for count in row.visible.all() {
            let _ = write!(text, " | {count}");
        }
        let hidden = &row.invisible;
        let _ = writeln!(
            text,
            " | {} | {} | {} | {} | {} | {} |",
            hidden.setups,
            hidden.told(),
            hidden.asked,
            hidden.wrong,
            row.clean,
            row.accused
        );
    }
    let missed: Vec<&Drawn> = found.draws.iter().filter(|d| d.is_missed()).collect();
    if !missed.is_empty() {
        text.push_str(
            "\nVisible faults that are not told, and clean set-ups that are accused:\n\n",
        );
        text.push_str("| set-up, seed | fault | trace | said |\n| --- | --- | --- | --- |\n");
        for d in missed {
            let said = d.said.join("; ");
            let _ = writeln!(
                text,
                "| `{}` {} | {} | {} | {} |",
                d.case,
                d.seed,
                d.faults.join(", and "),
                d.size(),
                if said.is_empty() { "nothing" } else { &said }
            );
        }
    }
    let invisible: Vec<&Drawn> = found
        .draws
        .iter()
        .filter(|d| !d.faults.is_empty() && d.is_invisible())
        .collect();
    if !invisible.is_empty() {
        text.push_str("\nInvisible faults:\n\n");
        text.push_str(
            "| set-up, seed | fault | trace | reason | in `these runs do not tell` | outcome |\n",
        );
        text.push_str("| --- | --- | --- | --- | --- | --- |\n");
        for d in invisible {
            let _ = writeln!(
                text,
                "| `{}` {} | {} | {} | {} | {} | {} |",
                d.case,
                d.seed,
                d.faults.join(", and "),
                d.size(),
                d.reason(),
                if d.foretold { "yes" } else { "no" },
                word(d.outcome)
            );
        }
    }
    text
}

impl Drawn {
    /// `true` for a visible fault that is not told, and for a clean set-up that is accused.
    fn is_missed(&self) -> bool {
        match self.outcome {
            Outcome::Named | Outcome::Equal | Outcome::Tied | Outcome::BySize => false,
            Outcome::Wrong => self.faults.is_empty() || !self.is_invisible(),
            _ => !self.faults.is_empty() && !self.is_invisible(),
        }
    }

    /// The trace in words.
    fn size(&self) -> String {
        match self.trace {
            trace if trace.is_infinite() => "–".to_owned(),
            trace if trace < 0.05 => "0".to_owned(),
            trace if trace < 10.0 => format!("{trace:.1}"),
            trace => format!("{trace:.0}"),
        }
    }

    /// Reason why exact data do not tell the fault.
    fn reason(&self) -> &'static str {
        match self.trace {
            trace if trace < 1e-6 => "contradicts nothing, even without noise",
            trace if trace < 1.0 => "all but nothing moves what would show it",
            _ => "small beside noise and usual differences of sensors",
        }
    }
}

/// An outcome as one word of the documents.
fn word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Named => "named",
        Outcome::Equal => "equal",
        Outcome::Tied => "tied",
        Outcome::BySize => "by-size",
        Outcome::Asked => "asked",
        Outcome::Half => "half",
        Outcome::Sensor => "sensor",
        Outcome::Unnamed => "unnamed",
        Outcome::Silent => "silent",
        Outcome::Wrong => "wrong",
    }
}

/// Prints the table, and the draws that were not named.
///
/// # Errors
/// If the terminal is gone.
pub fn print(out: &mut dyn Write, found: &Found) -> Result<()> {
    write!(out, "{BOLD}{:<14}", "set-up")?;
    for head in HEADS {
        write!(out, " {head:>8}")?;
    }
    writeln!(out, "  invisible: told wrongly  clean accused{BOLD:#}")?;
    for row in rows(found) {
        write!(out, "{:<14}", row.case)?;
        for count in row.visible.all() {
            write!(out, " {count:>8}")?;
        }
        let hidden = &row.invisible;
        let told = hidden.told();
        writeln!(
            out,
            "  {:>9}  {told:>4} {:>7}  {:>5} {:>7}",
            hidden.setups, hidden.wrong, row.clean, row.accused
        )?;
    }
    for d in found.draws.iter().filter(|d| d.is_missed()) {
        writeln!(
            out,
            "{DIM}{} {}: {:?}, {}, trace {:.0}: {}{DIM:#}",
            d.case,
            d.seed,
            d.outcome,
            d.faults.join(" and "),
            d.trace,
            d.said.join(" | ")
        )?;
    }
    for d in found
        .draws
        .iter()
        .filter(|d| !d.faults.is_empty() && d.is_invisible())
    {
        writeln!(
            out,
            "{DIM}{} {}: invisible, {}, trace {}: {}; {}{DIM:#}",
            d.case,
            d.seed,
            d.faults.join(" and "),
            d.size(),
            d.reason(),
            word(d.outcome)
        )?;
    }
    writeln!(
        out,
        "{DIM}invisible: exact data do not contradict the set-up by more than chance; {:.0} s of work over all threads{DIM:#}",
        found.work.as_secs_f64()
    )
}

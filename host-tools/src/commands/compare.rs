//! `massline identify --method all`: the methods side by side.

use super::identify::reading;
use super::table::{Row, rows};
use super::{Failure, print_json, refuse, warn};
use crate::cli::Verbosity;
use crate::format::{significant, with_std};
use crate::identification::{Answer, Choice, Session, recommended};
use crate::result::{ComparisonDocument, FailedMethod, ResultDocument};
use crate::setup::Setup;
use crate::simulate::Truth;
use anstyle::{AnsiColor, Style};
use massline_core::masslines::Method;
use std::io::Write;

/// How the methods are shown.
#[derive(Clone, Copy, Debug)]
pub(super) struct Options {
    /// As a document.
    pub(super) json: bool,
    /// With the numbers that are refused.
    pub(super) anyway: bool,
}

/// Runs all methods on one setup and prints what each gives. Numbers that are refused stand
/// in the document; on a terminal the reason stands in their place.
///
/// # Errors
/// [`Failure`] if the recordings cannot be read, no method gives an answer, or the recommended
/// one's is refused.
pub(super) fn run(
    setup: &Setup,
    choice: &Choice,
    truth: Option<&Truth>,
    options: Options,
    verbosity: Verbosity,
) -> Result<(), Failure> {
    let (best, because) = recommended(setup);
    let mut session = Session::new(setup).with_type_b();
    let mut answers = Vec::new();
    let mut failed = Vec::new();
    let mut code = 1;
    reading(verbosity, |progress| {
        for method in Method::ALL {
            let choice = Choice {
                method: Some(method),
                ..*choice
            };
            match session.answer(&choice, progress) {
                Ok(answer) => answers.push(answer),
                Err(e) => {
                    code = e.exit_code();
                    failed.push(FailedMethod {
                        method: method.name(),
                        reason: e.to_string(),
                    });
                }
            }
        }
        Ok(())
    })?;
    if answers.is_empty() {
        let reason = failed.swap_remove(0).reason;
        return Err(Failure {
            code,
            message: reason,
        });
    }
    // The recommended method has the last word, or what is left where it gives no answer.
    let judge = answers.iter().find(|a| a.method == best);
    let refused = judge.map_or_else(
        || answers.iter().find_map(|a| a.refused.clone()),
        |judge| judge.refused.clone(),
    );
    if options.json {
        print_json(&ComparisonDocument {
            schema: "massline/comparison/1",
            title: setup.title.clone(),
            recommended: best.name(),
            recommended_because: because,
            results: answers
                .iter()
                .map(|a| ResultDocument::new(setup, a))
                .collect(),
            failed,
        })?;
        return refuse(refused.as_deref());
    }
    if !options.anyway {
        answers.retain(|answer| {
            if let Some(reason) = &answer.refused {
                failed.push(FailedMethod {
                    method: answer.method.name(),
                    reason: format!("refused: {reason}"),
                });
            }
            answer.refused.is_none()
        });
    }
    if let Some(first) = answers.first() {
        warn(&first.warnings, verbosity);
    }
    print(&setup.title, best, because, &answers, &failed, truth)
        .map_err(|e| Failure::stdout(&e))?;
    refuse(refused.as_deref())
}

/// Width of a column that holds one number of one method.
const WIDTH: usize = 15;

fn print(
    title: &str,
    best: Method,
    because: &str,
    answers: &[Answer],
    failed: &[FailedMethod],
    truth: Option<&Truth>,
) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    let (bold, dim) = (Style::new().bold(), Style::new().dimmed());
    writeln!(out, "{bold}{title}{bold:#}")?;
    writeln!(
        out,
        "{dim}values with half of their 95 % intervals; * recommended: {because}{dim:#}"
    )?;
    let tables: Vec<Vec<Row>> = answers
        .iter()
        .map(|a| rows(&a.identification, a.type_b.as_ref(), truth))
        .collect();
    // Terminals are narrow: four methods beside each other at most.
    for (answers, tables) in answers.chunks(4).zip(tables.chunks(4)) {
        writeln!(out)?;
        write!(out, "{bold}{:<18}", "")?;
        for answer in answers {
            let star = if answer.method == best { "*" } else { " " };
            write!(out, "{:>WIDTH$}", format!("{}{star}", answer.method.name()))?;
        }
        writeln!(out, "{bold:#}")?;
        for i in 0..tables[0].len() {
            if tables.iter().any(|t| t[i].estimate.is_some()) {
                print_line(&mut out, tables, i)?;
            }
        }
    }
    if !failed.is_empty() {
        writeln!(out)?;
        let yellow = AnsiColor::Yellow.on_default();
        for f in failed {
            writeln!(out, "{yellow}{}:{yellow:#} {}", f.method, f.reason)?;
        }
    }
    Ok(())
}

fn print_line(out: &mut impl Write, tables: &[Vec<Row>], i: usize) -> std::io::Result<()> {
    let row = &tables[0][i];
    let unit = if row.unit.is_empty() { "" } else { ", " };
    write!(
        out,
        "{:<18}",
        format!("{}{}{unit}{}", row.name, row.group, row.unit)
    )?;
    for table in tables {
        let text = table[i].estimate.map_or_else(
            || "-".to_owned(),
            |e| {
                let half = table[i].half_width * row.scale;
                let (value, half) = with_std(e.value * row.scale, half);
                format!("{value} ±{half}")
            },
        );
        write!(out, "{text:>WIDTH$}")?;
    }
    if let Some(truth) = row.truth {
        write!(out, "   true {}", significant(truth * row.scale, 6))?;
    }
    writeln!(out)
}

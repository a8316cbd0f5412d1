//! `massline identify --method all`: the methods side by side.

use super::progress::reading;
use super::table::{Row, rows};
use super::{Failure, print_json, refuse, warn};
use crate::commands::Verbosity;
use crate::format::{significant, with_std};
use crate::identification::{Choice, LIKELIHOOD, LIKELIHOOD_PASSES, Session, recommended};
use crate::result::{COMPARISON_SCHEMA, ComparisonDocument, FailedMethod, ResultDocument};
use crate::setup::Setup;
use crate::simulate::Truth;
use anstyle::{AnsiColor, Style};
use massline_core::masslines::Method;
use std::io::Write;

/// Options of the display.
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
    let (band, because) = recommended(setup);
    let (mut best, mut because) = (band.name(), because);
    let mut session = Session::new(setup).with_type_b();
    let mut results: Vec<ResultDocument> = Vec::new();
    let mut failed = Vec::new();
    let mut code = 1;
    reading(verbosity, |progress| {
        for method in Method::ALL {
            let choice = Choice {
                method: Some(method),
                ..*choice
            };
            match session.answer(&choice, progress) {
                Ok(answer) => results.push(ResultDocument::new(setup, &answer)),
                Err(e) => {
                    code = e.exit_code();
                    failed.push(FailedMethod {
                        method: method.name().to_owned(),
                        reason: e.to_string(),
                    });
                }
            }
        }
        if band != Method::ApparentMass {
            return Ok(());
        }
        // Where the apparent mass has no answer, neither has its fit, for the same reason.
        let Ok(fitted) = session.answer_by_likelihood(choice, progress) else {
            return Ok(());
        };
        match fitted
            .likelihood
            .as_ref()
            .and_then(|l| l.stepped_back.clone())
        {
            None => {
                results.insert(0, ResultDocument::new(setup, &fitted));
                (best, because) = (LIKELIHOOD, LIKELIHOOD_PASSES);
            }
            Some(reason) => failed.push(FailedMethod {
                method: LIKELIHOOD.to_owned(),
                reason,
            }),
        }
        Ok(())
    })?;
    if results.is_empty() {
        let reason = failed.swap_remove(0).reason;
        return Err(Failure {
            code,
            message: reason,
        });
    }
    // The recommended method has the last word, or what is left where it gives no answer.
    let judge = results.iter().find(|result| result.method == best);
    let refused = judge.map_or_else(
        || results.iter().find_map(|result| result.refused.clone()),
        |result| result.refused.clone(),
    );
    if options.json {
        print_json(&ComparisonDocument {
            schema: COMPARISON_SCHEMA.to_owned(),
            title: setup.title.clone(),
            recommended: best.to_owned(),
            recommended_because: because.to_owned(),
            results,
            failed,
        })?;
        return refuse(refused.as_deref());
    }
    if !options.anyway {
        results.retain(|result| {
            if let Some(reason) = &result.refused {
                failed.push(FailedMethod {
                    method: result.method.clone(),
                    reason: format!("refused: {reason}"),
                });
            }
            result.refused.is_none()
        });
    }
    if let Some(first) = results.first() {
        warn(&first.warnings, verbosity);
    }
    print(&setup.title, best, because, &results, &failed, truth)
        .map_err(|e| Failure::stdout(&e))?;
    refuse(refused.as_deref())
}

/// Width of a column that holds one number of one method.
const WIDTH: usize = 18;

fn print(
    title: &str,
    best: &str,
    because: &str,
    results: &[ResultDocument],
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
    let tables: Vec<Vec<Row<'_>>> = results.iter().map(|result| rows(result, truth)).collect();
    // Terminals are narrow: three methods beside each other at most.
    for (results, tables) in results.chunks(3).zip(tables.chunks(3)) {
        writeln!(out)?;
        write!(out, "{bold}{:<18}", "")?;
        for result in results {
            let star = if result.method == best { "*" } else { " " };
            write!(out, "{:>WIDTH$}", format!("{}{star}", result.method))?;
        }
        writeln!(out, "{bold:#}")?;
        for i in 0..tables[0].len() {
            if tables.iter().any(|t| t[i].number.value.is_some()) {
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

fn print_line(out: &mut impl Write, tables: &[Vec<Row<'_>>], i: usize) -> std::io::Result<()> {
    let row = &tables[0][i];
    let unit = if row.unit.is_empty() { "" } else { ", " };
    write!(
        out,
        "{:<18}",
        format!("{}{}{unit}{}", row.name, row.group, row.unit)
    )?;
    for table in tables {
        let number = table[i].number;
        let text = number.value.map_or_else(
            || "-".to_owned(),
            |value| {
                let half = number.half_width() * row.scale;
                let (value, half) = with_std(value * row.scale, half);
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

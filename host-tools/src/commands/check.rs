//! `massline check`: which sensor has which fault.

use super::progress::reading;
use super::{Failure, print_json, print_line};
use crate::commands::Verbosity;
use crate::detective::{Axis, Findings, Suspect, WholeFault, foresee};
use crate::identification::{ExamineError, Session};
use crate::setup::Setup;
use std::path::PathBuf;

/// Examine the sensors: which of them the recordings contradict, and how to mend the setup
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline check setup.toml\n  massline check setup.toml --json | jq .suspects\n  massline check setup.toml --plan --axes z\n\nExit code 1: the recordings contradict the setup, and the sensor is named."
)]
pub struct Arguments {
    /// The setup: sensors, processing and runs
    setup: PathBuf,
    /// Before the test: no recording is read, and faults are listed that the runs would not show
    #[arg(long)]
    plan: bool,
    /// Axes along or about which the runs shake the table, with --plan
    #[arg(long, value_enum, value_delimiter = ',', value_name = "AXES", requires = "plan",
        default_values_t = [Axis::X, Axis::Y, Axis::Z, Axis::Rx, Axis::Ry, Axis::Rz])]
    axes: Vec<Axis>,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup)?;
    if arguments.plan {
        return plan(&setup, arguments);
    }
    let mut session = Session::new(&setup);
    let (findings, notes) = reading(verbosity, |progress| {
        let findings = session.examine(progress)?;
        Ok((findings, session.notes(progress)))
    })?;
    if arguments.json {
        print_json(&document(&findings, &notes))?;
    } else {
        for line in lines(&findings).iter().chain(&notes) {
            print_line(line)?;
        }
    }
    if findings.clean() {
        return Ok(());
    }
    Err(Failure {
        code: 1,
        message: "the recordings contradict the setup".to_owned(),
    })
}

/// Faults that the runs would not show.
fn plan(setup: &Setup, arguments: &Arguments) -> Result<(), Failure> {
    let untold = foresee(setup, &arguments.axes).map_err(|why| Failure::because(1, why))?;
    if arguments.json {
        return print_json(&serde_json::json!({
            "schema": "massline/check-plan/1",
            "untold": untold,
        }));
    }
    if untold.is_empty() {
        return print_line(
            "these runs would show every wrong sign, every exchanged channel and every wrong position",
        );
    }
    print_line("a mistake in one of these would show nowhere in these runs:")?;
    for line in &untold {
        print_line(&format!("  {line}"))?;
    }
    Ok(())
}

impl From<ExamineError> for Failure {
    fn from(error: ExamineError) -> Self {
        match error {
            ExamineError::Answer(error) => error.into(),
            ExamineError::Undecided(why) => Self::because(1, why),
        }
    }
}

/// A suspect in words: the best explanation, and those that are as good.
fn sentence(suspect: &Suspect) -> String {
    let all: Vec<&str> = suspect
        .explanations
        .iter()
        .map(|e| e.text.as_str())
        .collect();
    match all.as_slice() {
        [one] => (*one).to_owned(),
        several => format!(
            "one of these, which the data do not tell apart: {}",
            several.join("; or ")
        ),
    }
}

/// Notes of `identify` on findings.
pub(super) fn notes(findings: &Findings) -> Vec<String> {
    let mut notes: Vec<String> = findings.suspects.iter().map(sentence).collect();
    let told = findings
        .whole
        .iter()
        .filter(|w| w.fault != WholeFault::NoUnit);
    notes.extend(told.map(|w| w.text.clone()));
    if !findings.suspects.is_empty() || findings.more_is_wrong() {
        let check = match findings.mends() {
            false => "`massline check` says more",
            true => "`massline check` prints the lines that mend the setup",
        };
        notes.push(format!("{}; {check}", findings.evidence()));
    }
    notes
}

/// Lines of `check` on findings.
fn lines(findings: &Findings) -> Vec<String> {
    let mut lines = Vec::new();
    if findings.clean() {
        lines.push(format!(
            "the sensors agree with each other and with one rigid body, within {} times what usual differences explain",
            crate::format::plain(findings.contradiction.sqrt(), 2)
        ));
        lines.extend(findings.whole.iter().map(|w| w.text.clone()));
        lines.extend(untold(findings));
        return lines;
    }
    for suspect in &findings.suspects {
        lines.push(sentence(suspect));
        for explanation in &suspect.explanations {
            if explanation.repair.is_empty() {
                continue;
            }
            lines.push(String::new());
            if suspect.explanations.len() > 1 {
                lines.push(format!("  # if {}", explanation.text));
            }
            lines.extend(explanation.repair.iter().map(|line| format!("  {line}")));
        }
        lines.push(String::new());
    }
    for whole in &findings.whole {
        lines.push(whole.text.clone());
        if !whole.repair.is_empty() {
            lines.push(String::new());
            lines.extend(whole.repair.iter().map(|line| format!("  {line}")));
            lines.push(String::new());
        }
    }
    if !findings.suspects.is_empty() || findings.more_is_wrong() {
        lines.push(findings.evidence());
    }
    lines.extend(untold(findings));
    lines
}

/// Properties that these runs do not tell, in words.
fn untold(findings: &Findings) -> Option<String> {
    let all = findings.untold.join("; ");
    (!all.is_empty()).then(|| format!("these runs do not tell: {all}"))
}

fn document(findings: &Findings, notes: &[String]) -> serde_json::Value {
    let suspect = |suspect: &Suspect| {
        let explanations: Vec<serde_json::Value> = suspect
            .explanations
            .iter()
            .map(|e| serde_json::json!({ "text": e.text, "repair": e.repair }))
            .collect();
        serde_json::json!({ "explanations": explanations })
    };
    let suspects: Vec<serde_json::Value> = findings.suspects.iter().map(suspect).collect();
    let whole: Vec<&str> = findings.whole.iter().map(|w| w.text.as_str()).collect();
    let whole_repair: Vec<&String> = findings.whole.iter().flat_map(|w| &w.repair).collect();
    serde_json::json!({
        "schema": "massline/check/1",
        "clean": findings.clean(),
        "suspects": suspects,
        "whole": whole,
        "whole_repair": whole_repair,
        "untold": findings.untold,
        "notes": notes,
        "contradiction": findings.contradiction,
        "repaired": findings.repaired,
        "freedom": findings.freedom,
        "more_is_wrong": findings.more_is_wrong(),
    })
}

//! `massline identify`: recordings to ten numbers.

use super::procedure::{Procedure, parse_method};
use super::progress::reading;
use super::{
    Failure, check, compare, details, fitted, print_json, print_numbers, refuse, true_body, warn,
};
use crate::commands::Verbosity;
use crate::detective::Findings;
use crate::identification::{Answer, Choice, LIKELIHOOD, Session, WARNED};
use crate::output::{self, Existing};
use crate::report;
use crate::result::ResultDocument;
use crate::setup::{Setup, read_document};
use crate::simulate::Truth;
use massline_core::masslines::Method;
use std::path::{Path, PathBuf};

/// Identify the ten rigid-body properties from recordings
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline identify setup.toml\n  massline identify setup.toml --report report.html\n  massline identify setup.toml --json | jq .mass\n  massline identify setup.toml --method ml\n  massline identify setup.toml --method all"
)]
pub struct Arguments {
    /// The setup: sensors, processing and runs
    setup: PathBuf,
    /// Method that finds the masslines; the recommended one if absent
    #[arg(long, value_parser = parse_wanted, value_name = "NAME|all")]
    method: Option<Wanted>,
    #[command(flatten)]
    procedure: Procedure,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write a report with plots; an earlier report is replaced
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Have the report replace a file that is none
    #[arg(long, requires = "report")]
    force: bool,
    /// Compare with the truth.json of a simulation
    #[arg(long, value_name = "FILE.json")]
    truth: Option<PathBuf>,
    /// Print numbers that are refused because the data contradict them; exit code 1 stays
    #[arg(long)]
    anyway: bool,
}

/// One method, or all of them side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wanted {
    One(Method),
    Likelihood,
    All,
}

fn parse_wanted(name: &str) -> Result<Wanted, String> {
    match name {
        "all" => Ok(Wanted::All),
        LIKELIHOOD => Ok(Wanted::Likelihood),
        name => parse_method(name, ", ml, and all").map(Wanted::One),
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup)?;
    let truth = arguments.truth.as_deref().map(read_truth).transpose()?;
    let choice = Choice {
        method: match arguments.method {
            Some(Wanted::One(method)) => Some(method),
            _ => None,
        },
        iterative: arguments.procedure.iterative,
        weighted: arguments.procedure.weighted(),
    };
    if arguments.method == Some(Wanted::All) {
        if arguments.report.is_some() {
            return Err(Failure::input(
                "--report shows one method; leave out `--method all`, or name the method to report",
            ));
        }
        let options = compare::Options {
            json: arguments.json,
            anyway: arguments.anyway,
        };
        return compare::run(&setup, &choice, truth.as_ref(), options, verbosity);
    }
    if let Some(path) = &arguments.report {
        let recordings = setup.runs.iter().map(|run| setup.recording_path(run));
        let recordings: Vec<PathBuf> = recordings.collect();
        let inputs = recordings.iter().chain([&arguments.setup]);
        let inputs = inputs.chain(&arguments.truth).map(PathBuf::as_path);
        let existing = Existing::KeepUnlessReport.or_force(arguments.force);
        output::check(path, inputs, existing)?;
    }
    let fitted = arguments.method == Some(Wanted::Likelihood);
    let (answer, findings) = with_progress(&setup, &choice, fitted, verbosity)?;
    let mut result = ResultDocument::new(&setup, &answer);
    if let Some(found) = &findings {
        result.findings = crate::result::findings(&setup, found);
    }
    if let Some(path) = &arguments.report {
        let truth = truth.as_ref().map(true_body);
        let page = report::render(&setup, &answer, &result, truth.as_ref());
        output::write(path, page.as_bytes())?;
    }
    if arguments.json {
        print_json(&result)?;
        return refuse(result.refused.as_deref());
    }
    warn(&result.warnings, verbosity);
    if let Some(findings) = &findings {
        warn(&check::notes(findings), verbosity);
    }
    details::show(&setup, &answer, &result, verbosity);
    if result.refused.is_none() || arguments.anyway {
        show(&result, truth.as_ref())?;
        if let Some(fit) = &result.likelihood {
            fitted::print(&mut anstream::stdout(), fit).map_err(|e| Failure::stdout(&e))?;
        }
    }
    if let Some(path) = &arguments.report
        && !verbosity.quiet
    {
        eprintln!("report: {}", path.display());
    }
    refuse(result.refused.as_deref())
}

/// The answer to a setup, of the method `ml` if `fitted`, with a bar on the terminal meanwhile;
/// where the data contradict it, what they say of the sensors, too.
///
/// # Errors
/// As [`Session::answer`].
pub(super) fn with_progress(
    setup: &Setup,
    choice: &Choice,
    fitted: bool,
    verbosity: Verbosity,
) -> Result<(Answer, Option<Findings>), Failure> {
    let mut session = Session::new(setup).with_type_b();
    reading(verbosity, |progress| {
        let answer = if fitted {
            session.answer_by_likelihood(choice, progress)?
        } else {
            session.answer(choice, progress)?
        };
        let answer = session.add_modes(answer, progress)?;
        let doubtful = answer.refused.is_some()
            || answer
                .consistency
                .is_some_and(|test| test.probability < WARNED);
        // What cannot be examined has been answered all the same.
        let findings = doubtful.then(|| session.examine(progress).ok()).flatten();
        Ok((answer, findings.filter(|findings| !findings.clean())))
    })
}

pub(super) fn show(result: &ResultDocument, truth: Option<&Truth>) -> Result<(), Failure> {
    print_numbers(&mut anstream::stdout(), result, truth).map_err(|e| Failure::stdout(&e))
}

fn read_truth(path: &Path) -> Result<Truth, Failure> {
    let wrong = |e: &dyn std::fmt::Display| {
        Failure::input(format!(
            "{}: {e}; expected the truth.json that `massline simulate` writes",
            path.display()
        ))
    };
    let text = read_document(path)?;
    serde_json::from_slice(&text).map_err(|e| wrong(&e))
}

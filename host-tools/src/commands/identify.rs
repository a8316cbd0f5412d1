//! `massline identify`: recordings to ten numbers.

use super::procedure::Procedure;
use super::progress::reading;
use super::{
    Failure, compare, details, fitted, print_json, print_numbers, refuse, true_body, warn,
};
use crate::commands::Verbosity;
use crate::identification::{Answer, Choice, LIKELIHOOD, Session};
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
    #[arg(long, value_parser = parse_method, value_name = "NAME|all")]
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

fn parse_method(name: &str) -> Result<Wanted, String> {
    let known = || {
        let names = Method::ALL.iter().map(|m| m.name());
        let names: Vec<&str> = names.chain([LIKELIHOOD]).collect();
        names.join(", ")
    };
    if name == "all" {
        return Ok(Wanted::All);
    }
    if name == LIKELIHOOD {
        return Ok(Wanted::Likelihood);
    }
    Method::ALL
        .into_iter()
        .find(|m| m.name() == name)
        .map(Wanted::One)
        .ok_or_else(|| format!("the methods are: {}, and all", known()))
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup).map_err(Failure::input)?;
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
    let answer = if arguments.method == Some(Wanted::Likelihood) {
        let mut session = Session::new(&setup).with_type_b();
        reading(verbosity, |progress| {
            let answer = session.answer_by_likelihood(&choice, progress)?;
            Ok(session.add_modes(answer, progress)?)
        })?
    } else {
        with_progress(&setup, &choice, verbosity)?
    };
    let result = ResultDocument::new(&setup, &answer);
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

/// The answer to a setup, with a bar on the terminal meanwhile.
///
/// # Errors
/// As [`Session::answer`].
pub(super) fn with_progress(
    setup: &Setup,
    choice: &Choice,
    verbosity: Verbosity,
) -> Result<Answer, Failure> {
    let mut session = Session::new(setup).with_type_b();
    reading(verbosity, |progress| {
        Ok(session.answer_with_modes(choice, progress)?)
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
    let text = read_document(path).map_err(Failure::input)?;
    serde_json::from_slice(&text).map_err(|e| wrong(&e))
}

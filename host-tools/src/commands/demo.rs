//! `massline demo`: the main job on an embedded example, no arguments, no hardware.

use super::{Failure, details, identify, print_json, refuse, simulate, true_body, warn};
use crate::commands::Verbosity;
use crate::identification::{Answer, Choice, Wanted};
use crate::output::{self, Existing};
use crate::report;
use crate::result::ResultDocument;
use crate::setup::Setup;
use crate::simulate::{Model, Options, Truth};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Shake a tuning fork, record it, identify it, compare with the truth
#[derive(clap::Args)]
#[command(after_help = "Example:\n  massline demo --out demo && open demo/report.html")]
pub struct Arguments {
    /// Folder for setup, recordings, result and report
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Replace files of the same names that this program has not simulated
    #[arg(long)]
    force: bool,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// White noise on every channel, as a share of its RMS.
const NOISE: f64 = 0.01;

#[derive(Serialize)]
struct Document {
    #[serde(flatten)]
    result: ResultDocument,
    truth: Truth,
}

/// Options of the simulation of the fork.
pub(crate) fn options() -> Options {
    Options {
        noise: Some(NOISE),
        weighed: true,
        ..Options::default()
    }
}

/// Files and result of a demonstration.
pub(crate) struct Left {
    path: PathBuf,
    html: PathBuf,
    setup: Setup,
    truth: Truth,
    answer: Answer,
    result: ResultDocument,
}

/// Simulates, identifies by the method that is wanted, and reports into a folder.
///
/// # Errors
/// [`Failure`] with the reason.
pub(crate) fn leave(
    folder: &Path,
    options: &Options,
    wanted: Wanted,
    force: bool,
    verbosity: Verbosity,
) -> Result<Left, Failure> {
    let model = Model::fork()?;
    let simulation = simulate::with_progress(&model, options, verbosity)?;
    let html = folder.join("report.html");
    output::check(&html, [], Existing::KeepUnlessReport.or_force(force))?;
    simulation.check(folder, &[], force)?;
    let path = simulation.write(folder)?;
    let truth = simulation.truth;
    let setup = Setup::read(&path)?;
    let (answer, _) = identify::with_progress(&setup, wanted, &Choice::default(), None, verbosity)?;
    let result = ResultDocument::new(&setup, &answer);
    let page = report::render(&setup, &answer, &result, Some(&true_body(&truth)));
    output::write(&html, page.as_bytes())?;
    Ok(Left {
        path,
        html,
        setup,
        truth,
        answer,
        result,
    })
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let Left {
        path,
        html,
        setup,
        truth,
        answer,
        result,
    } = leave(
        &arguments.out,
        &options(),
        Wanted::Recommended,
        arguments.force,
        verbosity,
    )?;
    if arguments.json {
        let refused = result.refused.clone();
        print_json(&Document { result, truth })?;
        return refuse(refused.as_deref());
    }
    warn(&result.warnings, verbosity);
    details::show(&setup, &answer, &result, verbosity);
    identify::show(&result, Some(&truth))?;
    if !verbosity.quiet {
        eprintln!();
        eprintln!("report:  {}", html.display());
        eprintln!("try it:  massline identify {} --method all", path.display());
    }
    refuse(result.refused.as_deref())
}

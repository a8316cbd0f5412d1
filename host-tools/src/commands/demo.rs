//! `massline demo`: the main job on an embedded example, no arguments, no hardware.

use super::{
    Failure, details, identify, print_json, refuse, simulate, true_body, warn, write_file,
};
use crate::cli::Verbosity;
use crate::identification::Choice;
use crate::report;
use crate::result::ResultDocument;
use crate::setup::Setup;
use crate::simulate::{Model, Options, Truth};
use serde::Serialize;
use std::path::PathBuf;

/// Shake a tuning fork, record it, identify it, compare with the truth
#[derive(clap::Args)]
#[command(after_help = "Example:\n  massline demo --out demo && open demo/report.html")]
pub struct Arguments {
    /// Folder for setup, recordings, result and report
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
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

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let model = Model::fork().map_err(Failure::input)?;
    let options = Options {
        noise: Some(NOISE),
        weighed: true,
        ..Options::default()
    };
    let simulation = simulate::with_progress(&model, &options, verbosity)?;
    let path = simulation.write(&arguments.out).map_err(Failure::input)?;
    let truth = simulation.truth;
    let setup = Setup::read(&path).map_err(Failure::input)?;
    let answer = identify::with_progress(&setup, &Choice::default(), verbosity)?;
    let html = arguments.out.join("report.html");
    write_file(
        &html,
        &report::render(&setup, &answer, Some(&true_body(&truth))),
    )?;
    let result = ResultDocument::new(&setup, &answer);
    if arguments.json {
        print_json(&Document { result, truth })?;
        return refuse(answer.refused.as_deref());
    }
    warn(&answer.warnings, verbosity);
    details::show(&setup, &answer, verbosity);
    identify::show(&setup.title, &answer, Some(&truth))?;
    if !verbosity.quiet {
        eprintln!();
        eprintln!("report:  {}", html.display());
        eprintln!(
            "try it:  massline identify {} --method b-cholesky",
            path.display()
        );
    }
    refuse(answer.refused.as_deref())
}

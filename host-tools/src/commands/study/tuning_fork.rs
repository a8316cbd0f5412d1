//! `massline study tuning-fork`: the paper's numerical example, row by row.

use crate::commands::{Bar, Failure, Verbosity, print_json};
use crate::output::{self, Existing};
use crate::study::{self, Document, Options};
use std::path::PathBuf;

/// Repeat the paper's numerical example, row by row, and more under noise
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study tuning-fork\n  massline study tuning-fork --draws 0\n  massline study tuning-fork --noise 0.003,0.01 --draws 200 --report study.html\n  massline study tuning-fork --json | jq '.pattern[] | select(.holds | not)'\n\nThe paper (Schedlinski and Link) leaves its set-up open in places: what it leaves open is an option, and stands in the JSON."
)]
pub struct Arguments {
    #[command(flatten)]
    options: Options,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write a report with plots; an earlier report is replaced
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Have the report replace a file that is none
    #[arg(long, requires = "report")]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    if let Some(path) = &arguments.report {
        let existing = Existing::KeepUnlessReport.or_force(arguments.force);
        output::check(path, [], existing)?;
    }
    let bar = Bar::new("studying", verbosity);
    let options = &arguments.options;
    let study = study::run(options, &mut |share| {
        let done = (share * options.draws as f64 * (1.0 + options.noise.len() as f64)).round();
        bar.set(share, &format!("draw {done}"));
    })?;
    drop(bar);
    if let Some(path) = &arguments.report {
        output::write(path, study::render(&study).as_bytes())?;
    }
    if arguments.json {
        return print_json(&Document::new(&study));
    }
    study::print(&mut anstream::stdout(), &study)
        .map_err(|e| Failure::input(format!("stdout: {e}")))?;
    if let Some(path) = &arguments.report
        && !verbosity.quiet
    {
        eprintln!("report: {}", path.display());
    }
    Ok(())
}

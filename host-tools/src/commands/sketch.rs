//! `massline sketch`: the sensors of a setup in three views.

use super::Failure;
use crate::commands::Verbosity;
use crate::output::{self, Existing};
use crate::report::sketch;
use crate::setup::Setup;
use std::io::Write;
use std::path::PathBuf;

/// Draw the sensors of a setup in three views, without recordings
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline sketch setup.toml --out setup.svg\n  massline sketch setup.toml > setup.svg"
)]
pub struct Arguments {
    /// The setup
    setup: PathBuf,
    /// The SVG file to write; stdout if absent
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the file if it is there already
    #[arg(long, requires = "out")]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    if let Some(file) = &arguments.out {
        let existing = Existing::Keep.or_force(arguments.force);
        output::check(file, [arguments.setup.as_path()], existing)?;
    }
    let svg = sketch::svg(&Setup::read(&arguments.setup)?);
    match &arguments.out {
        Some(file) => {
            output::write(file, svg.as_bytes())?;
            if !verbosity.quiet {
                eprintln!("sketch: {}", file.display());
            }
            Ok(())
        }
        None => std::io::stdout()
            .write_all(svg.as_bytes())
            .map_err(|error| Failure::stdout(&error)),
    }
}

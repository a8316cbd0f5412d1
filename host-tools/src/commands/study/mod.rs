//! `massline study`: what the methods do, over many simulated tests.

mod coverage;
mod faults;
mod likelihood;
mod plans;
mod tuning_fork;

use super::Failure;
use crate::commands::Verbosity;
use crate::output;
use crate::study::marked;
use std::path::{Path, PathBuf};

/// Study the methods on simulated tests: the paper's example, how honest the error bars are, how near the limit
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study tuning-fork\n  massline study coverage --draws 60 --case fork\n  massline study plans --plans 200"
)]
pub struct Arguments {
    #[command(subcommand)]
    study: Study,
}

#[derive(clap::Subcommand)]
enum Study {
    TuningFork(Box<tuning_fork::Arguments>),
    Coverage(coverage::Arguments),
    Faults(faults::Arguments),
    Likelihood(likelihood::Arguments),
    Plans(plans::Arguments),
}

/// Help of an option that takes one of these names.
fn one_of(kind: &str, names: &[&str]) -> String {
    format!(
        "One kind of {kind} only; may be given several times [possible: {}]",
        names.join(", ")
    )
}

/// A Markdown page that a table goes into, read before an hour of work rather than after it.
struct Page {
    name: &'static str,
    /// Its path and its text.
    at: Option<(PathBuf, String)>,
}

impl Page {
    /// Reads a page with the marks of `name`; none if there is no path.
    fn read(path: Option<&Path>, name: &'static str) -> Result<Self, Failure> {
        let read = |path: &Path| {
            let text = std::fs::read_to_string(path)
                .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))?;
            if marked::insert(&text, name, "").is_none() {
                let [begin, end] = marked::marks(name);
                return Err(Failure::input(format!(
                    "{}: expected the lines `{begin}` and `{end}`, between which the table goes",
                    path.display()
                )));
            }
            Ok((path.to_owned(), text))
        };
        let at = path.map(read).transpose()?;
        Ok(Self { name, at })
    }

    /// Writes the table between its marks.
    fn write(&self, table: impl FnOnce() -> String) -> Result<(), Failure> {
        if let Some((path, page)) = &self.at {
            let new = marked::insert(page, self.name, &table());
            output::write(path, new.as_ref().unwrap_or(page).as_bytes())?;
        }
        Ok(())
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    match &arguments.study {
        Study::TuningFork(a) => tuning_fork::run(a, verbosity),
        Study::Coverage(a) => coverage::run(a, verbosity),
        Study::Faults(a) => faults::run(a, verbosity),
        Study::Likelihood(a) => likelihood::run(a, verbosity),
        Study::Plans(a) => plans::run(a, verbosity),
    }
}

//! `massline study coverage`: how many 95 % intervals hold the truth.

use super::Page;
use crate::commands::{Bar, Failure, Verbosity, print_json};
use crate::study::coverage::{self, Document, Options};
use std::path::PathBuf;

/// Name of the marks in a page.
const NAME: &str = "coverage";

/// Count how many 95 % intervals hold the truth, over many simulated tests
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study coverage\n  massline study coverage --case fork --draws 1000\n  massline study coverage --page host-tools/coverage.md\n\nExit code 1: all intervals together hold the truth in less than 94 or more than 96 %."
)]
pub struct Arguments {
    #[command(flatten)]
    options: Options,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write the table into a Markdown page, between `<!-- coverage: begin -->` and `<!-- coverage:
    /// end -->`
    #[arg(long, value_name = "FILE.md")]
    page: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let page = Page::read(arguments.page.as_deref(), NAME)?;
    let bar = Bar::new("counting", verbosity);
    let found = coverage::run(&arguments.options, &mut |share, case| bar.set(share, case))?;
    drop(bar);
    page.write(|| coverage::markdown(&found))?;
    if arguments.json {
        print_json(&Document::new(&found))?;
    } else {
        coverage::print(&mut anstream::stdout(), &found).map_err(|e| Failure::stdout(&e))?;
    }
    if found.total().total_is_outside() {
        return Err(Failure {
            code: 1,
            message: "all intervals together hold the truth in less than 94 or more than 96 %"
                .to_owned(),
        });
    }
    Ok(())
}

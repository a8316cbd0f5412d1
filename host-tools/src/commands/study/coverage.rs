//! `massline study coverage`: how many 95 % intervals hold the truth.

use crate::commands::Verbosity;
use crate::commands::{Bar, Failure, print_json};
use crate::output;
use crate::study::coverage::{self, CoverageError, Document, Options};
use std::path::{Path, PathBuf};

/// Count how many 95 % intervals hold the truth, over many simulated tests
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study coverage\n  massline study coverage --case fork --draws 1000\n  massline study coverage --page host-tools/coverage.md\n\nExit code 1: all intervals together hold the truth in less than 94 or more than 96 %."
)]
pub struct Arguments {
    /// Draws a cell: a case at a level of noise by a method
    #[arg(long, value_name = "N", default_value_t = Options::default().draws)]
    draws: usize,
    /// One case only; may be given several times [possible: fork, satellite, elastic, remounted, sine, poses, no-drive, twelve-blocks]
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
    /// Levels of noise, each a share of a channel's RMS over all runs
    #[arg(long, value_name = "R,R,…", value_delimiter = ',', default_values_t = Options::default().noise)]
    noise: Vec<f64>,
    /// Seed of the first draw; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u64,
    /// Threads; the counts do not depend on it [default: one a processor]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write the table into a Markdown page, between `<!-- coverage: begin -->` and `<!-- coverage: end -->`
    #[arg(long, value_name = "FILE.md")]
    page: Option<PathBuf>,
}

impl From<CoverageError> for Failure {
    fn from(error: CoverageError) -> Self {
        Self::input(error)
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    // Before an hour of work rather than after it.
    let page = arguments.page.as_deref().map(read_page).transpose()?;
    let options = Options {
        draws: arguments.draws,
        cases: arguments.cases.clone(),
        noise: arguments.noise.clone(),
        seed: arguments.seed,
        threads: arguments.threads,
    };
    let bar = Bar::new("counting", verbosity);
    let found = coverage::run(&options, &mut |share, case| bar.set(share, case))?;
    drop(bar);
    if let (Some(path), Some(page)) = (&arguments.page, page) {
        let new = coverage::insert(&page, &coverage::markdown(&found));
        output::write(path, new.unwrap_or(page).as_bytes())?;
    }
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

fn read_page(path: &Path) -> Result<String, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))?;
    if coverage::insert(&text, "").is_none() {
        return Err(Failure::input(format!(
            "{}: expected the lines `<!-- coverage: begin -->` and `<!-- coverage: end -->`, between which the table goes",
            path.display()
        )));
    }
    Ok(text)
}

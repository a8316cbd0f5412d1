//! `massline study likelihood`: the maximum likelihood fit beside its bound.

use super::{Page, one_of};
use crate::commands::{Bar, Failure, Verbosity, at_least_one, print_json};
use crate::study::likelihood::{self, Document, Options};
use std::path::PathBuf;

/// Name of the marks in a page.
const NAME: &str = "likelihood";

/// Hold method ml against the Cramér-Rao bound and the band's method, over random structures
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study likelihood --structures 40\n  massline study likelihood --case drive --noise 0.01 --structures 4\n  massline study likelihood --json | jq '.rows[].likelihood.error'"
)]
pub struct Arguments {
    /// Random structures a row
    #[arg(long, value_name = "N", default_value_t = Options::default().structures)]
    structures: usize,
    #[arg(long = "case", value_name = "NAME", help = one_of("test", &likelihood::CASES.map(|case| case.name)))]
    cases: Vec<String>,
    /// Levels of noise, each a share of a channel's RMS over all runs
    #[arg(long, value_name = "R,R,…", value_delimiter = ',', default_values_t = Options::default().noise)]
    noise: Vec<f64>,
    /// Length of each run, s
    #[arg(long, value_name = "S", default_value_t = Options::default().duration)]
    duration: f64,
    /// Seed of the first structure; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u64,
    /// Threads; the figures do not depend on it [default: one a processor]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    threads: Option<usize>,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write the table into a Markdown page, between `<!-- likelihood: begin -->` and
    /// `<!-- likelihood: end -->`
    #[arg(long, value_name = "FILE.md")]
    page: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let options = Options {
        structures: arguments.structures,
        noise: arguments.noise.clone(),
        cases: arguments.cases.clone(),
        duration: arguments.duration,
        seed: arguments.seed,
        threads: arguments.threads,
    };
    let page = Page::read(arguments.page.as_deref(), NAME)?;
    let bar = Bar::new("fitting", verbosity);
    let found = likelihood::run(&options, &mut |share, case| bar.set(share, case))?;
    drop(bar);
    page.write(|| likelihood::markdown(&found))?;
    if arguments.json {
        return print_json(&Document::new(&found));
    }
    likelihood::print(&mut anstream::stdout(), &found).map_err(|e| Failure::stdout(&e))
}

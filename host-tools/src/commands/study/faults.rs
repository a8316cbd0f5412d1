//! `massline study faults`: the detective on set-ups with faults.

use super::{Page, one_of};
use crate::commands::{Bar, Failure, Verbosity, at_least_one, print_json};
use crate::study::faults::{self, Document, Options};
use std::path::PathBuf;

/// Hold `massline check` against random set-ups with faults and without
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study faults --setups 40 --clean 0\n  massline study faults --faults 2 --setups 100 --clean 0\n  massline study faults --json | jq '.draws[] | select(.outcome == \"wrong\")'"
)]
pub struct Arguments {
    /// Set-ups with faults
    #[arg(long, value_name = "N", default_value_t = Options::default().setups)]
    setups: usize,
    /// Set-ups without faults
    #[arg(long, value_name = "N", default_value_t = Options::default().clean)]
    clean: usize,
    /// Faults in a set-up: 1 or 2
    #[arg(long, value_name = "N", default_value_t = Options::default().faults)]
    faults: usize,
    #[arg(long = "case", value_name = "NAME", help = one_of("set-up", &faults::cases()))]
    cases: Vec<String>,
    /// Seed of the first set-up; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u64,
    /// Threads; the figures do not depend on it [default: one a processor]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    threads: Option<usize>,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write the table into a Markdown page, between `<!-- faults: begin -->` and
    /// `<!-- faults: end -->`, or of two faults `<!-- pairs: begin -->` and `<!-- pairs: end -->`
    #[arg(long, value_name = "FILE.md")]
    page: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let options = Options {
        setups: arguments.setups,
        clean: arguments.clean,
        faults: arguments.faults,
        cases: arguments.cases.clone(),
        seed: arguments.seed,
        threads: arguments.threads,
    };
    let name = if options.faults == 2 {
        "pairs"
    } else {
        "faults"
    };
    let page = Page::read(arguments.page.as_deref(), name)?;
    let bar = Bar::new("examining", verbosity);
    let found = faults::run(&options, &mut |share, case| bar.set(share, case))?;
    drop(bar);
    page.write(|| faults::markdown(&found))?;
    if arguments.json {
        return print_json(&Document::new(&found));
    }
    faults::print(&mut anstream::stdout(), &found).map_err(|e| Failure::stdout(&e))
}

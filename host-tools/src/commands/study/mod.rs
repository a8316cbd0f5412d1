//! `massline study`: what the methods do, over many simulated tests.

mod coverage;
mod likelihood;
mod plans;
mod tuning_fork;

use super::Failure;
use crate::commands::Verbosity;

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
    Likelihood(likelihood::Arguments),
    Plans(plans::Arguments),
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    match &arguments.study {
        Study::TuningFork(a) => tuning_fork::run(a, verbosity),
        Study::Coverage(a) => coverage::run(a, verbosity),
        Study::Likelihood(a) => likelihood::run(a, verbosity),
        Study::Plans(a) => plans::run(a, verbosity),
    }
}

//! `massline simulate`: a model to a setup with recordings.

use super::{Bar, Failure, print_line};
use crate::cli::Verbosity;
use crate::simulate::{Model, Options, Simulation, simulate};
use std::path::{Path, PathBuf};

/// Simulate a test: a model to a setup with recordings
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline simulate fork --out fork\n  massline simulate satellite.toml --out sat --noise 0.01 --seed 7 --duration 60\n\nThe same seed gives the same bytes. MODEL `fork` is the built-in tuning fork."
)]
pub struct Arguments {
    /// A model: our .toml, a plane beam model .json, or `fork`
    model: PathBuf,
    /// Folder for setup.toml, the recordings and truth.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// White noise on every channel, as a share of its RMS; 0 for none
    #[arg(long, value_name = "R")]
    noise: Option<f64>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Length of each recording, s
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Do not record the drive signals
    #[arg(long)]
    no_drive: bool,
    /// State the mass in the setup, as if it had been weighed
    #[arg(long)]
    weighed: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let model = if arguments.model == Path::new("fork") {
        Model::fork()
    } else {
        Model::read(&arguments.model)
    }
    .map_err(Failure::input)?;
    let options = Options {
        noise: arguments.noise,
        seed: arguments.seed,
        duration: arguments.duration,
        drive: arguments.no_drive.then_some(false),
        weighed: arguments.weighed,
        ..Options::default()
    };
    let simulation = with_progress(&model, &options, verbosity)?;
    let setup = simulation.write(&arguments.out).map_err(Failure::input)?;
    print_line(&setup.display().to_string())?;
    if !verbosity.quiet {
        eprintln!(
            "next: massline identify {} --truth {}",
            setup.display(),
            arguments.out.join("truth.json").display()
        );
    }
    Ok(())
}

pub(super) fn with_progress(
    model: &Model,
    options: &Options,
    verbosity: Verbosity,
) -> Result<Simulation, Failure> {
    let bar = Bar::new("simulating", verbosity);
    simulate(model, options, &mut |p| {
        bar.set(p.done as f64 / p.total.max(1) as f64, p.run);
    })
    .map_err(Failure::input)
}

//! `massline simulate`: a model to a setup with recordings.

use super::{Bar, Failure, print_line};
use crate::commands::Verbosity;
use crate::prediction;
use crate::recording::Written;
use crate::rig::{self, Trouble, Troubles};
use crate::simulate::{self, Model, Options, Simulation};
use std::path::{Path, PathBuf};

/// Simulate a test: a model to a setup with recordings
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline simulate fork --out fork\n  massline simulate satellite.toml --out sat --noise 0.01 --seed 7 --duration 60\n  massline simulate fork --out bad --fault checksum --fault open\n\nThe same seed gives the same bytes. MODEL `fork` is the built-in tuning fork."
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
    /// Record as the box would: its converters, driver and acquisition, modelled
    #[arg(long)]
    through_converters: bool,
    /// Have something go wrong on the way through the converters; may be given several times
    #[arg(long, value_name = "KIND", value_parser = Trouble::parse)]
    fault: Vec<Trouble>,
    /// Faults per minute, of all kinds together
    #[arg(long, value_name = "N", default_value_t = 4.0, requires = "fault")]
    fault_rate: f64,
    /// State the mass in the setup, as if it had been weighed
    #[arg(long)]
    weighed: bool,
    /// Format of the recordings: csv, or parquet, which holds set-up, units and directions, too
    #[arg(long, value_enum, default_value_t = Written::Csv, hide_possible_values = true)]
    format: Written,
    /// Replace files of the same names that this program has not simulated
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let (model, inputs) = if arguments.model == Path::new("fork") {
        (Model::fork(), Ok(Vec::new()))
    } else {
        (
            Model::read(&arguments.model),
            Model::files(&arguments.model),
        )
    };
    let (model, inputs) = (model?, inputs?);
    let options = Options {
        noise: arguments.noise,
        seed: arguments.seed,
        duration: arguments.duration,
        drive: arguments.no_drive.then_some(false),
        weighed: arguments.weighed,
        ..Options::default()
    };
    let rate = arguments.fault_rate;
    if !(rate.is_finite() && rate >= 0.0) {
        return Err(Failure::input(format!(
            "--fault-rate {rate}: expected a number of faults per minute, 0 or more"
        )));
    }
    let mut simulation = with_progress(&model, &options, verbosity)?;
    if arguments.through_converters || !arguments.fault.is_empty() {
        let bar = Bar::new("acquiring", verbosity);
        let troubles = Troubles {
            kinds: arguments.fault.clone(),
            per_minute: rate,
            seed: arguments.seed,
        };
        let mut progress = |share: f64, run: &str| bar.set(share, run);
        rig::acquire(&mut simulation, &troubles, &mut progress).map_err(Failure::input)?;
    }
    simulation.record_as(arguments.format);
    simulation.check(&arguments.out, &inputs, arguments.force)?;
    let setup = simulation.write(&arguments.out)?;
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
    let mut progress = |p: simulate::Progress<'_>| {
        bar.set(p.done as f64 / p.total.max(1) as f64, p.run);
    };
    let mut simulation =
        simulate::without_errors(model, options, &mut progress).map_err(Failure::input)?;
    simulation.truth.bounds =
        prediction::bounds(&model.specimen, &simulation, options.noise_of(model));
    simulation.disturb(model, options).map_err(Failure::input)?;
    Ok(simulation)
}

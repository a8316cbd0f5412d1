//! `massline board identify`: the ten numbers from the runs that the box has stored.

use super::found::Asked;
use crate::commands::device::Device;
use crate::commands::{Failure, Verbosity};
use crate::rig::Troubles;
use crate::setup::Setup;
use std::path::PathBuf;

/// Ask the box for the ten properties from the runs it has measured
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board identify setup.toml --port /dev/ttyACM0 --inputs inputs.toml\n  massline board identify setup.toml --port /dev/ttyACM0 --iterative --json"
)]
pub struct Arguments {
    /// The setup that was measured
    setup: PathBuf,
    #[command(flatten)]
    device: Device,
    #[command(flatten)]
    asked: Asked,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box has no answer.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup)?.with_readings_in_si();
    let asked = &arguments.asked;
    arguments
        .device
        .talk_of_runs(Troubles::default(), |client, shaker| {
            let test = asked.plan(client, &setup, shaker)?;
            asked.answer(client, &test, &setup, verbosity)
        })
}

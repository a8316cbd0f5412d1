//! `massline board forget`: what went wrong is taken off the box's list.

use crate::commands::device::Device;
use crate::commands::{Failure, Verbosity};
use massline_firmware::wire::Request;

/// Clear the box's fault counters and the text of its last failure
#[derive(clap::Args)]
#[command(after_help = "Example:\n  massline board forget --port /dev/ttyACM0")]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box cannot be asked.
pub fn run(arguments: &Arguments, _: Verbosity) -> Result<(), Failure> {
    arguments.device.talk(|client| {
        client.hello()?;
        Ok(client.tell(&Request::ForgetFaults)?)
    })
}

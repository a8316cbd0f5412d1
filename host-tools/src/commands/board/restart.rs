//! `massline board restart`: the box starts afresh.

use crate::commands::device::Device;
use crate::commands::{Failure, Spinner, Verbosity};
use crate::device::ClientError;
use massline_firmware::wire::Request;
use std::time::{Duration, Instant};

/// Start the box afresh; its set-up and runs are lost, a changed bit rate takes effect
#[derive(clap::Args)]
#[command(after_help = "Example:\n  massline board restart --port /dev/ttyACM0")]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
}

/// Longest that a start may take: the wait for a crystal that is dead is a tenth of it.
const START: Duration = Duration::from_secs(10);
/// Time between two checks of the box's start.
const LOOK: Duration = Duration::from_millis(100);

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box cannot be asked, or does not come back.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    arguments.device.talk(|client| {
        client.hello()?;
        let before = client.link().received.restarts;
        match client.tell(&Request::Reboot) {
            // It was faster than its answer.
            Ok(()) | Err(ClientError::Restarted { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        let _spinner = Spinner::new("starting", verbosity);
        let since = Instant::now();
        while client.link().received.restarts == before {
            if since.elapsed() > START {
                return Err(Failure::input(
                    "the box does not come back; if its bit rate was changed, give the new one as --baud, else switch it off and on",
                ));
            }
            client.listen(LOOK)?;
        }
        Ok(())
    })
}

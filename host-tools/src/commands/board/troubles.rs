//! Faults of the box in this program.

use crate::commands::Failure;
use crate::rig::{Trouble, Troubles};

/// Faults of the box in this program.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct HostTroubles {
    /// With --host: have something go wrong; may be given several times
    #[arg(long, value_name = "KIND", value_parser = Trouble::parse, conflicts_with_all = ["port", "emulator"], help_heading = "The box")]
    fault: Vec<Trouble>,
    /// With --fault: faults per minute, of all kinds together
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4.0,
        requires = "fault",
        help_heading = "The box"
    )]
    fault_rate: f64,
}

impl HostTroubles {
    /// They, if they can be.
    pub(super) fn get(&self) -> Result<Troubles, Failure> {
        let rate = self.fault_rate;
        if !(rate.is_finite() && rate >= 0.0) {
            return Err(Failure::input(format!(
                "--fault-rate {rate}: expected a number of faults per minute, 0 or more"
            )));
        }
        Ok(Troubles {
            kinds: self.fault.clone(),
            per_minute: rate,
            seed: 1,
        })
    }
}

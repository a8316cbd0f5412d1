//! `massline study plans`: whether what a test cannot tell has no number.

use crate::commands::Verbosity;
use crate::commands::{Bar, Failure, print_json};
use crate::study::plans::{self, Options, PlansError};

/// Try random test plans: what a plan cannot tell has no number, what it tells has one
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study plans\n  massline study plans --seed 17 --plans 1\n\nExit code 1: a number was given that its plan cannot tell, or less than 99 % of those that plans tell."
)]
pub struct Arguments {
    /// Number of plans
    #[arg(long, value_name = "N", default_value_t = Options::default().plans)]
    plans: usize,
    /// Seed of the first plan; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u64,
    /// Threads; the outcome does not depend on it [default: one a processor]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

impl From<PlansError> for Failure {
    fn from(error: PlansError) -> Self {
        Self::input(error)
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let bar = Bar::new("trying", verbosity);
    let options = Options {
        plans: arguments.plans,
        seed: arguments.seed,
        threads: arguments.threads,
    };
    let found = plans::run(&options, &mut |share| bar.set(share, "test plans"))?;
    drop(bar);
    if arguments.json {
        print_json(&found)?;
    } else {
        plans::print(&mut anstream::stdout(), &found).map_err(|e| Failure::stdout(&e))?;
    }
    if found.hold() {
        return Ok(());
    }
    Err(Failure {
        code: 1,
        message:
            "numbers were given that their plans cannot tell, or too few of those that plans tell"
                .to_owned(),
    })
}

//! `massline study plans`: whether what a test cannot tell has no number.

use crate::commands::{Bar, Failure, Verbosity, print_json};
use crate::study::plans::{self, Options};

/// Try random test plans: what a plan cannot tell has no number, what it tells has one
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study plans\n  massline study plans --seed 17 --plans 1\n\nExit code 1: a number was given that its plan cannot tell, or less than 99 % of those that plans tell."
)]
pub struct Arguments {
    #[command(flatten)]
    options: Options,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let bar = Bar::new("trying", verbosity);
    let found = plans::run(&arguments.options, &mut |share| {
        bar.set(share, "test plans")
    })?;
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

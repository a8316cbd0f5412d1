//! The command line: one file a command, in [`crate::commands`].

use crate::commands::{
    self, Failure, Verbosity, board, check, demo, export, flash, identify, init, recover, replay,
    simulate, sketch, study,
};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Weigh what is on the shaker: mass, centre of gravity and inertia of a structure on a
/// shaking table, with error bars, from load cells at its interface and accelerometers
#[derive(Parser)]
#[command(
    name = "massline",
    version,
    arg_required_else_help = true,
    after_help = "Start here:\n  massline demo\n  massline simulate fork --out fork && massline identify fork/setup.toml"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    verbosity: Verbosity,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::Arguments),
    Init(init::Arguments),
    Sketch(sketch::Arguments),
    Identify(identify::Arguments),
    Check(check::Arguments),
    Export(export::Arguments),
    Simulate(simulate::Arguments),
    Study(study::Arguments),
    Replay(replay::Arguments),
    Board(board::Arguments),
    Recover(recover::Arguments),
    Flash(flash::Arguments),
    /// Print a completion script for your shell
    #[command(
        after_help = "Example:\n  massline completions bash > ~/.local/share/bash-completion/completions/massline"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => commands::report(&failure),
    }
}

/// Runs a command line in this process, as tests of what it writes do.
#[cfg(test)]
pub(crate) fn run_words(words: &[&str]) -> Result<(), Failure> {
    let words = std::iter::once("massline").chain(words.iter().copied());
    run(Cli::try_parse_from(words).map_err(Failure::input)?)
}

fn run(cli: Cli) -> Result<(), Failure> {
    let verbosity = cli.verbosity;
    match cli.command {
        Command::Demo(a) => demo::run(&a, verbosity),
        Command::Init(a) => init::run(&a, verbosity),
        Command::Sketch(a) => sketch::run(&a, verbosity),
        Command::Identify(a) => identify::run(&a, verbosity),
        Command::Check(a) => check::run(&a, verbosity),
        Command::Export(a) => export::run(&a, verbosity),
        Command::Simulate(a) => simulate::run(&a, verbosity),
        Command::Study(a) => study::run(&a, verbosity),
        Command::Replay(a) => replay::run(&a, verbosity),
        Command::Board(a) => board::run(&a, verbosity),
        Command::Recover(a) => recover::run(&a, verbosity),
        Command::Flash(a) => flash::run(&a, verbosity),
        Command::Completions { shell } => {
            let mut command = <Cli as clap::CommandFactory>::command();
            // By way of memory: the generator panics when a reader hangs up.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut command, "massline", &mut script);
            commands::print_line(String::from_utf8_lossy(&script).trim_end())
        }
    }
}

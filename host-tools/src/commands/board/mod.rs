//! `massline board`: the box next to the table, asked directly.

mod bringup;
mod change;
mod columns;
mod forget;
mod found;
mod identify;
mod info;
mod measure;
mod monitor;
mod record;
mod restart;
mod selftest;
mod settings;
mod troubles;

use super::Failure;
use crate::commands::Verbosity;
use crate::device::BoxInfo;
use anstyle::Style;
use clap::Subcommand;

/// The box next to the table: its identity, its settings, its inputs, its self-test
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board info --port /dev/ttyACM0\n  massline board selftest --emulator\n  massline board settings --port COM3 --set name=\"table 2\" --save\n  massline board monitor --port /dev/ttyACM0\n  massline board record x.csv --port /dev/ttyACM0 --seconds 60\n  massline board measure setup.toml --port /dev/ttyACM0 --inputs inputs.toml\n\n`massline board COMMAND --help` shows more."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Info(info::Arguments),
    Selftest(selftest::Arguments),
    Bringup(bringup::Arguments),
    Settings(settings::Arguments),
    Record(record::Arguments),
    Monitor(monitor::Arguments),
    Measure(measure::Arguments),
    Identify(identify::Arguments),
    Forget(forget::Arguments),
    Restart(restart::Arguments),
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    match &arguments.command {
        Command::Info(a) => info::run(a, verbosity),
        Command::Selftest(a) => selftest::run(a, verbosity),
        Command::Bringup(a) => bringup::run(a, verbosity),
        Command::Settings(a) => settings::run(a, verbosity),
        Command::Record(a) => record::run(a, verbosity),
        Command::Monitor(a) => monitor::run(a, verbosity),
        Command::Measure(a) => measure::run(a, verbosity),
        Command::Identify(a) => identify::run(a, verbosity),
        Command::Forget(a) => forget::run(a, verbosity),
        Command::Restart(a) => restart::run(a, verbosity),
    }
}

/// The heading of a page about a box.
fn print_heading(out: &mut impl std::io::Write, info: &BoxInfo) -> std::io::Result<()> {
    let bold = Style::new().bold();
    writeln!(
        out,
        "{bold}{} {}{bold:#} (build {}) on {}",
        info.firmware, info.version, info.build, info.chip
    )
}

/// A line of what a box says: what, and the text.
fn print_row(out: &mut impl std::io::Write, what: &str, text: &str) -> std::io::Result<()> {
    writeln!(out, "{what:<16}{text}")
}

/// Longest time that can be asked for, s: three years.
const LONGEST: f64 = 1e8;

/// Seconds on the command line.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= LONGEST => Ok(seconds),
        _ => Err(format!(
            "write a number of seconds above 0 and at most {LONGEST}, such as 60"
        )),
    }
}

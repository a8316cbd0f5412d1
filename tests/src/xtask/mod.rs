//! `cargo xtask`: all tests of the project, and what they need, by one command.
//!
//! A machine may have nothing but cargo, from rustup or from Debian. What is missing is brought by
//! rustup, or unpacked into the target folder, without root and without a change of the machine;
//! what came of it is said.
//!
//! * [`arguments`]: the command line.
//! * [`steps`]: what is tested, in which order, and what to do about a failure.
//! * [`plan`]: which of the steps run, and running them.
//! * [`toolchain`]: a compiler for the chip, by rustup or by Debian's packages.
//! * [`qemu`]: an emulator of the chip, the machine's or Debian's.
//! * [`packages`]: Debian's packages, unpacked.
//! * [`apt`]: finding and fetching them.
//! * [`process`]: other programs, their output, their failures.
//! * [`licences`]: the licences of dependencies.
//! * [`image`]: how much of the chip the firmware takes.
//! * [`variables`]: what of that its variables take.
//! * [`report`]: what is shown.

use std::process::ExitCode;

pub mod apt;
pub mod arguments;
pub mod image;
pub mod licences;
pub mod packages;
pub mod plan;
pub mod process;
pub mod qemu;
pub mod report;
pub mod steps;
pub mod toolchain;
pub mod variables;

use arguments::Request;
use report::{Report, Style};

/// Runs the command that the arguments ask for.
///
/// The exit code is 0 when everything passed, 1 when a step failed, 2 when the arguments are
/// wrong.
pub fn main(arguments: impl Iterator<Item = String>) -> ExitCode {
    let request = match arguments::parse(arguments) {
        Ok(request) => request,
        Err(error) => {
            eprintln!("error: {error}\n\n{}", arguments::USAGE);
            return ExitCode::from(2);
        }
    };
    let style = Style::of_stdout();
    let mut report = Report::new(std::io::stdout(), style);
    match request {
        Request::Help(text) => report.text(&text),
        Request::List => report.list(steps::STEPS),
        Request::Test { only } => {
            let mut context = steps::Context::new(style.colour);
            if !plan::run(&plan::select(&only), &mut context, &mut report) {
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}

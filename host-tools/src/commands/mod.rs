//! One file a command; what they share of talking to the user.

pub mod board;
pub mod check;
pub mod demo;
pub mod export;
mod fitted;
pub mod flash;
pub mod identify;
pub mod init;
pub mod recover;
pub mod replay;
pub mod simulate;
pub mod sketch;
pub mod study;

mod compare;
mod details;
mod device;
mod interrupt;
mod procedure;
mod progress;
mod table;

pub use interrupt::Interrupt;
pub use progress::{Bar, Spinner, Ticker, Verbosity};
pub use table::print_numbers;

use crate::printable::{printable, printable_json, printable_lines};
use crate::report::TrueBody;
use crate::simulate::Truth;
use std::io::Write;
use std::process::ExitCode;

/// A number of threads.
fn at_least_one(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|number| *number > 0);
    number.ok_or_else(|| "expected a whole number, at least 1".to_owned())
}

/// Why a command ends without doing what was asked.
#[derive(Debug)]
pub struct Failure {
    /// 1: the data do not allow an answer. 2: wrong usage or unreadable input.
    pub code: u8,
    /// Error, place and advice: text that shows as it stands.
    pub message: String,
}

impl Failure {
    /// Unusable input.
    pub fn input(error: impl std::fmt::Display) -> Self {
        Self::because(2, error)
    }

    /// An error with its exit code. What it quotes of files and boxes shows as it stands, on one
    /// line.
    pub fn because(code: u8, error: impl std::fmt::Display) -> Self {
        Self {
            code,
            message: printable(&error.to_string()).into_owned(),
        }
    }

    /// The same with another line below.
    #[must_use]
    pub fn and(mut self, line: impl std::fmt::Display) -> Self {
        self.message.push('\n');
        self.message += &printable(&line.to_string());
        self
    }

    /// The terminal, or what stands in its place, refused to take a result. A reader who
    /// has seen enough, such as `head`, is no reason to complain.
    pub fn stdout(error: &std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            return Self {
                code: 0,
                message: String::new(),
            };
        }
        Self::input(format!("stdout: cannot be written: {error}"))
    }
}

/// Errors that mean unusable input, and those that know their exit code.
macro_rules! failures {
    (input: $($input:ty)*; by code: $($coded:ty)*;) => {
        $(impl From<$input> for Failure {
            fn from(error: $input) -> Self {
                Self::input(error)
            }
        })*
        $(impl From<$coded> for Failure {
            fn from(error: $coded) -> Self {
                Self::because(error.exit_code(), error)
            }
        })*
    };
}

failures! {
    input:
        crate::device::ClientError
        crate::init::InitError
        crate::output::OutputError
        crate::result::ReadError
        crate::setup::DocumentError
        crate::setup::SetupError
        crate::simulate::ModelError
        crate::simulate::SimulationError
        crate::study::StudyError
        crate::study::coverage::CoverageError
        crate::study::faults::FaultsError
        crate::study::likelihood::LikelihoodError
        crate::study::plans::PlansError;
    by code:
        crate::box_runs::BoxRunError
        crate::identification::AnswerError
        crate::replay::ReplayError;
}

/// Prints the failure and turns it into the exit code.
pub fn report(failure: &Failure) -> ExitCode {
    if failure.message.is_empty() {
        return ExitCode::from(failure.code);
    }
    let style = anstyle::AnsiColor::Red.on_default().bold();
    let _ = writeln!(
        anstream::stderr(),
        "{style}error:{style:#} {}",
        printable_lines(&failure.message)
    );
    ExitCode::from(failure.code)
}

/// Ends a command whose numbers are refused, for this reason.
///
/// # Errors
/// [`Failure`] with code 1 if there is a reason.
pub fn refuse(reason: Option<&str>) -> Result<(), Failure> {
    reason.map_or(Ok(()), |reason| {
        Err(Failure {
            code: 1,
            message: format!(
                "the data do not allow an answer: {reason}. The numbers are in the document of --json, marked as refused; --anyway prints them"
            ),
        })
    })
}

/// Prints warnings on stderr unless asked to be quiet.
pub fn warn(warnings: &[String], verbosity: Verbosity) {
    if verbosity.quiet {
        return;
    }
    let style = anstyle::AnsiColor::Yellow.on_default().bold();
    let mut err = anstream::stderr();
    for warning in warnings {
        let _ = writeln!(err, "{style}note:{style:#} {}", printable(warning));
    }
}

/// The truth of a simulation as the report wants it.
#[must_use]
pub fn true_body(truth: &Truth) -> TrueBody {
    TrueBody {
        mass: Some(truth.mass),
        centre_of_gravity: truth.centre_of_gravity,
        inertia_reference: truth.inertia_reference.terms(),
        inertia_cg: truth.inertia_cg.terms(),
    }
}

/// Prints one JSON document on stdout.
///
/// # Errors
/// [`Failure`] if stdout is gone.
pub fn print_json(document: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(document).map_err(Failure::input)?;
    print_line(&printable_json(&text))
}

/// Prints one line on stdout.
///
/// # Errors
/// [`Failure`] if stdout is gone.
pub fn print_line(text: &str) -> Result<(), Failure> {
    // What tests print this way is shown where one fails only.
    if cfg!(test) {
        println!("{text}");
        return Ok(());
    }
    writeln!(std::io::stdout(), "{text}").map_err(|e| Failure::stdout(&e))
}

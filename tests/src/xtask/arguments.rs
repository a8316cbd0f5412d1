//! The command line of `cargo xtask`.

use std::fmt;

use super::steps::{self, Step};

/// The short help, shown after a mistake.
pub const USAGE: &str = "\
usage: cargo xtask test [--only STEP]... [--list]
       cargo xtask test --help";

/// What the long help says besides [`USAGE`] and the steps.
const HELP: &str = "\
Runs every test of the project and brings what is missing for it: the compiler's
target for the chip, by rustup or from Debian's packages, and QEMU from these. They
are unpacked into cargo's target folder, without root; nothing is installed. Quiet
unless something fails; then the output of that step is shown and what to do about it.

options:
  --only STEP   run this step and what it needs; may be given several times
  --list        show the steps and stop
  --help        show this text

example:
  cargo xtask test --only lints --only emulator

environment:
  NO_COLOR                    no colours
  MASSLINE_QEMU               use this QEMU instead of qemu-system-arm
  MASSLINE_XTASK_NO_RUSTUP=1  act as if rustup refused to install anything";

/// What the user asks for.
#[derive(Debug, PartialEq)]
pub enum Request {
    /// Show this text.
    Help(String),
    /// Show the steps.
    List,
    /// Run steps.
    Test {
        /// The steps asked for; none means all.
        only: Vec<&'static Step>,
    },
}

/// What is wrong with the arguments.
#[derive(Debug, PartialEq)]
pub enum ArgumentError {
    /// There is no command.
    NoCommand,
    /// There is no command of this name.
    UnknownCommand(String),
    /// There is no option of this name.
    UnknownOption(String),
    /// An option lacks its value.
    NoValue(&'static str),
    /// There is no step of this name.
    UnknownStep(String),
}

impl fmt::Display for ArgumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCommand => write!(f, "say what to do, for example `cargo xtask test`"),
            Self::UnknownCommand(name) => write!(f, "there is no command {name:?}"),
            Self::UnknownOption(name) => write!(f, "there is no option {name:?}"),
            Self::NoValue(option) => write!(f, "{option} needs the name of a step"),
            Self::UnknownStep(name) => {
                write!(f, "there is no step {name:?}; the steps are")?;
                for (n, step) in steps::STEPS.iter().enumerate() {
                    write!(f, "{} {}", if n == 0 { "" } else { "," }, step.name)?;
                }
                Ok(())
            }
        }
    }
}

impl std::error::Error for ArgumentError {}

/// Understands the arguments, the program's own name left out.
///
/// # Errors
///
/// [`ArgumentError`], which says what is wrong with them.
pub fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Request, ArgumentError> {
    match arguments.next().as_deref() {
        None => return Err(ArgumentError::NoCommand),
        Some("test") => {}
        Some("--help" | "-h" | "help") => return Ok(Request::Help(help())),
        Some(other) if other.starts_with('-') => {
            return Err(ArgumentError::UnknownOption(other.to_owned()));
        }
        Some(other) => return Err(ArgumentError::UnknownCommand(other.to_owned())),
    }
    let mut only = Vec::new();
    let mut list = false;
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--help" | "-h" => return Ok(Request::Help(help())),
            "--list" => list = true,
            "--only" => only.push(step(
                &arguments.next().ok_or(ArgumentError::NoValue("--only"))?,
            )?),
            other => match other.strip_prefix("--only=") {
                Some(name) => only.push(step(name)?),
                None => return Err(ArgumentError::UnknownOption(argument)),
            },
        }
    }
    Ok(if list {
        Request::List
    } else {
        Request::Test { only }
    })
}

fn step(name: &str) -> Result<&'static Step, ArgumentError> {
    steps::find(name).ok_or_else(|| ArgumentError::UnknownStep(name.to_owned()))
}

fn help() -> String {
    let mut text = format!("{USAGE}\n\n{HELP}\n\nsteps:\n");
    for step in steps::STEPS {
        text += &format!("  {:<16}{}\n", step.name, step.about);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(line: &str) -> Result<Request, ArgumentError> {
        parse(line.split_whitespace().map(str::to_owned))
    }

    #[test]
    fn understands_what_the_help_offers() {
        assert_eq!(parsed("test"), Ok(Request::Test { only: vec![] }));
        assert_eq!(parsed("test --list"), Ok(Request::List));
        let Ok(Request::Test { only }) = parsed("test --only lints --only=emulator") else {
            panic!("not understood");
        };
        assert_eq!(
            only.iter().map(|step| step.name).collect::<Vec<_>>(),
            ["lints", "emulator"]
        );
        for line in ["--help", "help", "test --help", "test --only lints -h"] {
            assert!(matches!(parsed(line), Ok(Request::Help(_))), "{line}");
        }
    }

    #[test]
    fn names_the_mistake() {
        assert_eq!(parsed(""), Err(ArgumentError::NoCommand));
        assert_eq!(
            parsed("tset"),
            Err(ArgumentError::UnknownCommand("tset".into()))
        );
        assert_eq!(
            parsed("test --fast"),
            Err(ArgumentError::UnknownOption("--fast".into()))
        );
        assert_eq!(parsed("test --only"), Err(ArgumentError::NoValue("--only")));
        let error = parsed("test --only lint").unwrap_err().to_string();
        assert!(error.starts_with("there is no step \"lint\""), "{error}");
        assert!(error.contains("emulator"), "{error}");
    }
}

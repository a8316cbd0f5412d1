//! The command line of `cargo xtask`.

use std::fmt;

use super::steps::{self, Step};
use super::{fuzz, mutants};

/// The short help, shown after a mistake.
pub const USAGE: &str = "\
usage: cargo xtask test [--only STEP]... [--list]
       cargo xtask fuzz [TARGET]... [--seconds N] [--jobs N] [--table] [--minimise]
       cargo xtask fuzz TARGET --repeat FILE
       cargo xtask mutants [--shard K/N] [--file PATH]... [--list]
       cargo xtask miri
       cargo xtask test --help";

/// The long help, shown after [`USAGE`] and before the steps.
const HELP: &str = "\
Runs every test of the project. A missing compiler's target for the chip is fetched
by rustup or from Debian's packages, a missing QEMU from these. Packages are unpacked
into cargo's target folder, without root; nothing is installed. If a step fails, its
output is shown, and a remedy.

options:
  --only STEP   run this step and what it needs; may be given several times
  --list        show the steps and stop
  --help        show this text

fuzz searches for inputs that make a target fail:
  --seconds N   time for each target, 3600 by default
  --jobs N      targets at a time, 2 by default
  --table       write the results into tests/README.md
  --minimise    then put the inputs with most coverage into the repository
  --repeat FILE repeat an input

mutants changes core in one place at a time and lists the changes that no test detects:
  --shard K/N   only the part K of N, from 0
  --file PATH   only this file; may be given several times
  --list        show the changes and stop

miri runs core's tests in an interpreter that detects undefined behaviour.

example:
  cargo xtask test --only lints --only emulator
  cargo xtask fuzz wire --seconds 60

environment:
  NO_COLOR                    no colours
  MASSLINE_QEMU               use this QEMU instead of qemu-system-arm
  MASSLINE_XTASK_NO_RUSTUP=1  act as if rustup refused to install anything";

/// A command with its options.
#[derive(Debug, PartialEq)]
pub enum Request {
    /// Show the help.
    Help(String),
    /// Show the steps.
    List,
    /// Run steps.
    Test {
        /// The steps to run; none means all.
        only: Vec<&'static Step>,
    },
    /// Search for inputs that make a fuzz target fail.
    Fuzz(fuzz::Order),
    /// Search for changes that no test detects.
    Mutants(mutants::Order),
    /// Run core's tests in an interpreter.
    Miri,
}

/// Error of the arguments.
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
    /// There is no fuzz target of this name.
    UnknownTarget(String),
    /// A value is not valid for its option.
    BadValue {
        /// The option.
        option: &'static str,
        /// The value.
        found: String,
        /// The valid values.
        expected: &'static str,
    },
    /// `--repeat` needs exactly one target.
    OneTarget,
}

impl fmt::Display for ArgumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCommand => write!(f, "a command is missing, for example `cargo xtask test`"),
            Self::UnknownCommand(name) => write!(f, "there is no command {name:?}"),
            Self::UnknownOption(name) => write!(f, "there is no option {name:?}"),
            Self::NoValue(option) => write!(f, "{option} needs a value"),
            Self::UnknownStep(name) => {
                write!(f, "there is no step {name:?}; the steps are")?;
                for (n, step) in steps::STEPS.iter().enumerate() {
                    write!(f, "{} {}", if n == 0 { "" } else { "," }, step.name)?;
                }
                Ok(())
            }
            Self::UnknownTarget(name) => write!(
                f,
                "there is no fuzz target {name:?}; the targets are {}",
                fuzz::TARGETS.join(", ")
            ),
            Self::BadValue {
                option,
                found,
                expected,
            } => write!(f, "{option} is {found:?}; expected {expected}"),
            Self::OneTarget => write!(f, "--repeat needs the name of one target"),
        }
    }
}

impl std::error::Error for ArgumentError {}

/// Parses the arguments, without the program's own name.
///
/// # Errors
///
/// [`ArgumentError`].
pub fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Request, ArgumentError> {
    match arguments.next().as_deref() {
        None => return Err(ArgumentError::NoCommand),
        Some("test") => {}
        Some("fuzz") => return parse_fuzz(arguments),
        Some("mutants") => return parse_mutants(arguments),
        Some("miri") => {
            return match arguments.next() {
                None => Ok(Request::Miri),
                Some(other) => Err(ArgumentError::UnknownOption(other)),
            };
        }
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

fn parse_fuzz(mut arguments: impl Iterator<Item = String>) -> Result<Request, ArgumentError> {
    let mut order = fuzz::Order {
        targets: Vec::new(),
        seconds: fuzz::HOUR,
        jobs: fuzz::JOBS,
        table: false,
        minimise: false,
        repeat: None,
    };
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--help" | "-h" => return Ok(Request::Help(help())),
            "--seconds" => order.seconds = number("--seconds", arguments.next())?,
            "--jobs" => order.jobs = number("--jobs", arguments.next())? as usize,
            "--table" => order.table = true,
            "--minimise" => order.minimise = true,
            "--repeat" => {
                let file = arguments.next();
                order.repeat = Some(file.ok_or(ArgumentError::NoValue("--repeat"))?.into());
            }
            option if option.starts_with('-') => {
                return Err(ArgumentError::UnknownOption(argument));
            }
            name => match fuzz::TARGETS.into_iter().find(|target| *target == name) {
                Some(target) => order.targets.push(target),
                None => return Err(ArgumentError::UnknownTarget(argument)),
            },
        }
    }
    if order.repeat.is_some() && order.targets.len() != 1 {
        return Err(ArgumentError::OneTarget);
    }
    Ok(Request::Fuzz(order))
}

fn parse_mutants(mut arguments: impl Iterator<Item = String>) -> Result<Request, ArgumentError> {
    let mut order = mutants::Order::default();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--help" | "-h" => return Ok(Request::Help(help())),
            "--list" => order.list = true,
            "--shard" => {
                let shard = arguments.next().ok_or(ArgumentError::NoValue("--shard"))?;
                order.shard = Some(shard);
            }
            "--file" => {
                let file = arguments.next().ok_or(ArgumentError::NoValue("--file"))?;
                order.files.push(file);
            }
            _ => return Err(ArgumentError::UnknownOption(argument)),
        }
    }
    Ok(Request::Mutants(order))
}

/// A whole number of one or more.
fn number(option: &'static str, value: Option<String>) -> Result<u64, ArgumentError> {
    let found = value.ok_or(ArgumentError::NoValue(option))?;
    let number = found.parse().ok().filter(|number| *number > 0);
    number.ok_or(ArgumentError::BadValue {
        option,
        found,
        expected: "a whole number of one or more",
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
    fn parses_the_commands_of_the_help() {
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
    fn parses_fuzz_mutants_and_miri() {
        let order = |line: &str| match parsed(line) {
            Ok(Request::Fuzz(order)) => order,
            other => panic!("{line}: {other:?}"),
        };
        let all = order("fuzz");
        assert_eq!((all.targets.len(), all.seconds, all.jobs), (0, 3600, 2));
        let some = order("fuzz wire flash --seconds 60 --jobs 1 --table --minimise");
        assert_eq!(some.targets, ["wire", "flash"]);
        assert_eq!((some.seconds, some.jobs), (60, 1));
        assert!(some.table && some.minimise);
        let one = order("fuzz client --repeat a/b");
        assert_eq!(one.repeat, Some("a/b".into()));
        let mutants = mutants::Order {
            shard: Some("1/8".into()),
            files: vec!["a.rs".into()],
            list: true,
        };
        assert_eq!(
            parsed("mutants --shard 1/8 --file a.rs --list"),
            Ok(Request::Mutants(mutants))
        );
        assert_eq!(parsed("miri"), Ok(Request::Miri));
        for (line, error) in [
            ("fuzz wires", ArgumentError::UnknownTarget("wires".into())),
            ("fuzz --seconds", ArgumentError::NoValue("--seconds")),
            ("fuzz --repeat x", ArgumentError::OneTarget),
            ("fuzz --fast", ArgumentError::UnknownOption("--fast".into())),
            ("mutants --shard", ArgumentError::NoValue("--shard")),
            ("miri --fast", ArgumentError::UnknownOption("--fast".into())),
        ] {
            assert_eq!(parsed(line), Err(error), "{line}");
        }
        let error = parsed("fuzz --jobs 0").unwrap_err().to_string();
        assert!(error.starts_with("--jobs is \"0\""), "{error}");
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

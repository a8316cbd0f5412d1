//! The command line of `cargo xtask`.

use lexopt::Parser;
use lexopt::prelude::*;

use super::steps::{self, Step};
use super::{bench, fuzz, mutants};

/// The short help, shown after a mistake.
pub const USAGE: &str = "\
usage: cargo xtask test [--only STEP]... [--list]
       cargo xtask fuzz [TARGET]... [--seconds N] [--jobs N] [--table] [--minimise]
       cargo xtask fuzz TARGET --repeat FILE
       cargo xtask bench host [--runs N] [--table]
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

bench host measures reading and spectra beside pandas, polars and scipy:
  --runs N      turns, 9 by default
  --table       write the tables into host-tools/README.md

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
    /// Measure reading and spectra on this machine.
    BenchHost(bench::host::Order),
    /// Search for changes that no test detects.
    Mutants(mutants::Order),
    /// Run core's tests in an interpreter.
    Miri,
}

/// Parses the arguments, without the program's own name.
///
/// # Errors
///
/// A message for the user.
pub fn parse(arguments: impl Iterator<Item = String>) -> Result<Request, lexopt::Error> {
    let mut parser = Parser::from_args(arguments);
    match parser.next()? {
        None => Err("a command is missing, for example `cargo xtask test`".into()),
        Some(Value(command)) => match command.string()?.as_str() {
            "test" => parse_test(parser),
            "fuzz" => parse_fuzz(parser),
            "bench" => parse_bench(parser),
            "mutants" => parse_mutants(parser),
            "miri" => match parser.next()? {
                None => Ok(Request::Miri),
                Some(other) => Err(other.unexpected()),
            },
            "help" => Ok(Request::Help(help())),
            other => Err(format!("there is no command {other:?}").into()),
        },
        Some(Long("help") | Short('h')) => Ok(Request::Help(help())),
        Some(other) => Err(other.unexpected()),
    }
}

fn parse_test(mut parser: Parser) -> Result<Request, lexopt::Error> {
    let mut only = Vec::new();
    let mut list = false;
    while let Some(argument) = parser.next()? {
        match argument {
            Long("help") | Short('h') => return Ok(Request::Help(help())),
            Long("list") => list = true,
            Long("only") => only.push(step(&parser.value()?.string()?)?),
            other => return Err(other.unexpected()),
        }
    }
    Ok(match list {
        true => Request::List,
        false => Request::Test { only },
    })
}

fn parse_fuzz(mut parser: Parser) -> Result<Request, lexopt::Error> {
    let mut order = fuzz::Order {
        targets: Vec::new(),
        seconds: fuzz::HOUR,
        jobs: fuzz::JOBS,
        table: false,
        minimise: false,
        repeat: None,
    };
    while let Some(argument) = parser.next()? {
        match argument {
            Long("help") | Short('h') => return Ok(Request::Help(help())),
            Long("seconds") => order.seconds = number(&mut parser, "--seconds")?,
            Long("jobs") => order.jobs = number(&mut parser, "--jobs")? as usize,
            Long("table") => order.table = true,
            Long("minimise") => order.minimise = true,
            Long("repeat") => order.repeat = Some(parser.value()?.into()),
            Value(name) => order.targets.push(target(&name.string()?)?),
            other => return Err(other.unexpected()),
        }
    }
    if order.repeat.is_some() && order.targets.len() != 1 {
        return Err("--repeat needs the name of one target".into());
    }
    Ok(Request::Fuzz(order))
}

fn parse_bench(mut parser: Parser) -> Result<Request, lexopt::Error> {
    match parser.next()? {
        Some(Value(what)) if what == "host" => {}
        Some(Value(what)) => {
            let what = what.string()?;
            return Err(format!("there is no benchmark {what:?}; there is `host`").into());
        }
        Some(other) => return Err(other.unexpected()),
        None => return Err("bench needs a name: `cargo xtask bench host`".into()),
    }
    let mut order = bench::host::Order {
        runs: 9,
        table: false,
    };
    while let Some(argument) = parser.next()? {
        match argument {
            Long("runs") => order.runs = number(&mut parser, "--runs")? as usize,
            Long("table") => order.table = true,
            other => return Err(other.unexpected()),
        }
    }
    Ok(Request::BenchHost(order))
}

fn parse_mutants(mut parser: Parser) -> Result<Request, lexopt::Error> {
    let mut order = mutants::Order::default();
    while let Some(argument) = parser.next()? {
        match argument {
            Long("help") | Short('h') => return Ok(Request::Help(help())),
            Long("list") => order.list = true,
            Long("shard") => order.shard = Some(parser.value()?.string()?),
            Long("file") => order.files.push(parser.value()?.string()?),
            other => return Err(other.unexpected()),
        }
    }
    Ok(Request::Mutants(order))
}

/// The value of an option, a whole number of one or more.
fn number(parser: &mut Parser, option: &str) -> Result<u64, lexopt::Error> {
    let found = parser.value()?.string()?;
    let number = found.parse().ok().filter(|number| *number > 0);
    number.ok_or_else(|| {
        format!("{option} is {found:?}; expected a whole number of one or more").into()
    })
}

/// The fuzz target of a name.
fn target(name: &str) -> Result<&'static str, String> {
    let known = fuzz::TARGETS.into_iter().find(|target| *target == name);
    known.ok_or_else(|| {
        let all = fuzz::TARGETS.join(", ");
        format!("there is no fuzz target {name:?}; the targets are {all}")
    })
}

/// The step of a name.
fn step(name: &str) -> Result<&'static Step, String> {
    steps::find(name).ok_or_else(|| {
        let all: Vec<&str> = steps::STEPS.iter().map(|step| step.name).collect();
        let all = all.join(", ");
        format!("there is no step {name:?}; the steps are {all}")
    })
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

    fn parsed(line: &str) -> Result<Request, String> {
        let request = parse(line.split_whitespace().map(str::to_owned));
        request.map_err(|error| error.to_string())
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
    fn parses_fuzz_mutants_miri_and_bench() {
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
        let order = |runs, table| Ok(Request::BenchHost(bench::host::Order { runs, table }));
        assert_eq!(parsed("bench host"), order(9, false));
        assert_eq!(parsed("bench host --runs 3 --table"), order(3, true));
    }

    #[test]
    fn an_error_names_the_mistake() {
        for (line, message) in [
            ("", "a command is missing"),
            ("tset", "there is no command \"tset\""),
            ("bench", "bench needs a name"),
            ("bench chop", "there is no benchmark \"chop\""),
            (
                "bench host --runs 0",
                "expected a whole number of one or more",
            ),
            ("test --fast", "invalid option '--fast'"),
            ("test --only", "missing argument for option '--only'"),
            (
                "test --only lint",
                "there is no step \"lint\"; the steps are toolchain, ",
            ),
            (
                "fuzz wires",
                "there is no fuzz target \"wires\"; the targets are wire, ",
            ),
            ("fuzz --seconds", "missing argument for option '--seconds'"),
            (
                "fuzz --jobs 0",
                "--jobs is \"0\"; expected a whole number of one or more",
            ),
            ("fuzz --repeat x", "--repeat needs the name of one target"),
            ("fuzz --fast", "invalid option '--fast'"),
            ("mutants --shard", "missing argument for option '--shard'"),
            ("miri --fast", "invalid option '--fast'"),
        ] {
            let error = parsed(line).unwrap_err();
            assert!(error.contains(message), "{line}: {error}");
        }
    }
}

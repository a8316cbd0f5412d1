//! `cargo xtask`: one command for all tests of the project, and the tools they need.
//!
//! A machine may have only cargo, from rustup or from Debian. Missing tools are fetched by rustup,
//! or unpacked into the target folder without root and without a change of the machine, and
//! reported.
//!
//! * [`arguments`]: the command line.
//! * [`steps`]: the steps of a test run, in order, with remedies for their failures.
//! * [`plan`]: selection and run of steps.
//! * [`toolchain`]: a compiler for the chip, by rustup or by Debian's packages.
//! * [`qemu`]: an emulator of the chip, the machine's or Debian's.
//! * [`packages`]: packages of Debian, unpacked.
//! * [`apt`]: their search and download.
//! * [`process`]: other programs, their output and failures.
//! * [`licences`]: the licences of dependencies.
//! * [`mod@bench`]: costs beside those of what a user would take instead.
//! * [`fuzz`]: inputs that make the fuzz targets fail.
//! * [`mutants`]: changes that no test detects.
//! * [`miri`]: core's tests in an interpreter.
//! * [`api`]: the public interface of core, against the committed list of it.
//! * [`image`]: memory of the chip that the firmware takes.
//! * [`variables`]: memory that its variables take.
//! * [`panics`]: places where it can panic, by crate, against a budget.
//! * [`report`]: output on the terminal.

use std::process::ExitCode;

pub mod api;
pub mod apt;
pub mod arguments;
pub mod bench;
pub mod fuzz;
pub mod image;
pub mod licences;
pub mod miri;
pub mod mutants;
pub mod packages;
pub mod panics;
pub mod plan;
pub mod process;
pub mod qemu;
mod readers;
pub mod report;
pub mod steps;
pub mod toolchain;
pub mod variables;

use arguments::Request;
use process::StepError;
use report::{Report, Style};

/// Runs the command of the arguments.
///
/// The exit code is 0 if all passed, 1 if a step failed, 2 if the arguments are wrong.
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
        Request::Fuzz(order) => return ended(fuzzed(&order, &mut report)),
        Request::Mutants(order) => {
            let context = steps::Context::new(style.colour);
            return ended(mutants::run(
                context.root(),
                &|| context.host_cargo(),
                &order,
            ));
        }
        Request::BenchHost(order) => {
            let context = steps::Context::new(style.colour);
            let measured = bench::host::run(context.root(), &|| context.host_cargo(), &order);
            return ended(measured.map(|tables| report.text(&tables)));
        }
        Request::Miri => {
            let context = steps::Context::new(style.colour);
            return ended(miri::run(context.root()).map(|output| report.text(&output)));
        }
    }
    ExitCode::SUCCESS
}

/// Searches for findings, or repeats one, and shows the results.
fn fuzzed(order: &fuzz::Order, report: &mut Report<std::io::Stdout>) -> Result<(), StepError> {
    if let Some(reason) = fuzz::impossible() {
        return Err(StepError::Missing {
            what: "a C++ compiler",
            tried: reason,
            remedy: "install one (Debian's g++), or name one in CXX",
        });
    }
    let context = steps::Context::new(false);
    eprintln!("building the targets");
    let programs = fuzz::build(context.root(), context.host_cargo())?;
    let targets = match order.targets.as_slice() {
        [] => &fuzz::TARGETS[..],
        some => some,
    };
    if let (Some(input), [target]) = (&order.repeat, targets) {
        report.text(&programs.repeat(target, input)?);
        return Ok(());
    }
    eprintln!("each target runs for {} s", order.seconds);
    let outcomes = programs.run_all(targets, order.seconds, order.jobs, &|outcome| {
        eprintln!(
            "{}: {} inputs, {} findings",
            outcome.target, outcome.executions, outcome.findings
        );
    })?;
    let table = fuzz::table(&outcomes);
    report.text(&table);
    if order.table {
        const README: &str = "tests/README.md";
        crate::readme::put(README, "fuzz", &table)
            .map_err(|problem| StepError::file(README.as_ref(), problem))?;
    }
    let findings = fuzz::findings(&outcomes);
    if !findings.is_empty() {
        return Err(StepError::Finding(findings));
    }
    if order.minimise {
        for target in targets {
            report.text(&programs.minimise(target)?);
        }
    }
    Ok(())
}

/// Exit code of a command, whose error is shown.
fn ended(result: Result<(), StepError>) -> ExitCode {
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    eprintln!("error: {error}");
    if let Some(remedy) = error.remedy() {
        eprintln!("\nWhat to do: {remedy}.");
    }
    ExitCode::FAILURE
}

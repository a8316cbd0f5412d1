//! `massline board selftest`: a body of known properties through the whole box.

use crate::commands::device::Device;
use crate::commands::{Failure, Spinner, Verbosity, print_json};
use crate::format::with_std;
use anstyle::{AnsiColor, Style};
use massline_firmware::wire::{Check, Health, Selftest};
use serde::Serialize;
use std::io::Write;

/// Have the box shake a synthetic body of known properties and identify it; no sensor needed
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board selftest --emulator\n  massline board selftest --port /dev/ttyACM0 --json\n\nThe set-up and the runs that the box holds are lost.\nExit code 0: passed. 1: failed."
)]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// The ten in the order of [`Selftest::checks`]: name, unit.
const PROPERTIES: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("CG x", "m"),
    ("CG y", "m"),
    ("CG z", "m"),
    ("Θxx about S", "kg m²"),
    ("Θyy about S", "kg m²"),
    ("Θzz about S", "kg m²"),
    ("Θxy about S", "kg m²"),
    ("Θxz about S", "kg m²"),
    ("Θyz about S", "kg m²"),
];

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box cannot be asked, or if it has not passed.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let selftest = arguments.device.talk(|client| {
        client.hello()?;
        let _spinner = Spinner::new("self-test", verbosity);
        Ok(client.selftest()?)
    })?;
    if arguments.json {
        print_json(&SelftestDocument::new(&selftest))?;
    } else {
        print(&selftest).map_err(|e| Failure::stdout(&e))?;
    }
    if selftest.passed {
        return Ok(());
    }
    Err(Failure {
        code: 1,
        message: "the box has not passed its self-test, so its answers cannot be trusted; flash it anew (`massline flash`), and if that does not help, replace it".to_owned(),
    })
}

/// The document of a self-test, `massline/selftest/1`.
#[derive(Serialize)]
struct SelftestDocument {
    schema: &'static str,
    passed: bool,
    checks: Vec<CheckEntry>,
    channel_faults: Vec<&'static str>,
}

/// SI units.
#[derive(Serialize)]
struct CheckEntry {
    property: &'static str,
    unit: &'static str,
    truth: f64,
    found: Option<f64>,
    bound: f64,
    passed: bool,
}

impl SelftestDocument {
    fn new(selftest: &Selftest) -> Self {
        let checks = PROPERTIES.iter().zip(&selftest.checks);
        Self {
            schema: "massline/selftest/1",
            passed: selftest.passed,
            checks: checks
                .map(|((property, unit), check)| CheckEntry {
                    property,
                    unit,
                    truth: check.truth,
                    found: check.found,
                    bound: check.bound,
                    passed: holds(check),
                })
                .collect(),
            channel_faults: faults(selftest.health),
        }
    }
}

/// `true` if a check holds by its own numbers, whatever the box says of it.
fn holds(check: &Check) -> bool {
    let distance = |found: f64| (found - check.truth).abs();
    check
        .found
        .is_some_and(|found| distance(found) <= check.bound)
}

/// Names of the faults of channels.
fn faults(health: Health) -> Vec<&'static str> {
    [
        (Health::OVERLOAD, "overload"),
        (Health::MISSING, "missing samples"),
        (Health::CHECKSUM, "checksum"),
        (Health::OPEN, "open input"),
        (Health::STUCK, "stuck reading"),
        (Health::OUT_OF_STEP, "converters out of step"),
        (Health::CONVERTER_RESET, "converter reset"),
        (Health::NOT_FINITE, "not a number"),
    ]
    .into_iter()
    .filter_map(|(fault, name)| health.contains(fault).then_some(name))
    .collect()
}

fn print(selftest: &Selftest) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    let bold = Style::new().bold();
    let (green, red) = (AnsiColor::Green.on_default(), AnsiColor::Red.on_default());
    writeln!(
        out,
        "{bold}{:<14}{:>12}{:>12}{:>12}  {:<6}{bold:#}",
        "", "found", "true", "may differ", ""
    )?;
    for ((name, unit), check) in PROPERTIES.iter().zip(&selftest.checks) {
        let shown = |value: f64| with_std(value, check.bound);
        let found = check.found.map_or_else(|| "-".to_owned(), |x| shown(x).0);
        let (truth, bound) = shown(check.truth);
        write!(
            out,
            "{name:<14}{found:>12}{truth:>12}{bound:>12}  {unit:<6}"
        )?;
        if holds(check) {
            writeln!(out, "{green}passed{green:#}")?;
        } else {
            writeln!(out, "{red}failed{red:#}")?;
        }
    }
    let faults = faults(selftest.health);
    if !faults.is_empty() {
        writeln!(out, "channels: {red}{}{red:#}", faults.join(", "))?;
    }
    if selftest.passed {
        writeln!(out, "{green}passed{green:#}")
    } else {
        writeln!(out, "{red}failed{red:#}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_holds_up_to_its_bound_and_not_without_a_number() {
        let check = |found: Option<f64>| Check {
            truth: 2.0,
            found,
            bound: 0.5,
        };
        assert!(holds(&check(Some(1.5))) && holds(&check(Some(2.5))));
        assert!(!holds(&check(Some(2.6))) && !holds(&check(None)));
        assert!(!holds(&check(Some(f64::NAN))));
    }

    #[test]
    fn every_fault_has_a_name() {
        assert_eq!(faults(Health(u16::MAX)).len(), Health::KINDS);
        assert_eq!(faults(Health::GOOD), Vec::<&str>::new());
    }
}

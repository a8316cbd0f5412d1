//! `massline board bringup`: clocks, buses, converters and link of a new board, on one page.

use super::print_heading;
use crate::bringup::{self, Check, Order, Verdict};
use crate::commands::device::Device;
use crate::commands::{Failure, Ticker, Verbosity, print_json};
use crate::device::BoxInfo;
use crate::rig::Troubles;
use anstyle::{AnsiColor, Style};
use massline_firmware::sampling::CHIPS;
use serde::Serialize;
use std::io::Write;

/// Measure a new board: crystal, buses, converters, link, and say what to solder next
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board bringup --port /dev/ttyACM0\n  massline board bringup --port /dev/ttyACM0 --without 2,3,4\n  massline board bringup --port /dev/ttyACM0 --seconds 60 --save --json\n\nConverters are numbered from 0; 4 is the ADXL355. Before any is soldered, a wire from MOSI to\nMISO tests a bus. Neither the set-up nor stored runs are lost; the board is at rest meanwhile.\nExit code 0: nothing is wrong. 1: something is."
)]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
    /// Count wrong checksums for so long, at each of three clocks of the buses
    #[arg(long, value_name = "S", default_value = "10", value_parser = super::seconds)]
    seconds: f64,
    /// Numbers of the converters that are not soldered: 2,3,4
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(0..CHIPS as i64))]
    without: Vec<u8>,
    /// Save the settings as they are, to measure how long that takes
    #[arg(long)]
    save: bool,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box cannot be asked, or if something is wrong with it.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let order = Order {
        seconds: arguments.seconds,
        without: arguments.without.iter().fold(0, |bits, k| bits | 1 << k),
        saves: arguments.save,
        keeps_time: arguments.device.keeps_time(),
    };
    let measured = arguments
        .device
        .talk_of_inputs(Troubles::default(), |client| {
            let ticker = Ticker::new("bring-up", verbosity);
            Ok(bringup::measure(client, &order, &mut |what| {
                ticker.set(what)
            })?)
        })?;
    let checks = measured.checks(&order);
    if arguments.json {
        print_json(&BringupDocument::new(&measured.info, &checks))?;
    } else {
        print(&measured.info, &checks).map_err(|e| Failure::stdout(&e))?;
    }
    let wrong = count(&checks, Verdict::Bad);
    if wrong == 0 {
        return Ok(());
    }
    Err(Failure {
        code: 1,
        message: format!(
            "{wrong} of {} checks are wrong; what to do is listed above",
            checks.len()
        ),
    })
}

fn count(checks: &[Check], verdict: Verdict) -> usize {
    checks
        .iter()
        .filter(|check| check.verdict == verdict)
        .count()
}

/// The document of a bring-up, `massline/bringup/1`.
#[derive(Serialize)]
struct BringupDocument<'a> {
    schema: &'static str,
    firmware: &'a str,
    build: &'a str,
    chip: &'a str,
    passed: bool,
    checks: Vec<CheckEntry<'a>>,
}

#[derive(Serialize)]
struct CheckEntry<'a> {
    part: &'a str,
    found: &'a str,
    expected: &'a str,
    verdict: &'static str,
    next: Option<&'a str>,
}

impl<'a> BringupDocument<'a> {
    fn new(info: &'a BoxInfo, checks: &'a [Check]) -> Self {
        let entries = checks.iter().map(|check| CheckEntry {
            part: &check.part,
            found: &check.found,
            expected: &check.expected,
            verdict: word(check.verdict),
            next: check.advice.as_deref(),
        });
        Self {
            schema: "massline/bringup/1",
            firmware: &info.firmware,
            build: &info.build,
            chip: &info.chip,
            passed: count(checks, Verdict::Bad) == 0,
            checks: entries.collect(),
        }
    }
}

const fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Bad => "wrong",
        Verdict::Open => "open",
    }
}

fn print(info: &BoxInfo, checks: &[Check]) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    let bold = Style::new().bold();
    print_heading(&mut out, info)?;
    for check in checks {
        let style = match check.verdict {
            Verdict::Good => AnsiColor::Green.on_default(),
            Verdict::Bad => AnsiColor::Red.on_default().bold(),
            Verdict::Open => Style::new().dimmed(),
        };
        write!(
            out,
            "{style}{:<6}{style:#}{:<26}{}",
            word(check.verdict),
            check.part,
            check.found
        )?;
        match check.verdict {
            Verdict::Bad => writeln!(out, "; expected: {}", check.expected)?,
            _ => writeln!(out)?,
        }
    }
    let mut advice = checks
        .iter()
        .filter_map(|check| check.advice.as_ref())
        .peekable();
    if advice.peek().is_some() {
        writeln!(out, "{bold}next{bold:#}")?;
    }
    for (number, advice) in (1..).zip(advice) {
        writeln!(out, "{number:>4}  {advice}")?;
    }
    let [good, wrong, open] =
        [Verdict::Good, Verdict::Bad, Verdict::Open].map(|verdict| count(checks, verdict));
    writeln!(out, "{good} good, {wrong} wrong, {open} open")
}

//! `massline replay`: recordings through the box, compared by bits with this machine.

use super::device::Device;
use super::procedure::{Procedure, parse_method};
use super::{Bar, Failure, print_json, warn};
use crate::commands::Verbosity;
use crate::device::{Client, Port};
use crate::identification::recommended;
use crate::replay::{Comparison, Flip, Order, Outcome, ReplayDocument, RunOutcome, replay};
use crate::setup::Setup;
use anstyle::{AnsiColor, Style};
use massline_core::masslines::Method;
use std::io::Write;
use std::path::PathBuf;

/// Send recordings through the box and compare all it finds with this machine, bit by bit
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline replay fork/setup.toml --host\n  massline replay fork/setup.toml --emulator --blocks 8 --method a,c-squared,apparent-mass\n  massline replay fork/setup.toml --port /dev/ttyACM0 --method all --iterative\n  massline replay fork/setup.toml --host --flip 1:3000:a1:20\n\nExit code 0: identical. 1: something differs, and the first difference is named."
)]
pub struct Arguments {
    /// The setup: sensors, processing and runs
    setup: PathBuf,
    #[command(flatten)]
    device: Device,
    /// Methods to identify by, with commas; the recommended one if absent
    #[arg(long, value_name = "NAMES|all", value_parser = parse_methods)]
    method: Option<Wanted>,
    #[command(flatten)]
    procedure: Procedure,
    /// Send only this many blocks of each run
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    blocks: Option<u32>,
    /// Flip one bit on the way to the box, to see it noticed
    #[arg(long, value_name = "RUN:SAMPLE:CHANNEL:BIT")]
    flip: Option<String>,
    /// Go on with a replay that was cut off, where the box stands
    #[arg(long, conflicts_with_all = ["emulator", "host"])]
    resume: bool,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Methods by name, or all that the box has.
#[derive(Clone, Debug, PartialEq)]
enum Wanted {
    These(Vec<Method>),
    All,
}

fn parse_methods(names: &str) -> Result<Wanted, String> {
    if names == "all" {
        return Ok(Wanted::All);
    }
    let mut methods = Vec::new();
    for name in names.split(',').map(str::trim) {
        let method = parse_method(name, ", and all")?;
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    Ok(Wanted::These(methods))
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the replay cannot be done, or if box and machine differ.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup)?;
    let flip = arguments.flip.as_deref();
    let flip = flip.map(|text| Flip::parse(text, &setup)).transpose()?;
    let mut outcome = arguments.device.talk(|client| {
        let order = Order {
            methods: methods(arguments.method.as_ref(), &setup, client)?,
            iterative: arguments.procedure.iterative,
            weighted: arguments.procedure.weighted(),
            blocks: arguments.blocks,
            flip,
            resume: arguments.resume,
        };
        let bar = Bar::new("replaying", verbosity);
        Ok(replay(client, &setup, &order, &mut |p| {
            let what = match p.run {
                "" => p.what.to_owned(),
                run => format!("{run}, {}", p.what),
            };
            bar.set(p.share, &what);
        })?)
    })?;
    if !arguments.device.keeps_time() {
        for answer in outcome.bases.iter_mut().flat_map(|b| &mut b.answers) {
            answer.seconds = None;
        }
    }
    if arguments.json {
        print_json(&ReplayDocument::new(&setup.title, &outcome))?;
    } else {
        print(&setup.title, &outcome).map_err(|e| Failure::stdout(&e))?;
    }
    warn(&faults(&outcome), verbosity);
    match (outcome.identical(), flip) {
        (true, None) => Ok(()),
        (true, Some(_)) => {
            let note = "the flipped bit changed nothing: its sample lies in no averaged block, its channel in no compared number, or it is so small that rounding swallows it; flip a higher bit near the middle of a run";
            warn(&[note.to_owned()], verbosity);
            Ok(())
        }
        (false, None) => Err(differs(
            "box and this machine differ: the box runs other firmware than this program's core (`massline flash` puts this one on it), or its memory or link is faulty (`massline board selftest`)",
        )),
        (false, Some(_)) => Err(differs("the flipped bit was noticed")),
    }
}

fn differs(message: &str) -> Failure {
    Failure {
        code: 1,
        message: message.to_owned(),
    }
}

fn methods<P: Port>(
    wanted: Option<&Wanted>,
    setup: &Setup,
    client: &mut Client<'_, P>,
) -> Result<Vec<Method>, Failure> {
    Ok(match wanted {
        Some(Wanted::These(methods)) => methods.clone(),
        None => vec![recommended(setup).0],
        Some(Wanted::All) => {
            let has = client.hello()?.capacity.methods;
            let known = Method::ALL.into_iter();
            known.filter(|&m| has.contains(m)).collect()
        }
    })
}

/// Width of the column of what was compared.
const WIDTH: usize = 44;

fn print(title: &str, outcome: &Outcome) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    let (bold, dim) = (Style::new().bold(), Style::new().dimmed());
    let device = &outcome.device;
    writeln!(out, "{bold}{title}{bold:#}")?;
    writeln!(
        out,
        "{dim}box: {} {} (build {}) on {}{dim:#}",
        device.firmware, device.version, device.build, device.chip
    )?;
    for base in &outcome.bases {
        writeln!(out)?;
        writeln!(out, "{bold}{}{bold:#}", base.base.description())?;
        row(&mut out, "lines of the set-up", &base.grid)?;
        if let Some(weights) = &base.weights {
            row(&mut out, "peaks and weights", weights)?;
        }
        for run in &base.runs {
            row(&mut out, &about(run), &run.comparison)?;
        }
        for answer in &base.answers {
            let (name, description) = (answer.method.name(), answer.method.description());
            row(
                &mut out,
                &format!("ten numbers by {name}"),
                &answer.comparison,
            )?;
            match (&answer.no_answer, answer.seconds) {
                (Some(why), _) => writeln!(out, "    {dim}both have no answer: {why}{dim:#}")?,
                (None, Some(s)) => {
                    writeln!(out, "    {dim}{description}, {s:.3} s on the box{dim:#}")?
                }
                (None, None) => writeln!(out, "    {dim}{description}{dim:#}")?,
            }
        }
    }
    let all = outcome.comparisons();
    let (numbers, different) = all.fold((0, 0), |(n, d), (_, c)| (n + c.numbers, d + c.different));
    writeln!(out)?;
    let link = &outcome.link;
    writeln!(
        out,
        "{dim}link: {} frames sent, {} of them again; {} received, {} lost{dim:#}",
        link.sent, link.resent, link.received.frames, link.received.lost
    )?;
    if outcome.identical() {
        let green = AnsiColor::Green.on_default().bold();
        writeln!(
            out,
            "{green}identical{green:#}: {numbers} numbers, to the last bit"
        )
    } else {
        let red = AnsiColor::Red.on_default().bold();
        writeln!(
            out,
            "{red}different{red:#}: {different} of {numbers} numbers"
        )
    }
}

fn about(run: &RunOutcome) -> String {
    format!("{}: {} blocks, {} lines", run.name, run.blocks, run.lines)
}

/// Notes on the samples that the recordings call faulty; a run that was measured in
/// several ways is noted once.
fn faults(outcome: &Outcome) -> Vec<String> {
    let runs = outcome.bases.first().map_or(&[][..], |base| &base.runs);
    let faulty = runs.iter().filter(|run| run.faulty > 0);
    let told = faulty.map(|run| {
        format!(
            "run \"{}\": faulty samples ({}) went to the box as what is no number; it left out {} of {} blocks",
            run.name,
            run.faulty,
            run.rejected,
            run.rejected + run.blocks
        )
    });
    told.collect()
}

fn row(out: &mut impl Write, what: &str, comparison: &Comparison) -> std::io::Result<()> {
    let numbers = comparison.numbers;
    write!(out, "  {what:<WIDTH$}{numbers:>7} numbers  ")?;
    if comparison.identical() {
        let green = AnsiColor::Green.on_default();
        return writeln!(out, "{green}identical{green:#}");
    }
    let red = AnsiColor::Red.on_default();
    writeln!(out, "{red}{} differ{red:#}", comparison.different)?;
    match &comparison.first {
        Some(first) => writeln!(out, "    {first}"),
        None => writeln!(out, "    nothing was compared"),
    }
}

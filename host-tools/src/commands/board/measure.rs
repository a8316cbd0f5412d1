//! `massline board measure`: the runs of a setup from the box's inputs, identified on the box.

use super::found::Asked;
use super::troubles::HostTroubles;
use crate::acquire::fault_text;
use crate::box_runs::{BoxRunError, Ended, Measuring, Operator, Progress, Stage};
use crate::commands::device::Device;
use crate::commands::{Failure, Interrupt, Ticker, Verbosity, warn};
use crate::format::plain;
use crate::recording::spell;
use crate::rig::Shaker;
use crate::setup::Setup;
use anstyle::Style;
use massline_firmware::wire::{Pass, RESULTANTS};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

/// Measure the runs of a setup from the box's inputs, and have the box identify the body
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board measure setup.toml --port /dev/ttyACM0 --inputs inputs.toml\n  massline board measure setup.toml --port /dev/ttyACM0 --run \"lateral X\" --duration 60\n  massline demo && massline board measure demo/setup.toml --host --duration 60\n\nBefore each run it says what to shake and waits for Enter. A run ends after --duration, or\nby Ctrl-C, and stays stored on the box: with --run the others stay as they are. Recordings\nof the setup are not read. With --host the tuning fork is shaken by this program."
)]
pub struct Arguments {
    /// The setup: sensors, processing and runs
    setup: PathBuf,
    #[command(flatten)]
    device: Device,
    /// Only this run; may be given several times. Others that the box has stay
    #[arg(long, value_name = "NAME")]
    run: Vec<String>,
    /// Length of each run, s; until Ctrl-C if absent
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    duration: Option<f64>,
    /// Begin each run so many seconds after the last, in place of waiting for Enter
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    countdown: Option<f64>,
    #[command(flatten)]
    asked: Asked,
    #[command(flatten)]
    troubles: HostTroubles,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if a run cannot be measured, or the box has no answer.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup)?.with_readings_in_si();
    let order = Measuring {
        runs: runs(&setup, &arguments.run)?,
        seconds: arguments.duration,
    };
    let troubles = arguments.troubles.get()?;
    let asked = &arguments.asked;
    arguments.device.talk_of_runs(troubles, |client, shaker| {
        let test = asked.plan(client, &setup, shaker)?;
        let forgotten = test.load(client)?;
        if forgotten > 0 {
            let note = format!(
                "the box held {forgotten} runs of another setup, or of this one before it was changed; they are forgotten"
            );
            warn(&[note], verbosity);
        }
        let mut table = Table {
            setup: &setup,
            arguments,
            verbosity,
            shaker,
            interrupt: Interrupt::catch()?,
            ticker: None,
        };
        table.interrupt.arm(false);
        test.measure(client, &order, &mut table)?;
        drop(table);
        asked.answer(client, &test, &setup, verbosity)
    })
}

/// Numbers of the runs that are meant, in the order of the setup.
fn runs(setup: &Setup, wanted: &[String]) -> Result<Vec<usize>, Failure> {
    let known = |name: &String| setup.runs.iter().any(|run| run.name == *name);
    if let Some(name) = wanted.iter().find(|name| !known(name)) {
        let names: Vec<String> = setup
            .runs
            .iter()
            .map(|r| format!("\"{}\"", r.name))
            .collect();
        return Err(Failure::input(format!(
            "--run {name}: the setup has no such run; it has {}",
            names.join(", ")
        )));
    }
    let all = setup.runs.iter().enumerate();
    let these = all.filter(|(_, run)| wanted.is_empty() || wanted.contains(&run.name));
    Ok(these.map(|(number, _)| number).collect())
}

/// The user at the terminal.
struct Table<'a> {
    setup: &'a Setup,
    arguments: &'a Arguments,
    verbosity: Verbosity,
    shaker: Option<&'a Shaker>,
    interrupt: Interrupt,
    ticker: Option<Ticker>,
}

impl Operator for Table<'_> {
    fn shake(&mut self, stage: &Stage<'_>) -> Result<(), BoxRunError> {
        self.interrupt.arm(false);
        let waits = std::io::stdin().is_terminal() && self.shaker.is_none();
        let countdown = self.arguments.countdown;
        // A terminal that does not take a prompt is no reason not to measure.
        let mut err = anstream::stderr();
        if !self.verbosity.quiet || waits {
            let _ = writeln!(err, "{}", self.announcement(stage));
        }
        match countdown {
            Some(seconds) => std::thread::sleep(Duration::from_secs_f64(seconds)),
            None if waits => {
                let _ = write!(err, "  Enter when the table shakes: ");
                let _ = err.flush();
                let _ = std::io::stdin().read_line(&mut String::new());
            }
            None => {}
        }
        if let Some(shaker) = self.shaker {
            shaker.shake(stage.name);
        }
        self.interrupt.arm(true);
        self.ticker = Some(Ticker::new("measuring", self.verbosity));
        Ok(())
    }

    fn watch(&mut self, _: &Stage<'_>, progress: &Progress) -> bool {
        let ticker = self
            .ticker
            .get_or_insert_with(|| Ticker::new("measuring", self.verbosity));
        for fault in &progress.faults {
            ticker.say(&fault_text(fault), self.verbosity);
        }
        ticker.set(&told(progress, self.arguments.duration));
        !self.interrupt.is_pressed()
    }

    fn ended(&mut self, stage: &Stage<'_>, ended: &Ended) {
        self.ticker = None;
        self.interrupt.arm(false);
        if !self.verbosity.quiet {
            let _ = writeln!(anstream::stderr(), "  {}", summary(ended));
        }
        if stage.pass == Pass::Measure && ended.summary.blocks == 0 {
            let note = format!(
                "run \"{}\" has no good block and is not stored; let it last longer, or see by `massline board monitor` what is wrong",
                stage.name
            );
            warn(&[note], self.verbosity);
        }
        if ended.failed() {
            let note = format!(
                "run \"{}\" was ended by a fault of the box; `massline board info` says more",
                stage.name
            );
            warn(&[note], self.verbosity);
        }
    }
}

impl Table<'_> {
    fn announcement(&self, stage: &Stage<'_>) -> String {
        let bold = Style::new().bold();
        let what = match stage.pass {
            Pass::Survey => "survey for the weights",
            Pass::Measure => "measurement",
        };
        let mut text = format!(
            "{bold}{} of {}: shake \"{}\"{bold:#}, random, {what}",
            stage.step, stage.steps, stage.name
        );
        if let Some(run) = self.setup.runs.get(stage.number)
            && run.is_remounted()
        {
            let list = |all: [f64; 3]| all.map(|x| plain(x, 6)).join(", ");
            text += &format!(
                ", the specimen turned by ({})°, shifted by ({}) m",
                list(run.rotation),
                list(run.translation)
            );
        }
        text + &match self.arguments.duration {
            Some(seconds) => format!(", {} s", plain(seconds, 6)),
            None => ", until Ctrl-C".to_owned(),
        }
    }
}

/// Names of the twelve resultants.
const NAMES: [&str; RESULTANTS] = [
    "x", "y", "z", "about x", "about y", "about z", "fx", "fy", "fz", "mx", "my", "mz",
];

/// The line that is shown meanwhile.
fn told(progress: &Progress, seconds: Option<f64>) -> String {
    let mut text = format!("{:.1} s", progress.seconds);
    if let Some(seconds) = seconds {
        text += &format!(" of {} s", plain(seconds, 6));
    }
    text += &format!(", {} blocks", progress.averaged);
    if progress.rejected.blocks > 0 {
        let (blocks, reasons) = (progress.rejected.blocks, progress.rejected.reasons());
        text += &format!(", {blocks} rejected: {reasons}");
    }
    if let Some(coherence) = progress.coherence {
        let best = |half: std::ops::Range<usize>| {
            let all = half.map(|k| (NAMES[k], coherence[k]));
            all.max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let both = [best(0..6), best(6..RESULTANTS)].into_iter().flatten();
        let both: Vec<String> = both.map(|(name, c)| format!("{name} {c:.3}")).collect();
        text += &format!(", coherence {}", both.join(" and "));
    }
    if let Some((channel, share)) = &progress.fullest {
        text += &format!(", largest {channel} at {:.0} % of its range", 100.0 * share);
    }
    if !progress.faulty.is_empty() {
        let now = progress.faulty.iter();
        let now: Vec<String> = now.map(|(c, h)| format!("{c} {}", spell(*h))).collect();
        text += &format!(", now: {}", now.join(", "));
    }
    text
}

/// Outcome of a run.
fn summary(ended: &Ended) -> String {
    let s = &ended.summary;
    let seconds = (s.samples + s.missing) as f64 / ended.rate;
    let mut text = format!("{} samples in {} s", s.samples, plain(seconds, 5));
    if s.missing > 0 {
        text += &format!(", {} missing", s.missing);
    }
    if s.pass == Pass::Measure {
        text += &format!(", {} blocks", s.blocks);
    }
    if s.rejected > 0 {
        text += &format!(", {} rejected: {}", s.rejected, ended.rejected().reasons());
    }
    if let Some(rate) = s.sample_rate {
        text += &format!("; {} Hz by the box's clock", plain(rate, 7));
    }
    text
}

//! `massline board monitor`: live levels of the box's inputs.

use super::columns::{self, Wanted};
use super::troubles::HostTroubles;
use crate::acquire::{Level, Snapshot, fault_text, monitor};
use crate::commands::device::Device;
use crate::commands::{Failure, Interrupt, Verbosity, warn};
use crate::format::significant;
use crate::recording::spell;
use anstyle::{AnsiColor, Style};
use std::io::{IsTerminal, Write};

/// Show the levels and faults of the box's inputs as they are now
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board monitor --port /dev/ttyACM0\n  massline board monitor --port /dev/ttyACM0 --inputs inputs.toml --seconds 10\n  massline board monitor --host --fault open --fault-rate 10 --seconds 20 | grep open\n\nMean, RMS about it and peak are SI; the bar is the peak's share of the range. It ends by\nCtrl-C. Where stdout is no terminal, each second has a line for each channel."
)]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
    /// Length in seconds; until Ctrl-C if absent
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    seconds: Option<f64>,
    /// Inputs: 1,3-6,drive=8, or a file of inputs; all that are wired if absent
    #[arg(long, value_name = "LIST|FILE", value_parser = columns::parse)]
    inputs: Option<Wanted>,
    #[command(flatten)]
    troubles: HostTroubles,
}

/// Seconds from one look to the next, on a terminal and elsewhere.
const EVERY: [f64; 2] = [0.25, 1.0];
/// Characters of a bar.
const BAR: usize = 20;

/// Runs the command.
///
/// # Errors
/// [`Failure`] if samples do not come.
pub fn run(arguments: &Arguments, _: Verbosity) -> Result<(), Failure> {
    let troubles = arguments.troubles.get()?;
    let live = std::io::stdout().is_terminal();
    let every = if live { EVERY[0] } else { EVERY[1] };
    arguments.device.talk_of_inputs(troubles, |client| {
        let inputs = columns::choose(client, arguments.inputs.as_ref())?;
        let interrupt = Interrupt::catch()?;
        let mut written = Ok(());
        let mut shown = 0;
        let mut show = |snapshot: &Snapshot| {
            let before = if live { std::mem::take(&mut shown) } else { 0 };
            let lines = if live { height() } else { usize::MAX };
            written = write(snapshot, before, live, lines).map(|lines| shown = lines);
            written.is_ok() && !interrupt.is_pressed()
        };
        let done = monitor(client, &inputs, every, arguments.seconds, &mut show);
        written.map_err(|e| Failure::stdout(&e))?;
        done.map_err(Failure::input)
    })
}

/// Lines of the terminal.
fn height() -> usize {
    let (lines, _) = console::Term::stdout().size();
    usize::from(lines)
}

/// Shows a snapshot in at most `height` lines, the cursor's included; on a terminal over the
/// `before` lines of the one before. The lines that it took.
fn write(snapshot: &Snapshot, before: usize, live: bool, height: usize) -> std::io::Result<usize> {
    let mut out = anstream::stdout().lock();
    if before > 0 {
        write!(out, "\x1b[{before}A")?;
    }
    // What was longer before is wiped out.
    let end = if live { "\x1b[K\n" } else { "\n" };
    // Faults of the box stay: what follows moves down.
    let yellow = AnsiColor::Yellow.on_default().bold();
    for fault in &snapshot.box_faults {
        let text = fault_text(fault);
        if live {
            write!(out, "{yellow}note:{yellow:#} {text}{end}")?;
        } else {
            warn(&[text], Verbosity::default());
        }
    }
    if live {
        let bold = Style::new().bold();
        let time = format!("{:.1} s", snapshot.seconds);
        write!(
            out,
            "{bold}{time:<12}{:>11}{:>11}{:>11}  {:<BAR$}{bold:#}{end}",
            "mean", "RMS", "peak", "of range"
        )?;
    }
    let fit = fitting(snapshot.levels.len(), height);
    let (shown, hidden) = snapshot.levels.split_at(fit);
    for level in shown {
        if !live {
            write!(out, "{:>8.1}  ", snapshot.seconds)?;
        }
        write!(out, "{}{end}", row(level))?;
    }
    if !hidden.is_empty() {
        let faulty = hidden.iter().filter(|l| !l.health.is_good()).count();
        let also = if faulty > 0 {
            let red = AnsiColor::Red.on_default();
            format!(", {red}{faulty} of them faulty{red:#}")
        } else {
            String::new()
        };
        write!(out, "... and {} more{also}{end}", hidden.len())?;
    }
    if live {
        // Lines of a longer table before.
        write!(out, "\x1b[J")?;
    }
    out.flush()?;
    Ok(1 + fit + usize::from(!hidden.is_empty()))
}

/// Number of channels that are shown of so many, where the heading, the cursor and the note on
/// further channels take a line each.
fn fitting(channels: usize, height: usize) -> usize {
    let room = height.saturating_sub(2);
    if channels <= room {
        channels
    } else {
        room.saturating_sub(1).min(channels)
    }
}

fn row(level: &Level) -> String {
    let number = |x: f64| {
        if level.samples == 0 {
            return "-".to_owned();
        }
        if x != 0.0 && !(1e-3..1e6).contains(&x.abs()) {
            return format!("{x:.2e}");
        }
        significant(x, 4)
    };
    let share = level.used();
    let filled = (share.clamp(0.0, 1.0) * BAR as f64).round() as usize;
    let style = if level.health.is_good() {
        Style::new()
    } else {
        AnsiColor::Red.on_default()
    };
    format!(
        "{:<12}{:>11}{:>11}{:>11}  {style}{}{}{style:#} {:>3.0} %  {style}{}{style:#}",
        level.channel,
        number(level.mean),
        number(level.rms()),
        number(level.peak),
        "█".repeat(filled),
        "·".repeat(BAR - filled),
        100.0 * share,
        spell(level.health)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_counted() {
        assert_eq!(fitting(19, 21), 19);
        // Heading, 17 channels, what is left, the cursor.
        assert_eq!(fitting(19, 20), 17);
        assert_eq!(fitting(19, 4), 1);
        assert_eq!((fitting(19, 0), fitting(0, 0)), (0, 0));
        assert_eq!(fitting(35, usize::MAX), 35);
    }
}

//! `massline board record`: the box's inputs to a recording.

use super::columns::{self, Wanted};
use super::troubles::HostTroubles;
use crate::acquire::{
    Ending, Order, Progress, Recorded, count_faults, fault_text, free_name, record,
};
use crate::commands::device::Device;
use crate::commands::{Failure, Interrupt, Ticker, Verbosity, print_json, warn};
use crate::device::{Client, Port};
use crate::format::{plain, with_std};
use crate::output::{self, Existing};
use crate::printable::printable;
use crate::recording::{Firmware, TrueRate, Written, fault_words, spell};
use anstyle::{AnsiColor, Style};
use massline_core::identify::half_width_95;
use massline_firmware::sampling::lowpass;
use massline_firmware::wire::Health;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Record the box's inputs to a file that `massline identify` reads
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board record x.csv --port /dev/ttyACM0 --seconds 60\n  massline board record x.parquet --port /dev/ttyACM0 --inputs inputs.toml\n  massline board record x.csv.gz --host --seconds 60 --inputs drive=1,a1=2,a2=3\n\nIt ends after --seconds, or by Ctrl-C. Samples that are faulty or never came are marked in\nthe column `health`; the true sample rate and the calibrations stand above the header, or in\nthe metadata of Parquet. Of a recording that was killed `massline recover` makes a file."
)]
pub struct Arguments {
    /// The recording, .csv, .csv.gz or .parquet; or a folder, for recording-1.csv and so on
    file: PathBuf,
    #[command(flatten)]
    device: Device,
    /// Length in seconds; until Ctrl-C if absent
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    seconds: Option<f64>,
    /// Inputs: 1,3-6,drive=8, or a file of inputs; all that are wired if absent
    #[arg(long, value_name = "LIST|FILE", value_parser = columns::parse)]
    inputs: Option<Wanted>,
    /// Replace a file of that name, and set aside what a killed program left of one (.part)
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    troubles: HostTroubles,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if there is no recording, or if it ended before its time.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let file = file(&arguments.file)?;
    let inputs = arguments.inputs.as_ref().and_then(Wanted::file);
    let inputs = inputs.into_iter().chain(arguments.device.file());
    output::check(&file, inputs, Existing::Keep.or_force(arguments.force))?;
    let troubles = arguments.troubles.get()?;
    let (recorded, inputs) = arguments.device.talk_of_inputs(troubles, |client| {
        let order = Order {
            inputs: columns::choose(client, arguments.inputs.as_ref())?,
            seconds: arguments.seconds,
            firmware: firmware(client, &file)?,
            file,
            replace: arguments.force,
        };
        let inputs: Vec<u8> = order.inputs.iter().map(|entry| entry.input).collect();
        let interrupt = Interrupt::catch()?;
        let ticker = Ticker::new("recording", verbosity);
        let mut told_faults = 0;
        let watch = &mut |progress: &Progress<'_>| {
            for fault in progress.box_faults.iter().skip(told_faults) {
                ticker.say(&fault_text(fault), verbosity);
            }
            told_faults = progress.box_faults.len();
            ticker.set(&told(progress, arguments.seconds));
            !interrupt.is_pressed()
        };
        let recorded = record(client, &order, watch).map_err(Failure::input)?;
        let last = recorded.box_faults.iter().skip(told_faults);
        let last: Vec<String> = last.map(fault_text).collect();
        warn(&last, verbosity);
        Ok((recorded, inputs))
    })?;
    if arguments.json {
        print_json(&RecordDocument::new(&recorded))?;
    } else {
        print(&recorded).map_err(|e| Failure::stdout(&e))?;
    }
    warn(&notes(&recorded), verbosity);
    let late = out_of_step(&recorded.channels, &inputs, recorded.nominal);
    warn(late.as_slice(), verbosity);
    match &recorded.ending {
        Ending::Complete | Ending::Stopped => Ok(()),
        Ending::Failed(error) => {
            let kept = format!("what came before is in {}", recorded.file.display());
            Err(Failure::input(error).and(kept))
        }
    }
}

/// The file, or a free name in the folder.
fn file(path: &Path) -> Result<PathBuf, Failure> {
    let text = path.to_string_lossy();
    if path.is_dir() || text.ends_with(['/', '\\']) {
        return Ok(free_name(path));
    }
    if Written::of(path).is_some() {
        return Ok(path.to_owned());
    }
    Err(Failure::input(format!(
        "{text}: a recording's name ends in .csv, .csv.gz or .parquet; a folder's in /"
    )))
}

/// Facts about the box, for a format that states them.
fn firmware<P: Port>(client: &mut Client<'_, P>, file: &Path) -> Result<Option<Firmware>, Failure> {
    if Written::of(file) != Some(Written::Parquet) {
        return Ok(None);
    }
    let info = client.hello()?;
    Ok(Some(Firmware {
        name: info.firmware,
        version: info.version,
        build: info.build,
        chip_serial: info
            .serial
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect(),
    }))
}

/// The line that is shown meanwhile.
fn told(progress: &Progress<'_>, seconds: Option<f64>) -> String {
    let mut text = format!("{:.1} s", progress.seconds);
    if let Some(seconds) = seconds {
        text += &format!(" of {} s", plain(seconds, 6));
    }
    let used =
        |a: &&crate::acquire::Level, b: &&crate::acquire::Level| a.used().total_cmp(&b.used());
    if let Some(level) = progress.levels.iter().max_by(used) {
        let share = 100.0 * level.used();
        text += &format!(", largest {} at {share:.0} % of its range", level.channel);
    }
    if progress.faulty > 0 {
        text += &format!(", {} faulty samples", progress.faulty);
    }
    let now = progress.levels.iter().filter(|l| !l.health.is_good());
    let now: Vec<String> = now
        .map(|l| format!("{} {}", l.channel, spell(l.health)))
        .collect();
    if !now.is_empty() {
        text += &format!(", now: {}", now.join(", "));
    }
    text
}

/// Note on channels behind converters of several kinds, whose filters delay differently, for the setup: the
/// recording has their readings as they came.
fn out_of_step(channels: &[String], inputs: &[u8], rate: f64) -> Option<String> {
    let delay = |input: &u8| Some(lowpass(usize::from(*input), rate)?.delay * rate);
    let first = delay(inputs.first()?)?;
    let late = channels.iter().zip(inputs);
    let lines: Vec<String> = late
        .filter_map(|(channel, input)| {
            let samples = delay(input)? - first;
            (samples != 0.0).then(|| format!("{channel} takes `delay = {}`", plain(samples, 3)))
        })
        .collect();
    (!lines.is_empty()).then(|| {
        format!(
            "other converters than that of {} delay otherwise: in the setup {}",
            channels.first().map_or("the first channel", String::as_str),
            lines.join(", ")
        )
    })
}

fn notes(recorded: &Recorded) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(aside) = &recorded.set_aside {
        notes.push(format!(
            "{}: here are now the rows of an earlier recording that was not finished",
            aside.display()
        ));
    }
    if let Some(left_over) = &recorded.left_over {
        notes.push(format!(
            "{}: could not be removed; all that is in it is in the recording",
            left_over.display()
        ));
    }
    if recorded.lost > 0 {
        notes.push(format!(
            "{} frames of the box were lost on the way; what they held is missing in the recording",
            recorded.lost
        ));
    }
    if recorded.more_box_faults > 0 {
        notes.push(format!(
            "the box told of {} more faults than the {} that were counted",
            recorded.more_box_faults,
            recorded.box_faults.len()
        ));
    }
    match &recorded.sample_rate {
        None => notes.push(
            "too short to tell the true sample rate: the setup needs `sample_rate`".to_owned(),
        ),
        Some(rate) if (rate.value / recorded.nominal - 1.0).abs() > 1e-3 => notes.push(format!(
            "the converters sample at {} Hz where they are set to {} Hz: is their crystal the one that the firmware was built for?",
            plain(rate.value, 7),
            plain(recorded.nominal, 7)
        )),
        Some(_) => {}
    }
    notes
}

/// Faults with their rows, most frequent first.
fn faults(recorded: &Recorded) -> Vec<(&'static str, u64)> {
    let mut faults: Vec<_> = fault_words().into_iter().zip(recorded.by_fault).collect();
    faults.retain(|(_, rows)| *rows > 0);
    faults.sort_by_key(|(_, rows)| std::cmp::Reverse(*rows));
    faults
}

fn print(recorded: &Recorded) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    let bold = Style::new().bold();
    let red = AnsiColor::Red.on_default();
    let file = recorded.file.display().to_string();
    writeln!(out, "{bold}{}{bold:#}", printable(&file))?;
    let samples = format!(
        "{} in {} s, {} channels",
        recorded.samples,
        plain(recorded.seconds, 6),
        recorded.channels.len()
    );
    super::print_row(&mut out, "samples", &samples)?;
    if let Some(TrueRate {
        value, uncertainty, ..
    }) = &recorded.sample_rate
    {
        // 95 %, as everywhere behind ±.
        let half = uncertainty * half_width_95(f64::INFINITY);
        let (value, half) = with_std(*value, half);
        let text = format!("{value} ± {half} Hz by this computer's clock");
        super::print_row(&mut out, "true rate", &text)?;
    }
    if !recorded.box_faults.is_empty() {
        let counts = count_faults(&recorded.box_faults).into_iter();
        let list: Vec<String> = counts.map(|(name, n)| format!("{name} ({n})")).collect();
        let text = format!("{red}{}{red:#}", list.join(", "));
        super::print_row(&mut out, "box", &text)?;
    }
    if recorded.faulty == 0 {
        return super::print_row(&mut out, "faulty", "none");
    }
    let list = faults(recorded);
    let list: Vec<String> = list
        .iter()
        .map(|(word, n)| format!("{word} ({n})"))
        .collect();
    let text = format!("{red}{}{red:#}: {}", recorded.faulty, list.join(", "));
    super::print_row(&mut out, "faulty", &text)?;
    for (channel, (rows, health)) in recorded.channels.iter().zip(&recorded.by_channel) {
        if *rows > 0 {
            let text = format!("{rows}: {}", spell(*health));
            super::print_row(&mut out, &format!("  {channel}"), &text)?;
        }
    }
    Ok(())
}

/// The document of a recording, `massline/record/1`.
#[derive(Serialize)]
struct RecordDocument {
    schema: &'static str,
    file: String,
    channels: Vec<String>,
    samples: u64,
    /// By the rate that the converters are set to.
    seconds: f64,
    faulty_samples: u64,
    missing_samples: u64,
    by_fault: BTreeMap<&'static str, u64>,
    faulty_channels: BTreeMap<String, ChannelFaults>,
    /// Faults of the box itself, by kind.
    box_faults: BTreeMap<&'static str, u64>,
    /// Hz, by the clock of this computer.
    true_sample_rate: Option<TrueRate>,
    frames_lost: u64,
    /// New path of the rows of an unfinished recording that were in the way.
    set_aside: Option<String>,
    /// `complete`, `stopped` or `failed`.
    ending: &'static str,
    reason: Option<String>,
}

/// Faults of a channel.
#[derive(Serialize)]
struct ChannelFaults {
    samples: u64,
    faults: Vec<&'static str>,
}

impl RecordDocument {
    fn new(recorded: &Recorded) -> Self {
        let channels = recorded.channels.iter().zip(&recorded.by_channel);
        let words = |health: Health| {
            let words = fault_words().into_iter().enumerate();
            let known = words.filter(|(kind, _)| health.contains(Health(1 << kind)));
            known.map(|(_, word)| word).collect()
        };
        let (ending, reason) = match &recorded.ending {
            Ending::Complete => ("complete", None),
            Ending::Stopped => ("stopped", None),
            Ending::Failed(error) => ("failed", Some(error.to_string())),
        };
        Self {
            schema: "massline/record/1",
            file: recorded.file.display().to_string(),
            channels: recorded.channels.clone(),
            samples: recorded.samples,
            seconds: recorded.seconds,
            faulty_samples: recorded.faulty,
            missing_samples: recorded.missing,
            by_fault: faults(recorded).into_iter().collect(),
            faulty_channels: channels
                .filter(|(_, (rows, _))| *rows > 0)
                .map(|(channel, (samples, health))| {
                    let faults = words(*health);
                    let samples = *samples;
                    (channel.clone(), ChannelFaults { samples, faults })
                })
                .collect(),
            box_faults: count_faults(&recorded.box_faults),
            true_sample_rate: recorded.sample_rate.clone(),
            frames_lost: recorded.lost,
            set_aside: recorded.set_aside.as_ref().map(|p| p.display().to_string()),
            ending,
            reason,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_of_another_kind_of_converter_are_told_with_their_delay() {
        let channels = ["f1", "a1", "a2"].map(str::to_owned);
        assert_eq!(out_of_step(&channels, &[0, 8, 31], 512.0), None);
        assert_eq!(out_of_step(&channels, &[32, 33, 34], 512.0), None);
        let told = out_of_step(&channels, &[3, 32, 33], 512.0);
        // 1.78 periods of 1000 Hz against 1/2048 and 1/1024 s.
        assert_eq!(
            told.as_deref(),
            Some(
                "other converters than that of f1 delay otherwise: in the setup a1 takes \
                 `delay = 0.161`, a2 takes `delay = 0.161`"
            )
        );
    }
}

//! `massline board settings`: what the box keeps beyond a set-up.

use super::change::{Change, Order, parse};
use super::print_row;
use crate::commands::device::Device;
use crate::commands::{Failure, Verbosity, print_json, warn};
use crate::device::{Client, ClientError, Port};
use crate::format::plain;
use crate::inputs::{self, InputEntry};
use crate::output::{self, Existing};
use crate::printable::printable;
use crate::rig::Troubles;
use anstyle::Style;
use massline_firmware::wire::{Reply, Request, Setting, SettingKey, Storage};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

/// Show the box's settings, change them and keep them
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board settings --port /dev/ttyACM0\n  massline board settings --port /dev/ttyACM0 --set name=\"table 2\" --set rate=512 --save\n  massline board settings --port /dev/ttyACM0 --inputs inputs.toml --save\n\nA file of inputs holds one [[input]] for each that is to change: `input` (its number, from 1),\n`circuit` and what its data sheet says, `serial`, `certificate`, `calibrated`, `uncertainty`.\n  bridge: rated_load, rated_output (V/V), supply (2.5 V)   iepe: sensitivity (V), divider, range\n  charge: sensitivity (C), amplifier (V/C), divider, range voltage: sensitivity (V), range\n  adxl355, unused: nothing; all: per_count, offset, gain, limits where they were calibrated\n`--export` writes such a file from what the box has.\nA changed baud holds from the next start on (`massline board restart`)."
)]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
    /// Change one: name (text), baud (link, bit/s), rate (converters, samples/s)
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse)]
    set: Vec<Change>,
    /// Wire inputs as a file says; those that are not in it stay as they are
    #[arg(long, value_name = "FILE")]
    inputs: Option<PathBuf>,
    /// Write the box's inputs to a file, to be kept or given to --inputs
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Have --export replace a file of that name
    #[arg(long, requires = "export")]
    force: bool,
    /// Go back to the settings the box was delivered with, before any --set and --inputs
    #[arg(long)]
    reset: bool,
    /// Keep them when the box is switched off
    #[arg(long)]
    save: bool,
    /// With --reset and --save: do not ask whether the calibrations may go
    #[arg(long, requires = "reset")]
    yes: bool,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// The document of the settings, `massline/settings/1`.
#[derive(Debug, Default, Serialize)]
struct SettingsDocument {
    schema: &'static str,
    name: String,
    /// bit/s
    baud: u32,
    /// samples/s
    rate: f64,
    inputs: Vec<InputRow>,
    saved: bool,
}

/// An input that something is wired to.
#[derive(Debug, Serialize)]
struct InputRow {
    /// From one.
    input: u32,
    circuit: &'static str,
    serial: String,
    certificate: String,
    calibrated: Option<String>,
    /// m/s², N or N m per count.
    per_count: f64,
    /// Count at zero.
    offset: f64,
    /// Relative, one standard deviation.
    uncertainty: f64,
    gain: u8,
    /// Counts.
    limits: [i32; 2],
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box cannot be asked, or refuses a value.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    // Before the box is asked for anything, so that a mistake in the file changes nothing.
    if let Some(file) = &arguments.export {
        let inputs = arguments.inputs.iter().map(PathBuf::as_path);
        let inputs = inputs.chain(arguments.device.file());
        let existing = Existing::Keep.or_force(arguments.force);
        output::check(file, inputs, existing)?;
    }
    let file = arguments.inputs.as_deref().map(inputs::read);
    let wired = file.transpose()?.unwrap_or_default();
    let order = Order {
        reset: arguments.reset,
        set: &arguments.set,
        wired: &wired,
        save: arguments.save,
        yes: arguments.yes,
    };
    order.check()?;
    let talk = |client: &mut Client<'_, Box<dyn Port + '_>>| {
        let info = client.hello()?;
        let saved = order.apply(client, &info)?;
        let (document, entries) = read(client, info.capacity.inputs)?;
        Ok((document, entries, saved == Some(Storage::Volatile)))
    };
    let device = &arguments.device;
    let (document, mut entries, volatile) = device.talk_of_inputs(Troubles::default(), talk)?;
    if let Some(file) = &arguments.export {
        // The box does not know the channels' names.
        for entry in &mut entries {
            let named = wired.iter().find(|w| w.input == entry.input);
            entry.channel = named.and_then(|w| w.channel.clone());
        }
        output::write(file, inputs::to_toml(&entries).as_bytes())?;
    }
    if arguments.json {
        print_json(&document)?;
    } else {
        print(&document).map_err(|e| Failure::stdout(&e))?;
    }
    if volatile {
        let note = "this box has no flash to keep settings in: they hold until it is switched off";
        warn(&[note.to_owned()], verbosity);
    } else if !document.saved {
        let note = "not kept yet: with --save they outlive the power switch";
        warn(&[note.to_owned()], verbosity);
    }
    Ok(())
}

fn read<P: Port>(
    client: &mut Client<'_, P>,
    inputs: u8,
) -> Result<(SettingsDocument, Vec<InputEntry>), ClientError> {
    let mut document = SettingsDocument {
        schema: "massline/settings/1",
        ..SettingsDocument::default()
    };
    let own = [
        SettingKey::Name,
        SettingKey::LinkBaud,
        SettingKey::SampleRate,
    ];
    for key in own {
        client.ask(&Request::ReadSetting(key), |reply| match reply {
            Reply::Setting(setting) => {
                document.take(setting);
                Some(())
            }
            _ => None,
        })?;
    }
    let entries = client.wired_inputs(inputs)?;
    document.inputs = entries.iter().map(InputRow::new).collect();
    document.saved = !client.status()?.unsaved;
    Ok((document, entries))
}

impl InputRow {
    fn new(entry: &InputEntry) -> Self {
        let input = entry.setting();
        Self {
            input: entry.number(),
            circuit: inputs::circuit(input.circuit),
            serial: input.serial.to_owned(),
            certificate: input.certificate.to_owned(),
            calibrated: input.calibrated.map(inputs::day),
            per_count: input.per_count,
            offset: input.offset,
            uncertainty: input.uncertainty,
            gain: input.gain,
            limits: input.limits,
        }
    }
}

impl SettingsDocument {
    fn take(&mut self, setting: &Setting<'_>) {
        match setting {
            Setting::Name(name) => self.name = printable(name).into_owned(),
            Setting::LinkBaud(baud) => self.baud = *baud,
            Setting::SampleRate(rate) => self.rate = *rate,
            // They are read on their own.
            Setting::Input(_) => {}
        }
    }
}

fn print(document: &SettingsDocument) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    print_row(&mut out, "name", &document.name)?;
    print_row(&mut out, "baud", &format!("{} bit/s", document.baud))?;
    let rate = plain(document.rate, 6);
    print_row(&mut out, "rate", &format!("{rate} samples/s"))?;
    if !document.inputs.is_empty() {
        writeln!(out)?;
        print_inputs(&mut out, &document.inputs)?;
    }
    Ok(())
}

fn print_inputs(out: &mut impl Write, inputs: &[InputRow]) -> std::io::Result<()> {
    let heads = [
        "input",
        "circuit",
        "serial",
        "certificate",
        "calibrated",
        "SI per count",
        "uncertainty",
        "gain",
    ];
    let dash = |text: &str| match text {
        "" => "-".to_owned(),
        text => text.to_owned(),
    };
    let rows: Vec<[String; 8]> = inputs
        .iter()
        .map(|input| {
            [
                input.input.to_string(),
                input.circuit.to_owned(),
                dash(&input.serial),
                dash(&input.certificate),
                dash(input.calibrated.as_deref().unwrap_or("")),
                format!("{:.5e}", input.per_count),
                match input.uncertainty {
                    0.0 => "-".to_owned(),
                    share => format!("{} %", plain(100.0 * share, 2)),
                },
                input.gain.to_string(),
            ]
        })
        .collect();
    let width = |c: usize| {
        let cells = rows.iter().map(|row| row[c].chars().count());
        cells.fold(heads[c].chars().count(), usize::max)
    };
    let widths: [usize; 8] = std::array::from_fn(width);
    let line = |cells: [&str; 8]| {
        let mut text = String::new();
        for (c, (cell, width)) in cells.iter().zip(widths).enumerate() {
            let gap = width - cell.chars().count();
            // Numbers stand to the right.
            let (before, after) = if matches!(c, 0 | 5 | 6 | 7) {
                (gap, 0)
            } else {
                (0, gap)
            };
            text += &format!("{:before$}{cell}{:after$}  ", "", "");
        }
        text.trim_end().to_owned()
    };
    let bold = Style::new().bold();
    writeln!(out, "{bold}{}{bold:#}", line(heads))?;
    for row in &rows {
        writeln!(out, "{}", line(row.each_ref().map(String::as_str)))?;
    }
    Ok(())
}

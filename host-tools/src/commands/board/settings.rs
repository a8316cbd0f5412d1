//! `massline board settings`: what the box keeps beyond a set-up.

use super::print_row;
use crate::cli::Verbosity;
use crate::commands::device::Device;
use crate::commands::{Failure, print_json, warn};
use crate::device::{Client, ClientError, Port};
use crate::format::plain;
use massline_core::wire::{Circuit, NAME_MAX, Reply, Request, Saved, Setting, SettingKey, Storage};
use serde::Serialize;

/// Show the box's settings, change them and keep them
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board settings --port /dev/ttyACM0\n  massline board settings --port /dev/ttyACM0 --set name=\"table 2\" --set rate=512 --save\n\nA changed baud holds from the next start on (`massline board restart`)."
)]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
    /// Change one: name (text), baud (link, bit/s), rate (converters, samples/s)
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse)]
    set: Vec<Change>,
    /// Go back to the settings the box was delivered with, before any --set
    #[arg(long)]
    reset: bool,
    /// Keep them when the box is switched off
    #[arg(long)]
    save: bool,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// A setting with its new value.
#[derive(Clone, Debug, PartialEq)]
enum Change {
    Name(String),
    Baud(u32),
    Rate(f64),
}

fn parse(text: &str) -> Result<Change, String> {
    let (key, value) = text
        .split_once('=')
        .ok_or("write KEY=VALUE, for example name=\"table 2\"")?;
    match key {
        "name" if value.len() > NAME_MAX => Err(format!(
            "the name has {} bytes, {NAME_MAX} fit",
            value.len()
        )),
        "name" => Ok(Change::Name(value.to_owned())),
        "baud" => value
            .parse()
            .map(Change::Baud)
            .map_err(|e| format!("{value}: {e}; write a number such as 921600")),
        "rate" => value
            .parse()
            .map(Change::Rate)
            .map_err(|e| format!("{value}: {e}; write a number such as 512")),
        other => Err(format!(
            "there is no setting {other}; there are name, baud, rate"
        )),
    }
}

impl Change {
    fn setting(&self) -> Setting<'_> {
        match self {
            Self::Name(name) => Setting::Name(name),
            Self::Baud(baud) => Setting::LinkBaud(*baud),
            Self::Rate(rate) => Setting::SampleRate(*rate),
        }
    }
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
    inputs: Vec<InputEntry>,
    saved: bool,
}

#[derive(Debug, Serialize)]
struct InputEntry {
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
    let (document, volatile) = arguments.device.talk(|client| {
        let info = client.hello()?;
        if arguments.reset {
            client.tell(&Request::ResetSettings)?;
        }
        for change in &arguments.set {
            client.tell(&Request::WriteSetting(change.setting()))?;
        }
        let saved = if arguments.save {
            Some(save(client)?)
        } else {
            None
        };
        let document = read(client, info.capacity.inputs)?;
        Ok((document, saved == Some(Storage::Volatile)))
    })?;
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

fn save<P: Port>(client: &mut Client<'_, P>) -> Result<Storage, ClientError> {
    client.ask(&Request::SaveSettings, |reply| match reply {
        Reply::Saved(Saved { storage }) => Some(*storage),
        _ => None,
    })
}

fn read<P: Port>(client: &mut Client<'_, P>, inputs: u8) -> Result<SettingsDocument, ClientError> {
    let mut document = SettingsDocument {
        schema: "massline/settings/1",
        ..SettingsDocument::default()
    };
    let own = [
        SettingKey::Name,
        SettingKey::LinkBaud,
        SettingKey::SampleRate,
    ];
    for key in own.into_iter().chain((0..inputs).map(SettingKey::Input)) {
        client.ask(&Request::ReadSetting(key), |reply| match reply {
            Reply::Setting(setting) => {
                document.take(setting);
                Some(())
            }
            _ => None,
        })?;
    }
    document.saved = !client.status()?.unsaved;
    Ok(document)
}

impl SettingsDocument {
    fn take(&mut self, setting: &Setting<'_>) {
        match setting {
            Setting::Name(name) => (*name).clone_into(&mut self.name),
            Setting::LinkBaud(baud) => self.baud = *baud,
            Setting::SampleRate(rate) => self.rate = *rate,
            Setting::Input(input) => self.inputs.push(InputEntry {
                input: u32::from(input.input) + 1,
                circuit: circuit(input.circuit),
                serial: input.serial.to_owned(),
                certificate: input.certificate.to_owned(),
                calibrated: input
                    .calibrated
                    .map(|d| format!("{:04}-{:02}-{:02}", d.year, d.month, d.day)),
                per_count: input.per_count,
                offset: input.offset,
                uncertainty: input.uncertainty,
                gain: input.gain,
                limits: input.limits,
            }),
        }
    }
}

const fn circuit(circuit: Circuit) -> &'static str {
    match circuit {
        Circuit::Unused => "unused",
        Circuit::Voltage => "voltage",
        Circuit::Bridge => "bridge",
        Circuit::Charge => "charge",
        Circuit::Iepe => "iepe",
        Circuit::Digital => "digital",
    }
}

fn print(document: &SettingsDocument) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    print_row(&mut out, "name", &document.name)?;
    print_row(&mut out, "baud", &format!("{} bit/s", document.baud))?;
    let rate = plain(document.rate, 6);
    print_row(&mut out, "rate", &format!("{rate} samples/s"))?;
    for input in document.inputs.iter().filter(|i| i.circuit != "unused") {
        let mut text = format!(
            "{}, gain {}, {:e} SI per count",
            input.circuit, input.gain, input.per_count
        );
        for (what, value) in [
            ("sensor", &input.serial),
            ("certificate", &input.certificate),
        ] {
            if !value.is_empty() {
                text += &format!(", {what} {value}");
            }
        }
        if let Some(day) = &input.calibrated {
            text += &format!(", calibrated {day}");
        }
        print_row(&mut out, &format!("input {}", input.input), &text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_read_and_wrong_ones_say_what_there_is() {
        assert_eq!(parse("name=a=b"), Ok(Change::Name("a=b".to_owned())));
        assert_eq!(parse("baud=115200"), Ok(Change::Baud(115_200)));
        assert_eq!(parse("rate=512.5"), Ok(Change::Rate(512.5)));
        for (text, word) in [
            ("name", "KEY=VALUE"),
            ("colour=red", "name, baud, rate"),
            ("baud=fast", "921600"),
            ("name=0123456789012345678901234567890123", "34 bytes"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}

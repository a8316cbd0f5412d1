//! `massline board info`: who the box is and how it fares.

use super::{print_heading, print_row};
use crate::commands::device::Device;
use crate::commands::{Failure, Verbosity, print_json, warn};
use crate::device::BoxInfo;
use crate::format::plain;
use crate::rig::Troubles;
use massline_core::masslines::Method;
use massline_firmware::wire::{
    ClockSource, FaultCounters, Pass, ResetReason, State, Status, Storage,
};
use serde::Serialize;

/// Say who the box is, what fits into it, what it is doing and what went wrong
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline board info --port /dev/ttyACM0\n  massline board info --emulator --json"
)]
pub struct Arguments {
    #[command(flatten)]
    device: Device,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if the box cannot be asked.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let (info, status) = arguments
        .device
        .talk_of_inputs(Troubles::default(), |client| {
            Ok((client.hello()?, client.status()?))
        })?;
    if arguments.json {
        return print_json(&InfoDocument::new(&info, &status));
    }
    print(&info, &status).map_err(|e| Failure::stdout(&e))?;
    warn(&notes(&info), verbosity);
    Ok(())
}

/// The document of a box, `massline/board/1`.
#[derive(Serialize)]
struct InfoDocument<'a> {
    schema: &'static str,
    firmware: &'a str,
    version: &'a str,
    build: &'a str,
    chip: &'a str,
    serial: String,
    clock: &'static str,
    clock_hz: u32,
    settings_kept: bool,
    started_by: &'static str,
    resets: u32,
    panic: Option<&'a str>,
    faults: FaultCounters,
    capacity: CapacityEntry,
    doing: &'static str,
    stored_runs: Vec<u32>,
}

#[derive(Serialize)]
struct CapacityEntry {
    channels: u8,
    inputs: u8,
    sensors: u8,
    runs: u8,
    lines: u16,
    block_length: u32,
    window: u8,
    methods: Vec<&'static str>,
}

impl<'a> InfoDocument<'a> {
    fn new(info: &'a BoxInfo, status: &Status) -> Self {
        let capacity = &info.capacity;
        Self {
            schema: "massline/board/1",
            firmware: &info.firmware,
            version: &info.version,
            build: &info.build,
            chip: &info.chip,
            serial: serial(info),
            clock: clock(info.clock),
            clock_hz: info.clock_hz,
            settings_kept: info.storage == Storage::Flash,
            started_by: reset(info.reset),
            resets: info.resets,
            panic: info.panic.as_deref(),
            faults: info.faults,
            capacity: CapacityEntry {
                channels: capacity.channels,
                inputs: capacity.inputs,
                sensors: capacity.sensors,
                runs: capacity.runs,
                lines: capacity.lines,
                block_length: capacity.block_length,
                window: capacity.window,
                methods: methods(info),
            },
            doing: doing(status.state),
            stored_runs: stored(status),
        }
    }
}

fn serial(info: &BoxInfo) -> String {
    info.serial
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

fn methods(info: &BoxInfo) -> Vec<&'static str> {
    let has = |m: &Method| info.capacity.methods.contains(*m);
    Method::ALL
        .iter()
        .filter(|m| has(m))
        .map(|m| m.name())
        .collect()
}

/// Numbers of the stored runs, from one as in a setup.
fn stored(status: &Status) -> Vec<u32> {
    (0..u32::BITS)
        .filter(|k| status.stored >> k & 1 == 1)
        .map(|k| k + 1)
        .collect()
}

const fn clock(source: ClockSource) -> &'static str {
    match source {
        ClockSource::CrystalPll => "crystal",
        ClockSource::InternalPll => "internal oscillator, multiplied",
        ClockSource::Internal => "internal oscillator",
    }
}

const fn reset(reason: ResetReason) -> &'static str {
    match reason {
        ResetReason::PowerOn => "power switch",
        ResetReason::BrownOut => "sagging supply",
        ResetReason::Pin => "reset pin",
        ResetReason::Watchdog => "watchdog",
        ResetReason::Panic => "panic",
        ResetReason::HardFault => "processor fault",
        ResetReason::StackOverflow => "stack overflow",
        ResetReason::Request => "request",
        ResetReason::Other => "something else",
    }
}

const fn doing(state: State) -> &'static str {
    match state {
        State::Empty => "no set-up",
        State::SettingUp => "taking a set-up",
        State::Ready => "ready",
        State::Running => "running",
    }
}

/// Each kind of fault with its count.
const fn counts(f: &FaultCounters) -> [(&'static str, u32); 11] {
    [
        ("watchdog", f.watchdog),
        ("sagging supply", f.brown_out),
        ("panic", f.panic),
        ("processor fault", f.hard_fault),
        ("stack overflow", f.stack_overflow),
        ("converter checksum", f.converter_checksum),
        ("converter too slow", f.converter_missed),
        ("converter reset", f.converter_reset),
        ("converters out of step", f.out_of_step),
        ("sample missed", f.overrun),
        ("settings", f.storage),
    ]
}

fn print(info: &BoxInfo, status: &Status) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    print_heading(&mut out, info)?;
    print_row(&mut out, "serial number", &serial(info))?;
    let megahertz = plain(f64::from(info.clock_hz) / 1e6, 4);
    print_row(
        &mut out,
        "clock",
        &format!("{megahertz} MHz, {}", clock(info.clock)),
    )?;
    let resets = match info.resets {
        0 => String::new(),
        1 => ", one reset since it was switched on".to_owned(),
        n => format!(", {n} resets since it was switched on"),
    };
    print_row(
        &mut out,
        "started by",
        &format!("{}{resets}", reset(info.reset)),
    )?;
    let kept = match info.storage {
        Storage::Flash => "in flash",
        Storage::Volatile => "until it is switched off",
    };
    print_row(&mut out, "settings kept", kept)?;
    let c = &info.capacity;
    print_row(
        &mut out,
        "fits",
        &format!(
            "{} sensors, {} runs of {} lines, blocks of {} samples, {} channels a sample",
            c.sensors, c.runs, c.lines, c.block_length, c.channels
        ),
    )?;
    print_row(&mut out, "own inputs", &c.inputs.to_string())?;
    print_row(&mut out, "methods", &methods(info).join(", "))?;
    print_row(&mut out, "doing", &activity(status))?;
    let faults = counts(&info.faults).into_iter().filter(|(_, n)| *n > 0);
    let faults: Vec<String> = faults.map(|(what, n)| format!("{what} {n}")).collect();
    let faults = if faults.is_empty() {
        "none".to_owned()
    } else {
        faults.join(", ")
    };
    print_row(&mut out, "faults", &faults)
}

fn activity(status: &Status) -> String {
    let mut text = match &status.running {
        Some(running) => {
            let pass = match running.pass {
                Pass::Survey => "surveying",
                Pass::Measure => "measuring",
            };
            format!(
                "{pass} run {}, {} blocks, {} samples",
                u32::from(running.run) + 1,
                running.blocks,
                running.next
            )
        }
        None => doing(status.state).to_owned(),
    };
    let stored: Vec<String> = stored(status).iter().map(ToString::to_string).collect();
    if !stored.is_empty() {
        text += &format!("; runs stored: {}", stored.join(", "));
    }
    if status.unsaved {
        text += "; settings not saved";
    }
    text
}

/// Notes to the user, each with advice.
fn notes(info: &BoxInfo) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(panic) = &info.panic {
        notes.push(format!(
            "the firmware has failed: {panic}; report this text with the build above, then `massline board forget` clears it"
        ));
    }
    if info.chip.starts_with("STM32") && info.clock != ClockSource::CrystalPll {
        notes.push(
            "the crystal does not start: the box works by the chip's own oscillator, which is good to 1 %; the converters have a clock of their own. Check the crystal (an emulator has none)"
                .to_owned(),
        );
    }
    if info.version != env!("CARGO_PKG_VERSION") {
        notes.push(format!(
            "this program is {}: a replay may differ; put its firmware on the box by `massline flash`",
            env!("CARGO_PKG_VERSION")
        ));
    }
    notes
}

//! `massline flash`: the firmware onto the box, through a debug probe.

use super::Failure;
use crate::commands::Verbosity;
use crate::device::firmware;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program that talks to debug probes.
const PROBE_RS: &str = "probe-rs";

/// Put the firmware on the box, through its debug probe
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline flash\n  massline flash --elf massline-firmware --probe 0483:374b\n\nprobe-rs does the work: `cargo install probe-rs-tools --locked` installs it, `probe-rs list`\nshows the probes. ST-LINK, J-Link and CMSIS-DAP probes are known to it."
)]
pub struct Arguments {
    /// The firmware; the one that was built last if absent
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
    /// The probe, if there are several: VID:PID or VID:PID:SERIAL
    #[arg(long, value_name = "PROBE")]
    probe: Option<String>,
    /// The chip, as probe-rs calls it
    #[arg(long, value_name = "NAME", default_value = "STM32F405RGTx")]
    chip: String,
    /// Show what would be run, and run nothing
    #[arg(long)]
    dry_run: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if there is no firmware, no probe-rs, or if that fails.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let elf = firmware::find(arguments.elf.as_deref()).map_err(Failure::input)?;
    for step in steps(arguments, &elf, verbosity) {
        if arguments.dry_run {
            super::print_line(&line(&step))?;
            continue;
        }
        let status = Command::new(PROBE_RS).args(&step).status();
        let status = status.map_err(|error| not_started(&error))?;
        if !status.success() {
            return Err(Failure::input(format!(
                "`{}` failed, see above; check that the probe is plugged in (`probe-rs list`), that the board has power, and that no other program holds the probe",
                line(&step)
            )));
        }
    }
    if !arguments.dry_run && !verbosity.quiet {
        eprintln!(
            "{} is on the box; next: massline board info --port DEV",
            elf.display()
        );
    }
    Ok(())
}

/// Calls of probe-rs in turn: to write and compare, then to start the firmware.
fn steps(arguments: &Arguments, elf: &Path, verbosity: Verbosity) -> [Vec<OsString>; 2] {
    let mut common = vec!["--chip".into(), OsString::from(&arguments.chip)];
    if let Some(probe) = &arguments.probe {
        common.extend(["--probe".into(), OsString::from(probe)]);
    }
    let mut download = vec![OsString::from("download")];
    download.extend(common.iter().cloned());
    download.push("--verify".into());
    if verbosity.quiet {
        download.push("--disable-progressbars".into());
    }
    download.push(elf.into());
    let mut reset = vec![OsString::from("reset")];
    reset.extend(common);
    [download, reset]
}

/// A step as it is typed.
fn line(step: &[OsString]) -> String {
    let words = step.iter().map(|word| word.to_string_lossy());
    std::iter::once(PROBE_RS.into())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

fn not_started(error: &std::io::Error) -> Failure {
    Failure::input(if error.kind() == ErrorKind::NotFound {
        format!(
            "{PROBE_RS} is not installed; `cargo install probe-rs-tools --locked` installs it, then run this again"
        )
    } else {
        format!("{PROBE_RS} cannot be started: {error}")
    })
}

//! An emulator of the chip: the one in the environment, the machine's own, or Debian's, unpacked.

use std::ffi::{OsStr, OsString};
use std::process::Command;

use crate::emulator::{self, DEFAULT_PROGRAM};

use super::packages::Bundle;
use super::process::{self, StepError};

/// Debian's QEMU, which finds its data relative to its program.
const DEBIAN: Bundle = Bundle {
    name: "qemu",
    packages: &[DEFAULT_PROGRAM],
    source: "qemu",
    programs: &[DEFAULT_PROGRAM],
};

/// An emulator.
#[derive(Debug)]
pub struct Qemu {
    /// The program to run.
    pub program: OsString,
    /// Origin and version, for the report.
    pub note: String,
}

/// Finds an emulator, or fetches one.
///
/// # Errors
///
/// [`StepError`] with all attempts.
pub fn provide() -> Result<Qemu, StepError> {
    let named = emulator::program();
    let error = match version(&named) {
        Ok(note) => {
            return Ok(Qemu {
                program: named,
                note,
            });
        }
        // An emulator from the environment is not replaced.
        Err(error) if named != DEFAULT_PROGRAM => return Err(error),
        Err(error) => error,
    };
    let missing = |how: &str| StepError::Missing {
        what: "an emulator of the chip",
        tried: format!("{error}\n{how}"),
        remedy: "let one of these succeed: QEMU for Arm installed by hand (Debian: as root \
                 `apt-get install qemu-system-arm`); one named in MASSLINE_QEMU; or, on a Debian \
                 with a network, this command again, which unpacks it without root",
    };
    let programs = DEBIAN
        .provide()
        .map_err(|error| missing(&error.to_string()))?;
    let program = programs.join(DEFAULT_PROGRAM).into_os_string();
    let note = format!("{}, unpacked: {}", version(&program)?, program.display());
    Ok(Qemu { program, note })
}

/// First line of an emulator's version.
fn version(program: &OsStr) -> Result<String, StepError> {
    let answer = process::answer(Command::new(program).arg("--version"))?;
    Ok(answer.lines().next().unwrap_or_default().to_owned())
}

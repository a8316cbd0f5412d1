//! Names that `cargo xtask test` shares with the emulator of `massline::device`.
//!
//! This crate is built without the host tool, so that it is ready within seconds. A test compares
//! the names.

use std::env;
use std::ffi::OsString;

/// Environment variable with the path of the firmware's ELF.
pub const FIRMWARE_ELF: &str = "MASSLINE_FIRMWARE_ELF";

/// Environment variable with the name of a QEMU instead of [`DEFAULT_PROGRAM`].
pub const QEMU: &str = "MASSLINE_QEMU";

/// Default name of QEMU; Debian's package of it has the same name.
pub const DEFAULT_PROGRAM: &str = "qemu-system-arm";

/// Name of the emulator: the value of [`QEMU`], or else [`DEFAULT_PROGRAM`].
#[must_use]
pub fn program() -> OsString {
    env::var_os(QEMU)
        .filter(|program| !program.is_empty())
        .unwrap_or_else(|| DEFAULT_PROGRAM.into())
}

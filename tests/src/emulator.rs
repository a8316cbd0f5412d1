//! What `cargo xtask test` and the emulator of `massline::device` agree on.
//!
//! Only the names: this program is built without the host tool, so that it is there within
//! seconds. A test compares them.

use std::env;
use std::ffi::OsString;

/// Environment variable that tells tests where the firmware's ELF is.
pub const FIRMWARE_ELF: &str = "MASSLINE_FIRMWARE_ELF";

/// Environment variable that names another QEMU than [`DEFAULT_PROGRAM`].
pub const QEMU: &str = "MASSLINE_QEMU";

/// The QEMU to use unless told otherwise; Debian's package of it has the same name.
pub const DEFAULT_PROGRAM: &str = "qemu-system-arm";

/// The emulator to use: what [`QEMU`] names, else [`DEFAULT_PROGRAM`].
#[must_use]
pub fn program() -> OsString {
    env::var_os(QEMU)
        .filter(|program| !program.is_empty())
        .unwrap_or_else(|| DEFAULT_PROGRAM.into())
}

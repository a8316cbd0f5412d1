//! Shared parts of the end-to-end tests, and the command that runs all tests of the project.
//!
//! * [`emulator`]: names by which tests find the emulator and the firmware.
//! * [`readme`]: tables in READMEs that tests write and compare.
//! * [`xtask`]: `cargo xtask test`, which runs all checks of a change on a machine that may have
//!   only cargo.

#![forbid(unsafe_code)]

pub mod emulator;
pub mod readme;
pub mod xtask;

use std::path::PathBuf;

/// A file of the fixtures folder.
#[must_use]
pub fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("fixtures")
        .join(name)
}

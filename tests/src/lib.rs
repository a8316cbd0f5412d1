//! What the end-to-end tests share, and the command that runs all tests of the project.
//!
//! * [`emulator`] says how the emulator and the firmware are named to tests.
//! * [`readme`]: tables in the firmware's README that tests write and compare.
//! * [`xtask`] is `cargo xtask test`: everything a change has to pass, on a machine that may have
//!   nothing but cargo.

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

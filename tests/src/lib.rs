//! What the end-to-end tests share: the firmware in an emulator, and the command that runs all
//! tests of the project.
//!
//! * [`emulator`] boots the ELF that is flashed and talks to it over its serial link.
//! * [`xtask`] is `cargo xtask test`: everything a change has to pass, on a machine that may have
//!   nothing but cargo.

#![forbid(unsafe_code)]

pub mod emulator;
pub mod xtask;

use std::path::PathBuf;

/// A file of the fixtures folder.
#[must_use]
pub fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("fixtures")
        .join(name)
}

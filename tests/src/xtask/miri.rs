//! `cargo xtask miri`: core's tests in an interpreter that sees what a processor does not.
//!
//! Core has no `unsafe`; what the interpreter can find is in the crates that it rests on, and in
//! what they make of core's calls.

use std::path::Path;
use std::process::Command;

use super::process::{self, StepError};

/// Tests of core that the interpreter takes minutes for, not days: those that compute no spectra
/// of whole recordings and try no inputs by the thousand.
const TESTS: [&str; 9] = [
    "wire::",
    "calibration::",
    "rigid_body::",
    "geometry::",
    "algebra::",
    "identify::",
    "weighting::",
    "spectra::window",
    "spectra::decimate",
];

/// Runs the tests, or says what is missing.
///
/// # Errors
///
/// [`StepError`].
pub fn run(root: &Path) -> Result<String, StepError> {
    let nightly = || {
        let mut command = Command::new("cargo");
        // What this very program was started by is another toolchain's.
        command
            .current_dir(root)
            .env_remove("RUSTUP_TOOLCHAIN")
            .env_remove("CARGO")
            .env_remove("LD_LIBRARY_PATH")
            .arg("+nightly");
        command
    };
    if process::answer(nightly().args(["miri", "--version"])).is_err() {
        let install = process::run(Command::new("rustup").args([
            "toolchain",
            "install",
            "nightly",
            "--profile=minimal",
            "--component=miri,rust-src",
        ]));
        if let Err(error) = install {
            return Err(StepError::Missing {
                what: "Miri, a component of the nightly toolchain",
                tried: error.to_string(),
                remedy: "run `rustup toolchain install nightly --component miri,rust-src` where \
                         its downloads are let through",
            });
        }
    }
    let mut test = nightly();
    test.args(["miri", "test", "--package", "massline-core", "--lib"])
        .args(["--target-dir", "target/miri", "--"])
        .args(TESTS)
        // Properties are tried on some inputs rather than hundreds; no file is written.
        .env("PROPTEST_CASES", "4")
        .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
        .env("MIRIFLAGS", "-Zmiri-disable-isolation");
    process::run(&mut test)
}

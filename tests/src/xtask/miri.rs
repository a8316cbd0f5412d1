//! `cargo xtask miri`: core's tests in an interpreter that detects undefined behaviour.
//!
//! Core has no `unsafe`; undefined behaviour could only be in the crates that it depends on, as
//! core calls them.

use std::path::Path;
use std::process::Command;

use super::process::{self, StepError};

/// Tests of core that take the interpreter minutes: those without spectra of whole recordings and
/// without thousands of inputs.
const TESTS: [&str; 7] = [
    "rigid_body::",
    "geometry::",
    "algebra::",
    "identify::",
    "weighting::",
    "spectra::window",
    "spectra::decimate",
];

/// Runs the tests; a missing component is an error.
///
/// # Errors
///
/// [`StepError`].
pub fn run(root: &Path) -> Result<String, StepError> {
    let nightly = || {
        let mut command = Command::new("cargo");
        // This program was started by another toolchain, whose variables must not be passed on.
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
        // Properties are tested on a few inputs rather than hundreds; no file is written.
        .env("PROPTEST_CASES", "4")
        .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
        .env("MIRIFLAGS", "-Zmiri-disable-isolation");
    process::run(&mut test)
}

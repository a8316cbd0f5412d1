//! `cargo xtask mutants`: changes core in one place at a time and asks whether a test notices.
//!
//! Which changes are not asked about, and why, stands in `.cargo/mutants.toml`.

use std::path::Path;
use std::process::Command;

use super::process::{self, StepError};

/// Seconds that the tests may take with a change in place: they take some twelve without, and
/// twenty on a machine that is busy.
const TIMEOUT: u32 = 120;
/// Changes that are tried at the same time.
const JOBS: u32 = 2;

/// Options of the command.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Order {
    /// One of several parts of equal size: `0/8` to `7/8`. Each is a sample of all changes, one of
    /// so many in turn.
    pub shard: Option<String>,
    /// Files to change; none means all of core.
    pub files: Vec<String>,
    /// `true` to show the changes and run nothing.
    pub list: bool,
}

/// Says of each change whether a test has noticed it. What `cargo mutants` says goes to the
/// terminal as it comes; its notes are in `target/mutants`.
///
/// # Errors
///
/// [`StepError`] if the tool cannot be had or a change was missed.
pub fn run(root: &Path, cargo: &dyn Fn() -> Command, order: &Order) -> Result<(), StepError> {
    let tools = root.join("target").join("tools");
    let program = tools.join("bin").join("cargo-mutants");
    if process::answer(Command::new(&program).args(["mutants", "--version"])).is_err() {
        eprintln!("installing cargo-mutants into {}", tools.display());
        let mut install = cargo();
        install.args(["install", "--locked", "cargo-mutants", "--root"]);
        process::run(install.arg(&tools)).map_err(|error| StepError::Missing {
            what: "cargo-mutants",
            tried: error.to_string(),
            remedy: "install it by hand into target/tools: \
                     `cargo install --locked cargo-mutants --root target/tools`",
        })?;
    }
    let mut mutants = Command::new(&program);
    mutants
        .current_dir(root)
        .args(["mutants", "--package", "massline-core", "--no-shuffle"])
        .args(["--sharding", "round-robin"])
        // Core and its tests are built anew for each change: sooner without what a debugger wants.
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .args(["--output", "target/mutants"]);
    for file in &order.files {
        mutants.args(["--file", file]);
    }
    if let Some(shard) = &order.shard {
        mutants.args(["--shard", shard]);
    }
    if order.list {
        mutants.arg("--list");
    } else {
        mutants
            .arg(format!("--timeout={TIMEOUT}"))
            .arg(format!("--jobs={JOBS}"));
    }
    process::show(&mut mutants)
}

//! Programs of others in a virtual environment of Python, in cargo's target folder.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::packages;
use super::process::{self, StepError};
use super::report::Ending;

/// The packages, with exact versions.
const REQUIREMENTS: &str = "tests/fixtures/readers/requirements.txt";
/// The checks.
const CHECKS: &str = "tests/fixtures/readers/check.py";

/// Runs the checks on a program, in a scratch folder below cargo's target folder.
///
/// # Errors
///
/// [`StepError`] of a check that failed, or of a file that cannot be written.
pub fn check(root: &Path, program: &Path) -> Result<Ending, StepError> {
    let target = packages::target().unwrap_or_else(|| root.join("target"));
    let python = match provide(root, REQUIREMENTS, &target.join("readers"))? {
        Ok(python) => python,
        Err(reason) => return Ok(Ending::Skipped(format!("NOT checked: {reason}"))),
    };
    let scratch = target.join("readers-scratch");
    let mut checks = Command::new(python);
    checks
        .current_dir(root)
        .arg(root.join(CHECKS))
        .arg(program)
        .arg(root.join("tests/fixtures"))
        .arg(root.join("host-tools/models"))
        .arg(&scratch);
    let output = process::run(&mut checks)?;
    // Files of a failure stay to be looked at; those of a success are in nobody's way.
    let _ = fs::remove_dir_all(&scratch);
    Ok(Ending::Passed(format!("{} checks", output.lines().count())))
}

/// The environment's Python with the packages of a list in it, or the reason why they cannot be had here.
///
/// # Errors
///
/// [`StepError`] of a file that cannot be read or written.
pub(super) fn provide(
    root: &Path,
    requirements: &str,
    folder: &Path,
) -> Result<Result<PathBuf, String>, StepError> {
    let list = root.join(requirements);
    let wanted = fs::read_to_string(&list).map_err(|error| StepError::file(&list, error))?;
    let programs = if cfg!(windows) { "Scripts" } else { "bin" };
    let python = folder.join(programs).join("python");
    // Written when everything is there: an environment that was cut is made again.
    let mark = folder.join("installed.txt");
    let runs = || process::run(Command::new(&python).arg("--version")).is_ok();
    if fs::read_to_string(&mark).is_ok_and(|installed| installed == wanted) && runs() {
        return Ok(Ok(python));
    }
    let makes = |name: &str| {
        let mut venv = Command::new(name);
        venv.args(["-m", "venv", "--clear"]).arg(folder);
        process::run(&mut venv).is_ok()
    };
    if !["python3", "python"].into_iter().any(makes) {
        let reason = "no Python with the module venv (Debian: python3-venv)";
        return Ok(Err(reason.to_owned()));
    }
    let mut pip = Command::new(&python);
    pip.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        // Python compiles what it imports, a small part of the packages.
        "--no-compile",
        "--disable-pip-version-check",
    ])
    .args(["--retries", "1", "--requirement"])
    .arg(&list);
    if let Err(error) = process::run(&mut pip) {
        let text = error.to_string();
        let mut lines = text.lines().rev();
        let reason = lines.find(|line| line.starts_with("ERROR"));
        let reason = reason.unwrap_or("pip does not say why");
        return Ok(Err(format!("pip cannot install the packages: {reason}")));
    }
    fs::write(&mark, wanted).map_err(|error| StepError::file(&mark, error))?;
    Ok(Ok(python))
}

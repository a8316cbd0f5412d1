//! Debian's packages, for what cargo cannot bring.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::process::Command;

use super::process::{self, StepError};

/// Whether the machine has Debian's package tool.
pub fn available() -> bool {
    Path::new("/usr/bin/apt-get").exists()
}

/// Installs packages without asking, and without removing any.
///
/// # Errors
///
/// [`StepError::Exit`] with all that was said.
pub fn install(packages: &[&str]) -> Result<(), StepError> {
    let mut install = apt_get("install");
    // A package that conflicts with what somebody chose to have is no reason to take that away.
    install.args(["--yes", "--no-install-recommends", "--no-remove"]);
    install.args(packages);
    if process::run(&mut install).is_ok() {
        return Ok(());
    }
    // A fresh machine has no package lists, an old one has lists of packages that are gone.
    process::run(&mut apt_get("update"))?;
    process::run(&mut install).map(drop)
}

fn apt_get(action: &str) -> Command {
    // Named on the command line, since sudo keeps no environment.
    const PROGRAM: [&str; 3] = ["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"];
    let mut command = if is_root() {
        Command::new(PROGRAM[0])
    } else {
        let mut sudo = Command::new("sudo");
        // It asks on the terminal itself; where there is none, it must fail, not wait.
        if !io::stdin().is_terminal() {
            sudo.arg("--non-interactive");
        }
        sudo.arg(PROGRAM[0]);
        sudo
    };
    command
        .args(&PROGRAM[1..])
        .args(["--quiet", "-o", "DPkg::Lock::Timeout=300"])
        .arg(action);
    command
}

fn is_root() -> bool {
    process::answer(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

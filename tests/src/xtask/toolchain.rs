//! A compiler for the chip, and the tools around it.
//!
//! # Design
//!
//! rustup has a compiled `core` for the chip, which is used if it can be fetched. Some networks
//! allow cargo its registry but not rustup's downloads; there Debian's own compiler, whose packages
//! include the standard library's source, builds `core` itself. That option is unstable; a stable
//! compiler accepts it under `RUSTC_BOOTSTRAP=1`. A newer compiler than the minimum is no problem.
//!
//! Debian's compiler is used where it is installed, and is otherwise unpacked into the target
//! folder: see [`packages`](super::packages). It has no linker for bare metal. The linker of
//! rustup's own toolchain is used, even if rustup cannot download; without rustup, Debian's `lld`.
//!
//! `rust-toolchain.toml` does not request the chip's target, since a refused download would then
//! stop the host's tools, too.

use std::env;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::packages::Bundle;
use super::process::{self, StepError};

/// Target of the firmware.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Environment variable that makes [`provide`] act as if rustup refused every download, to test the
/// other way where rustup works.
pub const NO_RUSTUP: &str = "MASSLINE_XTASK_NO_RUSTUP";

/// Folder of Debian's programs where they are installed.
const INSTALLED: &str = "/usr/bin";

/// Debian's toolchain, with the tools around it.
const DEBIAN: Bundle = Bundle {
    name: "rust",
    packages: &[
        "rustc-web",
        "cargo-web",
        "rust-web-src",
        "rustfmt-web",
        "rust-web-clippy",
    ],
    source: "rustc-web",
    programs: &[
        "rustc",
        "cargo",
        "rustdoc",
        "rustfmt",
        "cargo-fmt",
        "cargo-clippy",
    ],
};

const LLD: &str = "ld.lld";

/// Debian's linker.
const LINKER: Bundle = Bundle {
    name: "lld",
    packages: &["lld"],
    source: "llvm-defaults",
    programs: &[LLD],
};

/// A compiler that can make programs for the chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Toolchain {
    /// The active compiler, which has `core` for the chip.
    Active {
        /// Cargo of this toolchain.
        cargo: OsString,
    },
    /// Debian's compiler, which has to build `core` first.
    Debian {
        /// The folder of its programs.
        programs: PathBuf,
        /// A linker for the chip.
        linker: PathBuf,
    },
}

impl Toolchain {
    /// This toolchain's cargo.
    pub fn cargo(&self) -> Command {
        match self {
            Self::Active { cargo } => Command::new(cargo),
            Self::Debian { programs, linker } => {
                let mut command = debian_command(programs, "cargo");
                command.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", linker);
                command
            }
        }
    }

    /// Arguments of a cargo command for the chip, separated by spaces.
    pub fn arguments(&self) -> String {
        let build_core = match self {
            Self::Active { .. } => "",
            Self::Debian { .. } => " -Zbuild-std=core",
        };
        format!("--target {TARGET}{build_core}")
    }
}

/// A program of Debian's toolchain in this folder, with the variables to use only that toolchain.
fn debian_command(programs: &Path, program: &str) -> Command {
    let mut command = Command::new(programs.join(program));
    command
        .env("CARGO", programs.join("cargo"))
        .env("RUSTC", programs.join("rustc"))
        .env("RUSTDOC", programs.join("rustdoc"))
        .env("RUSTFMT", programs.join("rustfmt"))
        .env("RUSTC_BOOTSTRAP", "1")
        // Set by the other toolchain's cargo for its own programs.
        .env_remove("RUSTUP_TOOLCHAIN")
        .env_remove("LD_LIBRARY_PATH");
    command
}

/// A toolchain, with its origin.
#[derive(Debug)]
pub struct Provided {
    /// The toolchain.
    pub toolchain: Toolchain,
    /// Origin and version, for the report.
    pub note: String,
}

/// Finds a compiler for the chip, or fetches one.
///
/// # Errors
///
/// [`StepError`] with all attempts.
pub fn provide(cargo: &OsStr) -> Result<Provided, StepError> {
    let active = |how: &str| Provided {
        toolchain: Toolchain::Active {
            cargo: cargo.to_owned(),
        },
        note: format!("rustc {}, {TARGET} {how}", version("rustc")),
    };
    let mut tried = String::new();
    if rustup_may_be_used() {
        if has_target() {
            return Ok(active("is there"));
        }
        // After a refusal of rustup, a second run must not need a network.
        if let Some(programs) = DEBIAN.unpacked() {
            return debian(programs);
        }
        match rustup(&["target", "add", TARGET]) {
            Ok(()) if has_target() => return Ok(active("installed by rustup")),
            Ok(()) => tried += "rustup did not install it for the active toolchain\n",
            Err(error) => tried += &format!("{error}\n"),
        }
    } else {
        tried += &format!("rustup is out, {NO_RUSTUP} is set\n");
    }
    let installed = PathBuf::from(INSTALLED);
    if has_sources(&installed) {
        return debian(installed);
    }
    let missing = |how: &str| StepError::Missing {
        what: "a compiler for the chip",
        tried: format!("{tried}{how}"),
        remedy: "let one of these succeed: `rustup target add thumbv7em-none-eabihf`; as root \
                 `apt-get install rustc-web cargo-web rust-web-src`; or, on a Debian with a \
                 network, this command again, which unpacks them without root",
    };
    let programs = DEBIAN
        .provide()
        .map_err(|error| missing(&error.to_string()))?;
    if !has_sources(&programs) {
        return Err(missing(
            "Debian's packages did not bring the source of `core`",
        ));
    }
    debian(programs)
}

/// Debian's compiler in this folder, and a linker for it.
fn debian(programs: PathBuf) -> Result<Provided, StepError> {
    let linker = linker(&programs)?;
    Ok(Provided {
        note: format!(
            "Debian's rustc {}{} builds core for {TARGET}, {} links",
            version(programs.join("rustc")),
            if programs == Path::new(INSTALLED) {
                ""
            } else {
                ", unpacked,"
            },
            linker.file_name().unwrap_or_default().display()
        ),
        toolchain: Toolchain::Debian { programs, linker },
    })
}

/// A linker for bare metal: a toolchain's own, or Debian's.
fn linker(programs: &Path) -> Result<PathBuf, StepError> {
    let own = [PathBuf::from("rustc"), programs.join("rustc")]
        .into_iter()
        .filter_map(sysroot)
        .find_map(|sysroot| own_linker(&sysroot));
    if let Some(linker) = own {
        return Ok(linker);
    }
    let installed = Path::new(INSTALLED).join(LLD);
    if installed.exists() {
        return Ok(installed);
    }
    Ok(LINKER.provide()?.join(LLD))
}

/// The linker among the host's libraries of a toolchain.
fn own_linker(sysroot: &Path) -> Option<PathBuf> {
    fs::read_dir(sysroot.join("lib/rustlib"))
        .ok()?
        .filter_map(Result::ok)
        .map(|host| host.path().join("bin/rust-lld"))
        .find(|linker| linker.exists())
}

/// `true` if this folder has a cargo, and a compiler with the source of `core`.
fn has_sources(programs: &Path) -> bool {
    programs.join("cargo").exists()
        && sysroot(programs.join("rustc")).is_some_and(|sysroot| {
            sysroot
                .join("lib/rustlib/src/rust/library/core/Cargo.toml")
                .exists()
        })
}

fn sysroot(rustc: PathBuf) -> Option<PathBuf> {
    let path = process::answer(Command::new(rustc).args(["--print", "sysroot"])).ok()?;
    Some(PathBuf::from(path.trim()))
}

/// `true` if the active compiler has a compiled `core` for the chip.
fn has_target() -> bool {
    // The directory's name is printed whether it exists or not.
    let arguments = ["--print", "target-libdir", "--target", TARGET];
    process::answer(Command::new("rustc").args(arguments))
        .ok()
        .and_then(|path| fs::read_dir(path.trim()).ok())
        .is_some_and(|mut entries| entries.next().is_some())
}

fn version(rustc: impl AsRef<OsStr>) -> String {
    let version = process::answer(Command::new(rustc).arg("--version")).unwrap_or_default();
    version
        .split_whitespace()
        .nth(1)
        .unwrap_or("of unknown version")
        .to_owned()
}

fn rustup_may_be_used() -> bool {
    env::var_os(NO_RUSTUP).is_none_or(|value| value.is_empty() || value == "0")
}

/// Installs a component of the active toolchain by rustup.
fn rustup(arguments: &[&str]) -> Result<(), StepError> {
    process::run(Command::new("rustup").args(arguments)).map(drop)
}

/// A component of a toolchain that a fresh machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tool {
    subcommand: &'static str,
    component: &'static str,
}

impl Tool {
    /// Cargo's command for it, from Debian's programs in this folder.
    ///
    /// Cargo itself would look among rustup's programs first and find the tool of a compiler that
    /// has no `core` for the chip.
    fn debian(self, programs: &Path) -> Command {
        let mut command = debian_command(programs, &format!("cargo-{}", self.subcommand));
        command.arg(self.subcommand);
        command
    }
}

/// The formatter.
pub const RUSTFMT: Tool = Tool {
    subcommand: "fmt",
    component: "rustfmt",
};

/// The linter.
pub const CLIPPY: Tool = Tool {
    subcommand: "clippy",
    component: "clippy",
};

/// Finds or fetches a tool of a toolchain, and returns cargo's command for it, or the reason why
/// that is not possible.
pub fn provide_tool(toolchain: &Toolchain, tool: Tool) -> Result<Command, String> {
    let works = |command: Command| {
        let mut question = Command::new(command.get_program());
        question.args(command.get_args()).arg("--version");
        process::answer(&mut question).is_ok().then_some(command)
    };
    let active = |cargo: &OsStr| {
        let mut command = Command::new(cargo);
        command.arg(tool.subcommand);
        works(command)
    };
    let found = match toolchain {
        Toolchain::Active { cargo } => active(cargo),
        Toolchain::Debian { programs, .. } => works(tool.debian(programs)),
    };
    if let Some(command) = found {
        return Ok(command);
    }
    match toolchain {
        // Another toolchain's tool may report errors that this one's accepts.
        Toolchain::Active { cargo } if !is_debians(cargo) => {
            if !rustup_may_be_used() {
                return Err(format!("no {}, and rustup is out", tool.component));
            }
            rustup(&["component", "add", tool.component])
                .ok()
                .and_then(|()| active(cargo))
        }
        _ => DEBIAN
            .provide()
            .ok()
            .and_then(|programs| works(tool.debian(&programs))),
    }
    .ok_or_else(|| format!("no {} here, and it could not be had", tool.component))
}

/// `true` if this is the cargo that Debian has installed.
fn is_debians(cargo: &OsStr) -> bool {
    Path::new(cargo).parent() == Some(Path::new(INSTALLED))
}

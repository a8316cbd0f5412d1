//! A compiler for the chip, and the tools around it.
//!
//! # Design
//!
//! rustup brings a ready-made `core` for the chip, and that is what is used where it can be had.
//! Some networks let cargo through to its registry but refuse rustup's downloads; there Debian's
//! own compiler, which comes with the standard library's source, builds `core` itself. The switch
//! for that is an unstable one, which a stable compiler accepts under `RUSTC_BOOTSTRAP=1`; a
//! newer compiler than the minimum is fine, so this costs nothing but the beauty.
//!
//! Debian has no linker for bare metal in those packages. rustup's own toolchain does, even when
//! it must not download anything; without a rustup, Debian's `lld` is taken.
//!
//! `rust-toolchain.toml` would be the usual place to ask for the chip's target. It is not, as
//! then a refused download would stop the host's tools, too.

use std::env;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::packages;
use super::process::{self, StepError};

/// What the firmware is compiled for.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Environment variable that makes [`provide`] act as if rustup refused everything, so that the
/// other way can be tried where rustup works.
pub const NO_RUSTUP: &str = "MASSLINE_XTASK_NO_RUSTUP";

const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_RUSTDOC: &str = "/usr/bin/rustdoc";
const DEBIAN_PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];

/// A compiler that can make programs for the chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Toolchain {
    /// The one that runs anyway; it has `core` for the chip.
    Active {
        /// Its cargo.
        cargo: OsString,
    },
    /// Debian's, which has to build `core` first.
    Debian {
        /// A linker for the chip.
        linker: PathBuf,
    },
}

impl Toolchain {
    /// This toolchain's cargo.
    pub fn cargo(&self) -> Command {
        match self {
            Self::Active { cargo } => Command::new(cargo),
            Self::Debian { linker } => debian_command(DEBIAN_CARGO, linker),
        }
    }

    /// This toolchain's cargo, already told to run a tool.
    pub fn tool(&self, tool: Tool) -> Command {
        let mut command = match self {
            Self::Active { cargo } => Command::new(cargo),
            // Cargo would look among rustup's programs first and find the tool of the compiler
            // that cannot do this.
            Self::Debian { linker } => debian_command(&tool.debian_program(), linker),
        };
        command.arg(tool.subcommand);
        command
    }

    /// The arguments that make a cargo command one for the chip, between spaces.
    pub fn arguments(&self) -> String {
        let build_core = match self {
            Self::Active { .. } => "",
            Self::Debian { .. } => " -Zbuild-std=core",
        };
        format!("--target {TARGET}{build_core}")
    }
}

/// A program of Debian's toolchain, told to keep to that toolchain.
fn debian_command(program: &str, linker: &Path) -> Command {
    let mut command = Command::new(program);
    command
        .env("CARGO", DEBIAN_CARGO)
        .env("RUSTC", DEBIAN_RUSTC)
        .env("RUSTDOC", DEBIAN_RUSTDOC)
        .env("RUSTC_BOOTSTRAP", "1")
        .env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", linker)
        // What the other toolchain's cargo has put there for its own programs.
        .env_remove("RUSTUP_TOOLCHAIN")
        .env_remove("LD_LIBRARY_PATH");
    command
}

/// A toolchain and how it came about.
#[derive(Debug)]
pub struct Provided {
    /// The toolchain.
    pub toolchain: Toolchain,
    /// Which one it is, for the report.
    pub note: String,
}

/// Finds a compiler for the chip, or installs one.
///
/// # Errors
///
/// [`StepError`] with all that was tried.
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
        match rustup(&["target", "add", TARGET]) {
            Ok(()) if has_target() => return Ok(active("installed by rustup")),
            Ok(()) => tried += "rustup did not install it for the active toolchain\n",
            Err(error) => tried += &format!("{error}\n"),
        }
    } else {
        tried += &format!("rustup is out, {NO_RUSTUP} is set\n");
    }
    debian(&tried)
}

/// Finds or installs Debian's compiler and a linker for it.
fn debian(tried: &str) -> Result<Provided, StepError> {
    if !debian_is_complete() {
        let missing = |how: &str| StepError::Missing {
            what: "a compiler for the chip",
            tried: format!("{tried}{how}"),
            remedy: "let one of these succeed: `rustup target add thumbv7em-none-eabihf`, or as \
                     root `apt-get install rustc-web cargo-web rust-web-src`",
        };
        if !packages::available() {
            return Err(missing("there is no apt-get to install Debian's with"));
        }
        packages::install(&DEBIAN_PACKAGES).map_err(|error| missing(&error.to_string()))?;
        if !debian_is_complete() {
            return Err(missing("Debian's packages did not bring it"));
        }
    }
    let linker = linker()?;
    Ok(Provided {
        note: format!(
            "Debian's rustc {} builds core for {TARGET}, {} links",
            version(DEBIAN_RUSTC),
            linker.file_name().unwrap_or_default().display()
        ),
        toolchain: Toolchain::Debian { linker },
    })
}

/// A linker for bare metal: a toolchain's own, or Debian's.
fn linker() -> Result<PathBuf, StepError> {
    const PACKAGED: &str = "/usr/bin/ld.lld";
    let own = ["rustc", DEBIAN_RUSTC]
        .into_iter()
        .filter_map(sysroot)
        .find_map(|sysroot| own_linker(&sysroot));
    if let Some(linker) = own {
        return Ok(linker);
    }
    let packaged = PathBuf::from(PACKAGED);
    if !packaged.exists() {
        packages::install(&["lld"])?;
    }
    Ok(packaged)
}

/// The linker that a toolchain keeps among its host's libraries.
fn own_linker(sysroot: &Path) -> Option<PathBuf> {
    fs::read_dir(sysroot.join("lib/rustlib"))
        .ok()?
        .filter_map(Result::ok)
        .map(|host| host.path().join("bin/rust-lld"))
        .find(|linker| linker.exists())
}

fn debian_is_complete() -> bool {
    Path::new(DEBIAN_CARGO).exists()
        && sysroot(DEBIAN_RUSTC).is_some_and(|sysroot| {
            sysroot
                .join("lib/rustlib/src/rust/library/core/Cargo.toml")
                .exists()
        })
}

fn sysroot(rustc: &str) -> Option<PathBuf> {
    let path = process::answer(Command::new(rustc).args(["--print", "sysroot"])).ok()?;
    Some(PathBuf::from(path.trim()))
}

/// Whether the active compiler has a ready-made `core` for the chip.
fn has_target() -> bool {
    // The directory's name is printed whether it exists or not.
    let arguments = ["--print", "target-libdir", "--target", TARGET];
    process::answer(Command::new("rustc").args(arguments))
        .ok()
        .and_then(|path| fs::read_dir(path.trim()).ok())
        .is_some_and(|mut entries| entries.next().is_some())
}

fn version(rustc: &str) -> String {
    let said = process::answer(Command::new(rustc).arg("--version")).unwrap_or_default();
    said.split_whitespace()
        .nth(1)
        .unwrap_or("of unknown version")
        .to_owned()
}

fn rustup_may_be_used() -> bool {
    env::var_os(NO_RUSTUP).is_none_or(|value| value.is_empty() || value == "0")
}

/// Lets rustup install something for the active toolchain.
fn rustup(arguments: &[&str]) -> Result<(), StepError> {
    process::run(Command::new("rustup").args(arguments)).map(drop)
}

/// A part of a toolchain that a fresh machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tool {
    subcommand: &'static str,
    component: &'static str,
    package: &'static str,
}

impl Tool {
    fn debian_program(self) -> String {
        format!("{DEBIAN_CARGO}-{}", self.subcommand)
    }
}

/// The formatter.
pub const RUSTFMT: Tool = Tool {
    subcommand: "fmt",
    component: "rustfmt",
    package: "rustfmt-web",
};

/// The linter.
pub const CLIPPY: Tool = Tool {
    subcommand: "clippy",
    component: "clippy",
    package: "rust-web-clippy",
};

/// Finds a tool of a toolchain, or installs it; says why not where that fails.
pub fn provide_tool(toolchain: &Toolchain, tool: Tool) -> Result<(), String> {
    let works = || process::answer(toolchain.tool(tool).arg("--version")).is_ok();
    if works() {
        return Ok(());
    }
    let debian = match toolchain {
        Toolchain::Debian { .. } => true,
        Toolchain::Active { cargo } => cargo == DEBIAN_CARGO,
    };
    let installed = if debian {
        packages::install(&[tool.package])
    } else if rustup_may_be_used() {
        rustup(&["component", "add", tool.component])
    } else {
        return Err(format!("no {}, and rustup is out", tool.component));
    };
    match installed {
        Ok(()) if works() => Ok(()),
        _ => Err(format!(
            "no {} here, and it could not be installed",
            tool.component
        )),
    }
}

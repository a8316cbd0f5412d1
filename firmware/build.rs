//! Hands the linker its scripts, for the chip only: the host's `main` links like any program.

use std::path::PathBuf;
use std::{env, fs, io};

/// Scripts for the linker: the memory map of the board, kept at the top of the workspace, and
/// what `link.x` does not know.
const SCRIPTS: [(&str, &str); 2] = [("../memory.x", "memory.x"), ("sections.x", "sections.x")];

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    for (script, _) in SCRIPTS {
        println!("cargo::rerun-if-changed={script}");
    }

    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }

    // `link.x` includes `memory.x` by bare name. A copy on the search path makes the link
    // independent of the directory cargo happens to run in.
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    for (script, name) in SCRIPTS {
        fs::copy(script, PathBuf::from(&out).join(name))?;
    }
    println!("cargo::rustc-link-search={out}");

    // Here rather than as `rustflags` of the target, where one RUSTFLAGS variable in somebody's
    // environment would silently drop them.
    let arguments = [
        "-Tlink.x",
        "-Tsections.x",
        "-Tdefmt.x",
        "--nmagic",
        "--build-id",
    ];
    for argument in arguments {
        println!("cargo::rustc-link-arg-bins={argument}");
        println!("cargo::rustc-link-arg-examples={argument}");
    }
    Ok(())
}

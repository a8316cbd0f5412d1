//! Hands the linker its scripts, for the chip only: the host's `main` links like any program.

use std::path::PathBuf;
use std::{env, fs, io};

/// The memory map of the board, kept at the top of the workspace.
const MEMORY_MAP: &str = "../memory.x";

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={MEMORY_MAP}");

    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }

    // `link.x` includes `memory.x` by bare name. A copy on the search path makes the link
    // independent of the directory cargo happens to run in.
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    fs::copy(MEMORY_MAP, PathBuf::from(&out).join("memory.x"))?;
    println!("cargo::rustc-link-search={out}");

    // Here rather than as `rustflags` of the target, where one RUSTFLAGS variable in somebody's
    // environment would silently drop them.
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    Ok(())
}

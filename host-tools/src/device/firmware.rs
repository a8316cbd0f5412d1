//! Path of the firmware's ELF: the file that is flashed and that the emulator boots.

use std::env;
use std::path::{Path, PathBuf};

/// Environment variable that says where the firmware's ELF is; `cargo xtask test` sets it.
pub const FIRMWARE_ELF: &str = "MASSLINE_FIRMWARE_ELF";

/// Builds it.
pub const BUILD: &str =
    "cargo build --profile chip -p massline-firmware --target thumbv7em-none-eabihf";

/// Its path in cargo's target folder, where [`BUILD`] leaves it.
const BUILT: &str = "thumbv7em-none-eabihf/chip/massline-firmware";

/// There is no firmware.
#[derive(Debug, thiserror::Error)]
pub enum NoFirmware {
    /// The file that was named is not there.
    #[error("{}: there is no such file; build the firmware by `{BUILD}`", .0.display())]
    Named(PathBuf),
    /// None was named, and none was found.
    #[error(
        "found no firmware in {}; in massline's source folder, build it by `{BUILD}`, or name the ELF with --elf or in {FIRMWARE_ELF}",
        list(.0)
    )]
    NotFound(Vec<PathBuf>),
}

fn list(tried: &[PathBuf]) -> String {
    let names: Vec<String> = tried.iter().map(|p| p.display().to_string()).collect();
    names.join(", ")
}

/// The firmware's ELF: the one `named`, else what [`FIRMWARE_ELF`] names, else the one that was
/// built last in the source tree around the current folder.
///
/// # Errors
/// [`NoFirmware`], with how to build it.
pub fn find(named: Option<&Path>) -> Result<PathBuf, NoFirmware> {
    let variable = env::var_os(FIRMWARE_ELF).filter(|path| !path.is_empty());
    if let Some(path) = named.map(Path::to_owned).or(variable.map(PathBuf::from)) {
        return if path.is_file() {
            Ok(path)
        } else {
            Err(NoFirmware::Named(path))
        };
    }
    let target = env::var_os("CARGO_TARGET_DIR").filter(|path| !path.is_empty());
    let here = env::current_dir().unwrap_or_default();
    let folders = match target {
        Some(folder) => vec![PathBuf::from(folder)],
        None => here.ancestors().map(|a| a.join("target")).collect(),
    };
    let tried: Vec<PathBuf> = folders.iter().map(|folder| folder.join(BUILT)).collect();
    match tried.iter().find(|path| path.is_file()) {
        Some(path) => Ok(path.clone()),
        // The folders further up would only make the message long.
        None => Err(NoFirmware::NotFound(tried.into_iter().take(1).collect())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_there_is_named_with_the_way_to_build_it() {
        let error = find(Some(Path::new("no/such/firmware"))).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("no/such/firmware: "), "{text}");
        assert!(text.contains(BUILD), "{text}");
    }

    #[test]
    fn what_is_named_wins() {
        let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        assert_eq!(find(Some(&own)).unwrap(), own);
    }
}

//! Packages of Debian, unpacked into cargo's target folder, for tools that cargo cannot fetch.
//!
//! The machine is not changed and no root is needed: see [`super::apt`]. A folder is made beside
//! its place, under a lock, and renamed once it is complete and its programs run, so that no
//! interruption, full disk or second command leaves an incomplete folder in its place.

use std::env;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::apt;
use super::process::{self, StepError};

/// Packages to unpack together.
#[derive(Clone, Copy, Debug)]
pub struct Bundle {
    /// Name of their folder.
    pub name: &'static str,
    /// The packages, without their dependencies.
    pub packages: &'static [&'static str],
    /// Source package they are built from.
    pub source: &'static str,
    /// Programs to run from them, all in `/usr/bin`. Each has the option `--version`.
    pub programs: &'static [&'static str],
}

impl Bundle {
    /// The folder of scripts that run the programs, if they are unpacked and run.
    pub fn unpacked(&self) -> Option<PathBuf> {
        let folder = place()?.join(self.name);
        self.check(&folder).ok()
    }

    /// The folder of scripts that run the programs, which are fetched and unpacked if necessary.
    ///
    /// # Errors
    ///
    /// [`StepError`] of the step that failed.
    pub fn provide(&self) -> Result<PathBuf, StepError> {
        let place = place().ok_or(StepError::Missing {
            what: "cargo's target folder",
            tried: "this program does not lie in it".to_owned(),
            remedy: "run it by `cargo xtask test`",
        })?;
        let _lock = lock(&place)?;
        let folder = place.join(self.name);
        if let Ok(programs) = self.check(&folder) {
            return Ok(programs);
        }
        let made = place.join(format!("{}.part", self.name));
        remove(&made)?;
        let outcome = self.make(&made).and_then(|()| {
            // Programs that no longer run: the machine may have lost a library.
            remove(&folder)?;
            fs::rename(&made, &folder).map_err(|error| StepError::file(&folder, error))
        });
        if outcome.is_err() {
            // A full disk should not stay so. Remains are removed next time.
            let _ = remove(&made);
        }
        outcome?;
        self.check(&folder)
    }

    fn make(&self, folder: &Path) -> Result<(), StepError> {
        let root = folder.join("root");
        let fetched = folder.join("fetched");
        for package in apt::fetch(self.packages, self.source, &fetched)? {
            apt::unpack(&package, &root)?;
        }
        remove(&fetched)?;
        // These programs get no updates; none of them may run as another user.
        process::run(Command::new("chmod").args(["-R", "a-s"]).arg(&root))?;
        let libraries = libraries(&root).map_err(|error| StepError::file(&root, error))?;
        let launchers = folder.join("bin");
        fs::create_dir_all(&launchers).map_err(|error| StepError::file(&launchers, error))?;
        for program in self.programs {
            launcher(&launchers.join(program), program, &libraries)?;
        }
        self.check(folder).map(drop)
    }

    /// The folder of scripts, once each program has printed its version.
    fn check(&self, folder: &Path) -> Result<PathBuf, StepError> {
        let launchers = folder.join("bin");
        for program in self.programs {
            process::run(Command::new(launchers.join(program)).arg("--version"))?;
        }
        Ok(launchers)
    }
}

/// Folders below this one with shared libraries, relative to it.
fn libraries(folder: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    // Debian's places: these folders, and one level below, named by the architecture.
    for top in ["usr/lib", "lib", "usr/lib64", "lib64"] {
        if !folder.join(top).is_dir() {
            continue;
        }
        let mut candidates = vec![top.to_owned()];
        for entry in fs::read_dir(folder.join(top))? {
            if let Ok(name) = entry?.file_name().into_string() {
                candidates.push(format!("{top}/{name}"));
            }
        }
        candidates.sort();
        for candidate in candidates {
            let path = folder.join(&candidate);
            // A link leads to a folder that is listed itself, or out of the folder.
            if path.is_symlink() || !path.is_dir() {
                continue;
            }
            let holds = fs::read_dir(path)?
                .filter_map(Result::ok)
                .any(|entry| is_library(&entry.file_name().to_string_lossy()));
            if holds {
                found.push(candidate);
            }
        }
    }
    Ok(found)
}

/// `true` if a file of this name is a shared library: `libz.so`, `libz.so.1`.
fn is_library(name: &str) -> bool {
    name.ends_with(".so") || name.contains(".so.")
}

/// Writes a script that runs a program with the libraries unpacked beside it.
fn launcher(path: &Path, program: &str, libraries: &[String]) -> Result<(), StepError> {
    let list: Vec<String> = libraries
        .iter()
        .map(|folder| format!("$here/{folder}"))
        .collect();
    let script = format!(
        "#!/bin/sh\n\
         # Runs a program with the libraries that were unpacked with it.\n\
         here=$(cd \"${{0%/*}}/../root\" && pwd) || exit\n\
         LD_LIBRARY_PATH={}${{LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}}\n\
         export LD_LIBRARY_PATH\n\
         exec \"$here/usr/bin/{program}\" \"$@\"\n",
        list.join(":")
    );
    fs::write(path, script).map_err(|error| StepError::file(path, error))?;
    process::run(Command::new("chmod").arg("755").arg(path)).map(drop)
}

/// The folder for unpacked packages.
fn place() -> Option<PathBuf> {
    Some(target()?.join("debian"))
}

/// The target folder that this program was built into.
pub fn target() -> Option<PathBuf> {
    let program = env::current_exe().ok()?;
    // Cargo marks its target folder so; the depth of a program in it depends on cargo's options.
    let mut folders = program.ancestors();
    let target = folders.find(|folder| folder.join("CACHEDIR.TAG").is_file())?;
    Some(target.to_owned())
}

/// Waits until no other command unpacks into this folder. The lock is released when the file is
/// dropped, and with the process.
fn lock(place: &Path) -> Result<File, StepError> {
    let path = place.join("lock");
    fs::create_dir_all(place)
        .and_then(|()| File::create(&path))
        .and_then(|file| file.lock().map(|()| file))
        .map_err(|error| StepError::file(&path, error))
}

/// Removes a file or folder, if it exists.
fn remove(path: &Path) -> Result<(), StepError> {
    let removed = match path.symlink_metadata() {
        Ok(found) if found.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    };
    removed.map_err(|error| StepError::file(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distinguishes_libraries_from_other_files() {
        for name in ["libz.so", "libz.so.1.2.13", "librustc_driver-ea0e99b3.so"] {
            assert!(is_library(name), "{name}");
        }
        for name in ["libz.a", "sofa", "x.socket", "qemu"] {
            assert!(!is_library(name), "{name}");
        }
    }

    #[test]
    fn this_program_lies_in_a_target_folder() {
        assert!(place().unwrap().ends_with("debian"));
    }
}

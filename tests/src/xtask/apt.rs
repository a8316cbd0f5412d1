//! Packages of Debian, found and fetched without an installation.
//!
//! # Design
//!
//! An installation needs root, and it fails or removes packages where a package conflicts with an
//! installed one: the tools of one version of a program with the data of another, for example. A
//! copy in a folder conflicts with nothing. So apt resolves dependencies as for an installation,
//! but only downloads, and writes below a folder of this command:
//!
//! * It reads a list of the installed packages with names, versions and provisions only, so that
//!   installed libraries are not fetched, and conflicting, held or half-installed packages do not
//!   interfere.
//! * Packages of the same source as the requested ones are not in that list: an emulator of one
//!   version does not run with the data of another.
//! * The machine's own index of packages is tried first. A fresh machine has none, and an old index
//!   names packages that are gone; after a failure a new index is fetched into the folder.
//! * apt's configuration is the machine's (sources, proxies, pins) without its hooks, which change
//!   the machine.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::process::{self, StepError};

/// Downloads packages and their dependencies that are not installed, and returns the files.
///
/// `source` is the source package they are built from. apt writes below `folder`, an absolute path.
///
/// # Errors
///
/// [`StepError`] with apt's message.
pub fn fetch(packages: &[&str], source: &str, folder: &Path) -> Result<Vec<PathBuf>, StepError> {
    for program in ["apt-get", "apt-config", "dpkg-deb"] {
        process::answer(Command::new(program).arg("--version")).map_err(|_| {
            StepError::Missing {
                what: "a tool for Debian's packages",
                tried: format!("there is no {program} that runs"),
                remedy: "install the contents of these packages by hand",
            }
        })?;
    }
    let apt = Apt::set_up(source, folder)?;
    if let Ok(files) = apt.download(packages, &[]) {
        return Ok(files);
    }
    let lists = folder.join("state/lists");
    let own = ["-o", &format!("Dir::State::lists={}", lists.display())];
    process::run(apt.get("update").args(own).arg("--error-on=any"))?;
    apt.download(packages, &own)
}

/// Unpacks a package into a folder.
///
/// # Errors
///
/// [`StepError`] with the message of `dpkg-deb`.
pub fn unpack(package: &Path, folder: &Path) -> Result<(), StepError> {
    let mut extract = Command::new("dpkg-deb");
    extract.arg("--extract").arg(package).arg(folder);
    process::run(&mut extract).map(drop)
}

/// apt with its configuration and state in a folder of this command.
struct Apt {
    configuration: PathBuf,
    archives: PathBuf,
}

impl Apt {
    fn set_up(source: &str, folder: &Path) -> Result<Self, StepError> {
        let state = folder.join("state");
        make_folder(&state.join("lists/partial"))?;
        let ask = |arguments: &[&str]| process::answer(apt_config().args(arguments));
        let system = PathBuf::from(shell_value(&ask(&["shell", "X", "Dir::State::status/f"])?));
        let lists = PathBuf::from(shell_value(&ask(&["shell", "X", "Dir::State::lists/d"])?));
        let text = fs::read_to_string(&system).map_err(|error| StepError::file(&system, error))?;
        write(&state.join("status"), &installed(&text, source))?;
        let configuration = folder.join("apt.conf");
        write(&configuration, &relocated(&ask(&["dump"])?, folder, &lists))?;
        Ok(Self {
            configuration,
            archives: folder.join("cache/archives"),
        })
    }

    fn get(&self, action: &str) -> Command {
        let mut command = Command::new("apt-get");
        command
            .env("APT_CONFIG", &self.configuration)
            .env("LC_ALL", "C")
            .env("DEBIAN_FRONTEND", "noninteractive")
            .args(["--quiet", action]);
        command
    }

    fn download(&self, packages: &[&str], options: &[&str]) -> Result<Vec<PathBuf>, StepError> {
        // Files of an attempt with an older index would be unpacked, too.
        if self.archives.exists() {
            let removed = fs::remove_dir_all(&self.archives);
            removed.map_err(|error| StepError::file(&self.archives, error))?;
        }
        make_folder(&self.archives.join("partial"))?;
        let mut install = self.get("install");
        install
            .args(["--yes", "--download-only", "--no-install-recommends"])
            .args(options)
            .args(packages);
        process::run(&mut install)?;
        let entries = fs::read_dir(&self.archives);
        let mut files: Vec<PathBuf> = entries
            .map_err(|error| StepError::file(&self.archives, error))?
            .filter_map(Result::ok)
            .map(|entry| entry.path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "deb"))
            .collect();
        files.sort();
        if files.is_empty() {
            return Err(StepError::Answer {
                command: format!("apt-get install --download-only {}", packages.join(" ")),
                expected: "the packages it has fetched",
            });
        }
        Ok(files)
    }
}

fn apt_config() -> Command {
    let mut command = Command::new("apt-config");
    command.env("LC_ALL", "C");
    command
}

/// The value in a line such as `X='/var/lib/dpkg/status'`.
fn shell_value(line: &str) -> String {
    let (_, value) = line.trim_end().split_once('=').unwrap_or_default();
    value.trim_matches('\'').to_owned()
}

/// The machine's configuration of apt, from `apt-config dump`, for work in a folder.
fn relocated(dump: &str, folder: &Path, lists: &Path) -> String {
    // Hooks, and further downloads with an index: descriptions, icons.
    const WITHOUT: [&str; 8] = [
        "APT::Update::",
        "APT::Sandbox::",
        "DPkg::",
        "Acquire::IndexTargets::",
        "Acquire::Languages",
        "Dir::Log",
        "Binary::",
        "CommandLine::",
    ];
    // Folders that apt writes, and files from which it would read its hooks.
    const REPLACED: [&str; 4] = [
        "Dir::State",
        "Dir::Cache",
        "Dir::Etc::main",
        "Dir::Etc::parts",
    ];
    let mut text: String = dump
        .lines()
        .filter(|line| {
            !WITHOUT
                .iter()
                .chain(&REPLACED)
                .any(|key| line.starts_with(key))
        })
        .map(|line| format!("{line}\n"))
        .collect();
    let folder = folder.display();
    text += &format!(
        "Dir::Etc::main \"/dev/null\";\n\
         Dir::Etc::parts \"/dev/null\";\n\
         Dir::State \"{folder}/state\";\n\
         Dir::State::status \"{folder}/state/status\";\n\
         Dir::State::lists \"{}\";\n\
         Dir::Cache \"{folder}/cache\";\n\
         Dir::Cache::archives \"archives/\";\n\
         Dir::Log \"{folder}\";\n\
         Acquire::Languages \"none\";\n\
         APT::Sandbox::User \"root\";\n",
        lists.display()
    );
    text
}

/// A package database with the name, version and provisions of installed packages, without those
/// built from `source`.
fn installed(database: &str, source: &str) -> String {
    const KEPT: [&str; 5] = [
        "Package",
        "Architecture",
        "Multi-Arch",
        "Version",
        "Provides",
    ];
    let mut text = String::new();
    for paragraph in database.split("\n\n") {
        let field = |name: &str| {
            // A line that begins with a space continues the field before it.
            paragraph.lines().find_map(|line| {
                let (key, value) = line.split_once(':')?;
                key.eq_ignore_ascii_case(name).then(|| value.trim())
            })
        };
        let (Some(package), Some(status)) = (field("Package"), field("Status")) else {
            continue;
        };
        // A version may follow the source's name: `qemu (1:10.0.2+ds-2)`.
        let built_from = field("Source").and_then(|value| value.split_whitespace().next());
        let present = status.split_whitespace().nth(2) == Some("installed");
        if !present || built_from.unwrap_or(package) == source {
            continue;
        }
        text += "Status: install ok installed\n";
        for name in KEPT {
            if let Some(value) = field(name) {
                text += &format!("{name}: {value}\n");
            }
        }
        text += "\n";
    }
    text
}

fn make_folder(path: &Path) -> Result<(), StepError> {
    fs::create_dir_all(path).map_err(|error| StepError::file(path, error))
}

fn write(path: &Path, text: &str) -> Result<(), StepError> {
    fs::write(path, text).map_err(|error| StepError::file(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DATABASE: &str = "\
Package: libc6
Status: install ok installed
Source: glibc
Architecture: amd64
Multi-Arch: same
Version: 2.36-9
Provides: libc6-abi (= 1)
Depends: libgcc-s1
Breaks: qemu-system-arm (<< 5)
Description: shared libraries
 Version: 99 of a text that continues
 .

Package: qemu-utils
Status: install ok installed
Source: qemu (1:10.0.2+ds-2)
Version: 1:10.0.2+ds-2
Architecture: amd64

Package: qemu
Status: install ok installed
Version: 1:10.0.2
Architecture: amd64

Package: removed
Status: deinstall ok config-files
Version: 1
Architecture: amd64

Package: broken
Status: install reinstreq half-installed
Version: 1
Architecture: amd64

Package: held
Status: hold ok installed
Version: 3
Architecture: all
";

    #[test]
    fn lists_installed_packages_without_those_that_could_conflict() {
        assert_eq!(
            installed(DATABASE, "qemu"),
            "Status: install ok installed\nPackage: libc6\nArchitecture: amd64\n\
             Multi-Arch: same\nVersion: 2.36-9\nProvides: libc6-abi (= 1)\n\n\
             Status: install ok installed\nPackage: held\nArchitecture: all\nVersion: 3\n\n"
        );
        assert!(installed(DATABASE, "rustc-web").contains("Package: qemu-utils\n"));
        assert_eq!(installed("", "qemu"), "");
    }

    #[test]
    fn keeps_the_configuration_without_hooks_and_folders() {
        let dump = "APT::Architecture \"amd64\";\n\
            APT::Update::Post-Invoke:: \"rm -f /var/cache/apt/*.bin\";\n\
            Dir \"/\";\n\
            Dir::State \"var/lib/apt\";\n\
            Dir::Cache::archives \"archives/\";\n\
            Dir::Etc::sourcelist \"sources.list\";\n\
            Dir::Etc::parts \"apt.conf.d\";\n\
            Acquire::http::Proxy \"proxy:3128\";\n\
            DPkg::Post-Invoke:: \"true\";\n";
        let text = relocated(dump, Path::new("/a b"), Path::new("/var/lib/apt/lists"));
        for kept in [
            "APT::Architecture",
            "Dir::Etc::sourcelist",
            "Acquire::http::Proxy",
        ] {
            assert!(text.contains(kept), "{kept} is not in {text}");
        }
        for gone in ["Invoke", "var/lib/apt\"", "apt.conf.d"] {
            assert!(!text.contains(gone), "{gone} is in {text}");
        }
        assert!(text.contains("Dir::State::status \"/a b/state/status\";\n"));
        assert!(text.contains("Dir::State::lists \"/var/lib/apt/lists\";\n"));
    }

    #[test]
    fn reads_a_value_as_apt_writes_it_for_a_shell() {
        assert_eq!(
            shell_value("X='/var/lib/dpkg/status'\n"),
            "/var/lib/dpkg/status"
        );
        assert_eq!(shell_value(""), "");
    }
}

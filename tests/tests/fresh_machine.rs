//! Tools that `cargo xtask test` fetches for a machine that lacks them, on a machine made for the
//! test: packages, an index, a list of installed packages, a `PATH`, a target folder.
//!
//! apt and dpkg-deb are the real ones; on a system without them the tests pass with a message.

#![cfg(target_os = "linux")]

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A machine in a folder.
struct Machine {
    folder: tempfile::TempDir,
}

/// The emulator, as a script that needs the data of another package and a library's folder.
const EMULATOR: &str = "#!/bin/sh\n\
    read -r data < \"${0%/*}/../share/qemu/data\" || exit 3\n\
    case $LD_LIBRARY_PATH in *root/usr/lib*) echo \"emulator with $data\";; *) exit 4;; esac\n";

/// Installed packages: a library that is needed, and tools of a newer version, which do not go with
/// the data of the version in the index and must not be removed.
const INSTALLED: &str = "Package: libpresent\n\
    Status: install ok installed\n\
    Version: 2\n\
    Architecture: all\n\
    Maintainer: nobody <nobody@localhost>\n\
    Description: a library that is there\n\
    \n\
    Package: qemu-utils\n\
    Status: hold ok installed\n\
    Source: qemu (99)\n\
    Version: 99\n\
    Architecture: all\n\
    Breaks: qemu-system-common (<< 99)\n\
    Maintainer: nobody <nobody@localhost>\n\
    Description: tools of a newer version\n";

impl Machine {
    /// `None` on a system without apt.
    fn new() -> Option<Self> {
        let machine = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        for folder in ["repository", "lists/partial", "bin", "my target/debug"] {
            fs::create_dir_all(machine.at(folder)).unwrap();
        }
        let programs = [
            "apt-get",
            "apt-config",
            "dpkg",
            "dpkg-deb",
            "sh",
            "chmod",
            "tar",
            "rm",
        ];
        for program in programs {
            let Some(path) = which(program) else {
                eprintln!("nothing tried: there is no {program} here");
                return None;
            };
            symlink(path, machine.at("bin").join(program)).unwrap();
        }
        fs::copy(env!("CARGO_BIN_EXE_xtask"), machine.xtask()).unwrap();
        machine.write("my target/CACHEDIR.TAG", "");
        machine.write("status", INSTALLED);
        machine.package(
            "qemu-system-common",
            "",
            &[("share/qemu/data", "its data\n")],
        );
        let depends = "Depends: qemu-system-common, libpresent (>= 2), libabsent\n";
        machine.package(
            "qemu-system-arm",
            depends,
            &[("bin/qemu-system-arm", EMULATOR)],
        );
        machine.package("libabsent", "", &[("lib/libabsent.so.1", "")]);
        let at = |path| machine.at(path).display().to_string();
        machine.write(
            "sources.list",
            &format!("deb [trusted=yes] copy:{} ./\n", at("repository")),
        );
        let configuration = format!(
            "Dir::Etc::main \"/dev/null\";\nDir::Etc::parts \"/dev/null\";\n\
             Dir::Etc::sourcelist \"{}\";\nDir::Etc::sourceparts \"/dev/null\";\n\
             Dir::State::status \"{}\";\nDir::State::lists \"{}\";\n\
             APT::Update::Post-Invoke {{ \"touch {}\"; }};\n",
            at("sources.list"),
            at("status"),
            at("lists"),
            at("hooked"),
        );
        machine.write("apt.conf", &configuration);
        Some(machine)
    }

    fn at(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    fn xtask(&self) -> PathBuf {
        self.at("my target/debug/xtask")
    }

    fn unpacked(&self) -> PathBuf {
        self.at("my target/debian/qemu")
    }

    fn write(&self, path: &str, text: &str) {
        fs::write(self.at(path), text).unwrap();
    }

    fn program(&self, path: &str, text: &str) -> PathBuf {
        let path = self.at(path);
        // Not through a link to the real file.
        let _ = fs::remove_file(&path);
        fs::write(&path, text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        path
    }

    /// Builds a package with files below `usr`, and its entry in the index.
    fn package(&self, name: &str, fields: &str, files: &[(&str, &str)]) {
        let tree = format!("packages/{name}");
        for (path, text) in files {
            let path = format!("{tree}/usr/{path}");
            fs::create_dir_all(self.at(&path).parent().unwrap()).unwrap();
            self.program(&path, text);
        }
        let control = format!(
            "Package: {name}\nSource: qemu\nVersion: 7\nArchitecture: all\n{fields}\
             Maintainer: nobody <nobody@localhost>\nDescription: a package for a test\n"
        );
        fs::create_dir_all(self.at(&format!("{tree}/DEBIAN"))).unwrap();
        self.write(&format!("{tree}/DEBIAN/control"), &control);
        let file = format!("{name}_7_all.deb");
        let package = self.at("repository").join(&file);
        let mut build = Command::new("dpkg-deb");
        build
            .args(["--root-owner-group", "--build"])
            .arg(self.at(&tree));
        assert!(build.arg(&package).output().unwrap().status.success());
        let sum = Command::new("sha256sum").arg(&package).output().unwrap();
        let sum = String::from_utf8(sum.stdout).unwrap();
        let index = self.at("repository/Packages");
        let entry = format!(
            "{}{control}Filename: ./{file}\nSize: {}\nSHA256: {}\n\n",
            fs::read_to_string(&index).unwrap_or_default(),
            package.metadata().unwrap().len(),
            sum.split_whitespace().next().unwrap(),
        );
        fs::write(index, entry).unwrap();
    }

    /// `cargo xtask test --only STEP`, without a home and with this machine's programs only.
    fn test(&self, step: &str) -> Command {
        let mut command = Command::new(self.xtask());
        command
            .args(["test", "--only", step])
            .env_clear()
            .env("PATH", self.at("bin"))
            .env("APT_CONFIG", self.at("apt.conf"));
        command
    }

    fn passes(&self) -> String {
        let (passed, text) = outcome(&self.test("qemu").output().unwrap());
        assert!(passed, "{text}");
        text
    }
}

fn which(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())
}

fn outcome(output: &Output) -> (bool, String) {
    let text = [output.stdout.as_slice(), &output.stderr].concat();
    (output.status.success(), String::from_utf8(text).unwrap())
}

fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn an_emulator_comes_past_a_conflict_and_the_second_time_without_a_network() {
    let Some(machine) = Machine::new() else {
        return;
    };
    let text = machine.passes();
    assert!(text.contains("emulator with its data, unpacked"), "{text}");
    assert_eq!(fs::read_to_string(machine.at("status")).unwrap(), INSTALLED);
    assert_eq!(entries(&machine.at("lists")), ["partial"]);
    assert!(
        !machine.at("hooked").exists(),
        "apt's hooks change the machine"
    );
    let place = machine.at("my target/debian");
    assert_eq!(entries(&place), ["lock", "qemu"]);
    assert_eq!(entries(&machine.unpacked()), ["bin", "root"]);

    fs::remove_dir_all(machine.at("repository")).unwrap();
    fs::remove_file(machine.at("bin/apt-get")).unwrap();
    assert!(
        machine
            .passes()
            .contains("emulator with its data, unpacked")
    );
}

#[test]
fn a_machines_own_emulator_and_a_named_one_come_first() {
    let Some(machine) = Machine::new() else {
        return;
    };
    let other = machine.program("other", "#!/bin/sh\necho the named one\n");
    let named = machine.test("qemu").env("MASSLINE_QEMU", &other).output();
    assert!(outcome(&named.unwrap()).1.contains("the named one"));
    // A named emulator that does not exist is not replaced.
    let named = machine.test("qemu").env("MASSLINE_QEMU", "/none").output();
    let (passed, text) = outcome(&named.unwrap());
    assert!(
        !passed && text.contains("/none --version\ncannot be started"),
        "{text}"
    );
    machine.program("bin/qemu-system-arm", "#!/bin/sh\necho its own\n");
    assert!(machine.passes().contains("its own"));
    assert!(!machine.at("my target/debian").exists());
}

#[test]
fn remains_of_a_killed_command_are_no_emulator() {
    let Some(machine) = Machine::new() else {
        return;
    };
    let real = which("dpkg-deb").unwrap();
    // Three packages: killed before and after each is unpacked.
    for (count, after) in [(1, false), (1, true), (2, true), (3, false), (3, true)] {
        let kill = "kill -9 $PPID; exit 1";
        let (before, after) = if after { ("", kill) } else { (kill, "") };
        machine.program(
            "bin/dpkg-deb",
            &format!(
                "#!/bin/sh\n[ \"$1\" = --extract ] || exec {real} \"$@\"\n\
                 echo >> {log}\nn=0; while read -r _; do n=$((n + 1)); done < {log}\n\
                 [ $n = {count} ] && {{ :; {before}\n}}\n{real} \"$@\" || exit\n\
                 [ $n = {count} ] && {{ :; {after}\n}}\nexit 0\n",
                real = real.display(),
                log = machine.at("log").display(),
            ),
        );
        let output = machine.test("qemu").output().unwrap();
        assert!(!output.status.success(), "killed at {count}");
        assert!(!machine.unpacked().exists(), "killed at {count}");
        let left = entries(&machine.at("my target/debian"));
        assert_eq!(left, ["lock", "qemu.part"], "killed at {count}");
        fs::remove_file(machine.at("log")).unwrap();
    }
    machine.program(
        "bin/dpkg-deb",
        &format!("#!/bin/sh\nexec {} \"$@\"\n", real.display()),
    );
    machine.passes();
    assert_eq!(entries(&machine.at("my target/debian")), ["lock", "qemu"]);
}

#[test]
fn an_emulator_that_does_not_run_any_more_is_fetched_anew() {
    let Some(machine) = Machine::new() else {
        return;
    };
    machine.passes();
    let data = machine.unpacked().join("root/usr/share/qemu/data");
    fs::remove_file(&data).unwrap();
    machine.passes();
    assert!(data.exists());
    // A folder stays as long as it cannot be fetched again, so that its owner can see the error.
    fs::remove_file(&data).unwrap();
    fs::remove_dir_all(machine.at("repository")).unwrap();
    let (passed, text) = outcome(&machine.test("qemu").output().unwrap());
    assert!(!passed);
    for part in [
        "an emulator of the chip is missing",
        "apt-get",
        "MASSLINE_QEMU",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    assert_eq!(entries(&machine.at("my target/debian")), ["lock", "qemu"]);
}

#[test]
fn a_damaged_package_is_refused() {
    let Some(machine) = Machine::new() else {
        return;
    };
    machine.write(
        "repository/qemu-system-common_7_all.deb",
        "nothing of the kind",
    );
    let (passed, text) = outcome(&machine.test("qemu").output().unwrap());
    assert!(!passed && text.contains("qemu-system-common"), "{text}");
    assert_eq!(entries(&machine.at("my target/debian")), ["lock"]);
}

#[test]
fn two_commands_at_once_both_find_an_emulator() {
    let Some(machine) = Machine::new() else {
        return;
    };
    let piped = || std::process::Stdio::piped();
    let spawn = || {
        let mut command = machine.test("qemu");
        command.stdout(piped()).stderr(piped()).spawn().unwrap()
    };
    for child in [spawn(), spawn(), spawn()] {
        let (passed, text) = outcome(&child.wait_with_output().unwrap());
        assert!(passed, "{text}");
    }
    assert_eq!(entries(&machine.at("my target/debian")), ["lock", "qemu"]);
}

#[test]
fn advisories_are_reported_as_checked_only_if_they_were() {
    let Some(machine) = Machine::new() else {
        return;
    };
    // A cargo with cargo-deny, whose commands end with these codes.
    for (version, fetch, check, passes, note) in [
        (1, 0, 0, true, "NOT checked: no cargo-deny"),
        (0, 1, 0, true, "NOT checked: cargo-deny cannot fetch"),
        (0, 0, 1, false, "FAILED"),
        (0, 0, 0, true, "ok"),
    ] {
        let cargo = machine.program(
            "bin/cargo",
            &format!(
                "#!/bin/sh\ncase $* in *--version) exit {version};; *fetch*) exit {fetch};; \
                 *check*) exit {check};; esac\nexit 9\n"
            ),
        );
        let output = machine.test("advisories").env("CARGO", cargo).output();
        let (passed, text) = outcome(&output.unwrap());
        assert_eq!(passed, passes, "{text}");
        assert!(text.contains(note), "{note} is not in {text}");
        assert_eq!(text.contains("1 passed"), note == "ok", "{text}");
    }
}

/// Where Python's packages cannot be had, the summary says that nothing was checked and why; where
/// they were once installed, no network is needed.
#[test]
fn independent_readers_are_reported_as_checked_only_if_they_were() {
    let Some(machine) = Machine::new() else {
        return;
    };
    let built = r#"{"reason":"compiler-artifact","executable":"/a/massline"}"#;
    let cargo = machine.program("bin/cargo", &format!("#!/bin/sh\necho '{built}'\n"));
    // A Python whose venv, pip and check end with these codes.
    for (venv, pip, check, passes, note) in [
        (1, 0, 0, true, "NOT checked: no Python"),
        (
            0,
            1,
            0,
            true,
            "pip cannot install the packages: ERROR: no network",
        ),
        (0, 0, 1, false, "FAILED"),
        // From here on the environment is there.
        (1, 1, 0, true, "2 checks"),
    ] {
        let script = format!(
            "#!/bin/sh\ncase $* in\n\
             *venv*) for folder; do :; done; command -p mkdir -p \"$folder/bin\";\n\
             command -p cp \"$0\" \"$folder/bin/python\"; exit {venv};;\n\
             *pip*) echo 'ERROR: no network' >&2; exit {pip};;\n\
             *--version) exit 0;; esac\necho one\necho two\nexit {check}\n"
        );
        machine.program("bin/python3", &script);
        let environment = machine.at("my target/readers/bin/python");
        if environment.exists() && venv == 1 {
            machine.program("my target/readers/bin/python", &script);
        }
        let output = machine.test("readers").env("CARGO", &cargo).output();
        let (passed, text) = outcome(&output.unwrap());
        assert_eq!(passed, passes, "{text}");
        assert!(text.contains(note), "{note} is not in {text}");
        assert_eq!(text.contains("1 passed"), note == "2 checks", "{text}");
    }
}

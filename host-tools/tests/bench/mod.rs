//! A test on disk and the real binary, as a user has them.

// Every test program takes a part of this.
#![allow(dead_code)]

pub mod one_run;

use massline::simulate::{Model, Options, simulate};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use tempfile::TempDir;

/// Exit code and outputs of a command.
#[derive(Debug)]
pub struct Finished {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Finished {
    /// Asserts that wrong usage or unreadable input was refused: exit code 2, and one sentence
    /// with these words.
    #[track_caller]
    pub fn refused_input(&self, words: &str) {
        self.refused(2, words);
    }

    /// Asserts that data that allow no answer were refused: exit code 1, and one sentence with
    /// these words.
    #[track_caller]
    pub fn refused_data(&self, words: &str) {
        self.refused(1, words);
    }

    #[track_caller]
    fn refused(&self, code: i32, words: &str) {
        println!("{}", self.stderr.trim_end());
        assert_eq!(self.code, Some(code), "{}", self.stderr);
        assert_eq!(self.stdout, "");
        let line = self.stderr.strip_prefix("error: ").unwrap();
        assert_eq!(line.lines().count(), 1, "one sentence: {line}");
        assert!(!line.contains('\u{1b}'), "colours without a terminal");
        assert!(!line.contains("panicked"));
        assert_has(line, words);
    }

    /// Asserts these words on the standard error.
    #[track_caller]
    pub fn says(&self, words: &str) {
        assert_has(&self.stderr, words);
    }

    /// Asserts these words on the standard output.
    #[track_caller]
    pub fn shows(&self, words: &str) {
        assert_has(&self.stdout, words);
    }
}

/// Asserts that a text has all words between the marks ` … `, in this order.
#[track_caller]
fn assert_has(text: &str, words: &str) {
    let mut rest = text;
    for word in words.split(" … ") {
        let found = rest.split_once(word);
        (_, rest) = found.unwrap_or_else(|| panic!("«{word}» is not in: {text}"));
    }
}

/// Runs the binary in a folder.
pub fn massline<S: AsRef<OsStr>>(
    folder: &Path,
    arguments: impl IntoIterator<Item = S>,
) -> Finished {
    finish(command(folder, arguments))
}

/// The binary in a folder, with nothing of this process's environment that it looks at.
pub fn command<S: AsRef<OsStr>>(folder: &Path, arguments: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_massline"));
    command
        .current_dir(folder)
        .args(arguments)
        .env_remove("NO_COLOR")
        .env_remove("CLICOLOR")
        .env_remove("CLICOLOR_FORCE");
    command
}

/// Runs a command to its end.
pub fn finish(mut command: Command) -> Finished {
    let output = command.output().unwrap();
    Finished {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The fork shaken for six seconds: four blocks a run, enough for every complaint.
static FORK: LazyLock<TempDir> = LazyLock::new(|| {
    let options = Options {
        noise: Some(0.01),
        duration: Some(6.0),
        weighed: true,
        ..Options::default()
    };
    let simulation = simulate(&Model::fork().unwrap(), &options, &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let setup = simulation.write(folder.path()).unwrap();
    by_hand(&setup);
    folder
});

/// Takes the recordings' checksums out of a setup, so that it is like one that was written by
/// hand, and recordings may be changed.
pub fn by_hand(setup: &Path) {
    let text = std::fs::read_to_string(setup).unwrap();
    let kept = text.lines().filter(|line| !line.starts_with("checksum = "));
    let kept: String = kept.flat_map(|line| [line, "\n"]).collect();
    assert!(kept != text, "a simulated setup has checksums");
    std::fs::write(setup, kept).unwrap();
}

/// A copy of that test which may be spoilt.
pub struct Bench {
    folder: TempDir,
}

/// Names the averaging band's method.
pub const BAND: [&str; 2] = ["--method", "apparent-mass"];

/// The recordings of the three runs.
pub const RECORDINGS: [&str; 3] = ["lateral-x.csv", "lateral-z.csv", "rotation-y.csv"];

impl Bench {
    pub fn fork() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for file in ["setup.toml", "truth.json"].iter().chain(&RECORDINGS) {
            std::fs::copy(FORK.path().join(file), folder.path().join(file)).unwrap();
        }
        Self { folder }
    }

    /// The satellite shaken for ten seconds in six axes: a test that tells all ten numbers.
    pub fn satellite() -> Self {
        Self::satellite_for(10.0)
    }

    /// The same, so many seconds a run.
    pub fn satellite_for(seconds: f64) -> Self {
        let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/satellite.toml");
        let options = Options {
            noise: Some(0.01),
            duration: Some(seconds),
            ..Options::default()
        };
        let simulation = simulate(&Model::read(&model).unwrap(), &options, &mut |_| ()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        by_hand(&simulation.write(folder.path()).unwrap());
        Self { folder }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Rewrites a text file.
    pub fn edit(self, file: &str, change: impl Fn(&str) -> String) -> Self {
        let path = self.file(file);
        let text = std::fs::read_to_string(&path).unwrap();
        let changed = change(&text);
        assert!(text != changed, "the edit of {file} does nothing");
        std::fs::write(path, changed).unwrap();
        self
    }

    /// Replaces the first occurrence of a text in the setup.
    pub fn setup(self, from: &str, to: &str) -> Self {
        self.edit("setup.toml", |text| text.replacen(from, to, 1))
    }

    /// Gives a key of the setup another value, where it stands first.
    pub fn with(self, key: &str, value: &str) -> Self {
        let begin = format!("{key} = ");
        self.edit("setup.toml", |text| {
            let old = text.lines().find(|line| line.starts_with(&begin)).unwrap();
            text.replacen(old, &format!("{begin}{value}"), 1)
        })
    }

    /// Writes a file as it is.
    pub fn write(self, file: &str, bytes: impl AsRef<[u8]>) -> Self {
        std::fs::write(self.file(file), bytes).unwrap();
        self
    }

    /// Changes one channel of a recording: row number (from 0) and field to a new field.
    pub fn channel(
        self,
        file: &str,
        channel: &str,
        change: impl Fn(usize, &str) -> String,
    ) -> Self {
        self.edit(file, |text| {
            let mut lines = text.lines();
            let header = lines.next().unwrap();
            let column = header.split(',').position(|name| name == channel).unwrap();
            let mut changed = format!("{header}\n");
            for (row, line) in lines.enumerate() {
                let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
                fields[column] = change(row, &fields[column]);
                changed += &fields.join(",");
                changed.push('\n');
            }
            changed
        })
    }

    /// Leaves only these sensors in the setup.
    pub fn only(self, channels: &[&str]) -> Self {
        self.edit("setup.toml", |text| {
            let sensor =
                |part: &str| part.starts_with("[accelerometer") || part.starts_with("[load");
            let kept = |part: &str| {
                !sensor(part)
                    || channels
                        .iter()
                        .any(|c| part.contains(&format!("channel = \"{c}\"")))
            };
            let parts: Vec<&str> = text.split("\n[").filter(|part| kept(part)).collect();
            parts.join("\n[")
        })
    }

    /// [`Finished::refused_input`] of `massline identify setup.toml`.
    #[track_caller]
    pub fn refused_input(&self, words: &str) {
        self.identify(&[]).refused_input(words);
    }

    /// [`Finished::refused_data`] of `massline identify setup.toml`.
    #[track_caller]
    pub fn refused_data(&self, words: &str) {
        self.identify(&[]).refused_data(words);
    }

    /// `massline identify setup.toml` with more arguments: by the averaging band's method where they name none,
    /// whose numbers most tests expect, and which takes a tenth of the time.
    pub fn identify(&self, arguments: &[&str]) -> Finished {
        let fast: &[&str] = if arguments.contains(&"--method") {
            &[]
        } else {
            &BAND
        };
        self.recommended(&[arguments, fast].concat())
    }

    /// The same by the recommended method where they name none.
    pub fn recommended(&self, arguments: &[&str]) -> Finished {
        massline(
            self.path(),
            ["identify", "setup.toml"].iter().chain(arguments),
        )
    }
}

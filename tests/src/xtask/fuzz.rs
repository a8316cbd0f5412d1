//! `cargo xtask fuzz`: searches with libFuzzer for inputs that make the targets of `tests/fuzz`
//! fail.
//!
//! # Design
//!
//! Coverage comes from a pass of LLVM that every compiler of Rust has, so that a stable one is
//! enough; only libFuzzer itself, which counts the hits, is compiled by a C++ compiler. The targets
//! are built from the released code with overflow checks and debug assertions.
//!
//! Inputs with new coverage stay below cargo's target folder for the next call; `--minimise` puts
//! the few with the same coverage into the repository. There, the test `corpus` of `massline-fuzz`
//! repeats them without libFuzzer on every test run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::process::{self, StepError};

/// The targets, those of `massline_fuzz::TARGETS`.
pub const TARGETS: [&str; 7] = [
    "wire",
    "instrument",
    "setup",
    "recording",
    "inputs",
    "flash",
    "client",
];

/// Default time of each target, s.
pub const HOUR: u64 = 3600;
/// Time of each target as a step of `cargo xtask test`, s.
pub const STEP_SECONDS: u64 = 30;
/// Default number of targets at a time.
pub const JOBS: usize = 2;

/// Counters at every branch, a table of their places, and the operands of comparisons.
const COVERAGE: &str = "-Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// Longest input, bytes.
const LONGEST: usize = 16 << 10;
/// Seconds after which an input counts as a hang. Inputs take milliseconds, a hundred times longer
/// if targets share a processor.
const HANG: u32 = 60;
/// Limit of memory in MB; the largest target needs 40 MB.
const MEMORY: u32 = 512;

/// Most bytes, and most files, of a target's inputs in the repository.
const CORPUS: (u64, usize) = (60_000, 100);

/// Options of the command.
#[derive(Debug, PartialEq, Eq)]
pub struct Order {
    /// The targets to run; none means all.
    pub targets: Vec<&'static str>,
    /// Time of each target, s.
    pub seconds: u64,
    /// Number of targets at a time.
    pub jobs: usize,
    /// `true` to write the table in the documentation.
    pub table: bool,
    /// `true` to put inputs that were found into the repository.
    pub minimise: bool,
    /// An input to repeat with the one target.
    pub repeat: Option<PathBuf>,
}

/// Targets that have been built.
#[derive(Debug)]
pub struct Programs {
    /// The folder of this workspace.
    root: PathBuf,
    /// Folder of the programs.
    folder: PathBuf,
}

/// Result of a target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Name of the target.
    pub target: &'static str,
    /// Number of inputs.
    pub executions: u64,
    /// Places of the program that were reached.
    pub places: u64,
    /// Features: places by number and context of hits.
    pub features: u64,
    /// Time, s.
    pub seconds: u64,
    /// Number of inputs that made it fail.
    pub findings: u64,
    /// Path of the first of them, and its message.
    pub finding: Option<(PathBuf, String)>,
}

/// The reason why fuzzing is not possible here, if any.
#[must_use]
pub fn impossible() -> Option<String> {
    let compiler = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
    let found = process::answer(Command::new(&compiler).arg("--version"));
    found.is_err().then(|| {
        format!(
            "there is no C++ compiler ({}) for libFuzzer; the corpora were repeated by the tests",
            compiler.to_string_lossy()
        )
    })
}

/// Builds the targets by a command of cargo, in the workspace's folder.
///
/// # Errors
///
/// [`StepError`].
pub fn build(root: &Path, mut cargo: Command) -> Result<Programs, StepError> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let about = process::answer(Command::new(rustc).arg("-vV"))?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or(StepError::Missing {
        what: "the name of this machine",
        tried: about.clone(),
        remedy: "report it: rustc's messages have another form",
    })?;
    let target = root.join("target").join("fuzz");
    cargo
        .current_dir(root)
        // A named target keeps the flags away from build scripts and macros.
        .args(["build", "--profile", "fuzz", "--package", "massline-fuzz"])
        .args(["--features", "libfuzzer", "--bins", "--target", host])
        .arg("--target-dir")
        .arg(&target)
        .env("RUSTFLAGS", COVERAGE)
        .env_remove("CARGO_ENCODED_RUSTFLAGS");
    process::run(&mut cargo)?;
    Ok(Programs {
        root: root.to_owned(),
        folder: target.join(host).join("fuzz"),
    })
}

impl Programs {
    fn command(&self, target: &str) -> Command {
        let mut command = Command::new(self.folder.join(target));
        command
            .current_dir(&self.root)
            .arg(format!("-timeout={HANG}"))
            .arg(format!("-rss_limit_mb={MEMORY}"));
        command
    }

    /// Inputs of a target in the repository.
    fn committed(&self, target: &str) -> PathBuf {
        self.root.join("tests/fuzz/corpus").join(target)
    }

    fn folder(&self, kind: &str, target: &str) -> Result<PathBuf, StepError> {
        let folder = self.root.join("target/fuzz").join(kind).join(target);
        fs::create_dir_all(&folder).map_err(|error| StepError::file(&folder, error))?;
        Ok(folder)
    }

    /// Repeats an input.
    ///
    /// # Errors
    ///
    /// [`StepError::Exit`] with the target's message.
    pub fn repeat(&self, target: &str, input: &Path) -> Result<String, StepError> {
        // The path is relative to the user's folder.
        let input = fs::canonicalize(input).map_err(|error| StepError::file(input, error))?;
        process::run(self.command(target).arg(input))
    }

    /// Runs a target for some seconds, from the known inputs.
    ///
    /// # Errors
    ///
    /// [`StepError`] if it cannot be run, or is not guided by coverage. A finding is no error.
    pub fn run(&self, target: &'static str, seconds: u64) -> Result<Outcome, StepError> {
        let work = self.folder("corpus", target)?;
        let findings = self.folder("findings", target)?;
        let committed = self.committed(target);
        fs::create_dir_all(&committed).map_err(|error| StepError::file(&committed, error))?;
        let began = Instant::now();
        let mut command = self.command(target);
        command
            .arg(format!("-max_total_time={seconds}"))
            .arg(format!("-max_len={LONGEST}"))
            .arg("-print_final_stats=1")
            .arg(format!("-artifact_prefix={}/", findings.display()))
            .arg(&work)
            .arg(&committed);
        let dictionary = self.root.join(format!("tests/fuzz/words/{target}.dict"));
        if dictionary.is_file() {
            command.arg(format!("-dict={}", dictionary.display()));
        }
        let (output, finding) = match process::run(&mut command) {
            Ok(output) => (output, None),
            Err(error) => match &error {
                StepError::Exit { output, .. } => match finding(output) {
                    Some(finding) => (output.clone(), Some(finding)),
                    // The target did not start.
                    None => return Err(error),
                },
                _ => return Err(error),
            },
        };
        if !output.contains("inline 8-bit counters") {
            return Err(StepError::Missing {
                what: "coverage of the fuzz targets",
                tried: output,
                remedy: "report it with `rustc -vV`: its LLVM lacks the pass sancov-module",
            });
        }
        let (places, features) = coverage(&output);
        Ok(Outcome {
            target,
            executions: statistic(&output, "number_of_executed_units"),
            places,
            features,
            seconds: began.elapsed().as_secs(),
            findings: u64::from(finding.is_some()),
            finding,
        })
    }

    /// Runs targets, some at a time, and reports each outcome as it comes. Returns all in the order
    /// of `targets`.
    ///
    /// # Errors
    ///
    /// The first [`StepError`].
    pub fn run_all(
        &self,
        targets: &[&'static str],
        seconds: u64,
        jobs: usize,
        report: &(dyn Fn(&Outcome) + Sync),
    ) -> Result<Vec<Outcome>, StepError> {
        let left = Mutex::new(targets.iter().enumerate());
        let done = Mutex::new(Vec::new());
        let next = || left.lock().ok().and_then(|mut left| left.next());
        std::thread::scope(|scope| {
            for _ in 0..jobs.clamp(1, targets.len().max(1)) {
                scope.spawn(|| {
                    while let Some((number, target)) = next() {
                        let outcome = self.run(target, seconds);
                        if let Ok(outcome) = &outcome {
                            report(outcome);
                        }
                        if let Ok(mut done) = done.lock() {
                            done.push((number, outcome));
                        }
                    }
                });
            }
        });
        let mut done = done.into_inner().unwrap_or_default();
        done.sort_by_key(|(number, _)| *number);
        done.into_iter().map(|(_, outcome)| outcome).collect()
    }

    /// Puts inputs of a target into the repository, of those that together have the coverage of
    /// all: as many as there is room for, at random. Named inputs, which are past findings, stay.
    /// Returns a summary.
    ///
    /// # Errors
    ///
    /// [`StepError`].
    pub fn minimise(&self, target: &str) -> Result<String, StepError> {
        let work = self.folder("corpus", target)?;
        let least = self.folder("least", target)?;
        let committed = self.committed(target);
        for old in list(&least)? {
            fs::remove_file(&old).map_err(|error| StepError::file(&old, error))?;
        }
        let mut merge = self.command(target);
        process::run(
            merge
                .arg("-set_cover_merge=1")
                .arg(&least)
                .arg(&committed)
                .arg(&work),
        )?;
        let (mut sum, mut files) = (0, 0);
        for old in list(&committed)? {
            if is_named(&old) {
                let about = fs::metadata(&old).map_err(|error| StepError::file(&old, error))?;
                (sum, files) = (sum + about.len(), files + 1);
            } else {
                fs::remove_file(&old).map_err(|error| StepError::file(&old, error))?;
            }
        }
        // Their names are hashes, so that their order is random.
        let mut inputs = list(&least)?;
        inputs.sort();
        for input in &inputs {
            let bytes = fs::read(input).map_err(|error| StepError::file(input, error))?;
            let length = bytes.len() as u64;
            if sum + length <= CORPUS.0 && files < CORPUS.1 {
                (sum, files) = (sum + length, files + 1);
                let place = committed.join(input.file_name().unwrap_or_default());
                fs::write(&place, bytes).map_err(|error| StepError::file(&place, error))?;
            }
        }
        let of = inputs.len();
        Ok(format!("{target}: {files} of {of} inputs, {sum} bytes"))
    }
}

/// `true` if an input has a name other than libFuzzer's hashes.
fn is_named(input: &Path) -> bool {
    let name = input.file_name().unwrap_or_default().to_string_lossy();
    name.len() != 40 || !name.bytes().all(|b| b.is_ascii_hexdigit())
}

/// Files of a folder.
fn list(folder: &Path) -> Result<Vec<PathBuf>, StepError> {
    let entries = fs::read_dir(folder).and_then(|entries| {
        entries
            .map(|entry| Ok(entry?.path()))
            .collect::<Result<Vec<_>, _>>()
    });
    entries.map_err(|error| StepError::file(folder, error))
}

/// Numbers of places and features reached, from the last line that has them.
fn coverage(output: &str) -> (u64, u64) {
    let after = |line: &str, key: &str| -> Option<u64> {
        let (_, rest) = line.split_once(key)?;
        rest.split_whitespace().next()?.parse().ok()
    };
    let both = |line| Some((after(line, " cov: ")?, after(line, " ft: ")?));
    output.lines().rev().find_map(both).unwrap_or((0, 0))
}

/// A number of the statistics at the end, or of the last line before a finding.
fn statistic(output: &str, key: &str) -> u64 {
    let stated = output.lines().find_map(|line| {
        let (_, rest) = line.strip_prefix("stat::")?.split_once(':')?;
        line.contains(key).then(|| rest.trim().parse().ok())?
    });
    let counted = || {
        let number = |line: &str| {
            line.strip_prefix('#')?
                .split_whitespace()
                .next()?
                .parse()
                .ok()
        };
        output.lines().rev().find_map(number)
    };
    stated.or_else(counted).unwrap_or(0)
}

/// Path and message of the input that made the target fail, if any.
fn finding(output: &str) -> Option<(PathBuf, String)> {
    // Slow inputs that did not fail come before it.
    let written = output
        .lines()
        .rev()
        .find_map(|line| line.split_once("Test unit written to "));
    let place = PathBuf::from(written?.1.trim());
    let is_message = |line: &&str| {
        line.contains("panicked at")
            || line.contains("ERROR: libFuzzer")
            || line.contains("SUMMARY")
    };
    let mut words = String::new();
    let mut lines = output.lines();
    while let Some(line) = lines.next() {
        if is_message(&line) {
            words += line;
            words.push('\n');
            if line.contains("panicked at") {
                let reason = lines.next().unwrap_or_default();
                words.extend(reason.chars().take(2000));
                words.push('\n');
            }
        }
    }
    Some((place, words))
}

/// Outcomes as a table.
#[must_use]
pub fn table(outcomes: &[Outcome]) -> String {
    let mut text = "| target | executions | places reached | features | seconds | findings |\n\
                    | --- | ---: | ---: | ---: | ---: | ---: |"
        .to_owned();
    for outcome in outcomes {
        let Outcome {
            target,
            executions,
            places,
            features,
            seconds,
            findings,
            ..
        } = outcome;
        text += &format!(
            "\n| {target} | {} | {places} | {features} | {seconds} | {findings} |",
            grouped(*executions)
        );
    }
    text
}

/// Message about outcomes with findings, with the commands to repeat them; empty without findings.
#[must_use]
pub fn findings(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    for outcome in outcomes {
        if let Some((place, words)) = &outcome.finding {
            let (target, place) = (outcome.target, place.display());
            text += &format!(
                "\nfinding of {target}: {place}\n{words}again: cargo xtask fuzz {target} --repeat \
                 {place}\n"
            );
        }
    }
    text
}

/// A number with commas between its thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A sum for the report of `cargo xtask test`.
#[must_use]
pub fn sum(outcomes: &[Outcome], took: Duration) -> String {
    let executions = outcomes.iter().map(|outcome| outcome.executions).sum();
    format!(
        "{} inputs to {} targets in {} s",
        grouped(executions),
        outcomes.len(),
        took.as_secs()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "\
INFO: Loaded 1 modules   (17433 inline 8-bit counters): 17433 [0x1, 0x2),
#2	INITED cov: 30 ft: 31 corp: 1/1b exec/s: 0 rss: 27Mb
#8104	NEW    cov: 2619 ft: 6493 corp: 392/463Kb lim: 1790 exec/s: 506 rss: 31Mb
thread '<unnamed>' (9812) panicked at src/a.rs:135:9:
Taken too much
==9812== ERROR: libFuzzer: deadly signal
artifact_prefix='x/'; Test unit written to x/crash-12
stat::number_of_executed_units: 8110
stat::average_exec_per_sec:     506
";

    #[test]
    fn reads_the_output_of_libfuzzer() {
        assert_eq!(coverage(OUTPUT), (2619, 6493));
        assert_eq!(statistic(OUTPUT, "number_of_executed_units"), 8110);
        let (cut, _) = OUTPUT.split_once("stat::").unwrap();
        assert_eq!(statistic(cut, "number_of_executed_units"), 8104);
        let (place, words) = finding(OUTPUT).unwrap();
        assert_eq!(place, Path::new("x/crash-12"));
        assert!(
            words.contains("src/a.rs:135:9:\nTaken too much\n"),
            "{words}"
        );
        assert_eq!((coverage(""), statistic("", "x")), ((0, 0), 0));
        assert_eq!(finding("INFO: no such folder"), None);
    }

    #[test]
    fn a_table_has_a_row_a_target() {
        let outcome = Outcome {
            target: "wire",
            executions: 1_234_567,
            places: 2,
            features: 3,
            seconds: 60,
            findings: 1,
            finding: Some(("x/crash".into(), "why\n".to_owned())),
        };
        let text = table(std::slice::from_ref(&outcome));
        assert!(
            text.ends_with("| wire | 1,234,567 | 2 | 3 | 60 | 1 |"),
            "{text}"
        );
        let text = findings(&[outcome]);
        assert!(
            text.contains("cargo xtask fuzz wire --repeat x/crash"),
            "{text}"
        );
        assert_eq!([7, 1000, 999_999].map(grouped), ["7", "1,000", "999,999"]);
    }

    #[test]
    fn findings_have_names() {
        assert!(is_named(Path::new("a/full-of-another-programs-bytes")));
        let hash = "da39a3ee5e6b4b0d3255bfef95601890afd80709";
        assert!(!is_named(&Path::new("a").join(hash)));
    }

    #[test]
    fn every_target_has_its_program() {
        let programs = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/src/bin");
        let mut found: Vec<String> = list(&programs)
            .unwrap()
            .iter()
            .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
            .collect();
        let mut known = TARGETS.map(str::to_owned);
        found.sort();
        known.sort();
        assert_eq!(found, known);
    }
}

//! `cargo xtask fuzz`: has libFuzzer look for inputs that break the targets of `tests/fuzz`.
//!
//! # Design
//!
//! Coverage comes from a pass of LLVM that every compiler of Rust has, so that a stable one
//! will do; only what counts the hits, libFuzzer itself, is compiled by a C++ compiler. The
//! targets' code is what ships, with overflow checks and debug assertions on top.
//!
//! Inputs that reach something new stay below cargo's target folder and are taken up by the next
//! call; `--minimise` puts the few of them into the repository that reach the same. There, the
//! test `corpus` of `massline-fuzz` repeats them without libFuzzer on every test run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::process::{self, StepError};

/// The targets, as `massline_fuzz::TARGETS` has them.
pub const TARGETS: [&str; 7] = [
    "wire",
    "instrument",
    "setup",
    "recording",
    "inputs",
    "flash",
    "client",
];

/// Seconds that each target runs for where none are asked for.
pub const HOUR: u64 = 3600;
/// Seconds that each target runs for as a step of `cargo xtask test`.
pub const STEP_SECONDS: u64 = 30;
/// Targets that run at the same time.
pub const JOBS: usize = 2;

/// Counters at every branch, a table of their places, and the operands of comparisons.
const COVERAGE: &str = "-Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// Longest input, bytes.
const LONGEST: usize = 16 << 10;
/// Seconds after which an input counts as one that hangs: all of them take milliseconds, and
/// those of targets that share a processor a hundred times that.
const HANG: u32 = 60;
/// Megabytes of memory: the largest needs forty.
const MEMORY: u32 = 512;

/// Most bytes, and most files, of a target's inputs in the repository.
const CORPUS: (u64, usize) = (60_000, 100);

/// What is asked for.
#[derive(Debug, PartialEq, Eq)]
pub struct Order {
    /// The targets; none means all.
    pub targets: Vec<&'static str>,
    /// Seconds for each.
    pub seconds: u64,
    /// Targets that run at the same time.
    pub jobs: usize,
    /// Whether the table in the documentation is written anew.
    pub table: bool,
    /// Whether inputs that were found are put into the repository.
    pub minimise: bool,
    /// An input that is to be repeated, by the one target that is named.
    pub repeat: Option<PathBuf>,
}

/// Targets that are built.
#[derive(Debug)]
pub struct Programs {
    /// The folder of this workspace.
    root: PathBuf,
    /// Where they are.
    folder: PathBuf,
}

/// What has become of a target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Its name.
    pub target: &'static str,
    /// Inputs that it was given.
    pub executions: u64,
    /// Places of the program that were reached.
    pub places: u64,
    /// The same by how often, and in which company.
    pub features: u64,
    /// How long it ran.
    pub seconds: u64,
    /// Inputs that broke a promise.
    pub findings: u64,
    /// Where the first of them is, and what was said of it.
    pub finding: Option<(PathBuf, String)>,
}

/// Says why there can be no fuzzing here, if so.
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

/// Builds the targets by a command that is cargo's, in the workspace's folder.
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
        remedy: "report it: rustc's words are not what they used to be",
    })?;
    let target = root.join("target").join("fuzz");
    cargo
        .current_dir(root)
        // With a target named, what runs while things are built is left as it is.
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
        fs::create_dir_all(&folder).map_err(|error| unusable(&folder, &error))?;
        Ok(folder)
    }

    /// Repeats an input.
    ///
    /// # Errors
    ///
    /// [`StepError::Exit`] with what the target says of it.
    pub fn repeat(&self, target: &str, input: &Path) -> Result<String, StepError> {
        // It is named from where the user is.
        let input = fs::canonicalize(input).map_err(|error| unusable(input, &error))?;
        process::run(self.command(target).arg(input))
    }

    /// Runs a target for some seconds, from the inputs there are.
    ///
    /// # Errors
    ///
    /// [`StepError`] if it cannot be run, or is not guided by coverage. A finding is none.
    pub fn run(&self, target: &'static str, seconds: u64) -> Result<Outcome, StepError> {
        let work = self.folder("corpus", target)?;
        let findings = self.folder("findings", target)?;
        let committed = self.committed(target);
        fs::create_dir_all(&committed).map_err(|error| unusable(&committed, &error))?;
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
                    // It could not even begin.
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

    /// Runs targets, some at a time, and tells each outcome as it comes. They come back in the
    /// order asked for.
    ///
    /// # Errors
    ///
    /// The first [`StepError`] of any.
    pub fn run_all(
        &self,
        targets: &[&'static str],
        seconds: u64,
        jobs: usize,
        tell: &(dyn Fn(&Outcome) + Sync),
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
                            tell(outcome);
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

    /// Puts inputs of a target into the repository, of those that together reach what all do:
    /// as many as there is room for, small and large ones as chance has it. Those with a name,
    /// which are past findings, stay. Says how many.
    ///
    /// # Errors
    ///
    /// [`StepError`].
    pub fn minimise(&self, target: &str) -> Result<String, StepError> {
        let work = self.folder("corpus", target)?;
        let least = self.folder("least", target)?;
        let committed = self.committed(target);
        for old in list(&least)? {
            fs::remove_file(&old).map_err(|error| unusable(&old, &error))?;
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
                let about = fs::metadata(&old).map_err(|error| unusable(&old, &error))?;
                (sum, files) = (sum + about.len(), files + 1);
            } else {
                fs::remove_file(&old).map_err(|error| unusable(&old, &error))?;
            }
        }
        // Their names are hashes, so that their order is chance.
        let mut inputs = list(&least)?;
        inputs.sort();
        for input in &inputs {
            let bytes = fs::read(input).map_err(|error| unusable(input, &error))?;
            let length = bytes.len() as u64;
            if sum + length <= CORPUS.0 && files < CORPUS.1 {
                (sum, files) = (sum + length, files + 1);
                let place = committed.join(input.file_name().unwrap_or_default());
                fs::write(&place, bytes).map_err(|error| unusable(&place, &error))?;
            }
        }
        let of = inputs.len();
        Ok(format!("{target}: {files} of {of} inputs, {sum} bytes"))
    }
}

/// Whether somebody has given an input its name: libFuzzer's are hashes.
fn is_named(input: &Path) -> bool {
    let name = input.file_name().unwrap_or_default().to_string_lossy();
    name.len() != 40 || !name.bytes().all(|b| b.is_ascii_hexdigit())
}

fn unusable(path: &Path, error: &std::io::Error) -> StepError {
    StepError::File {
        path: path.display().to_string(),
        problem: error.to_string(),
    }
}

/// Files of a folder.
fn list(folder: &Path) -> Result<Vec<PathBuf>, StepError> {
    let entries = fs::read_dir(folder).and_then(|entries| {
        entries
            .map(|entry| Ok(entry?.path()))
            .collect::<Result<Vec<_>, _>>()
    });
    entries.map_err(|error| unusable(folder, &error))
}

/// Places and features that were reached, as the last line says that has them.
fn coverage(output: &str) -> (u64, u64) {
    let after = |line: &str, key: &str| -> Option<u64> {
        let (_, rest) = line.split_once(key)?;
        rest.split_whitespace().next()?.parse().ok()
    };
    let both = |line| Some((after(line, " cov: ")?, after(line, " ft: ")?));
    output.lines().rev().find_map(both).unwrap_or((0, 0))
}

/// A number of the statistics at the end, or of the last line where a finding has ended it.
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

/// Where the input is that broke a promise, and what was said of it; `None` if there is none.
fn finding(output: &str) -> Option<(PathBuf, String)> {
    // Slow ones that broke none come before it.
    let written = output
        .lines()
        .rev()
        .find_map(|line| line.split_once("Test unit written to "));
    let place = PathBuf::from(written?.1.trim());
    let said = |line: &&str| {
        line.contains("panicked at")
            || line.contains("ERROR: libFuzzer")
            || line.contains("SUMMARY")
    };
    let mut words = String::new();
    let mut lines = output.lines();
    while let Some(line) = lines.next() {
        if said(&line) {
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

/// What to tell of outcomes with findings, and how to see them again; nothing if there are none.
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
    fn reads_what_libfuzzer_says() {
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
        let told = findings(&[outcome]);
        assert!(
            told.contains("cargo xtask fuzz wire --repeat x/crash"),
            "{told}"
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

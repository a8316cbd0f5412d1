//! Other programs, their output and their failures.

use std::fmt;
use std::io::{self, Read};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread;

/// Error of a step.
#[derive(Debug)]
pub enum StepError {
    /// A program could not be started.
    Start {
        /// The command line.
        command: String,
        /// The system's error.
        source: io::Error,
    },
    /// A program ended with an error.
    Exit {
        /// The command line.
        command: String,
        /// The exit status.
        status: ExitStatus,
        /// The whole output.
        output: String,
    },
    /// The output of a program has another form than expected.
    Answer {
        /// The command line.
        command: String,
        /// The expected output.
        expected: &'static str,
    },
    /// A tool is missing and could not be installed.
    Missing {
        /// The tool.
        what: &'static str,
        /// The attempts and their results.
        tried: String,
        /// Steps to install it by hand.
        remedy: &'static str,
    },
    /// Inputs were found that make a target fail.
    Finding(String),
    /// A file that a step made is not valid.
    File {
        /// The file.
        path: String,
        /// The error of the file.
        problem: String,
    },
}

impl StepError {
    /// Error of a file.
    pub fn file(path: &Path, problem: impl fmt::Display) -> Self {
        Self::File {
            path: path.display().to_string(),
            problem: problem.to_string(),
        }
    }

    /// Remedy of this error, if it is better known than that of the step.
    pub fn remedy(&self) -> Option<&'static str> {
        match self {
            Self::Missing { remedy, .. } => Some(remedy),
            Self::Finding(_) => Some(
                "mend what it shows, and copy its input into the target's folder of \
                 tests/fuzz/corpus, where every test run repeats it",
            ),
            _ => None,
        }
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start { command, source } => write!(f, "{command}\ncannot be started: {source}"),
            Self::Exit {
                command,
                status,
                output,
            } => write!(f, "{command}\n{}\n{status}", output.trim_end()),
            Self::Answer { command, expected } => {
                write!(f, "{command}\nsucceeded without printing {expected}")
            }
            Self::Missing { what, tried, .. } => {
                write!(f, "{what} is missing\n{}", tried.trim_end())
            }
            Self::Finding(text) => f.write_str(text.trim()),
            Self::File { path, problem } => write!(f, "{path}: {problem}"),
        }
    }
}

impl std::error::Error for StepError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Start { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// Runs a program to its end and returns its output, from both streams in order.
///
/// # Errors
///
/// [`StepError::Start`] and [`StepError::Exit`].
pub fn run(command: &mut Command) -> Result<String, StepError> {
    let start = |command: &Command, source| StepError::Start {
        command: describe(command),
        source,
    };
    // One pipe for both outputs keeps an error next to the lines that explain it.
    let (mut reader, writer) = io::pipe().map_err(|source| start(command, source))?;
    let twin = writer
        .try_clone()
        .map_err(|source| start(command, source))?;
    let spawned = command
        .stdin(Stdio::null())
        .stdout(writer)
        .stderr(twin)
        .spawn();
    // The command holds the write ends of the pipe; reading ends only after they are closed.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = spawned.map_err(|source| start(command, source))?;
    let mut output = Vec::new();
    let read = reader.read_to_end(&mut output);
    let status = child.wait().map_err(|source| start(command, source))?;
    read.map_err(|source| start(command, source))?;
    finish(command, status, output)
}

/// Runs several programs beside each other to their ends and returns their outputs, one after the other.
///
/// # Errors
///
/// That of [`run`] for the first one that fails, which then holds the errors of the others, too.
pub fn run_together(commands: &mut [Command]) -> Result<String, StepError> {
    let ended: Vec<Result<String, StepError>> = thread::scope(|scope| {
        let running: Vec<_> = commands
            .iter_mut()
            .map(|command| scope.spawn(|| run(command)))
            .collect();
        let all = running.into_iter().map(|one| one.join());
        all.map(|one| one.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    let mut together = String::new();
    let mut failed: Option<StepError> = None;
    for one in ended {
        match (one, &mut failed) {
            (Ok(output), _) => together.push_str(&output),
            (Err(error), Some(StepError::Exit { output, .. })) => {
                output.push_str(&format!("\n{error}"));
            }
            (Err(error), failed) => *failed = Some(error),
        }
    }
    failed.map_or(Ok(together), Err)
}

/// Runs a program to its end and returns its standard output.
///
/// # Errors
///
/// [`StepError::Start`] and [`StepError::Exit`], which then holds its standard error.
pub fn answer(command: &mut Command) -> Result<String, StepError> {
    let output = command
        .stdin(Stdio::null())
        .output()
        .map_err(|source| StepError::Start {
            command: describe(command),
            source,
        })?;
    let text = if output.status.success() {
        output.stdout
    } else {
        output.stderr
    };
    finish(command, output.status, text)
}

/// Runs a program to its end, with the streams of this program.
///
/// # Errors
///
/// [`StepError::Start`], and [`StepError::Exit`] without the output, which was shown already.
pub fn show(command: &mut Command) -> Result<(), StepError> {
    let status = command.status().map_err(|source| StepError::Start {
        command: describe(command),
        source,
    })?;
    finish(command, status, Vec::new()).map(drop)
}

fn finish(command: &Command, status: ExitStatus, output: Vec<u8>) -> Result<String, StepError> {
    let output = String::from_utf8_lossy(&output).into_owned();
    if status.success() {
        Ok(output)
    } else {
        Err(StepError::Exit {
            command: describe(command),
            status,
            output,
        })
    }
}

/// A command line to copy into a shell, with the relevant variables.
fn describe(command: &Command) -> String {
    let mut line = String::from("$");
    for (name, value) in command.get_envs() {
        if let Some(value) = value.filter(|_| name != "CARGO_TERM_COLOR") {
            line += &format!(" {}={}", name.display(), quoted(&value.to_string_lossy()));
        }
    }
    line += &format!(" {}", quoted(&command.get_program().to_string_lossy()));
    for argument in command.get_args() {
        line += &format!(" {}", quoted(&argument.to_string_lossy()));
    }
    line
}

/// A word, quoted for a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn keeps_both_outputs_in_order() {
        let output = run(&mut shell("echo one; echo two >&2; echo three")).unwrap();
        assert_eq!(output, "one\ntwo\nthree\n");
    }

    #[test]
    fn an_answer_is_only_the_standard_output() {
        assert_eq!(
            answer(&mut shell("echo noise >&2; echo answer")).unwrap(),
            "answer\n"
        );
    }

    #[test]
    fn a_failure_shows_the_command_its_output_and_its_end() {
        let error = run(shell("echo bad >&2; exit 3").env("RUSTDOCFLAGS", "-D warnings"))
            .unwrap_err()
            .to_string();
        assert_eq!(
            error,
            "$ RUSTDOCFLAGS='-D warnings' sh -c 'echo bad >&2; exit 3'\nbad\nexit status: 3"
        );
    }

    #[test]
    fn programs_beside_each_other_are_all_heard() {
        let mut good = [shell("echo one"), shell("sleep 0.1; echo two")];
        assert_eq!(run_together(&mut good).unwrap(), "one\ntwo\n");
        let mut bad = [
            shell("echo one; exit 3"),
            shell("echo two"),
            shell("echo three; exit 4"),
        ];
        let error = run_together(&mut bad).unwrap_err().to_string();
        for word in ["\none\n", "exit status: 3", "\nthree\n", "exit status: 4"] {
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn a_missing_program_is_named() {
        let error = run(&mut Command::new("no-such-program")).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("$ no-such-program\ncannot be started")
        );
    }
}

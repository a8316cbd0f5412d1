//! Output on the terminal: one line a step, more only for a failure.

use std::env;
use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use super::process::StepError;
use super::steps::Step;

/// Style of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// With colours.
    pub colour: bool,
    /// On a terminal, where a line can be rewritten.
    pub live: bool,
}

impl Style {
    /// The style for the standard output, with respect to `NO_COLOR`.
    pub fn of_stdout() -> Self {
        let set = |name| env::var_os(name).is_some_and(|value| !value.is_empty());
        let dumb = env::var_os("TERM").is_some_and(|term| term == "dumb");
        let live = io::stdout().is_terminal() && !dumb;
        Self {
            live,
            colour: live && !set("NO_COLOR"),
        }
    }
}

/// Result of a step.
#[derive(Debug)]
pub enum Ending {
    /// Success, with a remark.
    Passed(String),
    /// Not possible here, or without purpose, for this reason.
    Skipped(String),
    /// Failure.
    Failed(StepError),
}

/// Shows and counts the results of steps.
#[derive(Debug)]
pub struct Report<W> {
    out: W,
    style: Style,
    passed: usize,
    skipped: Vec<&'static str>,
    failed: Vec<&'static str>,
}

impl<W: Write> Report<W> {
    /// An empty report.
    pub fn new(out: W, style: Style) -> Self {
        Self {
            out,
            style,
            passed: 0,
            skipped: Vec::new(),
            failed: Vec::new(),
        }
    }

    /// Shows a text as it is.
    pub fn text(&mut self, text: &str) {
        self.show(format_args!("{}\n", text.trim_end()));
    }

    /// Shows a list of steps.
    pub fn list(&mut self, steps: &[Step]) {
        for step in steps {
            self.show(format_args!("{:<16}{}\n", step.name, step.about));
        }
    }

    /// Shows the beginning of a step.
    pub fn begin(&mut self, step: &Step) {
        if self.style.live {
            self.show(format_args!("{:<16}{} ...", step.name, step.about));
        }
    }

    /// Shows and counts the result of a step.
    pub fn end(&mut self, step: &'static Step, ending: &Ending, took: Duration) {
        let (status, colour, note) = match ending {
            Ending::Passed(note) => ("ok", "32", note.as_str()),
            Ending::Skipped(reason) => ("skipped", "33", reason.as_str()),
            Ending::Failed(_) => ("FAILED", "31", ""),
        };
        let rewind = if self.style.live { "\r\x1b[2K" } else { "" };
        let (on, off) = match self.style.colour {
            true => (format!("\x1b[{colour}m"), "\x1b[0m"),
            false => (String::new(), ""),
        };
        let line = format!(
            "{rewind}{:<16}{on}{status:<7}{off}{:>7.1} s  {note}",
            step.name,
            took.as_secs_f64()
        );
        self.show(format_args!("{}\n", line.trim_end()));
        match ending {
            Ending::Passed(_) => self.passed += 1,
            Ending::Skipped(_) => self.skipped.push(step.name),
            Ending::Failed(error) => {
                self.failed.push(step.name);
                let remedy = error.remedy().unwrap_or(step.remedy);
                self.show(format_args!(
                    "\n{error}\n\nstep {} failed. Remedy: {remedy}.\n\n",
                    step.name
                ));
            }
        }
    }

    /// Shows a summary. `true` if no step failed.
    pub fn summary(&mut self, took: Duration) -> bool {
        let mut line = format!("{} passed", self.passed);
        for (word, names) in [("skipped", &self.skipped), ("FAILED", &self.failed)] {
            if !names.is_empty() {
                line += &format!(", {} {word} ({})", names.len(), names.join(", "));
            }
        }
        self.show(format_args!("\n{line} in {:.0} s\n", took.as_secs_f64()));
        if !self.failed.is_empty() {
            let again: String = self
                .failed
                .iter()
                .map(|name| format!(" --only {name}"))
                .collect();
            self.show(format_args!("again: cargo xtask test{again}\n"));
        }
        self.failed.is_empty()
    }

    /// Writes a text; a closed pipe (`| head`) does not stop the tests.
    fn show(&mut self, text: std::fmt::Arguments<'_>) {
        let _ = self.out.write_fmt(text).and_then(|()| self.out.flush());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xtask::steps;

    const PLAIN: Style = Style {
        colour: false,
        live: false,
    };

    fn shown(style: Style, ending: &Ending) -> (String, bool) {
        let step = steps::find("lints").unwrap();
        let mut out = Vec::new();
        let mut report = Report::new(&mut out, style);
        report.begin(step);
        report.end(step, ending, Duration::from_millis(1234));
        let passed = report.summary(Duration::from_secs(2));
        (String::from_utf8(out).unwrap(), passed)
    }

    #[test]
    fn success_is_one_line_and_a_sum() {
        let (text, passed) = shown(PLAIN, &Ending::Passed("3 crates".into()));
        assert!(passed);
        assert_eq!(
            text,
            "lints           ok         1.2 s  3 crates\n\n1 passed in 2 s\n"
        );
    }

    #[test]
    fn failure_shows_the_reason_the_step_and_what_to_do() {
        let error = StepError::File {
            path: "a.rs".into(),
            problem: "line 3 is bad".into(),
        };
        let (text, passed) = shown(PLAIN, &Ending::Failed(error));
        assert!(!passed);
        for part in [
            "lints           FAILED     1.2 s\n",
            "a.rs: line 3 is bad\n",
            "step lints failed. Remedy: ",
            "0 passed, 1 FAILED (lints) in 2 s\n",
            "again: cargo xtask test --only lints\n",
        ] {
            assert!(text.contains(part), "{part:?} is not in {text:?}");
        }
        assert!(!text.contains('\x1b'));
    }

    #[test]
    fn a_skipped_step_is_no_failure_and_is_reported() {
        let (text, passed) = shown(PLAIN, &Ending::Skipped("no clippy".into()));
        assert!(passed);
        assert!(text.contains("0 passed, 1 skipped (lints)"), "{text}");
    }

    #[test]
    fn colours_only_where_wanted() {
        let live = Style {
            colour: false,
            live: true,
        };
        let (text, _) = shown(live, &Ending::Passed(String::new()));
        assert!(text.contains("\r\x1b[2K") && !text.contains("\x1b[32m"));
        let colour = Style {
            colour: true,
            live: true,
        };
        let (text, _) = shown(colour, &Ending::Passed(String::new()));
        assert!(text.contains("\x1b[32mok     \x1b[0m"));
    }
}

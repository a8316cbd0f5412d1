//! Progress on stderr, on a terminal only.

use super::Failure;
use crate::identification::OnProgress;
use crate::measure::Work;
use crate::printable::printable;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Amount of progress and warnings on stderr.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct Verbosity {
    /// No progress and no warnings
    #[arg(long, short, global = true, display_order = 900)]
    pub quiet: bool,
    /// More about what was done
    #[arg(
        long,
        short,
        global = true,
        display_order = 901,
        conflicts_with = "quiet"
    )]
    pub verbose: bool,
}

/// A progress bar headed `prefix`; invisible if quiet or stderr is no terminal.
fn begin(
    steps: Option<u64>,
    template: &str,
    prefix: &'static str,
    verbosity: Verbosity,
) -> ProgressBar {
    let target = if verbosity.quiet {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr()
    };
    let bar = ProgressBar::with_draw_target(steps, target);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(prefix);
    bar
}

/// A bar from 0 to 1 with a word on what is being done.
pub struct Bar {
    bar: ProgressBar,
}

/// Steps of a bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

impl Bar {
    /// A bar headed `verb`; invisible if quiet or stderr is no terminal.
    #[must_use]
    pub fn new(verb: &'static str, verbosity: Verbosity) -> Self {
        let template = "{prefix:>12} {bar:30} {percent:>3} %  {wide_msg}";
        let bar = begin(Some(STEPS), template, verb, verbosity);
        Self { bar }
    }

    /// From now on it is about something else.
    pub fn head(&self, verb: &'static str) {
        self.bar.set_prefix(verb);
    }

    /// `share` of the whole, 0 to 1, is done; now it is about `what`.
    pub fn set(&self, share: f64, what: &str) {
        self.bar
            .set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
        self.bar.set_message(printable(what).into_owned());
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Something turns while it is not known how long it takes.
pub struct Spinner {
    bar: ProgressBar,
}

impl Spinner {
    /// A spinner that says `what`; invisible if quiet or stderr is no terminal.
    #[must_use]
    pub fn new(what: &'static str, verbosity: Verbosity) -> Self {
        let bar = begin(None, "{prefix:>12} {spinner} {elapsed}", what, verbosity);
        bar.enable_steady_tick(std::time::Duration::from_millis(100));
        Self { bar }
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A line that tells how it is while it is not known how long it takes.
pub struct Ticker {
    bar: ProgressBar,
}

impl Ticker {
    /// A line headed `verb`; invisible if quiet or stderr is no terminal.
    #[must_use]
    pub fn new(verb: &'static str, verbosity: Verbosity) -> Self {
        let bar = begin(None, "{prefix:>12} {wide_msg}", verb, verbosity);
        Self { bar }
    }

    /// Says something that stays, on stderr.
    pub fn say(&self, text: &str, verbosity: Verbosity) {
        self.bar
            .suspend(|| super::warn(&[text.to_owned()], verbosity));
    }

    /// Tells.
    pub fn set(&self, text: &str) {
        self.bar.set_message(printable(text).into_owned());
    }
}

impl Drop for Ticker {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Does something that reads recordings and may fit their lines, with a bar on the terminal meanwhile.
pub(super) fn reading<T>(
    verbosity: Verbosity,
    work: impl FnOnce(OnProgress<'_>) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let bar = Bar::new("reading", verbosity);
    work(&mut |p| {
        bar.head(match p.work {
            Work::Reading => "reading",
            Work::Fitting => "fitting",
        });
        bar.set((p.run as f64 + p.share) / p.runs as f64, p.name);
    })
}

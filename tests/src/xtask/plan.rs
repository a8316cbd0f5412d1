//! Selection and run of steps.

use std::io::Write;
use std::time::Instant;

use super::report::{Ending, Report};
use super::steps::{self, Context, Step};

/// The steps of `only` and all that they need, in order; all steps if `only` is empty.
pub fn select(only: &[&'static Step]) -> Vec<&'static Step> {
    let wanted = |step: &Step| only.is_empty() || only.iter().any(|other| other.needs_also(step));
    steps::STEPS.iter().filter(|step| wanted(step)).collect()
}

/// Runs steps in order, past failures. `true` if none failed.
pub fn run<W: Write>(
    steps: &[&'static Step],
    context: &mut Context,
    report: &mut Report<W>,
) -> bool {
    let begin = Instant::now();
    let mut undone: Vec<&'static str> = Vec::new();
    for &step in steps {
        let begin = Instant::now();
        report.begin(step);
        let ending = match step.needs.iter().find(|need| undone.contains(need)) {
            Some(need) => Ending::Skipped(format!("{need} is needed for it")),
            None => (step.run)(context).unwrap_or_else(Ending::Failed),
        };
        if !matches!(ending, Ending::Passed(_)) {
            undone.push(step.name);
        }
        report.end(step, &ending, begin.elapsed());
    }
    report.summary(begin.elapsed())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(only: &[&str]) -> Vec<&'static str> {
        let only: Vec<_> = only.iter().map(|name| steps::find(name).unwrap()).collect();
        select(&only).iter().map(|step| step.name).collect()
    }

    #[test]
    fn needed_steps_are_selected_and_come_first() {
        assert_eq!(names(&["format"]), ["format"]);
        assert_eq!(
            names(&["emulator"]),
            ["toolchain", "qemu", "firmware", "emulator"]
        );
        assert_eq!(
            names(&["firmware", "format"]),
            ["toolchain", "format", "firmware"]
        );
        assert_eq!(names(&[]).len(), steps::STEPS.len());
    }

    #[test]
    fn every_need_is_an_earlier_step() {
        for (n, step) in steps::STEPS.iter().enumerate() {
            for need in step.needs {
                assert!(
                    steps::STEPS[..n].iter().any(|other| other.name == *need),
                    "{} needs {need}",
                    step.name
                );
            }
        }
    }
}

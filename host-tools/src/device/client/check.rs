//! What a box says, held against what can be.
//!
//! A reply that gets here has come whole; it may still say what no box can mean, because the box
//! is broken or is none. Everything behind the client may then rely on it: sums of counts do not
//! overflow, rates divide, times have an end.

use super::ClientError;
use crate::limits;
use massline_core::calibration::Certificate;
use massline_core::wire::{
    Answer, Estimate, Identified, Info, Reply, Running, Setting, Status, Summary,
};

/// Checks a reply to the request of this number.
pub(super) fn reply(request: u8, reply: &Reply<'_>) -> Result<(), ClientError> {
    let wrong = match reply {
        Reply::Info(found) => info(found),
        Reply::Status(found) => status(found),
        Reply::Summary(found) => summary(found),
        Reply::Setting(found) => setting(found),
        Reply::Identified(found) => identified(found),
        Reply::Peaks(found) => each("a survey's peak", found.peaks.iter(), |x| x >= 0.0, NOT_BELOW),
        Reply::Weights(found) => {
            let within = |x| (0.0..=1.0).contains(&x);
            each("a weight", found.weights.iter(), within, "0 to 1")
        }
        _ => Ok(()),
    };
    wrong.map_err(|Wrong(what, found, expected)| ClientError::Limit {
        request,
        what,
        found,
        expected,
    })
}

/// What is wrong: its name, the value, and what had been right.
struct Wrong(&'static str, String, String);

const NOT_BELOW: &str = "0 or more";

fn at_most<T: Copy + PartialOrd + std::fmt::Display>(
    what: &'static str,
    found: T,
    limit: T,
) -> Result<(), Wrong> {
    if found <= limit {
        return Ok(());
    }
    Err(Wrong(what, found.to_string(), format!("at most {limit}")))
}

fn each(
    what: &'static str,
    mut numbers: impl Iterator<Item = f64>,
    right: impl Fn(f64) -> bool,
    expected: &str,
) -> Result<(), Wrong> {
    match numbers.find(|&x| !(x.is_finite() && right(x))) {
        None => Ok(()),
        Some(found) => Err(Wrong(what, found.to_string(), expected.to_owned())),
    }
}

fn info(info: &Info<'_>) -> Result<(), Wrong> {
    // Stored runs are the bits of a number in its status.
    let runs = u32::from(info.capacity.runs);
    at_most("a number of runs that fit", runs, u32::BITS)
}

fn status(status: &Status) -> Result<(), Wrong> {
    match &status.running {
        Some(running) => run(running),
        None => Ok(()),
    }
}

fn run(running: &Running) -> Result<(), Wrong> {
    at_most("a number of a run", u32::from(running.run) + 1, u32::BITS)?;
    at_most("a number of a sample", running.next, limits::LAST_SAMPLE)?;
    at_most("a number of blocks", running.blocks, limits::BLOCKS)
}

fn summary(summary: &Summary) -> Result<(), Wrong> {
    for count in [summary.samples, summary.missing, summary.overloads] {
        at_most("a number of samples", count, limits::LAST_SAMPLE)?;
    }
    let counts = [summary.blocks, summary.rejected];
    for count in counts.into_iter().chain(summary.rejected_by) {
        at_most("a number of blocks", count, limits::BLOCKS)?;
    }
    let rate = summary.sample_rate.iter().map(|rate| rate.0);
    each("a true sample rate", rate, |x| x > 0.0, "more than 0 Hz")
}

fn setting(setting: &Setting<'_>) -> Result<(), Wrong> {
    match setting {
        Setting::SampleRate(rate) => {
            let rates = limits::SAMPLE_RATES;
            let expected = format!("{} to {} Hz", rates.start(), rates.end());
            let rate = std::iter::once(*rate);
            each("a sample rate", rate, |x| rates.contains(&x), &expected)
        }
        Setting::Input(input) => match Certificate::new(input) {
            Ok(_) => Ok(()),
            Err(problem) => Err(Wrong(
                "a calibration",
                problem.to_string(),
                "one that a box can have".to_owned(),
            )),
        },
        Setting::Name(_) | Setting::LinkBaud(_) => Ok(()),
    }
}

fn identified(identified: &Identified) -> Result<(), Wrong> {
    let answer = &identified.answer;
    let quality = &answer.quality;
    for count in [quality.blocks, quality.rejected] {
        at_most("a number of blocks", count, limits::BLOCKS)?;
    }
    at_most("a number of samples", quality.missing, limits::LAST_SAMPLE)?;
    let estimates = || estimates(answer).into_iter().flatten();
    let any = |_| true;
    let values = estimates().map(|e| e.value.0);
    each("an identified value", values, any, "a number")?;
    let errors = estimates().map(|e| e.std.0);
    each("a standard deviation", errors, |x| x >= 0.0, NOT_BELOW)?;
    let principal = answer.principal.iter();
    let principal = principal.flat_map(|p| p.axes.iter().flatten().chain(&p.moments));
    let points = answer.reference.iter().chain(principal).map(|x| x.0);
    each("a coordinate or moment", points, any, "a number")
}

fn estimates(answer: &Answer) -> impl IntoIterator<Item = Option<Estimate>> {
    let own = [answer.mass, answer.indicator];
    let inertia = answer.inertia_reference.into_iter().chain(answer.inertia_cg);
    own.into_iter().chain(answer.centre_of_gravity).chain(inertia)
}

//! Checks of a box's replies against their possible range.
//!
//! A reply that gets here has come whole; it may still say what no box can mean, because the box
//! is broken or is none. Everything behind the client may then rely on it: sums of counts do not
//! overflow, rates divide, times have an end.

use super::ClientError;
use crate::limits;
use massline_core::identify::{Estimate, Identification};
use massline_firmware::calibration::Certificate;
use massline_firmware::wire::{Identified, Info, Reply, Running, Setting, Status, Summary};

/// Checks a reply to the request of this number.
pub(super) fn reply(request: u8, reply: &Reply<'_>) -> Result<(), ClientError> {
    let wrong = match reply {
        Reply::Info(found) => info(found),
        Reply::Status(found) => status(found),
        Reply::Summary(found) => summary(found),
        Reply::Setting(found) => setting(found),
        Reply::Identified(found) => identified(found),
        Reply::Peaks(found) => each(
            "a survey's peak",
            found.peaks.iter(),
            |x| x >= 0.0,
            NOT_BELOW,
        ),
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

/// An impossible value: its name, the value, and the possible range.
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
    numbers: impl Iterator<Item = f64>,
    right: impl Fn(f64) -> bool,
    expected: &str,
) -> Result<(), Wrong> {
    all(what, numbers, |x| x.is_finite() && right(x), expected)
}

/// As [`each`], but they may be infinite.
fn all(
    what: &'static str,
    mut numbers: impl Iterator<Item = f64>,
    right: impl Fn(f64) -> bool,
    expected: &str,
) -> Result<(), Wrong> {
    match numbers.find(|&x| !right(x)) {
        None => Ok(()),
        // The short way to write 1e300.
        Some(found) => Err(Wrong(what, format!("{found:?}"), expected.to_owned())),
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
    let rate = summary.sample_rate.into_iter();
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
    let found = &answer.identification;
    let estimates = || estimates(found).into_iter().flatten();
    let any = |_| true;
    let values = estimates().map(|e| e.value);
    each("an identified value", values, any, "a number")?;
    let errors = estimates().map(|e| e.std);
    each("a standard deviation", errors, |x| x >= 0.0, NOT_BELOW)?;
    quality_of(found, answer.findings.weakest_excitation)?;
    let principal = found.principal.iter();
    let principal = principal.flat_map(|p| p.axes.iter().chain(&p.moments));
    let points = found.reference.iter().chain(principal).copied();
    each("a coordinate or moment", points, any, "a number")
}

/// Measures of quality in an answer are compared with limits, which no NaN exceeds. Some of
/// them may be infinite.
fn quality_of(answer: &Identification, weakest_excitation: Option<f64>) -> Result<(), Wrong> {
    let p = &answer.plausibility;
    let margins = [p.mass, p.positive_definite, p.triangle];
    let margins = || margins.into_iter().flatten();
    let positive = [answer.condition_number, answer.misfit, answer.freedom];
    let positive = positive.into_iter().chain(answer.consistency);
    let positive = positive.chain(margins().map(|m| m.uncertainty));
    let any = [answer.attenuation].into_iter();
    let any = any.chain(weakest_excitation);
    let any = any.chain(margins().map(|m| m.relative));
    let what = "a number of an answer's quality";
    all(what, positive, |x| x >= 0.0, NOT_BELOW)?;
    all(what, any, |x| !x.is_nan(), "a number")
}

fn estimates(answer: &Identification) -> impl IntoIterator<Item = Option<Estimate>> {
    let own = [answer.mass, answer.indicator];
    let inertia = answer
        .inertia_reference
        .into_iter()
        .chain(answer.inertia_cg);
    own.into_iter()
        .chain(answer.centre_of_gravity)
        .chain(inertia)
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_firmware::wire::{Health, Outcome, Packed, Pass, Source, State, Weights};

    fn refused(reply: &Reply<'_>) -> String {
        super::reply(reply.number(), reply).unwrap_err().to_string()
    }

    #[test]
    fn a_status_counts_within_limits() {
        let status = |next, run| {
            Reply::Status(Status {
                state: State::Running,
                busy: None,
                fingerprint: None,
                running: Some(Running {
                    run,
                    pass: Pass::Measure,
                    source: Source::Inputs,
                    next,
                    blocks: 0,
                }),
                stored: u32::MAX,
                surveyed: u32::MAX,
                answer: false,
                unsaved: false,
            })
        };
        assert!(reply(3, &status(limits::LAST_SAMPLE, 31)).is_ok());
        assert!(refused(&status(u64::MAX, 0)).contains("sample of 18446744073709551615"));
        assert!(refused(&status(0, 32)).contains("run of 33, expected at most 32"));
    }

    #[test]
    fn sums_of_a_summary_do_not_overflow() {
        let summary = |samples, blocks, rate: f64| {
            Reply::Summary(Summary {
                run: 0,
                pass: Pass::Measure,
                source: Source::Inputs,
                outcome: Outcome::Stopped,
                samples,
                missing: samples,
                blocks,
                rejected: blocks,
                rejected_by: [blocks; Health::KINDS],
                health: Health::GOOD,
                overloads: 0,
                sample_rate: Some(rate),
                noise: None,
            })
        };
        assert!(reply(3, &summary(limits::LAST_SAMPLE, limits::BLOCKS, 512.0)).is_ok());
        assert!(limits::BLOCKS.checked_add(limits::BLOCKS).is_some());
        assert!(refused(&summary(u64::MAX, 0, 512.0)).contains("number of samples"));
        assert!(refused(&summary(0, u32::MAX, 512.0)).contains("number of blocks"));
        for rate in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            assert!(refused(&summary(0, 0, rate)).contains("true sample rate"));
        }
    }

    #[test]
    fn rates_and_weights_are_numbers_of_their_kind() {
        for rate in [
            f64::NAN,
            f64::INFINITY,
            1e300,
            0.0,
            -512.0,
            1e-300,
            200_001.0,
        ] {
            let text = refused(&Reply::Setting(Setting::SampleRate(rate)));
            assert!(
                text.contains("1 to 200000 Hz") && text.len() < 250,
                "{text}"
            );
        }
        assert!(reply(3, &Reply::Setting(Setting::SampleRate(32_768.0))).is_ok());
        let weights = |all: &'static [f64]| {
            Reply::Weights(Weights {
                run: 0,
                weights: Packed::new(all),
            })
        };
        assert!(reply(3, &weights(&[0.0, 0.25, 1.0])).is_ok());
        assert!(refused(&weights(&[1.0, f64::NAN])).contains("NaN"));
        assert!(refused(&weights(&[1.5])).contains("0 to 1"));
    }
}

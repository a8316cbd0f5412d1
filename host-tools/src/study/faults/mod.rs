//! The detective on simulated set-ups with faults and without: `massline study faults`.
//!
//! # Design
//!
//! * **A draw is a test with a set-up that was spoilt.** A fork, the satellite on six axes, the
//!   satellite on a vertical shaker mounted three ways, and random structures with random sensors,
//!   shaken along and about all axes or along three axes only. White noise on every channel; sensors
//!   differ from the set-up as those of good laboratories do.
//! * **Every fault counts**: it moves a number by more than the number's interval. One of a sensor on
//!   the structure moves those of method c-squared.
//! * **What cannot be told is told apart beforehand**, by the exact kinematics of the test and its
//!   noise, without the detective: see `trace`.
//! * **Draws, not threads, have seeds.**
//!
//! | file | does |
//! | --- | --- |
//! | `bench` | draws the set-ups |
//! | `spoil` | puts faults into them |
//! | `outcome` | compares findings with them |
//! | `trace` | how far a fault contradicts exact data |
//! | `table` | terminal, Markdown and JSON |

mod bench;
mod outcome;
mod spoil;
mod table;
#[cfg(test)]
mod tests;
mod trace;

pub use spoil::{KINDS, Kind};
pub use table::{Document, markdown, print};

use super::chance::Chance;
use super::coverage::CaseError;
use super::trial::{Trial, TrialError};
use crate::detective::{Fault, Findings};
use crate::parallel;
use bench::{BENCHES, Bench};
use spoil::Spoilt;
use std::time::Duration;
use trace::Scene;

/// Options of the study.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Set-ups with faults.
    pub setups: usize,
    /// Set-ups without any.
    pub clean: usize,
    /// Faults in a set-up: one or two.
    pub faults: usize,
    /// Kinds of set-ups by name; all if empty.
    pub cases: Vec<String>,
    /// Seed of the first draw.
    pub seed: u64,
    /// Threads; as many as there are processors if `None`.
    pub threads: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            setups: 200,
            clean: 200,
            faults: 1,
            cases: Vec::new(),
            seed: 1,
            threads: None,
        }
    }
}

/// Reason why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum FaultsError {
    /// An option outside its range.
    #[error("--{option} {found}: expected {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// Value that was given.
        found: String,
        /// Values that are accepted.
        expected: String,
    },
    /// A set-up that cannot be drawn.
    #[error("case {case}, seed {seed}: {source}")]
    Case {
        /// Kind of the set-up.
        case: &'static str,
        /// The draw's seed.
        seed: u64,
        /// Reason.
        source: Box<CaseError>,
    },
    /// A draw that cannot be simulated or measured.
    #[error("case {case}, seed {seed}: {source}")]
    Trial {
        /// Kind of the set-up.
        case: &'static str,
        /// The draw's seed.
        seed: u64,
        /// Reason.
        source: Box<TrialError>,
    },
}

/// Outcome of a set-up with faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// All faults are named, each alone.
    Named,
    /// All faults are named, one of them among others that exact data do not tell from it.
    Equal,
    /// All faults are named, one of them among others that explain the recorded data as well.
    Tied,
    /// A fault is told by size: of the body and its density, or of a position.
    BySize,
    /// A fault that no data tell is asked for.
    Asked,
    /// Of two faults one is named, and nothing else.
    Half,
    /// The right sensor is named, without its fault.
    Sensor,
    /// The set-up is said to be inconsistent, and nothing is named.
    Unnamed,
    /// Nothing is said.
    Silent,
    /// Something is named that is not wrong.
    Wrong,
}

/// One draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Kind of the set-up.
    pub case: &'static str,
    /// Seed of the draw.
    pub seed: u64,
    /// The faults in words; none of a clean set-up.
    pub faults: Vec<String>,
    /// Sum of squares, over what noise and usual differences of sensors explain, by which the fault
    /// contradicts exact data: the weaker one of two faults. Infinite where only size tells it.
    pub trace: f64,
    /// The outcome; of a clean set-up silent, or wrong if a sensor is accused.
    pub outcome: Outcome,
    /// The findings in words.
    pub said: Vec<String>,
    /// `true` if the findings say that these runs do not tell the fault.
    pub foretold: bool,
}

impl Drawn {
    /// `true` if exact data do not contradict the set-up by more than chance.
    #[must_use]
    pub fn is_invisible(&self) -> bool {
        self.trace < trace::LIMIT
    }
}

/// All draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Options of the study.
    pub options: Options,
    /// Set-ups with faults, then those without.
    pub draws: Vec<Drawn>,
    /// Time that the threads worked, all together.
    pub work: Duration,
}

/// Names of the kinds of set-ups.
#[must_use]
pub fn cases() -> [&'static str; BENCHES.len()] {
    BENCHES.map(|bench| bench.name)
}

/// Draws and examines. `progress` hears which share is done, and of which kind of set-up.
///
/// # Errors
/// [`FaultsError`].
pub fn run(options: &Options, progress: &mut dyn FnMut(f64, &str)) -> Result<Found, FaultsError> {
    if !(1..=2).contains(&options.faults) {
        return Err(FaultsError::Option {
            option: "faults",
            found: options.faults.to_string(),
            expected: "1 or 2".to_owned(),
        });
    }
    if options.setups + options.clean == 0 {
        return Err(FaultsError::Option {
            option: "setups",
            found: "0".to_owned(),
            expected: "at least one set-up, or --clean".to_owned(),
        });
    }
    let names = cases();
    if let Some(found) = options.cases.iter().find(|c| !names.contains(&c.as_str())) {
        return Err(FaultsError::Option {
            option: "case",
            found: found.clone(),
            expected: format!("one of {}", names.join(", ")),
        });
    }
    let wanted = |b: &&Bench| options.cases.is_empty() || options.cases.iter().any(|n| n == b.name);
    let benches: Vec<&Bench> = BENCHES.iter().filter(wanted).collect();
    let count = options.setups + options.clean;
    let job = |number: usize| {
        let faults = if number < options.setups {
            options.faults
        } else {
            0
        };
        let bench = benches[number % benches.len()];
        let seed = options.seed.wrapping_add(number as u64);
        draw(bench, seed, faults)
    };
    let (draws, work) = parallel::each(count, options.threads, &job, &mut |done, number| {
        progress(
            done as f64 / count as f64,
            benches[number % benches.len()].name,
        );
    })?;
    Ok(Found {
        options: options.clone(),
        draws,
        work,
    })
}

/// Faults that are drawn of one kind until one moves a number, and kinds that are tried.
const TRIES: [usize; 2] = [10, 12];

/// Traces of all faults, each with the others mended: a channel that is dead stays without a signal.
fn traces(clean: &Trial, level: f64, faults: &[Spoilt]) -> Vec<f64> {
    let dead = |fault: &Spoilt| match fault {
        Spoilt::Dead(channel) => Some(Fault::Dead { channel: *channel }),
        _ => None,
    };
    let trace = |fault: &Spoilt| {
        // Only size tells it.
        if *fault == Spoilt::Millimetres {
            return f64::INFINITY;
        }
        let others = faults.iter().filter(|other| *other != fault);
        let others: Vec<Fault> = others.filter_map(dead).collect();
        let mended: Vec<&Fault> = others.iter().collect();
        trace::contradiction(&Scene {
            clean,
            level,
            faults: &[fault],
            mended: &mended,
        })
    };
    faults.iter().map(trace).collect()
}

fn draw(bench: &Bench, seed: u64, count: usize) -> Result<Drawn, FaultsError> {
    let case = bench.name;
    let failed = |source| FaultsError::Trial {
        case,
        seed,
        source: Box::new(source),
    };
    let mut chance = Chance::new(seed, &["faults", case]);
    let (clean, level) = bench
        .draw(&mut chance, seed)
        .map_err(|source| FaultsError::Case {
            case,
            seed,
            source: Box::new(source),
        })?
        .map_err(failed)?;
    let mut trial = clean.clone();
    let mut spoilt: Vec<Spoilt> = Vec::new();
    let mut kinds = Vec::new();
    for _ in 0..TRIES[1] {
        // A kind that moves nothing here makes way for another one.
        let kind = KINDS[chance.whole(0, KINDS.len() - 1)];
        kinds.extend([kind; TRIES[0]]);
    }
    let mut left_out = Vec::new();
    for kind in kinds {
        if spoilt.len() == count {
            break;
        }
        // Pairs are of single sensors.
        if left_out.contains(&kind) || (count > 1 && kind.is_whole()) {
            continue;
        }
        let mut alone = clean.clone();
        let Some(fault) = spoil::spoil(&mut alone, kind, &mut chance, &spoilt) else {
            continue;
        };
        if !spoil::counts(&clean, &alone, level, &fault).map_err(failed)? {
            continue;
        }
        fault.apply(&mut trial);
        spoilt.push(fault);
        left_out.push(kind);
    }
    let trace = traces(&clean, level, &spoilt)
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let examined = trial.examine(level).map_err(failed)?;
    let said = match &examined {
        Ok(found) => outcome::said(found),
        Err(why) => vec![why.to_string()],
    };
    let found: Option<Findings> = examined.ok();
    let mut outcome = outcome::outcome(&clean.setup, &spoilt, found.as_ref());
    if let (Outcome::Tied, Some(found)) = (outcome, &found)
        && outcome::tied_in_principle(&clean, level, &spoilt, found)
    {
        outcome = Outcome::Equal;
    }
    Ok(Drawn {
        case,
        seed,
        faults: spoilt
            .iter()
            .map(|fault| fault.text(&trial.setup))
            .collect(),
        trace,
        outcome,
        said,
        foretold: found.as_ref().is_some_and(|found| {
            let told = |fault: &Spoilt| fault.is_untold(&trial.setup, &found.untold);
            spoilt.iter().any(told)
        }),
    })
}

//! The maximum likelihood fit beside the Cramér-Rao bound and the band's method:
//! `massline study likelihood`.
//!
//! # Design
//!
//! * **Random elastic structures**, a new one in each draw, 5 to 500 kg with three to five modes,
//!   six runs of 40 s at 512 Hz. White noise on every channel, the drive included.
//! * **Draws, not threads, have seeds**, and each kind of test has its own. Levels of noise share the
//!   structure and the shape of the noise.
//! * **All lines up to 1.2 times the second mode.** The bound is that of these lines, for the true
//!   model and the true noise; beside it stands the bound of the averaging band alone.
//! * **The numbers of the command.** Fits that fail their tests step back as in `identify`, and
//!   count with the numbers of the band's method.

mod draw;
mod table;

pub use table::{Document, markdown, print};

use super::trial::TrialError;
use crate::parallel;
use std::time::Duration;

/// Numbers of a row: mass, centre of gravity, inertia about it.
pub const NUMBERS: usize = 10;

/// Options of the study.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Structures a row.
    pub structures: usize,
    /// Levels of noise, shares of each channel's RMS.
    pub noise: Vec<f64>,
    /// Rows by name; all if empty.
    pub cases: Vec<String>,
    /// Length of each run, s.
    pub duration: f64,
    /// Seed of the first draw.
    pub seed: u64,
    /// Threads; as many as there are processors if `None`.
    pub threads: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            structures: 40,
            noise: vec![0.01, 0.001],
            cases: Vec::new(),
            duration: 40.0,
            seed: 1,
            threads: None,
        }
    }
}

/// A kind of test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// As given to `--case`.
    pub name: &'static str,
    /// `true` if the drive is recorded.
    pub drive: bool,
    /// Motion of its runs.
    pub axes: Axes,
    /// Deviation of the structure from the model of the fit.
    pub disturbance: Disturbance,
}

/// Motion of the six runs of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axes {
    /// Three translations and three rotations about A.
    All,
    /// Three translations, twice: nothing rotates.
    Translations,
    /// The same of a table that rotates along, by as much as its noise hides up to what tells the inertia.
    Coupled,
    /// Three rotations, twice, each about an axis of its own that passes A by.
    Rotations,
}

/// A deviation of the structure from the model of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    /// None.
    None,
    /// The third mode right above the last line.
    JustBeyond,
    /// Two modes 0.3 % apart.
    Pair,
    /// The first mode 0.5 % lower in one run.
    Moved,
    /// Structural damping in place of viscous.
    Structural,
    /// Twenty modes, all of them below the last line.
    Many,
}

/// All kinds, in the order of the table.
pub const CASES: [Case; 12] = [
    Case {
        name: "drive",
        drive: true,
        axes: Axes::All,
        disturbance: Disturbance::None,
    },
    Case {
        name: "no-drive",
        drive: false,
        axes: Axes::All,
        disturbance: Disturbance::None,
    },
    Case {
        name: "translations",
        drive: true,
        axes: Axes::Translations,
        disturbance: Disturbance::None,
    },
    Case {
        name: "translations-no-drive",
        drive: false,
        axes: Axes::Translations,
        disturbance: Disturbance::None,
    },
    Case {
        name: "translations-coupled",
        drive: true,
        axes: Axes::Coupled,
        disturbance: Disturbance::None,
    },
    Case {
        name: "rotations",
        drive: true,
        axes: Axes::Rotations,
        disturbance: Disturbance::None,
    },
    Case {
        name: "rotations-no-drive",
        drive: false,
        axes: Axes::Rotations,
        disturbance: Disturbance::None,
    },
    Case {
        name: "just-beyond",
        drive: true,
        axes: Axes::All,
        disturbance: Disturbance::JustBeyond,
    },
    Case {
        name: "pair",
        drive: true,
        axes: Axes::All,
        disturbance: Disturbance::Pair,
    },
    Case {
        name: "moved",
        drive: true,
        axes: Axes::All,
        disturbance: Disturbance::Moved,
    },
    Case {
        name: "structural",
        drive: true,
        axes: Axes::All,
        disturbance: Disturbance::Structural,
    },
    Case {
        name: "many",
        drive: true,
        axes: Axes::All,
        disturbance: Disturbance::Many,
    },
];

/// A number of one draw: error, claimed standard deviation and half of the 95 % interval over the
/// bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// Error over the bound.
    pub error: f64,
    /// Standard deviation over the bound.
    pub claim: f64,
    /// `true` if the interval holds the truth.
    pub holds: bool,
}

/// One draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// Numbers of the method `ml`, after a step back where there was one.
    pub likelihood: [Option<Scored>; NUMBERS],
    /// Numbers of the band's method.
    pub band: [Option<Scored>; NUMBERS],
    /// Bound of the averaging band alone over that of all lines.
    pub band_bound: [Option<f64>; NUMBERS],
    /// Reason for a step back.
    pub stepped_back: Option<String>,
    /// `true` if fewer lines than asked for were used.
    pub narrower: bool,
    /// Modes of the fit less modes below the last line.
    pub surplus: i64,
    /// Time of the fit.
    pub work: Duration,
}

/// Reason why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum LikelihoodError {
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
    /// A draw cannot be simulated or measured.
    #[error("case {case}, seed {seed}: {source}")]
    Trial {
        /// Its name.
        case: &'static str,
        /// The draw's seed.
        seed: u64,
        /// Reason.
        source: Box<TrialError>,
    },
}

/// One row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Kind of test.
    pub case: Case,
    /// Noise, a share of each channel's RMS.
    pub noise: f64,
    /// Its draws.
    pub draws: Vec<Drawn>,
}

/// All rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Options of the study.
    pub options: Options,
    /// In the order of cases and levels.
    pub rows: Vec<Row>,
    /// Time that the threads worked, all together.
    pub work: Duration,
}

/// Draws and fits. `progress` hears which share is done, and of which case.
///
/// # Errors
/// [`LikelihoodError`] for options that mean nothing.
pub fn run(
    options: &Options,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Found, LikelihoodError> {
    let refuse = |option, found: String, expected: &str| {
        Err(LikelihoodError::Option {
            option,
            found,
            expected: expected.to_owned(),
        })
    };
    if options.structures == 0 {
        return refuse("structures", "0".to_owned(), "at least one");
    }
    if !(options.duration >= 5.0 && options.duration <= 3600.0) {
        return refuse("duration", options.duration.to_string(), "5 to 3600 s");
    }
    for found in &options.noise {
        if !(*found > 0.0 && *found <= 1.0) {
            return refuse(
                "noise",
                found.to_string(),
                "shares of a channel's RMS, more than 0 and up to 1",
            );
        }
    }
    for found in &options.cases {
        if !CASES.iter().any(|case| case.name == found) {
            let names: Vec<&str> = CASES.iter().map(|c| c.name).collect();
            return refuse(
                "case",
                found.clone(),
                &format!("one of {}", names.join(", ")),
            );
        }
    }
    let wanted = |c: &&Case| options.cases.is_empty() || options.cases.iter().any(|n| n == c.name);
    let cases: Vec<&Case> = CASES.iter().filter(wanted).collect();
    let structures = options.structures;
    let count = cases.len() * structures;
    let (drawn, work) = parallel::each(
        count,
        options.threads,
        &|job| {
            let (case, number) = (cases[job / structures], job % structures);
            let seed = options.seed.wrapping_add(number as u64);
            draw::draw(case, options, seed).map_err(|source| LikelihoodError::Trial {
                case: case.name,
                seed,
                source: Box::new(source),
            })
        },
        &mut |done, job| progress(done as f64 / count as f64, cases[job / structures].name),
    )?;
    let mut rows = Vec::new();
    for (case, draws) in cases.iter().zip(drawn.chunks(structures)) {
        for (level, &noise) in options.noise.iter().enumerate() {
            rows.push(Row {
                case: **case,
                noise,
                draws: draws.iter().map(|d| d[level].clone()).collect(),
            });
        }
    }
    Ok(Found {
        options: options.clone(),
        rows,
        work,
    })
}

//! Study of random test plans: numbers that a plan cannot determine have to be absent
//! (`massline study plans`).
//!
//! # Design
//!
//! * **A plan is drawn at random**: structure (rigid or elastic), sensors, load cells, number of
//!   runs, directions (six axes, translations only, one axis, a plane, one rotation, re-mounted,
//!   several drives at once), kind (random with or without a drive channel, stepped sine, static
//!   poses), weighed or not, noise from 1e-4 to 3e-2 of each channel's RMS.
//! * **What it can tell comes from exact kinematics** (module `tell`): the directions that are
//!   excited
//!   are zero or they are not, and the rank of (8) follows without samples.
//! * **No plan stands on the border.** One where an excited direction is less than 1000 times
//!   its noise in power, where a singular value lies between 1e-9 and 1e-4 of the largest, where a
//!   parameter is left out of what is excited by less than ten times what noise may turn that by,
//!   or where an ideal estimator's error bar would exceed 1 % of the body's own scale is drawn
//!   anew. How many were, and why, is reported. The ideal error bar knows that noise tilts every
//!   acceleration: it takes the forces of a body of the test's own size for what such a tilt
//!   does, also by way of parameters that the plan does not tell.
//! * **The same path as `massline identify`**, see `study::trial`, by the recommended method.
//!
//! | file | does |
//! | --- | --- |
//! | `draw` | plans |
//! | `tell` | what a plan can tell |

mod draw;
pub(super) mod tell;

use super::chance::Chance;
use super::coverage::{NAMES, NUMBERS, numbers};
use super::parallel;
use super::trial::{Trial, TrialError};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use tell::{Verdict, tell};

/// Options of the study.
#[derive(Clone, Copy, Debug, PartialEq, clap::Args)]
pub struct Options {
    /// Number of plans
    #[arg(long, value_name = "N", default_value_t = Self::default().plans)]
    pub plans: usize,
    /// Seed of the first plan; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Self::default().seed)]
    pub seed: u64,
    /// Threads; the outcome does not depend on it [default: one a processor]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            plans: 1000,
            seed: 1,
            threads: None,
        }
    }
}

/// Why a plan cannot be tried.
#[derive(Debug, thiserror::Error)]
pub enum PlansError {
    /// No plans.
    #[error("--plans 0: expected at least one")]
    NoPlans,
    /// It cannot be simulated or measured.
    #[error("plan {seed} ({what}): {source}")]
    Trial {
        /// Its seed.
        seed: u64,
        /// Plan in words.
        what: String,
        /// Reason.
        source: Box<TrialError>,
    },
    /// None that stands clear of the border.
    #[error("plan {seed}: none of {tries} draws stands clear of the border")]
    Border {
        /// Its seed.
        seed: u64,
        /// Draws.
        tries: u32,
    },
}

/// Outcome of one plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// With `--seed` and `--plans 1` it is tried again.
    pub seed: u64,
    /// Plan in words.
    pub what: String,
    /// Why draws before it stood on the border.
    pub drawn_anew: Vec<&'static str>,
    /// Numbers that the plan tells and the estimator gives.
    pub right: usize,
    /// Numbers that the plan cannot tell and the estimator gives.
    pub invented: Vec<Given>,
    /// Numbers that the plan tells and the estimator gives, but more than [`OFF`] times half of
    /// their 95 % interval from the truth.
    pub off: Vec<Given>,
    /// Numbers that the plan tells and the estimator does not give.
    pub missed: Vec<&'static str>,
    /// Why there is no answer, if there is none.
    pub refused: Option<String>,
}

/// A number that should not have been given, or not like that.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Given {
    /// Name of the number.
    pub name: &'static str,
    /// Its value, SI units.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Half of its 95 % interval.
    pub interval: f64,
    /// The truth.
    pub truth: Option<f64>,
}

/// Outcome of all plans.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plans {
    schema: &'static str,
    /// Plans.
    pub plans: usize,
    /// Seed of the first.
    pub seed: u64,
    /// Draws that stood on the border, by the reason.
    pub drawn_anew: BTreeMap<&'static str, usize>,
    /// Plans with an invented number.
    pub plans_with_invented: usize,
    /// Numbers that plans cannot tell, and the estimator gave.
    pub invented: usize,
    /// Numbers that plans tell, and the estimator gave with an error bar that is far too small.
    pub off: usize,
    /// Numbers that plans tell.
    pub told: usize,
    /// Numbers that the estimator did not give.
    pub missed: usize,
    /// Plans with an invented number, a missed one or one that is off.
    pub faults: Vec<Tried>,
}

/// Distance from the truth from which a number is off, in halves of its 95 % interval: six standard
/// deviations, which chance does not exceed in a hundred thousand plans.
pub const OFF: f64 = 3.0;

/// Least share of told numbers that the estimator is to give.
pub const GIVEN: f64 = 0.99;

impl Plans {
    /// `true` if no number was invented and enough of the others were given.
    #[must_use]
    pub fn hold(&self) -> bool {
        self.invented == 0 && self.missed as f64 <= (1.0 - GIVEN) * self.told as f64
    }
}

/// Tries all plans. `progress` hears which share is done.
///
/// # Errors
/// [`PlansError`] for a plan that cannot be simulated.
pub fn run(options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Plans, PlansError> {
    if options.plans == 0 {
        return Err(PlansError::NoPlans);
    }
    let one = |number: usize| try_one(options.seed.wrapping_add(number as u64));
    let (tried, _) = parallel::each(options.plans, options.threads, &one, &mut |done, _| {
        progress(done as f64 / options.plans as f64);
    })?;
    let mut borders = BTreeMap::new();
    for why in tried.iter().flat_map(|t| &t.drawn_anew) {
        *borders.entry(*why).or_insert(0) += 1;
    }
    Ok(Plans {
        schema: "massline/plans/1",
        plans: options.plans,
        seed: options.seed,
        drawn_anew: borders,
        plans_with_invented: tried.iter().filter(|t| !t.invented.is_empty()).count(),
        invented: tried.iter().map(|t| t.invented.len()).sum(),
        off: tried.iter().map(|t| t.off.len()).sum(),
        told: tried.iter().map(|t| t.right + t.missed.len()).sum(),
        missed: tried.iter().map(|t| t.missed.len()).sum(),
        faults: tried
            .into_iter()
            .filter(|t| !(t.invented.is_empty() && t.off.is_empty() && t.missed.is_empty()))
            .collect(),
    })
}

fn try_one(seed: u64) -> Result<Tried, PlansError> {
    const TRIES: u32 = 200;
    let mut borders = Vec::new();
    for attempt in 0..TRIES {
        let mut chance = Chance::new(seed, &["plan", &attempt.to_string()]);
        let drawn = draw::draw(&mut chance);
        let failed = |source| PlansError::Trial {
            seed,
            what: drawn.what.clone(),
            source: Box::new(source),
        };
        let trial = Trial::new(drawn.model.clone(), seed, &drawn.conditions).map_err(failed)?;
        let runs = draw::excited(&drawn, &trial, seed);
        let to_origin = crate::frame::shift(&-nalgebra::Vector3::from(drawn.model.reference_point));
        let body = to_origin.tr_mul(&(drawn.model.specimen.mass_matrix * to_origin));
        let weighed = drawn.conditions.weighed;
        let told = match tell(&runs, &body, drawn.size(), weighed) {
            Verdict::Clear(told) => told,
            Verdict::Doubtful(why) => {
                borders.push(why);
                continue;
            }
        };
        let outcomes = trial.answers(drawn.noise, &[None]).map_err(failed)?;
        let found = outcomes
            .into_iter()
            .next()
            .unwrap_or_else(|| Err(String::new()));
        let truth = super::coverage::truths(&trial.truth);
        let (given, refused) = match &found {
            Ok(found) => (numbers(found), None),
            Err(reason) => ([None; NUMBERS], Some(reason.clone())),
        };
        let mut tried = Tried {
            seed,
            what: drawn.what.clone(),
            drawn_anew: borders,
            right: 0,
            invented: Vec::new(),
            off: Vec::new(),
            missed: Vec::new(),
            refused,
        };
        for (number, name) in NAMES.iter().enumerate() {
            // A weighed mass is given, not found.
            if number == 0 && weighed {
                continue;
            }
            let as_given = |n: super::coverage::Interval| Given {
                name,
                value: n.value,
                std: n.std,
                interval: n.half,
                truth: truth[number],
            };
            match (given[number], told[number]) {
                (Some(n), true) => {
                    tried.right += 1;
                    if truth[number].is_some_and(|t| (n.value - t).abs() > OFF * n.half) {
                        tried.off.push(as_given(n));
                    }
                }
                (Some(n), false) => tried.invented.push(as_given(n)),
                (None, true) => tried.missed.push(name),
                (None, false) => (),
            }
        }
        return Ok(tried);
    }
    Err(PlansError::Border { seed, tries: TRIES })
}

/// Prints counts and faults.
///
/// # Errors
/// If the terminal is gone.
pub fn print(out: &mut dyn Write, plans: &Plans) -> std::io::Result<()> {
    writeln!(
        out,
        "{} test plans from seed {}; {} draws near the border were drawn anew",
        plans.plans,
        plans.seed,
        plans.drawn_anew.values().sum::<usize>()
    )?;
    writeln!(
        out,
        "{} numbers that a plan cannot tell were given, in {} plans (0 expected)",
        plans.invented, plans.plans_with_invented
    )?;
    writeln!(
        out,
        "{} numbers were given more than {OFF} half intervals from the truth",
        plans.off
    )?;
    let share = 100.0 * (plans.told - plans.missed) as f64 / plans.told.max(1) as f64;
    writeln!(
        out,
        "{} of {} numbers that plans tell were given: {share:.2} % ({:.0} % expected)",
        plans.told - plans.missed,
        plans.told,
        100.0 * GIVEN
    )?;
    for tried in &plans.faults {
        writeln!(out, "\nplan {}: {}", tried.seed, tried.what)?;
        for (what, numbers) in [("invented", &tried.invented), ("off", &tried.off)] {
            for n in numbers {
                let truth = n.truth.map_or("-".to_owned(), |t| format!("{t:.4}"));
                writeln!(
                    out,
                    "  {what} {}: {:.4} ± {:.4} (95 %), truth {truth}",
                    n.name, n.value, n.interval
                )?;
            }
        }
        if !tried.missed.is_empty() {
            writeln!(out, "  missed {}", tried.missed.join(", "))?;
        }
        if let Some(reason) = &tried.refused {
            writeln!(out, "  refused: {reason}")?;
        }
    }
    Ok(())
}

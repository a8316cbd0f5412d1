//! Start values: modes are added one by one until the data no longer ask for more.

use super::descent::{self, Descent, Freedom, Problem};
use super::excited::Excited;
use super::guess::Body;
use super::model::{FittedMode, Model, OF_MODE, RIGID, SYMMETRIC, triangle};
use super::normal::Detail;
use super::record::{Record, highest, real_equations};
use super::search::Groups;
use super::shrinkage::believed;
use super::{Progress, Stage};
use nalgebra::{DMatrix, DVector, Vector6};

/// Lines of each record in the refits.
const LINES: usize = 450;
/// The same in the last look for modes beyond the lines.
const MORE_LINES: usize = 1200;
/// Ratio of the numbers of lines of one search for modes and the next.
const FINER: usize = 4;
/// Least fall of 2V, beyond that which its eight parameters take from noise, for a mode: chance exceeds it
/// at one place in 16,000 (33 with eight degrees of freedom).
const CHANCE: f64 = 25.0;
/// Most steps of a refit.
const STEPS: usize = 30;
/// Fall of V, and share of V, at which a refit ends: far below what decides on a mode.
const SETTLED: [f64; 2] = [1.0, 2e-4];
/// 2V over degrees of freedom from which the model does not explain the lines.
pub const RATIO: f64 = 1.2;
/// Most modes.
pub const MOST_MODES: usize = 30;
/// Last modes whose falls of V tell how much others may explain at most.
const LAST: usize = 5;
/// Share of the highest line at which a mode beyond it is started.
const BEYOND: [f64; 2] = [1.15, 1.6];
/// Difference of ln ω of two modes from which one of them may stand for a misplaced other.
const DOUBLE: f64 = 0.02;
/// Standard deviations of the Wald statistic of E, as chance spreads it, above its mean: from which
/// a mode beyond the lines is tried on more lines, and from which nothing but the data tells E.
const TRIED: f64 = 1.5;
const TOLD: f64 = 3.0;

/// When exponents and offsets of modes become free.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Freed {
    /// As soon as they explain more than one mode more.
    Early,
    /// Once no mode more helps.
    Late,
}

/// End of a search.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// No mode more helps.
    Whole,
    /// No modes explain what is left.
    Hopeless,
}

/// Model with as many modes as the data support, ready for all lines; `None` where a fit without
/// any mode fails.
///
/// Modes that are not found yet may look like offsets of those that are, and with these free may never be found, so
/// that a search whose residuals are larger than the noise is made once more in the other order, unless no modes
/// explain them.
pub(super) fn start(
    records: &[Record],
    excited: &Excited,
    body: &Body,
    threads: usize,
    progress: &mut dyn FnMut(Progress),
) -> Option<Model> {
    let mut search = |freed| searched(records, excited, (body, freed), threads, progress);
    let (first, outcome) = search(Freed::Early)?;
    if outcome == Outcome::Hopeless {
        return Some(first);
    }
    let all = body.problem(records, threads);
    let misfit = |model: &Model| -> Option<f64> {
        let (_, leaked) = all.misfit(model, Freedom::all(body.free))?;
        Some(leaked.iter().map(|of| of.misfit).sum())
    };
    let before = misfit(&first)?;
    if 2.0 * before <= RATIO * real_equations(records) as f64 {
        return Some(first);
    }
    let second = search(Freed::Late).and_then(|(model, _)| Some((misfit(&model)?, model)));
    match second {
        Some((after, second)) if after < before => Some(second),
        _ => Some(first),
    }
}

/// The same in one order.
fn searched(
    records: &[Record],
    excited: &Excited,
    (body, order): (&Body, Freed),
    threads: usize,
    progress: &mut dyn FnMut(Progress),
) -> Option<(Model, Outcome)> {
    let search = Search::of(records, excited, body, threads)?;
    let mut tell = |found: &Descent| {
        progress(Progress {
            stage: Stage::Modes,
            modes: found.model.modes.len(),
            iteration: 0,
            misfit: found.misfit,
        });
    };
    let mut freedom = Freedom::least(body.free);
    let (mut found, outcome) = search.within(order, &mut freedom, &mut tell)?;
    if outcome == Outcome::Whole {
        found = search.beyond(found, freedom, &mut tell)?;
    }
    Some((found.model, outcome))
}

/// A search for modes in records.
struct Search<'a> {
    records: &'a [Record],
    excited: &'a Excited,
    body: &'a Body,
    threads: usize,
    groups: Groups,
    /// Number of runs, and of lines of the longest record.
    runs: usize,
    lines: usize,
    /// Highest line, Hz.
    unit: f64,
    /// Natural logarithm of the number of real equations: the fall of 2V that a parameter has to be worth (Schwarz 1978).
    worth: f64,
}

impl<'a> Search<'a> {
    fn of(
        records: &'a [Record],
        excited: &'a Excited,
        body: &'a Body,
        threads: usize,
    ) -> Option<Self> {
        Some(Self {
            records,
            excited,
            body,
            threads,
            groups: Groups::new(records, excited)?,
            runs: 1 + records.iter().map(|r| r.run).max()?,
            lines: records.iter().map(|r| r.frequencies.len()).max()?,
            unit: highest(records),
            worth: (real_equations(records) as f64).ln(),
        })
    }

    /// Some `wanted` lines of each record, and the number of lines from one to the next.
    fn thinned(&self, wanted: usize) -> (usize, Vec<Record>) {
        let step = (self.lines / wanted).max(1);
        let records = self.records.iter().enumerate();
        // Records take turns, so that together they miss nothing.
        let every = |(e, r): (usize, &Record)| r.thinned(e % step, step, f64::INFINITY);
        (step, records.map(every).collect())
    }

    /// Looks for modes within the lines, of few lines first, of more as long as fewer would not show a mode that all of
    /// them together tell.
    fn within(
        &self,
        order: Freed,
        freedom: &mut Freedom,
        tell: &mut dyn FnMut(&Descent),
    ) -> Option<(Descent, Outcome)> {
        let threshold = (8.0 + 2.0 * self.runs as f64) * self.worth;
        let mut model = Model::rigid([0.0; RIGID], self.unit, self.runs);
        self.body.put(&mut model);
        model.upper = Some([0.0; SYMMETRIC]);
        let mut wanted = LINES;
        loop {
            let (step, some) = self.thinned(wanted);
            let problem = self.body.problem(&some, self.threads);
            // All lines together decide on a mode, but those that are left have to show it.
            let least = (threshold / step as f64).max(CHANCE);
            let found = refit(&problem, *freedom, &model)?;
            let (found, outcome) =
                self.with_modes(&problem, found, order, (freedom, least), tell)?;
            if outcome == Outcome::Hopeless {
                return Some((found, outcome));
            }
            let found = pruned(&problem, (*freedom, self.runs), found, least)?;
            if CHANCE * step as f64 <= threshold {
                return Some((found, outcome));
            }
            model = found.model;
            wanted *= FINER;
        }
    }

    /// Adds modes as long as each takes more than `least` off 2V.
    fn with_modes(
        &self,
        problem: &Problem<'_>,
        mut found: Descent,
        order: Freed,
        (freedom, least): (&mut Freedom, f64),
        tell: &mut dyn FnMut(&Descent),
    ) -> Option<(Descent, Outcome)> {
        let noise = 0.5 * RATIO * real_equations(problem.records) as f64;
        let mut falls = Vec::new();
        while found.model.modes.len() < MOST_MODES {
            tell(&found);
            let own = of_a_mode(*freedom, self.runs);
            let tried = self.groups.best(&found.model).into_iter();
            let tried = tried.filter_map(|mode| {
                let mut tried = found.model.clone();
                tried.push(mode);
                let settled = settled(problem, *freedom, &tried)?;
                // What is no resonance takes up delays, and rotations that the model lacks.
                let overdamped = |mode: &FittedMode| mode.is_overdamped(self.unit);
                (!settled.model.modes.iter().any(overdamped)).then_some(settled)
            });
            let best = tried.min_by(|a, b| a.misfit.total_cmp(&b.misfit));
            let better = best.filter(|b| 2.0 * (found.misfit - b.misfit) - own > least);
            // A mode that moved between the runs, or whose damping is not viscous, looks like several: what
            // explains more is taken first, if it is not to wait.
            let freed = match (order, &better) {
                (Freed::Late, Some(_)) => None,
                _ => freed(problem, *freedom, &found, self.runs, least),
            };
            let before = |b: &Descent| better.as_ref().is_none_or(|m| b.misfit < m.misfit);
            let from = found.misfit;
            found = match freed.filter(before) {
                Some(freed) => {
                    *freedom = Freedom::all(self.body.free);
                    freed
                }
                None => match better {
                    Some(better) => better,
                    None => break,
                },
            };
            falls.push(from - found.misfit);
            let left = MOST_MODES - found.model.modes.len();
            if is_hopeless(found.misfit, &falls, left, noise) {
                return Some((found, Outcome::Hopeless));
            }
        }
        Some((found, Outcome::Whole))
    }

    /// Adds modes beyond the lines where the terms E are more than noise: at most two by few lines, and two by more.
    fn beyond(
        &self,
        mut now: Descent,
        freedom: Freedom,
        tell: &mut dyn FnMut(&Descent),
    ) -> Option<Descent> {
        let all = self.body.problem(self.records, self.threads);
        let mut known: Option<Rest> = None;
        for wanted in [LINES, MORE_LINES] {
            let (step, some) = self.thinned(wanted);
            let problem = self.body.problem(&some, self.threads);
            for turn in 0..2 {
                let rest = match known.take() {
                    Some(rest) => rest,
                    None => Rest::of(&all, &now.model, freedom)?,
                };
                let threshold = match wanted {
                    LINES => rest.terms() * self.worth,
                    _ => rest.chance(TRIED),
                };
                if rest.statistic <= threshold {
                    known = Some(rest);
                    break;
                }
                if wanted != LINES && turn == 0 {
                    now = refit(&problem, freedom, &now.model)?;
                }
                let tried = BEYOND.iter().filter_map(|share| {
                    let mut model = now.model.clone();
                    model.push(beyond(&model, self.excited, self.unit * share)?);
                    model.upper = Some([0.0; SYMMETRIC]);
                    settled(&problem, freedom, &model)
                });
                let best = tried.min_by(|a, b| a.misfit.total_cmp(&b.misfit));
                let Some(better) = best.filter(|b| {
                    let gain = 2.0 * (now.misfit - b.misfit) - of_a_mode(freedom, self.runs);
                    gain * step as f64 > threshold
                }) else {
                    break;
                };
                now = better;
                tell(&now);
            }
        }
        Some(now)
    }
}

/// `true` if V cannot fall to that of noise with as many modes as are `left`, of which none explains more than
/// any of the last ones: what is there is no resonance, an outlying sample for instance.
fn is_hopeless(misfit: f64, falls: &[f64], left: usize, noise: f64) -> bool {
    let Some(last) = falls.last_chunk::<LAST>() else {
        return false;
    };
    let most = last.iter().copied().fold(0.0, f64::max);
    misfit - left as f64 * most > noise
}

fn refit(problem: &Problem<'_>, freedom: Freedom, model: &Model) -> Option<Descent> {
    let until = (STEPS, SETTLED);
    descent::descend_until(problem, model, freedom, until, &mut |_, _| ())
}

/// The same from a mode whose place is a guess: it settles before exponents and offsets move, which would
/// make up for a mode that is far from its place.
fn settled(problem: &Problem<'_>, freedom: Freedom, model: &Model) -> Option<Descent> {
    let least = Freedom::least(freedom.rigid);
    let first = refit(problem, least, model)?;
    if freedom == least {
        return Some(first);
    }
    refit(problem, freedom, &first.model)
}

/// Fall of 2V that the parameters of one more mode take from noise: frequency, damping, participations,
/// and once they are free the exponent and offsets of frequency but one. Offsets of damping hardly are: what
/// is known of them beforehand is narrower than what a mode tells that is barely seen.
fn of_a_mode(freedom: Freedom, runs: usize) -> f64 {
    let exponent = f64::from(u8::from(freedom.exponents));
    let offsets = if freedom.offsets {
        runs as f64 - 1.0
    } else {
        0.0
    };
    8.0 + exponent + offsets
}

/// The same modes with exponents and offsets of their own, where these explain more than noise.
fn freed(
    problem: &Problem<'_>,
    freedom: Freedom,
    found: &Descent,
    runs: usize,
    threshold: f64,
) -> Option<Descent> {
    let all = Freedom::all(freedom.rigid);
    if freedom == all || found.model.modes.is_empty() {
        return None;
    }
    let freed = refit(problem, all, &found.model)?;
    let more = (found.model.modes.len() * 2 * runs) as f64;
    (2.0 * (found.misfit - freed.misfit) - more > threshold).then_some(freed)
}

/// The same without modes that were added before others had found their place, and are no longer
/// worth the fall of 2V that `threshold` asks for.
fn pruned(
    problem: &Problem<'_>,
    (freedom, runs): (Freedom, usize),
    mut now: Descent,
    threshold: f64,
) -> Option<Descent> {
    while now.model.modes.len() > 1 {
        let system = problem.system(&now.model, freedom, Detail::Step)?;
        let places = freedom.places(&now.model);
        let inverse = descent::inverse(&system.information, &places)?;
        let strength = |r: usize| {
            // Participations, which stand side by side.
            let own = RIGID + OF_MODE * r + 2;
            let first = places.partition_point(|p| *p < own);
            let seen: Vec<usize> = (0..6)
                .filter(|j| system.information[(places[first + j], places[first + j])] > 0.0)
                .collect();
            let n = seen.len();
            let covariance = DMatrix::from_fn(n, n, |i, j| {
                0.5 * inverse[(first + seen[i], first + seen[j])]
            });
            let l = &now.model.modes[r].participation;
            let right = DMatrix::from_fn(n, 1, |i, _| l[seen[i]]);
            let solved = super::solve::solve_symmetric(covariance, &right);
            solved.map_or(0.0, |s| right.dot(&s))
        };
        let modes = &now.model.modes;
        let beside = |r: usize| {
            let close =
                |o: usize| o != r && (modes[o].ln_frequency - modes[r].ln_frequency).abs() < DOUBLE;
            (0..modes.len()).any(close)
        };
        // A strong mode by itself is not worth the time of a refit.
        let mut doubtful: Vec<(f64, usize)> = (0..modes.len())
            .map(|r| (strength(r), r))
            .filter(|(strength, r)| *strength < 10.0 * threshold || beside(*r))
            .collect();
        doubtful.sort_by(|a, b| a.0.total_cmp(&b.0));
        let without = |r: usize| {
            let mut fewer = now.model.clone();
            fewer.modes.remove(r);
            for run in &mut fewer.offsets {
                run.remove(r);
            }
            let tried = refit(problem, freedom, &fewer)?;
            let loss = 2.0 * (tried.misfit - now.misfit) - of_a_mode(freedom, runs);
            (loss <= threshold).then_some(tried)
        };
        let Some(tried) = doubtful.iter().find_map(|(_, r)| without(*r)) else {
            break;
        };
        now = tried;
    }
    Some(now)
}

/// E of modes beyond the lines, as a step of Gauss and Newton has it.
pub(super) struct Rest {
    /// Distance from zero, in the squares of what its noise explains (Wald).
    pub(super) statistic: f64,
    /// Terms that the records see: those along directions that do not move have no information.
    seen: Vec<usize>,
    /// Their covariance.
    covariance: DMatrix<f64>,
}

impl Rest {
    /// Of a model with E; nothing of one without.
    pub(super) fn of(problem: &Problem<'_>, model: &Model, freedom: Freedom) -> Option<Self> {
        let mut rest = Self {
            statistic: 0.0,
            seen: Vec::new(),
            covariance: DMatrix::zeros(0, 0),
        };
        let Some(upper) = &model.upper else {
            return Some(rest);
        };
        let system = problem.system(model, freedom, Detail::Step)?;
        let places = freedom.places(model);
        let inverse = descent::inverse(&system.information, &places)?;
        let first = model.upper_at();
        let at: Vec<usize> = (0..places.len())
            .filter(|&i| (first..first + SYMMETRIC).contains(&places[i]))
            .collect();
        rest.seen = (0..at.len())
            .filter(|&i| system.information[(places[at[i]], places[at[i]])] > 0.0)
            .collect();
        let (n, seen) = (rest.seen.len(), &rest.seen);
        rest.covariance = DMatrix::from_fn(n, n, |i, j| 0.5 * inverse[(at[seen[i]], at[seen[j]])]);
        let score = DVector::from_fn(places.len(), |i, _| system.score[places[i]]);
        let step = &inverse * score;
        let e = DMatrix::from_fn(n, 1, |i, _| upper[seen[i]] + step[at[seen[i]]]);
        let solved = super::solve::solve_symmetric(rest.covariance.clone(), &e)?;
        rest.statistic = e.dot(&solved);
        Some(rest)
    }

    fn terms(&self) -> f64 {
        self.seen.len() as f64
    }

    /// Mean of the statistic where E is zero, and so many standard deviations more.
    fn chance(&self, deviations: f64) -> f64 {
        self.terms() + deviations * (2.0 * self.terms()).sqrt()
    }

    /// Weights of the squares and products of E by which the data together tell how large it is (an
    /// empirical prior of the shape of its covariance, Stein's): without them modes beyond the lines
    /// would either cost what the lines have to say, or, left out, bend the numbers by several
    /// standard deviations. `None` where the data tell E term by term.
    pub(super) fn weights(&self) -> Option<DMatrix<f64>> {
        let told = self.statistic > self.chance(TOLD);
        if told || self.seen.is_empty() {
            return None;
        }
        let share = believed(self.statistic, self.terms());
        let n = self.seen.len();
        let own = super::solve::solve_symmetric(self.covariance.clone(), &DMatrix::identity(n, n))?;
        let mut weights = DMatrix::zeros(SYMMETRIC, SYMMETRIC);
        for j in 0..n {
            for i in 0..n {
                weights[(self.seen[i], self.seen[j])] = own[(i, j)] * ((1.0 - share) / share);
            }
        }
        Some(weights)
    }
}

/// Weights of the squares of E that follow from the body: the effective masses of all modes are no more than
/// the body itself, and E is theirs times (ω_hi/ω_r)². They hold the terms that no line tells.
pub(super) fn possible_rest(model: &Model) -> DMatrix<f64> {
    let body = model.rigid_matrix();
    let mut weights = DMatrix::zeros(SYMMETRIC, SYMMETRIC);
    for (at, (i, j)) in triangle().enumerate() {
        let square = body[(i, i)] * body[(j, j)];
        if square > 0.0 {
            weights[(at, at)] = 1.0 / square;
        }
    }
    weights
}

/// A mode beyond the lines from the largest eigenpair of E.
fn beyond(model: &Model, excited: &Excited, frequency: f64) -> Option<FittedMode> {
    let e = model.upper_matrix();
    let directions = &excited.directions;
    let whole = DMatrix::from_fn(6, 6, |i, j| e[(i, j)]);
    let work = directions.transpose() * &whole * directions;
    let strongest = excited.strongest(&work)?;
    // E = L Lᵀ (ω_hi/ω_r)² far below the mode.
    let forces = whole * directions * strongest * (frequency / model.unit);
    let participation = Vector6::from_fn(|i, _| forces[i]);
    Some(FittedMode::new(frequency, 0.01, participation))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Falls that together reach the noise at best, and those that do not; a strong mode that a weak one hid counts for
    /// as long as it is among the last.
    #[test]
    fn a_search_ends_where_no_modes_explain_what_is_left() {
        assert!(!is_hopeless(1000.0, &[1.0; LAST - 1], 20, 1.0));
        assert!(is_hopeless(1000.0, &[1.0; LAST], 20, 1.0));
        assert!(!is_hopeless(1000.0, &[50.0; LAST], 20, 1.0));
        assert!(!is_hopeless(
            1000.0,
            &[1.0, 60.0, 1.0, 1.0, 1.0, 1.0],
            20,
            1.0
        ));
        assert!(is_hopeless(
            1000.0,
            &[60.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            20,
            1.0
        ));
        assert!(is_hopeless(1.5, &[60.0; LAST], 0, 1.0) && !is_hopeless(0.5, &[0.0; LAST], 0, 1.0));
    }
}

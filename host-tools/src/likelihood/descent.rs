//! Levenberg-Marquardt: from start values to the most likely parameters.

use super::leakage::Leaked;
use super::model::{Model, OF_MODE, RIGID, SYMMETRIC};
use super::normal::{self, Detail, STRETCHES};
use super::record::Record;
use super::solve;
use crate::parallel;
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the offsets of ln ω and ln ζ between runs, before the data are seen.
pub const OFFSET: f64 = 0.01;
/// Mean and standard deviation of ln ζ before the data are seen: so wide that they matter only to
/// a mode beyond the lines.
const DAMPING: [f64; 2] = [-4.6, 2.0];
/// The same of the exponent.
const EXPONENT: [f64; 2] = [1.0, 1.0];
/// Largest steps of ln ω, ln ζ and the exponent.
const CLIP: [f64; 3] = [0.05, 0.7, 0.5];

/// Standard deviations over which the observed information is a difference.
const DIFFERENCE: f64 = 0.1;

/// Parameters that may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Freedom {
    /// Parameters of the rigid body that the test tells; the others stay zero.
    pub(super) rigid: [bool; RIGID],
    /// Exponents of the damping.
    pub(super) exponents: bool,
    /// Offsets between runs.
    pub(super) offsets: bool,
}

impl Freedom {
    /// Neither exponents nor offsets.
    pub(super) fn least(rigid: [bool; RIGID]) -> Self {
        Self {
            rigid,
            exponents: false,
            offsets: false,
        }
    }

    /// All parameters but those of the rigid body that the test does not tell.
    pub(super) fn all(rigid: [bool; RIGID]) -> Self {
        Self {
            rigid,
            exponents: true,
            offsets: true,
        }
    }

    /// Places of the free parameters of a model.
    pub(super) fn places(self, model: &Model) -> Vec<usize> {
        let modes = RIGID + OF_MODE * model.modes.len();
        let free = |&i: &usize| {
            let exponent = (RIGID..modes).contains(&i) && (i - RIGID) % OF_MODE == OF_MODE - 1;
            let offset = i >= model.shared();
            let told = self.rigid.get(i).is_none_or(|told| *told);
            told && (!exponent || self.exponents) && (!offset || self.offsets)
        };
        (0..model.parameters()).filter(free).collect()
    }
}

/// Records and how they are worked on.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) records: &'a [Record],
    /// `true` if each record has leakage terms.
    pub(super) leakage: bool,
    /// Threads.
    pub(super) threads: usize,
    /// Means and standard deviations of parameters of the rigid body before the data are seen.
    pub(super) body: Option<&'a [Option<[f64; 2]>; RIGID]>,
    /// Weights of the squares and products of E before the data are seen; none if `None`.
    pub(super) rest: Option<&'a DMatrix<f64>>,
}

/// Misfit, information and score of all records, priors included.
pub(super) struct System {
    /// V with the priors.
    pub(super) misfit: f64,
    /// V of the data alone.
    pub(super) data: f64,
    pub(super) information: DMatrix<f64>,
    pub(super) score: DVector<f64>,
    /// Scores of each record and stretch of frequency.
    pub(super) scores: Vec<DVector<f64>>,
    /// |ε|² of each record and line.
    pub(super) residuals: Vec<Vec<f64>>,
}

impl<'a> Problem<'a> {
    /// Nothing is known before the data are seen.
    pub(super) fn new(records: &'a [Record], leakage: bool, threads: usize) -> Self {
        Self {
            records,
            leakage,
            threads,
            body: None,
            rest: None,
        }
    }

    /// The same with weights of E.
    pub(super) fn beside(self, rest: Option<&'a DMatrix<f64>>) -> Self {
        Self { rest, ..self }
    }

    /// Of each record something, by as many threads as wanted.
    fn each<T: Send>(&self, one: impl Fn(&Record, usize) -> Option<T> + Sync) -> Option<Vec<T>> {
        let one = |e: usize| one(&self.records[e], e).ok_or(());
        if self.threads < 2 {
            return (0..self.records.len()).map(|e| one(e).ok()).collect();
        }
        parallel::each(self.records.len(), Some(self.threads), &one, &mut |_, _| ())
            .ok()
            .map(|(sums, _)| sums)
    }

    /// Weights of E, E, and their product; `None` where nothing is known of E.
    fn known_rest(&self, model: &Model) -> Option<(&DMatrix<f64>, DVector<f64>, DVector<f64>)> {
        let (weights, upper) = (self.rest?, model.upper?);
        let e = DVector::from_column_slice(&upper);
        let pull = weights * &e;
        Some((weights, e, pull))
    }

    /// V with the priors, and V and leakage of each record.
    pub(super) fn misfit(&self, model: &Model, freedom: Freedom) -> Option<(f64, Vec<Leaked>)> {
        let records = self.each(|record, _| normal::misfit(record, model, self.leakage))?;
        let data: f64 = records.iter().map(|r| r.misfit).sum();
        let known = priors(model, freedom, self.body, &mut |_, _, _| ());
        let rest = self
            .known_rest(model)
            .map_or(0.0, |(_, e, pull)| 0.5 * e.dot(&pull));
        Some((data + known + rest, records))
    }

    /// Everything about a model.
    pub(super) fn system(&self, model: &Model, freedom: Freedom, detail: Detail) -> Option<System> {
        let (_, leaked) = self.misfit(model, freedom)?;
        self.system_at(model, freedom, detail, &leaked)
    }

    /// Observed information of the free parameters, at their places: the fall of the score along each, by central
    /// differences over a tenth of its standard deviation by `inverse`, the expected information's. Along directions whose motion is near its noise, the
    /// expected one has the noise's power as well, which tells nothing.
    pub(super) fn observed(
        &self,
        model: &Model,
        freedom: Freedom,
        inverse: &DMatrix<f64>,
    ) -> Option<DMatrix<f64>> {
        let places = freedom.places(model);
        let count = model.parameters();
        let mut information = DMatrix::zeros(count, count);
        let mut step = vec![0.0; count];
        for (j, &place) in places.iter().enumerate() {
            let width = DIFFERENCE * (0.5 * inverse[(j, j)]).sqrt();
            let mut score = |to: f64| {
                let mut moved = model.clone();
                step[place] = to;
                moved.step(&step);
                step[place] = 0.0;
                Some(self.system(&moved, freedom, Detail::Step)?.score)
            };
            let fall = (score(-width)? - score(width)?) / (2.0 * width);
            for &row in &places {
                information[(row, place)] = fall[row];
            }
        }
        Some((&information + information.transpose()) * 0.5)
    }

    /// The same where V and leakage are known.
    fn system_at(
        &self,
        model: &Model,
        freedom: Freedom,
        detail: Detail,
        leaked: &[Leaked],
    ) -> Option<System> {
        let sums = self
            .each(|record, e| normal::sums(record, model, detail, self.leakage, leaked.get(e)?))?;
        let count = model.parameters();
        let mut system = System {
            misfit: 0.0,
            data: 0.0,
            information: DMatrix::zeros(count, count),
            score: DVector::zeros(count),
            scores: Vec::new(),
            residuals: Vec::new(),
        };
        for (record, sums) in self.records.iter().zip(sums) {
            system.data += sums.misfit;
            let targets = targets(model, record.run);
            for (i, of_i) in targets.iter().enumerate() {
                for &g in of_i.iter().flatten() {
                    system.score[g] += sums.score[i];
                    for (j, of_j) in targets.iter().enumerate() {
                        for &h in of_j.iter().flatten() {
                            system.information[(g, h)] += sums.information[(i, j)];
                        }
                    }
                }
            }
            for part in &sums.stretches {
                let mut score = DVector::zeros(count);
                for (i, of_i) in targets.iter().enumerate() {
                    for &g in of_i.iter().flatten() {
                        score[g] += part[i];
                    }
                }
                system.scores.push(score);
            }
            system.residuals.push(sums.residuals);
        }
        let mut known = 0.0;
        if let Some((weights, e, pull)) = self.known_rest(model) {
            known = 0.5 * e.dot(&pull);
            let place = model.upper_at();
            for j in 0..SYMMETRIC {
                system.score[place + j] -= 0.5 * pull[j];
                for i in 0..SYMMETRIC {
                    system.information[(place + i, place + j)] += 0.5 * weights[(i, j)];
                }
            }
        }
        let (information, score) = (&mut system.information, &mut system.score);
        system.misfit = system.data
            + known
            + priors(model, freedom, self.body, &mut |i, weight, away| {
                information[(i, i)] += 0.5 * weight;
                score[i] -= 0.5 * weight * away;
            });
        Some(system)
    }
}

impl System {
    /// Fall of V along a step, were V quadratic.
    fn promised(&self, step: &[f64]) -> f64 {
        let step = DVector::from_column_slice(step);
        2.0 * step.dot(&self.score) - step.dot(&(&self.information * &step))
    }
}

/// Places among all parameters of what one record depends on: a shared parameter, and for ln ω and
/// ln ζ the offset of the run as well.
fn targets(model: &Model, run: usize) -> Vec<[Option<usize>; 2]> {
    let modes = RIGID + OF_MODE * model.modes.len();
    (0..model.shared())
        .map(|i| {
            let term = (i.wrapping_sub(RIGID)) % OF_MODE;
            let offset = (RIGID..modes).contains(&i) && term < 2;
            let own = offset.then(|| model.offset_at(run, (i - RIGID) / OF_MODE) + term);
            [Some(i), own]
        })
        .collect()
}

/// Half the weighted squares of what is known beforehand. `term` hears place, weight and distance.
fn priors(
    model: &Model,
    freedom: Freedom,
    body: Option<&[Option<[f64; 2]>; RIGID]>,
    term: &mut dyn FnMut(usize, f64, f64),
) -> f64 {
    let mut sum = 0.0;
    let mut add = |place: usize, [mean, std]: [f64; 2], value: f64| {
        let (weight, away) = (1.0 / (std * std), value - mean);
        sum += 0.5 * weight * away * away;
        term(place, weight, away);
    };
    for (i, known) in body.into_iter().flatten().enumerate() {
        if let Some(known) = known {
            add(i, *known, model.rigid[i]);
        }
    }
    for (r, mode) in model.modes.iter().enumerate() {
        let at = RIGID + OF_MODE * r;
        add(at + 1, DAMPING, mode.ln_damping);
        if freedom.exponents {
            add(at + 8, EXPONENT, mode.exponent);
        }
    }
    if freedom.offsets {
        for (run, offsets) in model.offsets.iter().enumerate() {
            for (r, pair) in offsets.iter().enumerate() {
                for (k, value) in pair.iter().enumerate() {
                    add(model.offset_at(run, r) + k, [0.0, OFFSET], *value);
                }
            }
        }
    }
    sum
}

/// End of a descent.
#[derive(Clone, Debug)]
pub(super) struct Descent {
    pub(super) model: Model,
    /// V with the priors.
    pub(super) misfit: f64,
    pub(super) iterations: usize,
    /// `true` if V no longer fell.
    pub(super) converged: bool,
}

/// Fall of V at which a descent ends.
const SETTLED: f64 = 0.05;
/// Fall of V that a step promises below which it is not tried.
const NOTHING: f64 = 0.01;
/// Fall of V in the last step up to which a descent that was cut off counts as converged: half the
/// fall that one standard deviation of one parameter makes.
const NEARLY: f64 = 0.25;

/// Follows the misfit downwards for at most `limit` steps. `progress` hears the number of the step
/// and V.
pub(super) fn descend(
    problem: &Problem<'_>,
    start: &Model,
    freedom: Freedom,
    limit: usize,
    progress: &mut dyn FnMut(usize, f64),
) -> Option<Descent> {
    descend_until(problem, start, freedom, (limit, [SETTLED, 0.0]), progress)
}

/// The same until a step takes no more than so much off V, or so large a share of it.
pub(super) fn descend_until(
    problem: &Problem<'_>,
    start: &Model,
    freedom: Freedom,
    (limit, [fall, share]): (usize, [f64; 2]),
    progress: &mut dyn FnMut(usize, f64),
) -> Option<Descent> {
    let mut model = start.clone();
    let places = freedom.places(&model);
    let mut lambda = 1e-3;
    let (_, mut leaked) = problem.misfit(&model, freedom)?;
    let mut done = Descent {
        model: start.clone(),
        misfit: f64::INFINITY,
        iterations: 0,
        converged: false,
    };
    while done.iterations < limit {
        let system = problem.system_at(&model, freedom, Detail::Step, &leaked)?;
        done.misfit = system.misfit;
        progress(done.iterations, system.misfit);
        done.iterations += 1;
        let mut fell = None;
        // Ten decades: beyond that a step moves nothing.
        for _ in 0..10 {
            let step = step(&system, &places, lambda, &model);
            if step.as_ref().is_some_and(|s| system.promised(s) < NOTHING) {
                break;
            }
            let moved = step.map(|step| {
                let mut moved = model.clone();
                moved.step(&step);
                moved
            });
            let tried = moved.and_then(|m| problem.misfit(&m, freedom).map(|v| (m, v)));
            if let Some((moved, (misfit, of_moved))) = tried
                && misfit < system.misfit
            {
                leaked = of_moved;
                fell = Some(system.misfit - misfit);
                model = moved;
                done.misfit = misfit;
                lambda = (lambda * 0.1_f64).max(1e-9);
                break;
            }
            lambda *= 10.0;
        }
        done.model = model.clone();
        let by = fell.unwrap_or(0.0);
        done.converged = by < NEARLY;
        if by < fall.max(share * done.misfit) {
            break;
        }
    }
    Some(done)
}

/// A step of Levenberg and Marquardt for all parameters.
fn step(system: &System, places: &[usize], lambda: f64, model: &Model) -> Option<Vec<f64>> {
    let n = places.len();
    let mut matrix = DMatrix::from_fn(n, n, |i, j| system.information[(places[i], places[j])]);
    let scale = solve::to_unit_diagonal(&mut matrix);
    for j in 0..n {
        matrix[(j, j)] += lambda + if scale[j] > 0.0 { 0.0 } else { 1.0 };
    }
    let right = DVector::from_fn(n, |i, _| system.score[places[i]] * scale[i]);
    let solved = matrix.cholesky()?.solve(&right);
    let mut step = vec![0.0; model.parameters()];
    for (i, &place) in places.iter().enumerate() {
        step[place] = solved[i] * scale[i];
    }
    let modes = RIGID + OF_MODE * model.modes.len();
    for of_mode in step[RIGID..modes].chunks_exact_mut(OF_MODE) {
        for (at, most) in [(0, CLIP[0]), (1, CLIP[1]), (8, CLIP[2])] {
            of_mode[at] = of_mode[at].clamp(-most, most);
        }
    }
    let shared = model.shared();
    for pair in step[shared..].chunks_exact_mut(2) {
        pair[0] = pair[0].clamp(-CLIP[0], CLIP[0]);
        pair[1] = pair[1].clamp(-CLIP[1], CLIP[1]);
    }
    step.iter().all(|x| x.is_finite()).then_some(step)
}

/// Inverse of the information over the free parameters, and the places of these.
pub(super) fn inverse(information: &DMatrix<f64>, places: &[usize]) -> Option<DMatrix<f64>> {
    let n = places.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| information[(places[i], places[j])]);
    solve::solve_symmetric(matrix, &DMatrix::identity(n, n))
}

/// Number of scores that a record gives.
pub(super) const SCORES: usize = STRETCHES;

//! The whole fit: start values, all lines, covariance, and tests of whether it holds.

use super::descent::{self, Descent, Freedom, Problem, System};
use super::excited::Excited;
use super::guess::Body;
use super::leakage::leakage_terms;
use super::model::{Model, RIGID};
use super::normal::Detail;
use super::record::{Record, highest, real_equations};
use super::start;
use super::tilt;
use super::{Progress, Stage};
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix};

/// Covariance of σ.
pub type Covariance10 = SMatrix<f64, RIGID, RIGID>;

/// Most steps of the last descent.
const STEPS: usize = 80;
/// Share of the measured rotation that is motion, from which modes are sought beside a guess of the inertia that the
/// test does not tell, and from which the data say how far that guess may be off. Three directions at rest exceed it in
/// one test of fifty by chance, two in one of ten (40,000 draws), one alone always.
const ROTATES: f64 = 0.65;
/// Most times that the guess of the inertia is widened.
const WIDENED: usize = 3;
/// Power over its noise of the weakest direction up to which error bars come from the observed information.
const NEAR: f64 = 100.0;
/// Share of a variance that the guess of the body has from which the numbers rest on it.
const RESTS_ON_GUESS: f64 = 0.5;
/// Share of the first mode up to which lines are low.
const LOW: f64 = 0.35;
/// Deviation from chance, in standard deviations, from which the base moves along directions that were taken to be at
/// rest, which take part in the fit then: by chance one of five looks at a test exceeds it once in 150 tests.
pub const WANDERING: f64 = 3.0;

/// Reason why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FitError {
    /// Nothing moves more than its noise.
    #[error("no direction of base acceleration rises above the accelerometers' noise")]
    NoExcitation,
    /// Fewer equations than parameters.
    #[error("{equations} equations do not determine {parameters} parameters; record longer")]
    TooFew {
        /// Real equations there are.
        equations: usize,
        /// Parameters of the least model.
        parameters: usize,
    },
    /// Runs that measure different resultants.
    #[error("the runs measure different resultants, which this method does not join")]
    Unlike,
    /// Numbers that are not finite on the way.
    #[error(
        "the fit of the first model fails: numbers of the records are not finite or their noise is zero"
    )]
    Singular,
}

/// Options of a fit.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Start values in place of those that are looked for.
    pub start: Option<Model>,
    /// Threads; none or one: no others are started.
    pub threads: usize,
    /// Parameters σ that the test tells; all if `None`. The others are left out.
    pub rigid: Option<[bool; RIGID]>,
    /// Mass (kg) and those first moments about the reference point (kg m) that the test tells, by another method, from which
    /// the rest of the body is guessed while modes are sought, where the base rotates.
    pub near: Option<[f64; 4]>,
    /// `true` if directions near their noise are taken for rest even where the base moves along them: for modes, which
    /// the others tell.
    pub resting: bool,
}

/// A fit and its tests.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The most likely model.
    pub model: Model,
    /// Covariance of σ from the information matrix.
    pub by_information: Covariance10,
    /// Covariance of σ from the scatter of the score.
    pub by_score: Covariance10,
    /// Covariance of σ: of each number the larger of the two, and what the directions' uncertainty
    /// adds.
    pub covariance: Covariance10,
    /// Share of a variance by information that the guess of the inertia adds, of the told parameter where it is largest.
    pub guess_share: f64,
    /// Standard deviations of ln ω and ln ζ of each mode, as means over the runs.
    pub pole_deviations: Vec<[f64; 2]>,
    /// 2V of the data.
    pub twice_misfit: f64,
    /// Equations less parameters.
    pub freedom: f64,
    /// Steps of the last descent.
    pub iterations: usize,
    /// `true` if V no longer fell at the end.
    pub converged: bool,
    /// Squared distance between the fits of low and of all lines; `None` where there are too few
    /// low lines to tell.
    pub disagreement: Option<f64>,
    /// Number of directions of base acceleration that rise above their noise.
    pub excited: usize,
    /// Least share of its deviation beforehand that a guessed parameter has left, where the numbers rest on the guess and
    /// the base moves along directions near its noise.
    pub left_of_guess: Option<f64>,
    /// Deviation from chance, in standard deviations, of motion along directions near the noise that is otherwise at each
    /// frequency, zero where there is none, if the slope of the score tells no error bars.
    pub untold: Option<f64>,
    /// |ε|² over its expectation of each record, in stretches of frequency from low to high.
    pub residuals: Vec<Vec<f64>>,
    /// First and last line, Hz.
    pub band: [f64; 2],
    /// Lines of all records.
    pub lines: usize,
}

impl Fit {
    /// 2V over its expectation.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.twice_misfit / self.freedom.max(1.0)
    }
}

/// Fits the apparent mass to some records: start values, the descent to the most likely model, its covariance, and the
/// tests of whether it holds.
///
/// # Errors
/// [`FitError`] if the records do not support even a rigid body.
pub fn fit(
    records: &[Record],
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Fit, FitError> {
    let equations = enough(records)?;
    let mut excited = Excited::of(records).ok_or(FitError::NoExcitation)?;
    excited.steady();
    // What the base moves along directions near its noise, and otherwise at each frequency, is motion and no noise to take off.
    let wandering = Some(excited.wandering(records)).filter(|z| *z > WANDERING);
    let all_directions = wandering.is_some() && !options.resting;
    if all_directions {
        excited = Excited::seen(records).ok_or(FitError::NoExcitation)?;
    }
    let is_near = all_directions || (excited.weakest() < NEAR && !options.resting);
    let base = Base {
        wandering,
        is_near,
        noise: records.iter().map(|r| r.noise.base).sum::<Matrix6<f64>>() / records.len() as f64,
        excited,
    };
    let mut projected = records.to_vec();
    base.excited.project(&mut projected);
    let records = &projected;
    let threads = options.threads.max(1);
    let told = options.rigid.unwrap_or([true; RIGID]);
    let (model, body) = started(records, &base, told, options, progress)?;
    let fitted = descended(records, &base, told, (model, body), threads, progress)?;
    let (model, done) = (&fitted.done.model, &fitted.done);
    let problem = fitted.problem(records, threads);
    let system = problem
        .system(model, fitted.freedom, Detail::Test)
        .ok_or(FitError::Singular)?;
    let spread = Spread::of(&fitted, &problem, &system, told, &base)?;
    let leaked: usize = records.iter().map(|r| leakage_terms(r, model)).sum();
    let free = (spread.places.len() + leaked) as f64;
    let expected = |r: &Record| r.equation_count() as f64;
    let residuals = records
        .iter()
        .zip(&system.residuals)
        .map(|(r, lines)| stretches(lines, expected(r)))
        .collect();
    let first = records.iter().filter_map(|r| r.frequencies.first());
    Ok(Fit {
        by_information: spread.by_information,
        by_score: spread.by_score,
        covariance: spread.covariance,
        guess_share: spread.guess_share,
        pole_deviations: spread.pole_deviations(model),
        twice_misfit: 2.0 * system.data,
        freedom: equations as f64 - free,
        iterations: done.iterations,
        converged: done.converged,
        // Low lines are fitted beside the inertia that all lines have: what its guess leaves open is no difference.
        disagreement: low_lines(records, model, &spread.beside, told, threads),
        excited: base.excited.power.len(),
        left_of_guess: fitted
            .body
            .left(&spread.covariance)
            .filter(|_| base.is_near && spread.guess_share > RESTS_ON_GUESS),
        untold: spread.untold,
        residuals,
        band: [
            first.copied().fold(f64::INFINITY, f64::min),
            highest(records),
        ],
        lines: records.iter().map(|r| r.frequencies.len()).sum(),
        model: fitted.done.model,
    })
}

/// Number of real equations of the records.
///
/// # Errors
/// [`FitError::TooFew`] if they are fewer than twice the parameters of the least model, [`FitError::Unlike`].
fn enough(records: &[Record]) -> Result<usize, FitError> {
    let equations = real_equations(records);
    let parameters = RIGID + 21 + 12 * records.len();
    if equations < 2 * parameters {
        return Err(FitError::TooFew {
            equations,
            parameters,
        });
    }
    let rows = records.first().map(|r| r.equations);
    let unlike = |r: &Record| rows.is_some_and(|m| (m - r.equations).norm() > 1e-9);
    if records.iter().any(unlike) {
        return Err(FitError::Unlike);
    }
    Ok(equations)
}

/// How the base moves.
struct Base {
    /// The directions in which it does.
    excited: Excited,
    /// Deviation from chance, in standard deviations, of its motion along directions near its noise, where that is large.
    wandering: Option<f64>,
    /// `true` if it moves along directions near its noise that are in the fit, whose numbers are asked for.
    is_near: bool,
    /// Covariance of the noise of its accelerations, the mean of all records.
    noise: Matrix6<f64>,
}

impl Base {
    /// `true` if so much of its measured rotation is motion that modes are sought beside a guess of the inertia.
    fn rotates(&self) -> bool {
        self.excited.believed > ROTATES
    }
}

/// A model from which the descent may start, and the body beside which its modes were sought.
fn started(
    records: &[Record],
    base: &Base,
    told: [bool; RIGID],
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Model, Body), FitError> {
    if let Some(model) = &options.start {
        return Ok((model.clone(), Body::told(told)));
    }
    let sought = match &options.near {
        Some(near) if base.rotates() => {
            let mut model = Model::rigid([0.0; RIGID], highest(records), 1);
            model.rigid[..4].copy_from_slice(near);
            Body::guessed(told, &model, &base.noise)
        }
        _ => Body::told(told),
    };
    let threads = options.threads.max(1);
    let found = start::start(records, &base.excited, &sought, threads, progress);
    Ok((found.ok_or(FitError::Singular)?, sought))
}

/// The most likely model, and what was taken for likely before the data were seen.
struct Descended {
    done: Descent,
    /// Parameters that were free.
    freedom: Freedom,
    body: Body,
    /// Weights of E.
    weights: Option<DMatrix<f64>>,
}

impl Descended {
    /// The problem whose solution it is.
    fn problem<'a>(&'a self, records: &'a [Record], threads: usize) -> Problem<'a> {
        let problem = self.body.problem(records, threads);
        problem.beside(self.weights.as_ref())
    }
}

/// The most likely model of all lines: with a guess of the inertia that the test does not tell, as wide as the data
/// say, and with terms E that are no larger than the body and their noise make likely.
fn descended(
    records: &[Record],
    base: &Base,
    told: [bool; RIGID],
    (mut model, sought): (Model, Body),
    threads: usize,
    progress: &mut dyn FnMut(Progress),
) -> Result<Descended, FitError> {
    let mut body = Body::guessed(told, &model, &base.noise);
    if sought.free != body.free {
        body.put(&mut model);
    }
    let possible = model.upper.map(|_| start::possible_rest(&model));
    let modes = model.modes.len();
    let freedom = if modes == 0 {
        Freedom::least(body.free)
    } else {
        Freedom::all(body.free)
    };
    let mut descend = |problem: &Problem<'_>, from: &Model, before: usize| {
        let mut step = |iteration: usize, misfit: f64| {
            progress(Progress {
                stage: Stage::Lines,
                modes,
                iteration: before + iteration,
                misfit,
            });
        };
        let done = descent::descend(problem, from, freedom, STEPS, &mut step);
        done.ok_or(FitError::Singular)
    };
    let guesses = body.free != told;
    let mut widenings = if base.rotates() && guesses {
        WIDENED
    } else {
        0
    };
    let mut before = 0;
    let mut done = loop {
        let problem = body.problem(records, threads).beside(possible.as_ref());
        let done = descend(&problem, &model, before)?;
        if widenings == 0 {
            break done;
        }
        widenings -= 1;
        let covariance = informed(&problem, &done.model, freedom)?;
        let Some(wider) = body.widened(&done.model, &covariance) else {
            break done;
        };
        (body, model, before) = (wider, done.model, done.iterations);
    };
    let problem = body.problem(records, threads);
    let rest = start::Rest::of(&problem, &done.model, freedom).ok_or(FitError::Singular)?;
    let shrunk = rest.weights();
    let again = shrunk.is_some();
    let weights = match (possible, shrunk) {
        (Some(possible), Some(shrunk)) => Some(possible + shrunk),
        (possible, _) => possible,
    };
    if again {
        let problem = problem.beside(weights.as_ref());
        done = descend(&problem, &done.model, done.iterations)?;
    }
    Ok(Descended {
        done,
        freedom,
        body,
        weights,
    })
}

/// Uncertainty of a model.
struct Spread {
    /// Places of the free parameters, and their inverse information.
    places: Vec<usize>,
    inverse: DMatrix<f64>,
    /// Covariances of σ: by information, beside a known inertia where the test does not tell it, by the scatter of the
    /// score, and with the uncertainty of the directions in which the base moves.
    by_information: Covariance10,
    beside: Covariance10,
    by_score: Covariance10,
    covariance: Covariance10,
    /// Largest share of a variance by information that the guess of the inertia adds.
    guess_share: f64,
    /// Deviation from chance of motion near its noise whose error bars the slope of the score does not tell, or zero.
    untold: Option<f64>,
}

impl Spread {
    fn of(
        fitted: &Descended,
        problem: &Problem<'_>,
        system: &System,
        rigid: [bool; RIGID],
        base: &Base,
    ) -> Result<Self, FitError> {
        let excited = &base.excited;
        let (model, freedom) = (&fitted.done.model, fitted.freedom);
        let places = freedom.places(model);
        let freedom_told = Freedom { rigid, ..freedom };
        let told = freedom_told.places(model);
        let inverse_of = |places: &[usize]| {
            descent::inverse(&system.information, places).ok_or(FitError::Singular)
        };
        let beside = inverse_of(&told)?;
        let inverse = inverse_of(&places)?;
        let inverse = blended(&inverse, &places, &beside, &told, excited.believed);
        // The information is 2 Σ Re J*J, and the gradient -2 Σ Re J*ε.
        let beside = corner(&beside, &told) * 0.5;
        let observed = || {
            let information = problem.observed(model, freedom, &inverse)?;
            descent::inverse(&information, &places)
        };
        let observed = base.is_near.then(observed).flatten();
        let untold = (base.is_near && observed.is_none()).then_some(base.wandering.unwrap_or(0.0));
        let (inverse, informed) = match observed {
            Some(observed) => {
                // Variance of the score between two inverses of its slope.
                let expected = of_places(&system.information, &places);
                let sandwich = &observed * expected * &observed;
                (observed, sandwich)
            }
            None => (inverse.clone(), inverse),
        };
        let by_information = corner(&informed, &places) * 0.5;
        let guess_share = (told.iter().filter(|&&i| i < RIGID))
            .map(|&i| 1.0 - beside[(i, i)] / by_information[(i, i)])
            .fold(0.0, f64::max);
        let mut scatter = DMatrix::zeros(places.len(), places.len());
        for score in &system.scores {
            let free = DVector::from_fn(places.len(), |i, _| score[places[i]]);
            scatter.ger(1.0, &free, &free, 1.0);
        }
        let by_score = corner(&(&inverse * scatter * &inverse), &places);
        let wider = SMatrix::<f64, RIGID, 1>::from_fn(|i, _| {
            let ratio = by_score[(i, i)] / by_information[(i, i)];
            if ratio > 1.0 { ratio.sqrt() } else { 1.0 }
        });
        let tilted = |freedom: Freedom| {
            tilt::spread(problem, model, freedom, excited).ok_or(FitError::Singular)
        };
        let mut tilt = tilted(freedom_told)?;
        if freedom.rigid != rigid {
            // Inertia that only a rotation tells follows what is wrong about the rotation, by the same shares.
            tilt = tilted(freedom)? * excited.believed + tilt * (1.0 - excited.believed);
        }
        let covariance = Covariance10::from_fn(|i, j| {
            by_information[(i, j)] * wider[i] * wider[j] + tilt[(i, j)]
        });
        Ok(Self {
            places,
            inverse,
            by_information,
            beside,
            by_score,
            covariance,
            guess_share,
            untold,
        })
    }

    /// Standard deviations of ln ω and ln ζ of each mode, as means over the runs: the part that a mode and its offsets
    /// share is held by the offsets' prior alone. Of a parameter that is not free, none.
    fn pole_deviations(&self, model: &Model) -> Vec<[f64; 2]> {
        let runs = model.offsets.len();
        let deviation = |r: usize, k: usize| {
            let of_runs = (0..runs).map(|e| (model.offset_at(e, r) + k, 1.0 / runs as f64));
            let all = std::iter::once((RIGID + super::model::OF_MODE * r + k, 1.0)).chain(of_runs);
            let at = |place| self.places.iter().position(|&p| p == place);
            let mean: Vec<(usize, f64)> = all
                .filter_map(|(place, share)| Some((at(place)?, share)))
                .collect();
            if mean.is_empty() {
                return f64::NAN;
            }
            let pairs = mean.iter().flat_map(|a| mean.iter().map(move |b| (a, b)));
            let variance: f64 = pairs
                .map(|((i, a), (j, b))| a * b * self.inverse[(*i, *j)])
                .sum();
            (0.5 * variance).max(0.0).sqrt()
        };
        (0..model.modes.len())
            .map(|r| [0, 1].map(|k| deviation(r, k)))
            .collect()
    }
}

/// Covariance of σ by information.
fn informed(
    problem: &Problem<'_>,
    model: &Model,
    freedom: Freedom,
) -> Result<Covariance10, FitError> {
    let system = problem.system(model, freedom, Detail::Step);
    let places = freedom.places(model);
    let inverse = system.and_then(|s| descent::inverse(&s.information, &places));
    Ok(corner(&inverse.ok_or(FitError::Singular)?, &places) * 0.5)
}

/// Inverse information of all free parameters, from that with the inertia that the test does not tell as free as its
/// guess is, and that `beside` a known one. The guess's uncertainty bends the centre of gravity by as much as the base
/// truly rotates: by the share of the measured rotation that is `believed`. The rest is noise, whose effect is that
/// of the directions' uncertainty.
fn blended(
    inverse: &DMatrix<f64>,
    places: &[usize],
    beside: &DMatrix<f64>,
    told: &[usize],
    believed: f64,
) -> DMatrix<f64> {
    let mut sum = inverse * believed;
    let at: Vec<Option<usize>> = (places.iter())
        .map(|place| told.iter().position(|p| p == place))
        .collect();
    for (j, b) in at.iter().enumerate() {
        for (i, a) in at.iter().enumerate() {
            if let (Some(a), Some(b)) = (a, b) {
                sum[(i, j)] += beside[(*a, *b)] * (1.0 - believed);
            }
        }
    }
    sum
}

/// Rows and columns of these places.
fn of_places(matrix: &DMatrix<f64>, places: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(places.len(), places.len(), |i, j| {
        matrix[(places[i], places[j])]
    })
}

/// Covariance of σ from that of the free parameters; zero for those that are left out.
pub(super) fn corner(matrix: &DMatrix<f64>, places: &[usize]) -> Covariance10 {
    let mut covariance = Covariance10::zeros();
    for (i, &a) in places.iter().enumerate().filter(|(_, p)| **p < RIGID) {
        for (j, &b) in places.iter().enumerate().filter(|(_, p)| **p < RIGID) {
            covariance[(a, b)] = matrix[(i, j)];
        }
    }
    covariance
}

/// Means of |ε|² over its expectation in stretches of frequency.
fn stretches(lines: &[f64], expected: f64) -> Vec<f64> {
    let n = lines.len();
    (0..descent::SCORES)
        .map(|s| {
            let (from, to) = (s * n / descent::SCORES, (s + 1) * n / descent::SCORES);
            let part = &lines[from..to];
            part.iter().sum::<f64>() / (part.len().max(1) as f64 * expected)
        })
        .collect()
}

/// Squared distance of σ from a fit of the low lines, with their terms in ω² and ω⁴ of the known
/// modes' own curves replaced by free ones.
fn low_lines(
    records: &[Record],
    model: &Model,
    covariance: &Covariance10,
    told: [bool; RIGID],
    threads: usize,
) -> Option<f64> {
    let first = model.modes.iter().map(super::FittedMode::frequency);
    let first = first.fold(f64::INFINITY, f64::min).min(highest(records));
    let low: Vec<Record> = records
        .iter()
        .map(|r| r.thinned(0, 1, LOW * first))
        .filter(|r| r.frequencies.len() > 8)
        .collect();
    if low.is_empty() || real_equations(&low) < 8 * (RIGID + 21 + 12 * low.len()) {
        return None;
    }
    let problem = Problem::new(&low, true, threads);
    // Modes stay where they are; E is free, and takes what they miss in ω². The shape of ω⁴ is theirs.
    let mut fixed = model.clone();
    fixed.upper = Some(model.upper.unwrap_or([0.0; 21]));
    let system = problem.system(&fixed, Freedom::least(told), Detail::Step)?;
    let shared = RIGID + super::model::OF_MODE * fixed.modes.len();
    let places: Vec<usize> = (0..RIGID)
        .filter(|&i| told[i])
        .chain(shared..shared + 21)
        .collect();
    let seen: Vec<usize> = places
        .iter()
        .copied()
        .filter(|&p| system.information[(p, p)] > 0.0)
        .collect();
    let inverse = descent::inverse(&system.information, &seen)?;
    let score = DVector::from_fn(seen.len(), |i, _| system.score[seen[i]]);
    // One step of Gauss and Newton: V is all but quadratic in these.
    let step = &inverse * score;
    let rigid: Vec<usize> = (0..seen.len()).filter(|&i| seen[i] < RIGID).collect();
    let n = rigid.len();
    let d = DVector::from_fn(n, |i, _| step[rigid[i]]);
    // The low lines are among all lines: their fit differs by what the rest adds.
    let spread = DMatrix::from_fn(n, n, |i, j| {
        let (a, b) = (seen[rigid[i]], seen[rigid[j]]);
        0.5 * inverse[(rigid[i], rigid[j])] - covariance[(a, b)]
    });
    let eigen = spread.symmetric_eigen();
    let scale = eigen.eigenvalues.max();
    let mut sum = 0.0;
    for i in 0..n {
        let value = eigen.eigenvalues[i];
        if value > 1e-9 * scale {
            sum += eigen.eigenvectors.column(i).dot(&d).powi(2) / value;
        }
    }
    sum.is_finite().then_some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a rotation that is all motion the guess counts as it is, with one that is all noise as if it were known;
    /// what the test does not tell has the variance of its share alone.
    #[test]
    fn a_guess_counts_by_the_share_of_rotation_that_is_motion() {
        let information =
            DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.5, 1.0, 3.0, 2.0, 0.5, 2.0, 5.0]);
        let (places, told) = ([0, 5, 10], [0, 10]);
        let inverse = descent::inverse(&information, &[0, 1, 2]).unwrap();
        let beside = descent::inverse(&information, &[0, 2]).unwrap();
        let of = |believed| blended(&inverse, &places, &beside, &told, believed);
        assert_eq!(of(1.0), inverse);
        let (none, half) = (of(0.0), of(0.5));
        for (i, a) in [(0, 0), (2, 1)] {
            for (j, b) in [(0, 0), (2, 1)] {
                assert_eq!(none[(i, j)], beside[(a, b)]);
                let mean = 0.5 * (inverse[(i, j)] + beside[(a, b)]);
                assert!((half[(i, j)] - mean).abs() < 1e-15);
            }
            // What is known less tells less about the others.
            assert!(beside[(a, a)] < half[(i, i)] && half[(i, i)] < inverse[(i, i)]);
        }
        assert_eq!(half[(1, 1)], 0.5 * inverse[(1, 1)]);
    }
}

//! Does the twin show what the paper found, and what this project claims?

use super::estimate::{Answer, Numbers, Outcome};
use super::fits::Fits;
use super::monte_carlo::Level;
use super::rows::{Range, Row};
use super::{FewerModes, percent};
use massline_core::masslines::Method;
use serde::Serialize;

/// One claim, held against the figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Short name for scripts.
    pub id: &'static str,
    /// The claim.
    pub claim: String,
    /// `true` if the figures bear it out.
    pub holds: bool,
    /// The figures.
    pub measured: String,
}

/// Names of the parameters, in the order of [`Numbers`].
pub const NAMES: [&str; Numbers::COUNT] = ["x", "z", "Θ_A", "Θ_S", "Δ"];
const THETA_A: usize = 2;
const THETA_S: usize = 3;
/// The parameters that claims are about: Δ is an indicator, not a result.
const RESULTS: usize = 4;

/// Noise-free answers by row.
pub(super) struct Found<'a> {
    rows: Vec<Row>,
    answers: &'a [Answer],
    exact: Numbers,
}

impl<'a> Found<'a> {
    pub(super) fn new(answers: &'a [Answer], exact: Numbers) -> Self {
        Self {
            rows: Row::all(),
            answers,
            exact,
        }
    }

    fn answer(&self, method: Method, range: Range, weighted: bool) -> Option<&'a Answer> {
        let at = self.rows.iter().position(|row| {
            row.method == method && row.range == range && row.weighted == weighted
        })?;
        self.answers.get(at)
    }

    /// Per cent; not numbers where there is no answer, so that no claim holds for them.
    fn errors(&self, outcome: Option<&Outcome>) -> [f64; Numbers::COUNT] {
        match outcome {
            Some(Ok(solution)) => solution.numbers.errors(&self.exact),
            _ => [f64::NAN; Numbers::COUNT],
        }
    }

    fn direct(&self, method: Method, range: Range, weighted: bool) -> [f64; Numbers::COUNT] {
        let answer = self.answer(method, range, weighted);
        self.errors(answer.map(|a| &a.direct))
    }

    fn iterative(&self, method: Method, range: Range, weighted: bool) -> [f64; Numbers::COUNT] {
        let answer = self.answer(method, range, weighted);
        self.errors(answer.map(|a| &a.iterative))
    }

    /// All noise-free claims.
    pub(super) fn checks(&self, fewer_modes: &FewerModes) -> Vec<Check> {
        vec![
            self.synthesis_is_exact(),
            self.free_responses_err_by_a_percent(),
            self.below(Method::FreeResponsesSquared, false, 0.03, "c-squared-small"),
            self.below(Method::ApparentMass, false, 0.001, "apparent-mass-exact"),
            self.cholesky_helps(),
            self.farther_is_worse(),
            self.weighting_improves(Method::FreeResponses, "weighting-improves-c"),
            self.weighting_improves(Method::Synthesis, "weighting-improves-e"),
            self.iteration_improves_c(),
            self.iteration_improves_e(fewer_modes),
        ]
    }

    fn synthesis_is_exact(&self) -> Check {
        let e = self.direct(Method::Synthesis, Range::I, true);
        let close = |i: usize, limit: f64| e[i].abs() <= limit;
        Check {
            id: "e-exact",
            claim: "e, range I, weighted, direct: x, z and Θ_A within 0.05 %, Θ_S within 0.15 %"
                .to_owned(),
            holds: (0..THETA_S).all(|i| close(i, 0.05)) && close(THETA_S, 0.15),
            measured: listed(&e),
        }
    }

    fn free_responses_err_by_a_percent(&self) -> Check {
        let e = self.direct(Method::FreeResponses, Range::I, false);
        let worst = e[..RESULTS].iter().fold(0.0, |w: f64, e| w.max(e.abs()));
        Check {
            id: "c-about-a-percent",
            claim: "c, range I, unweighted: about 1 % (the worst of x, z, Θ_A, Θ_S between \
                    0.3 and 3 %)"
                .to_owned(),
            holds: (0.3..=3.0).contains(&worst),
            measured: listed(&e),
        }
    }

    fn below(&self, method: Method, weighted: bool, limit: f64, id: &'static str) -> Check {
        let e = self.direct(method, Range::I, weighted);
        let row = Row {
            method,
            range: Range::I,
            weighted,
        };
        Check {
            id,
            claim: format!("{}: x, z, Θ_A and Θ_S below {limit} %", row.name()),
            holds: e[..RESULTS].iter().all(|e| e.abs() < limit),
            measured: listed(&e),
        }
    }

    fn cholesky_helps(&self) -> Check {
        let mut holds = true;
        let mut said = Vec::new();
        for (weighted, name) in [(false, "w/o W"), (true, "with W")] {
            let plain = self.direct(Method::PowerSpectra, Range::I, weighted)[THETA_A];
            let factorised = self.direct(Method::PowerSpectraCholesky, Range::I, weighted)[THETA_A];
            holds &= factorised.abs() * 10.0 <= plain.abs();
            said.push(format!(
                "{name}: {} to {}",
                percent::with_unit(plain),
                percent::with_unit(factorised)
            ));
        }
        Check {
            id: "cholesky-helps",
            claim: "Cholesky makes b at least ten times better in Θ_A in range I".to_owned(),
            holds,
            measured: said.join("; "),
        }
    }

    fn farther_is_worse(&self) -> Check {
        let methods = [
            Method::FrequencyResponses,
            Method::PowerSpectraCholesky,
            Method::FreeResponses,
            Method::Synthesis,
        ];
        let mut holds = true;
        let mut said = Vec::new();
        for method in methods {
            for weighted in [false, true] {
                let near = self.direct(method, Range::I, weighted);
                let far = self.direct(method, Range::II, weighted);
                holds &= overall(&far) > overall(&near);
                let row = Row {
                    method,
                    range: Range::II,
                    weighted,
                };
                said.push(format!(
                    "{} {}: {} to {}{}",
                    row.method_name(),
                    row.weight_name(),
                    percent::with_unit(overall(&near)),
                    percent::with_unit(overall(&far)),
                    exceptions(&near, &far, |near, far| far <= near)
                ));
            }
        }
        Check {
            id: "range-two-worse",
            claim: "a, b Cholesky, c and e err more in range II than in I (root mean square of \
                    x, z, Θ_A, Θ_S)"
                .to_owned(),
            holds,
            measured: said.join("; "),
        }
    }

    fn weighting_improves(&self, method: Method, id: &'static str) -> Check {
        let mut holds = true;
        let mut said = Vec::new();
        for range in [Range::I, Range::II] {
            let without = self.direct(method, range, false);
            let with = self.direct(method, range, true);
            holds &= overall(&with) < overall(&without);
            said.push(format!(
                "{}: {} to {}{}",
                range.name(),
                percent::with_unit(overall(&without)),
                percent::with_unit(overall(&with)),
                exceptions(&without, &with, |without, with| with >= without)
            ));
        }
        Check {
            id,
            claim: format!(
                "weighting improves {} (root mean square of x, z, Θ_A, Θ_S)",
                method.name()
            ),
            holds,
            measured: said.join("; "),
        }
    }

    fn iteration_improves_c(&self) -> Check {
        let direct = self.direct(Method::FreeResponses, Range::I, true)[THETA_S];
        let iterative = self.iterative(Method::FreeResponses, Range::I, true)[THETA_S];
        Check {
            id: "iteration-improves-c",
            claim: "iteration improves c in Θ_S (range I, weighted)".to_owned(),
            holds: iterative.abs() < direct.abs(),
            measured: from_to(direct, iterative),
        }
    }

    /// Method e with all modes has no error left that the iteration could take away, so the
    /// claim is about one that misses a mode.
    fn iteration_improves_e(&self, fewer: &FewerModes) -> Check {
        let direct = self.direct(Method::Synthesis, Range::I, true)[THETA_S];
        let iterative = self.iterative(Method::Synthesis, Range::I, true)[THETA_S];
        let row = fewer
            .rows
            .iter()
            .find(|(row, _)| row.range == Range::I && row.weighted);
        let missing = row.map(|(_, answer)| {
            let error = |outcome| self.errors(Some(outcome))[THETA_S];
            [error(&answer.direct), error(&answer.iterative)]
        });
        let [before, after] = missing.unwrap_or([f64::NAN; 2]);
        let exact = direct.abs().max(iterative.abs()) < EXACT;
        Check {
            id: "iteration-improves-e",
            claim: format!(
                "iteration improves e in Θ_S (range I, weighted), or leaves nothing above \
                 {EXACT} %; it does where the modal analysis misses a mode"
            ),
            holds: (iterative.abs() < direct.abs() || exact) && after.abs() < before.abs(),
            measured: format!(
                "all modes: {}; {} modes: {}",
                from_to(direct, iterative),
                fewer.modes,
                from_to(before, after)
            ),
        }
    }
}

/// An error of Θ_S in per cent below which there is nothing to improve: a thirtieth of what
/// method e is allowed.
const EXACT: f64 = 0.005;

fn from_to(before: f64, after: f64) -> String {
    format!(
        "{} to {}",
        percent::with_unit(before),
        percent::with_unit(after)
    )
}

/// Claims about the level of noise that they name.
pub(super) fn noisy(levels: &[Level]) -> Vec<Check> {
    const NOISE: f64 = 0.01;
    let Some(level) = levels.iter().find(|l| (l.noise / NOISE - 1.0).abs() < 1e-9) else {
        return Vec::new();
    };
    let rows = Row::all();
    let errors = |at: usize| &level.rows[at].direct;
    let recommended: Vec<usize> = (0..rows.len())
        .filter(|&at| rows[at].method == Method::ApparentMass)
        .collect();
    let others: Vec<usize> = (0..rows.len())
        .filter(|at| !recommended.contains(at))
        .collect();
    // The row with the least of something; rows without an answer have none.
    let least = |of: &[usize], size: &dyn Fn(usize) -> f64| {
        let answered = of.iter().copied().filter(|&at| size(at).is_finite());
        answered.min_by(|&a, &b| size(a).total_cmp(&size(b)))
    };
    let mut best_everywhere = true;
    let mut said = Vec::new();
    for (i, name) in NAMES.iter().enumerate().take(RESULTS) {
        let rms = |at: usize| errors(at).rms[i];
        let (Some(ours), Some(theirs)) = (least(&recommended, &rms), least(&others, &rms)) else {
            best_everywhere = false;
            continue;
        };
        let ours = percent::with_unit(rms(ours));
        let theirs_is = format!(
            "{} {}",
            rows[theirs].name(),
            percent::with_unit(rms(theirs))
        );
        if least(&[recommended.as_slice(), &others].concat(), &rms) == Some(theirs) {
            best_everywhere = false;
            said.push(format!(
                "{name} {ours}, but {theirs_is}, whose mean errors are {}",
                listed(&errors(theirs).mean)
            ));
        } else {
            said.push(format!("{name} {ours}, next {theirs_is}"));
        }
    }
    let whole = |at: usize| overall(&errors(at).rms);
    let named = |at: Option<usize>| {
        at.map_or_else(
            || "none".to_owned(),
            |at| format!("{} {}", rows[at].name(), percent::with_unit(whole(at))),
        )
    };
    let (ours, theirs) = (least(&recommended, &whole), least(&others, &whole));
    let size = |at: Option<usize>| at.map_or(f64::NAN, whole);
    let e = rows
        .iter()
        .position(|row| row.method == Method::Synthesis && row.range == Range::I && row.weighted);
    let e = e.map_or(f64::NAN, |at| errors(at).rms[THETA_A]);
    let mut checks = vec![
        Check {
            id: "recommended-best-under-noise",
            claim: "1 % noise: the recommended estimator is the best row (root mean square of \
                    x, z, Θ_A, Θ_S)"
                .to_owned(),
            holds: size(ours) < size(theirs),
            measured: format!("{}, next {}", named(ours), named(theirs)),
        },
        Check {
            id: "recommended-best-everywhere-under-noise",
            claim: "1 % noise: the recommended estimator is the best row in every parameter"
                .to_owned(),
            holds: best_everywhere,
            measured: said.join("; "),
        },
        Check {
            id: "e-holds-under-noise",
            claim: "1 % noise: e, range I, weighted, has less than 1 % in Θ_A".to_owned(),
            holds: e < 1.0,
            measured: percent::with_unit(e),
        },
    ];
    checks.extend(level.fits.as_ref().map(twice_as_sharp));
    checks
}

/// All four numbers of the fork: mass (as Δ), two of the centre of gravity, inertia.
const FOUR: [usize; 4] = [0, 1, THETA_A, 4];

/// The claim about the fit through the resonances.
fn twice_as_sharp(fits: &Fits) -> Check {
    let said: Vec<String> = FOUR
        .iter()
        .map(|&i| {
            format!(
                "{} ±{} against ±{}",
                NAMES[i],
                percent::with_unit(fits.claimed[i]),
                percent::with_unit(fits.band_claimed[i])
            )
        })
        .collect();
    // A root mean square of few draws is not known to a third: the error bars tell how sharp, and all errors
    // together whether they are true.
    let squares: f64 = FOUR
        .iter()
        .map(|&i| (fits.fit.rms[i] / fits.claimed[i]).powi(2))
        .sum();
    let honest = (squares / FOUR.len() as f64).sqrt();
    let sharp = |i: &usize| 2.0 * fits.claimed[*i] <= fits.band_claimed[*i];
    Check {
        id: "likelihood-twice-as-sharp",
        claim: "1 % noise: error bars of maximum likelihood are at most half those of the apparent mass of the \
                averaging band in all four numbers, and its errors are as large as they say (within a \
                half)"
            .to_owned(),
        holds: FOUR.iter().all(sharp) && (0.5..1.5).contains(&honest),
        measured: format!(
            "{}; errors are {honest:.2} times the standard deviations",
            said.join("; ")
        ),
    }
}

/// Root mean square of the errors of x, z, Θ_A and Θ_S.
pub(super) fn overall(errors: &[f64; Numbers::COUNT]) -> f64 {
    let squares: f64 = errors[..RESULTS].iter().map(|e| e * e).sum();
    (squares / RESULTS as f64).sqrt()
}

/// ` (not z, Θ_S)`: the parameters that go the other way.
fn exceptions(
    before: &[f64; Numbers::COUNT],
    after: &[f64; Numbers::COUNT],
    other_way: impl Fn(f64, f64) -> bool,
) -> String {
    let names: Vec<&str> = (0..RESULTS)
        .filter(|&i| other_way(before[i].abs(), after[i].abs()))
        .map(|i| NAMES[i])
        .collect();
    if names.is_empty() {
        String::new()
    } else {
        format!(" (not {})", names.join(", "))
    }
}

fn listed(errors: &[f64; Numbers::COUNT]) -> String {
    let named = NAMES.iter().zip(errors).take(RESULTS);
    let said: Vec<String> = named
        .map(|(n, e)| format!("{n} {}", percent::with_unit(*e)))
        .collect();
    said.join(", ")
}

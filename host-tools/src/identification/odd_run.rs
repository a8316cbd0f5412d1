//! A run that contradicts the others, told by its modes where all runs together fit no structure.
//!
//! Each run is fitted by itself. A run is odd if none of its modes is one that others agree on, and if the others
//! without it fit one structure. Modes that all are the same multiple of the others' tell a wrong sample rate.

use super::Refusal;
use crate::likelihood::{self, Doubt, Options, Record};
use crate::setup::Setup;

/// Least number of runs of which one can be odd: of three, the two others may have their modes in common by chance, since
/// a run shows those that it excites.
const LEAST: usize = 4;
/// Relative difference up to which two natural frequencies are of one mode: twice that of a resonance that the study
/// moves in one run.
const SAME: f64 = 0.01;
/// The same of frequencies by another sample rate, all of which are off by one factor.
const MULTIPLE: f64 = 0.003;
/// Modes that have to be multiples by any factor, and by a power of two. Of four modes beside four others, drawn over
/// three octaves, three are by chance in one of 400 runs, and two by a power of two in one of 1500.
const MATCHES: [usize; 2] = [3, 2];

/// The run.
#[derive(Clone, Debug, PartialEq)]
pub struct OddRun {
    /// Its number in the setup.
    pub run: usize,
    /// Its natural frequencies, Hz, ascending.
    pub modes: Vec<f64>,
    /// Natural frequencies of the others over its own, where all are off by one factor.
    pub factor: Option<f64>,
    /// Highest line, Hz.
    pub highest: f64,
}

impl OddRun {
    /// The run among these records, if there is one.
    pub(super) fn among(
        records: &[Record],
        options: &Options,
        progress: &mut dyn FnMut(likelihood::Progress),
    ) -> Option<Self> {
        let mut runs: Vec<usize> = records.iter().map(|r| r.run).collect();
        runs.sort_unstable();
        runs.dedup();
        if runs.len() < LEAST {
            return None;
        }
        let options = Options {
            resting: true,
            ..options.clone()
        };
        let mut fitted = |some: Vec<Record>| likelihood::fit(&some, &options, progress).ok();
        let own: Vec<Vec<f64>> = runs
            .iter()
            .map(|run| fitted(of_runs(records, |r| r == *run)).map_or_else(Vec::new, modes))
            .collect();
        let candidates = runs.iter().zip(&own).enumerate();
        candidates
            .filter_map(|(k, (run, modes))| {
                let others: Vec<&Vec<f64>> = (0..own.len())
                    .filter(|j| *j != k)
                    .map(|j| &own[j])
                    .collect();
                let agreed = agreed(&others);
                let shared = |m: &f64| agreed.iter().any(|f| is_near(*m, *f, SAME));
                // One of its modes may be near theirs by chance.
                let multiple = || factor(modes, &agreed).is_some_and(|f| (f - 1.0).abs() > SAME);
                let other = !agreed.is_empty() && !modes.is_empty() && !modes.iter().any(shared);
                (other || multiple()).then_some((run, modes, agreed))
            })
            .find_map(|(run, modes, agreed)| {
                let rest = fitted(of_runs(records, |r| r != *run))?;
                // Without its drive an axis may hardly move.
                let fits = matches!(
                    rest.doubt(),
                    None | Some(Doubt::Wandering(_) | Doubt::Guess(_))
                );
                fits.then(|| Self {
                    run: *run,
                    modes: modes.clone(),
                    factor: factor(modes, &agreed),
                    highest: likelihood::highest(records),
                })
            })
    }

    fn fact(&self, setup: &Setup) -> String {
        let name = setup.runs.get(self.run).map_or("", |run| &run.name);
        let hertz = |modes: &[f64]| {
            let all: Vec<String> = modes.iter().map(|f| format!("{f:.2}")).collect();
            format!("{} Hz", all.join(", "))
        };
        let modes = match self.factor {
            Some(factor) => format!(
                "its natural frequencies, {}, are {:.3} times theirs",
                hertz(&self.modes),
                1.0 / factor
            ),
            None => format!(
                "none of its natural frequencies, {}, is theirs",
                hertz(&self.modes)
            ),
        };
        format!(
            "run \"{name}\" contradicts the others, which without it fit one structure up to {:.1} Hz: {modes}",
            self.highest
        )
    }

    /// The reason why the numbers must not be believed.
    pub(super) fn refusal(&self, setup: &Setup) -> Refusal {
        Refusal {
            fact: self.fact(setup),
            remedy: match self.factor {
                Some(factor) => format!(
                    "its samples were probably taken {factor:.3} times as often as stated; correct its sample rate, or leave it out"
                ),
                None => {
                    "is it of the same structure and mounting? Leave it out, or record it again"
                        .to_owned()
                }
            },
        }
    }
}

/// Records of some runs, whose numbers begin at zero.
fn of_runs(records: &[Record], wanted: impl Fn(usize) -> bool) -> Vec<Record> {
    let mut some: Vec<Record> = records.iter().filter(|r| wanted(r.run)).cloned().collect();
    let mut runs: Vec<usize> = some.iter().map(|r| r.run).collect();
    runs.sort_unstable();
    runs.dedup();
    for record in &mut some {
        record.run = runs.partition_point(|run| *run < record.run);
    }
    some
}

/// Natural frequencies of a fit, Hz, ascending.
fn modes(fit: likelihood::Fit) -> Vec<f64> {
    let mut all: Vec<f64> = fit.model.modes.iter().map(|m| m.frequency()).collect();
    all.sort_by(f64::total_cmp);
    all
}

fn is_near(a: f64, b: f64, tolerance: f64) -> bool {
    (a / b).ln().abs() < tolerance
}

/// Frequencies that two of these runs have, Hz, as the first of them has them.
fn agreed(runs: &[&Vec<f64>]) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        for f in run.iter() {
            let has = |other: &&Vec<f64>| other.iter().any(|o| is_near(*o, *f, SAME));
            let known = all.iter().any(|a| is_near(*a, *f, SAME));
            if !known && runs[k + 1..].iter().any(has) {
                all.push(*f);
            }
        }
    }
    all
}

/// The factor from which most of some frequencies are others, if more are than by chance.
fn factor(modes: &[f64], others: &[f64]) -> Option<f64> {
    let ratios = |s: f64| -> Vec<f64> {
        let of = |m: &f64| {
            others
                .iter()
                .find(|o| is_near(*m * s, **o, MULTIPLE))
                .map(|o| o / m)
        };
        modes.iter().filter_map(of).collect()
    };
    let tried = modes.iter().flat_map(|m| others.iter().map(move |o| o / m));
    let best = tried.map(ratios).max_by_key(Vec::len)?;
    let logarithm = best.iter().map(|s| s.ln()).sum::<f64>() / best.len() as f64;
    let octaves = logarithm / std::f64::consts::LN_2;
    let is_power = (octaves - octaves.round()).abs() < MULTIPLE && octaves.round() != 0.0;
    let [any, power] = MATCHES;
    (best.len() >= if is_power { power } else { any }).then(|| logarithm.exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_takes_more_than_chance() {
        let others = [37.5, 44.0, 52.0, 68.0];
        let found = factor(&[18.75, 22.0, 25.98], &others).unwrap();
        assert!((found - 2.0).abs() < 2e-3, "{found}");
        let found = factor(&[18.75, 26.0], &others).unwrap();
        assert!((found - 2.0).abs() < 2e-3, "{found}");
        let found = factor(&[37.5 / 1.28, 44.0 / 1.28, 52.0 / 1.28, 90.0], &others).unwrap();
        assert!((found - 1.28).abs() < 2e-3, "{found}");
        // Two by any factor, one by a power of two.
        assert_eq!(factor(&[37.5 / 1.28, 44.0 / 1.28], &others), None);
        assert_eq!(factor(&[18.75, 31.0], &others), None);
        assert_eq!(factor(&[], &others), None);
    }

    #[test]
    fn a_frequency_that_one_run_has_is_not_agreed_on() {
        let runs = [vec![37.5, 98.0], vec![44.0, 37.6], vec![44.1, 125.0]];
        assert_eq!(agreed(&runs.iter().collect::<Vec<_>>()), [37.5, 44.0]);
    }
}

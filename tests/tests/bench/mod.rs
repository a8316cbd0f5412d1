//! A simulated test from the model to the ten numbers, through files as a user has them.

// Each test program uses a part of this.
#![allow(dead_code)]

pub mod fork;

use std::num::NonZero;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use massline::identification::{Answer, Choice, answer};
use massline::result::ResultDocument;
use massline::setup::Setup;
use massline::simulate::{InertiaTruth, Model, Options, Truth, simulate};
use massline_core::identify::Estimate;
use tempfile::TempDir;

/// The folder of the models that ship with the host tool.
pub fn models() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../host-tools/models")
}

/// A model that ships with the host tool.
pub fn model(name: &str) -> Model {
    let path = models().join(name);
    Model::read(&path).unwrap_or_else(|error| panic!("{error}"))
}

/// A simulated test on disk.
pub struct Bench {
    pub setup: Setup,
    pub truth: Truth,
    /// Folder of the recordings, removed on drop.
    pub folder: TempDir,
}

impl Bench {
    /// Simulates a test of a model and writes the files of `massline simulate`.
    pub fn shake(model: &Model, options: &Options) -> Self {
        let simulation =
            simulate(model, options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"));
        let folder = tempfile::tempdir().unwrap();
        let path = simulation.write(folder.path()).unwrap();
        Self {
            setup: Setup::read(&path).unwrap_or_else(|error| panic!("{error}")),
            truth: simulation.truth,
            folder,
        }
    }
}

/// The default estimator's answer to a setup.
pub fn identify(setup: &Setup) -> Answer {
    answer(setup, &Choice::default(), &mut |_| ()).unwrap_or_else(|error| panic!("{error}"))
}

/// The result document, parsed from its JSON.
pub fn document(setup: &Setup, answer: &Answer) -> serde_json::Value {
    serde_json::to_value(ResultDocument::new(setup, answer)).unwrap()
}

/// The six terms in the order of the core: xx, yy, zz, xy, xz, yz.
pub fn terms(inertia: &InertiaTruth) -> [Option<f64>; 6] {
    let InertiaTruth {
        xx,
        yy,
        zz,
        xy,
        xz,
        yz,
    } = *inertia;
    [xx, yy, zz, xy, xz, yz]
}

/// The value of a parameter that must be observable.
#[track_caller]
pub fn value(estimate: Option<Estimate>) -> f64 {
    estimate.expect("must be observable").value
}

/// Errors of an answer.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// Error of the mass as a share of the mass.
    pub mass: f64,
    /// Distance of the centres of gravity over the radius of gyration.
    pub centre_of_gravity: f64,
    /// Largest error of the six terms about S as a share of the largest true one; `None` if the
    /// answer has none of them.
    pub inertia_cg: Option<f64>,
}

impl Errors {
    /// Asserts that mass and CG are known, and of the inertia all six terms, about A and about S,
    /// or none.
    #[track_caller]
    pub fn of(answer: &Answer, truth: &Truth) -> Self {
        let found = &answer.identification;
        let distance = (0..3)
            .map(|i| value(found.centre_of_gravity[i]) - truth.centre_of_gravity[i].unwrap())
            .map(|d| d * d)
            .sum::<f64>()
            .sqrt();
        let about_a = found.inertia_reference.iter().flatten().count();
        let about_s: Vec<f64> = found.inertia_cg.iter().flatten().map(|e| e.value).collect();
        assert!([0, 6].contains(&about_a) && about_s.len() == about_a);
        let expected = terms(&truth.inertia_cg).map(Option::unwrap);
        let largest = expected.iter().fold(0.0_f64, |max, t| max.max(t.abs()));
        Self {
            mass: (value(found.mass) / truth.mass - 1.0).abs(),
            centre_of_gravity: distance / radius_of_gyration(truth),
            inertia_cg: about_s
                .iter()
                .zip(expected)
                .map(|(found, expected)| (found - expected).abs() / largest)
                .reduce(f64::max),
        }
    }

    /// The worst of many in each error.
    pub fn worst(many: &[Self]) -> Self {
        let most = |of: fn(&Self) -> f64| many.iter().map(of).fold(0.0, f64::max);
        Self {
            mass: most(|e| e.mass),
            centre_of_gravity: most(|e| e.centre_of_gravity),
            inertia_cg: many.iter().filter_map(|e| e.inertia_cg).reduce(f64::max),
        }
    }
}

/// Root mean square distance of the mass from S: k² = ∫ |r|² dm / m = tr Θ_S / 2m.
pub fn radius_of_gyration(truth: &Truth) -> f64 {
    let [xx, yy, zz, ..] = terms(&truth.inertia_cg).map(Option::unwrap);
    ((xx + yy + zz) / (2.0 * truth.mass)).sqrt()
}

/// Runs `work` for every seed, on all processors, and returns the results in the seeds' order.
pub fn over_seeds<T: Send>(seeds: RangeInclusive<u64>, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(*seeds.start());
    let helpers = std::thread::available_parallelism().map_or(1, NonZero::get);
    let mut done: Vec<(u64, T)> = std::thread::scope(|scope| {
        let run = || {
            let mut own = Vec::new();
            loop {
                let seed = next.fetch_add(1, Ordering::Relaxed);
                if seed > *seeds.end() {
                    return own;
                }
                own.push((seed, work(seed)));
            }
        };
        let helpers: Vec<_> = (0..helpers).map(|_| scope.spawn(run)).collect();
        helpers
            .into_iter()
            .flat_map(|h| {
                h.join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect()
    });
    done.sort_by_key(|(seed, _)| *seed);
    done.into_iter().map(|(_, result)| result).collect()
}

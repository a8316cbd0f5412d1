//! A simulated 3D elastic structure, 60 s at 512 Hz, through CSV files.
//!
//! The bounds are the project's goal: at 1 % noise 0.05 % of the mass, 0.1 % of the radius of
//! gyration for the CG, 0.5 % of the largest term for all six inertia terms about S; a tenth
//! of that without noise, twice that without a drive channel. The CG's error is the distance
//! between the true and the found one, the radius of gyration the root mean square distance
//! of the mass from S ([`bench::radius_of_gyration`]), 0.705 m here.
//!
//! A plain fit of a polynomial in ω² reaches 0.02, 0.03 and 0.2 % with six runs.

mod bench;

use bench::{Bench, Errors, identify, model, over_seeds};
use massline::simulate::Options;

const SEEDS: std::ops::RangeInclusive<u64> = 1..=10;

/// Largest errors allowed, as shares.
#[derive(Clone, Copy)]
struct Bounds {
    mass: f64,
    centre_of_gravity: f64,
    inertia_cg: f64,
}

const AT_ONE_PERCENT: Bounds = Bounds {
    mass: 5e-4,
    centre_of_gravity: 1e-3,
    inertia_cg: 5e-3,
};

impl Bounds {
    fn times(self, factor: f64) -> Self {
        Self {
            mass: factor * self.mass,
            centre_of_gravity: factor * self.centre_of_gravity,
            inertia_cg: factor * self.inertia_cg,
        }
    }
}

/// Kind of a test.
#[derive(Clone, Copy)]
struct Case {
    model: &'static str,
    noise: f64,
    drive: bool,
    all_ten: bool,
}

const SIX_RUNS: Case = Case {
    model: "satellite.toml",
    noise: 0.01,
    drive: true,
    all_ten: true,
};

#[track_caller]
fn shows(case: Case, bounds: Bounds) {
    let model = model(case.model);
    let all = over_seeds(SEEDS, |seed| {
        let options = Options {
            noise: Some(case.noise),
            seed,
            drive: Some(case.drive),
            ..Options::default()
        };
        let bench = Bench::shake(&model, &options);
        let run = &bench.setup.runs[0];
        assert_eq!(!run.references.is_empty(), case.drive);
        assert_eq!(model.measurement.duration, 60.0);
        assert_eq!(model.measurement.sample_rate, 512.0);
        Errors::of(&identify(&bench.setup), &bench.truth)
    });
    let worst = Errors::worst(&all);
    println!(
        "{} at {} noise, drive {}: worst of {} seeds: mass {:.5} %, CG {:.5} %, Θ_S {:.5} %",
        case.model,
        case.noise,
        case.drive,
        all.len(),
        100.0 * worst.mass,
        100.0 * worst.centre_of_gravity,
        100.0 * worst.inertia_cg.unwrap_or(f64::NAN)
    );
    assert!(worst.mass < bounds.mass, "{all:?}");
    assert!(
        worst.centre_of_gravity < bounds.centre_of_gravity,
        "{all:?}"
    );
    for errors in &all {
        assert_eq!(errors.inertia_cg.is_some(), case.all_ten, "{all:?}");
    }
    if let Some(inertia) = worst.inertia_cg {
        assert!(inertia < bounds.inertia_cg, "{all:?}");
    }
}

#[test]
fn six_runs() {
    shows(SIX_RUNS, AT_ONE_PERCENT);
}

#[test]
fn six_runs_without_noise() {
    let case = Case {
        noise: 0.0,
        ..SIX_RUNS
    };
    shows(case, AT_ONE_PERCENT.times(0.1));
}

#[test]
fn six_runs_without_a_drive_channel() {
    let case = Case {
        drive: false,
        ..SIX_RUNS
    };
    shows(case, AT_ONE_PERCENT.times(2.0));
}

// A drive channel removes the bias of noise; without noise only leakage is left.
#[test]
fn six_runs_without_drive_and_noise() {
    let case = Case {
        drive: false,
        noise: 0.0,
        ..SIX_RUNS
    };
    shows(case, AT_ONE_PERCENT.times(0.2));
}

#[test]
fn three_runs_with_independent_rotations_give_all_ten() {
    let case = Case {
        model: "three-rotations.toml",
        ..SIX_RUNS
    };
    shows(case, AT_ONE_PERCENT);
}

#[test]
fn three_translations_give_mass_and_cg_only() {
    let case = Case {
        model: "three-translations.toml",
        all_ten: false,
        ..SIX_RUNS
    };
    shows(case, AT_ONE_PERCENT);
}

#[test]
fn a_specimen_mounted_three_ways_on_a_vertical_shaker_gives_mass_and_cg_only() {
    let case = Case {
        model: "uniaxial-remounted.toml",
        all_ten: false,
        ..SIX_RUNS
    };
    shows(case, AT_ONE_PERCENT);
}

mod intervals {
    //! The 95 % intervals hold the truth as often as stated.

    use super::bench::{Bench, identify, model, over_seeds, terms};
    use massline::simulate::Options;

    /// Half width of a 95 % interval in standard deviations.
    const TWO_SIDED_95: f64 = 1.959_964;

    // A seed holds the truth in s of its ten intervals. Were the ten independent, s/10 would
    // scatter by √(0.95·0.05/10) = 0.069 about 0.95; over seeds 1 to 200 of this model it
    // scatters by 0.070, so they nearly are. The mean of 40 seeds, which are independent,
    // then scatters by 0.070/√40 = 0.0111, and lies within three times that of 0.95 with a
    // probability of 99.7 %: 0.917 to 0.983.
    //
    // One parameter is missed in 40 seeds twice on average; more than eight misses have a
    // binomial probability of 1.3e-4, ten times that for any of ten.
    #[test]
    fn cover_the_truth_as_often_as_stated() {
        const SEEDS: u64 = 40;
        let model = model("satellite.toml");
        let inside = over_seeds(1..=SEEDS, |seed| {
            let options = Options {
                noise: Some(0.01),
                seed,
                ..Options::default()
            };
            let bench = Bench::shake(&model, &options);
            let found = identify(&bench.setup).identification;
            let truth = &bench.truth;
            let mut all = vec![(found.mass, Some(truth.mass))];
            all.extend(
                found
                    .centre_of_gravity
                    .into_iter()
                    .zip(truth.centre_of_gravity),
            );
            all.extend(found.inertia_cg.into_iter().zip(terms(&truth.inertia_cg)));
            let held = all.into_iter().map(|(found, truth)| {
                let (found, truth) = (found.unwrap(), truth.unwrap());
                assert!(found.std > 0.0);
                (found.value - truth).abs() <= TWO_SIDED_95 * found.std
            });
            held.collect::<Vec<bool>>()
        });
        let held = inside.iter().flatten().filter(|&&held| held).count();
        let share = held as f64 / (10 * SEEDS) as f64;
        println!("{share} of the intervals hold the truth");
        assert!((0.917..=0.983).contains(&share), "{share}");
        for parameter in 0..10 {
            let missed = inside.iter().filter(|held| !held[parameter]).count();
            println!("parameter {parameter}: missed {missed} times");
            assert!(missed <= 8, "parameter {parameter}: missed {missed} times");
        }
    }
}

//! Tests whose runs are stepped sines or static poses, with a fault and without.

use super::bench::BENCHES;
use super::spoil::Spoilt;
use super::trace::{LIMIT, Scene, contradiction};
use crate::detective::{Fault, Findings};
use crate::study::chance::Chance;
use crate::study::coverage::{poses, sine};
use crate::study::trial::Trial;

fn trial(case: &str, seed: u64) -> Trial {
    let mut chance = Chance::new(seed, &["faults", case]);
    let drawn = if case == "sine" {
        sine(&mut chance)
    } else {
        poses(&mut chance)
    };
    let (model, conditions) = drawn.unwrap();
    Trial::new(model, seed, &conditions).unwrap()
}

fn examined(trial: &Trial) -> Findings {
    trial.examine(0.003).unwrap().unwrap()
}

fn named(trial: &Trial) -> Vec<Fault> {
    let findings = examined(trial);
    assert!(!findings.more_is_wrong(), "{findings:?}");
    let of = |s: &crate::detective::Suspect| s.explanations[0].fault.clone();
    findings.suspects.iter().map(of).collect()
}

#[test]
fn stepped_sines_and_poses_accuse_nobody() {
    for case in ["sine", "poses"] {
        for seed in [1, 2, 3] {
            let found = examined(&trial(case, seed));
            assert!(found.clean(), "{case} {seed}: {found:?}");
        }
    }
}

/// Of the accelerometers the first, of the load cells the third: one along z.
#[test]
fn stepped_sines_and_poses_name_the_sensor() {
    for case in ["sine", "poses"] {
        let clean = trial(case, 1);
        let cell = clean.setup.accelerometers.len() + 2;
        for channel in [0, cell] {
            let mut spoilt = clean.clone();
            Spoilt::Inverted(channel).apply(&mut spoilt);
            assert_eq!(named(&spoilt), [Fault::Inverted { channel }], "{case}");
            let mut spoilt = clean.clone();
            Spoilt::Factor(channel, 1000.0).apply(&mut spoilt);
            let [
                Fault::Factor {
                    channel: found,
                    factor,
                },
            ] = named(&spoilt)[..]
            else {
                panic!("{case}: {:?}", examined(&spoilt));
            };
            assert_eq!((found, factor), (channel, 1000.0), "{case}");
        }
        let mut spoilt = clean.clone();
        Spoilt::Reversed.apply(&mut spoilt);
        let found = named(&spoilt);
        assert!(
            matches!(found[..], [Fault::Reversed { .. }]),
            "{case}: {found:?}"
        );
    }
}

/// Two faults of a stepped sine at once.
#[test]
fn stepped_sines_name_a_pair() {
    let mut spoilt = trial("sine", 1);
    let cell = spoilt.setup.accelerometers.len() + 2;
    Spoilt::Inverted(1).apply(&mut spoilt);
    Spoilt::Factor(cell, 2.0).apply(&mut spoilt);
    let mut found: Vec<Vec<usize>> = named(&spoilt).iter().map(Fault::channels).collect();
    found.sort();
    assert_eq!(found, [vec![1], vec![cell]]);
}

/// Load cells that are taken for nothing balance with any body, so that only accelerometers contradict each other.
#[test]
fn accelerometers_alone_leave_a_trace() {
    let satellite = BENCHES.iter().find(|b| b.name == "satellite").unwrap();
    let mut chance = Chance::new(1, &["faults", "satellite"]);
    let (clean, level) = satellite.draw(&mut chance, 1).unwrap().unwrap();
    let accelerometers = clean.setup.accelerometers.len();
    let cells = accelerometers..accelerometers + clean.setup.load_cells.len();
    let nothing: Vec<Fault> = cells.map(|channel| Fault::Dead { channel }).collect();
    let trace = |faults: &[&Spoilt]| {
        contradiction(&Scene {
            clean: &clean,
            level,
            faults,
            mended: &nothing.iter().collect::<Vec<_>>(),
        })
    };
    let [right, wrong] = [trace(&[]), trace(&[&Spoilt::Factor(0, 2.0)])];
    assert!(right < 1e-6, "{right}");
    assert!(wrong > LIMIT, "{wrong}");
}

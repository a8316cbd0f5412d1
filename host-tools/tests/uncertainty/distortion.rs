//! Forces that are no linear functions of the motion.

use crate::draws::Draws;
use crate::setups::{identify, satellite, type_b, uniaxial_of};
use massline::identification::{Answer, Session, estimates, number};

/// The warning of forces that are distorted.
pub fn told(answer: &Answer) -> Option<&str> {
    let mut warnings = answer.warnings.iter();
    let found = warnings.find(|w| w.starts_with("these readings are not linear"));
    found.map(String::as_str)
}

/// Readings of cells beside the forces on them, N: a cubic part of 1 % and of 0.1 % at 1 kN, play of ±5 N, and 2 %
/// less under push than under pull.
const FAULTS: [fn(f64) -> f64; 4] = [
    |x| x + 0.01 * x.powi(3) / 1e6,
    |x| x + 0.001 * x.powi(3) / 1e6,
    |x| x.signum() * (x.abs() - 5.0).max(0.0),
    |x| if x < 0.0 { 0.98 * x } else { x },
];

/// It is said of load cells, and the combined interval holds the truth: gains are taken to be off by what a play would
/// make of the distortion, which is the most of these faults.
#[test]
fn distorted_cells_are_told_and_held() {
    for (fault, drive) in FAULTS.into_iter().flat_map(|f| [(f, true), (f, false)]) {
        let folder = tempfile::tempdir().unwrap();
        let mut distorted = |_: &str, channel: &str, _: f64, x: f64| match channel {
            _ if channel.starts_with("cell") => fault(x),
            _ => x,
        };
        let setup = satellite(&folder, (20.0, 1, drive), &mut distorted);
        let answer = identify(&setup, None);
        let said = told(&answer).expect("a distortion");
        assert!(said.contains("in them: load cells cell"), "{said}");
        assert!(said.ends_with("the intervals with type B uncertainty hold it"));
        let truth = std::fs::read_to_string(folder.path().join("truth.json")).unwrap();
        let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
        let found = estimates(&answer.identification);
        let inertia = ["xx", "yy", "zz", "xy", "xz", "yz"].iter().enumerate();
        let inertia = inertia.map(|(k, key)| (number::INERTIA_CG + k, &truth["inertia_cg"][key]));
        for (k, truth) in inertia.chain([(number::MASS, &truth["mass"])]) {
            let estimate = found[k].unwrap();
            let off = (estimate.value - truth.as_f64().unwrap()).abs();
            // Gains up to their limit are equally likely.
            let limit = 3.0_f64.sqrt() * type_b(&answer).std(k).unwrap() + 4.0 * estimate.std;
            assert!(off < limit, "{k}: {estimate:?} {limit}, {truth}: {said}");
        }
    }
}

/// One cell of twelve is named by itself, with the share that a cube of 1 % has at the RMS of its run.
#[test]
fn a_distorted_cell_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut squares = std::collections::HashMap::new();
    let mut distorted = |run: &str, channel: &str, _: f64, x: f64| match channel {
        "cell3.y" => {
            let (sum, count) = squares.entry(run.to_owned()).or_insert((0.0, 0.0));
            *sum += x * x;
            *count += 1.0;
            FAULTS[0](x)
        }
        _ => x,
    };
    let setup = satellite(&folder, (20.0, 1, true), &mut distorted);
    let answer = identify(&setup, None);
    let said = told(&answer).expect("a distortion");
    assert!(said.contains("in them: load cells cell3.y ("), "{said}");
    assert!(said.contains("\"). A sensor beyond"), "one alone: {said}");
    let told = said
        .split(['(', ' '])
        .filter_map(|word| word.parse::<f64>().ok());
    let told: Vec<f64> = told.take(2).collect();
    let [share, interval] = told[..] else {
        panic!("{said}");
    };
    let run = said.split('"').nth(1).unwrap();
    let (sum, count) = squares[run];
    let cube = 0.01 * sum / count / 1e6;
    // As in the test of normal samples, with the linear part of the cube.
    let expected = 100.0 * 6.0_f64.sqrt() * cube / (1.0 + 24.0 * cube);
    assert!(
        (share - expected).abs() < 2.0 * interval,
        "{said} {expected}"
    );
}

/// An accelerometer of twelve on the interface, which is in all forces, is named, and no cell: with a cube of 1 % at the
/// RMS of one run, and of 20 %.
#[test]
fn a_distorted_accelerometer_is_named() {
    for cube in [0.0025, 0.05] {
        let folder = tempfile::tempdir().unwrap();
        let mut distorted = |_: &str, channel: &str, _: f64, x: f64| match channel {
            "base2.y" => x + cube * x.powi(3),
            _ => x,
        };
        let setup = satellite(&folder, (20.0, 1, true), &mut distorted);
        let answer = identify(&setup, None);
        let said = told(&answer).expect("a distortion");
        assert!(said.contains("in them: accelerometers base2.y ("), "{said}");
        assert!(said.contains("\"). A sensor beyond"), "one alone: {said}");
    }
}

/// A fault of one cell that all forces together do not tell is told by the check, which looks at each cell.
#[test]
fn a_check_looks_at_each_cell() {
    let folder = tempfile::tempdir().unwrap();
    let mut distorted = |_: &str, channel: &str, _: f64, x: f64| match channel {
        "cell3.y" => x + 0.006 * x.powi(3) / 1e6,
        _ => x,
    };
    let setup = satellite(&folder, (20.0, 1, true), &mut distorted);
    assert_eq!(told(&identify(&setup, None)), None);
    let notes = Session::new(&setup).notes(&mut |_| ());
    let [note] = notes.as_slice() else {
        panic!("{notes:?}");
    };
    assert!(note.contains("in them: load cells cell3.y ("), "{note}");
}

/// One force of known distortion: the share that is told, and the uncertainty of the mass, whose limit is √6 times that.
/// A cube of a σ² = 0.1 % has √6 times as much, and bends the mass by 0.3 %. The cube of the reading is more than that
/// of the force, by 24 times a σ².
#[test]
fn the_share_is_that_of_normal_samples() {
    let (deviation, cube) = (12.5 / (1.0_f64 - 0.49).sqrt(), 0.001);
    for drive in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let mut distorted = |_, [a, f]: [f64; 2]| [a, f + cube * f * (f / deviation).powi(2)];
        let mut setup = uniaxial_of(&folder, 65536, &mut distorted);
        if !drive {
            setup.runs[0].references.clear();
        }
        let answer = identify(&setup, None);
        let mass = answer.identification.mass.unwrap().value;
        // The variance of some 11,000 independent samples is known to 1.3 %.
        assert!(
            (mass / 12.5 - 1.0 - 3.0 * cube).abs() < 3.0 * cube * 0.06,
            "{mass}"
        );
        let share = 6.0_f64.sqrt() * cube / (1.0 + 24.0 * cube);
        let b = type_b(&answer).std(number::MASS).unwrap();
        // Its limit is that of the share's 95 % interval, a hundredth of it here.
        let expected = mass * share * 2.0_f64.sqrt();
        assert!(
            (b / expected - 1.01).abs() < 0.06,
            "{drive}: {b} {expected}"
        );
        let said = told(&answer).expect("a distortion");
        assert!(said.contains("in them: load cells fz (0.2"), "{said}");
    }
}

/// The motion at a sample, from its number and a normal one.
type Signal<'a> = &'a dyn Fn(usize, f64) -> f64;

/// Signals of a sound test that are not normal: a sweep that comes again every 2 s, samples that come again with
/// each block, a noise that comes and goes, and a table that distorts. Sensors have 3 % of noise, and there is no drive.
/// Without the limit that noise of the accelerations sets, 1.9 ± 0.7 % of the sweep are told.
#[test]
fn signals_that_are_not_normal_are_not_distorted() {
    let tau = std::f64::consts::TAU;
    let sweep = |n: usize, _: f64| {
        let t = (n % 1024) as f64 / 512.0;
        (tau * (2.0 * t + 10.0 * t * t)).sin()
    };
    let again = |n: usize, _: f64| {
        let mut rng = Draws::new(n as u64 % 1024);
        rng.normal()
    };
    let bursts = |n: usize, x: f64| if n % 1500 < 500 { x } else { 0.0 };
    let table = |_: usize, x: f64| x + 0.05 * x.powi(3);
    let signals: [(&str, Signal<'_>); 4] = [
        ("sweep", &sweep),
        ("again", &again),
        ("bursts", &bursts),
        ("table", &table),
    ];
    for (name, signal) in signals {
        for seed in 1..=5 {
            let folder = tempfile::tempdir().unwrap();
            let mut noise = Draws::new(seed);
            let mut samples = 0;
            let mut readings = |_: f64, [a, _]: [f64; 2]| {
                let x = signal(samples, a);
                samples += 1;
                [
                    x + 0.03 * noise.normal(),
                    12.5 * (x + 0.03 * noise.normal()),
                ]
            };
            let mut setup = uniaxial_of(&folder, 32768, &mut readings);
            setup.runs[0].references.clear();
            let answer = identify(&setup, None);
            assert_eq!(told(&answer), None, "{name} {seed}");
        }
    }
}

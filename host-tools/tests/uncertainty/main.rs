//! Type B uncertainty beside closed forms and beside what perturbed setups give.

mod distortion;
#[path = "../../../core/tests/draws/mod.rs"]
mod draws;
mod drift;
mod setups;

use draws::Draws;
use massline::identification::{Answer, Choice, NUMBERS, Session, Wanted, estimates, number};
use massline::result::ResultDocument;
use massline::setup::{Setup, Uncertainty};
use massline_core::identify::Identification;
use massline_core::masslines::Method;
use setups::{identify, rigid_box, satellite, share, type_b, uniaxial};

#[test]
fn a_gain_is_a_share_of_the_mass() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = uniaxial(&folder);
    let without = identify(&setup, None);
    assert!(without.type_b.is_none());
    let json = serde_json::to_value(ResultDocument::new(&setup, &without)).unwrap();
    assert!(json["mass"].get("type_b").is_none(), "{json}");

    setup.load_cells[0].uncertainty = share(0.02);
    let answer = identify(&setup, None);
    let mass = answer.identification.mass.unwrap();
    let b = type_b(&answer).std(number::MASS).unwrap();
    // m = f / a is linear in the load cell's gain. Responses are single precision, 6e-8, which
    // does not average where all lines are alike as here; the step is a hundredth of 0.02.
    let bound = 3e-4;
    assert!(
        (b / (0.02 * mass.value) - 1.0).abs() < bound,
        "{b} {mass:?}"
    );

    setup.load_cells[0].uncertainty = Uncertainty::default();
    setup.accelerometers[0].uncertainty = share(0.02);
    let b = type_b(&identify(&setup, None)).std(number::MASS).unwrap();
    let expected = 0.02 * mass.value;
    assert!((b / expected - 1.0).abs() < bound, "{b} {expected}");

    // Both, and what the document makes of them.
    setup.load_cells[0].uncertainty = share(0.01);
    let answer = identify(&setup, None);
    let both = type_b(&answer).std(number::MASS).unwrap();
    let expected = expected.hypot(0.01 * mass.value);
    assert!((both / expected - 1.0).abs() < bound, "{both} {expected}");
    let json = serde_json::to_value(ResultDocument::new(&setup, &answer)).unwrap();
    let mass_b = &json["mass"]["type_b"];
    assert_eq!(mass_b["source"], "calibration of az");
    // 4 : 1 in the variances.
    assert!(
        (mass_b["share"].as_f64().unwrap() - 0.8).abs() < 1e-3,
        "{json}"
    );
    let combined = &json["mass"]["combined"];
    let std = combined["std"].as_f64().unwrap();
    assert!((std / mass.std.hypot(both) - 1.0).abs() < 1e-12);
    // Type B has infinitely many degrees of freedom and is far larger: 1.96.
    let interval = combined["interval"].as_f64().unwrap();
    assert!((interval / std - 1.959_964).abs() < 1e-3, "{combined}");
    // What is shown where there is room for one error bar is that of both.
    let document = ResultDocument::new(&setup, &answer);
    assert_eq!(document.mass.half_width(), interval);
    assert!(document.mass.noise_half_width() < 0.1 * interval);
    let margin = answer.identification.plausibility.mass.unwrap();
    let relative = interval / mass.value;
    assert!(
        (margin.uncertainty / relative - 1.0).abs() < 1e-6,
        "{margin:?}"
    );
    let variance = json["covariance_type_b"]["matrix"][0][0].as_f64().unwrap();
    assert!((variance / (both * both) - 1.0).abs() < 1e-12, "{json}");
    // Nothing else is known from one axis, by either type.
    assert!(json["inertia_cg"]["xx"].get("type_b").is_none());
}

/// A certificate in the recording speaks where the setup does not, and before its defaults.
#[test]
fn certificates_count() {
    let folder = tempfile::tempdir().unwrap();
    let setup = uniaxial(&folder);
    let path = folder.path().join("z.csv");
    let rows = std::fs::read_to_string(&path).unwrap();
    let head =
        "# massline recording 1\n# [channel.fz]\n# certificate = \"K 7\"\n# uncertainty = 0.03\n";
    std::fs::write(&path, format!("{head}{rows}")).unwrap();
    let mass_b = |setup: &Setup| {
        let answer = identify(setup, None);
        let mass = answer.identification.mass.unwrap().value;
        type_b(&answer).std(number::MASS).unwrap() / mass
    };
    // Single precision over a step of a hundredth, as above.
    let bound = 6e-6;
    assert!((mass_b(&setup) - 0.03).abs() < bound);
    let mut with_default = setup.clone();
    with_default.defaults.force = share(0.5);
    assert!((mass_b(&with_default) - 0.03).abs() < bound);
    let mut own = setup;
    own.load_cells[0].uncertainty = share(0.01);
    assert!((mass_b(&own) - 0.01).abs() < bound);
}

/// All sensors one millimetre further along an axis are a centre of gravity one millimetre
/// further, the same mass, and the same inertia about it.
#[test]
fn a_shift_of_all_sensors_is_a_shift_of_the_centre_of_gravity() {
    shifted(true);
}

/// The same from cross-spectral matrices.
#[test]
fn without_a_drive_as_well() {
    shifted(false);
}

fn shifted(drive: bool) {
    let folder = tempfile::tempdir().unwrap();
    // Without any noise a single displaced sensor is all that is left over, and equations are
    // weighed by that: each error has its own weights then, and errors do not add up.
    let mut setup = rigid_box(&folder, drive, 1e-3);
    let u = 1e-3;
    setup.defaults.all.position = Some(u);
    let answer = identify(&setup, None);
    let b = type_b(&answer);
    let i = &answer.identification;
    let size = i.inertia_cg[0].unwrap().value;
    for (axis, name) in ["along x", "along y", "along z"].into_iter().enumerate() {
        let of_axis = b.contributions.iter().filter(|c| c.source.ends_with(name));
        let mut sum = [0.0; massline::identification::NUMBERS];
        for c in of_axis {
            for (sum, x) in sum.iter_mut().zip(c.numbers) {
                *sum += x.unwrap_or(0.0);
            }
        }
        // Single precision, 2e-8 on each of some 450 lines of six runs, where the step is 1e-5 of
        // lengths of 0.3 m, and eight blocks: 1e-4 of u.
        for k in 0..3 {
            let expected = if k == axis { u } else { 0.0 };
            let found = sum[number::CENTRE + k];
            assert!((found - expected).abs() < 1e-3 * u, "{name} {k}: {found:e}");
        }
        let mass = sum[number::MASS] / i.mass.unwrap().value;
        assert!(mass.abs() < 1e-5, "{name}: {mass:e}");
        for k in 0..6 {
            let change = sum[number::INERTIA_CG + k] / size;
            assert!(change.abs() < 3e-5, "{name} {k}: {change:e}");
        }
    }
}

/// Setups whose sensors were put elsewhere at random, identified one by one from the same
/// recordings, scatter as the derivative says: recommended method, and one with more in it.
#[test]
fn perturbed_setups_scatter_as_the_derivative_says() {
    const DRAWS: usize = 100;
    let folder = tempfile::tempdir().unwrap();
    // As much noise as the errors leave, so that those alone do not decide what each equation
    // weighs. It is the same in all draws.
    let nominal = rigid_box(&folder, true, 0.01);
    let (place, gain) = (5e-4, 2e-3);
    for method in [None, Some(Method::FreeResponses)] {
        let mut stated = nominal.clone();
        stated.defaults.all = Uncertainty {
            position: Some(place),
            calibration: Some(gain),
            ..Uncertainty::default()
        };
        let answer = identify(&stated, method);
        let b = type_b(&answer);
        let before = estimates(&answer.identification);
        let noise = identify(&nominal, method).identification;
        let margins = margins(&noise);
        let mut margin_squares = [0.0; 2];
        let mut rng = Draws::new(11);
        let mut squares = [0.0; massline::identification::NUMBERS];
        for _ in 0..DRAWS {
            let mut setup = nominal.clone();
            // Channels of one place move as one.
            let mut moved: Vec<([f64; 3], u8, [f64; 3])> = Vec::new();
            let mut shift = |position: &mut [f64; 3], kind: u8, rng: &mut Draws| {
                let known = moved.iter().find(|(p, k, _)| p == position && *k == kind);
                let by = known.map(|(_, _, by)| *by).unwrap_or_else(|| {
                    let by = [(); 3].map(|()| place * rng.normal());
                    moved.push((*position, kind, by));
                    by
                });
                for (x, by) in position.iter_mut().zip(by) {
                    *x += by;
                }
            };
            for a in &mut setup.accelerometers {
                shift(&mut a.position, a.mount as u8, &mut rng);
                a.scale *= 1.0 + gain * rng.normal();
            }
            for c in &mut setup.load_cells {
                shift(&mut c.position, 2, &mut rng);
                c.scale *= 1.0 + gain * rng.normal();
            }
            let perturbed = identify(&setup, method).identification;
            let moved = self::margins(&perturbed);
            for (sum, (after, before)) in margin_squares.iter_mut().zip(moved.iter().zip(margins)) {
                *sum += (after.0 - before.0).powi(2);
            }
            let found = estimates(&perturbed);
            for (sum, (after, before)) in squares.iter_mut().zip(found.iter().zip(&before)) {
                if let (Some(after), Some(before)) = (after, before) {
                    *sum += (after.value - before.value).powi(2);
                }
            }
        }
        for (k, (squares, before)) in squares.into_iter().zip(before).enumerate() {
            let Some(std) = b.std(k) else {
                assert!(before.is_none(), "{k}");
                continue;
            };
            let ratio = (squares / DRAWS as f64).sqrt() / std;
            // A standard deviation of N draws is known to 1 / sqrt(2 N): 7 %. Sixteen numbers
            // of two methods stay within four of these but once in 500 times.
            assert!(
                (ratio - 1.0).abs() < 4.0 / (2.0 * DRAWS as f64).sqrt(),
                "{method:?} {k}: {ratio}"
            );
        }
        // Plausibility is judged by both types: what the noise does not make of a margin's interval
        // is what these draws scatter by.
        let both = self::margins(&answer.identification);
        for (squares, (noise, both)) in margin_squares.iter().zip(margins.iter().zip(both)) {
            let b = (both.1.powi(2) - noise.1.powi(2)).sqrt();
            let ratio = (squares / DRAWS as f64).sqrt() / (b / 1.959_964);
            // Thousands of degrees of freedom are infinite to within some 1e-3.
            assert!(noise.1 < b && noise.0 == both.0, "{noise:?} {both:?}");
            assert!(
                (ratio - 1.0).abs() < 4.0 / (2.0 * DRAWS as f64).sqrt(),
                "{method:?}: {ratio}"
            );
        }
    }
}

/// Smallest principal moment and the triangle's margin with half of the 95 % interval, kg m².
fn margins(i: &Identification) -> [(f64, f64); 2] {
    let scale = i.principal.expect("all six terms").moments.amax();
    let p = i.plausibility;
    [p.positive_definite, p.triangle]
        .map(|m| m.map_or((0.0, 0.0), |m| (m.relative * scale, m.uncertainty * scale)))
}

/// A fit of all lines is judged by both types as the averaging band is: of errors that are far larger than the noise, which
/// both share, it makes the same intervals.
#[test]
fn plausibility_of_a_fit_has_both_types() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = rigid_box(&folder, true, 0.001);
    let fitted = |setup: &Setup| {
        let mut session = Session::new(setup).with_type_b();
        let wanted = Wanted::Likelihood;
        let answer = session.wanted_answer(wanted, &Choice::default(), &mut |_| ());
        let answer = answer.unwrap();
        assert_eq!(answer.method_name(), "ml", "{:?}", answer.warnings);
        margins(&answer.identification)
    };
    let noise = fitted(&setup);
    setup.defaults.all.position = Some(2e-3);
    let band = margins(&identify(&setup, None).identification);
    for ((noise, both), band) in noise.into_iter().zip(fitted(&setup)).zip(band) {
        // Noise that is a twentieth of the whole adds a thousandth to it.
        assert!(noise.1 < band.1 / 20.0, "{noise:?} {band:?}");
        assert!((both.1 / band.1 - 1.0).abs() < 3e-3, "{both:?} {band:?}");
    }
}

/// Errors that are next to nothing leave the plausibility that the core has found without them, of
/// all ten numbers, of some, and beside a weighed mass.
#[test]
fn plausibility_without_errors_is_that_of_the_core() {
    let folder = tempfile::tempdir().unwrap();
    let all = rigid_box(&folder, true, 0.01);
    let mut weighed = all.clone();
    weighed.known_mass = Some(37.0);
    let mut some = all.clone();
    // Along y, about x and about y: two moments of inertia of three.
    some.runs = [1, 3, 4].map(|run| all.runs[run].clone()).to_vec();
    let mut judged = [0; 2];
    for setup in [all, weighed, some] {
        let core = identify(&setup, None).identification.plausibility;
        let mut stated = setup.clone();
        stated.defaults.all.position = Some(1e-9);
        let host = identify(&stated, None).identification.plausibility;
        let pairs = [
            (core.mass, host.mass),
            (core.positive_definite, host.positive_definite),
            (core.triangle, host.triangle),
        ];
        for (core, host) in pairs {
            let Some((core, host)) = core.zip(host) else {
                assert!(core.is_none() && host.is_none(), "{core:?} {host:?}");
                continue;
            };
            assert!(
                (core.relative - host.relative).abs() < 1e-12,
                "{core:?} {host:?}"
            );
            // Responses are single precision, 6e-8, and the step is a hundredth of the error: what
            // rounding looks like, 6e-6, is 5 % of the smallest standard deviation, 1.1e-4 of the
            // mass, and adds to it in quadrature.
            let ratio = host.uncertainty / core.uncertainty;
            assert!((ratio - 1.0).abs() < 1.5e-3, "{core:?} {host:?}");
        }
        judged[usize::from(core.triangle.is_none())] +=
            usize::from(core.positive_definite.is_some());
    }
    assert_eq!(judged, [2, 1]);
}

/// The balance's own uncertainty, without any other.
#[test]
fn a_weighed_mass_has_its_uncertainty() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = uniaxial(&folder);
    setup.known_mass = Some(12.5);
    setup.known_mass_uncertainty = Some(0.05);
    let answer = identify(&setup, None);
    let b = type_b(&answer);
    // Δ is 12.5 kg of the data over the weighed mass.
    let delta = b.std(number::INDICATOR).unwrap();
    assert!((delta / (0.05 / 12.5) - 1.0).abs() < 1e-4, "{delta}");
    assert!((b.std(number::MASS).unwrap() - 0.05).abs() < 1e-12);
    // Data that say 12.5 kg do not contradict 12.4 ± 0.1 kg.
    setup.known_mass = Some(12.4);
    let quiet = identify(&setup, None);
    let speaks = |a: &Answer| a.warnings.iter().any(|w| w.contains("mass weighed"));
    assert!(!speaks(&quiet), "{:?}", quiet.warnings);
    setup.known_mass_uncertainty = None;
    assert!(speaks(&identify(&setup, None)));
}

/// Sensors whose gains, places and directions are off by twice what is usual, which nobody states: what a rigid body
/// leaves tells, and the intervals hold the truth, where those of the noise alone, widened by what is left, do not.
#[test]
fn errors_of_sensors_that_nobody_states_are_held() {
    let folder = tempfile::tempdir().unwrap();
    let sound = satellite(&folder, (20.0, 1, true), &mut |_, _, _, x| x);
    let truth = std::fs::read_to_string(folder.path().join("truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let mut truths = vec![truth["mass"].as_f64().unwrap()];
    truths.extend((0..3).map(|k| truth["centre_of_gravity"][k].as_f64().unwrap()));
    let keys = ["xx", "yy", "zz", "xy", "xz", "yz"];
    truths.extend(keys.map(|key| truth["inertia_cg"][key].as_f64().unwrap()));
    let places = [number::MASS].into_iter();
    let places = places.chain(number::CENTRE..number::INERTIA_REFERENCE);
    let places: Vec<usize> = places.chain(number::INERTIA_CG..NUMBERS).collect();
    let (mut held, mut by_noise) = (0, 0);
    for seed in 0..6 {
        let mut rng = Draws::new(seed);
        let mut setup = sound.clone();
        let mut moved: Vec<([f64; 3], [f64; 3], [f64; 3])> = Vec::new();
        let mut spoil = |position: &mut [f64; 3], direction: &mut [f64; 3], scale: &mut f64| {
            let known = moved.iter().find(|(at, ..)| at == position).copied();
            let (_, by, turn) = known.unwrap_or_else(|| {
                let by = [(); 3].map(|()| 0.002 * rng.normal());
                let turn = [(); 3].map(|()| 1_f64.to_radians() * rng.normal());
                moved.push((*position, by, turn));
                (*position, by, turn)
            });
            let [x, y, z] = *direction;
            let [u, v, w] = turn;
            *direction = [x + v * z - w * y, y + w * x - u * z, z + u * y - v * x];
            position.iter_mut().zip(by).for_each(|(x, by)| *x += by);
            *scale *= 1.0 + 0.01 * rng.normal();
        };
        for a in &mut setup.accelerometers {
            spoil(&mut a.position, &mut a.direction, &mut a.scale);
        }
        for c in &mut setup.load_cells {
            spoil(&mut c.position, &mut c.direction, &mut c.scale);
        }
        let answer = identify(&setup, None);
        let b = type_b(&answer);
        // Twice the usual errors.
        let times = b.times_usual.unwrap();
        assert!((1.0..4.0).contains(&times), "{times}");
        let all = estimates(&answer.identification);
        for (place, truth) in places.iter().zip(&truths) {
            let estimate = all[*place].unwrap();
            let freedom = answer.identification.freedom;
            let both = b.combined(*place, &estimate, freedom).unwrap();
            let off = (estimate.value - truth).abs();
            held += usize::from(off < both.interval);
            by_noise += usize::from(off < estimate.interval(freedom));
        }
        let told = "type B uncertainty holds errors of sensors that explain it";
        assert!(
            answer.warnings.iter().any(|w| w.contains(told)),
            "{:?}",
            answer.warnings
        );
    }
    // Of sixty, at least as many as the intervals say.
    assert!(held >= 57, "{held}");
    assert!(by_noise < 57, "{by_noise}");
}

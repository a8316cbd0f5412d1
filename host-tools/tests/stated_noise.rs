//! Noise where data cannot tell it: stated, seen in repeats, or assumed and said so.

use massline::identification::{Answer, AnswerError, Choice, Session, number};
use massline::result::ResultDocument;
use massline::setup::Setup;
use std::fmt::Write as _;
use tempfile::TempDir;

#[path = "../../core/tests/draws/mod.rs"]
mod draws;
use draws::Draws;

const MASS: f64 = 3.0;
/// Radius of the ring of sensors, m.
const RADIUS: f64 = 0.2;

const PLACES: [[f64; 3]; 4] = [
    [RADIUS, 0.0, 0.0],
    [-RADIUS, 0.0, 0.02],
    [0.0, RADIUS, 0.0],
    [0.0, -RADIUS, 0.02],
];

/// Triaxial accelerometers at the first `count` places of the ring, one six-axis load cell.
fn sensors(count: usize) -> String {
    let mut text = String::new();
    for (k, place) in PLACES.iter().take(count).enumerate() {
        for (axis, d) in ["[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]"].iter().enumerate() {
            let _ = writeln!(
                text,
                "[[accelerometer]]\nchannel = \"a{k}{axis}\"\nposition = {place:?}\ndirection = {d}\nmount = \"interface\"",
            );
        }
    }
    for (quantity, letter) in [("force", 'f'), ("moment", 't')] {
        for (axis, d) in ["[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]"].iter().enumerate() {
            let _ = writeln!(
                text,
                "[[load_cell]]\nchannel = \"{letter}{axis}\"\nposition = [0, 0, 0]\ndirection = {d}\nquantity = \"{quantity}\"",
            );
        }
    }
    text
}

fn header(count: usize) -> Vec<String> {
    let mut names: Vec<String> = (0..3 * count)
        .map(|c| format!("a{}{}", c / 3, c % 3))
        .collect();
    for letter in ['f', 't'] {
        names.extend((0..3).map(|axis| format!("{letter}{axis}")));
    }
    names
}

/// Readings of the channels under a translation `a`: a point mass at (0.01, 0.02, 0.05).
fn readings(count: usize, a: [f64; 3]) -> Vec<f64> {
    let mut all: Vec<f64> = (0..count).flat_map(|_| a).collect();
    let f = a.map(|x| MASS * x);
    let [x, y, z] = [0.01, 0.02, 0.05];
    all.extend(f);
    all.extend([
        y * f[2] - z * f[1],
        z * f[0] - x * f[2],
        x * f[1] - y * f[0],
    ]);
    all
}

/// Stepped sine runs along x, y, z at `lines` frequencies, each read `times` times, with noise of
/// the accelerometers and of the load cells (N; N m a tenth of it).
fn sine(folder: &TempDir, lines: usize, times: usize, noise: [f64; 2]) -> String {
    let mut chance = Draws::new(3);
    let mut runs = String::new();
    for time in 0..times {
        for axis in 0..3 {
            let names = header(4);
            let mut text = "frequency".to_owned();
            for name in &names {
                let _ = write!(text, ",{name}.re,{name}.im");
            }
            let mut a = [0.0; 3];
            a[axis] = 1.0;
            for line in 0..lines {
                let _ = write!(text, "\n{}", 5.0 + line as f64);
                for (c, x) in readings(4, a).into_iter().enumerate() {
                    let std = match c {
                        0..12 => noise[0],
                        12..15 => noise[1],
                        _ => 0.1 * noise[1],
                    };
                    // Both parts share the variance.
                    let [re, im] = [(); 2].map(|()| std * chance.normal() / 2_f64.sqrt());
                    let _ = write!(text, ",{:?},{:?}", x + re, im);
                }
            }
            std::fs::write(folder.path().join(format!("{axis}{time}.csv")), text + "\n").unwrap();
            let name = if time == 0 {
                format!("name = \"{axis}\"\n")
            } else {
                format!("name = \"{axis}, {time}\"\nrepeats = \"{axis}\"\n")
            };
            let _ = write!(
                runs,
                "[[run]]\n{name}recording = \"{axis}{time}.csv\"\nexcitation = \"sine\"\n"
            );
        }
    }
    runs
}

fn identify(folder: &TempDir, text: &str) -> Result<(Setup, Answer), AnswerError> {
    let setup = Setup::from_str(text, &folder.path().join("setup.toml")).unwrap();
    let answer = Session::new(&setup).answer(&Choice::default(), &mut |_| ())?;
    Ok((setup, answer))
}

fn origins((setup, answer): &(Setup, Answer)) -> Vec<(String, String)> {
    let json = serde_json::to_value(ResultDocument::new(setup, answer)).unwrap();
    let word = |v: &serde_json::Value| v.as_str().unwrap().to_owned();
    let list = json["noise"].as_array().unwrap().iter();
    list.map(|n| (word(&n["accelerations"]), word(&n["forces"])))
        .collect()
}

const PROCESSING: &str = "[processing]\naveraging_band = [5, 7]\n";

fn stated(noise: [f64; 2]) -> String {
    format!(
        "[defaults.accelerometer]\nnoise = {}\n[defaults.force]\nnoise = {}\n[defaults.moment]\nnoise = {}\n",
        noise[0],
        noise[1],
        0.1 * noise[1]
    )
}

/// Three lines, no neighbours: translations read with 0.5 % of noise look like rotations, and
/// only what is known of the noise says that they are none.
#[test]
fn three_lines_of_a_stepped_sine_need_to_be_told_their_noise() {
    let noise = [5e-3, 5e-3];
    let folder = tempfile::tempdir().unwrap();
    let runs = sine(&folder, 3, 1, noise);
    let text = |defaults: &str| format!("{PROCESSING}{defaults}{}{runs}", sensors(4));

    let assumed = identify(&folder, &text("")).unwrap();
    let both = |word: &str| vec![(word.to_owned(), word.to_owned()); 3];
    assert_eq!(origins(&assumed), both("assumed"));
    let says = |(_, a): &(Setup, Answer)| {
        a.warnings
            .iter()
            .any(|w| w.contains("rest on that assumption"))
    };
    assert!(says(&assumed));
    let inertia = |(_, a): &(Setup, Answer)| a.identification.observable[4..].contains(&true);
    assert!(
        inertia(&assumed),
        "the floor alone takes noise for a rotation"
    );

    let told = identify(&folder, &text(&stated(noise))).unwrap();
    assert_eq!(origins(&told), both("stated"));
    assert!(
        !says(&told) && !inertia(&told),
        "{:?}",
        told.1.identification
    );
    assert!(told.1.identification.observable[..4].iter().all(|o| *o));

    // Of accelerometers only: forces are assumed still, and some of a kind are none.
    let half = "[defaults.accelerometer]\nnoise = 0.005\n";
    let mixed = identify(&folder, &text(half)).unwrap();
    assert_eq!(
        origins(&mixed)[0],
        ("stated".to_owned(), "assumed".to_owned())
    );
    let one = text("").replacen("mount =", "noise = 0.005\nmount =", 1);
    let some = identify(&folder, &one).unwrap();
    assert_eq!(origins(&some), both("assumed"));
    let lists = |w: &String| w.contains("some accelerometers only") && w.contains("a01, a02");
    assert!(some.1.warnings.iter().any(lists), "{:?}", some.1.warnings);
}

#[test]
fn repeats_of_a_stepped_sine_tell_its_noise() {
    let noise = [5e-3, 8e-3];
    let folder = tempfile::tempdir().unwrap();
    let runs = sine(&folder, 3, 4, noise);
    let text = format!("{PROCESSING}{}{runs}", sensors(4));
    let found = identify(&folder, &text).unwrap();
    let repeats = ("repeats".to_owned(), "repeats".to_owned());
    assert_eq!(origins(&found), vec![repeats; 12]);
    let i = &found.1.identification;
    assert!(i.observable[..4].iter().all(|o| *o) && !i.observable[4..].contains(&true));
    for run in &found.1.measurement.sines {
        let forces = run.noise.force;
        for j in 0..6 {
            let std = if j < 3 { noise[1] } else { 0.1 * noise[1] };
            // Three times two parts of three lines: eighteen degrees of freedom know a variance
            // to a third. Four of these, on eighteen numbers of which four runs each share one.
            let ratio = forces[(j, j)] / (std * std);
            assert!(
                (ratio - 1.0).abs() < 4.0 * (2.0_f64 / 18.0).sqrt(),
                "{j}: {ratio}"
            );
        }
    }
}

/// Noise of the load cells in poses, N and N m.
const FORCE: f64 = 0.01;

fn poses(folder: &TempDir, times: usize, labelled: bool, noise: f64) -> String {
    let mut chance = Draws::new(5);
    let mut names = header(1);
    if labelled {
        names.push("pose".to_owned());
    }
    let mut text = names.join(",");
    for pose in 0..12 {
        let mut g = [(); 3].map(|()| chance.normal());
        let size = g.iter().map(|x| x * x).sum::<f64>().sqrt();
        g = g.map(|x| 9.81 * x / size);
        for _ in 0..times {
            let row: Vec<String> = readings(1, g)
                .into_iter()
                .enumerate()
                .map(|(c, x)| {
                    let std = if c < 3 { noise } else { FORCE };
                    format!("{:?}", x + std * chance.normal())
                })
                .collect();
            let _ = write!(text, "\n{}", row.join(","));
            if labelled {
                let _ = write!(text, ",{pose}");
            }
        }
    }
    std::fs::write(folder.path().join("poses.csv"), text + "\n").unwrap();
    "[[run]]\nname = \"poses\"\nrecording = \"poses.csv\"\nexcitation = \"static\"\n".to_owned()
}

#[test]
fn poses_of_one_triaxial_accelerometer_need_to_be_told_their_noise() {
    let noise = 2e-3;
    let folder = tempfile::tempdir().unwrap();
    let origin = |found: &(Setup, Answer)| origins(found)[0].0.clone();
    // No more than three accelerometers: nothing is left over that would tell.
    let run = poses(&folder, 3, false, noise);
    let plain = identify(&folder, &format!("{}{run}", sensors(1))).unwrap();
    assert_eq!(origin(&plain), "assumed");
    assert!(plain.1.warnings.iter().any(|w| w.contains("column `pose`")));
    let text = format!("{}{}{run}", stated([noise, FORCE]), sensors(1));
    let told = identify(&folder, &text).unwrap();
    assert_eq!(origin(&told), "stated");
    let run = poses(&folder, 3, true, noise);
    let repeated = identify(&folder, &format!("{}{run}", sensors(1))).unwrap();
    assert_eq!(origin(&repeated), "repeats");
    for (found, degrees) in [(&told, f64::INFINITY), (&repeated, 72.0)] {
        let poses = &found.1.measurement.poses[0];
        // Twelve poses with two more readings of three channels: 72 degrees of freedom, a sixth
        // of a variance; four of these. What is stated is exact but for the resolution of 1e-6 of
        // 9.81 m/s², 2.4e-5 of this variance.
        let bound = 4.0 * (2.0_f64 / degrees).sqrt() + 3e-5;
        for j in 0..3 {
            let ratio = poses.noise[(j, j)] / (noise * noise);
            assert!((ratio - 1.0).abs() < bound, "{j}: {ratio}");
        }
        assert!(!found.1.warnings.iter().any(|w| w.contains("assum")));
    }
}

/// Few blocks without a drive leave nothing that tells noise from signal; who knows the noise of
/// the sensors has an answer nevertheless.
#[test]
fn few_blocks_without_a_drive_need_to_be_told_their_noise() {
    let folder = tempfile::tempdir().unwrap();
    let noise = [1e-2, 3e-2];
    let mut chance = Draws::new(9);
    let mut runs = String::new();
    for axis in 0..3 {
        let mut text = header(4).join(",");
        let mut x = 0.0;
        for _ in 0..1024 {
            x = 0.7 * x + chance.normal();
            let mut a = [0.0; 3];
            a[axis] = x;
            let row: Vec<String> = readings(4, a)
                .into_iter()
                .enumerate()
                .map(|(c, x)| {
                    let std = match c {
                        0..12 => noise[0],
                        12..15 => noise[1],
                        _ => 0.1 * noise[1],
                    };
                    format!("{:?}", x + std * chance.normal())
                })
                .collect();
            let _ = write!(text, "\n{}", row.join(","));
        }
        std::fs::write(folder.path().join(format!("{axis}.csv")), text + "\n").unwrap();
        let _ = write!(
            runs,
            "[[run]]\nname = \"{axis}\"\nrecording = \"{axis}.csv\"\n"
        );
    }
    let head = "[processing]\nsample_rate = 256.0\nblock_length = 512\naveraging_band = [5, 40]\n";
    let text = |defaults: &str| format!("{head}{defaults}{}{runs}", sensors(4));
    let Err(refused) = identify(&folder, &text("")) else {
        panic!("three blocks tell no noise");
    };
    assert_eq!(refused.exit_code(), 1);
    let message = refused.to_string();
    assert!(
        message.contains("3 blocks") && message.contains("`noise`"),
        "{message}"
    );

    let told = identify(&folder, &text(&stated(noise))).unwrap();
    assert_eq!(
        origins(&told)[0],
        ("stated".to_owned(), "stated".to_owned())
    );
    let i = &told.1.identification;
    assert!(i.observable[..4].iter().all(|o| *o), "{i:?}");
    assert!(!i.observable[4..].contains(&true), "nothing turned: {i:?}");
    let mass = i.mass.unwrap();
    // Once in 1e4 times beyond four standard deviations; the seed is fixed.
    assert!((mass.value - MASS).abs() < 4.0 * mass.std, "{mass:?}");
    assert!(mass.std < 0.02 * MASS, "{mass:?}");
}

/// All load cells too sensitive by one share are a mass that is too large by that share, and the
/// same centre of gravity (Euler's theorem: the sum of the derivatives), by poses and sines.
#[test]
fn gains_of_all_load_cells_add_up_to_that_of_the_mass() {
    let folder = tempfile::tempdir().unwrap();
    let noise = [1e-3, 1e-3];
    let u = 1e-3;
    let gains = format!(
        "[defaults.accelerometer]\nnoise = 1e-3\n[defaults.force]\ncalibration_uncertainty = {u}\n[defaults.moment]\ncalibration_uncertainty = {u}\n"
    );
    for (head, sensors, runs) in [
        (PROCESSING, sensors(4), sine(&folder, 8, 1, noise)),
        ("", sensors(1), poses(&folder, 1, false, 1e-3)),
    ] {
        let text = format!("{head}{gains}{sensors}{runs}");
        let setup = Setup::from_str(&text, &folder.path().join("setup.toml")).unwrap();
        let mut session = Session::new(&setup).with_type_b();
        let answer = session.answer(&Choice::default(), &mut |_| ()).unwrap();
        let type_b = answer.type_b.as_ref().unwrap();
        assert_eq!(type_b.contributions.len(), 6);
        let sum = |number: usize| -> f64 {
            let all = type_b.contributions.iter();
            all.map(|c| c.numbers[number].unwrap()).sum()
        };
        let mass = answer.identification.mass.unwrap().value;
        // A step of u / 100 adds some 17 N times 1e-5 to what is left of a channel's 0.01 N, of
        // its power 3e-4, and equations are weighed by that.
        let found = sum(number::MASS) / (u * mass);
        assert!((found - 1.0).abs() < 1e-3, "{head}: {found}");
        for axis in 0..3 {
            let moved = sum(number::CENTRE + axis);
            assert!(moved.abs() < 1e-3 * u, "{head} {axis}: {moved:e}");
        }
    }
}

#[test]
fn a_repeat_names_a_run_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "{PROCESSING}{}{}",
        sensors(4),
        sine(&folder, 3, 2, [1e-3, 1e-3])
    );
    let refused = |text: &str| {
        let path = folder.path().join("setup.toml");
        Setup::from_str(text, &path).unwrap_err().to_string()
    };
    for (from, to, part) in [
        (
            "repeats = \"0\"",
            "repeats = \"4\"",
            "a run that stands before",
        ),
        (
            "repeats = \"2\"",
            "repeats = \"1, 1\"",
            "the first of the runs",
        ),
        (
            "repeats = \"0\"",
            "repeats = \"0\"\nrotation = [0, 0, 90]",
            "stands as in this one",
        ),
    ] {
        assert!(text.contains(from));
        let message = refused(&text.replacen(from, to, 1));
        assert!(
            message.contains(part) && message.contains("`repeats`"),
            "{message}"
        );
    }
    let random = text.replace("excitation = \"sine\"\n", "");
    assert!(refused(&random).contains("column `pose`"));
}

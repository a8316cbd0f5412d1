//! One run in which several drives shake at once: `reference` as a list.

use massline::identification::{Answer, AnswerError, Choice, Session};
use massline::setup::Setup;
use massline_core::geometry::{Accelerometer, LoadCell, Mount, Quantity};
use massline_core::masslines::Method;
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::{Matrix6, Vector3, Vector6};
use std::fmt::Write;
use std::path::Path;

#[path = "../../core/tests/draws/mod.rs"]
mod draws;
use draws::Draws;

const POSITIONS: [[f64; 3]; 6] = [
    [0.5, 0.5, 0.0],
    [0.5, 0.5, 0.0],
    [0.5, 0.5, 0.0],
    [-0.5, 0.5, 0.0],
    [-0.5, 0.5, 0.0],
    [0.5, -0.5, 0.0],
];
const DIRECTIONS: [[f64; 3]; 6] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, 1.0],
];
const RATE: f64 = 512.0;

fn body() -> RigidBody {
    RigidBody {
        mass: 120.0,
        centre_of_gravity: Vector3::new(0.1, -0.05, 0.4),
        inertia: Inertia::from_terms([15.0, 18.0, 12.0, 0.5, -0.8, 0.3]),
    }
}

/// 40 seconds of six shakers, each of which moves the table mainly one way; 1 % of noise on
/// every sensor. The seventh drive is the sum of the first two. Returns the setup's text.
fn record(folder: &Path) -> String {
    let origin = Vector3::zeros();
    let accelerometers: Vec<Accelerometer> = POSITIONS
        .iter()
        .zip(DIRECTIONS)
        .map(|(p, d)| Accelerometer::new((*p).into(), d.into(), Mount::Interface).unwrap())
        .collect();
    let cells: Vec<LoadCell> = POSITIONS
        .iter()
        .zip(DIRECTIONS)
        .map(|(p, d)| LoadCell::new((*p).into(), d.into(), Quantity::Force).unwrap())
        .collect();
    let to_resultants = Matrix6::from_fn(|i, j| cells[j].rigid_body_row(&origin)[i]);
    let to_cells = to_resultants.try_inverse().unwrap();
    let matrix = body().mass_matrix(&origin);
    let mut noise = Draws::new(1);
    let gains = Matrix6::from_fn(|i, j| {
        let gain = if i < 3 { 1.0 } else { 2.0 };
        if i == j {
            gain
        } else {
            0.1 * gain * noise.normal()
        }
    });
    let rows: Vec<([f64; 6], [f64; 12])> = (0..(40.0 * RATE) as usize)
        .map(|_| {
            let drives: [f64; 6] = core::array::from_fn(|_| noise.normal());
            let a = gains * Vector6::from(drives);
            let f = to_cells * (matrix * a);
            let read = |j: usize| {
                if j < 6 {
                    (accelerometers[j].rigid_body_row(&origin) * a)[0]
                } else {
                    f[j - 6]
                }
            };
            (drives, core::array::from_fn(read))
        })
        .collect();
    let rms: [f64; 12] = core::array::from_fn(|j| {
        let power: f64 = rows.iter().map(|(_, r)| r[j] * r[j]).sum();
        (power / rows.len() as f64).sqrt()
    });
    let mut csv = String::from("a1,a2,a3,a4,a5,a6,f1,f2,f3,f4,f5,f6,d1,d2,d3,d4,d5,d6,d12\n");
    for (drives, read) in &rows {
        for (x, rms) in read.iter().zip(rms) {
            let _ = write!(csv, "{:.7e},", x + 0.01 * rms * noise.normal());
        }
        let [first, second, ..] = drives;
        for d in drives {
            let _ = write!(csv, "{d:.7e},");
        }
        let _ = writeln!(csv, "{:.7e}", first + second);
    }
    std::fs::write(folder.join("run.csv"), csv).unwrap();
    let mut setup = format!(
        "[processing]\nsample_rate = {RATE}\nblock_length = 1024\naveraging_band = [2.0, 60.0]\n"
    );
    for (k, (p, d)) in POSITIONS.iter().zip(DIRECTIONS).enumerate() {
        let k = k + 1;
        let _ = write!(
            setup,
            "[[accelerometer]]\nchannel = \"a{k}\"\nposition = {p:?}\ndirection = {d:?}\nmount = \"interface\"\n\
             [[load_cell]]\nchannel = \"f{k}\"\nposition = {p:?}\ndirection = {d:?}\n"
        );
    }
    setup.push_str("[[run]]\nname = \"all\"\nrecording = \"run.csv\"\n");
    setup
}

fn answer(
    folder: &Path,
    setup: &str,
    reference: &str,
    method: Method,
) -> Result<Answer, AnswerError> {
    let setup = Setup::from_str(&format!("{setup}{reference}\n"), &folder.join("setup.toml"));
    let choice = Choice {
        method: Some(method),
        ..Choice::default()
    };
    Session::new(&setup.unwrap()).answer(&choice, &mut |_| ())
}

/// Number of the ten that are told, and the largest error among them in standard deviations.
fn told(answer: &Answer) -> (usize, f64) {
    let exact = body();
    let c = exact.centre_of_gravity;
    let t = &exact.inertia;
    let i = &answer.identification;
    let found = [i.mass]
        .into_iter()
        .chain(i.centre_of_gravity)
        .chain(i.inertia_cg);
    let expected = [
        exact.mass, c.x, c.y, c.z, t.xx, t.yy, t.zz, t.xy, t.xz, t.yz,
    ];
    let errors: Vec<f64> = found
        .zip(expected)
        .filter_map(|(e, exact)| e.map(|e| (e.value - exact).abs() / e.std))
        .collect();
    (errors.len(), errors.iter().copied().fold(0.0, f64::max))
}

/// One list of all drives: with one of them named, nine of ten numbers went missing and the
/// mass was a seventh off.
#[test]
fn all_drives_together_tell_all_ten() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let setup = record(folder);
    let six = "reference = [\"d1\", \"d2\", \"d3\", \"d4\", \"d5\", \"d6\"]";
    for method in [
        Method::ApparentMass,
        Method::FrequencyResponses,
        Method::PowerSpectraCholesky,
        Method::FreeResponses,
    ] {
        let answer = answer(folder, &setup, six, method).unwrap();
        let (count, worst) = told(&answer);
        // The largest of ten normal numbers exceeds four in one of 1600 draws.
        assert_eq!(count, 10, "{method:?}");
        assert!(worst < 4.0, "{method:?}: {worst} standard deviations off");
        assert_eq!(answer.measurement.runs.len(), 6);
        assert_eq!(answer.measurement.runs[2].name, "all (d3)");
        let warned = answer.warnings.iter().any(|w| w.contains("explains less"));
        assert!(!warned, "{:?}", answer.warnings);
    }
}

#[test]
fn one_drive_of_six_is_said_to_explain_little() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let setup = record(folder);
    let one = answer(folder, &setup, "reference = \"d1\"", Method::ApparentMass);
    let said = match &one {
        Ok(one) => one.warnings.clone(),
        Err(error) => vec![error.to_string()],
    };
    let warning = said.iter().find(|w| w.contains("explains less"));
    let warning = warning.unwrap_or_else(|| panic!("{said:?}"));
    for expected in ["run \"all\"", "(d1)", "d2, d3, d4, d5, d6", "reference = ["] {
        assert!(warning.contains(expected), "{warning}");
    }
    // Without a drive nothing is thrown away.
    let none = answer(folder, &setup, "", Method::ApparentMass).unwrap();
    assert_eq!(told(&none).0, 10);
    assert!(!none.warnings.iter().any(|w| w.contains("explains less")));
}

#[test]
fn a_drive_that_others_explain_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let setup = record(folder);
    let seven = "reference = [\"d1\", \"d2\", \"d12\", \"d3\", \"d4\", \"d5\", \"d6\"]";
    let answer = answer(folder, &setup, seven, Method::ApparentMass).unwrap();
    let (count, worst) = told(&answer);
    assert!(count == 10 && worst < 4.0, "{count}, {worst}");
    assert_eq!(answer.measurement.runs.len(), 6);
    let noted = |w: &String| w.contains("explain d12 in full");
    assert!(answer.warnings.iter().any(noted), "{:?}", answer.warnings);
}

#[test]
fn a_list_of_drives_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let setup = "[processing]\naveraging_band = [2.0, 60.0]\n\
        [[accelerometer]]\nchannel = \"a\"\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\n\
        [[load_cell]]\nchannel = \"f\"\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\n\
        [[run]]\nname = \"r\"\nrecording = \"r.csv\"\n";
    let read = |reference: &str| {
        let text = format!("{setup}reference = {reference}\n");
        Setup::from_str(&text, &folder.path().join("setup.toml"))
    };
    for (reference, complaint) in [
        ("[]", "`reference` is an empty list"),
        ("[\"d\", 3]", "`reference` is"),
        ("[\"d\", \" \"]", "`reference` is empty"),
        ("[\"d\", \"d\"]", "names \"d\" twice"),
        ("[\"d\", \"f\"]", "which is a sensor"),
        ("7", "`reference` is"),
    ] {
        let error = read(reference).unwrap_err().to_string();
        assert!(error.contains(complaint), "{reference}: {error}");
    }
    let two = read("[\"d\", \"e\"]").unwrap();
    assert_eq!(two.runs[0].references, ["d", "e"]);
    // As it is written, it reads back.
    let again = Setup::from_str(&two.to_toml(), &folder.path().join("setup.toml"));
    assert_eq!(again.unwrap(), two);
}

/// Averages and survey of recordings that are read once are those of a pass for each.
#[test]
fn one_pass_for_all_has_the_bits_of_passes_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let text = record(folder.path());
    for reference in [
        "reference = [\"d1\", \"d2\", \"d3\", \"d4\", \"d5\", \"d6\", \"d12\"]",
        "reference = \"d3\"",
        "",
    ] {
        let setup = Setup::from_str(
            &format!("{text}{reference}\n"),
            &folder.path().join("setup.toml"),
        );
        let setup = setup.unwrap();
        let outcome = |threads: Option<usize>| {
            let mut session = Session::new(&setup).on_threads(threads);
            if threads.is_some() {
                session.read_ahead(&Choice::default(), &mut |_| ());
            }
            let answer = session.answer_with_modes(&Choice::default(), &mut |_| ());
            let survey = session.survey(&mut |_| ()).unwrap();
            let surveyed = survey
                .runs
                .iter()
                .map(|run| (&run.sensors, &run.base, &run.forces));
            let surveyed = format!("{:?}", surveyed.collect::<Vec<_>>());
            match answer {
                Ok(answer) => format!(
                    "{:?} {:?} {:?} {surveyed}",
                    answer.identification, answer.covariance, answer.warnings
                ),
                Err(error) => format!("{error} {surveyed}"),
            }
        };
        let own = outcome(None);
        assert_eq!(outcome(Some(1)), own, "{reference}");
        assert_eq!(outcome(Some(3)), own, "{reference}");
    }
}

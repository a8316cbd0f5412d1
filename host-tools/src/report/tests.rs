//! Whole pages, of simulated tests: well-formed whatever the numbers and names are.

use super::number::uncertain;
use super::*;
use crate::identification::{self, Choice, Session, answer};
use crate::measure::{Measurement, Spectra};
use crate::setup::Setup;
use crate::simulate::{Model, Options, simulate};
use massline_core::identify::Estimate;
use roxmltree::{Document, ParsingOptions};
use std::path::{Path, PathBuf};

/// A folder of its own for each test, gone with it.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let name = format!("massline-report-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays behind is no failure of the test.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A short test of a model that comes with the project.
fn simulated(model: &str, folder: &Folder, drive: bool) -> (Setup, TrueBody) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("models")
        .join(model);
    let options = Options {
        duration: Some(12.0),
        drive: Some(drive),
        noise: Some(0.01),
        ..Options::default()
    };
    let simulation = simulate(&Model::read(&path).unwrap(), &options, &mut |_| ()).unwrap();
    let setup = simulation.write(&folder.0).unwrap();
    let t = &simulation.truth;
    let terms = crate::simulate::InertiaTruth::terms;
    let truth = TrueBody {
        mass: Some(t.mass),
        centre_of_gravity: t.centre_of_gravity,
        inertia_reference: terms(&t.inertia_reference),
        inertia_cg: terms(&t.inertia_cg),
    };
    (Setup::read(&setup).unwrap(), truth)
}

/// The report of an answer.
fn page(setup: &Setup, answer: &Answer, truth: Option<&TrueBody>) -> String {
    render(setup, answer, &ResultDocument::new(setup, answer), truth)
}

/// Checks that a page is XML, and says how many elements of a class it has.
fn check(html: &str, class: &str) -> usize {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = match Document::parse_with_options(html, options) {
        Ok(page) => page,
        Err(e) => panic!("{e}"),
    };
    assert!(page.descendants().all(|n| n.tag_name().name() != "script"));
    assert!(!html.contains("NaN") && !html.contains("inf\""));
    // Nothing is fetched: the only address is the name of SVG.
    assert_eq!(
        html.matches("http").count(),
        html.matches("http://www.w3.org/2000/svg").count()
    );
    let has = |n: &roxmltree::Node<'_, '_>| {
        let classes = n.attribute("class").unwrap_or_default();
        classes.split(' ').any(|c| c == class)
    };
    page.descendants().filter(has).count()
}

/// The measurement of an answer, to be spoilt.
fn measured(answer: &mut Answer) -> &mut Measurement {
    std::rc::Rc::get_mut(&mut answer.measurement).unwrap()
}

#[test]
fn six_runs_show_every_entry() {
    let folder = Folder::new("six");
    let (setup, truth) = simulated("rigid-body.toml", &folder, true);
    let answer = answer(&setup, &Choice::default(), &mut |_| ()).unwrap();
    let html = page(&setup, &answer, Some(&truth));
    // One diamond for each of mass, CG, and twice six terms of inertia.
    let outside = html.matches("truth-arrow\"").count();
    assert_eq!(check(&html, "truth-mark") + outside, 16);
    for title in [">m<", ">m z<", ">−Θyz<"] {
        assert!(html.contains(title), "{title}");
    }
    assert_eq!(check(&html, "body"), 3, "the ellipsoid in three views");
    assert!(html.len() < 1_500_000);
    let without = page(&setup, &answer, None);
    assert_eq!(check(&without, "truth-mark"), 0);
}

#[test]
fn what_a_test_does_not_tell_is_never_a_number() {
    let folder = Folder::new("translations");
    let (setup, truth) = simulated("three-translations.toml", &folder, true);
    let answer = answer(&setup, &Choice::default(), &mut |_| ()).unwrap();
    let html = page(&setup, &answer, Some(&truth));
    // Twelve terms of inertia, and each says so.
    assert_eq!(check(&html, "none"), 12);
    assert_eq!(check(&html, "body"), 0);
}

#[test]
fn a_test_without_drive_has_its_report() {
    let folder = Folder::new("undriven");
    let (setup, _) = simulated("rigid-body.toml", &folder, false);
    let answer = answer(&setup, &Choice::default(), &mut |_| ()).unwrap();
    let html = page(&setup, &answer, None);
    check(&html, "");
    assert!(html.contains("multiple coherence"));
}

/// A body that can exist is not called plausible where a rigid body leaves more than noise explains,
/// and the interval that is shown holds the errors that explain it.
#[test]
fn what_contradicts_a_rigid_body_is_said_at_first() {
    let folder = Folder::new("contradicted");
    let (mut setup, _) = simulated("rigid-body.toml", &folder, true);
    let of = |setup: &Setup| {
        let mut session = Session::new(setup).with_type_b();
        session.answer(&Choice::default(), &mut |_| ()).unwrap()
    };
    let sound = page(&setup, &of(&setup), None);
    setup.load_cells[0].scale *= 1.05;
    let answer = of(&setup);
    let spoilt = page(&setup, &answer, None);
    check(&spoilt, "");
    let said = [&sound, &spoilt].map(|html| html.contains("the data contradict a rigid body"));
    assert_eq!(said, [false, true]);
    let plausible =
        [&sound, &spoilt].map(|html| html.contains("The numbers are physically plausible"));
    assert_eq!(plausible, [true, false]);

    let mass = answer.identification.mass.unwrap();
    let both = answer.type_b.as_ref().unwrap();
    let both = both
        .combined(
            identification::number::MASS,
            &mass,
            answer.identification.freedom,
        )
        .unwrap();
    let noise = mass.interval(answer.identification.freedom);
    assert!(both.interval > 1.5 * noise, "{both:?} {noise}");
    let tile = |half: f64| format!("<b>{}\u{202f}kg</b>", uncertain(mass.value, half));
    assert!(spoilt.contains(&tile(both.interval)));
    assert!(!spoilt.contains(&tile(noise)));
}

#[test]
fn names_are_text_and_numbers_may_be_broken() {
    const HOSTILE: &str = "</title><script>\"x\" & 'y'\u{1}";
    let folder = Folder::new("hostile");
    let (mut setup, truth) = simulated("rigid-body.toml", &folder, true);
    setup.title = HOSTILE.to_owned();
    for run in &mut setup.runs {
        run.name.push_str(HOSTILE);
    }
    let mut answer = answer(&setup, &Choice::default(), &mut |_| ()).unwrap();
    answer.warnings.push(format!("`{HOSTILE}` and `{HOSTILE}"));
    check(&page(&setup, &answer, Some(&truth)), "");

    let broken = [f64::NAN, f64::INFINITY, -1e300, 0.0];
    for (value, std) in broken.into_iter().zip(broken.into_iter().rev()) {
        let estimate = Some(Estimate { value, std });
        let i = &mut answer.identification;
        i.mass = estimate;
        i.centre_of_gravity = [estimate; 3];
        i.inertia_cg = [estimate; 6];
        i.inertia_reference = [estimate, None, estimate, estimate, None, estimate];
        i.condition_number = value;
        i.consistency = Some(value);
        for run in &mut measured(&mut answer).runs {
            run.density.iter_mut().for_each(|d| *d = [value; 12]);
            if let Spectra::Drive {
                coherence,
                responses,
                ..
            } = &mut run.spectra
            {
                coherence.iter_mut().for_each(|c| *c = [value as f32; 12]);
                responses
                    .iter_mut()
                    .flatten()
                    .for_each(|h| h.im = value as f32);
            }
        }
        check(&page(&setup, &answer, Some(&truth)), "");
    }
    for run in &mut measured(&mut answer).runs {
        run.density.clear();
        run.health.clear();
        if let Spectra::Drive {
            responses,
            coherence,
            drive,
            ..
        } = &mut run.spectra
        {
            responses.clear();
            coherence.clear();
            drive.clear();
        }
    }
    check(&page(&setup, &answer, Some(&truth)), "");
    measured(&mut answer).band = massline_core::spectra::LineRange::all(0);
    measured(&mut answer).runs.clear();
    check(&page(&setup, &answer, Some(&truth)), "");
}

#[test]
fn poses_are_reported_without_spectra() {
    // One kilogram at (0, 0, 0.1) m, turned to its six sides.
    let mut csv = String::from("gx,gy,gz,fx,fy,fz,tx,ty,tz\n");
    for axis in 0..3 {
        for g in [9.8, -9.8] {
            let mut a = [0.0; 3];
            a[axis] = g;
            let [x, y, z] = a;
            let (tx, ty) = (-0.1 * y, 0.1 * x);
            // Every channel is off by some millionths, each time others.
            let mut off = [1.0, -2.0, 3.0, 1e-1, -3e-1, 2e-1];
            off.rotate_left(axis);
            let read = [x, y, z, tx, ty, 0.0].into_iter().zip(off);
            let read: Vec<String> = read.map(|(f, e)| (f + e * g * 1e-6).to_string()).collect();
            csv.push_str(&format!("{x},{y},{z},{}\n", read.join(",")));
        }
    }
    let folder = Folder::new("poses");
    std::fs::write(folder.0.join("poses.csv"), csv).unwrap();
    let mut toml = String::from("title = \"Poses\"\nreference_point = [0, 0, 0]\n");
    for (n, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let mut d = [0, 0, 0];
        d[n] = 1;
        toml.push_str(&format!(
            "[[accelerometer]]\nchannel = \"g{axis}\"\nposition = [0, 0, 0]\n\
             direction = {d:?}\nmount = \"interface\"\n"
        ));
        for (letter, quantity) in [("f", "force"), ("t", "moment")] {
            toml.push_str(&format!(
                "[[load_cell]]\nchannel = \"{letter}{axis}\"\nposition = [0, 0, 0]\n\
                 direction = {d:?}\nquantity = \"{quantity}\"\n"
            ));
        }
    }
    toml.push_str(
        "[[run]]\nname = \"sides\"\nrecording = \"poses.csv\"\nexcitation = \"static\"\n",
    );
    let setup = Setup::from_str(&toml, &folder.0.join("setup.toml")).unwrap();
    let answer = answer(&setup, &Choice::default(), &mut |_| ()).unwrap();
    let html = page(&setup, &answer, None);
    // Six loads and six residuals, one path of dots each, and the one in the legend.
    assert_eq!(check(&html, "large"), 13);
    assert!(html.contains("sides: 6 poses"));
    assert!(!html.contains("id=\"apparent-mass\"") && !html.contains("id=\"coherence\""));
}

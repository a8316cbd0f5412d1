//! The three-view sketch: where the sensors sit, where the centre of gravity is, how the
//! mass is spread.
//!
//! | file | does |
//! | --- | --- |
//! | `scene` | what there is, in metres and three dimensions |
//! | `layout` | three views of one scale, projected onto each other as in a drawing |
//! | `view` | one view |
//! | `labels` | names where there is room |
//! | `alone` | the views of a setup without a result, as a file of its own |

mod alone;
mod labels;
mod layout;
mod scene;
mod view;

pub use alone::svg;

use super::TrueBody;
use super::number::{exact, with_unit};
use super::page::Section;
use super::plot::Svg;
use crate::result::ResultDocument;
use crate::setup::Setup;
use layout::Layout;
use scene::{Kind, Scene};
use std::fmt::Write;

/// Arms of the CG's cross shorter than this are enlarged, in units of the drawing.
const SHORTEST_ARM: f64 = 9.0;

/// The section.
pub(super) fn section(setup: &Setup, result: &ResultDocument, truth: Option<&TrueBody>) -> Section {
    let scene = Scene::new(setup, result, truth);
    let layout = Layout::new(&scene);
    let magnification = magnification(&scene, layout.pixels_per_metre);
    let drawing = view::draw(&scene, &layout, magnification).finish_at_most();
    let html = format!(
        "{}<figure class=\"views\">{drawing}</figure><p class=\"small\">{}</p>",
        legend(&scene),
        notes(&scene, setup, magnification)
    );
    Section::new("sketch", "Sensors and mass", html)
}

/// A round factor that makes the CG's interval visible; one where it is anyway.
fn magnification(scene: &Scene, pixels_per_metre: f64) -> f64 {
    let widest = scene
        .centre
        .iter()
        .map(|n| n.half_width() * pixels_per_metre)
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max);
    if widest >= SHORTEST_ARM || widest <= 0.0 {
        return 1.0;
    }
    let wanted = SHORTEST_ARM / widest;
    let mut factor = super::number::power_of_ten(libm::floor(libm::log10(wanted)) as i32);
    for step in [2.0, 2.5, 2.0] {
        if factor >= wanted {
            break;
        }
        factor *= step;
    }
    factor
}

fn legend(scene: &Scene) -> String {
    let mut html = String::from("<ul class=\"legend\">");
    let mut item = |draw: &dyn Fn(&mut Svg), text: &str| {
        let mut svg = Svg::new(20.0, 16.0, "");
        draw(&mut svg);
        let _ = write!(html, "<li>{}{text}</li>", svg.finish_inline());
    };
    for kind in [Kind::LoadCell, Kind::Interface, Kind::Structure] {
        if scene.spots.iter().any(|s| s.kind == kind) {
            item(&|svg| view::symbol(svg, kind, [10.0, 8.0]), kind.words());
        }
    }
    item(
        &|svg| view::reference(svg, [10.0, 8.0]),
        "reference point A",
    );
    if scene.centre.iter().any(|n| n.observable) {
        item(&|svg| view::centre(svg, [10.0, 8.0]), "centre of gravity S");
    }
    if scene.true_centre.iter().any(Option::is_some) {
        item(
            &|svg| svg.circle("true-cg", [10.0, 8.0], 6.5),
            "true centre of gravity",
        );
    }
    html.push_str("</ul>");
    html
}

fn notes(scene: &Scene, setup: &Setup, magnification: f64) -> String {
    let mut text = String::from(
        "Three views to one scale, seen from above, from the front and from the right. Arrows \
         show positive directions; ⊙ points at the reader, ⊗ away; a double head is a moment.",
    );
    if scene.centre.iter().any(|n| n.std > Some(0.0)) {
        text.push_str(" The cross at S is its 95\u{202f}% interval");
        if magnification > 1.0 {
            let _ = write!(text, ", drawn {} times as large", exact(magnification));
        }
        text.push('.');
    }
    if scene.centre.iter().any(|n| !n.observable) {
        text.push_str(" S is drawn only in views whose two coordinates are observable.");
    }
    match &scene.ellipsoid {
        Ok(_) => text.push_str(
            " The shaded ellipsoid has the identified mass and inertia at uniform density; \
             dash-dotted lines are its principal axes.",
        ),
        Err(why) => {
            let _ = write!(text, " {why}");
        }
    }
    if let Some(run) = setup.runs.iter().find(|r| r.is_remounted()) {
        let first = &setup.runs[0];
        let _ = write!(
            text,
            " The specimen was re-mounted (run {}, for one); sensors of the table are drawn \
             where they were in run {}, as seen from the specimen.",
            super::markup::escape(&run.name),
            super::markup::escape(&first.name)
        );
    }
    if scene.left_out > 0 {
        let _ = write!(
            text,
            " {} sensors without finite position are left out.",
            scene.left_out
        );
    }
    let _ = write!(
        text,
        " The longest dimension drawn is {}.",
        with_unit(&super::number::significant(scene.longest(), 3), "m")
    );
    text
}

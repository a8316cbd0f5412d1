//! The three views of a setup without a result, as an SVG file of its own.

use super::scene::{Kind, Scene};
use super::{Layout, view};
use crate::report::page::STYLE;
use crate::report::plot::{Anchor, Svg, text_width};
use crate::setup::Setup;

/// Room for the legend below the views.
const LEGEND: f64 = 34.0;
const TEXT: f64 = 12.0;
const REFERENCE: &str = "reference point A";

/// An SVG document with the sensors of a setup and its reference point in three views.
#[must_use]
pub fn svg(setup: &Setup) -> String {
    let scene = Scene::of(setup);
    let layout = Layout::new(&scene);
    let [width, height] = layout.size;
    let label = format!("Sensors of {} in three views", setup.title);
    let kinds = [Kind::LoadCell, Kind::Interface, Kind::Structure];
    let shown = |kind: &Kind| scene.spots.iter().any(|s| s.kind == *kind);
    let kinds: Vec<Kind> = kinds.into_iter().filter(shown).collect();
    let words = kinds.iter().map(|kind| kind.words()).chain([REFERENCE]);
    let mut ends = vec![20.0];
    ends.extend(words.clone().scan(20.0, |x, words| {
        *x += 34.0 + text_width(words, TEXT);
        Some(*x)
    }));
    let width = ends.last().map_or(width, |end| width.max(*end));
    let mut whole = Svg::new(width, height + LEGEND, &label);
    whole.rectangle("paper", [0.0, 0.0], [width, height + LEGEND]);
    whole.place([0.0, 0.0], view::draw(&scene, &layout, 1.0));
    for (number, (x, words)) in ends.into_iter().zip(words).enumerate() {
        let at = [x, height + 0.5 * LEGEND];
        match kinds.get(number) {
            Some(kind) => view::symbol(&mut whole, *kind, at),
            None => view::reference(&mut whole, at),
        }
        whole.text("name", [x + 12.0, at[1] + 4.0], Anchor::Start, words);
    }
    let size = format!(
        "<svg width=\"{width:.0}\" height=\"{:.0}\" ",
        height + LEGEND
    );
    let (head, body) = split(&whole.finish().replacen("<svg ", &size, 1));
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{head}<style>\n{}</style>{body}\n",
        style()
    )
}

/// The root element's tag, and all behind it.
fn split(svg: &str) -> (String, String) {
    let (head, body) = svg.split_once('>').unwrap_or((svg, ""));
    (format!("{head}>"), body.to_owned())
}

/// The report's rules for drawings, with the colours on white written out: many programs that show
/// an SVG know no variables.
fn style() -> String {
    let light = STYLE
        .split_once(":root {")
        .and_then(|(_, rest)| rest.split_once('}'));
    let light = light.map_or("", |(block, _)| block);
    let drawings = STYLE.find("\nsvg text").map_or("", |at| &STYLE[at..]);
    let drawings = drawings.split("\n@media").next().unwrap_or_default();
    let mut rules = format!(
        ".paper {{ fill: var(--paper); }}\nsvg {{ font-family: system-ui, \"Segoe UI\", \"Noto Sans\", Arial, sans-serif; }}{drawings}\n"
    );
    for declaration in light.split(';') {
        if let Some((name, value)) = declaration.split_once(':') {
            rules = rules.replace(&format!("var({})", name.trim()), value.trim());
        }
    }
    rules
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_is_whole_and_needs_no_other() {
        let text = crate::setup::Setup::from_str(
            "title = \"a < b & c\"\n[processing]\naveraging_band = [1.0, 9.0]\n\
             [[accelerometer]]\ntriaxial = \"T1\"\nposition = [0.5, 0, 0]\nmount = \"interface\"\n\
             [[load_cell]]\nchannel = \"fz\"\nposition = [0, 0.5, 0]\ndirection = \"z\"\n\
             [[run]]\nname = \"x\"\nrecording = \"x.csv\"\n",
            "setup.toml".as_ref(),
        );
        let svg = svg(&text.unwrap());
        let document = roxmltree::Document::parse(&svg).unwrap();
        let texts: Vec<&str> = document.descendants().filter_map(|n| n.text()).collect();
        for shown in ["T1:X", "fz", "load cell", "from above", "reference point A"] {
            assert!(
                texts.iter().any(|t| t.contains(shown)),
                "{shown}: {texts:?}"
            );
        }
        assert!(!svg.contains("var("), "{svg}");
        for node in document.descendants() {
            for class in node.attribute("class").unwrap_or_default().split(' ') {
                let ruled = class.is_empty() || svg.contains(&format!(".{class}"));
                assert!(ruled || class == "tip", "no rule for {class}");
            }
        }
    }
}

//! Drawing the views.

use super::labels::Room;
use super::layout::{Layout, View};
use super::scene::{Ellipsoid, Kind, Scene, Spot};
use crate::report::plot::{Anchor, Mapping, SMALL_TEXT, Scale, Svg, path, ticks};
use crate::report::scales::Unit;
use nalgebra::{Matrix2, Vector2};

/// Length of a direction's arrow.
const ARROW: f64 = 19.0;
/// A direction that is shorter than this in a view points along the line of sight.
const END_ON: f64 = 0.25;
/// More spots than this are not named; the table of channels has them all.
const MOST_NAMES: usize = 40;

/// The whole drawing.
pub(super) fn draw(scene: &Scene, layout: &Layout, magnification: f64) -> Svg {
    let mut svg = Svg::new(
        layout.size[0],
        layout.size[1],
        "Three views of the sensors, the reference point, the centre of gravity and the inertia",
    );
    let unit = if scene.longest() < 1.0 {
        Unit::MILLIMETRE
    } else {
        Unit::METRE
    };
    for view in &layout.views {
        draw_view(&mut svg, scene, layout, view, unit, magnification);
    }
    svg
}

fn draw_view(
    svg: &mut Svg,
    scene: &Scene,
    layout: &Layout,
    view: &View,
    unit: Unit,
    magnification: f64,
) {
    let [u, v] = view.axes;
    let [across, up] = layout.scales(view);
    let at = |x: f64, y: f64| Some([across.at(x)?, up.at(y)?]);
    draw_axes(svg, layout, view, unit, [&across, &up]);
    let mut room = Room::new(view.corner, view.size);
    if let Ok(ellipsoid) = &scene.ellipsoid {
        draw_ellipsoid(svg, ellipsoid, view.axes, &at);
    }
    let mut named = Vec::new();
    for spot in &scene.spots {
        if let Some(place) = at(spot.position[u], spot.position[v]) {
            draw_spot(svg, spot, place, view, &mut room);
            named.push((place, spot));
        }
    }
    let reference_at = at(scene.reference[u], scene.reference[v]);
    if let Some(place) = reference_at {
        reference(svg, place);
        room.take(place, place, 6.0);
    }
    let centre_at = scene.centre_in(u, v).and_then(|[x, y]| at(x, y));
    if let Some(place) = centre_at {
        room.take(place, place, 9.0);
        centre(svg, place);
        let arm = [u, v]
            .map(|axis| scene.centre[axis].half_width() * layout.pixels_per_metre * magnification);
        if arm.iter().all(|a| *a > 0.0) {
            let [x, y] = place;
            svg.line("cross", [x - arm[0], y], [x + arm[0], y]);
            svg.line("cross", [x, y - arm[1]], [x, y + arm[1]]);
            room.take([x - arm[0], y], [x + arm[0], y], 2.0);
            room.take([x, y - arm[1]], [x, y + arm[1]], 2.0);
        }
    }
    if let (Some(x), Some(y)) = (scene.true_centre[u], scene.true_centre[v])
        && let Some(place) = at(x, y)
    {
        svg.circle("true-cg", place, 10.5);
        room.take(place, place, 11.0);
    }
    // Names last: they give way to everything else.
    if let Some(place) = centre_at {
        room.name(svg, "strong halo", place, "S");
    }
    if let Some(place) = reference_at {
        room.name(svg, "strong halo", place, "A");
    }
    if named.len() <= MOST_NAMES {
        for (place, spot) in named {
            room.name(svg, "name halo", place, &names(spot));
        }
    }
}

/// The channels of a spot; what they begin with is written once.
fn names(spot: &Spot) -> String {
    let names: Vec<&str> = spot.axes.iter().map(|a| a.channel.as_str()).collect();
    let first = names.first().copied().unwrap_or_default();
    let shared = first
        .char_indices()
        .map(|(at, c)| at + c.len_utf8())
        .take_while(|end| names.iter().all(|n| n.get(..*end) == first.get(..*end)))
        // Not in the middle of a number.
        .filter(|end| !first[..*end].ends_with(|c: char| c.is_ascii_digit()))
        .last()
        .unwrap_or(0);
    let ends: Vec<&str> = names.iter().filter_map(|n| n.get(shared..)).collect();
    let short = names.len() > 1 && shared > 0 && ends.iter().all(|e| (1..=2).contains(&e.len()));
    let text = if short {
        format!(
            "{}{}",
            first.get(..shared).unwrap_or_default(),
            ends.join("/")
        )
    } else {
        names.join(" ")
    };
    crate::report::markup::shortened(&text, 18)
}

fn draw_axes(svg: &mut Svg, layout: &Layout, view: &View, unit: Unit, scales: [&Scale; 2]) {
    const NAMES: [&str; 3] = ["x", "y", "z"];
    let [left, top] = view.corner;
    let [width, height] = view.size;
    let (right, bottom) = (left + width, top + height);
    let ticks_of = |axis: usize, pixels: f64| {
        let domain = layout.domain(axis).map(|m| m / unit.si);
        ticks(Mapping::Linear, domain, (pixels / 52.0).max(1.0) as usize)
    };
    svg.rectangle("grid", view.corner, view.size);
    for tick in ticks_of(view.axes[0], width).major {
        if let Some(x) = scales[0].at(tick.value * unit.si) {
            svg.line("grid", [x, top], [x, bottom]);
            if view.labelled[0] {
                svg.text(
                    "tick",
                    [x, bottom + SMALL_TEXT + 3.0],
                    Anchor::Middle,
                    &tick.label,
                );
            }
        }
    }
    for tick in ticks_of(view.axes[1], height).major {
        if let Some(y) = scales[1].at(tick.value * unit.si) {
            svg.line("grid", [left, y], [right, y]);
            if view.labelled[1] {
                svg.text(
                    "tick",
                    [left - 5.0, y + 0.35 * SMALL_TEXT],
                    Anchor::End,
                    &tick.label,
                );
            }
        }
    }
    svg.text(
        "axis-title",
        [right, bottom + 2.0 * SMALL_TEXT + 6.0],
        Anchor::End,
        &format!("{}, {}", NAMES[view.axes[0]], unit.symbol),
    );
    svg.text(
        "axis-title",
        [left, top - 6.0],
        Anchor::End,
        &format!("{}, {}", NAMES[view.axes[1]], unit.symbol),
    );
    svg.text("title", [left + 6.0, top - 6.0], Anchor::Start, view.title);
}

/// Outline and principal axes.
fn draw_ellipsoid(
    svg: &mut Svg,
    ellipsoid: &Ellipsoid,
    [u, v]: [usize; 2],
    at: &impl Fn(f64, f64) -> Option<[f64; 2]>,
) {
    const CORNERS: usize = 72;
    let shape = ellipsoid.shape();
    let flat = Matrix2::new(shape[(u, u)], shape[(u, v)], shape[(v, u)], shape[(v, v)]);
    let eigen = flat.symmetric_eigen();
    let half = |k: usize| -> Vector2<f64> {
        eigen.eigenvectors.column(k) * eigen.eigenvalues[k].max(0.0).sqrt()
    };
    let (a, b) = (half(0), half(1));
    let (x, y) = (ellipsoid.centre[u], ellipsoid.centre[v]);
    let outline: Vec<_> = (0..=CORNERS)
        .map(|k| {
            let angle = 2.0 * core::f64::consts::PI * k as f64 / CORNERS as f64;
            let p = a * libm::cos(angle) + b * libm::sin(angle);
            at(x + p[0], y + p[1])
        })
        .collect();
    svg.path("body", &path::line(&outline));
    for k in 0..3 {
        let axis = ellipsoid.axes.column(k) * ellipsoid.radii[k];
        if let (Some(from), Some(to)) = (at(x - axis[u], y - axis[v]), at(x + axis[u], y + axis[v]))
        {
            svg.line("principal-axis", from, to);
        }
    }
}

fn draw_spot(svg: &mut Svg, spot: &Spot, place: [f64; 2], view: &View, room: &mut Room) {
    let [u, v] = view.axes;
    let (sight, towards) = view.sight;
    let channels: Vec<&str> = spot.axes.iter().map(|a| a.channel.as_str()).collect();
    svg.open_group(&format!("{}: {}", spot.kind.words(), channels.join(", ")));
    room.take(place, place, 5.0);
    for axis in &spot.axes {
        let flat = [axis.direction[u], -axis.direction[v]];
        let length = libm::hypot(flat[0], flat[1]);
        if length < END_ON {
            let at_reader = (axis.direction[sight] > 0.0) == towards;
            end_on(svg, spot.kind, place, at_reader);
            room.take(place, place, 8.5);
        } else {
            let tip = [place[0] + ARROW * flat[0], place[1] + ARROW * flat[1]];
            arrow(svg, spot.kind, place, tip, axis.moment);
            room.take(place, tip, 2.0);
        }
    }
    symbol(svg, spot.kind, place);
    svg.close_group();
}

/// An arrow with one head, or two for a moment.
fn arrow(svg: &mut Svg, kind: Kind, from: [f64; 2], to: [f64; 2], double: bool) {
    let class = format!("arrow {}", kind.class());
    let d = [to[0] - from[0], to[1] - from[1]];
    let length = libm::hypot(d[0], d[1]).max(1e-9);
    let (along, aside) = (
        [d[0] / length, d[1] / length],
        [-d[1] / length, d[0] / length],
    );
    svg.line(&class, from, to);
    let mut head = |back: f64| {
        let tip = [to[0] - back * along[0], to[1] - back * along[1]];
        let wing = |side: f64| {
            Some([
                tip[0] - 4.0 * along[0] + side * aside[0],
                tip[1] - 4.0 * along[1] + side * aside[1],
            ])
        };
        svg.path(&class, &path::line(&[wing(2.6), Some(tip), wing(-2.6)]));
    };
    head(0.0);
    if double {
        head(3.5);
    }
}

/// A direction along the line of sight: a ring with a dot towards the reader, with a
/// cross away.
fn end_on(svg: &mut Svg, kind: Kind, at: [f64; 2], towards: bool) {
    const RING: f64 = 7.5;
    let class = format!("away {}", kind.class());
    svg.circle(&class, at, RING);
    if towards {
        return;
    }
    let d = RING * core::f64::consts::FRAC_1_SQRT_2;
    svg.line(&class, [at[0] - d, at[1] - d], [at[0] + d, at[1] + d]);
    svg.line(&class, [at[0] - d, at[1] + d], [at[0] + d, at[1] - d]);
}

/// The symbol of a kind of sensor; shapes differ as well as colours.
pub(super) fn symbol(svg: &mut Svg, kind: Kind, [x, y]: [f64; 2]) {
    const R: f64 = 3.4;
    match kind {
        Kind::LoadCell => svg.rectangle(kind.class(), [x - R, y - R], [2.0 * R, 2.0 * R]),
        Kind::Interface => svg.path(
            kind.class(),
            &path::line(&[
                Some([x - 4.2, y + 3.2]),
                Some([x + 4.2, y + 3.2]),
                Some([x, y - 4.2]),
                Some([x - 4.2, y + 3.2]),
            ]),
        ),
        Kind::Structure => svg.circle(kind.class(), [x, y], R),
    }
}

/// The reference point: a cross.
pub(super) fn reference(svg: &mut Svg, [x, y]: [f64; 2]) {
    const R: f64 = 5.5;
    svg.line("point", [x - R, y - R], [x + R, y + R]);
    svg.line("point", [x - R, y + R], [x + R, y - R]);
}

/// The centre of gravity: a disc with two black quarters, as drawings have it.
pub(super) fn centre(svg: &mut Svg, [x, y]: [f64; 2]) {
    const R: f64 = 6.5;
    svg.circle("cg", [x, y], R);
    let quarter = |from: f64| -> Vec<Option<[f64; 2]>> {
        let mut points = vec![Some([x, y])];
        points.extend((0..=9).map(|k| {
            let angle = from + core::f64::consts::FRAC_PI_2 * f64::from(k) / 9.0;
            Some([x + R * libm::cos(angle), y + R * libm::sin(angle)])
        }));
        points
    };
    svg.path("cg-quarter", &path::line(&quarter(0.0)));
    svg.path("cg-quarter", &path::line(&quarter(core::f64::consts::PI)));
}

//! The section on static poses: forces over specific force, and what is left of them.

use super::markup::{escape, push_number};
use super::number::{fixed, significant, with_unit};
use super::page::{Section, panels};
use super::plot::{Axis, Extent, LineChart, Mapping, Mark, Tone, legend};
use super::scales::axis_factor;
use super::{lines, rigid};
use crate::identification::Answer;
use crate::measure::MeasuredPoses;
use crate::result::ResultDocument;
use massline_core::geometry::RESULTANT_NAMES;
use nalgebra::{Matrix6, Vector6};
use std::fmt::Write;

/// A static run with what the identified body says about it.
struct Compared<'a> {
    run: &'a MeasuredPoses,
    matrix: Matrix6<f64>,
    offsets: Vector6<f64>,
    measured: [bool; 6],
}

impl Compared<'_> {
    fn predicted(&self, specific_force: &Vector6<f64>) -> Vector6<f64> {
        self.matrix * specific_force + self.offsets
    }

    fn residual(&self, i: usize) -> Vec<f64> {
        let rows = self.run.rows.iter();
        rows.map(|(a, f)| f[i] - self.predicted(a)[i]).collect()
    }
}

/// The section, or `None` without static runs.
pub(super) fn section(answer: &Answer, result: &ResultDocument) -> Option<Section> {
    if answer.measurement.poses.is_empty() {
        return None;
    }
    let mut html = String::new();
    for run in &answer.measurement.poses {
        let offsets = result.offsets.iter().find(|of| of.run == run.name);
        let compared = Compared {
            run,
            matrix: rigid::matrix(result),
            offsets: offsets.map_or_else(Vector6::zeros, |of| Vector6::from(of.resultants)),
            measured: core::array::from_fn(|i| run.geometry.equations.measured(i) > lines::WHOLE),
        };
        html.push_str(&one(&compared));
    }
    Some(Section::new("poses", "Static poses", html))
}

fn one(c: &Compared<'_>) -> String {
    let mut html = format!(
        "<h3>{}: {} poses</h3><p>Each dot is a pose. A body at rest on its load cells loads \
         them with its mass times the specific force, which is gravity reversed, and its \
         centre of gravity turns that force into moments. Lines are the identified body with \
         the constant offsets of the sensor.</p>",
        escape(&c.run.name),
        c.run.rows.len()
    );
    html.push_str(&legend(&[
        (Tone::Measured, Mark::Points, "measured"),
        (Tone::Identified, Mark::Line, "identified body"),
    ]));
    let shown: Vec<usize> = (0..6).filter(|i| c.measured[*i]).collect();
    html.push_str(&panels(shown.iter().map(|&i| load(c, i))));
    html.push_str(
        "<h3>What is left</h3><p>Measured minus identified, pose by pose. A pattern instead \
         of scatter points to cross-talk, misaligned axes or a bent cable.</p>",
    );
    html.push_str(&panels(shown.iter().map(|&i| left(c, i))));
    html.push_str(&offsets(c, &shown));
    html
}

/// A force over the specific force along it, or a moment over what it should be.
fn load(c: &Compared<'_>, i: usize) -> String {
    let rows = &c.run.rows;
    let across = |a: &Vector6<f64>| {
        if i < 3 {
            a[i]
        } else {
            c.predicted(a)[i] - c.offsets[i]
        }
    };
    let measured: Vec<[f64; 2]> = rows.iter().map(|(a, f)| [across(a), f[i]]).collect();
    let x = Extent::of(Mapping::Linear, measured.iter().map(|p| p[0])).domain(0.06);
    let y = Extent::of(Mapping::Linear, measured.iter().map(|p| p[1])).domain(0.06);
    let slope = if i < 3 { c.matrix[(i, i)] } else { 1.0 };
    let line = x.map(|x| [x, slope * x + c.offsets[i]]).to_vec();
    let (title, unit) = if i < 3 {
        let axis = ["x", "y", "z"][i];
        (format!("specific force along {axis}, m/s²"), "N")
    } else {
        ("moment of the identified body, N m".to_owned(), "N m")
    };
    let mut chart = LineChart::panel(
        RESULTANT_NAMES[i],
        Axis::linear(title, x),
        Axis::linear(unit, y),
    );
    chart.draw("identified", Tone::Identified, Mark::Line, line);
    chart.draw("measured", Tone::Measured, Mark::Points, measured);
    chart.svg()
}

fn left(c: &Compared<'_>, i: usize) -> String {
    let residual = c.residual(i);
    let mut extent = Extent::of(Mapping::Linear, residual.iter().copied());
    extent.see(0.0);
    let domain = extent.domain(0.1);
    let (factor, prefix) = axis_factor(domain[0].abs().max(domain[1].abs()));
    let mut chart = LineChart::panel(
        RESULTANT_NAMES[i],
        Axis::linear("pose", [0.0, residual.len() as f64 + 1.0]),
        Axis::linear(format!("{prefix}{}", unit(i)), domain.map(|v| v * factor)),
    );
    chart.size[1] = 160.0;
    let points = residual.iter().enumerate();
    let points = points.map(|(k, r)| [k as f64 + 1.0, r * factor]).collect();
    chart.draw("residual", Tone::Measured, Mark::Points, points);
    chart.svg()
}

fn offsets(c: &Compared<'_>, shown: &[usize]) -> String {
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\"></th>",
    );
    for i in shown {
        let _ = write!(
            html,
            "<th scope=\"col\" class=\"num\">{}</th>",
            RESULTANT_NAMES[*i]
        );
    }
    html.push_str("</tr></thead><tbody><tr><th scope=\"row\">Offset</th>");
    for &i in shown {
        push_number(&mut html, &with_unit(&fixed(c.offsets[i], 4), unit(i)));
    }
    html.push_str("</tr><tr><th scope=\"row\">Residual, RMS</th>");
    for &i in shown {
        let residual = c.residual(i);
        let squares = residual.iter().map(|r| r * r).sum::<f64>();
        let rms = (squares / residual.len().max(1) as f64).sqrt();
        push_number(&mut html, &with_unit(&significant(rms, 2), unit(i)));
    }
    html.push_str("</tr></tbody></table></div>");
    html
}

fn unit(i: usize) -> &'static str {
    if i < 3 { "N" } else { "N m" }
}

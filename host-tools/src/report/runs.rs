//! The section on runs, channels and processing, and how to read the error bars.

use super::markup::escape;
use super::number::{exact, fixed, significant, with_unit};
use super::page::Section;
use super::{channels, traceability};
use crate::identification::Answer;
use crate::measure::WINDOW;
use crate::result::ResultDocument;
use crate::setup::{Run, Setup};
use massline_core::spectra::Window;
use std::fmt::Write;

/// The section.
pub(super) fn section(setup: &Setup, answer: &Answer, result: &ResultDocument) -> Section {
    let mut html = runs(setup, answer);
    html.push_str(&processing(setup, answer, result));
    html.push_str("<h3>Channels</h3><p class=\"small\">Interface and structure: accelerometers fixed to the table or adapter, and to the specimen.</p>");
    html.push_str(&channels::table(setup, answer));
    html.push_str(&traceability::table(&answer.measurement.runs));
    Section::new("runs", "Runs, channels, processing", html)
}

/// The section that explains the error bars.
pub(super) fn reading(answer: &Answer) -> Section {
    let random = !answer.measurement.runs.is_empty();
    let sine = !answer.measurement.sines.is_empty();
    let mut html = String::from(
        "<p>What follows ± is half of a 95\u{202f}% interval: the true value lies within in 95 of \
         100 tests, as long as nothing but noise is wrong.",
    );
    if random {
        html.push_str(
            " It comes from the scatter of the lines around the fit, enlarged for what the \
             window does: neighbouring lines share samples and resemble each other, so that \
             a hundred lines say less than a hundred independent ones.",
        );
    } else if sine {
        html.push_str(" It comes from the scatter of the lines around the fit.");
    } else {
        html.push_str(" It comes from the scatter of the poses around the identified body.");
    }
    html.push_str(
        " Where a rigid body leaves more of the masslines than their noise explains, all \
         error bars are widened by the root of that ratio. Errors that are the same in \
         every line stay invisible to them: a wrong sensor position, direction or \
         sensitivity moves the result and not the bar.</p>",
    );
    html.push_str(
        "<p>Moments of inertia are ∫ (y² + z²) dm and so on; products of inertia are \
         ∫ x y dm, ∫ x z dm, ∫ y z dm with a plus sign, and enter the inertia tensor with a \
         minus sign. Forces and moments are those exerted on the structure, at the reference \
         point A.</p>",
    );
    Section::new("reading", "How to read the error bars", html)
}

fn runs(setup: &Setup, answer: &Answer) -> String {
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\">Run</th>\
         <th scope=\"col\">Recording</th><th scope=\"col\">Excitation</th>\
         <th scope=\"col\">Drive</th><th scope=\"col\" class=\"num\">Samples</th>\
         <th scope=\"col\" class=\"num\">Duration</th>\
         <th scope=\"col\" class=\"num\">Blocks</th><th scope=\"col\">Mounting</th>\
         </tr></thead><tbody>",
    );
    for (number, run) in setup.runs.iter().enumerate() {
        let random = answer.measurement.runs.iter().find(|r| r.number == number);
        let poses = answer.measurement.poses.iter().find(|r| r.name == run.name);
        let sine = answer.measurement.sines.iter().find(|r| r.name == run.name);
        let (kind, samples, duration, blocks) = match (random, sine, poses) {
            (Some(r), _, _) => {
                let rate = r.settings().grid().spacing * r.settings().block_length() as f64;
                let seconds = r.samples as f64 / rate;
                (
                    "random",
                    fixed(r.samples as f64, 0),
                    with_unit(&significant(seconds, 4), "s"),
                    match r.rejected.blocks {
                        0 => r.blocks.to_string(),
                        n => format!("{}; {n} left out: {}", r.blocks, r.rejected.reasons()),
                    },
                )
            }
            (None, Some(s), _) => (
                "stepped sine",
                format!("{} frequencies", s.frequencies.len()),
                String::new(),
                String::new(),
            ),
            (None, None, Some(p)) => (
                "static poses",
                format!("{} poses", p.rows.len()),
                String::new(),
                String::new(),
            ),
            (None, None, None) => ("not used", String::new(), String::new(), String::new()),
        };
        let mounting = if run.is_remounted() {
            format!(
                "turned by ({}) degrees, shifted by ({}) m",
                run.rotation.map(exact).join(", "),
                run.translation.map(exact).join(", ")
            )
        } else {
            "as drawn".to_owned()
        };
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{kind}</td><td>{}</td>\
             <td class=\"num\">{samples}</td><td class=\"num\">{duration}</td>\
             <td class=\"num\">{blocks}</td><td>{mounting}</td></tr>",
            escape(&run.name),
            escape(&run.recording.display().to_string()),
            escape(&drives(run)),
        );
    }
    html.push_str("</tbody></table></div>");
    html
}

fn drives(run: &Run) -> String {
    match run.references.as_slice() {
        [] => "none".to_owned(),
        some => some.join(", "),
    }
}

fn processing(setup: &Setup, answer: &Answer, result: &ResultDocument) -> String {
    let m = &answer.measurement;
    let mut rows: Vec<(&str, String)> = Vec::new();
    if let (Some(grid), Some(run)) = (m.grid, m.runs.first()) {
        let block = run.settings().block_length();
        let rate = grid.spacing * block as f64;
        let [low, high] = grid.ends(m.band);
        rows.push(("Sample rate", with_unit(&exact(round(rate)), "Hz")));
        rows.push((
            "Blocks",
            format!(
                "{block} samples, {} overlap, {} window",
                with_unit(&exact(round(100.0 * (1.0 - m.hop))), "%"),
                window(WINDOW)
            ),
        ));
        rows.push((
            "Lines",
            format!(
                "every {}, kept up to {}",
                with_unit(&exact(round(grid.spacing)), "Hz"),
                with_unit(
                    &exact(round(grid.frequency(grid.count.saturating_sub(1)))),
                    "Hz"
                )
            ),
        ));
        rows.push((
            "Averaging band",
            format!(
                "{} to {}, {} lines",
                exact(round(low)),
                with_unit(&exact(round(high)), "Hz"),
                m.band.indices().len()
            ),
        ));
    }
    if let (Some(sine), Some(p)) = (m.sines.first(), &setup.processing) {
        let [low, high] = p.averaging_band;
        rows.push((
            "Averaging band of sines",
            format!(
                "{} to {}, {} frequencies",
                exact(low),
                with_unit(&exact(high), "Hz"),
                sine.band.indices().len()
            ),
        ));
    }
    rows.push((
        "Condition number",
        format!(
            "{} of the equilibrated normal equations",
            significant(result.condition_number, 3)
        ),
    ));
    rows.push((
        "Consistency",
        result.consistency.map_or_else(
            || "not determined: there are no more equations than unknowns".to_owned(),
            |c| {
                format!(
                    "{} times the power that noise explains is left by the rigid body; about 1 is good",
                    significant(c, 3)
                )
            },
        ),
    ));
    rows.push((
        "Iterations",
        format!(
            "{}{}",
            result.iterations,
            if result.iterations == 1 {
                ", direct"
            } else {
                ""
            }
        ),
    ));
    for fit in &answer.fits {
        rows.push((
            "Excitation",
            format!(
                "{} independent directions, the weakest {} times its noise in power",
                fit.excited,
                significant(fit.weakest_excitation, 2)
            ),
        ));
    }
    let mut html =
        String::from("<h3>Processing</h3><div class=\"wide\"><table class=\"plain\"><tbody>");
    for (name, text) in rows {
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{name}</th><td class=\"wrap\">{text}</td></tr>"
        );
    }
    html.push_str("</tbody></table></div>");
    html
}

/// Ten digits: what a rate loses on its way through a spacing is not worth printing.
fn round(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}

fn window(window: Window) -> &'static str {
    match window {
        Window::Rectangular => "rectangular",
        Window::Hann => "Hann",
        Window::Hamming => "Hamming",
        Window::Blackman => "Blackman",
        Window::BlackmanHarris => "Blackman-Harris",
        Window::FlatTop => "flat-top",
    }
}

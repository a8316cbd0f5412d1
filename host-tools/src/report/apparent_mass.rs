//! The section on the apparent mass: is the fit good, and is the band free of modes?

use super::lines::{Fit, fitted};
use super::markup::escape;
use super::number::{fixed, significant};
use super::page::{Section, panels};
use super::plot::{Axis, Extent, LineChart, Mapping, Mark, Rule, Series, Tone, legend};
use super::response::{Entries, Entry, entries};
use super::scales::axis_factor;
use crate::identification::Answer;
use crate::result::ResultDocument;
use massline_core::masslines::ApparentMass;
use std::fmt::Write;

/// Data of all panels of the section.
struct View<'a> {
    /// Averaging band, Hz.
    band: [f64; 2],
    /// Highest kept line, Hz.
    top: f64,
    fit: Option<Fit<'a>>,
    /// `true` if the acceleration comes from the interface alone.
    interface_only: bool,
}

impl View<'_> {
    /// End of the curve of the fit, Hz. Beyond the averaging band that is the first mode with a term of its
    /// own: which of the modes there gets how much, the lines inside the band cannot tell. With a
    /// pseudo-mode, which is no mode of the structure, it is the band's end.
    fn last(&self) -> f64 {
        let high = self.band[1];
        match self.fit {
            Some(Fit::Lines(_)) => self.top,
            Some(Fit::Band(fit)) if fit.pseudo_mode.is_none() => {
                let found = fit.poles.iter().zip(&fit.elastic);
                let own = found.filter_map(|(pole, mass)| mass.as_ref().map(|_| pole.frequency));
                own.filter(|f| *f > high).reduce(f64::min).unwrap_or(high)
            }
            _ => high,
        }
    }
}

/// The section, or `None` without spectra.
pub(super) fn section(answer: &Answer, result: &ResultDocument) -> Option<Section> {
    let groups = fitted(answer);
    let mut html = String::new();
    for group in &groups {
        let Ok((band, top)) = group.read(None, |lines| {
            let band = group.band.indices();
            let band = [band.start, band.end.saturating_sub(1)].map(|line| lines.frequency(line));
            (band, lines.frequency(lines.count().saturating_sub(1)))
        }) else {
            continue;
        };
        let view = View {
            band,
            top,
            fit: group.fit,
            interface_only: answer.method.interface_only(),
        };
        let entries = entries(group, result);
        if groups.len() > 1 {
            let names: Vec<String> = group.names().into_iter().map(escape).collect();
            let runs = if names.len() == 1 { "Run" } else { "Runs" };
            let _ = write!(html, "<h3>{runs} {}</h3>", names.join(", "));
        }
        html.push_str(&introduction(&entries, &view));
        html.push_str(&overview(&entries, &view));
        html.push_str(&closeup(&entries, &view));
        // The modes have a section of their own where they were asked for.
        if let Some(Fit::Band(fit)) = group.fit.filter(|_| answer.modal.is_none()) {
            html.push_str(&modes(fit));
        }
    }
    (!html.is_empty()).then(|| Section::new("apparent-mass", "Apparent mass", html))
}

fn introduction(entries: &Entries, view: &View<'_>) -> String {
    let mut text = String::from("<p>");
    text.push_str(if entries.list.is_empty() {
        "No base acceleration rises above its noise, so there is nothing to draw."
    } else if entries.solved {
        "Force resultants per base acceleration, solved line by line from all runs. Towards \
         zero frequency they become the entries of the rigid body's mass matrix."
    } else {
        "These runs do not separate the directions of motion line by line. Shown is, for each \
         run, every force resultant per that run's strongest base acceleration; the other \
         directions move along, in the fit as well."
    });
    let drawn = !entries.list.is_empty();
    if let (true, Some(Fit::Lines(fit))) = (drawn, view.fit) {
        let _ = write!(
            text,
            " The fit is a rigid body plus the modes of the fixed structure, by maximum likelihood from all \
             lines of the records from {} to {} Hz. The points are averages, whose window flattens peaks.",
            significant(fit.band[0], 3),
            significant(fit.band[1], 4)
        );
    } else if drawn && view.fit.is_some() {
        text.push_str(
            " The fit is a rigid body plus the modes of the fixed structure, made inside the \
             shaded averaging band",
        );
        text.push_str(if view.last() > view.band[1] {
            "; the thin line extrapolates it to the first mode."
        } else {
            "."
        });
    } else if drawn && !view.interface_only {
        text.push_str(
            " This method takes the acceleration from all accelerometers, with what the \
             elastic structure adds to it: the curves bend away from the rigid body towards \
             the modes.",
        );
    }
    if entries.left_out > 0 {
        let _ = write!(text, " {} more runs are not drawn.", entries.left_out);
    }
    text.push_str("</p>");
    text
}

/// Magnitudes of the direct entries over all kept lines, logarithmic: where are the modes?
fn overview(entries: &Entries, view: &View<'_>) -> String {
    let direct: Vec<&Entry> = entries.list.iter().filter(|e| e.direct).collect();
    if direct.is_empty() {
        return String::new();
    }
    let mut key = vec![(Tone::Measured, Mark::Dots, "magnitude, measured")];
    if view.fit.is_some() {
        key.push((Tone::Fit, Mark::Line, "fit"));
        key.push((Tone::Muted, Mark::Dashed, "modes of the fixed structure"));
    }
    key.push((Tone::Identified, Mark::Dashed, "identified rigid body"));
    let charts = direct.iter().map(|e| magnitude(e, view));
    format!(
        "<h3>Magnitude over all lines</h3>{}{}",
        legend(&key),
        panels(charts)
    )
}

fn magnitude(entry: &Entry, view: &View<'_>) -> String {
    let size = |points: &[(f64, nalgebra::Complex<f64>)]| -> Vec<[f64; 2]> {
        points
            .iter()
            .map(|(f, z)| [*f, libm::hypot(z.re, z.im)])
            .collect()
    };
    let measured = size(&entry.measured);
    let fit = size(&entry.fit);
    let mut extent =
        Extent::within_quantiles(Mapping::Log, measured.iter().map(|p| p[1]), 0.004..1.0);
    let rigid: Vec<[f64; 2]> = entry.rigid.iter().map(|p| [p[0], p[1].abs()]).collect();
    rigid.iter().for_each(|p| extent.see(p[1]));
    let domain = extent.domain(0.08);
    let mut chart = LineChart::panel(
        entry.title.clone(),
        Axis::linear("Hz", [0.0, view.top]),
        Axis::new(detail(entry, ""), Mapping::Log, domain),
    );
    chart.shade(view.band, "averaging band");
    chart.rules = poles(view);
    chart.draw(
        "identified rigid body",
        Tone::Identified,
        Mark::Dashed,
        rigid,
    );
    chart.draw("measured", Tone::Measured, Mark::Dots, measured);
    push_fit(&mut chart, view, fit);
    chart.svg()
}

/// Real parts inside the band, without what the fit says is elastic: what the ten numbers
/// come from. Lines that scatter around a level are a good test, a slope is a poor fit.
fn closeup(entries: &Entries, view: &View<'_>) -> String {
    if entries.list.is_empty() {
        return String::new();
    }
    let mut key = Vec::new();
    let heading = if view.fit.is_some() {
        key.push((
            Tone::Measured,
            Mark::Dots,
            "measured, elastic part taken off",
        ));
        key.push((Tone::Fit, Mark::Thin, "fit with its elastic part"));
        "Real part inside the averaging band, elastic part taken off"
    } else {
        key.push((Tone::Measured, Mark::Dots, "measured"));
        "Real part inside the averaging band"
    };
    key.push((Tone::Identified, Mark::Dashed, "identified rigid body"));
    let charts = entries.list.iter().map(|e| real_part(e, view));
    format!("<h3>{heading}</h3>{}{}", legend(&key), panels(charts))
}

/// Least half height of a close-up, as a share of the level: what is flatter is flat.
const FLAT: f64 = 1e-3;

fn real_part(entry: &Entry, view: &View<'_>) -> String {
    let [low, high] = view.band;
    let inside = |f: f64| f >= low && f <= high;
    let measured: Vec<[f64; 2]> = entry
        .measured
        .iter()
        .enumerate()
        .filter(|(_, (f, _))| inside(*f))
        .map(|(k, (f, z))| [*f, z.re - entry.elastic.get(k).copied().unwrap_or(0.0)])
        .collect();
    let mut extent =
        Extent::within_quantiles(Mapping::Linear, measured.iter().map(|p| p[1]), 0.01..0.99);
    for [_, level] in entry.rigid.iter().filter(|p| inside(p[0])) {
        extent.see(level * (1.0 - FLAT));
        extent.see(level * (1.0 + FLAT));
    }
    let domain = extent.domain(0.1);
    let (factor, prefix) = axis_factor(domain[0].abs().max(domain[1].abs()));
    let scaled = |points: &mut dyn Iterator<Item = [f64; 2]>| -> Vec<[f64; 2]> {
        points.map(|p| [p[0], p[1] * factor]).collect()
    };
    let margin = 0.04 * (high - low);
    let mut chart = LineChart::panel(
        entry.title.clone(),
        Axis::linear("Hz", [(low - margin).max(0.0), high + margin]),
        Axis::linear(detail(entry, &prefix), domain.map(|v| v * factor)),
    );
    chart.shade(view.band, "");
    match entry.rigid.as_slice() {
        // A constant is a rule with its value at the end.
        [[_, a], [_, b]] if a == b => chart.rules.push(Rule::horizontal(
            a * factor,
            significant(a * factor, 5),
            Tone::Identified,
        )),
        rigid => chart.series.push(Series::new(
            "identified rigid body",
            Tone::Identified,
            Mark::Dashed,
            scaled(&mut rigid.iter().filter(|p| inside(p[0])).copied()),
        )),
    }
    chart.draw(
        "measured",
        Tone::Measured,
        Mark::Dots,
        scaled(&mut measured.into_iter()),
    );
    let fit = entry.fit.iter().filter(|(f, _)| inside(*f));
    chart.draw(
        "fit",
        Tone::Fit,
        Mark::Thin,
        scaled(&mut fit.map(|(f, z)| [*f, z.re])),
    );
    chart.svg()
}

fn detail(entry: &Entry, prefix: &str) -> String {
    format!("{}, {prefix}{}", entry.detail, entry.unit)
}

/// The fit: a full line where it was made, a thin one where it is extrapolated.
fn push_fit(chart: &mut LineChart, view: &View<'_>, fit: Vec<[f64; 2]>) {
    let [low, high] = match view.fit {
        Some(Fit::Lines(fit)) => fit.band,
        _ => view.band,
    };
    let mut part = |name: &str, mark: Mark, from: f64, to: f64| {
        let points = fit.iter().filter(|p| p[0] >= from && p[0] <= to);
        let series = Series::new(name, Tone::Fit, mark, points.copied().collect());
        chart.series.push(series);
    };
    part("fit, extrapolated", Mark::Thin, 0.0, view.last());
    part("fit", Mark::Line, low, high);
}

fn poles(view: &View<'_>) -> Vec<Rule> {
    let poles = view.fit.into_iter().flat_map(Fit::poles);
    poles
        .filter(|[frequency, _]| *frequency <= view.top)
        .map(|[frequency, _]| Rule::vertical(frequency, significant(frequency, 3), Tone::Muted))
        .collect()
}

/// The modes that the fit took account of. Its elastic terms are made to be taken off
/// inside the band; neighbours share what is there, so they are no effective masses.
fn modes(fit: &ApparentMass) -> String {
    if fit.poles.is_empty() {
        return "<p>No mode of the fixed structure was found in the lines.</p>".to_owned();
    }
    let mut html = String::from(
        "<h3>Modes of the fixed structure</h3><div class=\"wide\"><table class=\"plain\">\
         <thead><tr><th scope=\"col\" class=\"num\">Frequency, Hz</th>\
         <th scope=\"col\" class=\"num\">Damping, %</th>\
         <th scope=\"col\">In the fit</th></tr></thead><tbody>",
    );
    let shared = match (&fit.pseudo_mode, &fit.upper) {
        (Some(_), Some(_)) => "in the two terms for all modes above",
        (None, None) => "not needed inside the band",
        _ => "in the term for all modes above",
    };
    for (pole, mass) in fit.poles.iter().zip(&fit.elastic) {
        let role = match mass {
            Some(_) => "a term of its own",
            None => shared,
        };
        let _ = write!(
            html,
            "<tr><td class=\"num\">{}</td><td class=\"num\">{}</td><td>{role}</td></tr>",
            fixed(pole.frequency, 2),
            fixed(100.0 * pole.damping, 2)
        );
    }
    html.push_str(
        "</tbody></table></div><p class=\"small\">In percent of critical damping; the window \
         widens sharp peaks, so that the true damping is rather lower.</p>",
    );
    html
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_core::modes::Pole;
    use nalgebra::{Matrix6, Vector6};

    #[test]
    fn a_fit_is_drawn_to_the_first_mode_and_with_a_pseudo_mode_to_the_end_of_the_band() {
        let pole = |frequency, damping| Pole { frequency, damping };
        let mass = Matrix6::identity();
        let mut fit = ApparentMass {
            poles: [30.0, 40.0].into_iter().map(|f| pole(f, 0.01)).collect(),
            elastic: [None, Some(mass), None, None],
            pseudo_mode: None,
            upper: None,
            rigid: mass,
            excited: 6,
            weakest_excitation: 1e3,
            misfit: Vector6::zeros(),
        };
        let last = |fit: &ApparentMass| {
            let view = View {
                band: [1.0, 20.0],
                top: 60.0,
                fit: Some(Fit::Band(fit)),
                interface_only: true,
            };
            view.last()
        };
        assert_eq!(last(&fit), 40.0);
        fit.pseudo_mode = Some((pole(30.0, 0.0), mass));
        assert_eq!(last(&fit), 20.0);
    }
}

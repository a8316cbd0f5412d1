//! The section on the maximum likelihood fit: lines, modes, residuals, distance from the bound.

use super::markup::escape;
use super::number::{fixed, significant, uncertain};
use super::page::Section;
use crate::result::{LikelihoodDocument, ResultDocument};
use std::fmt::Write;

/// The section; `None` where another method was asked for.
pub(super) fn section(result: &ResultDocument) -> Option<Section> {
    let fit = result.likelihood.as_ref()?;
    let mut html = lines(fit);
    if !fit.modes.is_empty() {
        html.push_str(&modes(fit));
    }
    if !fit.residuals.is_empty() {
        html.push_str(&residuals(fit));
    }
    Some(Section::new("likelihood", "Maximum likelihood fit", html))
}

fn lines(fit: &LikelihoodDocument) -> String {
    let mut html = String::new();
    match (&fit.stepped_back, fit.band) {
        (Some(why), _) => {
            let _ = write!(
                html,
                "<p>The numbers are those of the apparent mass in the averaging band, since the fit did not pass its tests: {}.</p>",
                escape(why)
            );
        }
        (None, Some([low, high])) => {
            let _ = write!(
                html,
                "<p>{} lines from {} to {} Hz were fitted.",
                fit.lines,
                significant(low, 4),
                significant(high, 4)
            );
            if let Some(over) = fit.over_bound {
                let _ = write!(
                    html,
                    " The error bars are {} times {}.",
                    significant(over, 3),
                    fit.bound_in_words()
                );
            }
            html.push_str("</p>");
        }
        (None, None) => {}
    }
    if fit.stepped_back.is_none() {
        for band in &fit.rejected {
            let _ = write!(
                html,
                "<p class=\"small\">Lines up to {} Hz were not used: {}.</p>",
                significant(band.highest, 4),
                escape(&band.reason)
            );
        }
    }
    html
}

fn modes(fit: &LikelihoodDocument) -> String {
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"plain\"><thead><tr>\
         <th scope=\"col\" class=\"num\">Frequency, Hz</th>\
         <th scope=\"col\" class=\"num\">Damping, %</th>\
         <th scope=\"col\" class=\"num\">Exponent of the damping</th></tr></thead><tbody>",
    );
    for mode in &fit.modes {
        let number = |value: f64, std: Option<f64>| match std {
            Some(std) if std < value => uncertain(value, std),
            _ => significant(value, 3),
        };
        let _ = write!(
            html,
            "<tr><td class=\"num\">{}{}</td><td class=\"num\">{}</td><td class=\"num\">{}</td></tr>",
            number(mode.frequency, mode.frequency_std),
            if mode.among_lines {
                ""
            } else {
                " (beyond the lines)"
            },
            number(100.0 * mode.damping, mode.damping_std.map(|s| 100.0 * s)),
            fixed(mode.damping_exponent, 2)
        );
    }
    html.push_str(
        "</tbody></table></div><p class=\"small\">± is one standard deviation. The exponent is 1 for \
         viscous damping and 0 for structural damping.</p>",
    );
    html
}

fn residuals(fit: &LikelihoodDocument) -> String {
    let all = fit.residuals.iter().flatten().copied();
    let (low, high) = all.fold((f64::INFINITY, 0.0_f64), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let mut html = String::new();
    if let Some(ratio) = fit.residual_ratio {
        let _ = write!(
            html,
            "<p>The residuals have {} times the power of the noise (limit 1.2); over stretches of a twentieth of the lines {} to {} times.",
            significant(ratio, 3),
            significant(low, 3),
            significant(high, 3)
        );
    }
    if let Some(distance) = fit.low_line_distance {
        let _ = write!(
            html,
            " A fit of the low lines alone is a squared distance of {} away (limit 30).",
            significant(distance, 2)
        );
    }
    html.push_str("</p>");
    html
}

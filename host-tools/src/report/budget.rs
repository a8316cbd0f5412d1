//! The section on uncertainty: what noise and what stated errors of sensors contribute.

use super::markup::escape;
use super::number::{significant, uncertain, with_unit};
use super::page::Section;
use super::scales::Unit;
use super::table::TERMS;
use crate::identification::{Answer, estimates, number};
use std::fmt::Write;

/// The section, or `None` where neither setup nor certificates state an uncertainty.
pub(super) fn section(answer: &Answer) -> Option<Section> {
    let type_b = answer.type_b.as_ref()?;
    let i = &answer.identification;
    let all = estimates(i);
    let mut html = String::from(
        "<p>Type A is what scatters from sample to sample, type B what the setup and the \
         certificates state of calibrations, positions and directions; it would be the same in \
         the next test with these sensors. Both columns are standard uncertainties (k = 1). The \
         interval covers both, with the effective degrees of freedom of Welch and Satterthwaite.</p>\
         <div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\">Property</th>\
         <th scope=\"col\" class=\"num\">Type A</th><th scope=\"col\" class=\"num\">Type B</th>\
         <th scope=\"col\" class=\"num\">Value ± 95\u{202f}% interval of both</th><th></th>\
         <th scope=\"col\">Most of type B comes from</th></tr></thead><tbody>",
    );
    let largest = |first: usize| {
        let terms = all[first..first + 6].iter().flatten();
        terms.map(|e| e.value.abs()).fold(0.0, f64::max)
    };
    let mut rows: Vec<(usize, String, Unit)> = vec![match i.indicator {
        Some(_) => (number::INDICATOR, "Δ".to_owned(), Unit::ONE),
        None => {
            let unit = Unit::of_mass(i.mass.map_or(1.0, |m| m.value));
            (number::MASS, "m".to_owned(), unit)
        }
    }];
    for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
        rows.push((number::CENTRE + k, name.to_owned(), Unit::MILLIMETRE));
    }
    for (first, point) in [(number::INERTIA_REFERENCE, "A"), (number::INERTIA_CG, "S")] {
        let unit = Unit::of_inertia(largest(first));
        for (k, term) in TERMS.into_iter().enumerate() {
            rows.push((first + k, format!("Θ<sub>{term}</sub> about {point}"), unit));
        }
    }
    for (place, symbol, unit) in rows {
        let Some(e) = all[place] else { continue };
        let Some(both) = type_b.combined(place, &e, i.freedom) else {
            continue;
        };
        let source = type_b
            .dominant(place)
            .map_or(String::new(), |(source, share)| {
                let share = with_unit(&significant(100.0 * share, 2), "%");
                format!("{} ({share} of its variance)", escape(source))
            });
        let _ = write!(
            html,
            "<tr><th scope=\"row\"><i>{symbol}</i></th><td class=\"num\">{}</td>\
             <td class=\"num\">{}</td><td class=\"num value\">{}</td><td class=\"unit\">{}</td>\
             <td>{source}</td></tr>",
            significant(e.std / unit.si, 2),
            significant(both.type_b / unit.si, 2),
            uncertain(e.value / unit.si, both.interval / unit.si),
            unit.symbol,
        );
    }
    html.push_str("</tbody></table></div>");
    Some(Section::new("budget", "Uncertainty", html))
}

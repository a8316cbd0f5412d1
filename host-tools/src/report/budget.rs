//! The section on uncertainty: the shares of noise and of errors of sensors.

use super::markup::escape;
use super::number::{significant, with_unit};
use super::page::Section;
use super::scales::Unit;
use super::table::TERMS;
use crate::result::{Number, ResultDocument};
use std::fmt::Write;

/// The section, or `None` without type B uncertainty.
pub(super) fn section(result: &ResultDocument) -> Option<Section> {
    result.covariance_type_b.as_ref()?;
    let mut html = String::from(
        "<p>Type A is what scatters from sample to sample, type B what the setup and the \
         certificates state of calibrations, positions and directions, which would be the same in \
         the next test with these sensors, what forces change within a run, what readings that are \
         not linear may bend, and errors of sensors as large as the misfit of a rigid body tells. Both columns are standard uncertainties (k = 1). The \
         intervals above cover both, with the effective degrees of freedom of Welch and Satterthwaite.</p>\
         <div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\">Property</th>\
         <th scope=\"col\" class=\"num\">Type A</th><th scope=\"col\" class=\"num\">Type B</th>\
         <th></th>\
         <th scope=\"col\">Most of type B comes from</th></tr></thead><tbody>",
    );
    let mut rows: Vec<(&Number, String, Unit)> = vec![match &result.indicator {
        Some(indicator) => (indicator, "Δ".to_owned(), Unit::ONE),
        None => {
            let unit = Unit::of_mass(result.mass.value.unwrap_or(1.0));
            (&result.mass, "m".to_owned(), unit)
        }
    }];
    for (number, name) in result.centre_of_gravity.iter().zip(["x", "y", "z"]) {
        rows.push((number, name.to_owned(), Unit::MILLIMETRE));
    }
    for (terms, point) in [(&result.inertia_reference, "A"), (&result.inertia_cg, "S")] {
        let unit = Unit::of_inertia(terms.largest());
        for (number, term) in terms.terms().into_iter().zip(TERMS) {
            rows.push((number, format!("Θ<sub>{term}</sub> about {point}"), unit));
        }
    }
    for (number, symbol, unit) in rows {
        let Some((e, type_b)) = number.estimate().zip(number.type_b.as_ref()) else {
            continue;
        };
        let source = type_b.source.as_ref().zip(type_b.share);
        let source = source.map_or(String::new(), |(source, share)| {
            let share = with_unit(&significant(100.0 * share, 2), "%");
            format!("{} ({share} of its variance)", escape(source))
        });
        let _ = write!(
            html,
            "<tr><th scope=\"row\"><i>{symbol}</i></th><td class=\"num\">{}</td>\
             <td class=\"num\">{}</td><td class=\"unit\">{}</td>\
             <td>{source}</td></tr>",
            significant(e.std / unit.si, 2),
            significant(type_b.std / unit.si, 2),
            unit.symbol,
        );
    }
    html.push_str("</tbody></table></div>");
    Some(Section::new("budget", "Uncertainty", html))
}

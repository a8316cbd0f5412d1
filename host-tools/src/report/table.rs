//! The table of ten, with error bars.

use super::TrueBody;
use super::markup::escape;
use super::number::{self, decimals_of, fixed, significant, uncertain, with_unit};
use super::plot::{Anchor, Svg};
use super::scales::{Natural, Unit, largest_moment};
use crate::result::{InertiaTerms, Number, ResultDocument};
use massline_core::identify::Estimate;
use std::fmt::Write;

/// The six terms of inertia, in their fixed order.
pub(super) const TERMS: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];

struct Row<'a> {
    symbol: String,
    /// Meaning of the symbol.
    words: &'static str,
    number: &'a Number,
    truth: Option<f64>,
    /// Reference of its error in per cent, SI.
    whole: Option<f64>,
    unit: Unit,
    /// Remark behind the number.
    remark: &'static str,
}

/// The whole table.
pub(super) fn table(result: &ResultDocument, truth: Option<&TrueBody>) -> String {
    let groups = groups(result, truth);
    let widest = groups
        .iter()
        .flat_map(|(_, rows)| rows)
        .filter_map(share)
        .fold(0.0, f64::max);
    let mut html = String::new();
    if let Some(frame) = &result.frame {
        let _ = write!(
            html,
            "<p>In a frame with {}; plots, sketch and remarks are along the axes of the sensors.</p>",
            frame.words()
        );
    }
    html.push_str("<div class=\"wide\"><table class=\"ten\">");
    html.push_str(
        "<thead><tr><th scope=\"col\">Property</th>\
         <th scope=\"col\" class=\"num\">Value ± 95\u{202f}% interval</th><th></th>\
         <th scope=\"col\" class=\"num\">Relative</th>",
    );
    if truth.is_some() {
        html.push_str(
            "<th scope=\"col\">95\u{202f}% interval, truth</th>\
             <th scope=\"col\" class=\"num\">Truth</th>\
             <th scope=\"col\" class=\"num\" colspan=\"2\">Error</th>",
        );
    } else {
        let _ = write!(
            html,
            "<th scope=\"col\">95\u{202f}% interval{}</th>",
            if widest > 0.0 {
                let half = significant(widest * 100.0, 2);
                format!(", ±{} at full width", with_unit(&half, "%"))
            } else {
                String::new()
            }
        );
    }
    html.push_str("</tr></thead>");
    for (heading, rows) in &groups {
        let columns = if truth.is_some() { 8 } else { 5 };
        let _ = write!(
            html,
            "<tbody><tr class=\"group\"><th colspan=\"{columns}\" scope=\"rowgroup\">{}</th></tr>",
            escape(heading)
        );
        for row in rows {
            write_row(&mut html, row, truth.is_some(), widest);
        }
        html.push_str("</tbody>");
    }
    html.push_str("</table></div>");
    html.push_str(&footnote(result, truth));
    html
}

fn groups<'a>(result: &'a ResultDocument, truth: Option<&TrueBody>) -> Vec<(String, Vec<Row<'a>>)> {
    let natural = Natural::new(result, truth);
    let known = result.indicator.is_some() || result.mass.std == Some(0.0);
    let mass = Row {
        symbol: "m".to_owned(),
        words: "overall mass",
        number: &result.mass,
        truth: truth.and_then(|t| t.mass),
        whole: natural.mass,
        unit: Unit::of_mass(result.mass.value.unwrap_or(1.0)),
        remark: if known { "weighed" } else { "" },
    };
    let mut masses = vec![mass];
    if let Some(indicator) = &result.indicator {
        masses.push(Row {
            symbol: "Δ".to_owned(),
            words: "indicator, ideally 1",
            number: indicator,
            truth: truth.map(|_| 1.0),
            whole: Some(1.0),
            unit: Unit::ONE,
            remark: "",
        });
    }
    let centre = ["x", "y", "z"]
        .into_iter()
        .enumerate()
        .map(|(axis, name)| Row {
            symbol: name.to_owned(),
            words: "centre of gravity S",
            number: &result.centre_of_gravity[axis],
            truth: truth.and_then(|t| t.centre_of_gravity[axis]),
            whole: natural.length,
            unit: Unit::MILLIMETRE,
            remark: "",
        });
    let inertia = |terms: &'a InertiaTerms, truths: Option<&[Option<f64>; 6]>| {
        let true_terms = truths.iter().flat_map(|t| t.iter()).flatten();
        let unit = Unit::of_inertia(true_terms.fold(terms.largest(), |a, t| a.max(t.abs())));
        let moment = largest_moment(terms, truths);
        let numbers = terms.terms().into_iter().enumerate();
        numbers
            .map(|(t, number)| Row {
                symbol: format!("Θ<sub>{}</sub>", TERMS[t]),
                words: if t < 3 {
                    "moment of inertia"
                } else {
                    "product of inertia"
                },
                number,
                truth: truths.and_then(|truths| truths[t]),
                whole: moment,
                unit,
                remark: "",
            })
            .collect()
    };
    let point = result.reference_point.map(|x| number::exact(x * 1e3));
    let mut groups = vec![
        ("Mass".to_owned(), masses),
        ("Centre of gravity S".to_owned(), centre.collect()),
        (
            format!(
                "Inertia about the reference point A = ({}) mm",
                point.join(", ")
            ),
            inertia(
                &result.inertia_reference,
                truth.map(|t| &t.inertia_reference),
            ),
        ),
        (
            "Inertia about the centre of gravity S".to_owned(),
            inertia(&result.inertia_cg, truth.map(|t| &t.inertia_cg)),
        ),
    ];
    for (_, rows) in &mut groups {
        for row in rows {
            row.truth = row.truth.filter(|t| t.is_finite());
        }
    }
    groups
}

/// Half of the 95\u{202f}% interval as a share of what it is naturally compared with.
fn share(row: &Row<'_>) -> Option<f64> {
    let share = row.number.half_width() / row.whole?.abs();
    (share.is_finite() && share > 0.0).then_some(share)
}

fn write_row(html: &mut String, row: &Row<'_>, with_truth: bool, widest: f64) {
    let _ = write!(
        html,
        "<tr><th scope=\"row\"><i>{}</i> <span class=\"words\">{}</span></th>",
        row.symbol, row.words
    );
    let Some(e) = row.number.estimate() else {
        html.push_str("<td class=\"none\" colspan=\"4\">not observable from this test</td>");
        if with_truth {
            let _ = write!(html, "{}<td></td><td></td>", truth_cell(row));
        }
        html.push_str("</tr>");
        return;
    };
    let (value, half) = (e.value / row.unit.si, row.number.half_width() / row.unit.si);
    let _ = write!(
        html,
        "<td class=\"num value\">{}</td><td class=\"unit\">{}{}{}</td><td class=\"num\">{}</td>",
        uncertain(value, half),
        row.unit.symbol,
        if row.remark.is_empty() || row.unit.symbol.is_empty() {
            ""
        } else {
            ", "
        },
        row.remark,
        share(row).map_or(String::new(), |s| with_unit(
            &significant(100.0 * s, 2),
            "%"
        ))
    );
    let _ = write!(
        html,
        "<td class=\"bar\">{}</td>",
        bar(row, e.value, with_truth, widest)
    );
    if with_truth {
        html.push_str(&truth_cell(row));
        html.push_str(&error_cells(row, &e));
    }
    html.push_str("</tr>");
}

fn truth_cell(row: &Row<'_>) -> String {
    let text = row.truth.map_or(String::new(), |t| {
        let (t, half) = (t / row.unit.si, row.number.half_width() / row.unit.si);
        match row.number.value {
            // One digit more than the answer shows, where that is not more than is known.
            Some(_) if half > 0.0 => fixed(t, (decimals_of(half) + 1).min(9)),
            Some(_) => significant(t, 5),
            // There is no other number in the row that would carry the unit.
            None => with_unit(&significant(t, 5), row.unit.symbol),
        }
    });
    format!("<td class=\"num\">{text}</td>")
}

/// Error in percent and as a share of half the interval.
fn error_cells(row: &Row<'_>, e: &Estimate) -> String {
    let Some(truth) = row.truth else {
        return "<td></td><td></td>".to_owned();
    };
    let error = e.value - truth;
    if e.std == 0.0 && error == 0.0 {
        return "<td></td><td></td>".to_owned();
    }
    let percent = row.whole.map_or(String::new(), |whole| {
        with_unit(&signed(significant(100.0 * error / whole, 2)), "%")
    });
    let half = row.number.half_width();
    let (class, widths) = if half > 0.0 {
        let widths = error / half;
        let class = if widths.abs() > 1.0 { " outside" } else { "" };
        (class, with_unit(&signed(fixed(widths, 1)), "×"))
    } else {
        ("", String::new())
    };
    format!("<td class=\"num\">{percent}</td><td class=\"num{class}\">{widths}</td>")
}

fn signed(text: String) -> String {
    let zero = text.chars().all(|c| c == '0' || c == '.');
    if text.starts_with(number::MINUS) || zero || text == number::NO_NUMBER {
        text
    } else {
        format!("+{text}")
    }
}

/// The 95\u{202f}% interval. With a truth the bar is as long for every property and the truth
/// lies where it lies; without one, bars compare the properties with each other.
fn bar(row: &Row<'_>, value: f64, with_truth: bool, widest: f64) -> String {
    const WIDTH: f64 = 132.0;
    const MIDDLE: f64 = WIDTH / 2.0;
    /// Half widths from the middle to the end.
    const REACH: f64 = 2.0;
    let mut svg = Svg::new(WIDTH, 14.0, "");
    let half = if with_truth {
        (row.number.half_width() > 0.0).then_some(1.0 / REACH)
    } else {
        share(row).map(|s| s / widest)
    };
    let Some(half) = half.filter(|h| h.is_finite()) else {
        return String::new();
    };
    let room = MIDDLE - 6.0;
    let half = (half.min(1.0) * room).max(0.6);
    svg.line("bar-axis", [0.0, 7.0], [WIDTH, 7.0]);
    svg.rectangle("interval", [MIDDLE - half, 3.5], [2.0 * half, 7.0]);
    svg.line("centre", [MIDDLE, 1.5], [MIDDLE, 12.5]);
    if let Some(truth) = row.truth.filter(|_| with_truth) {
        let off = (truth - value) / (REACH * row.number.half_width());
        if off.abs() <= 1.0 {
            let x = MIDDLE + off * room;
            svg.path("truth-mark", &diamond(x, 7.0));
        } else if off.is_finite() {
            let (x, anchor, arrow) = if off > 0.0 {
                (WIDTH, Anchor::End, "▸")
            } else {
                (0.0, Anchor::Start, "◂")
            };
            svg.text("truth-arrow", [x, 11.0], anchor, arrow);
        }
    }
    svg.finish_inline()
}

fn diamond(x: f64, y: f64) -> String {
    const R: f64 = 4.0;
    super::plot::path::line(&[
        Some([x - R, y]),
        Some([x, y - R]),
        Some([x + R, y]),
        Some([x, y + R]),
        Some([x - R, y]),
    ])
}

fn footnote(result: &ResultDocument, truth: Option<&TrueBody>) -> String {
    let with_inertia = Natural::new(result, truth).inertia.is_some();
    let both = if result.covariance_type_b.is_some() {
        " It covers noise and type B uncertainty, which the next section tells apart."
    } else {
        ""
    };
    let mut text = format!(
        "<p class=\"small\">What follows ± is half of the 95\u{202f}% interval, here as everywhere.{both} \
         Relative is the same in percent: of the mass; for coordinates, of the ",
    );
    text.push_str(if with_inertia {
        "radius of gyration about S; for inertia, of the largest moment about the same point."
    } else {
        "distance of S from A."
    });
    if truth.is_some() {
        text.push_str(
            " Errors are given in the same percent and in times (×) what follows ±; bars end \
             at the 95\u{202f}% interval, ◆ is the truth.",
        );
    }
    if let Some((moments, axes)) = result.principal_moments.zip(result.principal_axes) {
        let largest = moments.iter().fold(0.0, |a: f64, m| a.max(m.abs()));
        let unit = Unit::of_inertia(largest);
        let deviations = result
            .inertia_cg
            .terms()
            .into_iter()
            .filter_map(Number::std_of_both);
        let decimals = decimals_of(deviations.fold(0.0, f64::max) / unit.si);
        let moments = moments.map(|m| fixed(m / unit.si, decimals));
        text.push_str("</p><table class=\"principal\"><caption>Principal moments and axes about S</caption><tbody>");
        for (k, (moment, axis)) in moments.iter().zip(axes).enumerate() {
            let axis = axis.map(|a| fixed(a, 4));
            let _ = write!(
                text,
                "<tr><th scope=\"row\"><i>Θ<sub>{}</sub></i></th><td class=\"num value\">{}</td>\
                 <td class=\"unit\">{}</td><td class=\"num\">({})</td></tr>",
                k + 1,
                moment,
                unit.symbol,
                axis.join(", ")
            );
        }
        text.push_str("</tbody></table>");
    } else {
        text.push_str(
            " Principal moments need all six terms of inertia about S; this test does not \
             give them.</p>",
        );
    }
    text
}

//! The table of ten on a terminal.

use super::true_body;
use crate::format::{plain, significant, with_std};
use crate::report::scales::{Natural, largest_moment};
use crate::result::{Number, ResultDocument};
use crate::simulate::{Bound, Truth};
use anstyle::{AnsiColor, Style};
use std::io::Write;

/// A number of the table.
pub(super) struct Row<'a> {
    pub(super) name: &'static str,
    /// The point that it is about, with a space before it; empty for mass and CG.
    pub(super) group: &'static str,
    pub(super) unit: &'static str,
    /// Displayed units per SI unit.
    pub(super) scale: f64,
    pub(super) number: &'a Number,
    /// Reference of its error in per cent, SI.
    pub(super) whole: Option<f64>,
    pub(super) truth: Option<f64>,
}

/// The rows of a result: mass or indicator, CG, inertia about A and about S.
pub(super) fn rows<'a>(result: &'a ResultDocument, truth: Option<&Truth>) -> Vec<Row<'a>> {
    let body = truth.map(true_body);
    let natural = Natural::new(result, body.as_ref());
    let first = match &result.indicator {
        Some(indicator) => Row {
            name: "indicator Δ",
            group: "",
            unit: "",
            scale: 1.0,
            number: indicator,
            whole: Some(1.0),
            truth: truth.map(|_| 1.0),
        },
        None => Row {
            name: "mass",
            group: "",
            unit: "kg",
            scale: 1.0,
            number: &result.mass,
            whole: natural.mass,
            truth: truth.map(|t| t.mass),
        },
    };
    let mut rows = vec![first];
    for (axis, name) in ["CG x", "CG y", "CG z"].into_iter().enumerate() {
        rows.push(Row {
            name,
            group: "",
            unit: "mm",
            scale: 1e3,
            number: &result.centre_of_gravity[axis],
            whole: natural.length,
            truth: truth.and_then(|t| t.centre_of_gravity[axis]),
        });
    }
    let names = ["Θxx", "Θyy", "Θzz", "Θxy", "Θxz", "Θyz"];
    let abouts = [
        (
            " about A",
            &result.inertia_reference,
            body.as_ref().map(|b| b.inertia_reference),
        ),
        (
            " about S",
            &result.inertia_cg,
            body.as_ref().map(|b| b.inertia_cg),
        ),
    ];
    for (group, terms, truth) in abouts {
        let (unit, scale) = if terms.largest() < 0.1 {
            ("g m²", 1e3)
        } else {
            ("kg m²", 1.0)
        };
        let whole = largest_moment(terms, truth.as_ref());
        for (j, (name, number)) in names.into_iter().zip(terms.terms()).enumerate() {
            rows.push(Row {
                name,
                group,
                unit,
                scale,
                number,
                whole,
                truth: truth.and_then(|truth| truth[j]),
            });
        }
    }
    rows
}

/// Prints the ten numbers with their error bars, and the truth beside them if it is known.
///
/// # Errors
/// If the terminal is gone.
pub fn print_numbers(
    out: &mut dyn Write,
    result: &ResultDocument,
    truth: Option<&Truth>,
) -> std::io::Result<()> {
    let bold = Style::new().bold();
    let dim = Style::new().dimmed();
    writeln!(out, "{bold}{}{bold:#}", result.title)?;
    let procedure = if result.iterative {
        format!("iterative, {} steps", result.iterations)
    } else {
        "direct".to_owned()
    };
    writeln!(out, "{} ({procedure})", result.method_description())?;
    if let Some(why) = &result.recommended_because {
        writeln!(out, "{dim}recommended: {why}{dim:#}")?;
    }
    let [x, y, z] = result.reference_point.map(|x| significant(x, 4));
    writeln!(
        out,
        "{dim}reference point A = ({x}, {y}, {z}) m, S = centre of gravity, products Θxy = ∫ x y dm{dim:#}"
    )?;
    if let Some(frame) = &result.frame {
        writeln!(out, "{dim}in a frame with {}{dim:#}", frame.words())?;
    }
    if let (Some(mass), Some(_)) = (result.mass.value, &result.indicator) {
        writeln!(out, "{dim}mass weighed: {} kg{dim:#}", significant(mass, 6))?;
    }
    let with_type_b = result.covariance_type_b.is_some();
    if with_type_b {
        writeln!(
            out,
            "{dim}95 % intervals: of the noise alone, and with type B uncertainty; behind each where most of that comes from{dim:#}"
        )?;
    }
    if truth.is_some() {
        writeln!(
            out,
            "{dim}errors in % of the mass, the radius of gyration about S, the largest moment about the same point{dim:#}"
        )?;
    }
    writeln!(out)?;
    write!(
        out,
        "{bold}{:<14}{:>12}  {:<13}",
        "", "value", "95 % interval"
    )?;
    if with_type_b {
        write!(out, "{:<15}", "  with type B")?;
    }
    if truth.is_some() {
        write!(out, "{:>12}{:>11}", "truth", "error")?;
    }
    writeln!(out, "{bold:#}")?;
    let mut unseen: Vec<&str> = Vec::new();
    let mut about = "";
    for row in rows(result, truth) {
        match row.number.value {
            Some(value) => print_row(out, &row, value, truth.is_some())?,
            None if row.group.is_empty() || row.group == about => unseen.push(row.name),
            // A term that is unknown about one point is seldom known about the other: the
            // second list only names the terms that the first does not.
            None if !unseen.contains(&row.name) => {
                about = row.group;
                unseen.push(row.name);
            }
            None => {}
        }
    }
    if !unseen.is_empty() {
        let yellow = AnsiColor::Yellow.on_default();
        writeln!(out)?;
        writeln!(
            out,
            "{yellow}not observable from this test:{yellow:#} {}",
            unseen.join(", ")
        )?;
    }
    if let Some(moments) = result.principal_moments {
        let m = moments.map(|m| significant(m, 4));
        writeln!(out)?;
        writeln!(out, "principal moments about S: {} kg m²", m.join(", "))?;
    }
    // Methods that look at modes have more than the averaging band, whose bound is the first.
    let widest = truth.and_then(|t| t.bounds.last());
    if let Some((bound, over)) = widest.and_then(|b| Some((b, over_bound(result, b)?))) {
        let [low, high] = bound.band.map(|x| plain(x, 4));
        writeln!(out)?;
        writeln!(
            out,
            "error bars: {} times the least that lines from {low} to {high} Hz can give (Cramér-Rao bound of the true model)",
            significant(over, 3)
        )?;
    }
    Ok(())
}

/// Root mean square ratio of standard deviations to a bound, over mass, CG and inertia about S.
fn over_bound(result: &ResultDocument, bound: &Bound) -> Option<f64> {
    // A weighed mass is estimated as the indicator Δ times it.
    let mass = match &result.indicator {
        Some(indicator) => indicator.std.zip(result.mass.value).map(|(std, m)| std * m),
        None => result.mass.std,
    };
    let cg = result.centre_of_gravity.iter().map(|n| n.std);
    let inertia = result.inertia_cg.terms().into_iter().map(|n| n.std);
    let deviations = [mass].into_iter().chain(cg).chain(inertia);
    let bounds = [bound.mass].into_iter();
    let bounds = bounds.chain(bound.centre_of_gravity);
    let bounds = bounds.chain(bound.inertia_cg.terms());
    let ratios: Vec<f64> = deviations
        .zip(bounds)
        .filter_map(|(std, bound)| Some((std? / bound?).powi(2)))
        .filter(|x| x.is_finite())
        .collect();
    let count = ratios.len() as f64;
    (count > 0.0).then(|| (ratios.iter().sum::<f64>() / count).sqrt())
}

fn print_row(
    out: &mut dyn Write,
    row: &Row<'_>,
    value: f64,
    with_truth: bool,
) -> std::io::Result<()> {
    let half_width = row.number.noise_half_width();
    let (shown, half) = with_std(value * row.scale, half_width * row.scale);
    let interval = format!("± {half} {}", row.unit);
    let name = format!("{}{}", row.name, row.group);
    write!(out, "{name:<14}{shown:>12}  {interval:<13}")?;
    let widest = row.number.half_width();
    if row.number.combined.is_some() {
        let (_, shown) = with_std(value * row.scale, widest * row.scale);
        write!(out, "  {:<13}", format!("± {shown} {}", row.unit))?;
    }
    if with_truth {
        match row.truth {
            Some(truth) => {
                let error = value - truth;
                let inside = error.abs() <= widest || widest == 0.0;
                let style = if inside {
                    AnsiColor::Green
                } else {
                    AnsiColor::Yellow
                }
                .on_default();
                let (shown, _) = with_std(truth * row.scale, half_width * row.scale / 10.0);
                let percent = row.whole.map_or_else(String::new, |whole| {
                    format!("{:+.3} %", 100.0 * error / whole.abs())
                });
                write!(out, "{shown:>12} {style}{percent:>10}{style:#}")?;
                if !inside {
                    write!(out, "  outside")?;
                }
            }
            None => write!(out, "{:>12}", "-")?,
        }
    }
    if let Some(source) = row.number.type_b.as_ref().and_then(|b| b.source.as_ref()) {
        let dim = Style::new().dimmed();
        write!(out, "  {dim}{source}{dim:#}")?;
    }
    writeln!(out)
}

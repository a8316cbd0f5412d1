//! The table of ten on a terminal.

use super::true_body;
use crate::format::{significant, with_std};
use crate::identification::{Answer, TypeB, number};
use crate::report::scales::{Natural, largest_moment};
use crate::simulate::Truth;
use anstyle::{AnsiColor, Style};
use massline_core::identify::{Estimate, Identification, Procedure};
use std::io::Write;

pub(super) struct Row {
    pub(super) name: String,
    /// What it is called where it is missing, and about which point.
    pub(super) group: &'static str,
    pub(super) unit: &'static str,
    /// Displayed units per SI unit.
    pub(super) scale: f64,
    pub(super) estimate: Option<Estimate>,
    /// Half of its 95 % interval, SI.
    pub(super) half_width: f64,
    /// The same with type B in it, where that is stated, and its main source.
    pub(super) combined: Option<(f64, Option<String>)>,
    /// What its error is a share of, SI.
    pub(super) whole: Option<f64>,
    pub(super) truth: Option<f64>,
}

/// The rows of an identification: mass or indicator, CG, inertia about A and about S.
pub(super) fn rows(i: &Identification, type_b: Option<&TypeB>, truth: Option<&Truth>) -> Vec<Row> {
    let mut rows = Vec::new();
    let body = truth.map(true_body);
    let natural = Natural::new(i, body.as_ref());
    let mut add = |name: String, group, unit, scale, estimate: Option<Estimate>, whole, truth| {
        rows.push(Row {
            name,
            group,
            unit,
            scale,
            estimate,
            half_width: estimate.map_or(0.0, |e| e.interval(i.freedom)),
            combined: None,
            whole,
            truth,
        });
    };
    match i.indicator {
        Some(indicator) => add(
            "indicator Δ".into(),
            "",
            "",
            1.0,
            Some(indicator),
            Some(1.0),
            truth.map(|_| 1.0),
        ),
        None => {
            let whole = natural.mass;
            add(
                "mass".into(),
                "",
                "kg",
                1.0,
                i.mass,
                whole,
                truth.map(|t| t.mass),
            );
        }
    }
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        add(
            format!("CG {name}"),
            "",
            "mm",
            1e3,
            i.centre_of_gravity[axis],
            natural.length,
            truth.and_then(|t| t.centre_of_gravity[axis]),
        );
    }
    let names = ["Θxx", "Θyy", "Θzz", "Θxy", "Θxz", "Θyz"];
    let abouts = [
        (
            " about A",
            i.inertia_reference,
            body.as_ref().map(|b| b.inertia_reference),
        ),
        (
            " about S",
            i.inertia_cg,
            body.as_ref().map(|b| b.inertia_cg),
        ),
    ];
    for (point, terms, truth) in abouts {
        let largest = terms
            .iter()
            .flatten()
            .fold(0.0_f64, |a, t| a.max(t.value.abs()));
        let (unit, scale) = if largest < 0.1 {
            ("g m²", 1e3)
        } else {
            ("kg m²", 1.0)
        };
        let whole = largest_moment(&terms, truth.as_ref());
        for (j, name) in names.into_iter().enumerate() {
            let truth = truth.and_then(|truth| truth[j]);
            add(name.to_owned(), point, unit, scale, terms[j], whole, truth);
        }
    }
    // Mass or Δ, then as the numbers of an identification.
    let first = match i.indicator {
        Some(_) => number::INDICATOR,
        None => number::MASS,
    };
    for (place, row) in rows.iter_mut().enumerate() {
        let place = match place {
            0 => first,
            _ => number::CENTRE + place - 1,
        };
        row.combined = type_b.zip(row.estimate).and_then(|(type_b, e)| {
            let both = type_b.combined(place, &e, i.freedom)?;
            let source = type_b.dominant(place).map(|(source, _)| source.to_owned());
            Some((both.interval, source))
        });
    }
    rows
}

/// What stands above the ten numbers.
#[derive(Clone, Copy, Debug)]
pub struct Heading<'a> {
    /// Title of the setup.
    pub title: &'a str,
    /// What gave the masslines, in words.
    pub method: &'a str,
    /// Direct or iterative.
    pub procedure: Procedure,
    /// Why this method, if the user left the choice.
    pub why: Option<&'a str>,
    /// Type B uncertainty, where it is stated.
    pub type_b: Option<&'a TypeB>,
}

/// Prints the ten numbers with their error bars, and the truth beside them if it is known.
///
/// # Errors
/// If the terminal is gone.
pub fn print_answer(
    out: &mut dyn Write,
    title: &str,
    answer: &Answer,
    truth: Option<&Truth>,
) -> std::io::Result<()> {
    let heading = Heading {
        title,
        method: answer.method_description(),
        procedure: answer.procedure,
        why: answer.why,
        type_b: answer.type_b.as_ref(),
    };
    print_numbers(out, &heading, &answer.identification, truth)
}

/// The same of an identification, wherever it was done.
///
/// # Errors
/// If the terminal is gone.
pub fn print_numbers(
    out: &mut dyn Write,
    heading: &Heading<'_>,
    i: &Identification,
    truth: Option<&Truth>,
) -> std::io::Result<()> {
    let bold = Style::new().bold();
    let dim = Style::new().dimmed();
    let title = heading.title;
    writeln!(out, "{bold}{title}{bold:#}")?;
    let procedure = match heading.procedure {
        Procedure::Direct => "direct".to_owned(),
        Procedure::Iterative { .. } => format!("iterative, {} steps", i.iterations),
    };
    writeln!(out, "{} ({procedure})", heading.method)?;
    if let Some(why) = heading.why {
        writeln!(out, "{dim}recommended: {why}{dim:#}")?;
    }
    let [x, y, z] = i.reference.into();
    writeln!(
        out,
        "{dim}reference point A = ({}, {}, {}) m, S = centre of gravity, products Θxy = ∫ x y dm{dim:#}",
        significant(x, 4),
        significant(y, 4),
        significant(z, 4)
    )?;
    if let (Some(mass), Some(_)) = (i.mass, i.indicator) {
        writeln!(
            out,
            "{dim}mass weighed: {} kg{dim:#}",
            significant(mass.value, 6)
        )?;
    }
    if heading.type_b.is_some() {
        writeln!(
            out,
            "{dim}95 % intervals: of the noise alone, and with the stated uncertainty of sensors; behind each where most of that comes from{dim:#}"
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
    if heading.type_b.is_some() {
        write!(out, "{:<15}", "  with sensors")?;
    }
    if truth.is_some() {
        write!(out, "{:>12}{:>11}", "truth", "error")?;
    }
    writeln!(out, "{bold:#}")?;
    let mut unseen: Vec<String> = Vec::new();
    let mut about = "";
    for row in rows(i, heading.type_b, truth) {
        match row.estimate {
            Some(e) => print_row(out, &row, e, truth.is_some())?,
            None if row.group.is_empty() || row.group == about => unseen.push(row.name),
            // What is not known about one point is seldom known about the other: the
            // second list only names what the first did not.
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
    if let Some(p) = i.principal {
        let m: Vec<String> = p.moments.iter().map(|&m| significant(m, 4)).collect();
        writeln!(out)?;
        writeln!(out, "principal moments about S: {} kg m²", m.join(", "))?;
    }
    Ok(())
}

fn print_row(out: &mut dyn Write, row: &Row, e: Estimate, with_truth: bool) -> std::io::Result<()> {
    let (value, half) = with_std(e.value * row.scale, row.half_width * row.scale);
    let interval = format!("± {half} {}", row.unit);
    let name = format!("{}{}", row.name, row.group);
    write!(out, "{name:<14}{value:>12}  {interval:<13}")?;
    let mut widest = row.half_width;
    if let Some((half, _)) = row.combined {
        let (_, shown) = with_std(e.value * row.scale, half * row.scale);
        write!(out, "  {:<13}", format!("± {shown} {}", row.unit))?;
        widest = half;
    }
    if with_truth {
        match row.truth {
            Some(truth) => {
                let error = e.value - truth;
                let inside = error.abs() <= widest || widest == 0.0;
                let style = if inside {
                    AnsiColor::Green
                } else {
                    AnsiColor::Yellow
                }
                .on_default();
                let (shown, _) = with_std(truth * row.scale, row.half_width * row.scale / 10.0);
                let percent = row.whole.map_or_else(String::new, |whole| {
                    format!("{:+.3} %", 100.0 * error / whole.abs())
                });
                write!(out, "{shown:>12}{style}{percent:>11}{style:#}")?;
                if !inside {
                    write!(out, "  outside")?;
                }
            }
            None => write!(out, "{:>12}", "-")?,
        }
    }
    if let Some((_, Some(source))) = &row.combined {
        let dim = Style::new().dimmed();
        write!(out, "  {dim}{source}{dim:#}")?;
    }
    writeln!(out)
}

//! The table of channels: where each sensor sits, what it read, what it weighed.

use super::markup::{escape, push_number, shortened};
use super::number::{exact, fixed, significant};
use crate::identification::Answer;
use crate::measure::MeasuredRun;
use crate::recording::{ChannelHealth, Complaint};
use crate::setup::{Mount, Quantity, Setup};
use std::fmt::Write;

/// A channel of the setup.
struct Channel<'a> {
    name: &'a str,
    kind: &'static str,
    unit: &'static str,
    scale: f64,
    place: String,
}

/// The table.
pub(super) fn table(setup: &Setup, answer: &Answer) -> String {
    let place = |position: [f64; 3], direction: [f64; 3]| {
        format!(
            "<td class=\"num\">({})</td><td class=\"num\">({})</td>",
            position.map(|x| exact((1e4 * x).round() / 10.0)).join(", "),
            direction.map(|x| exact((1e4 * x).round() / 1e4)).join(", ")
        )
    };
    let accelerometers = setup.accelerometers.iter().map(|a| Channel {
        name: &a.channel,
        kind: match a.mount {
            Mount::Interface => "interface",
            Mount::Structure => "structure",
        },
        unit: "m/s²",
        scale: a.scale,
        place: place(a.position, a.direction),
    });
    let cells = setup.load_cells.iter().map(|c| {
        let (kind, unit) = match c.quantity {
            Quantity::Force => ("load cell, force", "N"),
            Quantity::Moment => ("load cell, moment", "N m"),
        };
        Channel {
            name: &c.channel,
            kind,
            unit,
            scale: c.scale,
            place: place(c.position, c.direction),
        }
    });
    let runs = &answer.measurement.runs;
    let remarks: Vec<String> = (0..setup.accelerometers.len() + setup.load_cells.len())
        .map(|at| remarks(runs, at))
        .collect();
    let remarkable = remarks.iter().any(|r| !r.is_empty());
    let weights = answer.weights.as_deref();
    let mut html = heads(runs, weights.is_some(), remarkable);
    for (at, (channel, remark)) in accelerometers.chain(cells).zip(&remarks).enumerate() {
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}</th><td>{}</td>{}<td>{}</td>",
            escape(channel.name),
            channel.kind,
            channel.place,
            channel.unit
        );
        if let Some(weights) = weights {
            push_number(&mut html, &weight(weights, at));
        }
        let rms = |run: &MeasuredRun| {
            let rms = run.health.get(at).map_or(f64::NAN, |h| h.rms);
            (rms * channel.scale).abs()
        };
        let levels: Vec<f64> = if runs.len() > MOST_COLUMNS {
            vec![runs.iter().map(rms).fold(0.0, f64::max)]
        } else {
            runs.iter().map(rms).collect()
        };
        for level in levels {
            push_number(&mut html, &significant(level, 3));
        }
        if remarkable {
            let _ = write!(html, "<td class=\"wrap\">{remark}</td>");
        }
        html.push_str("</tr>");
    }
    html.push_str("</tbody></table></div>");
    html
}

/// The weight of an accelerometer, from the lowest to the highest of all runs; load cells
/// have none.
fn weight(weights: &[Vec<f64>], at: usize) -> String {
    let all = weights.iter().filter_map(|run| run.get(at).copied());
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), w| {
        (low.min(w), high.max(w))
    });
    if low > high {
        String::new()
    } else if high - low < 0.005 {
        fixed(low, 2)
    } else {
        format!("{} to {}", fixed(low, 2), fixed(high, 2))
    }
}

/// More runs than this share one column.
const MOST_COLUMNS: usize = 6;

fn heads(runs: &[MeasuredRun], weighted: bool, remarkable: bool) -> String {
    let columns = if runs.len() > MOST_COLUMNS {
        1
    } else {
        runs.len()
    };
    let rows = if columns > 1 { 2 } else { 1 };
    let mut html = format!(
        "<div class=\"wide\"><table class=\"plain channels\"><thead><tr>\
         <th scope=\"col\" rowspan=\"{rows}\">Channel</th>\
         <th scope=\"col\" rowspan=\"{rows}\">Sensor</th>\
         <th scope=\"col\" rowspan=\"{rows}\" class=\"num\">Position, mm</th>\
         <th scope=\"col\" rowspan=\"{rows}\" class=\"num\">Direction</th>\
         <th scope=\"col\" rowspan=\"{rows}\">Unit</th>"
    );
    if weighted {
        let _ = write!(
            html,
            "<th scope=\"col\" rowspan=\"{rows}\" class=\"num\">Weight</th>"
        );
    }
    match (columns, runs.len()) {
        (0, _) => {}
        (1, 1) => html.push_str("<th scope=\"col\" class=\"num\">RMS</th>"),
        (1, _) => html.push_str("<th scope=\"col\" class=\"num\">RMS, highest</th>"),
        _ => {
            let _ = write!(
                html,
                "<th class=\"over\" colspan=\"{columns}\">RMS in run</th>"
            );
        }
    }
    if remarkable {
        let _ = write!(html, "<th scope=\"col\" rowspan=\"{rows}\">Remarks</th>");
    }
    html.push_str("</tr>");
    if rows == 2 {
        html.push_str("<tr>");
        for run in runs {
            let name = shortened(&run.name, 14);
            let _ = write!(
                html,
                "<th scope=\"col\" class=\"num\">{}</th>",
                escape(&name)
            );
        }
        html.push_str("</tr>");
    }
    html.push_str("</thead><tbody>");
    html
}

fn remarks(runs: &[MeasuredRun], at: usize) -> String {
    let found: Vec<(&str, Option<String>)> = runs
        .iter()
        .map(|run| (run.name.as_str(), run.health.get(at).and_then(remark)))
        .collect();
    let text = match found.first() {
        Some((_, Some(first))) if found.iter().all(|(_, r)| r.as_ref() == Some(first)) => {
            let all = if found.len() > 1 { " in all runs" } else { "" };
            format!("{first}{all}")
        }
        _ => {
            let some = found
                .iter()
                .filter_map(|(run, r)| Some(format!("{run}: {}", r.as_ref()?)));
            some.collect::<Vec<String>>().join("; ")
        }
    };
    escape(&text)
}

/// A mean this many times the RMS eats the range of the converter.
const LARGE_OFFSET: f64 = 3.0;

fn remark(health: &ChannelHealth) -> Option<String> {
    match health.complaint() {
        Some(Complaint::Dead) => Some("no signal".to_owned()),
        Some(Complaint::Clipped { samples, .. }) => Some(format!("{samples} samples at the stop")),
        None if health.mean.abs() > LARGE_OFFSET * health.rms => Some("large offset".to_owned()),
        None => None,
    }
}

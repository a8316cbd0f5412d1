//! The section on coherence: does what is measured come from what was driven?

use super::lines::{Excited, comparable, determined_accelerations, measured_forces};
use super::markup::escape;
use super::number::{exact, significant, with_unit};
use super::page::{Section, captioned, panels};
use super::plot::{Axis, Extent, LineChart, Mapping, Mark, Series, Tone, legend};
use super::scales::lever;
use crate::identification::Answer;
use crate::measure::{MeasuredRun, Spectra};
use crate::result::ResultDocument;
use massline_core::geometry::{ACCELERATION_NAMES, RESULTANT_NAMES};
use massline_core::masslines::Moments;
use massline_core::spectra::{LineGrid, LineRange};
use nalgebra::Vector6;
use std::fmt::Write;

/// Share of a run's strongest component, in power, that counts as excited: a tenth in
/// amplitude.
const EXCITED: f64 = 1e-2;
/// Up to so many components of a kind are drawn one by one.
const FEW: usize = 4;
/// More runs than this are not drawn.
const MOST_RUNS: usize = 12;
/// Largest coherence that is drawn; higher ones are drawn there.
const NEAREST: f64 = 1.0 - 1e-7;

/// Coherences of some components of a run, line by line.
struct Curves {
    name: &'static str,
    tone: Tone,
    components: Vec<(&'static str, Vec<f64>)>,
    /// Measured, but not moved by this run.
    idle: Vec<&'static str>,
}

/// The section, or `None` without random runs.
pub(super) fn section(answer: &Answer, result: &ResultDocument) -> Option<Section> {
    let grid = answer.measurement.grid?;
    if answer.measurement.runs.is_empty() {
        return None;
    }
    let band = answer.measurement.band;
    let runs: Vec<(&MeasuredRun, Vec<Curves>)> = answer
        .measurement
        .runs
        .iter()
        .take(MOST_RUNS)
        .map(|run| (run, curves(run, answer, result)))
        .collect();
    let mut extent = Extent::new(Mapping::Nines);
    for (_, values) in all(&runs).flat_map(|c| &c.components) {
        let share = Extent::within_quantiles(Mapping::Nines, values.iter().copied(), 0.0..0.98);
        if !share.is_empty() {
            share.domain(0.0).into_iter().for_each(|v| extent.see(v));
        }
    }
    let domain = extent.domain(0.0);
    let figures = runs.iter().map(|(run, curves)| {
        let svg = chart(run, curves, &grid, band, domain);
        captioned(svg, &caption(curves, &grid, band))
    });
    let driven = runs.iter().any(|(r, _)| r.responses().is_some());
    let undriven = runs.iter().any(|(r, _)| r.responses().is_none());
    let mut html = String::from("<p>");
    if driven {
        html.push_str(
            "Coherence with the drive signal of the resultants that each run excites. One \
             would be a measurement without noise; dips at the modes of the structure are \
             leakage and harmless outside the shaded averaging band.",
        );
    }
    if undriven {
        html.push_str(
            " Without a drive signal it is the multiple coherence of each force with the six \
             accelerations: the share of its power that they explain.",
        );
    }
    html.push_str(
        " The axis is stretched towards one: from 0.9 to 0.99 is as far as from 0.99 to \
         0.999.</p>",
    );
    if answer.measurement.runs.len() > MOST_RUNS {
        let _ = write!(html, "<p>The first {MOST_RUNS} runs are drawn.</p>");
    }
    let mut key = Vec::new();
    for kind in 0..2 {
        if let Some(c) =
            all(&runs).find(|c| c.tone == Tone::Colour(kind) && !c.components.is_empty())
        {
            key.push((c.tone, Mark::Line, c.name));
        }
    }
    if all(&runs).any(|c| c.components.len() > FEW) {
        key.push((Tone::Muted, Mark::Area, "from the lowest to the highest"));
    }
    html.push_str(&legend(&key));
    html.push_str(&panels(figures));
    Some(Section::new("coherence", "Coherence", html))
}

fn all<'a>(runs: &'a [(&MeasuredRun, Vec<Curves>)]) -> impl Iterator<Item = &'a Curves> {
    runs.iter().flat_map(|(_, curves)| curves)
}

fn chart(
    run: &MeasuredRun,
    curves: &[Curves],
    grid: &LineGrid,
    band: LineRange,
    domain: [f64; 2],
) -> String {
    let top = grid.frequency(grid.count.saturating_sub(1));
    let mut chart = LineChart::panel(
        run.name.clone(),
        Axis::linear("Hz", [0.0, top]),
        Axis::new("γ²", Mapping::Nines, domain),
    );
    chart.shade(grid.ends(band), "");
    for kind in curves {
        if kind.components.len() <= FEW {
            for (name, values) in &kind.components {
                let points = values.iter().enumerate();
                let points = points.map(|(k, v)| [grid.frequency(k), *v]).collect();
                let series = Series::new(*name, kind.tone, Mark::Thin, points);
                chart.series.push(series.labelled());
            }
        } else {
            push_range(&mut chart, kind, grid);
        }
    }
    chart.svg()
}

/// Many components: their median between the lowest and the highest.
fn push_range(chart: &mut LineChart, kind: &Curves, grid: &LineGrid) {
    let ranked = |pick: fn(&[f64]) -> Option<&f64>| -> Vec<[f64; 2]> {
        (0..grid.count)
            .map(|k| {
                let here = kind
                    .components
                    .iter()
                    .filter_map(|(_, v)| v.get(k).copied());
                let mut here: Vec<f64> = here.collect();
                here.sort_by(f64::total_cmp);
                [grid.frequency(k), pick(&here).copied().unwrap_or(f64::NAN)]
            })
            .collect()
    };
    let (low, high) = (ranked(|v| v.first()), ranked(|v| v.last()));
    let range = format!("{}, lowest to highest", kind.name);
    chart.series.push(Series::area(range, kind.tone, high, low));
    let middle = ranked(|v| v.get(v.len() / 2));
    chart.draw(kind.name, kind.tone, Mark::Thin, middle);
}

/// The lowest in the band, and who is not in the picture.
fn caption(curves: &[Curves], grid: &LineGrid, band: LineRange) -> String {
    let mut lowest: Option<(f64, &str, f64)> = None;
    for (name, values) in curves.iter().flat_map(|c| &c.components) {
        for k in band {
            if let Some(&v) = values.get(k)
                && lowest.is_none_or(|(l, _, _)| v < l)
            {
                lowest = Some((v, name, grid.frequency(k)));
            }
        }
    }
    let mut text = match lowest {
        Some((value, name, frequency)) => format!(
            "Lowest in the band: {}, {name} at {}.",
            near_one(value),
            with_unit(&exact(frequency), "Hz")
        ),
        None => "This run excites nothing.".to_owned(),
    };
    let idle: Vec<&str> = curves.iter().flat_map(|c| c.idle.clone()).collect();
    if !idle.is_empty() {
        text.push_str(&format!(" Not excited by this run: {}.", idle.join(", ")));
    }
    escape(&text)
}

/// A share that may be very near one: two digits of what is missing.
fn near_one(value: f64) -> String {
    let missing = 1.0 - value;
    if missing >= 0.5 {
        significant(value, 2)
    } else if missing < 1e-7 {
        "1".to_owned()
    } else {
        super::number::fixed(value, super::number::decimals_of(missing).min(9))
    }
}

fn curves(run: &MeasuredRun, answer: &Answer, result: &ResultDocument) -> Vec<Curves> {
    let lever = lever(result);
    let band = answer.measurement.band;
    let determined = determined_accelerations(&run.geometry);
    let forces = measured_forces(&run.geometry);
    let power = |offset: usize| {
        Vector6::from_fn(|j, _| {
            let lines = band.into_iter().filter_map(|k| run.density.get(k));
            lines.map(|d| d[offset + j]).sum::<f64>()
        })
    };
    match &run.spectra {
        Spectra::Drive { coherence, .. } => {
            let of = |c: usize| -> Vec<f64> {
                coherence
                    .iter()
                    .map(|line| f64::from(line[c]).min(NEAREST))
                    .collect()
            };
            vec![
                sorted(
                    "base accelerations",
                    Tone::Colour(0),
                    &ACCELERATION_NAMES,
                    &determined,
                    &comparable(&power(0), lever, false),
                    of,
                ),
                sorted(
                    "forces and moments",
                    Tone::Colour(1),
                    &RESULTANT_NAMES,
                    &forces,
                    &comparable(&power(6), lever, true),
                    |j| of(6 + j),
                ),
            ]
        }
        Spectra::Cross { .. } => {
            let multiple = multiple_coherence(run, answer);
            vec![sorted(
                "forces and moments",
                Tone::Colour(1),
                &RESULTANT_NAMES,
                &forces,
                &comparable(&power(6), lever, true),
                |j| multiple.iter().map(|line| line[j].min(NEAREST)).collect(),
            )]
        }
    }
}

/// Parts the measured components into excited and idle ones.
fn sorted(
    name: &'static str,
    tone: Tone,
    names: &[&'static str; 6],
    measured: &[bool; 6],
    power: &Vector6<f64>,
    values: impl Fn(usize) -> Vec<f64>,
) -> Curves {
    let strongest = (0..6)
        .filter(|j| measured[*j])
        .map(|j| power[j])
        .fold(0.0, f64::max);
    let mut curves = Curves {
        name,
        tone,
        components: Vec::new(),
        idle: Vec::new(),
    };
    for j in (0..6).filter(|j| measured[*j]) {
        if power[j] > 0.0 && power[j] >= EXCITED * strongest {
            curves.components.push((names[j], values(j)));
        } else {
            curves.idle.push(names[j]);
        }
    }
    curves
}

/// Share of each force that the accelerations explain, line by line.
fn multiple_coherence(run: &MeasuredRun, answer: &Answer) -> Vec<[f64; 6]> {
    let read = answer.measurement.group_of(run).read(None, |lines| {
        let excited = Excited::new(lines, answer.measurement.band);
        (0..lines.count())
            .map(|line| {
                let mut m = Moments::default();
                lines.add_moments(0, line, 1.0, &mut m);
                let quotient = super::response::quotient(&m, &excited.components);
                core::array::from_fn(|i| {
                    let explained = quotient
                        .map_or(f64::NAN, |q| (q.row(i) * m.fa.row(i).adjoint())[(0, 0)].re);
                    explained / m.ff[(i, i)].re
                })
            })
            .collect()
    });
    read.unwrap_or_default()
}

//! The section on the base spectra: was every motion excited by some run?

use super::lines::determined_accelerations;
use super::page::{Section, panels};
use super::plot::{Axis, Extent, LineChart, Mapping, Mark, Series, Span, Tone, legend};
use crate::identification::Answer;
use crate::measure::MeasuredRun;
use massline_core::geometry::ACCELERATION_NAMES;
use massline_core::spectra::LineGrid;
use std::fmt::Write;

/// Runs up to which each has a colour of its own.
const MOST_COLOURS: usize = 7;
/// Runs drawn in one panel: those that move its component most.
const MOST_SERIES: usize = 8;
/// Decades that are shown below the highest peak; deeper lies only noise.
const DECADES: f64 = 9.0;

/// The section, or `None` without random runs.
pub(super) fn section(answer: &Answer) -> Option<Section> {
    let grid = answer.measurement.grid?;
    let runs = &answer.measurement.runs;
    if runs.is_empty() {
        return None;
    }
    let seen: Vec<usize> = (0..6)
        .filter(|j| {
            runs.iter()
                .any(|r| determined_accelerations(&r.geometry)[*j])
        })
        .collect();
    let translation = domain(runs, seen.iter().copied().filter(|j| *j < 3));
    let rotation = domain(runs, seen.iter().copied().filter(|j| *j >= 3));
    let band = answer.measurement.band;
    let span = Span {
        x: grid.ends(band),
        label: String::new(),
    };
    let charts = seen.iter().map(|&j| {
        let (unit, domain) = if j < 3 {
            ("(m/s²)²/Hz", translation)
        } else {
            ("(rad/s²)²/Hz", rotation)
        };
        let top = grid.frequency(grid.count.saturating_sub(1));
        let mut chart = LineChart::panel(
            ACCELERATION_NAMES[j],
            Axis::linear("Hz", [0.0, top]),
            Axis::new(unit, Mapping::Log, domain),
        );
        chart.spans.push(span.clone());
        chart.series = series(runs, &grid, j);
        chart.svg()
    });
    let names: Vec<(Tone, Mark, &str)> = runs
        .iter()
        .enumerate()
        .map(|(n, run)| (Tone::Colour(n), Mark::Line, run.name.as_str()))
        .collect();
    let mut html = String::from(
        "<p>Power spectral density of the base acceleration at the reference point, run by \
         run. Translations share one scale, rotations another; what lies far below the \
         highest is cross-talk of the table, or noise of the sensors.</p>",
    );
    html.push_str(&legend(&names));
    if runs.len() > MOST_COLOURS {
        let _ = write!(
            html,
            "<p class=\"small\">Further runs repeat the colours; each panel shows the \
             {MOST_SERIES} runs that move its component most.</p>"
        );
    }
    html.push_str(&panels(charts));
    Some(Section::new("base-spectra", "Base spectra", html))
}

fn series(runs: &[MeasuredRun], grid: &LineGrid, j: usize) -> Vec<Series> {
    let mut list: Vec<Series> = runs
        .iter()
        .enumerate()
        .filter(|(_, run)| determined_accelerations(&run.geometry)[j])
        .map(|(n, run)| {
            let points = run.density.iter().enumerate();
            let points = points.map(|(k, d)| [grid.frequency(k), d[j]]).collect();
            Series::new(run.name.clone(), Tone::Colour(n), Mark::Thin, points)
        })
        .collect();
    // The strongest is drawn last, so that noise does not cover it.
    let strength = |s: &Series| s.points.iter().map(|p| p[1]).sum::<f64>();
    list.sort_by(|a, b| strength(a).total_cmp(&strength(b)));
    list.split_off(list.len().saturating_sub(MOST_SERIES))
}

fn domain(runs: &[MeasuredRun], components: impl Iterator<Item = usize>) -> [f64; 2] {
    let mut extent = Extent::new(Mapping::Log);
    for j in components {
        for run in runs
            .iter()
            .filter(|r| determined_accelerations(&r.geometry)[j])
        {
            let values = run.density.iter().map(|d| d[j]);
            let share = Extent::within_quantiles(Mapping::Log, values, 0.01..1.0);
            if !share.is_empty() {
                share.domain(0.0).into_iter().for_each(|v| extent.see(v));
            }
        }
    }
    let [low, high] = extent.domain(0.06);
    [low.max(high * libm::pow(10.0, -DECADES)), high]
}

//! Runs that share their equations and their way of averaging condense together.

use super::AnswerError;
use crate::measure::{MeasuredRun, MeasuredSine, Measurement, RunGeometry, Spectra, WINDOW};
use crate::setup::Setup;
use massline_core::masslines::{
    self, Bands, Condensed, CrossLines, DriveLines, Lines, MasslineError, Method, SineLines,
};
use massline_core::spectra::{CrossAverage, RunResponses, Sum};
use nalgebra::Complex;
use std::ops::Range;

/// Masslines of every group of runs.
pub(super) fn all(
    setup: &Setup,
    method: Method,
    measurement: &Measurement,
) -> Result<Vec<Condensed>, AnswerError> {
    let mut condensed = Vec::new();
    for group in groups(&measurement.runs, |a, b| {
        alike(&a.geometry, &b.geometry) && a.responses().is_some() == b.responses().is_some()
    }) {
        condensed.push(random(setup, method, &group, measurement)?);
    }
    for group in groups(&measurement.sines, |a, b| alike(&a.geometry, &b.geometry)) {
        condensed.push(sine(setup, method, &group)?);
    }
    Ok(condensed)
}

fn alike(a: &RunGeometry, b: &RunGeometry) -> bool {
    // Equal up to the rounding of a rotation matrix.
    (a.equations.rows() - b.equations.rows()).norm() < 1e-9
}

fn groups<T>(runs: &[T], alike: impl Fn(&T, &T) -> bool) -> Vec<Vec<&T>> {
    let mut groups: Vec<Vec<&T>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|g| alike(g[0], run)) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

fn random(
    setup: &Setup,
    method: Method,
    group: &[&MeasuredRun],
    measurement: &Measurement,
) -> Result<Condensed, AnswerError> {
    let band = measurement.band.clone();
    let geometry = &group[0].geometry;
    let responses: Vec<RunResponses<'_>> = group.iter().filter_map(|r| r.responses()).collect();
    if let Some(lines) = DriveLines::new(&responses, WINDOW) {
        return of_lines(setup, method, &lines, band, geometry);
    }
    let settings = *group[0].settings();
    let mut storage: Vec<(Vec<Sum>, u32)> = group
        .iter()
        .filter_map(|r| match &r.spectra {
            Spectra::Cross { sums } => Some((sums.clone(), r.blocks)),
            Spectra::Drive { .. } => None,
        })
        .collect();
    let averages: Vec<CrossAverage<'_>> = storage
        .iter_mut()
        .filter_map(|(sums, blocks)| CrossAverage::resume(&settings, sums, *blocks).ok())
        .collect();
    let maps: Vec<_> = group.iter().map(|r| r.geometry.map.clone()).collect();
    let lines = CrossLines::new(
        &averages,
        settings.grid(),
        band.clone(),
        WINDOW,
        measurement.hop,
        &maps,
    )
    .ok_or(MasslineError::TooManyPairs)?;
    of_lines(setup, method, &lines, band, geometry)
}

fn sine(setup: &Setup, method: Method, group: &[&MeasuredSine]) -> Result<Condensed, AnswerError> {
    let runs: Vec<_> = group.iter().map(|s| s.run()).collect();
    let lines = SineLines::new(&group[0].frequencies, &runs).ok_or(MasslineError::Singular)?;
    let band = setup
        .processing
        .as_ref()
        .map_or(0..0, |p| group[0].within(p.averaging_band));
    of_lines(setup, method, &lines, band, &group[0].geometry)
}

fn of_lines<L: Lines>(
    setup: &Setup,
    method: Method,
    lines: &L,
    band: Range<usize>,
    geometry: &RunGeometry,
) -> Result<Condensed, AnswerError> {
    let mut bands = Bands::new(band, lines.count());
    bands.modes = setup.estimation.modes;
    if let Some([low, high]) = setup.estimation.fit_band {
        let inside = |line: &usize| (low..=high).contains(&lines.frequency(*line));
        let start = (0..lines.count()).find(inside).unwrap_or(0);
        let end = (0..lines.count()).rfind(inside).map_or(start, |l| l + 1);
        bands.fit = start..end;
    }
    let mut work = vec![Complex::new(0.0, 0.0); 2 * lines.count()];
    Ok(masslines::condense(
        method,
        lines,
        &bands,
        geometry.reference,
        &geometry.equations,
        &mut work,
    )?)
}

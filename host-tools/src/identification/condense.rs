//! Groups of runs to masslines, and to the modes of the fixed structure.

use super::AnswerError;
use crate::measure::{Group, Measurement};
use crate::setup::Setup;
use massline_core::masslines::{self, Bands, Condensed, FixedMode, Lines, MasslineError, Method};
use nalgebra::Complex;
use std::ops::Range;

/// Masslines of every group of runs.
pub(super) fn all(
    setup: &Setup,
    method: Method,
    measurement: &Measurement,
) -> Result<Vec<Condensed>, AnswerError> {
    let name = format!("method {}", method.name());
    each_group(setup, measurement, &name, |lines, group| {
        let mut bands = Bands::new(group.band.clone(), lines.count());
        bands.modes = setup.estimation.modes;
        bands.fit = fit_lines(setup, lines);
        let geometry = group.geometry();
        masslines::condense(
            method,
            lines,
            &bands,
            geometry.reference,
            &geometry.equations,
            &mut work(lines),
        )
    })
}

/// Modes of the fixed structure, from the group of runs that shows most of them.
pub(super) fn fixed_modes(
    setup: &Setup,
    measurement: &Measurement,
) -> Result<Vec<FixedMode>, AnswerError> {
    let groups = each_group(setup, measurement, "modal analysis", |lines, group| {
        let (band, fit) = (group.band.clone(), fit_lines(setup, lines));
        let equations = &group.geometry().equations;
        masslines::fixed_modes(lines, band, fit, equations, &mut work(lines))
    })?;
    let most = groups.into_iter().max_by_key(|modes| modes.len());
    Ok(most.map_or_else(Vec::new, |modes| modes.to_vec()))
}

fn each_group<T>(
    setup: &Setup,
    measurement: &Measurement,
    name: &str,
    task: impl Fn(&dyn Lines, &Group<'_>) -> Result<T, MasslineError>,
) -> Result<Vec<T>, AnswerError> {
    let groups = measurement.groups(setup);
    let done = groups.iter().map(|group| {
        let done = group.read(None, |lines| task(lines, group));
        done.unwrap_or(Err(MasslineError::TooManyPairs))
            .map_err(|e| AnswerError::lacking(name, e))
    });
    done.collect()
}

/// Lines of the fit band, all that are kept without one.
fn fit_lines(setup: &Setup, lines: &dyn Lines) -> Range<usize> {
    match setup.fit_band() {
        Some(band) => masslines::lines_between(lines, band),
        None => 0..lines.count(),
    }
}

fn work(lines: &dyn Lines) -> Vec<Complex<f64>> {
    vec![Complex::new(0.0, 0.0); 2 * lines.count()]
}

//! Groups of runs to masslines, and to the modes of the fixed structure.

use super::AnswerError;
use crate::measure::{Group, Measurement};
use crate::setup::Setup;
use massline_core::masslines::{self, Bands, Condensed, FixedMode, FreeModes, Lines, Method};
use massline_core::spectra::LineRange;
use nalgebra::Complex;

/// Masslines of every group of runs.
pub(super) fn all(
    setup: &Setup,
    method: Method,
    measurement: &Measurement,
) -> Result<Vec<Condensed>, AnswerError> {
    let name = format!("method {}", method.name());
    each_group(measurement, &name, |lines, group| {
        let mut bands = Bands::new(group.band);
        bands.modes = setup.estimation.modes;
        bands.fit = fit_lines(setup, lines)?;
        let geometry = group.geometry();
        masslines::condense(
            method,
            lines,
            &bands,
            geometry.reference,
            &geometry.equations,
            &mut work(lines),
        )
        .map_err(|e| AnswerError::lacking(&name, e))
    })
}

/// Modes of the fixed structure, from the group of runs that shows most of them.
pub(super) fn fixed_modes(
    setup: &Setup,
    measurement: &Measurement,
) -> Result<Vec<FixedMode>, AnswerError> {
    let groups = each_group(measurement, "modal analysis", |lines, group| {
        let (band, fit) = (group.band, fit_lines(setup, lines)?);
        let equations = &group.geometry().equations;
        masslines::fixed_modes(lines, band, fit, equations, &mut work(lines))
            .map_err(|e| AnswerError::lacking("modal analysis", e))
    })?;
    let most = groups.into_iter().max_by_key(|modes| modes.len());
    Ok(most.map_or_else(Vec::new, |modes| modes.to_vec()))
}

/// Modes of the free structure; `None` where the runs do not suffice.
pub(super) fn free_modes(setup: &Setup, measurement: &Measurement) -> Option<FreeModes> {
    let condensed = all(setup, Method::Synthesis, measurement).ok()?;
    condensed.into_iter().find_map(|c| c.free_modes)
}

fn each_group<T>(
    measurement: &Measurement,
    name: &str,
    task: impl Fn(&dyn Lines, &Group<'_>) -> Result<T, AnswerError>,
) -> Result<Vec<T>, AnswerError> {
    let groups = measurement.groups();
    let done = groups.iter().map(|group| {
        let done = group.read(None, |lines| task(lines, group));
        done.unwrap_or_else(|e| Err(AnswerError::lacking(name, e)))
    });
    done.collect()
}

/// Lines of the fit band. Without one, those from the averaging band's begin up to where
/// recordings are kept by default: modes far above would only cost.
fn fit_lines(setup: &Setup, lines: &dyn Lines) -> Result<LineRange, AnswerError> {
    let (key, band) = match (setup.estimation.fit_band, &setup.processing) {
        (Some(band), _) => ("fit_band", band),
        (None, Some(p)) => {
            let last = lines.frequency(lines.count().saturating_sub(1));
            let high = p.kept_up_to(None).min(last);
            ("averaging_band", [p.averaging_band[0], high])
        }
        (None, None) => return Ok(LineRange::all(lines.count())),
    };
    masslines::lines_between(lines, band).map_err(|source| AnswerError::Band { key, source })
}

fn work(lines: &dyn Lines) -> Vec<Complex<f64>> {
    vec![Complex::new(0.0, 0.0); 2 * lines.count()]
}

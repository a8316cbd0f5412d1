//! Runs that share their equations and their way of averaging condense together.

use super::AnswerError;
use crate::measure::{MeasuredRun, MeasuredSine, Measurement, RunGeometry, Spectra, WINDOW};
use crate::setup::Setup;
use massline_core::masslines::{
    self, Bands, Condensed, CrossLines, DriveLines, FixedMode, Lines, MasslineError, Method,
    SineLines,
};
use massline_core::spectra::{CrossAverage, RunResponses, Sum};
use nalgebra::Complex;
use std::ops::Range;

/// What is done with the lines of a group.
trait Task {
    type Output;
    fn of<L: Lines>(
        &self,
        lines: &L,
        band: Range<usize>,
        geometry: &RunGeometry,
    ) -> Result<Self::Output, AnswerError>;
}

/// Masslines of every group of runs.
pub(super) fn all(
    setup: &Setup,
    method: Method,
    measurement: &Measurement,
) -> Result<Vec<Condensed>, AnswerError> {
    each_group(setup, measurement, &ToMasslines { setup, method })
}

/// Modes of the fixed structure, from the group of runs that shows most of them.
pub(super) fn fixed_modes(
    setup: &Setup,
    measurement: &Measurement,
) -> Result<Vec<FixedMode>, AnswerError> {
    let groups = each_group(setup, measurement, &ToFixedModes { setup })?;
    Ok(groups.into_iter().max_by_key(Vec::len).unwrap_or_default())
}

fn each_group<T: Task>(
    setup: &Setup,
    measurement: &Measurement,
    task: &T,
) -> Result<Vec<T::Output>, AnswerError> {
    let mut done = Vec::new();
    for group in groups(&measurement.runs, |a, b| {
        alike(&a.geometry, &b.geometry) && a.responses().is_some() == b.responses().is_some()
    }) {
        done.push(random(task, &group, measurement)?);
    }
    for group in groups(&measurement.sines, |a, b| alike(&a.geometry, &b.geometry)) {
        done.push(sine(setup, task, &group)?);
    }
    Ok(done)
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

fn random<T: Task>(
    task: &T,
    group: &[&MeasuredRun],
    measurement: &Measurement,
) -> Result<T::Output, AnswerError> {
    let band = measurement.band.clone();
    let geometry = &group[0].geometry;
    let responses: Vec<RunResponses<'_>> = group.iter().filter_map(|r| r.responses()).collect();
    if let Some(lines) = DriveLines::new(&responses, WINDOW) {
        return task.of(&lines, band, geometry);
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
    task.of(&lines, band, geometry)
}

fn sine<T: Task>(
    setup: &Setup,
    task: &T,
    group: &[&MeasuredSine],
) -> Result<T::Output, AnswerError> {
    let runs: Vec<_> = group.iter().map(|s| s.run()).collect();
    let lines = SineLines::new(&group[0].frequencies, &runs).ok_or(MasslineError::Singular)?;
    let band = setup
        .processing
        .as_ref()
        .map_or(0..0, |p| group[0].within(p.averaging_band));
    task.of(&lines, band, &group[0].geometry)
}

fn work<L: Lines>(lines: &L) -> Vec<Complex<f64>> {
    vec![Complex::new(0.0, 0.0); 2 * lines.count()]
}

/// Lines in which modes are looked for: those asked for, else up to the mode band's end,
/// else as far as recordings are kept by default. Modes far above would only cost.
fn fit_lines<L: Lines>(setup: &Setup, lines: &L) -> Range<usize> {
    let Some([low, high]) = setup.estimation.fit_band.or_else(|| {
        let p = setup.processing.as_ref()?;
        Some([p.averaging_band[0], p.kept_up_to(None)])
    }) else {
        return 0..lines.count();
    };
    let inside = |line: &usize| (low..=high).contains(&lines.frequency(*line));
    let start = (0..lines.count()).find(inside).unwrap_or(0);
    let end = (0..lines.count()).rfind(inside).map_or(start, |l| l + 1);
    start..end
}

struct ToMasslines<'s> {
    setup: &'s Setup,
    method: Method,
}

impl Task for ToMasslines<'_> {
    type Output = Condensed;

    fn of<L: Lines>(
        &self,
        lines: &L,
        band: Range<usize>,
        geometry: &RunGeometry,
    ) -> Result<Condensed, AnswerError> {
        let mut bands = Bands::new(band, lines.count());
        bands.modes = self.setup.estimation.modes;
        bands.fit = fit_lines(self.setup, lines);
        Ok(masslines::condense(
            self.method,
            lines,
            &bands,
            geometry.reference,
            &geometry.equations,
            &mut work(lines),
        )?)
    }
}

struct ToFixedModes<'s> {
    setup: &'s Setup,
}

impl Task for ToFixedModes<'_> {
    type Output = Vec<FixedMode>;

    fn of<L: Lines>(
        &self,
        lines: &L,
        band: Range<usize>,
        geometry: &RunGeometry,
    ) -> Result<Vec<FixedMode>, AnswerError> {
        let fit = fit_lines(self.setup, lines);
        let modes =
            masslines::fixed_modes(lines, band, fit, &geometry.equations, &mut work(lines))?;
        Ok(modes.to_vec())
    }
}

//! One pass over each recording for all that a session asks of it, several recordings at a time.
//!
//! Averages of several selections of accelerometers and the survey have blocks of their own each, so that they
//! have the bits of passes of their own.

use super::distortion::{Distortion, Distortions};
use super::opened::{Ended, Opened, block_settings};
use super::random::{self, Averaged, Resultants};
use super::sums::SumStorage;
use super::survey::{self, Sensors};
use super::units::StatedUnits;
use super::{
    Accelerations, MeasureError, Measurement, Progress, RunGeometry, Survey, Wanted, assemble,
};
use crate::parallel::{self, Idle};
use crate::recording::Recording;
use crate::setup::{Excitation, Run, Setup};
use massline_core::spectra::BlockSettings;

/// One random run that was read.
struct Passed {
    units: StatedUnits,
    notes: Vec<String>,
    ended: Ended,
    /// In the order of the selections.
    averaged: Vec<Option<(RunGeometry, Averaged)>>,
    distortions: Vec<Distortion>,
    surveyed: Option<survey::Found>,
}

/// The measurements of several selections of accelerometers and the survey, of at most the first `limit` samples of
/// each random run; on `threads` threads, as many as there are processors if `None`. `None` where the set-up has no
/// random run, or the survey would settle the sample rate by another run.
///
/// # Errors
/// An error of one of them, not necessarily the first.
pub(crate) fn together(
    setup: &Setup,
    selections: &[Accelerations],
    limit: Option<u64>,
    threads: Option<usize>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Option<(Vec<Measurement>, Survey)>, MeasureError> {
    let is_random = |run: &Run| run.excitation == Excitation::Random;
    let numbers = (0..setup.runs.len()).filter(|number| is_random(&setup.runs[*number]));
    let numbers: Vec<usize> = numbers.collect();
    let driven = |number: &&usize| survey::is_driven(&setup.runs[**number]);
    if numbers.is_empty() || (numbers.iter().any(|n| driven(&n)) && !driven(&&numbers[0])) {
        return Ok(None);
    }
    let settings = block_settings(setup)?;
    let job = |at: usize, report: &mut dyn FnMut(f64), idle: &Idle| {
        let wanted = (numbers[at], selections, limit);
        pass(setup, wanted, settings, idle, report)
    };
    let mut report = |latest: usize, done: f64| {
        let number = numbers[latest];
        progress(Progress {
            work: super::Work::Reading,
            run: (done as usize).min(numbers.len() - 1),
            runs: numbers.len(),
            name: &setup.runs[number].name,
            share: done - (done as usize).min(numbers.len() - 1) as f64,
        });
    };
    let passed = parallel::each_with_shares(numbers.len(), threads, &job, &mut report)?;
    let mut of_run: Vec<Option<Passed>> = setup.runs.iter().map(|_| None).collect();
    for (number, passed) in numbers.iter().zip(passed) {
        of_run[*number] = Some(passed);
    }
    let mut measurements = Vec::with_capacity(selections.len());
    for (at, selection) in selections.iter().enumerate() {
        let mut random = |run: Wanted<'_>| {
            let (number, settled, noticed) = (run.number, run.settings, run.noticed);
            *settled = settings;
            let Some(passed) = &mut of_run[number] else {
                return Ok(Vec::new());
            };
            let Some((geometry, averaged)) = passed.averaged[at].take() else {
                return Ok(Vec::new());
            };
            noticed.notice_units(setup, &passed.units)?;
            let warnings = &mut noticed.warnings;
            warnings.extend(passed.notes.iter().cloned());
            let distortions = &passed.distortions;
            random::conclude(
                setup,
                geometry,
                averaged,
                distortions,
                &passed.ended,
                warnings,
            )
        };
        measurements.push(assemble(setup, selection, &mut random, &mut |_| ())?);
    }
    let mut surveyed = |number: usize| {
        let found = of_run[number]
            .as_mut()
            .and_then(|passed| passed.surveyed.take());
        Ok(found.unwrap_or_default())
    };
    let survey = survey::gather(setup, &mut surveyed)?;
    Ok(Some((measurements, survey)))
}

/// Reads one random run.
fn pass(
    setup: &Setup,
    (number, selections, limit): (usize, &[Accelerations], Option<u64>),
    mut settings: Option<BlockSettings>,
    idle: &Idle,
    progress: &mut dyn FnMut(f64),
) -> Result<Passed, MeasureError> {
    let run = &setup.runs[number];
    let geometries = selections
        .iter()
        .map(|a| RunGeometry::new(setup, number, a));
    let geometries: Vec<RunGeometry> = geometries.collect::<Result<_, _>>()?;
    // The survey's geometry is that of the interface accelerometers, where there are any: it is the last selection.
    let own;
    let of_interface = match (selections.last(), geometries.last()) {
        (Some(Accelerations::Interface), Some(last)) => last,
        _ => {
            own = survey::geometry(setup, number)?;
            &own
        }
    };
    let of_survey = survey::is_driven(run).then_some(of_interface);
    let (mut units, mut notes) = (None, Vec::new());
    let mut notice = |recording: &Recording| {
        units = Some(StatedUnits::of(setup, run, recording));
        recording.notice_columns(&mut notes);
        Ok(())
    };
    let mut opened = Opened::new(setup, number, limit, &mut settings, &mut notice)?;
    let band = opened.band()?;
    let mut storages: Vec<_> = geometries.iter().map(|_| SumStorage::default()).collect();
    let mut of_sensors = SumStorage::default();
    let resultants = geometries.iter().zip(&mut storages);
    let resultants = resultants.map(|(g, storage)| Resultants::new(&opened, band, g, storage));
    let mut resultants: Vec<Resultants<'_>> = resultants.collect::<Result<_, _>>()?;
    let sensors = of_survey.map(|g| Sensors::new(&opened, g, &mut of_sensors));
    let mut sensors = sensors.transpose()?;
    let drives = opened.drives.len();
    let mut distortions = Distortions::new(of_interface, band.indices(), drives);
    let mut sinks: Vec<&mut dyn super::stream::Sink> = Vec::new();
    for sink in &mut resultants {
        sinks.push(sink);
    }
    if let Some(sink) = &mut sensors {
        sinks.push(sink);
    }
    sinks.push(&mut distortions);
    let read = opened.read(&mut sinks, idle, progress)?;
    let averaged = resultants
        .into_iter()
        .map(|r| r.finish(&opened, &distortions));
    let averaged: Vec<Averaged> = averaged.collect::<Result<_, _>>()?;
    let surveyed = sensors.map(|sensors| sensors.finish(&opened, &read));
    let averaged = averaged
        .into_iter()
        .zip(storages)
        .map(|(a, storage)| a.with(storage));
    let distortions = distortions.finish(&opened.settings);
    Ok(Passed {
        distortions,
        units: units.unwrap_or_default(),
        notes,
        surveyed: surveyed.transpose()?,
        ended: opened.ended(read),
        averaged: geometries
            .clone()
            .into_iter()
            .zip(averaged)
            .map(Some)
            .collect(),
    })
}

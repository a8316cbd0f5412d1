//! Random runs from samples in memory: what [`super::measure`] does with recordings, for
//! studies that draw thousands of them.

use super::noise::Stated;
use super::opened::settings_at;
use super::random::{densities, finish_drive};
use super::{
    Accelerations, BlockStorage, MeasureError, MeasuredRun, Measurement, Rejected, RunGeometry,
    Spectra,
};
use crate::recording::Preamble;
use crate::setup::{Run, Setup};
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{
    Average, BlockSettings, CrossAverage, CrossSums, DriveAverage, LineRange, SpectraError, Sum,
};
use std::path::PathBuf;

/// Samples of one run in recorded units, one list a channel and all of one length.
pub(crate) struct Samples<'a> {
    /// Accelerometers, then load cells, in the order of the setup.
    pub(crate) sensors: &'a [Vec<f32>],
    /// The generator's signal; read where the run names a `reference`.
    pub(crate) drive: &'a [f32],
}

/// Averages the random runs of a setup from samples, in the order of the runs.
///
/// # Errors
/// [`MeasureError`] where sensors, bands or lengths do not suit.
pub(crate) fn measure_samples(
    setup: &Setup,
    accelerations: &Accelerations,
    runs: &[Samples<'_>],
) -> Result<Measurement, MeasureError> {
    let mut measurement = Measurement::default();
    for (number, (run, samples)) in setup.runs.iter().zip(runs).enumerate() {
        let geometry = RunGeometry::new(setup, number, accelerations)?;
        let processing = setup.processing.as_ref();
        let (Some(processing), Some(rate)) = (processing, processing.and_then(|p| p.sample_rate))
        else {
            return Err(MeasureError::NoProcessing {
                run: run.name.clone(),
            });
        };
        let file = PathBuf::from(&run.recording);
        let spectral = |source| MeasureError::Spectra {
            file: file.clone(),
            source,
        };
        let settings = settings_at(processing, rate).map_err(spectral)?;
        measurement.grid = Some(settings.grid());
        measurement.band = settings
            .grid()
            .within(processing.averaging_band)
            .map_err(|why| MeasureError::band(&file, "averaging_band", why))?;
        measurement.hop = settings.hop() as f64 / settings.block_length() as f64;
        let stated = Stated::of(setup, &geometry, &mut measurement.warnings);
        let mut measured = averaged((number, run), geometry, settings, measurement.band, samples)
            .map_err(spectral)?;
        if measured.blocks < 2 {
            return Err(MeasureError::TooShort {
                file,
                samples: measured.samples,
                blocks: measured.blocks,
                block_length: settings.block_length(),
            });
        }
        measured.stated = stated.whole.iter().all(|w| *w).then_some(stated.noise);
        measurement.noise.push(measured.noise_origin());
        measurement.runs.push(measured);
    }
    Ok(measurement)
}

fn averaged(
    (number, run): (usize, &Run),
    geometry: RunGeometry,
    settings: BlockSettings,
    band: LineRange,
    samples: &Samples<'_>,
) -> Result<MeasuredRun, SpectraError> {
    let resultants = |sample: &[f32], into: &mut [f32]| {
        into.copy_from_slice(&geometry.resultants(sample));
    };
    let (spectra, density, blocks) = if !run.references.is_empty() {
        let mut sums = vec![Sum::ZERO; DriveAverage::storage_len(&settings, RESULTANTS)];
        let mut average = DriveAverage::new(&settings, RESULTANTS, &mut sums)?;
        feed(
            &settings,
            samples,
            (true, RESULTANTS),
            &resultants,
            &mut average,
        )?;
        finish_drive(band, &geometry, &settings, &average)?
    } else {
        let mut sums = vec![CrossSums::default(); settings.grid().count];
        let mut average = CrossAverage::new(&settings, &mut sums)?;
        feed(
            &settings,
            samples,
            (false, RESULTANTS),
            &resultants,
            &mut average,
        )?;
        let blocks = average.blocks();
        let power = |c: usize, k: usize| average.cross(c, c, k).0;
        let density = densities(&settings.grid(), settings.density(), blocks, &power);
        (Spectra::Cross { sums }, density, blocks)
    };
    Ok(MeasuredRun {
        name: run.name.clone(),
        number,
        geometry,
        spectra,
        density,
        blocks,
        freedom: blocks,
        band,
        samples: samples.sensors.first().map_or(0, Vec::len) as u64,
        rejected: Rejected::default(),
        preamble: Preamble::default(),
        health: Vec::new(),
        early_late: None,
        distortions: Vec::new(),
        fingerprint: 0,
        stated: None,
        settings,
    })
}

/// Streams samples through blocks into an average: `transform` turns a sample of all sensors into
/// the channels that are averaged, so many behind the drive where there is one.
pub(super) fn feed(
    settings: &BlockSettings,
    samples: &Samples<'_>,
    (driven, count): (bool, usize),
    transform: &dyn Fn(&[f32], &mut [f32]),
    average: &mut dyn Average,
) -> Result<(), SpectraError> {
    let lead = usize::from(driven);
    let channels = lead + count;
    let mut storage = BlockStorage::new(*settings, channels);
    let mut blocks = storage.blocks()?;
    let mut sample = vec![0.0_f32; samples.sensors.len()];
    let mut input = vec![0.0_f32; channels];
    for n in 0..samples.sensors.first().map_or(0, Vec::len) {
        for (slot, channel) in sample.iter_mut().zip(samples.sensors) {
            *slot = channel.get(n).copied().unwrap_or(0.0);
        }
        let (head, tail) = input.split_at_mut(lead);
        if let Some(slot) = head.first_mut() {
            *slot = samples.drive.get(n).copied().unwrap_or(0.0);
        }
        transform(&sample, tail);
        if let Some(block) = blocks.push(&input) {
            average.add(&block);
        }
    }
    Ok(())
}

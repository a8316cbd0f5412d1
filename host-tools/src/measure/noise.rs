//! Sources of the noise of a run, and its estimation where spectra do not tell it.
//!
//! # Design
//!
//! Random runs tell their noise by what a drive, or the other half of the resultants, does not
//! explain. Elsewhere the first of these that there is counts, for accelerations and for forces
//! each by itself:
//!
//! | source | stepped sine | static poses |
//! | --- | --- | --- |
//! | stated: key `noise` of every sensor of that half | of a complex amplitude | of the reading of a pose |
//! | repeats | scatter of the amplitudes of runs that repeat each other | scatter of rows of one `pose` |
//! | what should not be there | what a line misses of the cubic through its neighbours | what more than three accelerometers leave of one vector |
//! | assumed | a resolution of 1e-6 | a resolution of 1e-6 |
//!
//! Sensors are independent, and what is known of them becomes the noise of the resultants
//! through the geometry, so that its correlations are there and it moves with A.

use super::{MeasuredSine, RunGeometry};
use crate::setup::Setup;
use massline_core::geometry::ResultantNoise;
use nalgebra::Complex;

/// Source of the noise of the accelerations or of the forces of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseOrigin {
    /// Averaged spectra.
    Spectra,
    /// The sensors' key `noise`.
    Stated,
    /// The scatter of repeats.
    Repeats,
    /// The misfit of neighbouring lines.
    Neighbours,
    /// Residual of a rigid set of sensors, or of a rigid body.
    Residual,
    /// A resolution that nothing in the data speaks for.
    Assumed,
}

impl NoiseOrigin {
    /// The word of the result document.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Spectra => "spectra",
            Self::Stated => "stated",
            Self::Repeats => "repeats",
            Self::Neighbours => "neighbours",
            Self::Residual => "residual",
            Self::Assumed => "assumed",
        }
    }
}

/// Source of the noise of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunNoise {
    /// Name of the run.
    pub run: String,
    /// Source of the noise of its accelerations.
    pub accelerations: NoiseOrigin,
    /// Source of the noise of its forces.
    pub forces: NoiseOrigin,
}

/// Relative resolution that is assumed where nothing tells the noise, and the least there is:
/// recordings are text of six or more digits.
pub(super) const RESOLUTION: f64 = 1e-6;

/// The noise that the setup states of a run's sensors, by halves.
pub(super) struct Stated {
    pub(super) noise: ResultantNoise,
    /// `true` if every sensor of accelerations, of forces states its own.
    pub(super) whole: [bool; 2],
}

impl Stated {
    /// Stated noise of the sensors that count in this geometry. Warns of those that lack a `noise`
    /// that others of their half have.
    pub(super) fn of(setup: &Setup, geometry: &RunGeometry, warnings: &mut Vec<String>) -> Self {
        let mut noise = ResultantNoise::default();
        let sensors = setup.accelerometers.len();
        let mut whole = [false; 2];
        for (half, kind) in ["accelerometers", "load cells"].into_iter().enumerate() {
            let (mut with, mut without) = (0, Vec::new());
            for (k, column) in geometry.columns.iter().enumerate() {
                let counts = column.iter().any(|x| *x != 0.0);
                if (k >= sensors) != (half == 1) || !counts {
                    continue;
                }
                let (own, scale) = if half == 0 {
                    let scale = setup.accelerometers[k].scale;
                    (setup.accelerometer_uncertainty(k), scale)
                } else {
                    let scale = setup.load_cells[k - sensors].scale;
                    (setup.load_cell_uncertainty(k - sensors), scale)
                };
                match own.noise {
                    Some(std) => {
                        with += 1;
                        noise.add_sensor(column, (std / scale).powi(2));
                    }
                    None => without.push(geometry.channels[k].as_str()),
                }
            }
            whole[half] = with > 0 && without.is_empty();
            if with > 0 && !without.is_empty() {
                warnings.push(format!(
                    "`noise` is stated of some {kind} only and is not used: it is missing for {}",
                    without.join(", ")
                ));
            }
        }
        Self { noise, whole }
    }
}

/// Puts the noise of sine runs in its place when all of them have been read.
pub(super) fn settle(
    setup: &Setup,
    sines: &mut [MeasuredSine],
    warnings: &mut Vec<String>,
) -> Vec<RunNoise> {
    let repeated: Vec<Option<ResultantNoise>> =
        sines.iter().map(|run| repeats(run, sines)).collect();
    let mut origins = Vec::new();
    for (run, repeated) in sines.iter_mut().zip(repeated) {
        let stated = Stated::of(setup, &run.geometry, warnings);
        let mut noise = ResultantNoise::default();
        let mut origin = [NoiseOrigin::Assumed; 2];
        for (half, origin) in origin.iter_mut().enumerate() {
            let (from, source) = if stated.whole[half] {
                (stated.noise, NoiseOrigin::Stated)
            } else if let Some(repeated) = repeated {
                (repeated, NoiseOrigin::Repeats)
            } else if let Some(neighbours) = run.neighbours {
                (neighbours, NoiseOrigin::Neighbours)
            } else {
                continue;
            };
            *origin = source;
            if half == 0 {
                noise.acceleration = from.acceleration;
            } else {
                noise.force = from.force;
            }
        }
        noise.add(&run.resolution, 1.0);
        run.noise = noise;
        if origin.contains(&NoiseOrigin::Assumed) {
            warnings.push(assumed(
                &run.name,
                "too few frequencies in the averaging band do not tell how noisy they are",
                "repeat the run and name the first one by `repeats`",
            ));
        }
        origins.push(RunNoise {
            run: run.name.clone(),
            accelerations: origin[0],
            forces: origin[1],
        });
    }
    origins
}

/// The warning about a run whose noise is assumed.
pub(super) fn assumed(run: &str, why: &str, advice: &str) -> String {
    format!(
        "run \"{run}\": {why}; a relative resolution of {RESOLUTION:.0e} is assumed, and what is observable and the error bars rest on that assumption. State the sensors' `noise`, or {advice}"
    )
}

/// The noise of a run that is repeated, or repeats another, from the scatter of each channel
/// about the mean of the repeats over the lines of the averaging band.
fn repeats(run: &MeasuredSine, all: &[MeasuredSine]) -> Option<ResultantNoise> {
    let first = run.repeats.as_ref().unwrap_or(&run.name);
    let same =
        |other: &&MeasuredSine| other.name == *first || other.repeats.as_ref() == Some(first);
    let members: Vec<&MeasuredSine> = all.iter().filter(same).collect();
    let freedom = members.len().checked_sub(1).filter(|n| *n > 0)?;
    let mut noise = ResultantNoise::default();
    for (channel, column) in run.geometry.columns.iter().enumerate() {
        let (mut squares, mut lines) = (0.0, 0.0);
        for line in run.band {
            let values = || members.iter().map(|m| m.readings[line][channel]);
            let mean = values().sum::<Complex<f64>>() / members.len() as f64;
            squares += values().map(|x| (x - mean).norm_sqr()).sum::<f64>();
            lines += 1.0;
        }
        noise.add_sensor(column, squares / (freedom as f64 * f64::max(lines, 1.0)));
    }
    Some(noise)
}

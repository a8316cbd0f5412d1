//! The runs as the estimators saw them: in groups that share their equations, as second
//! moments line by line.

use crate::identification::Answer;
use crate::measure::{MeasuredRun, MeasuredSine, Measurement, RunGeometry, Spectra, WINDOW};
use crate::setup::Setup;
use massline_core::masslines::{
    ApparentMass, CrossLines, DriveLines, Excitation, Lines, Moments, SineLines,
};
use massline_core::spectra::{CrossAverage, RunResponses, Sum};
use nalgebra::{Matrix6, Vector6};
use std::ops::Range;

/// Runs that were condensed together, and the fit to them.
pub(super) struct Group<'a> {
    members: Members<'a>,
    measurement: &'a Measurement,
    /// Averaging band, as indices into the lines.
    pub band: Range<usize>,
    /// What the apparent mass was fitted with.
    pub fit: Option<&'a ApparentMass>,
}

enum Members<'a> {
    Random(Vec<&'a MeasuredRun>),
    Sine(Vec<&'a MeasuredSine>),
}

/// Power over noise from which a component can be divided by: noise pulls the quotient
/// towards zero by less than a hundredth.
const ABOVE_NOISE: f64 = 100.0;

/// Below this share a component counts as not measured.
pub(super) const WHOLE: f64 = 1.0 - 1e-6;

/// The groups of an answer, in the order in which its fits stand: random runs, then sines.
pub(super) fn groups<'a>(setup: &Setup, answer: &'a Answer) -> Vec<Group<'a>> {
    let measurement: &Measurement = &answer.measurement;
    let random = gather(&measurement.runs, |a, b| {
        alike(&a.geometry, &b.geometry) && a.responses().is_some() == b.responses().is_some()
    });
    let sines = gather(&measurement.sines, |a, b| alike(&a.geometry, &b.geometry));
    let band = setup.processing.as_ref().map(|p| p.averaging_band);
    let random = random.into_iter().map(|runs| Group {
        members: Members::Random(runs),
        measurement,
        band: measurement.band.clone(),
        fit: None,
    });
    let sines = sines.into_iter().map(|runs| Group {
        band: band.map_or(0..0, |band| runs[0].within(band)),
        members: Members::Sine(runs),
        measurement,
        fit: None,
    });
    let mut groups: Vec<Group<'a>> = random.chain(sines).collect();
    for (group, fit) in groups.iter_mut().zip(&answer.fits) {
        group.fit = Some(fit);
    }
    groups
}

fn alike(a: &RunGeometry, b: &RunGeometry) -> bool {
    // Equal up to the rounding of a rotation matrix.
    (a.equations.rows() - b.equations.rows()).norm() < 1e-9
}

fn gather<T>(runs: &[T], alike: impl Fn(&T, &T) -> bool) -> Vec<Vec<&T>> {
    let mut groups: Vec<Vec<&T>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|g| alike(g[0], run)) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

impl<'a> Group<'a> {
    /// A group of one random run.
    pub fn of_run(run: &'a MeasuredRun, measurement: &'a Measurement) -> Self {
        Self {
            members: Members::Random(vec![run]),
            measurement,
            band: measurement.band.clone(),
            fit: None,
        }
    }

    /// Names of the runs.
    pub fn names(&self) -> Vec<&'a str> {
        match &self.members {
            Members::Random(runs) => runs.iter().map(|r| r.name.as_str()).collect(),
            Members::Sine(runs) => runs.iter().map(|r| r.name.as_str()).collect(),
        }
    }

    /// The sensors, which the runs share as far as it matters.
    pub fn geometry(&self) -> &'a RunGeometry {
        match &self.members {
            Members::Random(runs) => &runs[0].geometry,
            Members::Sine(runs) => &runs[0].geometry,
        }
    }

    /// Whether each run is a single pair of acceleration and force at every line.
    pub fn is_paired(&self) -> bool {
        match &self.members {
            Members::Random(runs) => runs[0].responses().is_some(),
            Members::Sine(_) => true,
        }
    }

    /// Lets `look` see the lines of all runs, or of one; `None` if they cannot be read
    /// together.
    pub fn read<R>(&self, one: Option<usize>, look: impl FnOnce(&dyn Lines) -> R) -> Option<R> {
        let chosen = one.map_or(0..self.names().len(), |k| k..k + 1);
        match &self.members {
            Members::Sine(runs) => {
                let frequencies = &runs[0].frequencies;
                let runs: Vec<_> = runs.get(chosen)?.iter().map(|r| r.run()).collect();
                SineLines::new(frequencies, &runs).map(|lines| look(&lines))
            }
            Members::Random(runs) => {
                let runs = runs.get(chosen)?;
                let responses: Vec<RunResponses<'_>> =
                    runs.iter().filter_map(|r| r.responses()).collect();
                if responses.len() == runs.len() {
                    DriveLines::new(&responses, WINDOW).map(|lines| look(&lines))
                } else {
                    self.read_undriven(runs, look)
                }
            }
        }
    }

    fn read_undriven<R>(
        &self,
        runs: &[&MeasuredRun],
        look: impl FnOnce(&dyn Lines) -> R,
    ) -> Option<R> {
        let settings = *runs.first()?.settings();
        let mut storage: Vec<(Vec<Sum>, u32)> = Vec::new();
        for run in runs {
            match &run.spectra {
                Spectra::Cross { sums } => storage.push((sums.clone(), run.blocks)),
                Spectra::Drive { .. } => return None,
            }
        }
        let mut averages = Vec::new();
        for (sums, blocks) in &mut storage {
            averages.push(CrossAverage::resume(&settings, sums, *blocks).ok()?);
        }
        let maps: Vec<_> = runs.iter().map(|r| r.geometry.map.clone()).collect();
        let band = self.measurement.band.clone();
        let (grid, hop) = (settings.grid(), self.measurement.hop);
        CrossLines::new(&averages, grid, band, WINDOW, hop, &maps).map(|lines| look(&lines))
    }
}

/// Which accelerations a set of lines excites, judged over the averaging band.
pub(super) struct Excited {
    /// Components that rise above their noise.
    pub components: [bool; 6],
    /// Independent directions among them.
    pub rank: usize,
    /// Takes out of an acceleration what is not along those directions: noise.
    pub projector: Matrix6<f64>,
    /// Power of each acceleration over the band.
    pub accelerations: Vector6<f64>,
    /// Power of each resultant over the band.
    pub forces: Vector6<f64>,
}

impl Excited {
    pub fn new(lines: &dyn Lines, band: &Range<usize>) -> Self {
        let mut energy = Moments::zero();
        let mut noise = Vector6::zeros();
        for run in 0..lines.runs() {
            let per_line = lines.noise(run);
            for j in 0..6 {
                noise[j] += per_line[j] * band.len() as f64;
            }
            for line in band.clone() {
                lines.add_moments(run, line, 1.0, &mut energy);
            }
        }
        let real = energy.aa.map(|z| z.re);
        let components =
            core::array::from_fn(|j| noise[j] > 0.0 && real[(j, j)] > ABOVE_NOISE * noise[j]);
        let excitation = Excitation::new(&real, &noise);
        Self {
            components,
            rank: excitation.rank(),
            projector: excitation.basis() * excitation.coordinates(),
            accelerations: real.diagonal(),
            forces: energy.ff.diagonal().map(|z| z.re),
        }
    }

    /// Number of components that rise above their noise.
    pub fn count(&self) -> usize {
        self.components.iter().filter(|c| **c).count()
    }
}

/// Which resultants the load cells measure wholly.
pub(super) fn measured_forces(geometry: &RunGeometry) -> [bool; 6] {
    core::array::from_fn(|i| geometry.equations.measured(i) > WHOLE)
}

/// Which accelerations the accelerometers determine wholly.
pub(super) fn determined_accelerations(geometry: &RunGeometry) -> [bool; 6] {
    geometry.determined().map(|share| share > WHOLE)
}

/// Brings powers of translations and rotations (or forces and moments) to one unit:
/// rotations times a length squared, moments by it.
pub(super) fn comparable(powers: &Vector6<f64>, lever: f64, forces: bool) -> Vector6<f64> {
    let squared = if forces {
        1.0 / (lever * lever)
    } else {
        lever * lever
    };
    Vector6::from_fn(|j, _| {
        if j < 3 {
            powers[j]
        } else {
            powers[j] * squared
        }
    })
}

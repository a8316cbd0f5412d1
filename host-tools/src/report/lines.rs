//! The runs as the estimators saw them: in groups that share their equations, as second
//! moments line by line.

use crate::identification::Answer;
use crate::measure::{MeasuredRun, Measurement, Spectra, WINDOW};
use massline_core::masslines::{ApparentMass, CrossLines, DriveLines, Excitation, Lines, Moments};
use massline_core::spectra::{CrossAverage, RunResponses, Sum};
use nalgebra::{Matrix6, Vector6};
use std::ops::Range;

/// Runs that were condensed together, and the fit to them.
pub(super) struct Group<'a> {
    pub runs: Vec<&'a MeasuredRun>,
    pub fit: Option<&'a ApparentMass>,
}

/// Power over noise from which a component can be divided by: noise pulls the quotient
/// towards zero by less than a hundredth.
const ABOVE_NOISE: f64 = 100.0;

/// Below this share a component counts as not measured.
pub(super) const WHOLE: f64 = 1.0 - 1e-6;

/// The groups of an answer, in the order in which its fits stand.
pub(super) fn groups(answer: &Answer) -> Vec<Group<'_>> {
    let alike = |a: &MeasuredRun, b: &MeasuredRun| {
        let difference = a.geometry.equations.rows() - b.geometry.equations.rows();
        difference.norm() < 1e-9 && a.responses().is_some() == b.responses().is_some()
    };
    let mut groups: Vec<Group<'_>> = Vec::new();
    for run in &answer.measurement.runs {
        match groups.iter_mut().find(|g| alike(g.runs[0], run)) {
            Some(group) => group.runs.push(run),
            None => groups.push(Group {
                runs: vec![run],
                fit: None,
            }),
        }
    }
    for (group, fit) in groups.iter_mut().zip(&answer.fits) {
        group.fit = Some(fit);
    }
    groups
}

impl Group<'_> {
    /// Lets `look` see the lines of some of the group's runs; `None` if they cannot be
    /// read together.
    pub fn read<R>(
        runs: &[&MeasuredRun],
        measurement: &Measurement,
        look: impl FnOnce(&dyn Lines) -> R,
    ) -> Option<R> {
        let responses: Vec<RunResponses<'_>> = runs.iter().filter_map(|r| r.responses()).collect();
        if responses.len() == runs.len() {
            return DriveLines::new(&responses, WINDOW).map(|lines| look(&lines));
        }
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
        let band = measurement.band.clone();
        let grid = settings.grid();
        CrossLines::new(&averages, grid, band, WINDOW, measurement.hop, &maps)
            .map(|lines| look(&lines))
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

/// Which resultants the load cells of a run measure wholly.
pub(super) fn measured_forces(run: &MeasuredRun) -> [bool; 6] {
    core::array::from_fn(|i| run.geometry.equations.measured(i) > WHOLE)
}

/// Which accelerations the accelerometers of a run determine wholly.
pub(super) fn determined_accelerations(run: &MeasuredRun) -> [bool; 6] {
    run.geometry.determined().map(|share| share > WHOLE)
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

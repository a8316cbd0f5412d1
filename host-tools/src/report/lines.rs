//! The runs as the estimators saw them: in groups that share their equations, as second
//! moments line by line.

use crate::identification::Answer;
use crate::likelihood;
use crate::measure::{Group, RunGeometry};
use massline_core::masslines::{ApparentMass, Lines, Moments, excited_directions};
use massline_core::spectra::LineRange;
use nalgebra::{Complex, Matrix6, Vector6};

/// Runs that were condensed together, and the fit to them.
pub(super) struct Fitted<'a> {
    /// The runs.
    pub group: Group<'a>,
    /// The fit of the apparent mass that the numbers come from.
    pub fit: Option<Fit<'a>>,
}

/// A fit of the apparent mass.
#[derive(Clone, Copy)]
pub(super) enum Fit<'a> {
    /// Of the averaging band.
    Band(&'a ApparentMass),
    /// Of all lines, by maximum likelihood.
    Lines(&'a likelihood::Fit),
}

impl Fit<'_> {
    /// The apparent mass at a frequency (Hz).
    pub fn at(self, frequency: f64) -> Matrix6<Complex<f64>> {
        match self {
            Self::Band(fit) => fit.at(frequency),
            // No run has this number: modes are where they are on average.
            Self::Lines(fit) => fit.model.at(usize::MAX, frequency),
        }
    }

    /// Its rigid body.
    pub fn rigid(self) -> Matrix6<f64> {
        match self {
            Self::Band(fit) => fit.rigid,
            Self::Lines(fit) => fit.model.rigid_matrix(),
        }
    }

    /// Natural frequency (Hz) and share of critical damping of each mode.
    pub fn poles(self) -> Vec<[f64; 2]> {
        match self {
            Self::Band(fit) => fit.poles.iter().map(|p| [p.frequency, p.damping]).collect(),
            Self::Lines(fit) => {
                let modes = fit.model.modes.iter();
                modes.map(|m| [m.frequency(), m.damping()]).collect()
            }
        }
    }
}

/// Power over noise from which a component can be divided by: noise pulls the quotient
/// towards zero by less than a hundredth.
const ABOVE_NOISE: f64 = 100.0;

/// Below this share a component counts as not measured.
pub(super) const WHOLE: f64 = 1.0 - 1e-6;

impl<'a> std::ops::Deref for Fitted<'a> {
    type Target = Group<'a>;

    fn deref(&self) -> &Group<'a> {
        &self.group
    }
}

/// The groups of an answer, each with its fit.
pub(super) fn fitted(answer: &Answer) -> Vec<Fitted<'_>> {
    let groups = answer.measurement.groups().into_iter().enumerate();
    let used = answer.likelihood.as_ref().filter(|l| l.is_used());
    let all_lines = used.and_then(|l| l.fit.as_ref()).map(Fit::Lines);
    groups
        .map(|(k, group)| Fitted {
            group,
            fit: all_lines.or_else(|| answer.fits.get(k).map(Fit::Band)),
        })
        .collect()
}

/// Accelerations that a set of lines excites, judged over the averaging band.
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
    pub fn new(lines: &dyn Lines, band: LineRange) -> Self {
        let mut energy = Moments::default();
        let mut noise = Matrix6::zeros();
        for run in 0..lines.runs() {
            noise += lines.noise(run).acceleration * band.indices().len() as f64;
            for line in band {
                lines.add_moments(run, line, 1.0, &mut energy);
            }
        }
        let real = energy.aa.map(|z| z.re);
        let components = core::array::from_fn(|j| {
            let noise = noise[(j, j)];
            noise > 0.0 && real[(j, j)] > ABOVE_NOISE * noise
        });
        let (rank, projector) = excited_directions(&real, &noise);
        Self {
            components,
            rank,
            projector,
            accelerations: real.diagonal(),
            forces: energy.ff.diagonal().map(|z| z.re),
        }
    }

    /// Number of components that rise above their noise.
    pub fn count(&self) -> usize {
        self.components.iter().filter(|c| **c).count()
    }
}

/// `true` for the resultants that the load cells measure wholly.
pub(super) fn measured_forces(geometry: &RunGeometry) -> [bool; 6] {
    core::array::from_fn(|i| geometry.equations.measured(i) > WHOLE)
}

/// `true` for the accelerations that the accelerometers determine wholly.
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

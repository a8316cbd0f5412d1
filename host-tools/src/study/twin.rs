//! The numerical twin of the paper's tuning fork, as the study shakes it.

use super::{Options, StudyError};
use crate::setup::{Mount, Quantity, Setup};
use crate::simulate::{self, Model, Shaking, Truth, simulate};
use massline_core::geometry::{Accelerometer, Mount as Glued};
use massline_core::modes::Pole;
use nalgebra::{Complex, DMatrix, Vector3, Vector6};

/// The twin with its sensors, and what should come out.
#[derive(Clone, Debug)]
pub struct Twin {
    /// The model, with the study's amplitudes and lines.
    pub model: Model,
    /// The measurement of it, mass weighed.
    pub setup: Setup,
    /// Exact properties.
    pub truth: Truth,
    /// Natural frequencies of the fixed structure, Hz, ascending.
    pub fixed: Vec<f64>,
    /// Elastic natural frequencies of the free structure, Hz, ascending.
    pub free: Vec<f64>,
}

/// Recordings are sampled so that the highest line lies below this share of the rate, as
/// behind an anti-aliasing filter.
const HIGHEST: f64 = 0.45;

impl Twin {
    /// The built-in tuning fork under the study's conditions, with the rotational run at
    /// `rotation` rad/s².
    ///
    /// # Errors
    /// [`StudyError`] if the lines do not suit a recording.
    pub fn new(options: &Options, rotation: f64) -> Result<Self, StudyError> {
        let mut model = Model::fork()?;
        for plan in &mut model.runs {
            if let Shaking::Random { motion, .. } = &mut plan.excitation {
                for (axis, level) in motion.iter_mut().enumerate() {
                    let amplitude = if axis < 3 {
                        options.translation
                    } else {
                        rotation
                    };
                    *level = if *level == 0.0 { 0.0 } else { amplitude };
                }
            }
        }
        let fixed: Vec<f64> = model.specimen.modes.iter().map(|m| m.frequency).collect();
        let first = fixed.first().copied().unwrap_or(0.0);
        let lines = options.highest / HIGHEST / options.spacing;
        let block_length = (lines.max(16.0) as usize).next_power_of_two();
        let m = &mut model.measurement;
        m.block_length = block_length;
        m.sample_rate = block_length as f64 * options.spacing;
        m.duration = options.duration;
        m.averaging_band = [options.spacing, range_end(options, first, 1)];
        m.mode_band = Some(options.mode_band);
        // The setup and the truth come with any simulation; the shortest will do.
        let shortest = simulate::Options {
            noise: Some(0.0),
            duration: Some(block_length as f64 / m.sample_rate),
            weighed: true,
            ..simulate::Options::default()
        };
        let simulation = simulate(&model, &shortest, &mut |_| ())?;
        Ok(Self {
            free: free_frequencies(&model),
            fixed,
            setup: simulation.setup,
            truth: simulation.truth,
            model,
        })
    }

    /// Base acceleration of a run at A, m/s² and rad/s².
    pub(super) fn motion(&self, run: usize) -> Vector6<f64> {
        match self.model.runs.get(run).map(|plan| &plan.excitation) {
            Some(Shaking::Random { motion, .. }) => Vector6::from(*motion),
            _ => Vector6::zeros(),
        }
    }

    /// Complex amplitudes of all channels at one frequency (Hz) in one run: accelerometers,
    /// then load cells, in the order of the setup.
    ///
    /// `s = X a + Σ φ_r D_r L_r a` and `f = M_0 a + Σ L_rᵀ D_r L_r a` over *all* modes of
    /// the mesh, so that nothing of its quasi-static flexibility is missing.
    #[must_use]
    pub fn channels(&self, run: usize, frequency: f64) -> Vec<Complex<f64>> {
        let motion = self.motion(run);
        let specimen = &self.model.specimen;
        let modal: Vec<Complex<f64>> = specimen
            .modes
            .iter()
            .map(|mode| {
                let pole = Pole {
                    frequency: mode.frequency,
                    damping: mode.damping,
                };
                pole.amplification(frequency) * mode.participation.dot(&motion)
            })
            .collect();
        let mut channels = Vec::with_capacity(self.setup.accelerometers.len() + 3);
        for sensor in &self.model.accelerometers {
            let rigid = rigid_reading(&sensor.entry.position, &sensor.entry.direction, &motion);
            let mut reading = Complex::new(rigid, 0.0);
            if sensor.entry.mount == Mount::Structure {
                for (shape, q) in sensor.shape.iter().zip(&modal) {
                    reading += q * *shape;
                }
            }
            channels.push(reading);
        }
        let mut force = (specimen.mass_matrix * motion).map(|x| Complex::new(x, 0.0));
        for (mode, q) in specimen.modes.iter().zip(&modal) {
            force += mode.participation.map(|l| q * l);
        }
        for cell in &self.model.load_cells {
            // The fork's cells stand at the origin, one for each resultant of the plane.
            let first = match cell.quantity {
                Quantity::Force => 0,
                Quantity::Moment => 3,
            };
            let along = (0..3).map(|j| force[first + j] * cell.direction[j]);
            channels.push(along.sum());
        }
        channels
    }
}

fn rigid_reading(position: &[f64; 3], direction: &[f64; 3], motion: &Vector6<f64>) -> f64 {
    Accelerometer::new((*position).into(), (*direction).into(), Glued::Structure).map_or(
        0.0,
        |sensor| {
            let row = sensor.rigid_body_row(&Vector3::zeros());
            (row * motion)[0]
        },
    )
}

/// End of range I (0) or II (1), Hz: the line nearest to its share of `first`.
pub(super) fn range_end(options: &Options, first: f64, range: usize) -> f64 {
    let share = options.ranges[range.min(1)];
    (share * first / options.spacing).round() * options.spacing
}

/// Elastic natural frequencies of the structure without supports, Hz, ascending.
///
/// With all fixed-base modes q and the interface's motion a, the free structure obeys
/// `M_0 a + Lᵀ q̈ = 0` and `q̈ + Ω² q + L a = 0`. Without a this is
/// `(1 - L M_0⁻¹ Lᵀ) q̈ + Ω² q = 0`, turned round so that the low frequencies are the
/// large eigenvalues, which a symmetric solver finds best.
fn free_frequencies(model: &Model) -> Vec<f64> {
    let specimen = &model.specimen;
    let axes: Vec<usize> = (0..6)
        .filter(|&j| specimen.mass_matrix[(j, j)] > 0.0)
        .collect();
    let mass = DMatrix::from_fn(axes.len(), axes.len(), |i, j| {
        specimen.mass_matrix[(axes[i], axes[j])]
    });
    let modes = &specimen.modes;
    let participation = DMatrix::from_fn(modes.len(), axes.len(), |r, j| {
        modes[r].participation[axes[j]]
    });
    let Some(inverse) = mass.try_inverse() else {
        return Vec::new();
    };
    let coupled = &participation * inverse * participation.transpose();
    let turned = DMatrix::from_fn(modes.len(), modes.len(), |i, j| {
        let unit = f64::from(u8::from(i == j));
        (unit - 0.5 * (coupled[(i, j)] + coupled[(j, i)]))
            / (modes[i].frequency * modes[j].frequency)
    });
    let mut squares: Vec<f64> = turned.symmetric_eigenvalues().iter().copied().collect();
    squares.retain(|inverse_square| *inverse_square > 0.0);
    squares.sort_by(|a, b| b.total_cmp(a));
    squares.iter().map(|s| 1.0 / s.sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_frequencies_are_those_published_with_the_model() {
        let model: serde_json::Value =
            serde_json::from_str(include_str!("../../models/tuning-fork.json")).unwrap();
        let twin = Twin::new(&Options::default(), 1.0).unwrap();
        for (key, found) in [("f_fixed_Hz", &twin.fixed), ("f_free_Hz", &twin.free)] {
            for (expected, found) in model[key].as_array().unwrap().iter().zip(found) {
                let expected = expected.as_f64().unwrap();
                // 1e-6 as for the fixed structure: condition numbers of the meshes
                // squared leave no more of the sixteen digits.
                assert!((found / expected - 1.0).abs() < 1e-6, "{key} {found}");
            }
        }
    }

    #[test]
    fn ranges_end_on_lines() {
        let options = Options::default();
        assert_eq!(range_end(&options, 32.497, 0), 14.5);
        assert_eq!(range_end(&options, 32.497, 1), 26.0);
    }
}

//! A rigid body with sprung masses on a table of six axes, and its responses in closed form.

use massline_core::masslines::{SineLines, SineRun};
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::{Complex, Matrix6, Vector3, Vector6};

#[path = "../draws/mod.rs"]
mod draws;
use draws::Draws;

/// A sprung mass: its pole, and L of `M(ω) = M₀ + Σ Lᵀ L D(ω)`.
#[derive(Clone, Copy)]
pub struct Sprung {
    pub frequency: f64,
    pub damping: f64,
    pub participation: Vector6<f64>,
}

impl Sprung {
    /// `mass` kg that moves along x (`axis` 0) or y (1), `height` m above A.
    pub fn bending(frequency: f64, mass: f64, axis: usize, height: f64) -> Self {
        let mut participation = Vector6::zeros();
        participation[axis] = mass.sqrt();
        participation[4 - axis] = mass.sqrt() * if axis == 0 { height } else { -height };
        Self {
            frequency,
            damping: 0.02,
            participation,
        }
    }

    fn amplification(&self, f: f64) -> Complex<f64> {
        let r = f / self.frequency;
        Complex::new(r * r, 0.0) / Complex::new(1.0 - r * r, 2.0 * self.damping * r)
    }
}

/// A hundred kilograms whose centre of gravity lies a metre above A.
pub fn hundred() -> RigidBody {
    RigidBody {
        mass: 100.0,
        centre_of_gravity: Vector3::new(0.0, 0.0, 1.0),
        inertia: Inertia::from_terms([50.0, 50.0, 10.0, 0.0, 0.0, 0.0]),
    }
}

/// Measured responses of the runs, line by line.
pub struct Measured {
    pub frequencies: Vec<f64>,
    runs: Vec<Vec<[Complex<f64>; 12]>>,
    noise: [f64; 12],
}

impl Measured {
    /// Runs with the given base accelerations over `count` lines, `spacing` Hz apart. Every
    /// acceleration and every force reads `noise` of its RMS over all runs and lines.
    pub fn new(
        body: &RigidBody,
        sprung: &[Sprung],
        accelerations: &[Vector6<f64>],
        count: usize,
        spacing: f64,
        noise: f64,
    ) -> Self {
        let frequencies: Vec<f64> = (1..=count).map(|k| spacing * k as f64).collect();
        let rigid = body.mass_matrix(&Vector3::zeros());
        let mut runs: Vec<Vec<[Complex<f64>; 12]>> = Vec::new();
        for a in accelerations {
            let line = |f: &f64| {
                let mut m = rigid.map(|x| Complex::new(x, 0.0));
                for s in sprung {
                    let mass: Matrix6<f64> = s.participation * s.participation.transpose();
                    m += mass.map(|x| s.amplification(*f) * x);
                }
                let a = a.map(|x| Complex::new(x, 0.0));
                let force = m * a;
                core::array::from_fn(|j| if j < 6 { a[j] } else { force[j - 6] })
            };
            runs.push(frequencies.iter().map(line).collect());
        }
        let lines = (runs.len() * count) as f64;
        let power: [f64; 12] = core::array::from_fn(|j| {
            let all = runs.iter().flatten().map(|r| r[j].norm_sqr());
            all.sum::<f64>() / lines
        });
        // Half of a complex number's power is in each of its parts.
        let std = power.map(|p| noise * (p / 2.0).sqrt());
        let mut draws = Draws::new(2026);
        for line in runs.iter_mut().flatten() {
            for (x, std) in line.iter_mut().zip(std) {
                *x += Complex::new(draws.normal(), draws.normal()) * std;
            }
        }
        Self {
            frequencies,
            runs,
            // Without noise there is still the rounding of what was written down.
            noise: power.map(|p| noise.max(1e-6) * noise.max(1e-6) * p),
        }
    }

    /// Lets `look` see the first `count` runs.
    pub fn first<R>(&self, count: usize, look: impl FnOnce(&SineLines<'_>) -> R) -> R {
        let run = |responses| SineRun {
            responses,
            noise: massline_core::geometry::ResultantNoise::diagonal(&self.noise),
        };
        let runs: Vec<_> = self.runs[..count].iter().map(|r| run(r)).collect();
        look(&SineLines::new(&self.frequencies, &runs).unwrap())
    }

    /// Lets `look` see all runs.
    pub fn read<R>(&self, look: impl FnOnce(&SineLines<'_>) -> R) -> R {
        self.first(self.runs.len(), look)
    }
}

/// The six base accelerations, one a run.
pub fn axes() -> Vec<Vector6<f64>> {
    (0..6)
        .map(|j| Vector6::from_fn(|i, _| f64::from(u8::from(i == j))))
        .collect()
}

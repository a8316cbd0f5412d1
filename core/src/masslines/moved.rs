//! Averaged lines about another reference point: exact, nothing is averaged again.

use super::lines::{Amplitudes, Lines};
use super::regression::between;
use super::{MasslineError, Moments};
use crate::geometry::{ResultantNoise, transfer};
use nalgebra::{Complex, Vector3};

/// Lines as they would be about a point `shift` (m) away from their own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moved<'l, L: ?Sized> {
    lines: &'l L,
    shift: Vector3<f64>,
}

impl<'l, L: Lines + ?Sized> Moved<'l, L> {
    pub(super) fn new(lines: &'l L, shift: &Vector3<f64>) -> Self {
        Self {
            lines,
            shift: *shift,
        }
    }

    #[inline(never)] // Its matrices are on the stack only where they are needed.
    fn moved(&self, run: usize, line: usize, weight: f64) -> Moments {
        let mut m = Moments::zero();
        self.lines.add_moments(run, line, weight, &mut m);
        // Of accelerations, T, and of resultants, T⁻ᵀ.
        let accelerations = transfer(&self.shift);
        let forces = transfer(&-self.shift).transpose();
        between(&accelerations, &mut m.aa, &accelerations);
        between(&forces, &mut m.fa, &accelerations);
        between(&forces, &mut m.ff, &forces);
        m
    }
}

/// `shift x w` for complex amplitudes.
fn cross(shift: &Vector3<f64>, w: [Complex<f64>; 3]) -> [Complex<f64>; 3] {
    let [x, y, z] = w;
    let [a, b, c] = [shift.x, shift.y, shift.z];
    [z * b - y * c, x * c - z * a, y * a - x * b]
}

impl<L: Lines + ?Sized> Lines for Moved<'_, L> {
    fn count(&self) -> usize {
        self.lines.count()
    }

    fn frequency(&self, line: usize) -> f64 {
        self.lines.frequency(line)
    }

    fn runs(&self) -> usize {
        self.lines.runs()
    }

    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        if let Some((a, f)) = self.pair(run, line) {
            into.add_pair(&a, &f, weight * self.pair_weight(run, line));
        } else {
            let m = self.moved(run, line, weight);
            into.aa += m.aa;
            into.fa += m.fa;
            into.ff += m.ff;
        }
    }

    fn add_real_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        if let Some((a, f)) = self.pair(run, line) {
            into.add_real_pair(&a, &f, weight * self.pair_weight(run, line));
        } else {
            self.add_moments(run, line, weight, into);
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        self.lines.noise(run).at(&self.shift)
    }

    fn check(&self) -> Result<(), MasslineError> {
        self.lines.check()
    }

    fn equations_per_line(&self, run: usize) -> f64 {
        self.lines.equations_per_line(run)
    }

    fn correlation(&self) -> f64 {
        self.lines.correlation()
    }

    fn pair(&self, run: usize, line: usize) -> Option<Amplitudes> {
        let (mut a, mut f) = self.lines.pair(run, line)?;
        // u_B = u_A - s x w, and the moment loses s x force.
        let lost = cross(&self.shift, [a[3], a[4], a[5]]);
        let leverage = cross(&self.shift, [f[0], f[1], f[2]]);
        for (j, (lost, leverage)) in lost.into_iter().zip(leverage).enumerate() {
            a[j] -= lost;
            f[3 + j] -= leverage;
        }
        Some((a, f))
    }

    fn pair_weight(&self, run: usize, line: usize) -> f64 {
        self.lines.pair_weight(run, line)
    }
}

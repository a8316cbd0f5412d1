//! Averaged lines about another reference point: exact, nothing is averaged again.

use super::driven::Driven;
use super::lines::{Amplitudes, Internals, Lines};
use super::moments::add_scaled;
use super::regression::between;
use super::{MasslineError, Moments};
use crate::geometry::{ResultantNoise, move_accelerations, transfer};
use nalgebra::{Complex, Matrix6, Vector3};

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

    /// Leaves the noise of the accelerations of all runs, each with its weight, in `sum`. It is moved
    /// once.
    #[inline(never)] // The noise of a run is off the stack when the caller goes on.
    pub(super) fn accelerations_noise(&self, weights: &[f64], sum: &mut Matrix6<f64>) {
        sum.fill(0.0);
        for (run, weight) in weights.iter().enumerate().take(self.lines.runs()) {
            add_scaled(sum, &self.lines.noise(run).acceleration, *weight);
        }
        move_accelerations(sum, &self.shift);
    }

    /// As [`Lines::add_moments`], but of `Σ f f*` only the real part is sure to be added: all that
    /// a regression reads.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(super) fn add_real_moments(
        &self,
        run: usize,
        line: usize,
        weight: f64,
        into: &mut Moments,
    ) {
        if let Some((a, f)) = self.pair(run, line) {
            into.add_real_pair(&a, &f, weight * self.pair_weight(run, line));
        } else {
            self.add_moved(run, line, weight, into);
        }
    }

    /// Adds moments that are no single pair's.
    #[inline(never)] // Its matrices are on the stack only where they are needed.
    fn add_moved(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        let mut m = Moments::zero();
        self.lines.add_moments(run, line, weight, &mut m);
        // Of accelerations, T, and of resultants, T⁻ᵀ.
        let accelerations = transfer(&self.shift);
        let forces = transfer(&-self.shift).transpose();
        between(&accelerations, &mut m.aa, &accelerations);
        between(&forces, &mut m.fa, &accelerations);
        between(&forces, &mut m.ff, &forces);
        into.aa += m.aa;
        into.fa += m.fa;
        into.ff += m.ff;
    }
}

/// Takes `shift x lever` off complex amplitudes.
#[inline(never)] // Once in the flash.
fn take_cross(from: &mut [Complex<f64>], shift: &Vector3<f64>, lever: &[Complex<f64>]) {
    if let ([x, y, z], &[a, b, c]) = (from, lever) {
        *x -= c * shift.y - b * shift.z;
        *y -= a * shift.z - c * shift.x;
        *z -= b * shift.x - a * shift.y;
    }
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
            self.add_moved(run, line, weight, into);
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        let mut noise = self.lines.noise(run);
        noise.move_by(&self.shift);
        noise
    }
}

impl<L: Lines + ?Sized> Internals for Moved<'_, L> {
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
        let mut pair = self.lines.pair(run, line)?;
        let (a, f) = (&mut pair.0, &mut pair.1);
        // u_B = u_A - s x w, and the moment loses s x force.
        let (translation, rotation) = a.as_mut_slice().split_at_mut(3);
        take_cross(translation, &self.shift, rotation);
        let (force, moment) = f.as_mut_slice().split_at_mut(3);
        take_cross(moment, &self.shift, force);
        Some(pair)
    }

    fn driven(&self) -> Option<Driven<'_>> {
        Some(self.lines.driven()?.moved(&self.shift))
    }

    fn pair_weight(&self, run: usize, line: usize) -> f64 {
        self.lines.pair_weight(run, line)
    }
}

//! Modes that one pole hides: as many as there are independent shapes behind it.
//!
//! The bending modes of an axisymmetric structure come in pairs at nearly one frequency. In
//! a scalar sum over all motions they are one peak; in the matrix they are two, because each
//! mode adds a matrix of rank one, `L_rᵀ L_r D_r(ω)`. Any sum over the lines with real weights
//! leaves `Σ_r L_rᵀ L_r α_r`. Two such sums around the peak, of `-Im M` and of `-Im M` times
//! the distance from the peak, have different α_r where the frequencies differ, so their
//! common eigenvectors v are the motions of the base in which all these modes but one rest:
//! `L_s v = 0` for s ≠ r. (The first sum alone is what is known as a mode indicator: it has as
//! many eigenvalues above noise as there are modes.) In such a motion the apparent mass has
//! one pole again, which is looked for as every other.

use super::{FixedMode, row_of};
use crate::algebra::{factor_hermitian, solve_hermitian, symmetric_eigen};
use crate::geometry::Equations;
use crate::masslines::lines::two_a_line;
use crate::masslines::methods::apparent_mass::Basis;
use crate::masslines::regression::between;
use crate::masslines::{Complex6, Excitation, Lines, MasslineError, Moments};
use crate::modes::{Pole, PoleSearch, Residues, Trace, find_poles};
use core::ops::Range;
use nalgebra::{Complex, Matrix3, Matrix6, Vector3, Vector6};

/// Most modes that one pole can hide: two bending modes and one more.
pub(super) const CLOSE: usize = 3;
/// Share of the strongest eigenvalue from which on another is looked into.
const SECOND: f64 = 0.01;
/// Share of the bandwidth within which frequencies are one.
const SAME: f64 = 0.01;

/// The lines and the motions of the base in which modes are looked for.
pub(super) struct Neighbourhood<'a, L: ?Sized> {
    pub(super) lines: &'a L,
    pub(super) fit: Range<usize>,
    pub(super) excitation: &'a Excitation,
    pub(super) equations: &'a Equations,
}

impl<L: Lines + ?Sized> Neighbourhood<'_, L> {
    /// The modes behind `pole`, if they are more than one, when the modes `others` are taken
    /// out. `None` also where the runs do not tell the matrix line by line.
    ///
    /// # Errors
    /// [`MasslineError::Work`].
    pub(super) fn split(
        &self,
        pole: &Pole,
        others: &[FixedMode],
        search: &mut PoleSearch,
        work: &mut [Complex<f64>],
    ) -> Result<Option<heapless::Vec<FixedMode, CLOSE>>, MasslineError> {
        let work = two_a_line(&self.fit, work)?;
        let rank = self.excitation.rank();
        let unmeasured = self.excitation.basis() - self.measured() * self.excitation.basis();
        let whole = self.excitation.basis().norm();
        if rank < 2 || unmeasured.norm() > 1e-9 * whole {
            return Ok(None);
        }
        let Some((motions, found, shares)) = self.motions(pole, others) else {
            return Ok(None);
        };
        for count in (2..=found).rev() {
            let motions = &motions(count);
            let share = shares[count - 1];
            let mut modes = heapless::Vec::new();
            for (motion, centre) in motions.iter().take(count) {
                let near = Pole {
                    frequency: pole.frequency + centre,
                    damping: pole.damping,
                };
                let Some(mode) = self.single(motion, &near, share, others, search, work) else {
                    break;
                };
                let _ = modes.push(mode);
            }
            if modes.len() == count {
                canonical(&mut modes);
                modes.sort_unstable_by(|a, b| a.pole.frequency.total_cmp(&b.pole.frequency));
                return Ok(Some(modes));
            }
        }
        Ok(None)
    }

    /// Projector of resultants on the measured equations.
    fn measured(&self) -> Matrix6<f64> {
        let e = self.equations.rows();
        e.transpose() * e
    }

    /// Lines within which modes are not told apart in a scalar: see the search for poles.
    fn window(&self, pole: &Pole) -> Range<usize> {
        let at = |line: usize| self.lines.frequency(line);
        let near = |line: &usize| {
            let spacing = at(line + 1) - at(*line);
            (at(*line) - pole.frequency).abs() < reach(spacing, pole)
        };
        let from = self.fit.clone().find(near).unwrap_or(self.fit.end);
        let to = self.fit.clone().rfind(near).map_or(from, |line| line + 1);
        from..to
    }

    /// Forces at A per unit of each excited motion, without the modes `others`: the first
    /// columns, one a motion.
    #[inline(never)]
    fn responses(&self, line: usize, others: &[FixedMode]) -> Option<Complex6> {
        let mut m = Moments::zero();
        for run in 0..self.lines.runs() {
            self.lines.add_moments(run, line, 1.0, &mut m);
        }
        let p = self.excitation.coordinates();
        let rank = self.excitation.rank();
        between(p, &mut m.aa, p);
        between(&Matrix6::identity(), &mut m.fa, p);
        let mut x = m.fa.adjoint();
        factor_hermitian(&mut m.aa, rank)?;
        solve_hermitian(&m.aa, rank, &mut x);
        let mut x = x.adjoint();
        let f = self.lines.frequency(line);
        for mode in others {
            let in_motions = self.excitation.basis().transpose() * mode.participation;
            let d = mode.pole.amplification(f);
            for j in 0..rank {
                for i in 0..6 {
                    x[(i, j)] -= d * (mode.participation[i] * in_motions[j]);
                }
            }
        }
        Some(x)
    }

    /// For a number of modes, the motions in which all but one of them rest, and how far from
    /// the pole the remaining one lies, Hz. With how many there may be, and which share of the
    /// matrix so many explain.
    #[allow(clippy::type_complexity)]
    fn motions(
        &self,
        pole: &Pole,
        others: &[FixedMode],
    ) -> Option<(
        impl Fn(usize) -> [(Vector6<f64>, f64); CLOSE] + use<L>,
        usize,
        [f64; CLOSE],
    )> {
        let basis = self.excitation.basis();
        let rank = self.excitation.rank();
        let (mut sum, mut moment) = (Matrix6::<f64>::zeros(), Matrix6::<f64>::zeros());
        let mut size = Vector6::<f64>::zeros();
        for line in self.window(pole) {
            let x = self.responses(line, others)?;
            let z = basis.transpose().map(|b| Complex::new(b, 0.0)) * x;
            let away = self.lines.frequency(line) - pole.frequency;
            let loss = z.map(|z| -z.im);
            let loss = (loss + loss.transpose()) * 0.5;
            sum += loss;
            moment += loss * away;
            size += z.diagonal().map(|z| libm::sqrt(z.norm_sqr()));
        }
        // Kilogram and kilogram metre squared mix: in units of the apparent mass itself.
        let unit = Vector6::from_fn(|i, _| {
            if i < rank && size[i] > 0.0 {
                1.0 / libm::sqrt(size[i])
            } else {
                0.0
            }
        });
        let scaled = |m: &Matrix6<f64>| Matrix6::from_fn(|i, j| m[(i, j)] * unit[i] * unit[j]);
        let mut vectors = Matrix6::zeros();
        let values = symmetric_eigen(&mut scaled(&sum), &mut vectors);
        let values: [f64; 6] = core::array::from_fn(|i| values[i]);
        let enough = |v: &&f64| **v > SECOND * values[0];
        let found = values.iter().take_while(enough).count().min(CLOSE);
        if values[0].is_nan() || values[0] <= 0.0 || found < 2 {
            return None;
        }
        let all: f64 = values.iter().map(|v| v.abs()).sum();
        let mut shares = [0.0; CLOSE];
        for (k, share) in shares.iter_mut().enumerate() {
            *share = values[..=k].iter().sum::<f64>() / all;
        }
        let moment = scaled(&moment);
        // In whitened coordinates the first sum is the identity.
        let white = Matrix6::from_fn(|i, r| {
            if r < found {
                vectors[(i, r)] / libm::sqrt(values[r])
            } else {
                0.0
            }
        });
        let motions = move |count: usize| {
            let inner = white.transpose() * moment * white;
            let mut leading = Matrix3::zeros();
            for i in 0..count {
                for j in 0..count {
                    leading[(i, j)] = inner[(i, j)];
                }
            }
            // Coordinates that are left out come last.
            let shift = leading.abs().max() + 1.0;
            for i in 0..count {
                leading[(i, i)] += 4.0 * shift;
            }
            let mut turn = Matrix3::zeros();
            let centres = symmetric_eigen(&mut leading, &mut turn);
            core::array::from_fn(|r| {
                let mut motion = Vector6::zeros();
                for k in 0..count {
                    for i in 0..6 {
                        motion[i] += white[(i, k)] * turn[(k, r)] * unit[i];
                    }
                }
                (motion, centres[r] - 4.0 * shift)
            })
        };
        Some((motions, found, shares))
    }

    /// The only mode that does not rest in a motion of the base, if there is one near a pole.
    fn single(
        &self,
        motion: &Vector6<f64>,
        near: &Pole,
        share: f64,
        others: &[FixedMode],
        search: &mut PoleSearch,
        work: &mut [Complex<f64>],
    ) -> Option<FixedMode> {
        let base = self.excitation.basis() * motion;
        let complex = motion.map(|x| Complex::new(x, 0.0));
        for (line, t) in self.fit.clone().zip(work.iter_mut()) {
            let force = self.responses(line, others)? * complex;
            *t = (0..6).map(|i| force[i] * base[i]).sum();
        }
        let frequency = |k: usize| self.lines.frequency(self.fit.start + k);
        let trace = Trace::new(work, &frequency);
        let poles = find_poles(&trace, Residues::Positive, search);
        let distance = |p: &Pole| (p.frequency - near.frequency).abs();
        let nearest = poles
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let window = self.window(near);
        let line = frequency_index(self.lines, &self.fit, nearest.frequency);
        if !window.contains(&line) {
            return None;
        }
        // The row that goes with it: the forces in that motion have this pole only.
        let basis = Basis::new(self.lines, core::slice::from_ref(nearest), &self.fit);
        let mut normal = Matrix3::<f64>::zeros();
        let mut right = [Vector3::<f64>::zeros(); 6];
        for (k, line) in self.fit.clone().enumerate() {
            let phi = basis.at(self.lines.frequency(line));
            let force = self.responses(line, others)? * complex;
            let weight = trace.weight(k);
            for i in 0..3 {
                let turned = phi[i].conj() * weight;
                for j in 0..3 {
                    normal[(i, j)] += (turned * phi[j]).re;
                }
                for (right, f) in right.iter_mut().zip(&force) {
                    right[i] += (turned * f).re;
                }
            }
        }
        // In the order of the basis: 1, the pole, ω².
        let inverse = normal.try_inverse()?;
        let column = Vector6::from_fn(|i, _| (inverse * right[i])[1]);
        let row = self.measured() * column;
        let power = row.dot(&base);
        if power.is_nan() || power <= 0.0 {
            return None;
        }
        Some(FixedMode::new(
            *nearest,
            row_of(row / libm::sqrt(power)),
            share,
        ))
    }
}

/// Distance from a pole within which lines do not tell another one apart, Hz: leakage of the window
/// into three lines, and three half widths of the resonance.
fn reach(spacing: f64, pole: &Pole) -> f64 {
    3.0 * spacing + 3.0 * pole.damping * pole.frequency
}

fn frequency_index<L: Lines + ?Sized>(lines: &L, fit: &Range<usize>, frequency: f64) -> usize {
    let below = |line: &usize| lines.frequency(*line) <= frequency;
    fit.clone().rfind(below).unwrap_or(fit.start)
}

/// Makes the rows of two modes of one frequency unique, which any rotation of them describes as
/// well: the first mode takes all of the first axis in which both have much mass.
fn canonical(modes: &mut [FixedMode]) {
    let [a, b] = modes else { return };
    let bandwidth = 2.0 * a.pole.damping * a.pole.frequency;
    if (a.pole.frequency - b.pole.frequency).abs() > SAME * bandwidth {
        return;
    }
    let (p, q) = (a.participation, b.participation);
    let power = |j: usize| p[j] * p[j] + q[j] * q[j];
    let most = power(0).max(power(1)).max(power(2));
    let Some(axis) = (0..3).find(|&j| power(j) > 0.5 * most && most > 0.0) else {
        return;
    };
    let size = libm::sqrt(power(axis));
    let (c, s) = (p[axis] / size, q[axis] / size);
    *a = FixedMode::new(a.pole, row_of(p * c + q * s), a.rank_one);
    *b = FixedMode::new(b.pole, row_of(q * c - p * s), b.rank_one);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pole_reaches_three_lines_and_three_half_widths() {
        let pole = |damping| Pole {
            frequency: 40.0,
            damping,
        };
        assert_eq!(reach(0.25, &pole(0.0)), 0.75);
        assert_eq!(reach(0.5, &pole(0.0)), 1.5);
        assert_eq!(reach(0.0, &pole(0.125)), 15.0);
        assert_eq!(reach(0.5, &pole(0.0625)), 1.5 + 7.5);
    }
}

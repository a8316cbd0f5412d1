//! Poles of one scalar function: peaks first, then a damped Gauss-Newton fit.

use super::{MAX_MODES, Pole, Trace};
use crate::algebra::{Triangle, solve_positive, triangle_len};
use crate::cells::{Seen, cells, seen};
use nalgebra::{Complex, SVector};

/// Unknowns of the fit: a constant, one term for all modes above, and frequency, damping
/// and up to two residues of each mode.
const UNKNOWNS: usize = 2 + 4 * MAX_MODES;
/// Damping that the search starts from.
const FIRST_DAMPING: f64 = 0.01;
/// Bounds of a damping that a mode of a structure can have.
const DAMPING: core::ops::Range<f64> = 1e-5..0.3;
const STEPS: usize = 40;

type Normal = Triangle<{ triangle_len(UNKNOWNS) }>;
type Parameters = SVector<f64, UNKNOWNS>;

/// Prior knowledge of the residues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Residues {
    /// Positive, as in a power-like scalar of the apparent mass: no two modes cancel.
    Positive,
    /// Of either sign and phase, as in the free structure: damping couples its modes even
    /// where it leaves those of the fixed one apart.
    Complex,
}

/// Working memory of the search: it is lent, since the stack of a small chip is too small.
#[derive(Clone, Debug)]
pub(crate) struct PoleSearch {
    normal: Normal,
    /// With Levenberg's and Marquardt's term, and then its factor.
    damped: Normal,
}

impl PoleSearch {
    /// As good as any other state.
    pub const EMPTY: Self = Self {
        normal: Normal::ZERO,
        damped: Normal::ZERO,
    };
}

/// Finds the poles of `t(ω) = c₀ + c₁ ω² + Σ (e_r + g_r jω/ω_r) D_r(ω)` in a trace whose lines lie
/// at `frequency(line)` Hz, in ascending order. At most [`MAX_MODES`], the strongest ones; none if
/// no peak rises above what the lines scatter by.
#[must_use]
pub(crate) fn find_poles(
    trace: &Trace<'_>,
    residues: Residues,
    frequency: &dyn Fn(usize) -> f64,
    search: &mut PoleSearch,
) -> heapless::Vec<Pole, MAX_MODES> {
    let mut fit = Fit::start(trace, residues, frequency);
    let mut cost = fit.refine(trace, frequency, ROUGH, search);
    // Strongest first, one at a time, each next one in what the others leave.
    let mut refused: heapless::Vec<usize, TRIES> = heapless::Vec::new();
    while fit.modes < MAX_MODES {
        let Some(line) = fit.strongest_peak(trace, frequency, &refused) else {
            break;
        };
        let mut more = fit.with_mode(frequency(line), fit.left(trace, line, frequency).im);
        let lower = more.refine(trace, frequency, ROUGH, search);
        let gain = trace.len() as f64 * libm::log(cost / lower);
        if gain > WORTH && !more.implausible(trace.len(), frequency) {
            fit = more;
            cost = lower;
        } else if refused.push(line).is_err() {
            break;
        }
    }
    fit.refine(trace, frequency, FINE, search);
    fit.poles()
}

/// Gain of log-likelihood that three more unknowns must bring. Noise gives three on
/// average, twice that where the window makes neighbouring lines alike, and the largest
/// of a hundred peaks some three times more.
const WORTH: f64 = 20.0;
/// Peaks that may turn out to be none before the search ends.
const TRIES: usize = 6;
/// Relative gain of a step at which a fit ends: while modes are looked for, and at last.
const ROUGH: f64 = 1e-3;
const FINE: f64 = 1e-9;

struct Fit {
    modes: usize,
    parameters: Parameters,
    /// Frequency that scales the ω² term, Hz.
    unit: f64,
    /// Its square, inverted.
    per_square: f64,
    residues: Residues,
}

impl Fit {
    fn start(trace: &Trace<'_>, residues: Residues, frequency: &dyn Fn(usize) -> f64) -> Self {
        let mut parameters = Parameters::zeros();
        parameters[0] = trace.value(0).re;
        let unit = frequency(trace.len().saturating_sub(1));
        Self {
            modes: 0,
            parameters,
            unit,
            per_square: 1.0 / (unit * unit),
            residues,
        }
    }

    /// Residual of the fit at a line.
    fn left(
        &self,
        trace: &Trace<'_>,
        line: usize,
        frequency: &dyn Fn(usize) -> f64,
    ) -> Complex<f64> {
        trace.value(line) - self.value(&self.parameters, frequency(line))
    }

    /// The highest peak of the imaginary part that the fit leaves, away from the modes
    /// that are there and from what was refused before.
    fn strongest_peak(
        &self,
        trace: &Trace<'_>,
        frequency: &dyn Fn(usize) -> f64,
        refused: &[usize],
    ) -> Option<usize> {
        let height = |line: usize| {
            let im = -self.left(trace, line, frequency).im;
            match self.residues {
                Residues::Positive => im,
                Residues::Complex => im.abs(),
            }
        };
        let mut best = None;
        let mut highest = 0.0;
        let (mut here, mut after) = (height(0), height(1));
        for line in 1..trace.len().saturating_sub(1) {
            let before = here;
            here = after;
            after = height(line + 1);
            let f = frequency(line);
            // Leakage bends the flanks of a mode that is already there; what it leaves
            // is not another mode.
            let spacing = frequency(line + 1) - f;
            let taken = (0..self.modes).any(|r| {
                let pole = self.pole(r);
                (pole.frequency - f).abs() < 3.0 * spacing + 3.0 * pole.damping * f
            });
            let tried = refused.iter().any(|&r| line.abs_diff(r) < 3);
            let peak = here > before && here >= after;
            if peak && !taken && !tried && here > highest {
                highest = here;
                best = Some(line);
            }
        }
        best
    }

    /// One more mode whose resonance leaves `imaginary` to explain.
    fn with_mode(&self, frequency: f64, imaginary: f64) -> Self {
        let at = self.at(self.modes);
        let mut parameters = self.parameters;
        // At resonance Im D = -1 / 2ζ.
        let p = &mut cells(&mut parameters);
        p[at] = -imaginary * 2.0 * FIRST_DAMPING;
        p[at + 1] = frequency;
        p[at + 2] = FIRST_DAMPING;
        Self {
            modes: self.modes + 1,
            parameters,
            ..*self
        }
    }

    /// Index of the first unknown of a mode: residue, frequency, damping, and the quadrature
    /// residue where there is one.
    fn at(&self, mode: usize) -> usize {
        let each = match self.residues {
            Residues::Positive => 3,
            Residues::Complex => 4,
        };
        2 + each * mode
    }

    fn pole(&self, mode: usize) -> Pole {
        let p = seen(&self.parameters);
        Pole {
            frequency: p[self.at(mode) + 1],
            damping: p[self.at(mode) + 2],
        }
    }

    fn unknowns(&self) -> usize {
        self.at(self.modes)
    }

    /// Value at one frequency, without its derivatives, which cost three times as much.
    fn value(&self, p: &Parameters, f: f64) -> Complex<f64> {
        let square = f * f;
        let mut value = Complex::new(p[0] + square * self.per_square * p[1], 0.0);
        for r in 0..self.modes {
            let (at, p) = (self.at(r), seen(p));
            let inverse = inverse(p[at + 1], p[at + 2], f, square);
            value += times(inverse * square, self.residue(&p, r, f));
        }
        value
    }

    /// The residue of a mode, and its quadrature per ω/ω_r where there is one.
    fn residue(&self, p: &Seen<'_, Parameters>, mode: usize, f: f64) -> Complex<f64> {
        let at = self.at(mode);
        let quadrature = match self.residues {
            Residues::Positive => 0.0,
            Residues::Complex => f / p[at + 1] * p[at + 3],
        };
        Complex::new(p[at], quadrature)
    }

    /// Value at one frequency, and its derivatives, which are left in `d`.
    fn model(&self, p: &Parameters, f: f64, d: &mut [Complex<f64>; UNKNOWNS]) -> Complex<f64> {
        let square = f * f;
        d[0] = Complex::new(1.0, 0.0);
        d[1] = Complex::new(square * self.per_square, 0.0);
        let mut value = Complex::new(p[0] + d[1].re * p[1], 0.0);
        let (p, d) = (seen(p), &mut cells(&mut d[..]));
        for r in 0..self.modes {
            let at = self.at(r);
            let (fr, z) = (p[at + 1], p[at + 2]);
            let residue = self.residue(&p, r, f);
            let inverse = inverse(fr, z, f, square);
            let unit = inverse * square;
            d[at] = unit;
            if self.residues == Residues::Complex {
                let ahead = f / fr;
                d[at + 3] = Complex::new(-unit.im * ahead, unit.re * ahead);
            }
            let elastic = times(unit, residue);
            let slope = -elastic * inverse;
            d[at + 1] = slope * Complex::new(2.0 * fr, 2.0 * z * f);
            let damping = 2.0 * fr * f;
            d[at + 2] = Complex::new(-slope.im * damping, slope.re * damping);
            value += elastic;
        }
        value
    }

    fn cost(&self, p: &Parameters, trace: &Trace<'_>, frequency: &dyn Fn(usize) -> f64) -> f64 {
        let mut cost = 0.0;
        for k in 0..trace.len() {
            let left = self.value(p, frequency(k)) - trace.value(k);
            cost += left.norm_sqr() * trace.weight(k);
        }
        cost
    }

    /// Levenberg and Marquardt: the step is accepted only if it explains more.
    fn refine(
        &mut self,
        trace: &Trace<'_>,
        frequency: &dyn Fn(usize) -> f64,
        end: f64,
        search: &mut PoleSearch,
    ) -> f64 {
        let PoleSearch { normal, damped } = search;
        let n = self.unknowns();
        let mut lambda = 1e-3;
        let mut cost = self.cost(&self.parameters, trace, frequency);
        let mut right = Parameters::zeros();
        let mut d = [Complex::new(0.0, 0.0); UNKNOWNS];
        for _ in 0..STEPS {
            normal.clear();
            right.fill(0.0);
            let (sums, sides) = (&mut cells(normal), &mut cells(&mut right));
            for k in 0..trace.len() {
                let value = self.model(&self.parameters, frequency(k), &mut d);
                let weight = trace.weight(k);
                let residual = (trace.value(k) - value) * weight;
                // The first two derivatives are real. Where the processor has no `f64`,
                // a product with a zero costs as much as any other.
                sides[0] += residual.re;
                sides[1] += d[1].re * residual.re;
                sums[(0, 0)] += weight;
                sums[(1, 0)] += d[1].re * weight;
                sums[(1, 1)] += d[1].re * d[1].re * weight;
                let d = seen(&d[..]);
                for i in 2..n {
                    let weighted = d[i] * weight;
                    sides[i] += d[i].re * residual.re + d[i].im * residual.im;
                    sums[(i, 0)] += weighted.re;
                    sums[(i, 1)] += weighted.re * d[1].re;
                    for j in 2..=i {
                        sums[(i, j)] += weighted.re * d[j].re + weighted.im * d[j].im;
                    }
                }
            }
            let mut improved = false;
            while lambda < 1e9 {
                damped.clone_from(normal);
                let diagonal = &mut cells(damped);
                for i in 0..n {
                    diagonal[(i, i)] *= 1.0 + lambda;
                }
                let mut step = right;
                if solve_positive(damped, step.as_mut_slice(), n).is_some() {
                    let tried = self.bounded(&(self.parameters + step));
                    let tried_cost = self.cost(&tried, trace, frequency);
                    if tried_cost < cost {
                        let gain = (cost - tried_cost) / cost;
                        self.parameters = tried;
                        cost = tried_cost;
                        lambda *= 0.1;
                        improved = gain > end;
                        break;
                    }
                }
                lambda *= 10.0;
            }
            if !improved {
                break;
            }
        }
        cost
    }

    fn bounded(&self, p: &Parameters) -> Parameters {
        let mut bounded = *p;
        let p = &mut cells(&mut bounded);
        for r in 0..self.modes {
            let at = self.at(r);
            p[at + 1] = p[at + 1].max(1e-3 * self.unit);
            p[at + 2] = p[at + 2].clamp(DAMPING.start, DAMPING.end);
        }
        bounded
    }

    /// `true` if one of the modes is implausible: outside the lines, without mass, overdamped, or
    /// within two lines of another mode.
    fn implausible(&self, lines: usize, frequency: &dyn Fn(usize) -> f64) -> bool {
        let (first, last) = (frequency(0), frequency(lines.saturating_sub(1)));
        let spacing = frequency(1) - first;
        (0..self.modes).any(|r| {
            let pole = self.pole(r);
            let inside = pole.frequency > first && pole.frequency < last;
            let positive =
                self.residues == Residues::Complex || seen(&self.parameters)[self.at(r)] > 0.0;
            let twin =
                (0..r).any(|q| (self.pole(q).frequency - pole.frequency).abs() < 2.0 * spacing);
            !(inside && positive && pole.damping < DAMPING.end) || twin
        })
    }

    fn poles(&self) -> heapless::Vec<Pole, MAX_MODES> {
        let mut poles: heapless::Vec<Pole, MAX_MODES> =
            (0..self.modes).map(|r| self.pole(r)).collect();
        poles.sort_unstable_by(|a, b| a.frequency.total_cmp(&b.frequency));
        poles
    }
}

/// Reciprocal of the denominator of a mode's amplification at `f` Hz: one division,
/// which costs as much as ten products where the processor has no `f64`.
fn inverse(frequency: f64, damping: f64, f: f64, square: f64) -> Complex<f64> {
    let re = frequency * frequency - square;
    let im = 2.0 * damping * frequency * f;
    let scale = 1.0 / (re * re + im * im);
    Complex::new(re * scale, -im * scale)
}

/// `unit` times a residue, most of which are real.
fn times(unit: Complex<f64>, residue: Complex<f64>) -> Complex<f64> {
    if residue.im == 0.0 {
        unit * residue.re
    } else {
        unit * residue
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: usize = 120;

    fn frequency(line: usize) -> f64 {
        0.5 * (line as f64 + 1.0)
    }

    fn found(modes: &[(f64, f64, f64)], residues: Residues) -> heapless::Vec<Pole, MAX_MODES> {
        found_at(modes, residues, &frequency)
    }

    fn found_at(
        modes: &[(f64, f64, f64)],
        residues: Residues,
        frequency: &dyn Fn(usize) -> f64,
    ) -> heapless::Vec<Pole, MAX_MODES> {
        let mut work = [Complex::new(0.0, 0.0); 2 * LINES];
        for (k, t) in work.iter_mut().enumerate().take(LINES) {
            *t = Complex::new(1.0, 0.0);
            for &(e, frequency_of_mode, damping) in modes {
                let pole = Pole {
                    frequency: frequency_of_mode,
                    damping,
                };
                *t += pole.amplification(frequency(k)) * e;
            }
        }
        find_poles(&Trace::new(&mut work), residues, frequency, &mut {
            PoleSearch::EMPTY
        })
    }

    #[test]
    fn exact_lines_return_their_poles() {
        for (residues, sign) in [(Residues::Positive, 1.0), (Residues::Complex, -1.0)] {
            let modes = [(0.3, 32.5, 0.01), (sign * 0.1, 41.1, 0.02)];
            let found = found(&modes, residues);
            assert_eq!(found.len(), 2);
            for (pole, (_, f, z)) in found.iter().zip(modes) {
                // The last accepted step gains less than 1e-9 of a cost that is zero at
                // the solution: the parameters are then good to its root, 3e-5.
                assert!((pole.frequency / f - 1.0).abs() < 3e-5, "{pole:?}");
                assert!((pole.damping / z - 1.0).abs() < 3e-5, "{pole:?}");
            }
        }
    }

    #[test]
    fn a_weak_mode_beside_a_strong_one_is_found() {
        let found = found(
            &[(1.0, 30.0, 0.005), (0.01, 37.0, 0.01)],
            Residues::Positive,
        );
        assert_eq!(found.len(), 2);
        assert!((found[1].frequency / 37.0 - 1.0).abs() < 1e-4);
    }

    /// Two modes are one if they lie within two lines of each other, wherever the first line lies.
    #[test]
    fn modes_far_above_the_first_line_are_two() {
        let modes = [(0.5, 23.0, 0.005), (0.5, 28.0, 0.005)];
        let found = found_at(&modes, Residues::Positive, &|line| 20.0 + 0.1 * line as f64);
        assert_eq!(found.len(), 2, "{found:?}");
        for (pole, (_, f, _)) in found.iter().zip(modes) {
            assert!((pole.frequency / f - 1.0).abs() < 3e-5, "{pole:?}");
        }
    }

    #[test]
    fn a_rigid_body_has_none() {
        assert!(found(&[], Residues::Positive).is_empty());
    }

    #[test]
    fn a_mode_above_the_lines_is_not_invented() {
        assert!(found(&[(0.3, 90.0, 0.01)], Residues::Positive).is_empty());
    }

    #[test]
    fn no_lines_no_poles() {
        let none = Trace::new(&mut []);
        assert!(
            find_poles(&none, Residues::Complex, &frequency, &mut {
                PoleSearch::EMPTY
            })
            .is_empty()
        );
    }
}

//! Poles of one scalar function: peaks first, then a damped Gauss-Newton fit.

use super::{MAX_MODES, Pole};
use nalgebra::{Complex, SMatrix, SVector};

/// Unknowns of the fit: a constant, one term for all modes above, and residue,
/// frequency and damping of each mode.
const UNKNOWNS: usize = 2 + 3 * MAX_MODES;
/// Damping that the search starts from.
const FIRST_DAMPING: f64 = 0.01;
/// Bounds of a damping that a mode of a structure can have.
const DAMPING: core::ops::Range<f64> = 1e-5..0.3;
const STEPS: usize = 40;

type Normal = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Parameters = SVector<f64, UNKNOWNS>;

/// What is known of the residues beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Residues {
    /// Positive, as in a power-like scalar of the apparent mass: no two modes cancel.
    Positive,
    /// Of either sign.
    Any,
}

/// Finds the poles of `t(ω) = c₀ + c₁ ω² + Σ e_r D_r(ω)` in the lines
/// `trace` at `frequency(line)` Hz, in ascending order. At most [`MAX_MODES`], the lowest ones; none
/// if no peak rises above the scatter of the lines.
///
/// The fit is relative to `|t|`, so that the lines below a resonance count as much as
/// the resonance itself: they carry the mass, and leakage does not bend them.
#[must_use]
pub fn find_poles(
    trace: &[Complex<f64>],
    residues: Residues,
    frequency: &dyn Fn(usize) -> f64,
) -> heapless::Vec<Pole, MAX_MODES> {
    let mut fit = Fit::start(trace, residues, frequency);
    while fit.modes > 0 {
        fit.refine(trace, frequency);
        match fit.implausible(frequency) {
            Some(mode) => fit.drop_mode(mode),
            None => break,
        }
    }
    fit.poles()
}

struct Fit {
    modes: usize,
    parameters: Parameters,
    /// Lines used: those below a further mode that is not fitted.
    lines: usize,
    /// Frequency that scales the ω² term, Hz.
    unit: f64,
    floor: f64,
    residues: Residues,
}

impl Fit {
    fn start(trace: &[Complex<f64>], residues: Residues, frequency: &dyn Fn(usize) -> f64) -> Self {
        let usable = trace.len();
        let scale = mean_size(trace);
        let scatter = scatter(trace);
        let mut parameters = Parameters::zeros();
        let mut modes = 0;
        let mut lines = usable;
        let mut last = 0;
        let signed = |k: usize| trace.get(k).map_or(0.0, |t| -t.im);
        let imaginary = |k: usize| match residues {
            Residues::Positive => signed(k),
            Residues::Any => signed(k).abs(),
        };
        for k in 1..usable.saturating_sub(1) {
            let height = imaginary(k);
            let peak = height > imaginary(k - 1) && height >= imaginary(k + 1);
            if !(peak && height > 6.0 * scatter && height > 0.02 * scale) {
                continue;
            }
            // Leakage ripples the flanks of a sharp peak; the next mode is one only if
            // the curve drops to half between them.
            if modes > 0 {
                let valley = (last..k).map(imaginary).fold(f64::INFINITY, f64::min);
                if valley > 0.5 * height.min(imaginary(last)) {
                    if height > imaginary(last) {
                        set_mode(&mut parameters, modes - 1, frequency(k), signed(k));
                        last = k;
                    }
                    continue;
                }
            }
            if modes == MAX_MODES {
                // Stay clear of the mode that there is no room for.
                lines = (last + (k - last) / 2).max(3);
                break;
            }
            set_mode(&mut parameters, modes, frequency(k), signed(k));
            last = k;
            modes += 1;
        }
        parameters[0] = trace.first().map_or(0.0, |t| t.re);
        Self {
            modes,
            parameters,
            lines,
            unit: frequency(usable.saturating_sub(1)),
            floor: 0.05 * scale,
            residues,
        }
    }

    fn pole(&self, mode: usize) -> Pole {
        Pole {
            frequency: self.parameters[3 + 3 * mode],
            damping: self.parameters[4 + 3 * mode],
        }
    }

    fn unknowns(&self) -> usize {
        2 + 3 * self.modes
    }

    /// Value and derivatives at one frequency.
    fn model(&self, p: &Parameters, f: f64) -> (Complex<f64>, [Complex<f64>; UNKNOWNS]) {
        let zero = Complex::new(0.0, 0.0);
        let mut d = [zero; UNKNOWNS];
        let above = f / self.unit;
        d[0] = Complex::new(1.0, 0.0);
        d[1] = Complex::new(above * above, 0.0);
        let mut value = d[0] * p[0] + d[1] * p[1];
        for r in 0..self.modes {
            let (e, fr, z) = (p[2 + 3 * r], p[3 + 3 * r], p[4 + 3 * r]);
            let below = Complex::new(fr * fr - f * f, 2.0 * z * fr * f);
            let unit = Complex::new(f * f, 0.0) / below;
            d[2 + 3 * r] = unit;
            let slope = -unit / below * e;
            d[3 + 3 * r] = slope * Complex::new(2.0 * fr, 2.0 * z * f);
            d[4 + 3 * r] = slope * Complex::new(0.0, 2.0 * fr * f);
            value += unit * e;
        }
        (value, d)
    }

    fn cost(
        &self,
        p: &Parameters,
        trace: &[Complex<f64>],
        frequency: &dyn Fn(usize) -> f64,
    ) -> f64 {
        let mut cost = 0.0;
        for (k, t) in trace.iter().enumerate().take(self.lines) {
            let (value, _) = self.model(p, frequency(k));
            let weight = 1.0 / (modulus(t) + self.floor);
            cost += (value - t).norm_sqr() * weight * weight;
        }
        cost
    }

    /// Levenberg and Marquardt: the step is accepted only if it explains more.
    fn refine(&mut self, trace: &[Complex<f64>], frequency: &dyn Fn(usize) -> f64) {
        let n = self.unknowns();
        let mut lambda = 1e-3;
        let mut cost = self.cost(&self.parameters, trace, frequency);
        for _ in 0..STEPS {
            let mut normal = Normal::zeros();
            let mut right = Parameters::zeros();
            for (k, t) in trace.iter().enumerate().take(self.lines) {
                let (value, d) = self.model(&self.parameters, frequency(k));
                let weight = 1.0 / (modulus(t) + self.floor);
                let weight = weight * weight;
                let residual = (t - value) * weight;
                for i in 0..n {
                    right[i] += (d[i].conj() * residual).re;
                    for j in 0..=i {
                        normal[(i, j)] += (d[i].conj() * d[j]).re * weight;
                    }
                }
            }
            let mut improved = false;
            while lambda < 1e9 {
                if let Some(step) = damped_step(&normal, &right, n, lambda) {
                    let tried = self.bounded(&(self.parameters + step));
                    let tried_cost = self.cost(&tried, trace, frequency);
                    if tried_cost < cost {
                        let gain = (cost - tried_cost) / cost;
                        self.parameters = tried;
                        cost = tried_cost;
                        lambda *= 0.1;
                        improved = gain > 1e-9;
                        break;
                    }
                }
                lambda *= 10.0;
            }
            if !improved {
                return;
            }
        }
    }

    fn bounded(&self, p: &Parameters) -> Parameters {
        let mut p = *p;
        for r in 0..self.modes {
            p[3 + 3 * r] = p[3 + 3 * r].max(1e-3 * self.unit);
            p[4 + 3 * r] = p[4 + 3 * r].clamp(DAMPING.start, DAMPING.end);
        }
        p
    }

    /// A mode that is none: outside the lines, without mass, or overdamped.
    fn implausible(&self, frequency: &dyn Fn(usize) -> f64) -> Option<usize> {
        let last = frequency(self.lines.saturating_sub(1));
        (0..self.modes).find(|&r| {
            let pole = self.pole(r);
            let inside = pole.frequency > frequency(0) && pole.frequency < last;
            let positive = self.residues == Residues::Any || self.parameters[2 + 3 * r] > 0.0;
            !(inside && positive && pole.damping < DAMPING.end)
        })
    }

    fn drop_mode(&mut self, mode: usize) {
        for i in 2 + 3 * mode..self.unknowns() - 3 {
            self.parameters[i] = self.parameters[i + 3];
        }
        self.modes -= 1;
    }

    fn poles(&self) -> heapless::Vec<Pole, MAX_MODES> {
        let mut poles: heapless::Vec<Pole, MAX_MODES> =
            (0..self.modes).map(|r| self.pole(r)).collect();
        poles.sort_unstable_by(|a, b| a.frequency.total_cmp(&b.frequency));
        poles
    }
}

fn set_mode(p: &mut Parameters, mode: usize, frequency: f64, height: f64) {
    // At resonance Im D = -1 / 2ζ.
    p[2 + 3 * mode] = height * 2.0 * FIRST_DAMPING;
    p[3 + 3 * mode] = frequency;
    p[4 + 3 * mode] = FIRST_DAMPING;
}

fn modulus(z: &Complex<f64>) -> f64 {
    libm::sqrt(z.norm_sqr())
}

/// Mean size of the lines, with a resonance counting no more than its share of them.
fn mean_size(trace: &[Complex<f64>]) -> f64 {
    let n = trace.len().max(1) as f64;
    let roots: f64 = trace.iter().map(|t| libm::sqrt(modulus(t))).sum();
    (roots / n) * (roots / n)
}

/// Scatter of the imaginary parts from their second differences, clipped three times so
/// that the peaks themselves do not count.
fn scatter(trace: &[Complex<f64>]) -> f64 {
    let mut limit = f64::INFINITY;
    for _ in 0..4 {
        let (mut sum, mut count) = (0.0, 0.0);
        for w in trace.windows(3) {
            let second = w[0].im - 2.0 * w[1].im + w[2].im;
            if second.abs() <= limit {
                sum += second * second;
                count += 1.0;
            }
        }
        if count == 0.0 {
            return 0.0;
        }
        limit = 3.0 * libm::sqrt(sum / count);
    }
    // The variance of 1, -2, 1 is six; the limit holds three standard deviations.
    limit / 3.0 / libm::sqrt(6.0)
}

/// `(N + λ diag N) step = right`, lower triangle of N given.
fn damped_step(normal: &Normal, right: &Parameters, n: usize, lambda: f64) -> Option<Parameters> {
    let mut l = Normal::zeros();
    let mut x = Parameters::zeros();
    for j in 0..n {
        for i in j..n {
            let mut sum = normal[(i, j)];
            if i == j {
                sum *= 1.0 + lambda;
            }
            for k in 0..j {
                sum -= l[(i, k)] * l[(j, k)];
            }
            if i == j {
                if !(sum > 0.0 && sum.is_finite()) {
                    return None;
                }
                l[(j, j)] = libm::sqrt(sum);
            } else {
                l[(i, j)] = sum / l[(j, j)];
            }
        }
    }
    for i in 0..n {
        let mut sum = right[i];
        for k in 0..i {
            sum -= l[(i, k)] * x[k];
        }
        x[i] = sum / l[(i, i)];
    }
    for i in (0..n).rev() {
        let mut sum = x[i];
        for k in i + 1..n {
            sum -= l[(k, i)] * x[k];
        }
        x[i] = sum / l[(i, i)];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frequency(line: usize) -> f64 {
        0.5 * (line as f64 + 1.0)
    }

    fn trace(modes: &[(f64, f64, f64)]) -> heapless::Vec<Complex<f64>, 120> {
        (0..120)
            .map(|k| {
                let f = frequency(k);
                modes.iter().fold(Complex::new(1.0, 0.0), |t, &(e, fr, z)| {
                    let pole = Pole {
                        frequency: fr,
                        damping: z,
                    };
                    t + pole.amplification(f) * e
                })
            })
            .collect()
    }

    #[test]
    fn exact_lines_return_their_poles() {
        let found = find_poles(
            &trace(&[(0.3, 32.5, 0.01), (0.1, 41.1, 0.02)]),
            Residues::Positive,
            &frequency,
        );
        assert_eq!(found.len(), 2);
        for (pole, (f, z)) in found.iter().zip([(32.5, 0.01), (41.1, 0.02)]) {
            // The last accepted step gains less than 1e-9 of a cost that is zero at the
            // solution: the parameters are then good to its root, 3e-5.
            assert!((pole.frequency / f - 1.0).abs() < 3e-5, "{pole:?}");
            assert!((pole.damping / z - 1.0).abs() < 3e-5, "{pole:?}");
        }
    }

    #[test]
    fn a_rigid_body_has_none() {
        assert!(find_poles(&trace(&[]), Residues::Positive, &frequency).is_empty());
    }

    #[test]
    fn a_mode_above_the_lines_is_not_invented() {
        assert!(
            find_poles(&trace(&[(0.3, 90.0, 0.01)]), Residues::Positive, &frequency).is_empty()
        );
    }

    #[test]
    fn no_lines_no_poles() {
        assert!(find_poles(&[], Residues::Positive, &frequency).is_empty());
    }
}

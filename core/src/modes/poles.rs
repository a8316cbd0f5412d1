//! Poles of one scalar function: peaks first, then a damped Gauss-Newton fit.
//!
//! Sums over lines are in single precision, which the chip has in hardware: its
//! rounding is far below the scatter of the lines, and moves no pole by more than 1e-7 of its
//! frequency. The small systems are solved in double precision.

use super::trace::TraceLine;
use super::{MAX_MODES, Pole, Trace};
use crate::algebra::{Triangle, not_negative, solve_positive, triangle_len};
use crate::cells::{cells, seen};
use nalgebra::{Complex, SVector};

/// Unknowns of the fit: a constant, one term for all modes above, and frequency, damping
/// and up to two residues of each mode.
const UNKNOWNS: usize = 2 + 4 * MAX_MODES;
/// The unknowns' derivatives at a line, and what is left there.
const COLUMNS: usize = UNKNOWNS + 1;
/// Damping that the search starts from where two lines do not tell it.
const FIRST_DAMPING: f64 = 0.01;
/// Dampings that the search starts from where two lines tell them.
const TOLD_DAMPING: core::ops::Range<f32> = 1e-4..0.2;
/// Bounds of a damping that a mode of a structure can have.
const DAMPING: core::ops::Range<f64> = 1e-5..0.3;
const STEPS: usize = 40;

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
    /// Sums of the products of all columns, the lower triangle row after row: the normal matrix,
    /// its right-hand side as the last row, and the cost as the last entry.
    sums: [f32; triangle_len(COLUMNS)],
    /// The normal matrix with Levenberg's and Marquardt's term, and then its factor.
    damped: Triangle<{ triangle_len(UNKNOWNS) }>,
}

impl PoleSearch {
    /// As good as any other state.
    pub const EMPTY: Self = Self {
        sums: [0.0; triangle_len(COLUMNS)],
        damped: Triangle::ZERO,
    };
}

/// A resonance of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Resonance {
    /// Its pole.
    pub pole: Pole,
    /// Its residue e_r over the constant c₀; zero if the constant is not positive.
    pub share: f64,
}

/// The resonances of a trace, and the share of those beyond it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Resonances {
    /// The resonances in ascending order of their frequencies.
    pub found: heapless::Vec<Resonance, MAX_MODES>,
    /// The one above all lines of which the lines show the flank, if they do.
    pub beyond: Option<Resonance>,
    /// Coefficient c₁ of f² over the constant c₀, 1/Hz²; zero if the constant is not positive, or if it is
    /// negative itself without a flank.
    pub upper: f64,
}

impl Resonances {
    /// Their poles.
    pub fn poles(&self) -> heapless::Vec<Pole, MAX_MODES> {
        self.found.iter().map(|resonance| resonance.pole).collect()
    }
}

/// The poles of [`find_resonances`].
#[must_use]
pub(crate) fn find_poles(
    trace: &Trace<'_>,
    residues: Residues,
    search: &mut PoleSearch,
) -> heapless::Vec<Pole, MAX_MODES> {
    find_resonances(trace, residues, search).poles()
}

/// Finds the resonances of `t(ω) = c₀ + c₁ ω² + Σ (e_r + g_r jω/ω_r) D_r(ω)` in a trace, in ascending
/// order of their frequencies. At most [`MAX_MODES`], the strongest ones; none if no peak rises above what the lines
/// scatter by.
///
/// With [`Residues::Positive`], and if there is room for one more, a flank that ω² does not explain is that of a
/// mode above the lines.
#[must_use]
pub(crate) fn find_resonances(
    trace: &Trace<'_>,
    residues: Residues,
    search: &mut PoleSearch,
) -> Resonances {
    let mut fit = Fit::start(trace, residues);
    let mut cost = fit.refine(trace, ROUGH, f64::INFINITY, search);
    // Strongest first, one at a time, each next one in what the others leave.
    let mut refused: heapless::Vec<usize, TRIES> = heapless::Vec::new();
    let rounding = ROUNDING * trace.len() as f64;
    while fit.modes < MAX_MODES && cost > rounding {
        let Some(line) = fit.strongest_peak(trace, &refused) else {
            break;
        };
        let enough = cost * libm::exp(-WORTH / trace.len() as f64);
        let mut more = fit.with_mode(trace, line);
        let lower = more.refine(trace, ROUGH, enough, search);
        if lower < enough && !more.implausible(trace) {
            fit = more;
            cost = lower;
        } else if refused.push(line).is_err() {
            break;
        }
    }
    if cost > rounding
        && let Some(mut flank) = fit.with_flank(trace, cost)
    {
        let enough = cost * libm::exp(-WORTH / trace.len() as f64);
        let lower = flank.refine(trace, ROUGH, enough, search);
        if lower < enough && !flank.implausible(trace) {
            fit = flank;
        }
    }
    fit.refine(trace, FINE, f64::INFINITY, search);
    fit.resonances()
}

/// Gain of log-likelihood that three more unknowns must bring. Noise gives three on
/// average, twice that where the window makes neighbouring lines alike, and the largest
/// of a hundred peaks some three times more.
const WORTH: f64 = 20.0;
/// A peak is given up when what is missing to [`WORTH`] is more than so many times what the next step
/// promises; noise like that of the firmware's budgets promises a sixteenth of it and less. In 20 000 random
/// traces of up to four modes with noise, 98 % of the modes that are found without this end are found with
/// it, in 73 % of the steps. Most others lie far from the peak where the fit that found them began.
const PATIENCE: f64 = 15.0;
/// Peaks that may turn out to be none before the search ends.
const TRIES: usize = 6;
/// Relative gain of a step at which a fit ends: while modes are looked for, and at last.
const ROUGH: f64 = 1e-3;
const FINE: f64 = 1e-9;
/// Relative gain that the cost in single precision does not show.
const KNOWN: f64 = 1e-5;
/// Cost of a line that fits to within rounding: a weight is no more than the inverse square of 2 %
/// of the value, of which rounding is 2e-6.
const ROUNDING: f64 = 1e-8;

/// Residue, frequency (Hz) and damping ratio of the resonance through two lines, each a frequency (Hz) and
/// a value: `L(ω) = e ω² / (p - ω²)`, `p = ω_r² (1 + 2jζ)`. `None` if it lies a line away or further.
fn resonance(here: (f32, Complex<f32>), beside: (f32, Complex<f32>)) -> Option<[f64; 3]> {
    let [per_square, other] = [here, beside].map(|(f, left)| left / (f * f));
    let p = (here.1 - beside.1) / (per_square - other);
    let frequency = libm::sqrtf(p.re);
    let damping = p.im / (2.0 * p.re);
    let near = (frequency - here.0).abs() < (beside.0 - here.0).abs();
    let residue = (per_square * (p - here.0 * here.0)).re;
    (near && TOLD_DAMPING.contains(&damping)).then(|| [residue, frequency, damping].map(f64::from))
}

struct Fit {
    modes: usize,
    parameters: Parameters,
    /// Frequency that scales the ω² term, Hz.
    unit: f64,
    residues: Residues,
    /// Frequency of one line more than there are, Hz.
    above: f64,
    /// `true` if the last mode is the one above the lines.
    flank: bool,
}

/// The parameters of a fit in single precision.
struct Model {
    constant: f32,
    /// Of ω² in Hz².
    upper: f32,
    /// One over the square of the frequency that scales the ω² term.
    per_square: f32,
    modes: [Mode; MAX_MODES],
    count: usize,
    residues: Residues,
}

/// A mode in single precision.
#[derive(Clone, Copy, Default)]
struct Mode {
    residue: f32,
    frequency: f32,
    /// Part of the frequency that single precision rounds off, Hz.
    rest: f32,
    damping: f32,
    /// The quadrature residue over the frequency.
    quadrature: f32,
}

impl Mode {
    /// Reciprocal of the denominator of the amplification at `f` Hz.
    #[inline]
    fn inverse(&self, f: f32) -> Complex<f32> {
        // Close to the resonance the first difference is exact, that of squares would not be.
        let re = (self.frequency - f + self.rest) * (self.frequency + f);
        let im = 2.0 * self.damping * self.frequency * f;
        let scale = 1.0 / (re * re + im * im);
        Complex::new(re * scale, -im * scale)
    }
}

impl Model {
    /// Residual of a line: its value less the model.
    #[inline]
    fn left(&self, line: &TraceLine) -> Complex<f32> {
        let f = line.frequency;
        let square = f * f;
        let mut left = line.value;
        left.re -= self.constant + square * self.upper;
        for mode in self.modes.iter().take(self.count) {
            let unit = mode.inverse(f) * square;
            left -= match self.residues {
                Residues::Positive => unit * mode.residue,
                Residues::Complex => unit * Complex::new(mode.residue, mode.quadrature * f),
            };
        }
        left
    }

    /// Sums of the products of `count` columns over all lines.
    fn add_up(&self, trace: &Trace<'_>, count: usize, sums: &mut [f32]) {
        sums.fill(0.0);
        let mut columns = [Complex::new(0.0, 0.0); COLUMNS];
        for line in trace.lines() {
            self.columns(&line, &mut columns);
            let columns = columns.get(..count).unwrap_or_default();
            add_products(columns, line.weight, sums);
        }
    }

    fn cost(&self, trace: &Trace<'_>) -> f64 {
        let cost = trace
            .lines()
            .map(|line| self.left(&line).norm_sqr() * line.weight);
        cost.sum::<f32>().into()
    }

    /// The derivatives of the model at a line, and what is left of the line.
    #[inline]
    fn columns(&self, line: &TraceLine, columns: &mut [Complex<f32>; COLUMNS]) {
        let f = line.frequency;
        let square = f * f;
        let mut left = line.value;
        left.re -= self.constant + square * self.upper;
        let (plain, mut others) = columns.split_at_mut(2);
        if let [constant, upper] = plain {
            *constant = Complex::new(1.0, 0.0);
            *upper = Complex::new(square * self.per_square, 0.0);
        }
        for mode in self.modes.iter().take(self.count) {
            let inverse = mode.inverse(f);
            let unit = inverse * square;
            let elastic = match self.residues {
                Residues::Positive => unit * mode.residue,
                Residues::Complex => unit * Complex::new(mode.residue, mode.quadrature * f),
            };
            let slope = -elastic * inverse;
            let Some(([of_residue, of_frequency, of_damping], rest)) =
                others.split_first_chunk_mut()
            else {
                return;
            };
            *of_residue = unit;
            *of_frequency = slope * Complex::new(2.0 * mode.frequency, 2.0 * mode.damping * f);
            let damping = 2.0 * mode.frequency * f;
            *of_damping = Complex::new(-slope.im * damping, slope.re * damping);
            others = rest;
            if self.residues == Residues::Complex {
                let Some(([of_quadrature], rest)) = others.split_first_chunk_mut() else {
                    return;
                };
                let ahead = f / mode.frequency;
                *of_quadrature = Complex::new(-unit.im * ahead, unit.re * ahead);
                others = rest;
            }
            left -= elastic;
        }
        if let Some(last) = others.first_mut() {
            *last = left;
        }
    }
}

/// Adds the products of a line's columns to their sums.
#[inline]
fn add_products(columns: &[Complex<f32>], weight: f32, sums: &mut [f32]) {
    let mut rest = sums;
    for (i, column) in columns.iter().enumerate() {
        let (re, im) = (column.re * weight, column.im * weight);
        let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
            return;
        };
        for (sum, other) in row.iter_mut().zip(columns) {
            *sum += re * other.re + im * other.im;
        }
        rest = after;
    }
}

impl Fit {
    fn start(trace: &Trace<'_>, residues: Residues) -> Self {
        let mut parameters = Parameters::zeros();
        parameters[0] = trace.at(0).value.re.into();
        let frequency = |line: usize| f64::from(trace.at(line).frequency);
        let unit = frequency(trace.len().saturating_sub(1));
        Self {
            modes: 0,
            parameters,
            unit,
            above: unit + frequency(1) - frequency(0),
            residues,
            flank: false,
        }
    }

    /// The model of these parameters.
    fn model(&self, p: &Parameters) -> Model {
        let per_square = 1.0 / (self.unit * self.unit);
        let p = seen(p);
        let mut modes = [Mode::default(); MAX_MODES];
        for (r, mode) in modes.iter_mut().enumerate().take(self.modes) {
            let at = self.at(r);
            *mode = Mode {
                residue: p[at] as f32,
                frequency: p[at + 1] as f32,
                rest: (p[at + 1] - f64::from(p[at + 1] as f32)) as f32,
                damping: p[at + 2] as f32,
                quadrature: match self.residues {
                    Residues::Positive => 0.0,
                    Residues::Complex => (p[at + 3] / p[at + 1]) as f32,
                },
            };
        }
        Model {
            constant: p[0] as f32,
            upper: (p[1] * per_square) as f32,
            per_square: per_square as f32,
            modes,
            count: self.modes,
            residues: self.residues,
        }
    }

    /// The highest peak of the imaginary part that the fit leaves, away from the modes
    /// that are there and from what was refused before.
    fn strongest_peak(&self, trace: &Trace<'_>, refused: &[usize]) -> Option<usize> {
        let model = self.model(&self.parameters);
        let left = |line: usize| model.left(&trace.at(line)).im;
        let height = |im: f32| match self.residues {
            Residues::Positive => -im,
            Residues::Complex => im.abs(),
        };
        let mut best = None;
        let mut highest = 0.0;
        let (mut here, mut after) = (left(0), left(1));
        for line in 1..trace.len().saturating_sub(1) {
            let before = here;
            here = after;
            after = left(line + 1);
            let peak = height(here) > height(before) && height(here) >= height(after);
            if !(peak && height(here) > highest) {
                continue;
            }
            let f = trace.at(line).frequency;
            // Leakage bends the flanks of a mode that is already there; what it leaves
            // is not another mode.
            let spacing = trace.at(line + 1).frequency - f;
            let taken =
                model.modes.iter().take(self.modes).any(|mode| {
                    (mode.frequency - f).abs() < 3.0 * spacing + 3.0 * mode.damping * f
                });
            let tried = refused.iter().any(|&r| line.abs_diff(r) < 3);
            if !taken && !tried {
                highest = height(here);
                best = Some(line);
            }
        }
        best
    }

    /// One more mode, whose resonance explains this line and the larger one beside it.
    fn with_mode(&self, trace: &Trace<'_>, line: usize) -> Self {
        let model = self.model(&self.parameters);
        let left = |line: usize| {
            let line = trace.at(line);
            (line.frequency, model.left(&line))
        };
        let [before, here, after] = [line.saturating_sub(1), line, line + 1].map(left);
        let beside = if before.1.norm_sqr() > after.1.norm_sqr() {
            before
        } else {
            after
        };
        let [residue, frequency, damping] = resonance(here, beside).unwrap_or_else(|| {
            // At resonance Im D = -1 / 2ζ.
            let residue = -f64::from(here.1.im) * 2.0 * FIRST_DAMPING;
            [residue, here.0.into(), FIRST_DAMPING]
        });
        let at = self.at(self.modes);
        let mut parameters = self.parameters;
        let p = &mut cells(&mut parameters);
        p[at] = residue;
        p[at + 1] = frequency;
        p[at + 2] = damping;
        Self {
            modes: self.modes + 1,
            parameters,
            ..*self
        }
    }

    /// One more mode a quarter above the last line, which explains what the ω² term did. `None` if there is no room,
    /// or if that term explains too little for its bend to be worth a mode.
    fn with_flank(&self, trace: &Trace<'_>, cost: f64) -> Option<Self> {
        const ABOVE: f64 = 1.25;
        /// Power of the ω² term over that of what it leaves of a flank, at least: with lines from nearly zero 4.7 for a
        /// mode a twentieth above the last one, 31 for one a quarter above.
        const BEND: f64 = 4.0;
        let upper = self.parameters[1];
        if self.modes == MAX_MODES || self.residues == Residues::Complex || upper <= 0.0 {
            return None;
        }
        let per_square = 1.0 / (self.unit * self.unit) as f32;
        let powers = trace.lines().map(|line| {
            let value = line.frequency * line.frequency * per_square;
            value * value * line.weight
        });
        let explained = upper * upper * f64::from(powers.sum::<f32>());
        if explained * (trace.len() as f64) < BEND * WORTH * cost {
            return None;
        }
        let at = self.at(self.modes);
        let mut parameters = self.parameters;
        let p = &mut cells(&mut parameters);
        p[at] = ABOVE * ABOVE * upper;
        p[at + 1] = ABOVE * self.unit;
        p[at + 2] = FIRST_DAMPING;
        p[1] = 0.0;
        Some(Self {
            modes: self.modes + 1,
            parameters,
            flank: true,
            ..*self
        })
    }

    /// `true` if a mode is the one above the lines.
    fn is_flank(&self, mode: usize) -> bool {
        self.flank && mode + 1 == self.modes
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

    /// Levenberg and Marquardt: the step is accepted only if it explains more. Ends early where a
    /// cost of `enough` is out of reach.
    fn refine(&mut self, trace: &Trace<'_>, end: f64, enough: f64, search: &mut PoleSearch) -> f64 {
        let PoleSearch { sums, damped } = search;
        let n = self.unknowns();
        let mut lambda = 1e-3;
        let mut cost = f64::INFINITY;
        let rounding = ROUNDING * trace.len() as f64;
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            self.model(&self.parameters).add_up(trace, n + 1, sums);
            cost = sums
                .get(triangle_len(n + 1) - 1)
                .map_or(cost, |&c| c.into());
            let mut improved = false;
            while lambda < 1e9 {
                let Some((tried, promise)) = self.step(n, sums, lambda, damped) else {
                    lambda *= 10.0;
                    continue;
                };
                if cost - enough > PATIENCE * promise {
                    return cost;
                }
                let promise = promise / (cost + rounding);
                if promise < KNOWN {
                    // The gradient is known better than the cost, until it is rounding, too.
                    self.parameters = tried;
                    lambda *= 0.1;
                    improved = promise > end && promise < 0.5 * last;
                    last = promise;
                    break;
                }
                if promise < end {
                    break;
                }
                let tried_cost = self.model(&tried).cost(trace);
                if tried_cost < cost {
                    let gain = (cost - tried_cost) / (cost + rounding);
                    self.parameters = tried;
                    cost = tried_cost;
                    lambda *= 0.1;
                    improved = gain > end;
                    break;
                }
                lambda *= 10.0;
            }
            if !improved {
                break;
            }
        }
        cost
    }

    /// The parameters after a step with Marquardt's factor `lambda`, from the sums of `n`
    /// unknowns, and how much less a linear model would cost there. `None` if the system cannot be
    /// solved.
    fn step(
        &self,
        n: usize,
        sums: &[f32],
        lambda: f64,
        damped: &mut Triangle<{ triangle_len(UNKNOWNS) }>,
    ) -> Option<(Parameters, f64)> {
        let (normal, right) = sums.split_at_checked(triangle_len(n))?;
        damped.copy_from(normal);
        let (diagonal, mut excess) = (&mut cells(damped), Parameters::zeros());
        for (i, excess) in excess.iter_mut().enumerate().take(n) {
            *excess = lambda * diagonal[(i, i)];
            diagonal[(i, i)] += *excess;
        }
        let mut step = Parameters::zeros();
        for (step, right) in step.iter_mut().zip(right).take(n) {
            *step = f64::from(*right);
        }
        solve_positive(damped, step.as_mut_slice(), n)?;
        let mut promise = 0.0;
        for ((step, excess), right) in step.iter().zip(&excess).zip(right).take(n) {
            promise += step * (step * excess + f64::from(*right));
        }
        step += self.parameters;
        Some((self.bounded(&step), promise))
    }

    fn bounded(&self, p: &Parameters) -> Parameters {
        let mut bounded = *p;
        let p = &mut cells(&mut bounded);
        for r in 0..self.modes {
            let at = self.at(r);
            let least = if self.is_flank(r) {
                self.above
            } else {
                1e-3 * self.unit
            };
            p[at + 1] = p[at + 1].max(least);
            p[at + 2] = p[at + 2].clamp(DAMPING.start, DAMPING.end);
        }
        bounded
    }

    /// `true` if one of the modes is implausible: outside the lines, without mass, overdamped, or
    /// within two lines of another mode.
    fn implausible(&self, trace: &Trace<'_>) -> bool {
        let frequency = |line: usize| f64::from(trace.at(line).frequency);
        let (first, last) = (frequency(0), frequency(trace.len().saturating_sub(1)));
        let spacing = frequency(1) - first;
        (0..self.modes).any(|r| {
            let pole = self.pole(r);
            let outside = if self.is_flank(r) {
                pole.frequency <= self.above
            } else {
                pole.frequency <= first || pole.frequency >= last
            };
            let positive =
                self.residues == Residues::Complex || seen(&self.parameters)[self.at(r)] > 0.0;
            let twin =
                (0..r).any(|q| (self.pole(q).frequency - pole.frequency).abs() < 2.0 * spacing);
            outside || !(positive && pole.damping < DAMPING.end) || twin
        })
    }

    fn resonances(&self) -> Resonances {
        let p = seen(&self.parameters);
        let over_constant = |x: f64| if p[0] > 0.0 { x / p[0] } else { 0.0 };
        let resonance = |r: usize| Resonance {
            pole: self.pole(r),
            share: over_constant(p[self.at(r)]),
        };
        let inside = self.modes - usize::from(self.flank);
        let beyond = self.flank.then(|| resonance(inside));
        let mut found: heapless::Vec<Resonance, MAX_MODES> = (0..inside).map(resonance).collect();
        found.sort_unstable_by(|a, b| a.pole.frequency.total_cmp(&b.pole.frequency));
        let upper = if self.flank { p[1] } else { not_negative(p[1]) };
        Resonances {
            found,
            beyond,
            upper: over_constant(upper) / (self.unit * self.unit),
        }
    }
}

#[cfg(test)]
mod tests;

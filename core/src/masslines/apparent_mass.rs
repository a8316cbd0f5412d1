//! The apparent mass with elastic terms: the recommended method.
//!
//! On a rigid interface the interface accelerometers alone give the base acceleration
//! exactly, however elastic the structure is, and
//!
//! ```text
//! f = M(ω) a,   M(ω) = M₀ + Σ_r L_rᵀ L_r D_r(ω),   D_r = ω² / (ω_r² - ω² + 2jζ_r ω_r ω)
//! ```
//!
//! with the poles of the *fixed* structure. M₀ is exactly the rigid-body mass matrix
//! (1). So nothing is averaged away: the poles are found once, and the elastic terms go
//! into the regression as unknowns of their own and are eliminated from it again.

use super::averaging::MIN_LINES;
use super::regression::{MAX_TERMS, Regression, Solution};
use super::{Excitation, Lines, MasslineError, Masslines, Moments};
use crate::geometry::Equations;
use crate::modes::{MAX_MODES, Pole, Residues, Trace, find_poles};
use core::ops::Range;
use nalgebra::{Complex, Matrix6, Vector3, Vector6};

/// Most runs whose noise levels are weighed against each other.
const MAX_RUNS: usize = 24;

/// Masslines by apparent mass, with the elastic terms that were eliminated.
#[derive(Clone, Debug, PartialEq)]
pub struct ApparentMass {
    /// The pairs.
    pub masslines: Masslines,
    /// Poles of the fixed structure found in the lines.
    pub poles: heapless::Vec<Pole, MAX_MODES>,
    /// What each pole's term was multiplied with in the averaging band, if it was needed
    /// there. Below the modes their terms resemble each other and share what they explain;
    /// for effective masses see [`super::fixed_modes`].
    pub elastic: [Option<Matrix6<f64>>; MAX_MODES],
    /// What all modes above add per (Hz)², if that term was needed.
    pub upper: Option<Matrix6<f64>>,
    /// M₀ before the structure of equation (1) is imposed.
    pub rigid: Matrix6<f64>,
    /// Number of independent directions of base acceleration that the runs excite.
    pub excited: usize,
    /// Power over noise of the weakest of them.
    pub weakest_excitation: f64,
    /// Standard deviation of each resultant's residual, relative to its power.
    pub misfit: Vector6<f64>,
}

impl ApparentMass {
    /// The fitted apparent mass at `frequency` Hz, 6 x 6, in excited directions.
    #[must_use]
    pub fn at(&self, frequency: f64) -> Matrix6<Complex<f64>> {
        let mut m = self.rigid.map(|x| Complex::new(x, 0.0));
        for (pole, mass) in self.poles.iter().zip(&self.elastic) {
            if let Some(mass) = mass {
                let d = pole.amplification(frequency);
                m += mass.map(|x| d * x);
            }
        }
        if let Some(upper) = &self.upper {
            m += upper.map(|x| Complex::new(x * frequency * frequency, 0.0));
        }
        m
    }
}

/// Condenses the lines `band` to masslines about `reference`. The lines `fit` serve to find
/// the poles. `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`] if the band is too short or nothing is excited or measured.
pub fn apparent_mass<L: Lines + ?Sized>(
    lines: &L,
    band: Range<usize>,
    fit: Range<usize>,
    reference: Vector3<f64>,
    equations: &Equations,
    work: &mut [Complex<f64>],
) -> Result<ApparentMass, MasslineError> {
    if band.len() < MIN_LINES {
        return Err(MasslineError::TooFewLines(band.len()));
    }
    if equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let (poles, _) = find_fixed_poles(lines, &band, fit, work);
    let basis = Basis::new(lines, &poles, &band);
    let equal = [1.0; MAX_RUNS];
    let first = Condensed::new(lines, &band, equations, &basis, &equal)?;
    // Runs differ in level, and so does the noise of sensors whose noise follows it.
    let weights = first.run_weights(&first.left(lines, &band, &basis), lines.runs());
    let last = Condensed::new(lines, &band, equations, &basis, &weights)?;
    let spread = last.spread(lines, &band, &weights, &last.left(lines, &band, &basis));
    last.finish(poles, &basis, reference, &spread)
}

/// The poles of the fixed structure, from the power-like scalar `Σ_runs a*f / a*W a`,
/// and that scalar with its weights.
pub(super) fn find_fixed_poles<'w, L: Lines + ?Sized>(
    lines: &L,
    band: &Range<usize>,
    fit: Range<usize>,
    work: &'w mut [Complex<f64>],
) -> (heapless::Vec<Pole, MAX_MODES>, Trace<'w>) {
    // W makes translations and rotations comparable: force over acceleration, roughly
    // the body's own mass and inertia.
    let mut energy = Moments::zero();
    for run in 0..lines.runs() {
        for line in band.clone() {
            lines.add_moments(run, line, 1.0, &mut energy);
        }
    }
    let w = Vector6::from_fn(|j, _| {
        let (a, f) = (energy.aa[(j, j)].re, energy.ff[(j, j)].re);
        if a > 0.0 { libm::sqrt(f / a) } else { 0.0 }
    });
    let end = fit.end.min(lines.count()).min(fit.start + work.len() / 2);
    let count = end.saturating_sub(fit.start);
    for (line, t) in (fit.start..end).zip(work.iter_mut()) {
        *t = Complex::new(0.0, 0.0);
        for run in 0..lines.runs() {
            let mut power = Complex::new(0.0, 0.0);
            let mut norm = 0.0;
            if let Some((a, f)) = lines.pair(run, line) {
                for j in 0..6 {
                    power += f[j] * a[j].conj();
                    norm += w[j] * a[j].norm_sqr();
                }
            } else {
                let mut m = Moments::zero();
                lines.add_moments(run, line, 1.0, &mut m);
                for j in 0..6 {
                    power += m.fa[(j, j)];
                    norm += w[j] * m.aa[(j, j)].re;
                }
            }
            if norm > 0.0 {
                *t += power / norm;
            }
        }
    }
    let trace = Trace::new(&mut work[..2 * count]);
    let poles = find_poles(&trace, Residues::Positive, &|k| {
        lines.frequency(fit.start + k)
    });
    (poles, trace)
}

/// The functions of frequency that the regression may use: 1, one per mode, and ω².
pub(super) struct Basis {
    poles: heapless::Vec<Pole, MAX_MODES>,
    /// Frequency at which the ω² term is one, Hz.
    unit: f64,
}

impl Basis {
    pub(super) fn new<L: Lines + ?Sized>(lines: &L, poles: &[Pole], band: &Range<usize>) -> Self {
        Self {
            poles: poles.iter().copied().collect(),
            unit: lines.frequency(band.end.saturating_sub(1)),
        }
    }

    pub(super) fn terms(&self) -> usize {
        2 + self.poles.len()
    }

    fn upper(&self) -> usize {
        1 + self.poles.len()
    }

    /// Values at frequency `f`, Hz.
    pub(super) fn at(&self, f: f64) -> [Complex<f64>; MAX_TERMS] {
        let mut phi = [Complex::new(0.0, 0.0); MAX_TERMS];
        phi[0] = Complex::new(1.0, 0.0);
        for (slot, pole) in phi[1..].iter_mut().zip(&self.poles) {
            *slot = pole.amplification(f);
        }
        let ratio = f / self.unit;
        phi[self.upper()] = Complex::new(ratio * ratio, 0.0);
        phi
    }
}

struct Condensed {
    regression: Regression,
    solution: Solution,
    excitation: Excitation,
    noise: Vector6<f64>,
    power: Vector6<f64>,
}

impl Condensed {
    fn new<L: Lines + ?Sized>(
        lines: &L,
        band: &Range<usize>,
        equations: &Equations,
        basis: &Basis,
        weights: &[f64; MAX_RUNS],
    ) -> Result<Self, MasslineError> {
        let runs = lines.runs().min(MAX_RUNS);
        let mut energy = Moments::zero();
        let mut noise = Vector6::zeros();
        for (run, weight) in weights.iter().enumerate().take(runs) {
            let per_line = lines.noise(run);
            for j in 0..6 {
                noise[j] += weight * per_line[j] * band.len() as f64;
            }
            for line in band.clone() {
                lines.add_moments(run, line, *weight, &mut energy);
            }
        }
        let excitation = Excitation::new(&energy.aa.map(|z| z.re), &noise);
        if excitation.rank() == 0 {
            return Err(MasslineError::NoExcitation);
        }
        let mut regression =
            Regression::new(excitation, *equations, basis.terms(), lines.correlation());
        for line in band.clone() {
            let mut m = Moments::zero();
            let mut count = 0.0;
            for (run, weight) in weights.iter().enumerate().take(runs) {
                lines.add_moments(run, line, *weight, &mut m);
                // Real and imaginary part hold independently (chapter 6).
                count += 2.0 * lines.equations_per_line(run);
            }
            regression.add(&m, &basis.at(lines.frequency(line))[..basis.terms()], count);
        }
        let solution = best(&regression, basis).ok_or(MasslineError::Singular)?;
        Ok(Self {
            regression,
            solution,
            excitation,
            noise,
            power: energy.ff.diagonal().map(|z| z.re),
        })
    }

    /// What the fit leaves in each run: power of each measured equation per independent
    /// complex line, in units of the pooled residual.
    fn left<L: Lines + ?Sized>(
        &self,
        lines: &L,
        band: &Range<usize>,
        basis: &Basis,
    ) -> [Vector6<f64>; MAX_RUNS] {
        let mut left = [Vector6::zeros(); MAX_RUNS];
        let Some(whitened) = self.regression.whitened(&self.solution) else {
            return left;
        };
        let terms: heapless::Vec<Matrix6<f64>, MAX_TERMS> = (0..basis.terms())
            .map(|t| {
                let m = self.regression.coefficient(&self.solution, t);
                whitened.rows() * m.unwrap_or_else(Matrix6::zeros)
            })
            .collect();
        let runs = lines.runs().min(MAX_RUNS);
        for line in band.clone() {
            let phi = basis.at(lines.frequency(line));
            let mut model = Matrix6::<Complex<f64>>::zeros();
            for (m, phi) in terms.iter().zip(&phi) {
                model += m.map(|x| phi * x);
            }
            for (run, left) in left.iter_mut().enumerate().take(runs) {
                *left += residual(lines, run, line, &whitened, &model);
            }
        }
        for (run, left) in left.iter_mut().enumerate().take(runs) {
            *left /= (lines.equations_per_line(run) * band.len() as f64).max(1.0);
        }
        left
    }

    /// Inverse residual power of each run.
    fn run_weights(&self, left: &[Vector6<f64>; MAX_RUNS], runs: usize) -> [f64; MAX_RUNS] {
        let runs = runs.min(MAX_RUNS);
        let mut weights = [1.0; MAX_RUNS];
        let mean = left
            .iter()
            .take(runs)
            .map(|l| l.sum() / runs as f64)
            .sum::<f64>();
        for (weight, left) in weights.iter_mut().zip(left).take(runs) {
            // A run is never trusted a thousand times more than the average one.
            *weight = mean / left.sum().max(1e-3 * mean).max(f64::MIN_POSITIVE);
        }
        if mean > 0.0 { weights } else { [1.0; MAX_RUNS] }
    }

    /// Variance of the pairs' equations where runs differ in their noise: each pair has
    /// that of the runs which excite its direction, in their shares of its power.
    fn spread<L: Lines + ?Sized>(
        &self,
        lines: &L,
        band: &Range<usize>,
        weights: &[f64; MAX_RUNS],
        left: &[Vector6<f64>; MAX_RUNS],
    ) -> [Vector6<f64>; 6] {
        let mut variance = [Vector6::zeros(); 6];
        let mut total = [0.0; 6];
        let mut mean = Vector6::zeros();
        let mut counted = 0.0;
        for (run, (weight, left)) in weights.iter().zip(left).enumerate().take(lines.runs()) {
            let mut m = Moments::zero();
            for line in band.clone() {
                lines.add_moments(run, line, *weight, &mut m);
            }
            let share = self.regression.powers(&self.solution, &m.aa.map(|z| z.re));
            for ((variance, total), share) in variance.iter_mut().zip(&mut total).zip(share) {
                *variance += left * (share * *weight);
                *total += share;
            }
            let lines_of_run = lines.equations_per_line(run);
            mean += left * (lines_of_run * *weight);
            counted += lines_of_run;
        }
        // In units of the pooled residual, whose degrees of freedom are taken off already.
        for (variance, total) in variance.iter_mut().zip(total) {
            for j in 0..6 {
                let pooled = mean[j] * total;
                variance[j] = if pooled > 0.0 {
                    variance[j] * counted / pooled
                } else {
                    1.0
                };
            }
        }
        variance
    }

    fn finish(
        self,
        poles: heapless::Vec<Pole, MAX_MODES>,
        basis: &Basis,
        reference: Vector3<f64>,
        spread: &[Vector6<f64>; 6],
    ) -> Result<ApparentMass, MasslineError> {
        let mut masslines = self.regression.masslines(&self.solution, reference)?;
        for (pair, spread) in masslines.pairs.iter_mut().zip(spread) {
            pair.variance.component_mul_assign(spread);
        }
        // Of the noise, the pairs hold only what lies along the excited directions.
        let kept = self.excitation.basis() * self.excitation.coordinates();
        masslines.noise = kept * Matrix6::from_diagonal(&self.noise.map(libm::sqrt));
        let coefficient = |t: usize| self.regression.coefficient(&self.solution, t);
        let mut elastic = [None; MAX_MODES];
        for (r, slot) in elastic.iter_mut().enumerate().take(poles.len()) {
            *slot = coefficient(1 + r);
        }
        let measured = self.regression.residual_diagonal(&self.solution);
        let misfit = measured.zip_map(
            &self.power,
            |c, p| {
                if p > 0.0 { libm::sqrt(c / p) } else { 0.0 }
            },
        );
        Ok(ApparentMass {
            masslines,
            elastic,
            upper: coefficient(basis.upper()).map(|m| m / (basis.unit * basis.unit)),
            rigid: coefficient(0).unwrap_or_else(Matrix6::zeros),
            poles,
            excited: self.excitation.rank(),
            weakest_excitation: self.excitation.weakest(),
            misfit,
        })
    }
}

/// Chooses how many modes get a term of their own; those above share the ω² term, which
/// always stays.
///
/// Every term that is kept costs precision, every one that is left out costs bias. The
/// bias of a smaller set is seen in how far its M₀ lies from that of the full set, beyond
/// the scatter that this distance has anyway (the focused information criterion of
/// Claeskens and Hjort). What bias remains in the best set widens its error bars.
fn best(regression: &Regression, basis: &Basis) -> Option<Solution> {
    let mut full: Option<Solution> = None;
    let mut best: Option<(f64, Solution)> = None;
    for modes in (0..=basis.poles.len()).rev() {
        let mut chosen: heapless::Vec<usize, MAX_TERMS> = (0..=modes).collect();
        // `MAX_TERMS` holds every mode and this one.
        let _ = chosen.push(basis.upper());
        let Some(mut solution) = regression.solve(&chosen) else {
            continue;
        };
        let reference = full.get_or_insert_with(|| solution.clone());
        let risk = regression.risk(&mut solution, reference);
        if best.as_ref().is_none_or(|(least, _)| risk < *least) {
            best = Some((risk, solution));
        }
    }
    // Where no mode shows at all, the ω² term has to be worth its cost, too. And three
    // lines of one run do not carry even that: then a plain average is left.
    let plain = regression.solve(&[0]);
    match (best, full, plain) {
        (Some((risk, solution)), Some(reference), Some(mut plain)) if basis.poles.is_empty() => {
            if regression.risk(&mut plain, &reference) < risk {
                Some(plain)
            } else {
                Some(solution)
            }
        }
        (Some((_, solution)), ..) => Some(solution),
        (None, _, plain) => plain,
    }
}

/// Power that `model`, the apparent mass in the rows of `equations`, leaves in each of
/// them for one run at one line.
fn residual<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    equations: &Equations,
    model: &Matrix6<Complex<f64>>,
) -> Vector6<f64> {
    let e = equations.rows();
    if let Some((a, f)) = lines.pair(run, line) {
        let weight = lines.pair_weight(run, line);
        return Vector6::from_fn(|j, _| {
            let mut left = Complex::new(0.0, 0.0);
            for i in 0..6 {
                left += f[i] * e[(j, i)] - model[(j, i)] * a[i];
            }
            left.norm_sqr() * weight
        });
    }
    let mut m = Moments::zero();
    lines.add_moments(run, line, 1.0, &mut m);
    Vector6::from_fn(|j, _| {
        let mut left = 0.0;
        for i in 0..6 {
            let (mut force, mut both) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
            for k in 0..6 {
                let (e, model) = (e[(j, k)], model[(j, k)].conj());
                force += m.ff[(i, k)] * e - m.fa[(i, k)] * model;
                both += m.fa[(k, i)].conj() * e - m.aa[(i, k)] * model;
            }
            left += e[(j, i)] * force.re - (model[(j, i)] * both).re;
        }
        left.max(0.0)
    })
}

//! The averaged spectra as the estimators read them: second moments, line by line.
//!
//! With a drive channel a run gives one pair of amplitudes per line, `a = H_a` and
//! `f = H_f`, weighted with the drive's power; without one it gives the cross-spectral
//! matrix. Both come down to the same three matrices, `Σ a a*`, `Σ f a*` and `Σ f f*`,
//! which is equation (13) before anyone averages over the band.

use super::MasslineError;
use crate::algebra::{incoherent, larger};
use crate::geometry::{RESULTANTS, ResultantMap, ResultantNoise};
use crate::spectra::{Average, BandError, CrossAverage, LineGrid, LineRange, RunResponses, Window};
use nalgebra::{Complex, Matrix6, Vector6};

/// A complex 6 x 6 matrix.
pub(super) type Complex6 = Matrix6<Complex<f64>>;

/// Second moments of accelerations and forces at one line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// `Σ a a*`, Hermitian.
    pub aa: Matrix6<Complex<f64>>,
    /// `Σ f a*`; its adjoint is the paper's G_AF.
    pub fa: Matrix6<Complex<f64>>,
    /// `Σ f f*`, the paper's G_FF, Hermitian.
    pub ff: Matrix6<Complex<f64>>,
}

impl Moments {
    /// Nothing yet.
    pub(crate) fn zero() -> Self {
        Self {
            aa: Complex6::zeros(),
            fa: Complex6::zeros(),
            ff: Complex6::zeros(),
        }
    }

    /// Adds one pair of amplitudes with a weight.
    pub(crate) fn add_pair(
        &mut self,
        a: &Vector6<Complex<f64>>,
        f: &Vector6<Complex<f64>>,
        weight: f64,
    ) {
        self.add_accelerations(a, f, weight);
        for j in 0..6 {
            let fj = f[j].conj() * weight;
            for i in 0..j {
                self.ff[(i, j)] += f[i] * fj;
                self.ff[(j, i)] = self.ff[(i, j)].conj();
            }
            // Powers are real.
            self.ff[(j, j)].re += real_product(f[j], fj);
        }
    }

    /// Adds one pair of amplitudes with a weight, but only the real part of `f f*`: what a
    /// regression needs of it.
    pub(crate) fn add_real_pair(
        &mut self,
        a: &Vector6<Complex<f64>>,
        f: &Vector6<Complex<f64>>,
        weight: f64,
    ) {
        self.add_accelerations(a, f, weight);
        for j in 0..6 {
            let fj = f[j].conj() * weight;
            for i in 0..=j {
                self.ff[(i, j)].re += real_product(f[i], fj);
                self.ff[(j, i)].re = self.ff[(i, j)].re;
            }
        }
    }

    fn add_accelerations(
        &mut self,
        a: &Vector6<Complex<f64>>,
        f: &Vector6<Complex<f64>>,
        weight: f64,
    ) {
        for j in 0..6 {
            let aj = a[j].conj() * weight;
            for i in 0..6 {
                self.fa[(i, j)] += f[i] * aj;
                if i < j {
                    self.aa[(i, j)] += a[i] * aj;
                    self.aa[(j, i)] = self.aa[(i, j)].conj();
                }
            }
            self.aa[(j, j)].re += real_product(a[j], aj);
        }
    }
}

/// Real part of a product, without the other.
fn real_product(x: Complex<f64>, y: Complex<f64>) -> f64 {
    x.re * y.re - x.im * y.im
}

/// Powers of accelerations and forces, by which the excitation is judged: a quarter of the work of
/// [`Moments`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Powers {
    /// `Re Σ a a*`.
    pub aa: Matrix6<f64>,
    /// Diagonal of `Σ f f*`.
    pub ff: Vector6<f64>,
}

impl Powers {
    /// Nothing yet.
    #[must_use]
    pub fn zero() -> Self {
        Self {
            aa: Matrix6::zeros(),
            ff: Vector6::zeros(),
        }
    }

    /// Adds one pair of amplitudes with a weight: to the last bit what
    /// [`Moments::add_pair`] adds to the same numbers.
    pub(crate) fn add_pair(
        &mut self,
        a: &Vector6<Complex<f64>>,
        f: &Vector6<Complex<f64>>,
        weight: f64,
    ) {
        for j in 0..6 {
            let (aj, fj) = (a[j].conj() * weight, f[j].conj() * weight);
            self.ff[j] += real_product(f[j], fj);
            for i in 0..=j {
                self.aa[(i, j)] += real_product(a[i], aj);
                self.aa[(j, i)] = self.aa[(i, j)];
            }
        }
    }
}

/// Real parts of the second moments of accelerations and of forces: what averages of power
/// spectra are judged by, for a third of the work that [`Moments`] take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Squares {
    /// `Re Σ a a*`.
    pub aa: Matrix6<f64>,
    /// `Re Σ f f*`.
    pub ff: Matrix6<f64>,
}

impl Squares {
    /// Nothing yet.
    #[must_use]
    pub fn zero() -> Self {
        Self {
            aa: Matrix6::zeros(),
            ff: Matrix6::zeros(),
        }
    }

    /// Adds one pair of amplitudes with a weight.
    pub(crate) fn add_pair(
        &mut self,
        a: &Vector6<Complex<f64>>,
        f: &Vector6<Complex<f64>>,
        weight: f64,
    ) {
        add_square(&mut self.aa, a, weight);
        add_square(&mut self.ff, f, weight);
    }

    /// Adds `weight` times others.
    pub(crate) fn add(&mut self, other: &Self, weight: f64) {
        add_scaled(&mut self.aa, &other.aa, weight);
        add_scaled(&mut self.ff, &other.ff, weight);
    }
}

/// Adds `Re x x*`, times `weight`.
#[inline(never)] // Once in the flash.
fn add_square(sum: &mut Matrix6<f64>, x: &Vector6<Complex<f64>>, weight: f64) {
    for j in 0..6 {
        let xj = x[j].conj() * weight;
        for i in 0..=j {
            sum[(i, j)] += real_product(x[i], xj);
            sum[(j, i)] = sum[(i, j)];
        }
    }
}

/// Adds `weight` times another matrix: the operator between values would copy it.
pub(super) fn add_scaled(sum: &mut Matrix6<f64>, other: &Matrix6<f64>, weight: f64) {
    for (sum, other) in sum.iter_mut().zip(other) {
        *sum += other * weight;
    }
}

/// Complex amplitudes of acceleration and force at one line.
pub type Amplitudes = (Vector6<Complex<f64>>, Vector6<Complex<f64>>);

/// Averaged spectra of one or more runs that share a reference point, a frame and the
/// equations their load cells complete: [`DriveLines`], [`CrossLines`] and [`super::SineLines`].
pub trait Lines: Internals {
    /// Number of lines.
    fn count(&self) -> usize;
    /// Frequency of a line, Hz, ascending.
    fn frequency(&self, line: usize) -> f64;
    /// Number of runs.
    fn runs(&self) -> usize;
    /// Adds the moments of one run at one line, times `weight`.
    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments);
    /// Covariance of the noise per line that `Σ a a*` and `Σ f f*` of a run contain, mean over
    /// the averaging band, about the reference point.
    fn noise(&self, run: usize) -> ResultantNoise;
}

/// The part of [`Lines`] that only the estimators read; it keeps that trait to the kinds of lines
/// of this crate.
pub trait Internals {
    /// Refuses runs that have too few blocks to tell their noise.
    ///
    /// # Errors
    /// [`MasslineError::TooFewBlocks`].
    fn check(&self) -> Result<(), MasslineError> {
        Ok(())
    }
    /// Independent complex equations that one line of a run holds.
    fn equations_per_line(&self, run: usize) -> f64;
    /// Variance of a mean over lines relative to independent lines and blocks.
    fn correlation(&self) -> f64;
    /// The single pair of amplitudes of a run at a line, if it was referred to a drive.
    fn pair(&self, run: usize, line: usize) -> Option<Amplitudes>;
    /// Factor with which the squares of that pair enter the moments.
    fn pair_weight(&self, _run: usize, _line: usize) -> f64 {
        1.0
    }
}

/// Adds the powers of one run at one line, times `weight`.
pub(super) fn add_powers<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Powers,
) {
    if let Some((a, f)) = lines.pair(run, line) {
        into.add_pair(&a, &f, weight * lines.pair_weight(run, line));
    } else {
        add_powers_of_moments(lines, run, line, weight, into);
    }
}

/// Adds the squares of one run at one line, times `weight`.
pub(super) fn add_squares<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Squares,
) {
    if let Some((a, f)) = lines.pair(run, line) {
        into.add_pair(&a, &f, weight * lines.pair_weight(run, line));
    } else {
        add_squares_of_moments(lines, run, line, weight, into);
    }
}

#[inline(never)] // Moments are on the stack only where they are needed.
fn add_powers_of_moments<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Powers,
) {
    let mut m = Moments::zero();
    lines.add_moments(run, line, weight, &mut m);
    into.aa += m.aa.map(|z| z.re);
    into.ff += m.ff.diagonal().map(|z| z.re);
}

#[inline(never)] // Moments are on the stack only where they are needed.
fn add_squares_of_moments<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Squares,
) {
    let mut m = Moments::zero();
    lines.add_moments(run, line, weight, &mut m);
    into.aa.zip_apply(&m.aa, |sum, z| *sum += z.re);
    into.ff.zip_apply(&m.ff, |sum, z| *sum += z.re);
}

/// The lines of a band (Hz), both ends included: see [`LineRange::among`].
///
/// # Errors
/// [`BandError`] if it is no band, or reaches beyond the lines.
pub fn lines_between<L: Lines + ?Sized>(lines: &L, band: [f64; 2]) -> Result<LineRange, BandError> {
    LineRange::between(lines.count(), |line| lines.frequency(line), band)
}

/// A band's indices, if it was chosen from as many lines as there are.
///
/// # Errors
/// [`MasslineError::OtherLines`].
pub(super) fn indices<L: Lines + ?Sized>(
    lines: &L,
    band: LineRange,
) -> Result<core::ops::Range<usize>, MasslineError> {
    if band.count() != lines.count() {
        return Err(MasslineError::OtherLines {
            band: band.count(),
            lines: lines.count(),
        });
    }
    Ok(band.indices())
}

/// The first two elements a line of lent working memory.
///
/// # Errors
/// [`MasslineError::Work`] if there are fewer.
pub(super) fn two_a_line<'w>(
    lines: &core::ops::Range<usize>,
    work: &'w mut [Complex<f64>],
) -> Result<&'w mut [Complex<f64>], MasslineError> {
    let (needed, given) = (2 * lines.len(), work.len());
    work.get_mut(..needed)
        .ok_or(MasslineError::Work { needed, given })
}

/// Runs referred to their drive signals.
#[derive(Clone, Copy, Debug)]
pub struct DriveLines<'a> {
    runs: &'a [RunResponses<'a>],
    grid: LineGrid,
    correlation: f64,
}

impl<'a> DriveLines<'a> {
    /// Lines of `runs`, which were averaged with `window`. `None` if there is no run,
    /// their grids differ, or one has fewer responses or powers than lines.
    #[must_use]
    pub fn new(runs: &'a [RunResponses<'a>], window: Window) -> Option<Self> {
        let first = runs.first()?;
        let whole = |r: &RunResponses<'_>| {
            let count = r.grid.count;
            r.grid == first.grid && r.responses.len() >= count && r.drive.len() >= count
        };
        runs.iter().all(whole).then(|| Self {
            runs,
            grid: first.grid,
            correlation: window.line_correlation(),
        })
    }
}

fn halves(h: &[crate::spectra::Complex32; RESULTANTS]) -> [Vector6<Complex<f64>>; 2] {
    let wide = |i: usize| Complex::new(f64::from(h[i].re), f64::from(h[i].im));
    [
        Vector6::from_fn(|i, _| wide(i)),
        Vector6::from_fn(|i, _| wide(6 + i)),
    ]
}

impl Lines for DriveLines<'_> {
    fn count(&self) -> usize {
        self.grid.count
    }

    fn frequency(&self, line: usize) -> f64 {
        self.grid.frequency(line)
    }

    fn runs(&self) -> usize {
        self.runs.len()
    }

    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        if let Some((a, f)) = self.pair(run, line) {
            into.add_pair(&a, &f, weight * self.pair_weight(run, line));
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        let run = self.runs.get(run);
        run.map_or(ResultantNoise::NONE, |r| ResultantNoise::unpacked(&r.noise))
    }
}

impl Internals for DriveLines<'_> {
    /// A single block is explained by its drive to the last digit.
    fn check(&self) -> Result<(), MasslineError> {
        match self.runs.iter().map(|r| r.blocks).min() {
            Some(found @ ..2) => Err(MasslineError::TooFewBlocks { needed: 2, found }),
            _ => Ok(()),
        }
    }

    fn equations_per_line(&self, _run: usize) -> f64 {
        1.0
    }

    fn correlation(&self) -> f64 {
        self.correlation
    }

    fn pair(&self, run: usize, line: usize) -> Option<Amplitudes> {
        let [a, f] = halves(self.runs.get(run)?.responses.get(line)?);
        Some((a, f))
    }

    /// The power of the drive.
    fn pair_weight(&self, run: usize, line: usize) -> f64 {
        let drive = self.runs.get(run).and_then(|r| r.drive.get(line));
        drive.copied().map_or(0.0, f64::from)
    }
}

/// Runs without a drive: their cross-spectral matrices.
#[derive(Debug)]
pub struct CrossLines<'a, 's> {
    runs: &'a [CrossAverage<'s>],
    grid: LineGrid,
    noise: heapless::Vec<ResultantNoise, MAX_RUNS>,
    /// `true` if the noise was stated by the caller, so that blocks need not tell it.
    stated: bool,
    line_correlation: f64,
    block_correlation: f64,
}

/// Most runs that are read together, since what each leaves of the fit is kept beside it.
pub(crate) const MAX_RUNS: usize = 24;

impl<'a, 's> CrossLines<'a, 's> {
    /// Lines of finished cross-spectral averages. `band` are the kept lines over which
    /// the noise is taken, `hop` is the blocks' hop over their length, `maps` made the
    /// resultants of each run.
    ///
    /// # Errors
    /// [`MasslineError::TooManyRuns`], [`MasslineError::TooFewRuns`] without a run or with
    /// fewer maps than runs, [`MasslineError::OtherLines`] for a band of other lines.
    pub fn new(
        runs: &'a [CrossAverage<'s>],
        grid: LineGrid,
        band: LineRange,
        window: Window,
        hop: f64,
        maps: &[ResultantMap],
    ) -> Result<Self, MasslineError> {
        let (needed, found) = (runs.len().max(1), maps.len().min(runs.len()));
        if found < needed {
            return Err(MasslineError::TooFewRuns { needed, found });
        }
        if band.count() != grid.count {
            return Err(MasslineError::OtherLines {
                band: band.count(),
                lines: grid.count,
            });
        }
        let mut lines = Self {
            runs,
            grid,
            noise: heapless::Vec::new(),
            stated: false,
            line_correlation: window.line_correlation(),
            block_correlation: window.block_correlation(hop),
        };
        for (run, map) in maps.iter().enumerate().take(needed) {
            let noise = lines.incoherent(run, band, map);
            lines
                .noise
                .push(noise)
                .map_err(|_| MasslineError::TooManyRuns {
                    limit: MAX_RUNS,
                    found: runs.len(),
                })?;
        }
        Ok(lines)
    }

    /// The same lines with the stated noise of each run, as [`Lines::noise`] has it, where a run
    /// has too few blocks to tell its own and the noise of every run is stated.
    #[must_use]
    pub fn or_stated(mut self, noise: &[ResultantNoise]) -> Self {
        if self.check().is_err() && noise.len() == self.noise.len() {
            self.noise.copy_from_slice(noise);
            self.stated = true;
        }
        self
    }

    /// Independent blocks that were averaged in a run.
    fn independent_blocks(&self, run: usize) -> f64 {
        let blocks = self.runs.get(run).map_or(0, CrossAverage::blocks);
        f64::from(blocks) / self.block_correlation
    }

    /// Accelerations that the forces do not explain, and the other way round:
    /// an upper bound of the sensors' noise, as the noise of both sides is in it.
    fn incoherent(&self, run: usize, band: LineRange, map: &ResultantMap) -> ResultantNoise {
        let mut power = [0.0; RESULTANTS];
        let mut noise = [0.0; RESULTANTS];
        let blocks = self.independent_blocks(run);
        // Six explaining channels take six degrees of freedom. `check` has refused fewer.
        let freedom = blocks / (blocks - EXPLAINING).max(1.0);
        let lines = band.len().max(1) as f64;
        for line in band {
            let mut m = Moments::zero();
            self.add_moments(run, line, 1.0, &mut m);
            let of_accelerations = incoherent(&m.ff, &m.fa.adjoint(), &m.aa);
            let of_forces = incoherent(&m.aa, &m.fa, &m.ff);
            for j in 0..6 {
                power[j] += m.aa[(j, j)].re / lines;
                power[6 + j] += m.ff[(j, j)].re / lines;
                noise[j] += of_accelerations[(j, j)] * freedom / lines;
                noise[6 + j] += of_forces[(j, j)] * freedom / lines;
            }
        }
        let rounding = map.rounding_power(&power);
        map.noise(&core::array::from_fn(|j| larger(noise[j], rounding[j])))
    }
}

/// Channels that explain the others where there is no drive.
const EXPLAINING: f64 = 6.0;

impl Lines for CrossLines<'_, '_> {
    fn count(&self) -> usize {
        self.grid.count
    }

    fn frequency(&self, line: usize) -> f64 {
        self.grid.frequency(line)
    }

    fn runs(&self) -> usize {
        self.runs.len()
    }

    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
        let Some(average) = self.runs.get(run) else {
            return;
        };
        let value = |i: usize, j: usize| {
            let (re, im) = average.cross(i, j, line);
            Complex::new(re, im) * weight
        };
        for j in 0..6 {
            for i in 0..6 {
                into.aa[(i, j)] += value(i, j);
                into.fa[(i, j)] += value(6 + i, j);
                into.ff[(i, j)] += value(6 + i, 6 + j);
            }
        }
    }

    fn noise(&self, run: usize) -> ResultantNoise {
        self.noise.get(run).copied().unwrap_or(ResultantNoise::NONE)
    }
}

impl Internals for CrossLines<'_, '_> {
    /// Six channels explain all of six others in as many blocks. One independent block more
    /// tells the noise at some tens of lines together.
    fn check(&self) -> Result<(), MasslineError> {
        if self.stated {
            return Ok(());
        }
        let needed = EXPLAINING + 1.0;
        for run in 0..self.runs.len() {
            if self.independent_blocks(run) < needed {
                return Err(MasslineError::TooFewBlocks {
                    needed: libm::ceil(needed * self.block_correlation) as u32,
                    found: self.runs.get(run).map_or(0, CrossAverage::blocks),
                });
            }
        }
        Ok(())
    }

    fn equations_per_line(&self, run: usize) -> f64 {
        self.runs
            .get(run)
            .map_or(0.0, |r| f64::from(r.blocks()) / self.block_correlation)
    }

    fn correlation(&self) -> f64 {
        self.line_correlation * self.block_correlation
    }

    fn pair(&self, _run: usize, _line: usize) -> Option<Amplitudes> {
        None
    }
}

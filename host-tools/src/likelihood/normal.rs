//! Misfit, gradient and information of a model, record by record and line by line.
//!
//! With C = Cf + M Ca M* = G G* and ε = G⁻¹ (F - M A - T) the misfit is V = Σ |ε|²: minus the
//! logarithm of the likelihood after the base accelerations are eliminated. Their most likely
//! values are Ã = A + Ca M* G⁻* ε, and with J = G⁻¹ (∂M/∂θ Ã + ∂T/∂θ) the gradient of V is exactly
//! -2 Re J* ε. The leakage T is linear in coefficients of each record, which are eliminated by a
//! Schur complement.

use super::complex::{
    adjoint_times, inverse_factor, lower_times, real_times, times_real, upper_adjoint_times,
};
use super::model::{
    self, FittedMode, Model, OF_MODE, RIGID, Resonance, SYMMETRIC, Slopes, rest_of, rigid_columns,
};
use super::record::{Complex6, Record};
use nalgebra::{Complex, DMatrix, DVector, Matrix6, Vector6};
use pulp::{Arch, Simd, WithSimd};

type C = Complex<f64>;

/// Terms (jω)ⁿ of the leakage of each resultant, n from zero.
const POLYNOMIAL: usize = 4;
/// Modes up to this share of a record's highest line have leakage terms of their own.
const LEAKING: f64 = 3.0;
/// Stretches of frequency that each record's score is summed over.
pub(super) const STRETCHES: usize = 20;

/// Real rows of a complex equation: 12 for six resultants.
const ROWS: usize = 12;

/// Sums over the lines of one record; `leakage` is eliminated.
pub(super) struct Sums {
    /// V.
    pub(super) misfit: f64,
    /// Σ Re J* J over the parameters of the record.
    pub(super) information: DMatrix<f64>,
    /// Σ Re J* ε.
    pub(super) score: DVector<f64>,
    /// The score by stretches of frequency.
    pub(super) stretches: Vec<DVector<f64>>,
    /// |ε|² of each line.
    pub(super) residuals: Vec<f64>,
}

/// Degree of detail of the sums.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Detail {
    /// Gradient and information.
    Step,
    /// The score by stretches and the residuals of each line as well.
    Test,
}

/// Number of the parameters that one record depends on.
fn local(model: &Model) -> usize {
    model.shared()
}

/// Modes with leakage terms in a record.
fn leaking(record: &Record, model: &Model) -> Vec<usize> {
    let highest = record.frequencies.last().copied().unwrap_or(0.0) * LEAKING;
    let modes = model.modes.iter().enumerate();
    let near = modes.filter(|(_, mode)| mode.frequency() <= highest);
    near.map(|(r, _)| r).collect()
}

/// Number of leakage coefficients of a record.
pub(super) fn leakage_terms(record: &Record, model: &Model) -> usize {
    2 * leaking(record, model).len() + POLYNOMIAL * record.equation_count()
}

/// V of one record, and the coefficients of leakage that make it least.
pub(super) struct Leaked {
    pub(super) misfit: f64,
    coefficients: Vec<f64>,
}

/// V and leakage of one record at a model; `None` where numbers are not finite.
pub(super) fn misfit(record: &Record, model: &Model, leak: bool) -> Option<Leaked> {
    let evaluation = Evaluation::new(record, model, leak);
    Arch::new().dispatch(Leakage(&evaluation))
}

/// Sums of one record at a model, with its V and leakage; `None` where numbers are not finite.
pub(super) fn sums(
    record: &Record,
    model: &Model,
    detail: Detail,
    leak: bool,
    leaked: &Leaked,
) -> Option<Sums> {
    let evaluation = Evaluation::new(record, model, leak);
    Arch::new().dispatch(AllSums(&evaluation, detail, leaked))
}

/// Passes over the lines, compiled for the widest lanes that the processor has. Products are rounded
/// before they are added, so that all processors give the same bits.
struct Leakage<'a>(&'a Evaluation<'a>);

impl WithSimd for Leakage<'_> {
    type Output = Option<Leaked>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        self.0.leakage()
    }
}

struct AllSums<'a>(&'a Evaluation<'a>, Detail, &'a Leaked);

impl WithSimd for AllSums<'_> {
    type Output = Option<Sums>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        all_sums(self.0, self.1, self.2)
    }
}

#[inline(always)]
fn all_sums(evaluation: &Evaluation<'_>, detail: Detail, leaked: &Leaked) -> Option<Sums> {
    let lines = evaluation.record.frequencies.len();
    let mut sums = Sums {
        misfit: leaked.misfit,
        information: DMatrix::zeros(0, 0),
        score: DVector::zeros(0),
        stretches: Vec::new(),
        residuals: Vec::new(),
    };
    let (p, t) = (local(evaluation.model), evaluation.columns);
    let width = p + t + 1;
    let mut square = Square::new(width);
    let mut parts = vec![vec![0.0; width]; if detail == Detail::Test { STRETCHES } else { 0 }];
    let mut rows = square.rows();
    for k in 0..lines {
        let size = evaluation.rows(k, &leaked.coefficients, &mut rows)?;
        square.add(&rows);
        if detail == Detail::Test {
            sums.residuals.push(size);
            let part = &mut parts[(k * STRETCHES / lines.max(1)).min(STRETCHES - 1)];
            for row in rows.values.chunks_exact(rows.length) {
                let e = row[width - 1];
                for (sum, x) in part.iter_mut().zip(row) {
                    *sum += x * e;
                }
            }
        }
    }
    let full = square.symmetric();
    let mut information = full.view((0, 0), (p, p)).into_owned();
    let mut score: DVector<f64> = full.view((0, p + t), (p, 1)).column(0).into_owned();
    let mut eliminate = DMatrix::zeros(p, 0);
    if t > 0 {
        let own = full.view((p, p), (t, t)).into_owned();
        let cross = full.view((0, p), (p, t)).into_owned();
        let rest: DVector<f64> = full.view((p, p + t), (t, 1)).column(0).into_owned();
        let solved = solve_symmetric(own, &cross.transpose())?;
        information -= &cross * &solved;
        score -= solved.transpose() * rest;
        eliminate = solved.transpose();
    }
    sums.stretches = parts
        .iter()
        .map(|part| {
            let mut score = DVector::from_column_slice(&part[..p]);
            if t > 0 {
                score -= &eliminate * DVector::from_column_slice(&part[p..p + t]);
            }
            score
        })
        .collect();
    sums.information = information;
    sums.score = score;
    Some(sums)
}

/// Scales a matrix to a diagonal of ones, rows and columns alike. Gives the scales; zero where the
/// diagonal is.
pub(super) fn to_unit_diagonal(matrix: &mut DMatrix<f64>) -> DVector<f64> {
    let n = matrix.nrows();
    let scale = DVector::from_fn(n, |i, _| {
        let d = matrix[(i, i)];
        if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
    });
    for j in 0..n {
        for i in 0..n {
            matrix[(i, j)] *= scale[i] * scale[j];
        }
    }
    scale
}

/// Solution of `matrix X = right` for a positive semidefinite matrix, columns scaled alike;
/// `None` where numbers are not finite.
pub(super) fn solve_symmetric(
    mut matrix: DMatrix<f64>,
    right: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let scale = to_unit_diagonal(&mut matrix);
    let mut scaled = right.clone();
    for j in 0..scaled.ncols() {
        for i in 0..n {
            scaled[(i, j)] *= scale[i];
        }
    }
    // What rounding leaves of columns that depend on others, from little to much.
    let factor = [1e-12, 1e-11, 1e-10, 1e-9, 1e-8]
        .into_iter()
        .find_map(|ridge| {
            let mut raised = matrix.clone();
            for j in 0..n {
                raised[(j, j)] += ridge;
            }
            raised.cholesky()
        });
    let mut solved = factor?.solve(&scaled);
    for j in 0..solved.ncols() {
        for i in 0..n {
            solved[(i, j)] *= scale[i];
        }
    }
    solved.iter().all(|x| x.is_finite()).then_some(solved)
}

/// Numbers that processors work on at a time, at most.
const LANES: usize = 4;

/// Sum of products of rows: its upper triangle, row after row.
struct Square {
    width: usize,
    /// The next multiple of [`LANES`]: length of a row.
    padded: usize,
    sums: Vec<f64>,
}

impl Square {
    fn new(width: usize) -> Self {
        let padded = width.next_multiple_of(LANES);
        Self {
            width,
            padded,
            sums: vec![0.0; width * padded],
        }
    }

    /// Zeros in place of the rows of a line.
    fn rows(&self) -> Rows {
        Rows {
            length: self.padded,
            values: vec![0.0; ROWS * self.padded],
        }
    }

    /// Adds the products of the rows of a line.
    #[inline(always)]
    fn add(&mut self, rows: &Rows) {
        let n = self.padded;
        let mut of_line: [&[f64]; ROWS] = [&[]; ROWS];
        for (row, of) in of_line.iter_mut().zip(rows.values.chunks_exact(n)) {
            *row = of;
        }
        for (i, sums) in self.sums.chunks_exact_mut(n).enumerate() {
            let mut f = [0.0; ROWS];
            let mut bits = 0;
            for (f, row) in f.iter_mut().zip(of_line) {
                *f = row[i];
                bits |= f.to_bits();
            }
            // Zero, of either sign.
            if bits << 1 == 0 {
                continue;
            }
            // Whole lanes, from below the diagonal if need be.
            let sums = &mut sums[i / LANES * LANES..];
            let mut x = of_line;
            for row in &mut x {
                *row = &row[i / LANES * LANES..][..sums.len()];
            }
            for (j, sum) in sums.iter_mut().enumerate() {
                // One addition after the other would wait for each.
                let four = |q: usize| {
                    (f[q] * x[q][j] + f[q + 1] * x[q + 1][j])
                        + (f[q + 2] * x[q + 2][j] + f[q + 3] * x[q + 3][j])
                };
                *sum += (four(0) + four(4)) + four(8);
            }
        }
    }

    fn symmetric(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.width, self.width, |i, j| {
            self.sums[i.min(j) * self.padded + i.max(j)]
        })
    }
}

/// Rows of a line: real parts before imaginary ones.
struct Rows {
    length: usize,
    values: Vec<f64>,
}

impl Rows {
    /// Puts a complex column into them.
    #[inline(always)]
    fn put(&mut self, at: usize, column: &Complex6) {
        for (i, x) in column.iter().enumerate() {
            self.values[i * self.length + at] = x.re;
            self.values[(i + 6) * self.length + at] = x.im;
        }
    }
}

/// A mode as one record sees it.
struct Seen<'a> {
    mode: &'a FittedMode,
    frequency: f64,
    damping: f64,
    /// Participations in the equations that are measured.
    measured: Vector6<f64>,
}

/// A model beside the lines of a record.
struct Evaluation<'a> {
    record: &'a Record,
    model: &'a Model,
    complete: bool,
    modes: Vec<Seen<'a>>,
    rigid: Matrix6<f64>,
    upper: Matrix6<f64>,
    /// Noise of the measured combinations of resultants; one where nothing is measured.
    force_noise: Matrix6<f64>,
    measured: [bool; 6],
    leaking: Vec<usize>,
    /// Coefficients of leakage.
    columns: usize,
    highest: f64,
}

/// One line: whitening and residual without leakage.
struct Line {
    /// G⁻¹, lower triangular.
    whitener: Matrix6<C>,
    /// M in the equations that are measured.
    mass: Matrix6<C>,
    /// G⁻¹ (F - M A).
    residual: Complex6,
    resonances: Vec<Resonance>,
}

impl<'a> Evaluation<'a> {
    fn new(record: &'a Record, model: &'a Model, leak: bool) -> Self {
        let rows = &record.equations;
        let measured: [bool; 6] = core::array::from_fn(|i| rows.row(i).norm_squared() > 0.0);
        let mut force_noise = rows * record.noise.force * rows.transpose();
        for (i, seen) in measured.iter().enumerate() {
            if !seen {
                force_noise[(i, i)] = 1.0;
            }
        }
        let modes = (0..model.modes.len()).map(|r| {
            let (frequency, damping) = model.mode_in(record.run, r);
            let mode = &model.modes[r];
            Seen {
                mode,
                frequency,
                damping,
                measured: rows * mode.participation,
            }
        });
        let leaking = if leak {
            leaking(record, model)
        } else {
            Vec::new()
        };
        let count = measured.iter().filter(|seen| **seen).count();
        Self {
            record,
            model,
            complete: *rows == Matrix6::identity(),
            modes: modes.collect(),
            rigid: rows * model.rigid_matrix(),
            upper: rows * model.upper_matrix(),
            force_noise,
            measured,
            columns: if leak {
                2 * leaking.len() + POLYNOMIAL * count
            } else {
                0
            },
            leaking,
            highest: record.frequencies.last().copied().unwrap_or(1.0),
        }
    }

    #[inline(always)]
    fn line(&self, k: usize) -> Option<Line> {
        let frequency = self.record.frequencies[k];
        let ratio = frequency / self.model.unit;
        let mut mass = (self.rigid + self.upper * rest_of(ratio)).map(Complex::from);
        let mut resonances = Vec::with_capacity(self.modes.len());
        for seen in &self.modes {
            let exponent = seen.mode.exponent;
            let resonance = Resonance::new(frequency / seen.frequency, seen.damping, exponent);
            let d = resonance.response();
            for j in 0..6 {
                let scaled = d * seen.mode.participation[j];
                for i in 0..6 {
                    mass[(i, j)] += scaled * seen.measured[i];
                }
            }
            resonances.push(resonance);
        }
        let spread = times_real(&mass, &self.record.noise.base);
        let level = self.record.level(k);
        let mut covariance = self.force_noise.map(Complex::from);
        for j in 0..6 {
            for i in j..6 {
                let mut sum = covariance[(i, j)];
                for l in 0..6 {
                    sum += spread[(i, l)] * mass[(j, l)].conj();
                }
                covariance[(i, j)] = sum * level;
            }
        }
        let whitener = inverse_factor(&covariance)?;
        let force = &self.record.force[k];
        let force = if self.complete {
            *force
        } else {
            real_times(&self.record.equations, force)
        };
        let residual = lower_times(&whitener, &(force - mass * self.record.base[k]));
        Some(Line {
            whitener,
            mass,
            residual,
            resonances,
        })
    }

    /// Calls `column` with each leakage column of a line, whitened.
    #[inline(always)]
    fn leakage_columns(&self, k: usize, line: &Line, mut column: impl FnMut(usize, &Complex6)) {
        if self.columns == 0 {
            return;
        }
        let mut at = 0;
        for &r in &self.leaking {
            let shape = lower_times(&line.whitener, &self.modes[r].measured.map(Complex::from));
            for function in line.resonances[r].leakage() {
                column(at, &(shape * function));
                at += 1;
            }
        }
        let step = Complex::new(0.0, self.record.frequencies[k] / self.highest);
        let mut power = Complex::from(1.0);
        for _ in 0..POLYNOMIAL {
            for i in (0..6).filter(|&i| self.measured[i]) {
                let unit: Complex6 = line.whitener.column(i).into();
                column(at, &(unit * power));
                at += 1;
            }
            power *= step;
        }
    }

    #[inline(always)]
    fn leakage(&self) -> Option<Leaked> {
        let width = self.columns + 1;
        let mut square = Square::new(width);
        let mut rows = square.rows();
        for k in 0..self.record.frequencies.len() {
            let line = self.line(k)?;
            self.leakage_columns(k, &line, |at, column| rows.put(at, column));
            rows.put(self.columns, &line.residual);
            square.add(&rows);
        }
        let full = square.symmetric();
        let t = self.columns;
        let misfit = full[(t, t)];
        if t == 0 {
            return misfit.is_finite().then(|| Leaked {
                misfit,
                coefficients: Vec::new(),
            });
        }
        let own = full.view((0, 0), (t, t)).into_owned();
        let right = full.view((0, t), (t, 1)).into_owned();
        let solved = solve_symmetric(own, &right)?;
        let explained = (right.transpose() * &solved)[(0, 0)];
        let misfit = misfit - explained;
        misfit.is_finite().then(|| Leaked {
            misfit,
            coefficients: solved.column(0).iter().copied().collect(),
        })
    }

    /// Rows of J, of the leakage columns and ε of a line, whitened, real parts before imaginary
    /// ones. Gives |ε|².
    #[inline(always)]
    fn rows(&self, k: usize, coefficients: &[f64], rows: &mut Rows) -> Option<f64> {
        let line = self.line(k)?;
        let p = local(self.model);
        let width = p + self.columns + 1;
        let mut epsilon = line.residual;
        self.leakage_columns(k, &line, |at, column| {
            epsilon -= column * Complex::from(coefficients[at]);
            rows.put(p + at, column);
        });
        // Ã = A + level Ca M* G⁻* ε.
        let back = adjoint_times(&line.mass, &upper_adjoint_times(&line.whitener, &epsilon));
        let level = self.record.level(k);
        let pull = real_times(&self.record.noise.base, &back) * Complex::from(level);
        let base = self.record.base[k] + pull;

        for (j, column) in rigid_columns(&base).iter().enumerate() {
            rows.put(j, &self.whitened(&line, column));
        }
        for (r, seen) in self.modes.iter().enumerate() {
            let resonance = &line.resonances[r];
            let l = &seen.mode.participation;
            let drive: C = l.iter().zip(base.iter()).map(|(l, a)| a * *l).sum();
            let shape = lower_times(&line.whitener, &seen.measured.map(Complex::from));
            let d = resonance.response();
            let (leaked, leaked_slopes) = self.leaked(r, resonance, coefficients);
            let slopes = resonance.response_slopes();
            let at = RIGID + OF_MODE * r;
            let of = |s: usize| shape * (slopes[s] * drive + leaked_slopes[s]);
            rows.put(at, &of(0));
            rows.put(at + 1, &of(1));
            rows.put(at + 8, &of(2));
            let through = d * drive + leaked;
            for j in 0..6 {
                // Of L (L·a) D and of L times leakage.
                let own: Complex6 = if self.complete {
                    line.whitener.column(j).into()
                } else {
                    let unit = Vector6::from_fn(|i, _| self.record.equations[(i, j)]);
                    lower_times(&line.whitener, &unit.map(Complex::from))
                };
                let column = own * through + shape * (d * base[j]);
                rows.put(at + 2 + j, &column);
            }
        }
        if self.model.upper.is_some() {
            let ratio = self.record.frequencies[k] / self.model.unit;
            let square = Complex::from(rest_of(ratio));
            let first = p - SYMMETRIC;
            for (at, (i, j)) in model::triangle().enumerate() {
                let mut force = Complex6::zeros();
                force[i] += base[j];
                if i != j {
                    force[j] += base[i];
                }
                rows.put(first + at, &self.whitened(&line, &(force * square)));
            }
        }
        rows.put(width - 1, &epsilon);
        let size = epsilon.norm_squared();
        size.is_finite().then_some(size)
    }

    #[inline(always)]
    fn whitened(&self, line: &Line, force: &Complex6) -> Complex6 {
        if self.complete {
            lower_times(&line.whitener, force)
        } else {
            lower_times(&line.whitener, &real_times(&self.record.equations, force))
        }
    }

    /// Leakage of a mode at a line, per participation, and its slopes.
    #[inline(always)]
    fn leaked(&self, r: usize, resonance: &Resonance, coefficients: &[f64]) -> (C, Slopes) {
        match self.leaking.iter().position(|&l| l == r) {
            Some(at) => resonance.leaked([coefficients[2 * at], coefficients[2 * at + 1]]),
            None => (Complex::new(0.0, 0.0), [Complex::new(0.0, 0.0); 3]),
        }
    }
}

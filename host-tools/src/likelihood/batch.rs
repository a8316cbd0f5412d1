//! Neighbouring lines beside a model: apparent mass, noise of its residual, residual without leakage.

use super::lanes::{BATCH, Lane, Pair, PairRow, Row, six, steps};
use super::model::{FittedMode, Model, rest_of};
use super::record::Record;
use super::resonances::Resonances;
use nalgebra::{Matrix6, Vector6};
use pulp::Simd;

/// Terms (jω)ⁿ of the leakage of each resultant, n from zero.
pub(super) const POLYNOMIAL: usize = 4;
/// Powers of ω that sums over leakage need.
const POWERS: usize = 2 * POLYNOMIAL - 1;
/// Elements of a Hermitian 6 x 6 matrix.
const LOWER: usize = 21;

/// Place of an element on or below the diagonal.
#[inline(always)]
const fn lower(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// A Hermitian matrix, or a symmetric one, for each line of a batch.
#[derive(Clone)]
pub(super) struct Square(pub(super) [PairRow; LOWER]);

impl Square {
    /// An element of the Hermitian matrix.
    #[inline(always)]
    pub(super) fn hermitian<S: Simd>(&self, simd: S, n: usize, i: usize, j: usize) -> Pair<S> {
        if i >= j {
            self.0[lower(i, j)].get(simd, n)
        } else {
            self.0[lower(j, i)].get(simd, n).conj()
        }
    }

    /// An element of the symmetric matrix.
    #[inline(always)]
    pub(super) fn symmetric<S: Simd>(&self, simd: S, n: usize, i: usize, j: usize) -> Pair<S> {
        self.0[lower(i.max(j), i.min(j))].get(simd, n)
    }

    /// The product of the Hermitian matrix and a vector.
    #[inline(always)]
    pub(super) fn times<S: Simd>(&self, simd: S, n: usize, x: &[Pair<S>; 6]) -> [Pair<S>; 6] {
        let mut product = [Pair::zero(simd); 6];
        for (i, sum) in product.iter_mut().enumerate() {
            for (j, x) in x.iter().enumerate() {
                *sum += self.hermitian(simd, n, i, j) * *x;
            }
        }
        product
    }
}

/// A mode as one record sees it.
pub(super) struct Seen<'a> {
    pub(super) mode: &'a FittedMode,
    frequency: f64,
    damping: f64,
    /// Participations in the equations that are measured.
    pub(super) measured: Vector6<f64>,
}

/// A model beside the lines of a record.
pub(super) struct Evaluation<'a> {
    pub(super) record: &'a Record,
    pub(super) model: &'a Model,
    /// `true` if all six equations are measured, each for itself.
    pub(super) complete: bool,
    pub(super) modes: Vec<Seen<'a>>,
    rigid: Matrix6<f64>,
    upper: Matrix6<f64>,
    pub(super) measured: [bool; 6],
    /// Modes with leakage terms.
    pub(super) leaking: Vec<usize>,
    /// Coefficients of leakage.
    pub(super) columns: usize,
    highest: f64,
}

impl<'a> Evaluation<'a> {
    pub(super) fn new(record: &'a Record, model: &'a Model, leaking: Option<Vec<usize>>) -> Self {
        let rows = &record.equations;
        let measured: [bool; 6] = core::array::from_fn(|i| rows.row(i).norm_squared() > 0.0);
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
        let count = measured.iter().filter(|seen| **seen).count();
        Self {
            record,
            model,
            complete: *rows == Matrix6::identity(),
            modes: modes.collect(),
            rigid: model.rigid_matrix(),
            upper: model.upper_matrix(),
            measured,
            columns: leaking
                .as_ref()
                .map_or(0, |l| 2 * l.len() + POLYNOMIAL * count),
            leaking: leaking.unwrap_or_default(),
            highest: record.frequencies.last().copied().unwrap_or(1.0),
        }
    }

    /// ω/ω_r over the share of the highest line.
    pub(super) fn stretch(&self, r: usize) -> f64 {
        self.highest / self.modes[r].frequency
    }
}

/// Lines side by side. Where there are fewer than a batch has room for, the last is repeated, and weighs nothing.
pub(super) struct Batch {
    /// Lines.
    pub(super) lines: usize,
    /// 1 for each line, 0 for what is repeated.
    weight: Row,
    /// Powers of the share of the highest line, from zero.
    pub(super) powers: [Row; POWERS],
    pub(super) level: Row,
    /// Response of modes beyond the lines per E.
    pub(super) rest: Row,
    pub(super) base: [PairRow; 6],
    force: [PairRow; 6],
    /// F - M A, of all six resultants.
    pub(super) residual: [PairRow; 6],
    /// M.
    pub(super) mass: Square,
    /// C⁻¹ in the equations that are measured.
    pub(super) inverse: Square,
    /// C⁻¹ (F - M A) in the equations that are measured.
    pub(super) pull: [PairRow; 6],
    /// |G⁻¹ (F - M A)|².
    pub(super) misfit: Row,
    pub(super) resonances: Vec<Resonances>,
    /// Squares of the diagonal of G.
    pivots: [Row; 6],
}

impl Batch {
    pub(super) fn new(modes: usize) -> Box<Self> {
        Box::new(Self {
            lines: 0,
            weight: Row::ZERO,
            powers: [Row::ZERO; POWERS],
            level: Row::ZERO,
            rest: Row::ZERO,
            base: [PairRow::ZERO; 6],
            force: [PairRow::ZERO; 6],
            residual: [PairRow::ZERO; 6],
            mass: Square([PairRow::ZERO; LOWER]),
            inverse: Square([PairRow::ZERO; LOWER]),
            pull: [PairRow::ZERO; 6],
            misfit: Row::ZERO,
            resonances: vec![Resonances::ZERO; modes],
            pivots: [Row::ZERO; 6],
        })
    }

    /// Lines `first` to `end` of a record; `None` where their noise is not positive definite.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        evaluation: &Evaluation<'_>,
        first: usize,
        end: usize,
    ) -> Option<()> {
        self.lines = end - first;
        let record = evaluation.record;
        for at in 0..BATCH {
            let k = (first + at).min(end - 1);
            let frequency = record.frequencies[k];
            self.weight.0[at] = f64::from(u8::from(at < self.lines));
            self.level.0[at] = record.level(k);
            self.rest.0[at] = rest_of(frequency / evaluation.model.unit);
            let share = frequency / evaluation.highest;
            let mut power = 1.0;
            for row in &mut self.powers {
                row.0[at] = power;
                power *= share;
            }
            for i in 0..6 {
                self.base[i].put(at, record.base[k][i]);
                self.force[i].put(at, record.force[k][i]);
            }
            for (seen, resonances) in evaluation.modes.iter().zip(&mut self.resonances) {
                let x = frequency / seen.frequency;
                resonances.put(at, x, seen.damping, seen.mode.exponent);
            }
        }
        for n in 0..steps::<S>() {
            self.work_out(simd, n, evaluation);
        }
        let positive = |row: &Row| row.0.iter().all(|d| *d > 0.0);
        self.pivots.iter().all(positive).then_some(())
    }

    #[expect(
        clippy::needless_range_loop,
        reason = "rows and columns as in formulas"
    )]
    #[inline(always)]
    fn work_out<S: Simd>(&mut self, simd: S, n: usize, evaluation: &Evaluation<'_>) {
        let zero = Pair::zero(simd);
        let rest = self.rest.get(simd, n);
        let mut mass = [[zero; 6]; 6];
        for i in 0..6 {
            for j in 0..=i {
                mass[i][j] = Pair::real(simd, evaluation.rigid[(i, j)]);
                mass[i][j].re += rest * evaluation.upper[(i, j)];
            }
        }
        for (seen, resonances) in evaluation.modes.iter().zip(&mut self.resonances) {
            resonances.invert(simd, n);
            let d = resonances.response(simd, n);
            let l = &seen.mode.participation;
            for i in 0..6 {
                let scaled = d * l[i];
                for j in 0..=i {
                    mass[i][j] += scaled * l[j];
                }
            }
        }
        for i in 0..6 {
            for j in 0..=i {
                self.mass.0[lower(i, j)].set(n, mass[i][j]);
                mass[j][i] = mass[i][j];
            }
        }
        let base: [Pair<S>; 6] = six(
            zero,
            #[inline(always)]
            |i| self.base[i].get(simd, n),
        );
        let mut residual: [Pair<S>; 6] = six(
            zero,
            #[inline(always)]
            |i| self.force[i].get(simd, n),
        );
        for i in 0..6 {
            for j in 0..6 {
                residual[i] -= mass[i][j] * base[j];
            }
            self.residual[i].set(n, residual[i]);
        }
        let noise = &evaluation.record.noise;
        let mut covariance = [[zero; 6]; 6];
        for i in 0..6 {
            let mut spread = [zero; 6];
            for (l, spread) in spread.iter_mut().enumerate() {
                for k in 0..6 {
                    *spread += mass[i][k] * noise.base[(k, l)];
                }
            }
            for j in 0..=i {
                let mut sum = Pair::real(simd, noise.force[(i, j)]);
                for l in 0..6 {
                    sum += spread[l] * mass[j][l].conj();
                }
                covariance[i][j] = sum;
            }
        }
        if !evaluation.complete {
            let rows = &evaluation.record.equations;
            covariance = measured(simd, rows, &covariance);
            for (i, seen) in evaluation.measured.iter().enumerate() {
                if !seen {
                    covariance[i][i] = Pair::real(simd, 1.0);
                }
            }
            residual = turned(simd, rows, &residual);
        }
        let level = self.level.get(simd, n);
        for of in &mut covariance {
            for x in of {
                *x = *x * level;
            }
        }
        let (factor, pivots) = inverse_factor(simd, &covariance);
        for (row, pivot) in self.pivots.iter_mut().zip(pivots) {
            row.set(n, pivot);
        }
        let weight = self.weight.get(simd, n);
        let mut whitened = [zero; 6];
        let mut misfit = Lane::all(simd, 0.0);
        for i in 0..6 {
            for j in 0..=i {
                whitened[i] += factor[i][j] * residual[j];
            }
            misfit += whitened[i].square();
        }
        self.misfit.set(n, misfit * weight);
        for j in 0..6 {
            let mut pull = zero;
            for i in j..6 {
                pull += factor[i][j].conj() * whitened[i];
            }
            self.pull[j].set(n, pull * weight);
            for l in 0..=j {
                let mut sum = zero;
                for i in j..6 {
                    sum += factor[i][j].conj() * factor[i][l];
                }
                self.inverse.0[lower(j, l)].set(n, sum * weight);
            }
        }
    }

    /// Takes the inverse from the equations that are measured to the six resultants.
    #[inline(always)]
    pub(super) fn spread_inverse<S: Simd>(&mut self, simd: S, rows: &Matrix6<f64>) {
        let back = rows.transpose();
        for n in 0..steps::<S>() {
            let mut own = [[Pair::zero(simd); 6]; 6];
            for (i, row) in own.iter_mut().enumerate() {
                for (j, x) in row.iter_mut().enumerate() {
                    *x = self.inverse.hermitian(simd, n, i, j);
                }
            }
            let spread = measured(simd, &back, &own);
            for (i, row) in spread.iter().enumerate() {
                for (j, x) in row.iter().enumerate().take(i + 1) {
                    self.inverse.0[lower(i, j)].set(n, *x);
                }
            }
        }
    }
}

/// R x.
#[inline(always)]
pub(super) fn turned<S: Simd>(simd: S, rows: &Matrix6<f64>, x: &[Pair<S>; 6]) -> [Pair<S>; 6] {
    let mut product = [Pair::zero(simd); 6];
    for (i, sum) in product.iter_mut().enumerate() {
        for (j, x) in x.iter().enumerate() {
            *sum += *x * rows[(i, j)];
        }
    }
    product
}

/// R C Rᵀ of a Hermitian matrix, of which the lower triangle is read.
#[inline(always)]
fn measured<S: Simd>(simd: S, rows: &Matrix6<f64>, c: &[[Pair<S>; 6]; 6]) -> [[Pair<S>; 6]; 6] {
    let mut columns = [[Pair::zero(simd); 6]; 6];
    for (j, column) in columns.iter_mut().enumerate() {
        let mut whole = [Pair::zero(simd); 6];
        for (i, x) in whole.iter_mut().enumerate() {
            *x = if i >= j { c[i][j] } else { c[j][i].conj() };
        }
        *column = turned(simd, rows, &whole);
    }
    let mut product = [[Pair::zero(simd); 6]; 6];
    for (i, row) in product.iter_mut().enumerate() {
        for (j, sum) in row.iter_mut().enumerate() {
            for (l, column) in columns.iter().enumerate() {
                *sum += column[i] * rows[(j, l)];
            }
        }
    }
    product
}

/// G⁻¹ of a Hermitian matrix C = G G*, of which the lower triangle is read, and the squares of the
/// diagonal of G, positive where C is positive definite.
#[expect(
    clippy::needless_range_loop,
    reason = "rows and columns as in formulas"
)]
#[inline(always)]
fn inverse_factor<S: Simd>(simd: S, c: &[[Pair<S>; 6]; 6]) -> ([[Pair<S>; 6]; 6], [Lane<S>; 6]) {
    let zero = Pair::zero(simd);
    let one = Lane::all(simd, 1.0);
    let mut g = [[zero; 6]; 6];
    let mut pivots = [one; 6];
    let mut scales = [one; 6];
    for j in 0..6 {
        let mut d = c[j][j].re;
        for l in 0..j {
            d = d - g[j][l].square();
        }
        pivots[j] = d;
        scales[j] = one / d.sqrt();
        for i in j + 1..6 {
            let mut sum = c[i][j];
            for l in 0..j {
                sum -= g[i][l] * g[j][l].conj();
            }
            g[i][j] = sum * scales[j];
        }
    }
    let mut inverse = [[zero; 6]; 6];
    for j in 0..6 {
        inverse[j][j].re = scales[j];
        for i in j + 1..6 {
            let mut sum = zero;
            for l in j..i {
                sum -= g[i][l] * inverse[l][j];
            }
            inverse[i][j] = sum * scales[i];
        }
    }
    (inverse, pivots)
}

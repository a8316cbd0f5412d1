//! Columns of K = ∂M/∂θ Ã + ∂T/∂θ of neighbouring lines, and their products with Y = C⁻¹ K.

use super::batch::{Batch, Evaluation, POLYNOMIAL, turned};
use super::lanes::{Lane, Lanes, Pair, PairRow, Row, add, six, steps};
use super::leakage::{part, part_of};
use super::model::{OF_MODE, RIGID, SYMMETRIC};
use super::products::{Pattern, Places, patterns_of_body, patterns_of_upper};
use pulp::Simd;

/// Numbers of a mode at each line of a batch, which its columns consist of.
#[derive(Clone)]
struct ModeRows {
    /// C⁻¹ L_r.
    inverse: [PairRow; 6],
    /// Factors of L_r: for ln ω_r, ln ζ_r and the exponent.
    slopes: [PairRow; 3],
    /// Factors of L_r for its own elements, D Ã_j.
    moved: [PairRow; 6],
    /// Factor of e_j for element j: D L·Ã and leakage.
    through: PairRow,
}

impl ModeRows {
    const ZERO: Self = Self {
        inverse: [PairRow::ZERO; 6],
        slopes: [PairRow::ZERO; 3],
        moved: [PairRow::ZERO; 6],
        through: PairRow::ZERO,
    };
}

/// Parts of the columns of a batch.
pub(super) struct Columns<'a, 'b> {
    evaluation: &'b Evaluation<'a>,
    pub(super) places: Places,
    batch: Box<Batch>,
    /// Ã, and the same times the response of modes beyond the lines.
    base: [PairRow; 6],
    beyond: [PairRow; 6],
    modes: Vec<ModeRows>,
    /// Matrices that Ã is multiplied with for a parameter.
    of_body: Vec<Pattern>,
    of_upper: Vec<Pattern>,
    /// A column of Y, in the equations that are measured as well, and L_r of each mode times it.
    column: [PairRow; 6],
    own: [PairRow; 6],
    along: Vec<PairRow>,
    /// C⁻¹ (F - M A - T), and |ε|².
    pull: [PairRow; 6],
    pub(super) size: Row,
}

impl<'a, 'b> Columns<'a, 'b> {
    pub(super) fn new(evaluation: &'b Evaluation<'a>) -> Self {
        let modes = evaluation.modes.len();
        Self {
            evaluation,
            places: Places::new(evaluation),
            batch: Batch::new(modes),
            base: [PairRow::ZERO; 6],
            beyond: [PairRow::ZERO; 6],
            modes: vec![ModeRows::ZERO; modes],
            of_body: patterns_of_body(),
            of_upper: patterns_of_upper(),
            column: [PairRow::ZERO; 6],
            own: [PairRow::ZERO; 6],
            along: vec![PairRow::ZERO; modes],
            pull: [PairRow::ZERO; 6],
            size: Row::ZERO,
        }
    }

    /// Takes lines `first` to `end`.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        first: usize,
        end: usize,
        coefficients: &[f64],
    ) -> Option<()> {
        let evaluation = self.evaluation;
        self.batch.fill(simd, evaluation, first, end)?;
        if !evaluation.complete {
            self.batch
                .spread_inverse(simd, &evaluation.record.equations);
        }
        for n in 0..steps::<S>() {
            self.work_out(simd, n, coefficients);
        }
        Some(())
    }

    #[expect(
        clippy::needless_range_loop,
        reason = "rows and columns as in formulas"
    )]
    #[inline(always)]
    fn work_out<S: Simd>(&mut self, simd: S, n: usize, coefficients: &[f64]) {
        let (evaluation, batch) = (self.evaluation, &self.batch);
        let zero = Pair::zero(simd);
        let mut residual: [Pair<S>; 6] = six(
            zero,
            #[inline(always)]
            |i| batch.residual[i].get(simd, n),
        );
        if evaluation.columns > 0 {
            let leaked = self.polynomials(simd, n, coefficients);
            for (x, leaked) in residual.iter_mut().zip(leaked) {
                *x -= leaked;
            }
            for (at, &r) in evaluation.leaking.iter().enumerate() {
                let pair = [coefficients[2 * at], coefficients[2 * at + 1]];
                let (.., leaked) = batch.resonances[r].slopes(simd, n, 1.0, pair);
                let l = &evaluation.modes[r].mode.participation;
                for (x, l) in residual.iter_mut().zip(l) {
                    *x -= leaked * *l;
                }
            }
        }
        let pull = batch.inverse.times(simd, n, &residual);
        let mut size = Lane::all(simd, 0.0);
        let mut back = [zero; 6];
        for i in 0..6 {
            self.pull[i].set(n, pull[i]);
            size += residual[i].dot(pull[i]);
            for (j, back) in back.iter_mut().enumerate() {
                *back += batch.mass.symmetric(simd, n, i, j).conj() * pull[i];
            }
        }
        self.size.set(n, size);
        // Ã = A + level Ca M* G⁻* ε.
        let (level, rest) = (batch.level.get(simd, n), batch.rest.get(simd, n));
        let moved = turned(simd, &evaluation.record.noise.base, &back);
        let base: [Pair<S>; 6] = six(
            zero,
            #[inline(always)]
            |i| batch.base[i].get(simd, n) + moved[i] * level,
        );
        for i in 0..6 {
            self.base[i].set(n, base[i]);
            self.beyond[i].set(n, base[i] * rest);
        }
        for (r, rows) in self.modes.iter_mut().enumerate() {
            let seen = &evaluation.modes[r];
            let l = &seen.mode.participation;
            let real: [Lane<S>; 6] = six(
                Lane::all(simd, 0.0),
                #[inline(always)]
                |i| Lane::all(simd, l[i]),
            );
            let mut drive = zero;
            for i in 0..6 {
                let mut inverse = zero;
                for (j, l) in real.iter().enumerate() {
                    inverse += batch.inverse.hermitian(simd, n, i, j) * *l;
                }
                rows.inverse[i].set(n, inverse);
                drive += base[i] * real[i];
            }
            let pair = match evaluation.leaking.iter().position(|&l| l == r) {
                Some(at) => [coefficients[2 * at], coefficients[2 * at + 1]],
                None => [0.0; 2],
            };
            let resonances = &batch.resonances[r];
            let exponent = seen.mode.exponent;
            let (slopes, of_leaked, leaked) = resonances.slopes(simd, n, exponent, pair);
            for (s, row) in rows.slopes.iter_mut().enumerate() {
                row.set(n, slopes[s] * drive + of_leaked[s]);
            }
            let d = resonances.response(simd, n);
            for (row, base) in rows.moved.iter_mut().zip(base) {
                row.set(n, d * base);
            }
            rows.through.set(n, d * drive + leaked);
        }
    }

    /// Polynomials of the leakage, of all six resultants.
    #[inline(always)]
    fn polynomials<S: Simd>(&self, simd: S, n: usize, coefficients: &[f64]) -> [Pair<S>; 6] {
        let evaluation = self.evaluation;
        let mut leaked = [Pair::zero(simd); 6];
        let mut of = coefficients[2 * evaluation.leaking.len()..].iter();
        for power in 0..POLYNOMIAL {
            let share = self.batch.powers[power].get(simd, n);
            let (real, sign) = part(power);
            for i in (0..6).filter(|&i| evaluation.measured[i]) {
                let x = share * (sign * of.next().copied().unwrap_or(0.0));
                // jⁿ is real or imaginary, positive or negative, as the part of (-j)ⁿ y is that is real.
                if real {
                    leaked[i].re += x;
                } else {
                    leaked[i].im += x;
                }
            }
        }
        if !evaluation.complete {
            leaked = turned(simd, &evaluation.record.equations.transpose(), &leaked);
        }
        leaked
    }

    /// Adds the products of all columns.
    #[inline(always)]
    pub(super) fn add_all<S: Simd>(
        &mut self,
        simd: S,
        products: &mut [Lanes],
        errors: &mut [Lanes],
    ) {
        let count = self.places.count;
        let mut of = products.chunks_exact_mut(count);
        for column in 0..RIGID {
            self.set_symmetric(simd, column, false);
            if let Some(sums) = of.next() {
                self.add_column(simd, sums, 0, false);
            }
        }
        for r in 0..self.modes.len() {
            for term in 0..OF_MODE {
                self.set_of_mode(simd, r, term);
                if let Some(sums) = of.next() {
                    self.add_column(simd, sums, r + 1, true);
                }
            }
        }
        if self.evaluation.model.upper.is_some() {
            for column in 0..SYMMETRIC {
                self.set_symmetric(simd, column, true);
                if let Some(sums) = of.next() {
                    self.add_column(simd, sums, 0, true);
                }
            }
        }
        self.column = self.pull;
        self.add_column(simd, errors, self.modes.len(), true);
    }

    /// Y of a symmetric matrix times Ã.
    #[inline(always)]
    fn set_symmetric<S: Simd>(&mut self, simd: S, parameter: usize, beyond: bool) {
        let (base, pattern) = if beyond {
            (&self.beyond, &self.of_upper[parameter])
        } else {
            (&self.base, &self.of_body[parameter])
        };
        for n in 0..steps::<S>() {
            let mut column = [Pair::zero(simd); 6];
            for &(l, j, x) in pattern {
                let x = base[j].get(simd, n) * x;
                for (i, sum) in column.iter_mut().enumerate() {
                    *sum += self.batch.inverse.hermitian(simd, n, i, l) * x;
                }
            }
            for (row, x) in self.column.iter_mut().zip(column) {
                row.set(n, x);
            }
        }
    }

    /// Y of a parameter of a mode.
    #[inline(always)]
    fn set_of_mode<S: Simd>(&mut self, simd: S, r: usize, term: usize) {
        let rows = &self.modes[r];
        let element = (2..8).contains(&term).then(|| term - 2);
        let factor = match element {
            Some(j) => &rows.moved[j],
            None => &rows.slopes[if term == OF_MODE - 1 { 2 } else { term }],
        };
        for n in 0..steps::<S>() {
            let factor = factor.get(simd, n);
            for i in 0..6 {
                let mut y = rows.inverse[i].get(simd, n) * factor;
                if let Some(j) = element {
                    let own = self.batch.inverse.hermitian(simd, n, i, j);
                    y += own * rows.through.get(simd, n);
                }
                self.column[i].set(n, y);
            }
        }
    }

    /// Adds the products of a column of Y with all other columns: with those of so many modes, and of E
    /// if `upper`.
    #[inline(always)]
    fn add_column<S: Simd>(&mut self, simd: S, sums: &mut [Lanes], modes: usize, upper: bool) {
        let (evaluation, places) = (self.evaluation, &self.places);
        let leaks = evaluation.columns > 0;
        for (i, of) in sums[..36].chunks_exact_mut(6).enumerate() {
            add_six(simd, of, &self.base, &self.column[i]);
        }
        if let Some(at) = places.upper.filter(|_| upper) {
            for (i, of) in sums[at..at + 36].chunks_exact_mut(6).enumerate() {
                add_six(simd, of, &self.beyond, &self.column[i]);
            }
        }
        for (r, along) in self.along.iter_mut().enumerate() {
            let seen = &evaluation.modes[r];
            for n in 0..steps::<S>() {
                let mut sum = Pair::zero(simd);
                for i in 0..6 {
                    sum += self.column[i].get(simd, n) * seen.mode.participation[i];
                }
                along.set(n, sum);
            }
        }
        for r in 0..modes {
            let (rows, along) = (&self.modes[r], &self.along[r]);
            let first = places.modes + OF_MODE * r;
            let (slopes, rest) = sums[first..first + OF_MODE].split_at_mut(2);
            let (elements, exponent) = rest.split_at_mut(6);
            add(
                simd,
                slopes,
                #[inline(always)]
                |n| {
                    let along = along.get(simd, n);
                    [
                        rows.slopes[0].get(simd, n).dot(along),
                        rows.slopes[1].get(simd, n).dot(along),
                    ]
                },
            );
            add(
                simd,
                exponent,
                #[inline(always)]
                |n| [rows.slopes[2].get(simd, n).dot(along.get(simd, n))],
            );
            add(
                simd,
                elements,
                #[inline(always)]
                |n| -> [Lane<S>; 6] {
                    let (along, through) = (along.get(simd, n), rows.through.get(simd, n));
                    six(
                        Lane::all(simd, 0.0),
                        #[inline(always)]
                        |j| {
                            rows.moved[j].get(simd, n).dot(along)
                                + through.dot(self.column[j].get(simd, n))
                        },
                    )
                },
            );
        }
        if !leaks {
            return;
        }
        let column = if evaluation.complete {
            &self.column
        } else {
            for n in 0..steps::<S>() {
                let column = six(
                    Pair::zero(simd),
                    #[inline(always)]
                    |i| self.column[i].get(simd, n),
                );
                let own = turned(simd, &evaluation.record.equations, &column);
                for (row, x) in self.own.iter_mut().zip(own) {
                    row.set(n, x);
                }
            }
            &self.own
        };
        for power in 0..POLYNOMIAL {
            let first = places.polynomials + 6 * power;
            let share = &self.batch.powers[power];
            add(
                simd,
                &mut sums[first..first + 6],
                #[inline(always)]
                |n| -> [Lane<S>; 6] {
                    let share = share.get(simd, n);
                    six(
                        Lane::all(simd, 0.0),
                        #[inline(always)]
                        |i| part_of(power, column[i].get(simd, n)) * share,
                    )
                },
            );
        }
        for (at, &r) in evaluation.leaking.iter().enumerate() {
            let first = places.leaking + 2 * at;
            let inverse = &self.batch.resonances[r].inverse;
            let (along, share) = (&self.along[r], &self.batch.powers[1]);
            add(
                simd,
                &mut sums[first..first + 2],
                #[inline(always)]
                |n| {
                    let (f, along) = (inverse.get(simd, n), along.get(simd, n));
                    [f.dot(along), f.cross(along) * share.get(simd, n)]
                },
            );
        }
    }
}

/// Adds Re Ã_j* y for all j.
#[inline(always)]
fn add_six<S: Simd>(simd: S, sums: &mut [Lanes], base: &[PairRow; 6], y: &PairRow) {
    add(
        simd,
        sums,
        #[inline(always)]
        |n| -> [Lane<S>; 6] {
            let y = y.get(simd, n);
            six(
                Lane::all(simd, 0.0),
                #[inline(always)]
                |j| base[j].get(simd, n).dot(y),
            )
        },
    );
}

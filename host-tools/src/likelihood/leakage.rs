//! Leakage: how a record begins and ends.
//!
//! Its columns are, in the equations that are measured, `L_r/N` and `L_r jx/N` of each mode, N being its
//! denominator, and `e_i (jω)ⁿ`. They differ from line to line by factors only, so that sums over C⁻¹ times
//! these factors make all products of columns.

use super::batch::{Batch, Evaluation, POLYNOMIAL};
use super::lanes::{Lane, Lanes, Pair, PairRow, add, six, steps, total};
use super::model::Model;
use super::record::Record;
use super::solve::solve_symmetric;
use nalgebra::DMatrix;
use pulp::Simd;

/// Modes up to this share of a record's highest line have leakage terms of their own.
const LEAKING: f64 = 3.0;
/// Highest power of ω of the products of a mode's columns and those of the polynomials.
const CROSSED: usize = POLYNOMIAL + 1;

/// Modes with leakage terms in a record.
pub(super) fn leaking(record: &Record, model: &Model) -> Vec<usize> {
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
    pub(super) coefficients: Vec<f64>,
    /// Products of the columns.
    pub(super) own: DMatrix<f64>,
}

/// Re (-j)ⁿ y: of y the part, and its sign.
pub(super) const fn part(n: usize) -> (bool, f64) {
    (n.is_multiple_of(2), if n % 4 < 2 { 1.0 } else { -1.0 })
}

/// Real part of a number where `n` is even, and the imaginary part where it is odd.
#[inline(always)]
pub(super) fn part_of<S: Simd>(n: usize, x: Pair<S>) -> Lane<S> {
    if part(n).0 { x.re } else { x.im }
}

/// Lanes over the lines of a record.
struct Products {
    /// C⁻¹: real parts times even powers of ω, imaginary parts times odd ones.
    inverse: Vec<[Lanes; 6 * 6]>,
    /// L_r in C⁻¹, per 1/N*, times powers of ω, and such products of two modes.
    modes: Vec<[[Lanes; 6]; CROSSED]>,
    pairs: Vec<[Lanes; 3]>,
    /// Residual times columns of modes and polynomials.
    of_modes: Vec<[Lanes; 2]>,
    of_polynomials: [[Lanes; 6]; POLYNOMIAL],
    misfit: [Lanes; 1],
}

impl Products {
    fn new(leaking: usize) -> Self {
        let zero = [0.0; 4];
        Self {
            inverse: vec![[zero; 36]; 2 * POLYNOMIAL - 1],
            modes: vec![[[zero; 6]; CROSSED]; leaking],
            pairs: vec![[zero; 3]; leaking * (leaking + 1) / 2],
            of_modes: vec![[zero; 2]; leaking],
            of_polynomials: [[zero; 6]; POLYNOMIAL],
            misfit: [zero],
        }
    }
}

/// V and leakage of a record.
#[inline(always)]
pub(super) fn leakage<S: Simd>(simd: S, evaluation: &Evaluation<'_>) -> Option<Leaked> {
    let lines = evaluation.record.frequencies.len();
    let leaking = &evaluation.leaking;
    let mut batch = Batch::new(evaluation.modes.len());
    let mut sums = Products::new(leaking.len());
    let mut through = vec![[PairRow::ZERO; 6]; leaking.len()];
    let mut first = 0;
    while first < lines {
        let end = (first + super::lanes::BATCH).min(lines);
        batch.fill(simd, evaluation, first, end)?;
        add(
            simd,
            &mut sums.misfit,
            #[inline(always)]
            |n| [batch.misfit.get(simd, n)],
        );
        if evaluation.columns > 0 {
            add_products(simd, evaluation, &batch, &mut through, &mut sums);
        }
        first = end;
    }
    solve(evaluation, &sums)
}

#[expect(
    clippy::needless_range_loop,
    reason = "rows and columns as in formulas"
)]
#[inline(always)]
fn add_products<S: Simd>(
    simd: S,
    evaluation: &Evaluation<'_>,
    batch: &Batch,
    through: &mut [[PairRow; 6]],
    sums: &mut Products,
) {
    for (q, of) in sums.inverse.iter_mut().enumerate() {
        let power = &batch.powers[q];
        for i in 0..6 {
            add(
                simd,
                &mut of[6 * i..6 * i + 6],
                #[inline(always)]
                |n| -> [Lane<S>; 6] {
                    let power = power.get(simd, n);
                    six(
                        Lane::all(simd, 0.0),
                        #[inline(always)]
                        |j| part_of(q, batch.inverse.hermitian(simd, n, i, j)) * power,
                    )
                },
            );
        }
    }
    for (n, of) in sums.of_polynomials.iter_mut().enumerate() {
        let power = &batch.powers[n];
        add(
            simd,
            of,
            #[inline(always)]
            |at| -> [Lane<S>; 6] {
                let power = power.get(simd, at);
                six(
                    Lane::all(simd, 0.0),
                    #[inline(always)]
                    |i| part_of(n, batch.pull[i].get(simd, at)) * power,
                )
            },
        );
    }
    for (at, &r) in evaluation.leaking.iter().enumerate() {
        let l = &evaluation.modes[r].measured;
        let inverse = &batch.resonances[r].inverse;
        for n in 0..steps::<S>() {
            let f = inverse.get(simd, n);
            for i in 0..6 {
                let mut sum = Pair::zero(simd);
                for j in 0..6 {
                    sum += batch.inverse.hermitian(simd, n, i, j) * l[j];
                }
                through[at][i].set(n, sum * f);
            }
        }
        let (before, own) = through.split_at(at);
        let own = &own[0];
        for (q, of) in sums.modes[at].iter_mut().enumerate() {
            let power = &batch.powers[q];
            add(
                simd,
                of,
                #[inline(always)]
                |n| -> [Lane<S>; 6] {
                    let power = power.get(simd, n);
                    six(
                        Lane::all(simd, 0.0),
                        #[inline(always)]
                        |i| part_of(q, own[i].get(simd, n)) * power,
                    )
                },
            );
        }
        add(
            simd,
            &mut sums.of_modes[at],
            #[inline(always)]
            |n| {
                let mut sum = Pair::zero(simd);
                for i in 0..6 {
                    sum += batch.pull[i].get(simd, n) * l[i];
                }
                let f = inverse.get(simd, n);
                [f.dot(sum), f.cross(sum) * batch.powers[1].get(simd, n)]
            },
        );
        for other in 0..=at {
            let column = before.get(other).unwrap_or(own);
            add(
                simd,
                &mut sums.pairs[at * (at + 1) / 2 + other],
                #[inline(always)]
                |n| {
                    let mut sum = Pair::zero(simd);
                    for i in 0..6 {
                        sum += column[i].get(simd, n) * l[i];
                    }
                    let f = inverse.get(simd, n);
                    let (even, odd) = (f.dot(sum), f.cross(sum));
                    let (one, two) = (&batch.powers[1], &batch.powers[2]);
                    [even, odd * one.get(simd, n), even * two.get(simd, n)]
                },
            );
        }
    }
}

/// The least V, from the sums.
fn solve(evaluation: &Evaluation<'_>, sums: &Products) -> Option<Leaked> {
    let misfit = total(&sums.misfit[0]);
    let t = evaluation.columns;
    if t == 0 {
        return misfit.is_finite().then(|| Leaked {
            misfit,
            coefficients: Vec::new(),
            own: DMatrix::zeros(0, 0),
        });
    }
    let modes = evaluation.leaking.len();
    let stretch: Vec<f64> = evaluation
        .leaking
        .iter()
        .map(|&r| evaluation.stretch(r))
        .collect();
    let equations: Vec<usize> = (0..6).filter(|&i| evaluation.measured[i]).collect();
    let mut own = DMatrix::zeros(t, t);
    let mut right = DMatrix::zeros(t, 1);
    for r in 0..modes {
        let x = stretch[r];
        right[(2 * r, 0)] = total(&sums.of_modes[r][0]);
        right[(2 * r + 1, 0)] = total(&sums.of_modes[r][1]) * x;
        for s in 0..=r {
            let [even, odd, square] = sums.pairs[r * (r + 1) / 2 + s].map(|p| total(&p));
            let y = stretch[s];
            own[(2 * r, 2 * s)] = even;
            own[(2 * r, 2 * s + 1)] = -y * odd;
            own[(2 * r + 1, 2 * s)] = x * odd;
            own[(2 * r + 1, 2 * s + 1)] = x * y * square;
        }
        for n in 0..POLYNOMIAL {
            for (at, &i) in equations.iter().enumerate() {
                let row = 2 * modes + n * equations.len() + at;
                let of = |q: usize| total(&sums.modes[r][q][i]);
                own[(row, 2 * r)] = part(n).1 * of(n);
                // Of jx y the real part is that of -x Im y, and the imaginary one x Re y.
                let x = if n.is_multiple_of(2) { -x } else { x };
                own[(row, 2 * r + 1)] = part(n).1 * x * of(n + 1);
            }
        }
    }
    for n in 0..POLYNOMIAL {
        for (a, &i) in equations.iter().enumerate() {
            let row = 2 * modes + n * equations.len() + a;
            right[(row, 0)] = part(n).1 * total(&sums.of_polynomials[n][i]);
            for m in 0..=n {
                for (b, &j) in equations.iter().enumerate() {
                    // Re j^(m-n) x.
                    let sign = part(n - m).1;
                    own[(row, 2 * modes + m * equations.len() + b)] =
                        sign * total(&sums.inverse[n + m][6 * i + j]);
                }
            }
        }
    }
    for j in 0..t {
        for i in 0..j {
            own[(i, j)] = own[(j, i)];
        }
    }
    let solved = solve_symmetric(own.clone(), &right)?;
    let explained = (right.transpose() * &solved)[(0, 0)];
    let misfit = misfit - explained;
    misfit.is_finite().then(|| Leaked {
        misfit,
        coefficients: solved.column(0).iter().copied().collect(),
        own,
    })
}

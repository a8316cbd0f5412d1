//! Misfit, gradient and information of a model, record by record and line by line.
//!
//! With C = Cf + M Ca M* = G G* and ε = G⁻¹ (F - M A - T) the misfit is V = Σ |ε|²: minus the
//! logarithm of the likelihood after the base accelerations are eliminated. Their most likely
//! values are Ã = A + Ca M* G⁻* ε, and with K = ∂M/∂θ Ã + ∂T/∂θ and J = G⁻¹ K the gradient of V is exactly
//! -2 Re J* ε. The leakage T is linear in coefficients of each record, which are eliminated by a
//! Schur complement.
//!
//! Columns of K are few vectors times numbers of the line: those of the rigid body and of E are symmetric
//! matrices times Ã, those of a mode L_r times a number, and e_j times another. So J* J = K* Y with
//! Y = C⁻¹ K is summed over products with these vectors, a fifth of the products of whole columns.

use super::batch::Evaluation;
use super::columns::Columns;
use super::lanes::{self, BATCH, LANES, Lanes};
use super::leakage::{Leaked, leakage, leaking};
use super::model::Model;
use super::products::Reader;
use super::record::Record;
use super::solve::solve_symmetric;
use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Scalar, Simd, WithSimd};

/// Stretches of frequency that each record's score is summed over.
pub(super) const STRETCHES: usize = 20;

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

/// V and leakage of one record at a model; `None` where numbers are not finite.
pub(super) fn misfit(record: &Record, model: &Model, leak: bool) -> Option<Leaked> {
    let evaluation = evaluation(record, model, leak);
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
    let evaluation = evaluation(record, model, leak);
    Arch::new().dispatch(AllSums(&evaluation, detail, leaked))
}

pub(super) fn evaluation<'a>(record: &'a Record, model: &'a Model, leak: bool) -> Evaluation<'a> {
    Evaluation::new(record, model, leak.then(|| leaking(record, model)))
}

/// Passes over the lines, compiled for the widest lanes that the processor has.
struct Leakage<'a>(&'a Evaluation<'a>);

impl WithSimd for Leakage<'_> {
    type Output = Option<Leaked>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if lanes::fits::<S>() {
            leakage(simd, self.0)
        } else {
            leakage(Scalar::new(), self.0)
        }
    }
}

struct AllSums<'a>(&'a Evaluation<'a>, Detail, &'a Leaked);

impl WithSimd for AllSums<'_> {
    type Output = Option<Sums>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if lanes::fits::<S>() {
            all_sums(simd, self.0, self.1, self.2)
        } else {
            all_sums(Scalar::new(), self.0, self.1, self.2)
        }
    }
}

/// Sums of one record.
#[inline(always)]
pub(super) fn all_sums<S: Simd>(
    simd: S,
    evaluation: &Evaluation<'_>,
    detail: Detail,
    leaked: &Leaked,
) -> Option<Sums> {
    let lines = evaluation.record.frequencies.len();
    let p = evaluation.model.shared();
    let mut columns = Columns::new(evaluation);
    let count = columns.places.count;
    let mut products = vec![[0.0; LANES]; p * count];
    let parts = if detail == Detail::Test { STRETCHES } else { 1 };
    let mut errors = vec![vec![[0.0; LANES]; count]; parts];
    let mut residuals = Vec::new();
    for (s, errors) in errors.iter_mut().enumerate() {
        let (mut first, last) = (
            (s * lines).div_ceil(parts),
            ((s + 1) * lines).div_ceil(parts),
        );
        while first < last {
            let end = (first + BATCH).min(last);
            columns.fill(simd, first, end, &leaked.coefficients)?;
            columns.add_all(simd, &mut products, errors);
            if detail == Detail::Test {
                residuals.extend_from_slice(&columns.size.0[..end - first]);
            }
            first = end;
        }
    }
    let reader = Reader::new(evaluation, columns.places);
    let mut information = DMatrix::zeros(p, p);
    for b in 0..p {
        let of = &products[b * count..(b + 1) * count];
        for a in (0..p).filter(|&a| reader.comes_first(a, b)) {
            information[(a, b)] = reader.parameter(of, a);
            information[(b, a)] = information[(a, b)];
        }
    }
    let t = evaluation.columns;
    let mut eliminate = DMatrix::zeros(p, 0);
    if t > 0 {
        let cross = DMatrix::from_fn(p, t, |b, at| {
            reader.leakage(&products[b * count..(b + 1) * count], at)
        });
        let solved = solve_symmetric(leaked.own.clone(), &cross.transpose())?;
        information -= &cross * &solved;
        eliminate = solved.transpose();
    }
    let score_of = |errors: &[Lanes]| {
        let mut score = DVector::from_fn(p, |a, _| reader.parameter(errors, a));
        if t > 0 {
            score -= &eliminate * DVector::from_fn(t, |at, _| reader.leakage(errors, at));
        }
        score
    };
    let mut stretches: Vec<DVector<f64>> = errors.iter().map(|e| score_of(e)).collect();
    let score = stretches
        .iter()
        .fold(DVector::zeros(p), |sum, part| sum + part);
    if detail != Detail::Test {
        stretches.clear();
    }
    let finite = score.iter().all(|x| x.is_finite());
    finite.then_some(Sums {
        misfit: leaked.misfit,
        information,
        score,
        stretches,
        residuals,
    })
}

//! Lanes of products of a column of Y = C⁻¹ K with the vectors that columns of K consist of, and what they say
//! of whole columns.

use super::batch::{Evaluation, POLYNOMIAL};
use super::lanes::{Lanes, total};
use super::leakage::part;
use super::model::{OF_MODE, RIGID, rigid_columns, triangle};
use nalgebra::{Complex, Vector6};

/// Places of the sums of one column of Y.
pub(super) struct Places {
    /// With Ã_j in row i, place 6 i + j; with Ã_j times the response of modes beyond the lines.
    pub(super) upper: Option<usize>,
    pub(super) modes: usize,
    pub(super) polynomials: usize,
    pub(super) leaking: usize,
    pub(super) count: usize,
}

impl Places {
    pub(super) fn new(evaluation: &Evaluation<'_>) -> Self {
        let upper = evaluation.model.upper.map(|_| 36);
        let modes = if upper.is_some() { 72 } else { 36 };
        let polynomials = modes + OF_MODE * evaluation.modes.len();
        let leaking = polynomials
            + if evaluation.columns > 0 {
                6 * POLYNOMIAL
            } else {
                0
            };
        Self {
            upper,
            modes,
            polynomials,
            leaking,
            count: leaking + 2 * evaluation.leaking.len(),
        }
    }
}

/// Row, column and value of each element of a symmetric matrix that is not zero.
pub(super) type Pattern = Vec<(usize, usize, f64)>;

/// The matrices that an acceleration is multiplied with for the parameters of the rigid body.
pub(super) fn patterns_of_body() -> Vec<Pattern> {
    let mut patterns = vec![Pattern::new(); RIGID];
    for j in 0..6 {
        let unit = Vector6::from_fn(|l, _| Complex::from(f64::from(u8::from(l == j))));
        for (pattern, column) in patterns.iter_mut().zip(rigid_columns(&unit)) {
            let elements = column.iter().enumerate().filter(|(_, x)| x.re != 0.0);
            pattern.extend(elements.map(|(i, x)| (i, j, x.re)));
        }
    }
    patterns
}

/// The same for the elements of E.
pub(super) fn patterns_of_upper() -> Vec<Pattern> {
    let pattern = |(i, j)| {
        if i == j {
            vec![(i, i, 1.0)]
        } else {
            vec![(i, j, 1.0), (j, i, 1.0)]
        }
    };
    triangle().map(pattern).collect()
}

/// Reads products of one column of Y with columns of K from sums.
pub(super) struct Reader<'a, 'b> {
    evaluation: &'b Evaluation<'a>,
    places: Places,
    of_body: Vec<Pattern>,
    of_upper: Vec<Pattern>,
}

impl<'a, 'b> Reader<'a, 'b> {
    pub(super) fn new(evaluation: &'b Evaluation<'a>, places: Places) -> Self {
        Self {
            evaluation,
            places,
            of_body: patterns_of_body(),
            of_upper: patterns_of_upper(),
        }
    }

    /// First place of E.
    fn upper(&self) -> usize {
        self.evaluation.model.upper_at()
    }

    /// `true` if the product of columns `a` of K and `b` of Y was summed, and not that of `b` and `a`.
    pub(super) fn comes_first(&self, a: usize, b: usize) -> bool {
        // The rigid body before E before modes.
        let rank = |i: usize| {
            if i < RIGID {
                (0, i)
            } else if i >= self.upper() {
                (1, i)
            } else {
                (2, i)
            }
        };
        rank(a) <= rank(b)
    }

    /// Product with the column of a parameter.
    pub(super) fn parameter(&self, sums: &[Lanes], a: usize) -> f64 {
        let of = |pattern: &Pattern, at: usize| {
            let elements = pattern.iter();
            elements
                .map(|(i, j, x)| x * total(&sums[at + 6 * i + j]))
                .sum()
        };
        if let Some(pattern) = self.of_body.get(a) {
            of(pattern, 0)
        } else if let (Some(at), true) = (self.places.upper, a >= self.upper()) {
            of(&self.of_upper[a - self.upper()], at)
        } else {
            total(&sums[self.places.modes + a - RIGID])
        }
    }

    /// Product with a column of leakage.
    pub(super) fn leakage(&self, sums: &[Lanes], at: usize) -> f64 {
        let modes = &self.evaluation.leaking;
        if let Some(&r) = modes.get(at / 2) {
            let product = total(&sums[self.places.leaking + at]);
            return if at.is_multiple_of(2) {
                product
            } else {
                product * self.evaluation.stretch(r)
            };
        }
        let count = self
            .evaluation
            .measured
            .iter()
            .filter(|seen| **seen)
            .count();
        let place = at - 2 * modes.len();
        let (power, nth) = (place / count, place % count);
        let seen = (0..6).filter(|&i| self.evaluation.measured[i]);
        let equation = seen.clone().nth(nth).unwrap_or(0);
        part(power).1 * total(&sums[self.places.polynomials + 6 * power + equation])
    }
}

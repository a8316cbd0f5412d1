//! Numbers of neighbouring lines side by side.
//!
//! Four lines are summed apart from each other, whatever the processor works on at a time, and products
//! are rounded before they are added: all processors give the same bits.

use pulp::Simd;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Lines that are summed apart.
pub(super) const LANES: usize = 4;
/// Lines of a batch, a multiple of [`LANES`]: as many as caches have room for.
pub(super) const BATCH: usize = 16;

/// A sum for each of [`LANES`] lines.
pub(super) type Lanes = [f64; LANES];

/// The sum of all lines.
pub(super) fn total(sums: &Lanes) -> f64 {
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Numbers that the processor works on at a time.
#[derive(Clone, Copy)]
pub(super) struct Lane<S: Simd> {
    simd: S,
    x: S::f64s,
}

impl<S: Simd> Lane<S> {
    #[inline(always)]
    pub(super) fn all(simd: S, x: f64) -> Self {
        Self {
            simd,
            x: simd.splat_f64s(x),
        }
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self {
            x: self.simd.sqrt_f64s(self.x),
            ..self
        }
    }
}

impl<S: Simd> Add for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            x: self.simd.add_f64s(self.x, other.x),
            ..self
        }
    }
}

impl<S: Simd> Sub for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            x: self.simd.sub_f64s(self.x, other.x),
            ..self
        }
    }
}

impl<S: Simd> Mul for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            x: self.simd.mul_f64s(self.x, other.x),
            ..self
        }
    }
}

impl<S: Simd> Mul<f64> for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * Self::all(self.simd, other)
    }
}

impl<S: Simd> Div for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self {
            x: self.simd.div_f64s(self.x, other.x),
            ..self
        }
    }
}

impl<S: Simd> Neg for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            x: self.simd.neg_f64s(self.x),
            ..self
        }
    }
}

impl<S: Simd> AddAssign for Lane<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// Complex numbers side by side.
#[derive(Clone, Copy)]
pub(super) struct Pair<S: Simd> {
    pub(super) re: Lane<S>,
    pub(super) im: Lane<S>,
}

impl<S: Simd> Pair<S> {
    #[inline(always)]
    pub(super) fn real(simd: S, x: f64) -> Self {
        Self {
            re: Lane::all(simd, x),
            im: Lane::all(simd, 0.0),
        }
    }

    #[inline(always)]
    pub(super) fn zero(simd: S) -> Self {
        Self::real(simd, 0.0)
    }

    #[inline(always)]
    pub(super) fn conj(self) -> Self {
        Self {
            im: -self.im,
            ..self
        }
    }

    /// j times the number.
    #[inline(always)]
    pub(super) fn turned(self) -> Self {
        Self {
            re: -self.im,
            im: self.re,
        }
    }

    /// Re of the product with the conjugate of `self`.
    #[inline(always)]
    pub(super) fn dot(self, other: Self) -> Lane<S> {
        self.re * other.re + self.im * other.im
    }

    /// Im of the product with the conjugate of `self`.
    #[inline(always)]
    pub(super) fn cross(self, other: Self) -> Lane<S> {
        self.re * other.im - self.im * other.re
    }

    #[inline(always)]
    pub(super) fn square(self) -> Lane<S> {
        self.dot(self)
    }
}

impl<S: Simd> Add for Pair<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl<S: Simd> Sub for Pair<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }
}

impl<S: Simd> Mul for Pair<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

impl<S: Simd> Mul<Lane<S>> for Pair<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Lane<S>) -> Self {
        Self {
            re: self.re * other,
            im: self.im * other,
        }
    }
}

impl<S: Simd> Mul<f64> for Pair<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * Lane::all(self.re.simd, other)
    }
}

impl<S: Simd> AddAssign for Pair<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> SubAssign for Pair<S> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// A number for each line of a batch.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(super) struct Row(pub(super) [f64; BATCH]);

impl Row {
    pub(super) const ZERO: Self = Self([0.0; BATCH]);

    #[inline(always)]
    pub(super) fn get<S: Simd>(&self, simd: S, n: usize) -> Lane<S> {
        Lane {
            simd,
            x: S::as_simd_f64s(&self.0).0[n],
        }
    }

    #[inline(always)]
    pub(super) fn set<S: Simd>(&mut self, n: usize, value: Lane<S>) {
        S::as_mut_simd_f64s(&mut self.0).0[n] = value.x;
    }
}

/// A complex number for each line of a batch.
#[derive(Clone, Copy)]
pub(super) struct PairRow {
    pub(super) re: Row,
    pub(super) im: Row,
}

impl PairRow {
    pub(super) const ZERO: Self = Self {
        re: Row::ZERO,
        im: Row::ZERO,
    };

    #[inline(always)]
    pub(super) fn get<S: Simd>(&self, simd: S, n: usize) -> Pair<S> {
        Pair {
            re: self.re.get(simd, n),
            im: self.im.get(simd, n),
        }
    }

    #[inline(always)]
    pub(super) fn set<S: Simd>(&mut self, n: usize, value: Pair<S>) {
        self.re.set(n, value.re);
        self.im.set(n, value.im);
    }

    #[inline(always)]
    pub(super) fn put(&mut self, line: usize, value: nalgebra::Complex<f64>) {
        self.re.0[line] = value.re;
        self.im.0[line] = value.im;
    }
}

/// Six values. Functions of the standard library that take a closure are compiled without the processor's
/// lanes.
#[inline(always)]
pub(super) fn six<T: Copy>(zero: T, value: impl Fn(usize) -> T) -> [T; 6] {
    let mut values = [zero; 6];
    for (i, slot) in values.iter_mut().enumerate() {
        *slot = value(i);
    }
    values
}

/// Groups of lines that the processor takes for a batch.
#[inline(always)]
pub(super) fn steps<S: Simd>() -> usize {
    BATCH / S::F64_LANES
}

/// Adds terms of all lines of a batch to sums.
#[inline(always)]
pub(super) fn add<S: Simd, const K: usize>(
    simd: S,
    sums: &mut [Lanes],
    term: impl Fn(usize) -> [Lane<S>; K],
) {
    let sums = &mut sums[..K];
    let parts = LANES / S::F64_LANES;
    for part in 0..parts {
        let mut own = [Lane::all(simd, 0.0); K];
        for v in 0..BATCH / LANES {
            let terms = term(v * parts + part);
            for k in 0..K {
                own[k] += terms[k];
            }
        }
        for k in 0..K {
            let sum = &mut S::as_mut_simd_f64s(&mut sums[k]).0[part];
            *sum = simd.add_f64s(*sum, own[k].x);
        }
    }
}

/// `true` if the processor's lanes divide those that are summed apart.
#[inline(always)]
pub(super) fn fits<S: Simd>() -> bool {
    LANES.is_multiple_of(S::F64_LANES)
}

//! Second moments of accelerations and forces at a line, and the parts of them that some estimators
//! need alone.

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

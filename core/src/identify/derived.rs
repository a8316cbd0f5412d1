//! Centre of gravity and inertia about any point from σ, with their error bars.

use super::measurement::{TERMS, Term, inertia_about};
use super::normal::Workspace;
use super::student::half_width_95;
use crate::algebra::{multiply_left, multiply_right, not_negative};
use crate::cells::{cells, seen};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A value with its standard deviation, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// One standard deviation; zero for an exact value.
    pub std: f64,
}

impl Estimate {
    /// `true` if both are finite.
    pub(super) fn is_finite(&self) -> bool {
        self.value.is_finite() && self.std.is_finite()
    }

    /// Half of the 95 % interval, in the same unit, where the standard deviation was
    /// estimated with so many degrees of freedom ([`super::Identification::freedom`]).
    #[must_use]
    pub fn interval(&self, freedom: f64) -> f64 {
        if self.std == 0.0 {
            return 0.0;
        }
        self.std * half_width_95(freedom)
    }
}

/// The standard deviation of a variance that rounding may have made negative.
fn deviation(variance: f64) -> f64 {
    libm::sqrt(not_negative(variance))
}

/// Six inertia terms xx, yy, zz, xy, xz, yz; `None` where not observable.
pub type InertiaEstimate = [Option<Estimate>; 6];

/// Covariance of ten numbers, in the squares and products of their SI units.
pub type Covariance = [[Option<f64>; 10]; 10];

/// Mass, CG relative to the point of solution, and inertia about that point, with the
/// covariance of these ten.
pub(super) struct Body<'w> {
    space: &'w Workspace,
    point: Vector3<f64>,
    mass_known: bool,
    indicator: Option<Estimate>,
    mass: f64,
    /// CG relative to `point`.
    r: Vector3<f64>,
    theta: [f64; 6],
    /// Of mass, or Δ where the mass is known, three of CG, six of inertia.
    covariance: SMatrix<f64, 10, 10>,
    /// Mass, three of CG, six of inertia.
    observable: [bool; 10],
}

impl<'w> Body<'w> {
    /// Of the last solution in `space`.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(super) fn new(space: &'w Workspace) -> Self {
        let solved = &space.solved;
        let known_mass = solved.known_mass;
        let s = &solved.sigma;
        let mut jacobian = SMatrix::<f64, 10, 10>::identity();
        let mut observable = solved.observable;
        let mass = match known_mass {
            // (7): the CG stands in σ itself, and the mass is exact.
            Some(m) => {
                observable[0] = true;
                m
            }
            // (6): divide the first moments by the mass.
            None => {
                for i in 1..4 {
                    observable[i] &= observable[0];
                    if observable[i] {
                        jacobian[(i, i)] = 1.0 / s[0];
                        jacobian[(i, 0)] = -s[i] / (s[0] * s[0]);
                    }
                }
                s[0]
            }
        };
        let divisor = if known_mass.is_some() { 1.0 } else { mass };
        let r = Vector3::from_fn(|i, _| {
            if observable[1 + i] {
                s[1 + i] / divisor
            } else {
                0.0
            }
        });
        let std = |j: usize| deviation(solved.covariance[(j, j)]);
        let indicator = (known_mass.is_some() && solved.observable[0]).then(|| Estimate {
            value: s[0],
            std: std(0),
        });
        let mut covariance = solved.covariance;
        multiply_left(&jacobian, &mut covariance);
        jacobian.transpose_mut();
        multiply_right(&mut covariance, &jacobian);
        Self {
            space,
            point: solved.point,
            mass_known: known_mass.is_some(),
            indicator,
            mass,
            r,
            theta: core::array::from_fn(|j| s[4 + j]),
            covariance,
            observable,
        }
    }

    /// Standard deviation of a sum of the terms about S with this gradient, and with these second derivatives by the centre
    /// of gravity, kg: with its covariance C and the second derivatives A, `½ tr A C A C` and the square of the mean `½ tr A C`
    /// join the variance of the first order.
    ///
    /// A centre that is told to a quarter of its distance bends the inertia about S by `m r²` of its error r. The first
    /// order knows nothing of that where the distance comes out near zero. With the errors of first order of the centre,
    /// those of the mass are in it; what is left is of third order.
    fn deviation(&self, gradient: &SVector<f64, 10>, curvature: &Matrix3<f64>) -> f64 {
        let first = (gradient.transpose() * self.covariance * gradient)[0];
        let bent = curvature * self.covariance.fixed_view::<3, 3>(1, 1);
        let mean = 0.5 * bent.trace();
        deviation(first + 0.5 * (bent * bent).trace() + mean * mean)
    }

    /// Adds the second derivatives by the centre of gravity of term `j` times a weight.
    fn bend(&self, j: usize, weight: f64, curvature: &mut Matrix3<f64>) {
        let mut subtract = |p: usize, q: usize| {
            let entries = &mut cells(curvature);
            entries[(p, q)] -= self.mass * weight;
            entries[(q, p)] -= self.mass * weight;
        };
        match TERMS.get(j) {
            Some(Term::Moment(p, q)) => {
                subtract(*p, *p);
                subtract(*q, *q);
            }
            Some(Term::Product(p, q)) => subtract(*p, *q),
            None => {}
        }
    }

    pub(super) fn mass(&self) -> Option<Estimate> {
        let std = if self.mass_known {
            0.0
        } else {
            deviation(self.covariance[(0, 0)])
        };
        self.observable[0].then_some(Estimate {
            value: self.mass,
            std,
        })
    }

    pub(super) fn indicator(&self) -> Option<Estimate> {
        self.indicator
    }

    pub(super) fn centre_of_gravity(&self) -> [Option<Estimate>; 3] {
        let (observable, covariance) = (seen(&self.observable[..]), seen(&self.covariance));
        let place = self.point + self.r;
        let place = seen(&place);
        core::array::from_fn(|i| {
            observable[1 + i].then(|| Estimate {
                value: place[i],
                std: deviation(covariance[(1 + i, 1 + i)]),
            })
        })
    }

    /// Inertia about the reference point, m, by the parallel-axis rule: a sum of the elements of σ,
    /// which may be determined though some of them are not.
    pub(super) fn inertia_about(&self, reference: &Vector3<f64>) -> InertiaEstimate {
        let c = reference - self.point;
        let solved = &self.space.solved;
        let known = seen(&solved.inertia_about_reference[..]);
        core::array::from_fn(|j| {
            let (sum, exact) = inertia_about(j, &c, solved.known_mass);
            known[j].then(|| Estimate {
                value: exact + sum.dot(&solved.sigma),
                std: deviation((sum.transpose() * solved.covariance * sum)[0]),
            })
        })
    }

    /// Inertia about S.
    pub(super) fn inertia_about_cg(&self) -> InertiaEstimate {
        core::array::from_fn(|j| {
            let (value, gradient) = self.term(j)?;
            let mut curvature = Matrix3::zeros();
            self.bend(j, 1.0, &mut curvature);
            let std = self.deviation(&gradient, &curvature);
            Some(Estimate { value, std })
        })
    }

    /// Standard deviation of a weighted sum of the six terms about S; unknown terms are
    /// left out.
    pub(super) fn deviation_about_cg(&self, weights: &[f64; 6]) -> f64 {
        let mut sum = SVector::<f64, 10>::zeros();
        let mut curvature = Matrix3::zeros();
        for (j, &weight) in weights.iter().enumerate() {
            if weight == 0.0 {
                continue;
            }
            if let Some((_, gradient)) = self.term(j) {
                sum.axpy(weight, &gradient, 1.0);
                self.bend(j, weight, &mut curvature);
            }
        }
        self.deviation(&sum, &curvature)
    }

    /// Covariance of mass or Δ, CG and inertia about S, of the first order; `None` in the row and
    /// the column of what is not observable.
    pub(super) fn covariance(&self) -> Covariance {
        let mut gradients = SMatrix::<f64, 10, 10>::identity();
        let mut known = self.observable;
        if self.mass_known {
            known[0] = self.indicator.is_some();
        }
        for j in 0..6 {
            let term = self.term(j);
            known[4 + j] = term.is_some();
            if let Some((_, gradient)) = term {
                gradients.row_mut(4 + j).copy_from(&gradient.transpose());
            }
        }
        let mut matrix = self.covariance;
        multiply_left(&gradients, &mut matrix);
        gradients.transpose_mut();
        multiply_right(&mut matrix, &gradients);
        core::array::from_fn(|i| {
            core::array::from_fn(|j| (known[i] && known[j]).then(|| matrix[(i, j)]))
        })
    }

    /// Θ about S, with its gradient: that about the point of solution less m `r r`.
    fn term(&self, j: usize) -> Option<(f64, SVector<f64, 10>)> {
        let mut g = SVector::<f64, 10>::zeros();
        let observable = seen(&self.observable[..]);
        let mut known = observable[0] && observable[4 + j];
        let mut value = seen(&self.theta[..])[j];
        let (r, m) = (seen(&self.r), self.mass);
        let slopes = &mut cells(&mut g);
        slopes[4 + j] = 1.0;
        let mut subtract = |p: usize, q: usize| {
            known &= observable[1 + p] && observable[1 + q];
            value -= m * r[p] * r[q];
            slopes[0] -= r[p] * r[q];
            slopes[1 + p] -= m * r[q];
            slopes[1 + q] -= m * r[p];
        };
        match TERMS.get(j)? {
            Term::Moment(p, q) => {
                subtract(*p, *p);
                subtract(*q, *q);
            }
            Term::Product(p, q) => subtract(*p, *q),
        }
        // A known mass is exact, and Δ stands in its place.
        if self.mass_known {
            g[0] = 0.0;
        }
        known.then_some((value, g))
    }
}

#[cfg(test)]
mod tests {
    use super::{Body, TERMS, Term, Workspace};
    use nalgebra::{Matrix3, Vector3};

    /// The six terms of the inertia about S less that about the point of solution.
    fn moved(mass: f64, r: &Vector3<f64>) -> [f64; 6] {
        core::array::from_fn(|j| match TERMS[j] {
            Term::Moment(p, q) => -mass * (r[p] * r[p] + r[q] * r[q]),
            Term::Product(p, q) => -mass * r[p] * r[q],
        })
    }

    /// A centre of gravity known to half its distance, and one that came out at the point of solution: the errors of the
    /// inertia about S, and of sums of its terms, have the mean square of a normal distribution. The three points of Gauss and
    /// Hermite along each axis give that of a polynomial of fourth order exactly.
    #[test]
    fn a_centre_that_is_hardly_told_widens_the_inertia() {
        const MASS: f64 = 3.0;
        let root = Matrix3::new(0.2, 0.0, 0.0, 0.05, 0.1, 0.0, -0.1, 0.02, 0.3);
        let mixed = [0.3, -1.0, 0.0, 0.7, 2.0, -0.4];
        for r in [Vector3::new(0.3, -0.1, 0.6), Vector3::zeros()] {
            let mut space = Workspace::EMPTY;
            let solved = &mut space.solved;
            solved.known_mass = Some(MASS);
            solved.observable = [true; 10];
            solved.sigma[0] = 1.0;
            solved.sigma.fixed_rows_mut::<3>(1).copy_from(&r);
            let covariance = root * root.transpose();
            (solved.covariance.fixed_view_mut::<3, 3>(1, 1)).copy_from(&covariance);
            let (mut expected, mut of_sum) = ([0.0; 6], 0.0);
            let points = [(-1.0, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.0, 1.0 / 6.0)];
            for (x, of_x) in points {
                for (y, of_y) in points {
                    for (z, of_z) in points {
                        let away = root * Vector3::new(x, y, z) * libm::sqrt(3.0);
                        let (there, here) = (moved(MASS, &(r + away)), moved(MASS, &r));
                        let share = of_x * of_y * of_z;
                        let error = |i: usize| there[i] - here[i];
                        for (i, square) in expected.iter_mut().enumerate() {
                            *square += error(i) * error(i) * share;
                        }
                        let sum: f64 = (0..6).map(|i| mixed[i] * error(i)).sum();
                        of_sum += sum * sum * share;
                    }
                }
            }
            let body = Body::new(&space);
            for (term, expected) in body.inertia_about_cg().iter().zip(expected) {
                let std = term.unwrap().std;
                assert!((std * std - expected).abs() < 1e-12, "{std} {expected}");
            }
            let std = body.deviation_about_cg(&mixed);
            assert!((std * std - of_sum).abs() < 1e-12, "{std} {of_sum}");
        }
    }
}

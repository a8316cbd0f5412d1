//! Equation (8): the measurement matrix B of one acceleration vector.

use crate::cells::{cells, seen};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// Six equations by ten unknowns.
pub(crate) type Measurement = SMatrix<f64, 6, 10>;

/// The ten unknowns of equation (6) or (7).
pub(super) type Vector10 = SVector<f64, 10>;

/// The rows of B for one acceleration vector about A, equation (8).
///
/// With `mass` the known mass (kg) the unknowns are those of equation (7),
/// `[Δ, x, y, z, Θxx, Θyy, Θzz, Θxy, Θxz, Θyz]`; with `mass` one they are those of
/// equation (6), where m, mx, my, mz take the first four places.
#[must_use]
#[rustfmt::skip]
pub(crate) fn measurement_matrix(acceleration: &Vector6<f64>, mass: f64) -> Measurement {
    let [ax, ay, az, alpha, beta, gamma] = (*acceleration).into();
    let m = mass;
    Measurement::from_row_slice(&[
        //  Δ        x          y          z       Θxx    Θyy   Θzz    Θxy     Θxz     Θyz
        m * ax,     0.0,   -m * gamma,  m * beta,  0.0,   0.0,  0.0,   0.0,    0.0,    0.0,
        m * ay,  m * gamma,    0.0,    -m * alpha, 0.0,   0.0,  0.0,   0.0,    0.0,    0.0,
        m * az, -m * beta,  m * alpha,     0.0,    0.0,   0.0,  0.0,   0.0,    0.0,    0.0,
          0.0,      0.0,      m * az,   -m * ay,  alpha,  0.0,  0.0,  -beta,  -gamma,  0.0,
          0.0,   -m * az,      0.0,      m * ax,   0.0,  beta,  0.0,  -alpha,  0.0,   -gamma,
          0.0,    m * ay,   -m * ax,      0.0,     0.0,   0.0, gamma,  0.0,   -alpha, -beta,
    ])
}

/// The two axes that a term of inertia multiplies: a moment about one axis is the sum of
/// the squares along the other two.
pub(super) const TERMS: [Term; 6] = [
    Term::Moment(1, 2),
    Term::Moment(0, 2),
    Term::Moment(0, 1),
    Term::Product(0, 1),
    Term::Product(0, 2),
    Term::Product(1, 2),
];

#[derive(Clone, Copy)]
pub(super) enum Term {
    Moment(usize, usize),
    Product(usize, usize),
}

/// Term `j` (below six) of the inertia about the point `c` (m), seen from that of σ, by the
/// parallel-axis rule: the coefficients of σ, and what a known mass (kg) adds to their sum, kg m².
#[must_use]
pub(super) fn inertia_about(
    j: usize,
    c: &Vector3<f64>,
    known_mass: Option<f64>,
) -> (Vector10, f64) {
    let c = seen(c);
    let mut sum = Vector10::zeros();
    let slopes = &mut cells(&mut sum);
    // The elements of (7) are lengths, those of (6) first moments.
    let (mut exact, weight) = (0.0, known_mass.unwrap_or(1.0));
    slopes[4 + j] = 1.0;
    let mut add = |p: usize, q: usize| {
        slopes[1 + q] -= weight * c[p];
        slopes[1 + p] -= weight * c[q];
        match known_mass {
            Some(mass) => exact += mass * c[p] * c[q],
            None => slopes[0] += c[p] * c[q],
        }
    };
    match TERMS.get(j) {
        Some(Term::Moment(p, q)) => {
            add(*p, *p);
            add(*q, *q);
        }
        Some(Term::Product(p, q)) => add(*p, *q),
        None => (),
    }
    (sum, exact)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigid_body::{Inertia, RigidBody};
    use nalgebra::Vector3;

    #[test]
    fn equation_8_is_equation_1_rearranged() {
        let body = RigidBody {
            mass: 3.0,
            centre_of_gravity: Vector3::new(0.1, -0.2, 0.3),
            inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
        };
        let reference = Vector3::new(-0.3, 0.2, 0.7);
        let a = Vector6::new(1.0, -2.0, 0.5, 0.3, 0.7, -0.9);
        let sigma = SVector::<f64, 10>::from(body.sigma(&reference));
        let force = body.mass_matrix(&reference) * a;
        // A dozen products below 10: ten roundings are 1e-14.
        assert!((measurement_matrix(&a, 1.0) * sigma - force).norm() < 1e-14);
        let mut known = sigma;
        for i in 0..4 {
            known[i] /= body.mass;
        }
        assert!((measurement_matrix(&a, body.mass) * known - force).norm() < 1e-14);
    }
}

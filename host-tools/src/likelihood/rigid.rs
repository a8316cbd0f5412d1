//! From σ to mass, centre of gravity and inertia, with their covariance.

use super::model::RIGID;
use massline_core::identify::Covariance;
use nalgebra::{Matrix6, SMatrix, Vector3};

/// σ of equation (6) from a mass matrix of equation (1), of which a plane model has rows and columns of
/// zeros: a first moment that is missing in one place stands in another.
#[must_use]
pub fn sigma_of(m: &Matrix6<f64>) -> [f64; RIGID] {
    let either = |a: f64, b: f64| if a == 0.0 { b } else { a };
    [
        either(m[(0, 0)], either(m[(1, 1)], m[(2, 2)])),
        either(m[(1, 5)], -m[(2, 4)]),
        either(m[(2, 3)], -m[(0, 5)]),
        either(m[(0, 4)], -m[(1, 3)]),
        m[(3, 3)],
        m[(4, 4)],
        m[(5, 5)],
        -m[(3, 4)],
        -m[(3, 5)],
        -m[(4, 5)],
    ]
}

/// Axes of the six terms xx, yy, zz, xy, xz, yz: a moment adds the squares along two axes.
const MOMENTS: [(usize, usize); 3] = [(1, 2), (0, 2), (0, 1)];
const PRODUCTS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Mass (kg), centre of gravity in the global frame (m) and inertia about it (kg m²) from σ about
/// `reference`, and their slopes with respect to σ. With a known mass the first number is the
/// indicator Δ of equation (7).
#[must_use]
pub fn numbers(
    sigma: &[f64; RIGID],
    reference: &Vector3<f64>,
    known_mass: Option<f64>,
) -> ([f64; RIGID], SMatrix<f64, RIGID, RIGID>) {
    let mass = known_mass.unwrap_or(sigma[0]);
    let r = [sigma[1] / mass, sigma[2] / mass, sigma[3] / mass];
    let mut values = *sigma;
    let mut slopes = SMatrix::<f64, RIGID, RIGID>::identity();
    for i in 0..3 {
        values[1 + i] = reference[i] + r[i];
        slopes[(1 + i, 1 + i)] = 1.0 / mass;
    }
    // Θ_S = Θ_A - s s / m with the first moments s.
    let mut take = |j: usize, p: usize, q: usize| {
        values[4 + j] -= mass * r[p] * r[q];
        slopes[(4 + j, 0)] += r[p] * r[q];
        slopes[(4 + j, 1 + p)] -= r[q];
        slopes[(4 + j, 1 + q)] -= r[p];
    };
    for (j, (p, q)) in MOMENTS.into_iter().enumerate() {
        take(j, p, p);
        take(j, q, q);
    }
    for (j, (p, q)) in PRODUCTS.into_iter().enumerate() {
        take(3 + j, p, q);
    }
    if known_mass.is_some() {
        // The mass in these is no longer σ's.
        values[0] = sigma[0] / mass;
        slopes.fill_column(0, 0.0);
        slopes[(0, 0)] = 1.0 / mass;
    } else {
        for i in 0..3 {
            slopes[(1 + i, 0)] = -r[i] / mass;
        }
    }
    (values, slopes)
}

/// Covariance of some of ten numbers, `None` for those that are not observable.
#[must_use]
pub fn covariance_of(
    matrix: &SMatrix<f64, RIGID, RIGID>,
    observable: &[bool; RIGID],
) -> Covariance {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| (observable[i] && observable[j]).then(|| matrix[(i, j)]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_core::rigid_body::{Inertia, RigidBody};

    #[test]
    fn numbers_are_those_of_the_body() {
        let reference = Vector3::new(0.4, 0.1, -0.3);
        let body = RigidBody {
            mass: 3.0,
            centre_of_gravity: Vector3::new(0.1, -0.2, 0.3),
            inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
        };
        let sigma = sigma_of(&body.mass_matrix(&reference));
        for (known, first) in [(None, 3.0), (Some(3.0), 1.0)] {
            let (values, slopes) = numbers(&sigma, &reference, known);
            let expected = [first, 0.1, -0.2, 0.3, 0.5, 0.6, 0.7, 0.05, -0.04, 0.03];
            for (a, b) in values.iter().zip(expected) {
                // Some ten roundings of numbers near one.
                assert!((a - b).abs() < 1e-14, "{known:?}: {a} {b}");
            }
            // Central differences of a function with third derivatives near one: h²/6.
            let h = 1e-4;
            for j in 0..RIGID {
                let at = |d: f64| {
                    let mut moved = sigma;
                    moved[j] += d;
                    numbers(&moved, &reference, known).0
                };
                let (up, down) = (at(h), at(-h));
                for i in 0..RIGID {
                    let slope = (up[i] - down[i]) / (2.0 * h);
                    let error = (slope - slopes[(i, j)]).abs();
                    assert!(error < 1e-7, "{known:?}: {i} {j}");
                }
            }
        }
    }
}

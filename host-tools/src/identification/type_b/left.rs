//! Errors of sensors by what a rigid body leaves.
//!
//! # Design
//!
//! Where a rigid body leaves more than noise does, the likely cause is sensors that are not quite where, or as
//! sensitive as, the setup says. Error bars that are widened by what is left (Birge's ratio) take it for noise, which
//! scatters from line to line; an error of a sensor is the same in all lines, and bends the numbers by several such
//! bars.
//!
//! * Of each usual error of each sensor the chain tells the change of the residuals `r` of the masslines, J, and of the
//!   numbers, T: one error is one column.
//! * Errors are `λ` times as large as usual ones, and `λ` is the one for which `r`, of the covariance `s² + λ² J Jᵀ`, is
//!   most likely. Of `s²` 1 is noise, and the rest is what columns that are derivatives leave of errors.
//! * Given `r`, the errors have the mean `e = -λ² Jᵀ (s² + λ² J Jᵀ)⁻¹ r` and the covariance
//!   `λ² - λ² Jᵀ (s² + λ² J Jᵀ)⁻¹ J λ²`. Nothing is mended by them: T e, which would mend the numbers, counts as
//!   uncertainty beside the covariance.

use super::super::consistency::{weighted, weights};
use super::{Contribution, NUMBERS};
use crate::likelihood::rigid_columns;
use massline_core::masslines::Masslines;
use nalgebra::{Complex, DMatrix, DVector, SMatrix};

/// Name of the source.
pub(super) const SOURCE: &str = "sensor errors, by the misfit";

/// Range of the decimal logarithm of λ, and steps in which it is looked for.
const DECADES: [f64; 2] = [-2.0, 4.0];
const STEPS: u32 = 240;

/// Share of the residuals that their derivatives leave: errors of some per cent are as much off by their squares.
const LINEAR: f64 = 0.05;

/// Share of the largest singular value from which a parameter is determined.
const DETERMINED: f64 = 1e-9;

/// What an error does.
#[derive(Clone, Debug)]
pub(super) struct Effect {
    /// Change of the numbers by one usual error.
    pub(super) numbers: [Option<f64>; NUMBERS],
    /// Change of the residuals.
    pub(super) residuals: DVector<f64>,
}

/// What a rigid body leaves of each equation of the masslines, in units of its noise; `None` where equations do not
/// carry the weights of their noise.
pub(super) fn residuals(sets: &[Masslines]) -> Option<DVector<f64>> {
    if sets.is_empty() || !weighted(sets) {
        return None;
    }
    let (mut rows, mut right) = (Vec::new(), Vec::new());
    for set in sets {
        let equations = set.equations().rows();
        for pair in set.pairs() {
            let columns = rigid_columns(&pair.acceleration.map(Complex::from));
            let columns = columns.map(|column| equations * column.map(|z| z.re));
            let force = equations * pair.force;
            let roots = weights(&pair.variance).map(f64::sqrt);
            for i in 0..6 {
                rows.extend(columns.iter().map(|column| column[i] * roots[i]));
                right.push(force[i] * roots[i]);
            }
        }
    }
    let is_number = |x: &f64| x.is_finite();
    if right.is_empty() || !rows.iter().chain(&right).all(is_number) {
        return None;
    }
    let mut scaled = DMatrix::from_row_iterator(right.len(), 10, rows);
    let right = DVector::from_vec(right);
    // Kilograms and kg m² mix: columns of one length.
    for mut column in scaled.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column /= length;
        }
    }
    let svd = scaled.svd(true, false);
    let (u, largest) = (svd.u?, svd.singular_values.max());
    let mut left = right;
    for (column, size) in u.column_iter().zip(svd.singular_values.iter()) {
        if *size > DETERMINED * largest {
            let along = column.dot(&left);
            left.axpy(-along, &column, 1.0);
        }
    }
    left.iter().all(|x| x.is_finite()).then_some(left)
}

/// The contributions of errors with these effects to the observable numbers, and λ, by what is left; `None` where half
/// of the effects are not known.
pub(super) fn contributions(
    left: &DVector<f64>,
    effects: &[Effect],
    observable: &[bool; NUMBERS],
) -> Option<(Vec<Contribution>, f64)> {
    let is_known = |e: &&Effect| {
        let mut numbers = e.numbers.iter().zip(observable);
        e.residuals.len() == left.len()
            && e.residuals.iter().all(|x| x.is_finite())
            && numbers.all(|(number, observable)| number.is_some() || !observable)
    };
    let known: Vec<&Effect> = effects.iter().filter(is_known).collect();
    if known.is_empty() || 2 * known.len() < effects.len() {
        return None;
    }
    let effects = known;
    let j = DMatrix::from_fn(left.len(), effects.len(), |i, s| effects[s].residuals[i]);
    let products = &j * j.transpose();
    if !products.iter().all(|x| x.is_finite()) {
        return None;
    }
    let both = products.symmetric_eigen();
    let along = both.eigenvectors.tr_mul(left);
    let power: Vec<f64> = both.eigenvalues.iter().map(|x| x.max(0.0)).collect();
    let told = power
        .iter()
        .filter(|p| **p > DETERMINED * both.eigenvalues.max());
    let noise = 1.0 + LINEAR * LINEAR * left.norm_squared() / told.count().max(1) as f64;
    let unlikely = |square: f64| -> f64 {
        let of = power.iter().zip(along.iter());
        of.map(|(p, z)| (square * p / noise).ln_1p() + z * z / (noise + square * p))
            .sum()
    };
    let [low, high] = DECADES;
    let times = (0..=STEPS)
        .map(|k| 10_f64.powf(low + (high - low) * f64::from(k) / f64::from(STEPS)))
        .min_by(|a, b| unlikely(a * a).total_cmp(&unlikely(b * b)))?;
    let square = times * times;
    // (s² + λ² J Jᵀ)⁻¹, in its own axes.
    let inverse = |vector: &DVector<f64>| {
        let mut own = both.eigenvectors.tr_mul(vector);
        for (x, p) in own.iter_mut().zip(&power) {
            *x /= noise + square * p;
        }
        &both.eigenvectors * own
    };
    let t = DMatrix::from_fn(NUMBERS, effects.len(), |k, s| {
        effects[s].numbers[k].unwrap_or(0.0)
    });
    let mend = &t * (j.tr_mul(&inverse(left)) * -square);
    let across = &j * t.transpose();
    let mut covariance = &t * t.transpose() * square;
    for k in 0..NUMBERS {
        let column = inverse(&across.column(k).into_owned());
        let explained = across.tr_mul(&column) * (square * square);
        for i in 0..NUMBERS {
            covariance[(i, k)] -= explained[i];
        }
    }
    let mut columns = vec![mend];
    columns.extend(roots(&covariance));
    let contribution = |column: &DVector<f64>| Contribution {
        source: SOURCE.to_owned(),
        numbers: std::array::from_fn(|k| observable[k].then_some(column[k])),
    };
    Some((columns.iter().map(contribution).collect(), times))
}

/// Columns whose squares sum to a covariance of numbers in different units.
fn roots(covariance: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let size: Vec<f64> = (0..NUMBERS)
        .map(|k| covariance[(k, k)].max(0.0).sqrt())
        .collect();
    let unit = |k: usize| if size[k] > 0.0 { 1.0 / size[k] } else { 0.0 };
    let scaled = SMatrix::<f64, NUMBERS, NUMBERS>::from_fn(|i, k| {
        0.5 * (covariance[(i, k)] + covariance[(k, i)]) * unit(i) * unit(k)
    });
    let own = scaled.symmetric_eigen();
    let pairs = own.eigenvalues.iter().zip(own.eigenvectors.column_iter());
    pairs
        .filter(|(value, _)| **value > 0.0)
        .map(|(value, vector)| DVector::from_fn(NUMBERS, |k, _| vector[k] * value.sqrt() * size[k]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Draws;
    use massline_core::rigid_body::{Inertia, RigidBody};
    use nalgebra::{Vector3, Vector6};

    #[test]
    fn a_rigid_body_leaves_nothing() {
        let body = RigidBody {
            mass: 800.0,
            centre_of_gravity: Vector3::new(0.04, -0.01, 0.9),
            inertia: Inertia {
                xx: 300.0,
                yy: 330.0,
                zz: 160.0,
                xy: 6.0,
                xz: 15.0,
                yz: 34.0,
            },
        };
        let reference = Vector3::new(0.1, 0.2, -0.3);
        let matrix = body.mass_matrix(&reference);
        let mut rng = Draws::new(5);
        let pairs: Vec<_> = (0..6)
            .map(|_| {
                let a = Vector6::from_fn(|_, _| rng.normal());
                (a, matrix * a)
            })
            .collect();
        let exact = Masslines::exact(reference, pairs.iter().copied()).unwrap();
        // Exact pairs have no noise to be weighed by.
        assert_eq!(residuals(&[exact]), None);
        assert_eq!(residuals(&[]), None);
    }

    /// Numbers that are bent by errors of unknown size are held by the intervals, as often as these say, on the mean over
    /// many draws, whatever the size.
    #[test]
    fn errors_are_held_as_often_as_is_said() {
        let mut rng = Draws::new(1);
        let (equations, sources) = (26, 40);
        for size in [0.3, 3.0, 30.0] {
            let (mut squares, mut sizes) = (0.0, 0.0);
            let draws = 300;
            for _ in 0..draws {
                let effects: Vec<Effect> = (0..sources)
                    .map(|_| Effect {
                        numbers: std::array::from_fn(|_| Some(rng.normal())),
                        residuals: DVector::from_fn(equations, |_, _| 5.0 * rng.normal()),
                    })
                    .collect();
                let errors: Vec<f64> = (0..sources).map(|_| size * rng.normal()).collect();
                let mut left = DVector::from_fn(equations, |_, _| rng.normal());
                let mut off = 0.0;
                for (effect, error) in effects.iter().zip(&errors) {
                    left += &effect.residuals * *error;
                    off += effect.numbers[3].unwrap() * error;
                }
                let (found, times) = contributions(&left, &effects, &[true; NUMBERS]).unwrap();
                // The first is what would mend the numbers; the others are about that.
                let of = |c: &Contribution| c.numbers[3].unwrap();
                let about: f64 = found[1..].iter().map(|c| of(c).powi(2)).sum();
                squares += (off + of(&found[0])).powi(2) / about;
                sizes += times / size;
            }
            let n = f64::from(draws);
            // A mean square of normal numbers, with λ known to a seventh (26 equations): four deviations, and as
            // much for the square of that.
            let bound = 4.0 * (2.0 / n).sqrt() + 0.06;
            assert!((squares / n - 1.0).abs() < bound, "{size}: {}", squares / n);
            assert!((sizes / n - 1.0).abs() < 0.1, "{size}: {}", sizes / n);
        }
    }

    /// One error and one equation: `e = -λ² j r / (s² + λ² j²)` where `s² + λ² j² = r²` is most likely.
    #[test]
    fn one_error_is_that_of_the_closed_form() {
        let mut numbers = [None; NUMBERS];
        numbers[0] = Some(7.0);
        let effect = Effect {
            numbers,
            residuals: DVector::from_element(1, 2.0),
        };
        let left = DVector::from_element(1, 10.0);
        let mut first = [false; NUMBERS];
        first[0] = true;
        let (found, times) = contributions(&left, &[effect], &first).unwrap();
        let noise = 1.0 + LINEAR * LINEAR * 100.0;
        let square = (100.0 - noise) / 4.0;
        // λ is looked for in steps of 6 %.
        assert!((times * times / square - 1.0).abs() < 0.07, "{times}");
        let square = times * times;
        let mean = -7.0 * square * 2.0 * 10.0 / (noise + 4.0 * square);
        let variance = 49.0 * square * noise / (noise + 4.0 * square);
        let of = |c: &Contribution| c.numbers[0].unwrap();
        assert!((of(&found[0]) / mean - 1.0).abs() < 1e-12);
        let about: f64 = found[1..].iter().map(|c| of(c).powi(2)).sum();
        assert!((about / variance - 1.0).abs() < 1e-9, "{about} {variance}");
        assert!(
            found
                .iter()
                .all(|c| c.numbers[1..].iter().all(Option::is_none))
        );
    }

    #[test]
    fn effects_on_other_equations_tell_nothing() {
        let effect = Effect {
            numbers: [Some(1.0); NUMBERS],
            residuals: DVector::zeros(0),
        };
        let left = DVector::from_element(3, 1.0);
        let all = [true; NUMBERS];
        let known = |numbers: Option<f64>, residual: f64| Effect {
            numbers: [numbers; NUMBERS],
            residuals: DVector::from_element(3, residual),
        };
        let sound = known(Some(1.0), 2.0);
        for other in [effect, known(None, 2.0), known(Some(1.0), f64::NAN)] {
            assert!(contributions(&left, std::slice::from_ref(&other), &all).is_none());
            // One of two is enough, and counts by itself.
            let both = contributions(&left, &[other, sound.clone()], &all).unwrap();
            assert_eq!(
                both,
                contributions(&left, std::slice::from_ref(&sound), &all).unwrap()
            );
        }
        assert!(contributions(&left, &[], &all).is_none());
    }
}

//! Consistency of the data with a rigid body, as a test with its distribution.
//!
//! Masslines hold more equations than there are unknowns. What a rigid body leaves of them, in
//! units of what noise leaves, is a sum of as many squares as there are equations too many; the
//! noise was itself estimated from the scatter of the lines. The ratio of both is distributed as
//! Fisher's F with these two numbers of degrees of freedom, and as χ² over its degrees of
//! freedom where the noise counts as known.
//!
//! If equations do not carry the weights of their noise (some set-ups of methods a to e), and
//! of static poses, whose residuals are too few to tell how they correlate, the sum is one of
//! unequal squares. Of all such sums with one mean, a single square has the
//! heaviest tail, so that one degree of freedom bounds the probability.

use massline_core::identify::Identification;
use massline_core::masslines::Masslines;
use nalgebra::Vector6;
use statrs::function::beta::checked_beta_reg;
use statrs::function::gamma::checked_gamma_ur;

/// Probability below which what a rigid body leaves is worth a warning: one sound test of a
/// thousand.
pub const WARNED: f64 = 1e-3;

/// Probability below which numbers are refused, where what is left is not small besides.
pub const REFUSED: f64 = 1e-9;

/// Residual of the rigid body, compared with that of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// Power that is left over power that noise leaves: about one when all is well.
    pub ratio: f64,
    /// Equations beyond the unknowns.
    pub surplus: f64,
    /// Degrees of freedom of the estimate of noise; infinite where it is known.
    pub freedom: f64,
    /// Probability that noise alone leaves as much or more.
    pub probability: f64,
}

impl Consistency {
    /// The test of an identification from `sets`; `None` where there are no equations too many.
    pub(super) fn of(i: &Identification, sets: &[Masslines]) -> Option<Self> {
        let ratio = i.consistency?;
        let surplus = surplus(i, ratio, sets).unwrap_or(1.0);
        Some(Self::new(ratio, surplus, i.freedom))
    }

    /// The same where squares are unequal or masslines not at hand: the bound of one degree of
    /// freedom.
    pub(crate) fn bound(i: &Identification) -> Option<Self> {
        Some(Self::new(i.consistency?, 1.0, i.freedom))
    }

    fn new(ratio: f64, surplus: f64, freedom: f64) -> Self {
        Self {
            ratio,
            surplus,
            freedom,
            probability: exceeded(ratio, surplus, freedom),
        }
    }
}

/// Probability that F with these degrees of freedom exceeds `ratio`.
pub(super) fn exceeded(ratio: f64, surplus: f64, freedom: f64) -> f64 {
    if ratio.is_nan() {
        // What is no number is consistent with nothing.
        return 0.0;
    }
    if ratio <= 0.0 {
        return 1.0;
    }
    if freedom.is_infinite() {
        return checked_gamma_ur(surplus / 2.0, surplus * ratio / 2.0).unwrap_or(0.0);
    }
    if freedom < 1.0 {
        // Nothing is known of the noise.
        return 1.0;
    }
    let share = freedom / (freedom + surplus * ratio);
    checked_beta_reg(freedom / 2.0, surplus / 2.0, share).unwrap_or(0.0)
}

/// Equations beyond the unknowns, from what the core says of their sum of squares: the share of
/// the forces' squares that is left, and that sum over the equations too many. `None` where
/// equations do not carry the weights of their noise, and where nothing is left.
fn surplus(i: &Identification, ratio: f64, sets: &[Masslines]) -> Option<f64> {
    if !weighted(sets) || ratio <= 0.0 {
        return None;
    }
    let (mut squares, mut rows) = (0.0, 0.0);
    for set in sets {
        for pair in set.pairs() {
            let force: Vector6<f64> = set.equations().rows() * pair.force;
            squares += force.dot(&force.component_mul(&weights(&pair.variance)));
            rows += set.equations().count() as f64;
        }
    }
    let surplus = (i.misfit * i.misfit * squares / ratio).round();
    // Anything else is no number of equations.
    (1.0..rows).contains(&surplus).then_some(surplus)
}

/// `true` if equations carry the weights of their noise.
pub(super) fn weighted(sets: &[Masslines]) -> bool {
    sets.iter().all(|set| {
        set.equations().is_whitened() && set.pairs().iter().all(|pair| pair.variance.max() > 0.0)
    })
}

/// Weights of the equations of a pair as the core has them: inverse variances, none far above
/// the others.
pub(super) fn weights(variance: &Vector6<f64>) -> Vector6<f64> {
    const SMALLEST: f64 = 1e-6;
    let largest = variance.max();
    variance.map(|v| 1.0 / v.max(SMALLEST * largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// mpmath's `betainc` and `gammainc`, regularised, with 40 digits.
    #[test]
    fn probabilities_are_those_of_mpmath() {
        for (ratio, surplus, freedom, expected) in MPMATH {
            let found = exceeded(ratio, surplus, freedom);
            // Both are continued fractions that end at rounding of a sum of some tens.
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{ratio} {surplus} {freedom}: {found:e} {expected:e}"
            );
        }
    }

    #[test]
    fn what_is_no_number_is_consistent_with_nothing() {
        assert_eq!(exceeded(f64::NAN, 8.0, 100.0), 0.0);
        assert_eq!(exceeded(f64::INFINITY, 8.0, 100.0), 0.0);
        assert_eq!(exceeded(0.0, 8.0, 100.0), 1.0);
        assert_eq!(exceeded(1e9, 8.0, 0.5), 1.0);
    }

    /// One degree of freedom bounds the probability of any mixture of squares far out.
    #[test]
    fn one_square_has_the_heaviest_tail() {
        for freedom in [8.0, 60.0, f64::INFINITY] {
            let mut before = 1.0;
            for surplus in [1.0, 2.0, 5.0, 26.0] {
                let now = exceeded(20.0, surplus, freedom);
                assert!(now < before, "{surplus} {freedom}");
                before = now;
            }
        }
    }

    #[rustfmt::skip]
    const MPMATH: [(f64, f64, f64, f64); 8] = [
        (1.0, 8.0, 100.0, 0.4409647758938605),
        (2.5, 8.0, 60.0, 0.02054810175018732),
        (6.0, 26.0, 150.0, 3.8520476661163845e-13),
        (37.3, 1.0, 8.0, 0.00028712981069588494),
        (12.0, 4.0, 20.0, 3.903754297663495e-05),
        (3.0, 10.0, f64::INFINITY, 0.0008566412107753004),
        (7.0, 26.0, f64::INFINITY, 2.333270902870421e-25),
        (37.3, 1.0, f64::INFINITY, 1.0128460462528371e-09),
    ];
}

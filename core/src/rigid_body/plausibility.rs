//! Could a body with these properties exist? Each condition is held, violated, or within
//! its error bar of both.

use super::PrincipalInertia;

/// Share of the largest principal moment that rounding of the solve may be worth.
const ROUNDING: f64 = 1e-12;

/// A number and half of its 95 % interval, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounded {
    /// The number.
    pub value: f64,
    /// Half of its 95 % interval; zero for an exact number.
    pub half_width: f64,
}

/// Answer to a condition, or to all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// It holds by more than its error bar.
    Holds,
    /// It is violated by more than its error bar.
    Violated,
    /// The error bar allows both, or too little is observable.
    Undecided,
}

/// Distance of one condition from its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Margin {
    /// The distance from the condition's limit, as a share of the quantity it is taken from;
    /// negative is violated.
    pub relative: f64,
    /// Half of its 95 % interval, as a share of the same.
    pub uncertainty: f64,
}

impl Margin {
    fn new(left: f64, half_width: f64, scale: f64) -> Self {
        let scale = if scale > 0.0 { scale } else { 1.0 };
        Self {
            relative: left / scale,
            uncertainty: half_width / scale,
        }
    }

    /// The verdict on the condition, with its error bar.
    #[must_use]
    pub fn verdict(self) -> Verdict {
        if self.relative > self.uncertainty {
            Verdict::Holds
        } else if self.relative < -self.uncertainty {
            Verdict::Violated
        } else {
            Verdict::Undecided
        }
    }
}

/// The three conditions every body of positive mass density obeys. A condition that
/// needs a parameter nobody could observe is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Plausibility {
    /// m > 0, as a share of its absolute value.
    pub mass: Option<Margin>,
    /// Inertia about S positive definite: the smallest principal moment over the largest
    /// absolute one. Where only some moments about S are known, the smallest of these.
    pub positive_definite: Option<Margin>,
    /// The largest principal moment is at most the sum of the other two: the difference
    /// over the largest absolute one. A flat plate has zero.
    pub triangle: Option<Margin>,
}

impl Plausibility {
    /// The verdict on the existence of such a body. It is [`Verdict::Undecided`], too, where the
    /// mass or every moment about S is unknown; a plane problem is judged by the moments it knows.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let all = [self.mass, self.positive_definite, self.triangle];
        let any = |wanted| all.iter().flatten().any(|m| m.verdict() == wanted);
        if any(Verdict::Violated) {
            Verdict::Violated
        } else if any(Verdict::Undecided) || self.mass.is_none() || self.positive_definite.is_none()
        {
            Verdict::Undecided
        } else {
            Verdict::Holds
        }
    }

    /// The condition that is violated, or the one that cannot be judged; `None` if all hold.
    #[must_use]
    pub fn reason(&self) -> Option<&'static str> {
        let is = |m: Option<Margin>, verdict| m.is_some_and(|m| m.verdict() == verdict);
        let first = |verdict| {
            let conditions = [self.mass, self.positive_definite, self.triangle];
            conditions.iter().position(|m| is(*m, verdict))
        };
        match self.verdict() {
            Verdict::Holds => None,
            Verdict::Violated => Some(match first(Verdict::Violated) {
                Some(0) => "the mass is not positive",
                Some(1) => "the inertia about the CG is not positive definite",
                _ => "the largest principal moment of inertia exceeds the sum of the other two",
            }),
            Verdict::Undecided => Some(match first(Verdict::Undecided) {
                Some(0) => "the mass is zero to within its error bar",
                Some(1) => {
                    "the smallest moment of inertia about the CG is zero to within its error bar"
                }
                Some(_) => {
                    "the largest principal moment of inertia is the sum of the other two to within its error bar"
                }
                None if self.mass.is_none() => "the mass is not observable",
                None => "no moment of inertia about the CG is observable",
            }),
        }
    }
}

/// Moments of inertia about S, as far as they are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Moments<'a> {
    /// All six terms are known, hence principal moments.
    Principal(&'a PrincipalInertia),
    /// Those about x, y and z that are observable, kg m².
    Some([Option<Bounded>; 3]),
}

/// Checks what is known of a body.
///
/// `half_width` gives half of the 95 % interval of a weighted sum of the six terms of inertia
/// about S (xx, yy, zz, xy, xz, yz), kg m²; it is asked for principal moments only.
#[must_use]
#[inline(never)] // Not on the stack of what else its caller does.
pub(crate) fn check(
    mass: Option<Bounded>,
    moments: &Moments<'_>,
    half_width: impl Fn(&[f64; 6]) -> f64,
) -> Plausibility {
    let mass = mass.map(|m| Margin::new(m.value, m.half_width, m.value.abs()));
    match moments {
        Moments::Principal(p) => {
            let m = p.moments;
            let scale = m.amax();
            let rounding = ROUNDING * scale;
            let [smallest, middle, largest] = [0, 1, 2].map(|k| gradient(p, k));
            let mut triangle = smallest;
            let others = middle.iter().zip(&largest);
            for (sum, (middle, largest)) in triangle.iter_mut().zip(others) {
                *sum += middle - largest;
            }
            let margin =
                |left, weights| Margin::new(left, half_width(weights).max(rounding), scale);
            Plausibility {
                mass,
                positive_definite: Some(margin(m[0], &smallest)),
                triangle: Some(margin(m[0] + m[1] - m[2], &triangle)),
            }
        }
        Moments::Some(known) => {
            let scale = known
                .iter()
                .flatten()
                .fold(0.0, |a: f64, m| a.max(m.value.abs()));
            let margins = known
                .iter()
                .flatten()
                .map(|m| Margin::new(m.value, m.half_width, scale));
            Plausibility {
                mass,
                positive_definite: margins.reduce(worse),
                triangle: None,
            }
        }
    }
}

/// A violation before what might be one, and the nearer to it first.
fn worse(a: Margin, b: Margin) -> Margin {
    let violated = |m: Margin| m.verdict() == Verdict::Violated;
    let nearer = match (violated(a), violated(b)) {
        (true, false) => true,
        (false, true) => false,
        _ => a.relative - a.uncertainty <= b.relative - b.uncertainty,
    };
    if nearer { a } else { b }
}

/// Change of principal moment `k` with the six terms: `vᵀ dΘ v` about its axis v, with the
/// products entering the tensor twice and with a minus sign.
fn gradient(p: &PrincipalInertia, k: usize) -> [f64; 6] {
    let v = p.axes.column(k);
    let (x, y, z) = (v[0], v[1], v[2]);
    [
        x * x,
        y * y,
        z * z,
        -2.0 * x * y,
        -2.0 * x * z,
        -2.0 * y * z,
    ]
}

#[cfg(test)]
mod tests {
    use super::super::Inertia;
    use super::*;

    /// A body of 1 kg whose terms of inertia about S are known to `half`, independently.
    fn verdict(terms: [f64; 6], half: f64) -> Plausibility {
        let principal = Inertia::from_terms(terms).principal();
        check(
            bounded(1.0, 0.0),
            &Moments::Principal(&principal),
            |weights| half * libm::sqrt(weights.iter().map(|w| w * w).sum()),
        )
    }

    fn bounded(value: f64, half_width: f64) -> Option<Bounded> {
        Some(Bounded { value, half_width })
    }

    fn of_moment(mass: Option<Bounded>, moment: Option<Bounded>) -> Plausibility {
        check(mass, &Moments::Some([None, moment, None]), |_| 0.0)
    }

    #[test]
    fn a_plate_is_at_the_limit_and_beyond_it_is_not_possible() {
        let plate = verdict([1.0, 2.0, 3.0, 0.0, 0.0, 0.0], 0.0);
        assert_eq!(plate.verdict(), Verdict::Undecided);
        let thick = verdict([1.0, 2.0, 2.9, 0.0, 0.0, 0.0], 0.0);
        assert_eq!(thick.verdict(), Verdict::Holds);
        let impossible = verdict([1.0, 2.0, 3.1, 0.0, 0.0, 0.0], 0.0);
        assert_eq!(impossible.verdict(), Verdict::Violated);
        assert!((impossible.triangle.unwrap().relative + 0.1 / 3.1).abs() < 1e-11);
    }

    #[test]
    fn a_large_product_makes_it_indefinite() {
        let v = verdict([1.0, 1.0, 1.5, 1.2, 0.0, 0.0], 0.0);
        assert_eq!(
            v.reason(),
            Some("the inertia about the CG is not positive definite")
        );
    }

    #[test]
    fn a_negative_mass_is_named_first() {
        let v = of_moment(bounded(-1.0, 0.1), bounded(0.2, 0.01));
        assert_eq!(v.reason(), Some("the mass is not positive"));
        assert_eq!(v.positive_definite.unwrap().verdict(), Verdict::Holds);
    }

    /// One load cell reversed, and error bars so wide that two negative principal moments
    /// were once called plausible.
    #[test]
    fn wide_error_bars_make_no_body_plausible() {
        let reversed = [-16.7, -3.6, 15.0, 0.0, 0.0, 0.0];
        let wide = verdict(reversed, 25.0);
        assert_eq!(wide.verdict(), Verdict::Undecided);
        assert!(wide.reason().unwrap().contains("error bar"));
        // The triangle's margin is (-16.7 - 3.6 - 15) / 16.7, of whichever width.
        let triangle = wide.triangle.unwrap();
        assert!((triangle.relative + 35.3 / 16.7).abs() < 1e-12);
        assert!((triangle.uncertainty - 25.0 * libm::sqrt(3.0) / 16.7).abs() < 1e-12);
        assert_eq!(verdict(reversed, 5.0).verdict(), Verdict::Violated);
    }

    /// -1e-6 ± 1 kg m² in a plane problem was once a violation.
    #[test]
    fn error_bars_count_in_a_plane_problem() {
        let undecided = of_moment(bounded(1.0, 0.0), bounded(-1e-6, 1.0));
        assert_eq!(undecided.verdict(), Verdict::Undecided);
        let violated = of_moment(bounded(1.0, 0.0), bounded(-1.0, 0.9));
        assert_eq!(violated.verdict(), Verdict::Violated);
        let held = of_moment(bounded(1.0, 0.0), bounded(1.0, 0.9));
        assert_eq!((held.verdict(), held.reason()), (Verdict::Holds, None));
        let mass = of_moment(bounded(1.0, 1.1), bounded(1.0, 0.9));
        assert_eq!(mass.verdict(), Verdict::Undecided);
    }

    #[test]
    fn a_mass_alone_is_not_enough_to_judge() {
        let v = of_moment(bounded(1.0, 0.01), None);
        assert_eq!(v.verdict(), Verdict::Undecided);
        assert_eq!(
            v.reason(),
            Some("no moment of inertia about the CG is observable")
        );
        assert_eq!(of_moment(None, None).verdict(), Verdict::Undecided);
    }

    #[test]
    fn of_several_moments_the_violated_one_speaks() {
        let moments = [bounded(-0.1, 5.0), bounded(-1.0, 0.2), bounded(3.0, 0.1)];
        let v = check(bounded(1.0, 0.0), &Moments::Some(moments), |_| 0.0);
        assert_eq!(v.verdict(), Verdict::Violated);
    }

    #[test]
    fn the_gradient_of_principal_moments_is_their_difference_quotient() {
        let terms = [1.0, 2.0, 2.5, 0.3, -0.2, 0.4];
        let p = Inertia::from_terms(terms).principal();
        for k in 0..3 {
            let g = gradient(&p, k);
            for j in 0..6 {
                let step = 1e-6;
                let moved = |by: f64| {
                    let mut t = terms;
                    t[j] += by;
                    Inertia::from_terms(t).principal().moments[k]
                };
                let quotient = (moved(step) - moved(-step)) / (2.0 * step);
                // Second differences of order one times 1e-12, rounding of 1e-16 over 1e-6.
                assert!((quotient - g[j]).abs() < 1e-8, "{k} {j}");
            }
        }
    }

    #[test]
    fn numbers_that_are_none_decide_nothing() {
        for (value, half_width) in [
            (f64::NAN, 1.0),
            (1.0, f64::NAN),
            (f64::INFINITY, f64::INFINITY),
        ] {
            let some = Some(Bounded { value, half_width });
            assert_eq!(of_moment(some, some).verdict(), Verdict::Undecided);
        }
    }
}

//! Could a body with these properties exist?

use super::Inertia;

/// How far one condition is from being violated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// What is left, as a share of the quantity it is taken from; negative is violated.
    pub relative: f64,
}

impl Margin {
    fn new(left: f64, scale: f64) -> Self {
        let relative = if scale > 0.0 { left / scale } else { left };
        Self { relative }
    }

    /// Whether the condition holds.
    #[must_use]
    pub fn holds(self) -> bool {
        self.relative >= 0.0
    }
}

/// The three conditions every body of positive mass density obeys. A condition that
/// needs a parameter nobody could observe is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plausibility {
    /// m > 0.
    pub mass: Option<Margin>,
    /// Inertia about S positive definite: the smallest principal moment over the largest.
    pub positive_definite: Option<Margin>,
    /// The largest principal moment is at most the sum of the other two; what is left
    /// over the largest. A flat plate has zero.
    pub triangle: Option<Margin>,
}

impl Plausibility {
    /// Whether no condition that could be checked is violated.
    #[must_use]
    pub fn ok(&self) -> bool {
        self.first_violation().is_none()
    }

    /// What is wrong, if anything.
    #[must_use]
    pub fn first_violation(&self) -> Option<&'static str> {
        let broken = |m: Option<Margin>| m.is_some_and(|m| !m.holds());
        if broken(self.mass) {
            Some("the mass is not positive")
        } else if broken(self.positive_definite) {
            Some("the inertia about the CG is not positive definite")
        } else if broken(self.triangle) {
            Some("the largest principal moment of inertia exceeds the sum of the other two")
        } else {
            None
        }
    }
}

/// Checks what is known. `rounding` is the relative error up to which a violated
/// triangle is the flat plate's rounding and not a violation.
///
/// `moments_about_cg` are the diagonal terms about S that could be observed; a plane
/// problem knows one of them, and that must be positive too.
#[must_use]
pub fn check(
    mass: Option<f64>,
    inertia_about_cg: Option<&Inertia>,
    moments_about_cg: &[Option<f64>; 3],
    rounding: f64,
) -> Plausibility {
    let mass = mass.map(|m| Margin {
        relative: if m > 0.0 { 1.0 } else { -1.0 },
    });
    match inertia_about_cg {
        Some(inertia) => {
            let m = inertia.principal().moments;
            let forgiven = rounding * m[2].abs();
            Plausibility {
                mass,
                positive_definite: Some(Margin::new(m[0] + forgiven, m[2].abs())),
                triangle: Some(Margin::new(m[0] + m[1] - m[2] + forgiven, m[2].abs())),
            }
        }
        None => {
            let smallest = moments_about_cg.iter().flatten().copied().reduce(f64::min);
            Plausibility {
                mass,
                positive_definite: smallest.map(|s| Margin::new(s, s.abs())),
                triangle: None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(terms: [f64; 6]) -> Plausibility {
        check(
            Some(1.0),
            Some(&Inertia::from_terms(terms)),
            &[None; 3],
            1e-12,
        )
    }

    #[test]
    fn a_plate_is_just_possible_and_less_is_not() {
        assert!(verdict([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]).ok());
        let impossible = verdict([1.0, 2.0, 3.1, 0.0, 0.0, 0.0]);
        assert!(!impossible.ok());
        assert!((impossible.triangle.unwrap().relative + 0.1 / 3.1).abs() < 1e-11);
    }

    #[test]
    fn a_large_product_makes_it_indefinite() {
        let v = verdict([1.0, 1.0, 1.5, 1.2, 0.0, 0.0]);
        assert_eq!(
            v.first_violation(),
            Some("the inertia about the CG is not positive definite")
        );
    }

    #[test]
    fn a_negative_mass_is_named_first() {
        let v = check(Some(-1.0), None, &[None, Some(0.2), None], 0.0);
        assert_eq!(v.first_violation(), Some("the mass is not positive"));
        assert!(v.positive_definite.unwrap().holds());
    }
}

//! Units that suit the numbers, and what an error is a percentage of.

use super::TrueBody;
use crate::result::{InertiaTerms, ResultDocument};

/// A unit and how much of the SI unit it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    pub symbol: &'static str,
    pub si: f64,
}

impl Unit {
    pub const MILLIMETRE: Self = Self::new("mm", 1e-3);
    pub const METRE: Self = Self::new("m", 1.0);
    pub const ONE: Self = Self::new("", 1.0);

    const fn new(symbol: &'static str, si: f64) -> Self {
        Self { symbol, si }
    }

    /// Kilograms, or grams for what weighs less than a tenth of one.
    pub fn of_mass(largest: f64) -> Self {
        match largest.abs() {
            m if m < 1e-4 => Self::new("mg", 1e-6),
            m if m < 0.1 => Self::new("g", 1e-3),
            _ => Self::new("kg", 1.0),
        }
    }

    /// The unit in which the largest of some inertia terms has digits before the point.
    pub fn of_inertia(largest: f64) -> Self {
        match largest.abs() {
            t if t < 1e-4 => Self::new("mg m²", 1e-6),
            t if t < 0.1 => Self::new("g m²", 1e-3),
            _ => Self::new("kg m²", 1.0),
        }
    }
}

/// References of errors and error bars in per cent, on the terminal as in the report.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Natural {
    /// The whole mass, kg.
    pub mass: Option<f64>,
    /// Radius of gyration about the CG, m: the largest of those known; without any, the
    /// distance of the CG from the reference point.
    pub length: Option<f64>,
    /// Largest moment of inertia about the CG, kg m².
    pub inertia: Option<f64>,
}

impl Natural {
    /// The truth's where it has them, else those of the answer.
    pub fn new(result: &ResultDocument, truth: Option<&TrueBody>) -> Self {
        let positive = |x: &f64| x.is_finite() && *x > 0.0;
        let largest = |terms: &mut dyn Iterator<Item = Option<f64>>| {
            terms.flatten().filter(positive).reduce(f64::max)
        };
        let mass = truth
            .and_then(|t| t.mass)
            .or(result.mass.value)
            .filter(positive);
        let inertia = truth
            .and_then(|t| largest(&mut t.inertia_cg[..3].iter().copied()))
            .or(largest(&mut result.inertia_cg.moments()));
        let length = mass.zip(inertia).map(|(m, t)| (t / m).sqrt()).or_else(|| {
            let known = result.centre_of_gravity.iter().zip(result.reference_point);
            let known = known.filter_map(|(number, a)| Some(number.value? - a));
            let distance = known.map(|d| d * d).sum::<f64>().sqrt();
            Some(distance).filter(positive)
        });
        Self {
            mass,
            length,
            inertia,
        }
    }
}

/// Reference of errors of inertia about a point: the largest true moment about it, or
/// the largest of those found, kg m².
pub(crate) fn largest_moment(
    terms: &InertiaTerms,
    truth: Option<&[Option<f64>; 6]>,
) -> Option<f64> {
    let positive = |t: &f64| t.is_finite() && *t > 0.0;
    let true_moments = truth.iter().flat_map(|t| &t[..3]).flatten().copied();
    let found = terms.moments().flatten().map(f64::abs);
    true_moments
        .filter(positive)
        .reduce(f64::max)
        .or(found.filter(positive).reduce(f64::max))
}

/// A length that makes rotations comparable with translations: the radius of gyration
/// about the reference point as far as it is known, else a tenth of a metre.
pub(super) fn lever(result: &ResultDocument) -> f64 {
    let moments = result.inertia_reference.moments().flatten();
    let largest = moments.fold(0.0, f64::max);
    match result.mass.value {
        Some(mass) if mass > 0.0 && largest > 0.0 => (largest / mass).sqrt(),
        _ => 0.1,
    }
}

/// A factor that gives an axis short labels, and what to write before its unit.
pub(super) fn axis_factor(largest: f64) -> (f64, String) {
    if !(largest.is_finite() && largest > 0.0) || (0.01..1e5).contains(&largest) {
        return (1.0, String::new());
    }
    let thirds = libm::floor(libm::log10(largest) / 3.0).clamp(-9.0, 9.0) as i32;
    let exponent = 3 * thirds;
    (
        super::number::power_of_ten(-exponent),
        format!("{} ", super::number::ten_to(exponent)),
    )
}

//! The numbers of a document by name, with their units.

use super::{Number, ResultDocument};
use crate::identification::{LIKELIHOOD, LIKELIHOOD_IN_WORDS, STATIC_POSES};
use massline_core::masslines::Method;

/// The point that a number refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// None: a mass is the same about every point.
    Nothing,
    /// The origin of the global frame.
    Origin,
    /// The reference point A.
    Reference,
    /// The centre of gravity S.
    CentreOfGravity,
}

/// One of the numbers of a document.
#[derive(Clone, Copy, Debug)]
pub struct Property<'a> {
    /// Name, as the keys of the document have it.
    pub name: &'static str,
    /// SI unit; `1` for a ratio.
    pub unit: &'static str,
    /// The point that the number refers to.
    pub about: About,
    /// Value and error bars.
    pub number: &'a Number,
}

const CENTRE: [&str; 3] = [
    "centre_of_gravity.x",
    "centre_of_gravity.y",
    "centre_of_gravity.z",
];
const REFERENCE: [&str; 6] = [
    "inertia_reference.xx",
    "inertia_reference.yy",
    "inertia_reference.zz",
    "inertia_reference.xy",
    "inertia_reference.xz",
    "inertia_reference.yz",
];
const CG: [&str; 6] = [
    "inertia_cg.xx",
    "inertia_cg.yy",
    "inertia_cg.zz",
    "inertia_cg.xy",
    "inertia_cg.xz",
    "inertia_cg.yz",
];

impl ResultDocument {
    /// Mass, indicator Δ where the mass was known, centre of gravity, inertia about A and about
    /// S, in this order.
    #[must_use]
    pub fn properties(&self) -> Vec<Property<'_>> {
        let of = |unit, about| {
            move |(name, number)| Property {
                name,
                unit,
                about,
                number,
            }
        };
        let indicator = self.indicator.iter().map(|number| ("indicator", number));
        let centre = CENTRE.into_iter().zip(&self.centre_of_gravity);
        let reference = REFERENCE.into_iter().zip(self.inertia_reference.terms());
        let cg = CG.into_iter().zip(self.inertia_cg.terms());
        let mass = std::iter::once(("mass", &self.mass)).map(of("kg", About::Nothing));
        mass.chain(indicator.map(of("1", About::Nothing)))
            .chain(centre.map(of("m", About::Origin)))
            .chain(reference.map(of("kg m²", About::Reference)))
            .chain(cg.map(of("kg m²", About::CentreOfGravity)))
            .collect()
    }

    /// Number of the ten parameters that the data determine: mass or Δ, centre of gravity, and
    /// each term of inertia about A or S.
    #[must_use]
    pub fn observable(&self) -> usize {
        let first = self.indicator.as_ref().unwrap_or(&self.mass);
        let inertia = self.inertia_reference.terms().into_iter();
        let inertia = inertia.zip(self.inertia_cg.terms());
        usize::from(first.observable)
            + self
                .centre_of_gravity
                .iter()
                .filter(|n| n.observable)
                .count()
            + inertia
                .filter(|(a, s)| a.observable || s.observable)
                .count()
    }

    /// The method in words; its name where this program does not know it.
    #[must_use]
    pub fn method_description(&self) -> &str {
        let (poses, in_words) = STATIC_POSES;
        if self.method == poses {
            return in_words;
        }
        if self.method == LIKELIHOOD {
            return LIKELIHOOD_IN_WORDS;
        }
        let known = Method::ALL.into_iter().find(|m| m.name() == self.method);
        match known {
            Some(method) => method.description(),
            None => &self.method,
        }
    }
}

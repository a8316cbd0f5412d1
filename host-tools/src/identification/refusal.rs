//! When data do not allow an answer, though numbers come out: they contradict a rigid body,
//! or the body contradicts nature or the scales.

use super::{Judged, REFUSED, TypeB, number};
use crate::format::{plain, with_std};
use massline_core::identify::{Estimate, Identification};
use massline_core::rigid_body::{Margin, Verdict};
use std::fmt;

/// Share of the forces, as amplitude, that a rigid body may leave however small the noise is.
///
/// Elastic structures below their first mode leave up to 1.3 % in the worst of the methods
/// (the fork up to 80 % of its first natural frequency, method a). Sensors of the satellite
/// whose scales are 3 % wrong, their directions 0.03 rad and their positions 5 mm (standard
/// deviations) leave up to 9 %, and an answer that is wrong by as much, with error bars that say
/// so. One interface accelerometer with the wrong sign leaves 11 % (method a) to 51 % (c), one
/// load cell 61 to 67 %. Method b, whose pseudo forces are powers, leaves less than all
/// others, 3 and 16 %: what it misses is said by the recommended method, see [`by_recommended`].
const MISFIT: f64 = 0.1;

/// Half widths of the 95 % interval by which a moment of inertia or the triangle inequality
/// must be violated: plates and rods lie on the limit, and chance takes one in forty of them
/// beyond one half width, one in twenty thousand beyond two.
const IMPOSSIBLE: f64 = 2.0;

/// Half widths of its 95 % interval by which Δ may differ from one without a word.
pub(super) const NOTED: f64 = 2.0;

/// Half widths by which Δ must differ from one for a refusal.
const WEIGHED: f64 = 5.0;

/// Difference of Δ from one, and share of the largest moment of inertia, up to which scales
/// that are a few per cent wrong explain what noise does not.
const SCALE: f64 = 0.05;

/// Reason why the numbers must not be believed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The contradiction in words.
    pub fact: String,
    /// Advice: what to check, or what is wrong where that was found.
    pub remedy: String,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.fact, self.remedy)
    }
}

impl Refusal {
    fn new(fact: String, remedy: &str) -> Self {
        let remedy = remedy.to_owned();
        Self { fact, remedy }
    }
}

/// The reason why the numbers must not be believed; `None` where nothing speaks against them.
pub(crate) fn refusal(judged: &Judged<'_>) -> Option<Refusal> {
    let i = judged.identification;
    negative_mass(i)
        .or_else(|| contradiction(judged))
        .or_else(|| impossible(i))
        .or_else(|| weighed(judged))
        .or_else(|| no_mass(judged))
}

/// The reason why no method's numbers must be believed: the recommended one finds no rigid body in the data.
/// Others can leave less of the forces by a body that is another one.
pub(crate) fn by_recommended(judged: &Judged<'_>) -> Option<Refusal> {
    let found = contradiction(judged)?;
    Some(Refusal {
        fact: format!("by the recommended method apparent-mass {}", found.fact),
        remedy: found.remedy,
    })
}

/// The mass that the data say; a weighed one times Δ.
fn mass(i: &Identification) -> Option<Estimate> {
    let (mass, times) = (i.mass?, i.indicator.map_or(1.0, |d| d.value));
    Some(Estimate {
        value: mass.value * times,
        std: i.indicator.map_or(mass.std, |d| mass.value * d.std),
    })
}

/// A number with half of its 95 % interval.
fn with_interval(e: &Estimate, freedom: f64) -> String {
    let (value, half) = with_std(e.value, e.interval(freedom));
    format!("{value} ± {half}")
}

fn negative_mass(i: &Identification) -> Option<Refusal> {
    let violated = i.plausibility.mass?.verdict() == Verdict::Violated;
    let mass = mass(i).filter(|_| violated)?;
    Some(Refusal::new(
        format!(
            "the mass in the data is negative, {} kg",
            with_interval(&mass, i.freedom)
        ),
        "forces and accelerations have opposite signs; check `direction` of the load cells, which is positive where the force acts on the structure, and of the accelerometers",
    ))
}

/// A mass that may as well be zero.
fn no_mass(judged: &Judged<'_>) -> Option<Refusal> {
    let i = judged.identification;
    let mass = mass(i)?;
    let none = mass.value <= mass.interval(i.freedom);
    none.then(|| {
        Refusal::new(
            format!(
                "the mass in the data, {} kg, is not told from zero: half of its 95 % interval is {} kg",
                plain(mass.value, 3),
                plain(mass.interval(i.freedom), 2)
            ),
            "shake harder along an axis, record longer, or look for a wrong sensor with `massline check`",
        )
    })
}

fn contradiction(judged: &Judged<'_>) -> Option<Refusal> {
    let (i, test) = (judged.identification, judged.consistency?);
    let ratio = test.ratio;
    let beyond = test.probability < REFUSED && i.misfit > MISFIT;
    beyond.then(|| {
        Refusal::new(
            format!(
                "a rigid body leaves {} % of the forces, {} times what noise explains",
                plain(100.0 * i.misfit, 2),
                plain(ratio.sqrt(), 2)
            ),
            "check `direction`, `position` and `scale` of each load cell and of each accelerometer (one with the wrong sign does this), and that every load path is measured",
        )
    })
}

fn impossible(i: &Identification) -> Option<Refusal> {
    let p = &i.plausibility;
    let far = |m: Option<Margin>| {
        m.is_some_and(|m| m.relative < -SCALE && m.relative < -IMPOSSIBLE * m.uncertainty)
    };
    let reason = p.reason()?;
    (p.verdict() == Verdict::Violated && (far(p.positive_definite) || far(p.triangle))).then(|| {
        Refusal::new(
            format!(
                "no real body has these properties, {reason}, by more than {IMPOSSIBLE} times its error bar"
            ),
            "check `direction`, `position` and `scale` of the sensors that turn with the structure",
        )
    })
}

/// Contradiction between the weighed mass and the mass in the data.
fn against_weighed(judged: &Judged<'_>) -> Option<(f64, String)> {
    let i = judged.identification;
    let (mass_weighed, delta) = (i.mass?.value, i.indicator?);
    // Scales that are off by as much as their certificates allow contradict nothing.
    let combined = |type_b: &TypeB| type_b.combined(number::INDICATOR, &delta, i.freedom);
    let half = match judged.type_b.and_then(combined) {
        Some(both) => both.interval,
        None => delta.interval(i.freedom),
    };
    let widths = (delta.value - 1.0).abs() / half;
    let bounded = |value: f64, half: f64| {
        let (value, half) = with_std(value, half);
        format!("{value} ± {half}")
    };
    let text = format!(
        "the mass weighed is {} kg and the data say {} kg (Δ = {})",
        plain(mass_weighed, 6),
        bounded(mass(i)?.value, mass_weighed * half),
        bounded(delta.value, half)
    );
    Some((widths, text))
}

fn weighed(judged: &Judged<'_>) -> Option<Refusal> {
    let (widths, text) = against_weighed(judged)?;
    let far = widths > WEIGHED && (judged.identification.indicator?.value - 1.0).abs() > SCALE;
    far.then(|| {
        Refusal::new(
            text,
            "correct `known_mass`, or the load cells' `scale`, or leave `known_mass` out; the centre of gravity and the inertia about it rest on it",
        )
    })
}

/// A warning about a weighed mass that is not refused.
pub(super) fn notice_weighed(judged: &Judged<'_>) -> Option<String> {
    let (widths, text) = against_weighed(judged)?;
    (widths > NOTED).then(|| {
        format!(
            "{text}, {} times the error bar apart; check `known_mass`, the load cells' `scale`, and that the averaging band lies below the first mode",
            plain(widths, 2)
        )
    })
}

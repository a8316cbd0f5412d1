//! Units of recorded numbers and of lengths, and their way to SI.

use massline_core::geometry::Quantity;
use serde::{Deserialize, Deserializer};

use super::keys;
use crate::printable::quoted;

/// Standard acceleration of gravity, m/s² (ISO 80000-3).
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// Pound-force, N.
const LBF: f64 = 4.448_221_615_260_5;

/// Quantity that a channel measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measured {
    Acceleration,
    Force,
    Moment,
}

/// Kind of a unit of recorded numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Of(Measured),
    Voltage,
    Charge,
    Counts,
}

const UNITS: [(&str, Kind, f64); 15] = [
    ("m/s²", Kind::Of(Measured::Acceleration), 1.0),
    ("g", Kind::Of(Measured::Acceleration), STANDARD_GRAVITY),
    ("mm/s²", Kind::Of(Measured::Acceleration), 1e-3),
    ("N", Kind::Of(Measured::Force), 1.0),
    ("kN", Kind::Of(Measured::Force), 1e3),
    ("lbf", Kind::Of(Measured::Force), LBF),
    ("N m", Kind::Of(Measured::Moment), 1.0),
    ("kN m", Kind::Of(Measured::Moment), 1e3),
    ("lbf in", Kind::Of(Measured::Moment), LBF * 0.0254),
    ("lbf ft", Kind::Of(Measured::Moment), LBF * 0.3048),
    ("V", Kind::Voltage, 1.0),
    ("mV", Kind::Voltage, 1e-3),
    ("pC", Kind::Charge, 1.0),
    ("counts", Kind::Counts, 1.0),
    ("count", Kind::Counts, 1.0),
];

/// Units of what this program measures nothing of, such as sound, temperature, strain and displacement.
const OTHERS: [&str; 30] = [
    "Pa", "hPa", "kPa", "MPa", "bar", "mbar", "psi", "dB", "dB(A)", "°C", "degC", "K", "°F",
    "degF", "%", "m", "mm", "µm", "um", "m/s", "mm/s", "in/s", "µm/m", "um/m", "rpm", "1/min",
    "deg", "°", "rad", "rad/s",
];

/// A unit without the characters that are written in several ways.
fn plain(text: &str) -> String {
    let kept = |c: &char| !matches!(c, ' ' | '·' | '⋅' | '*' | '^');
    let all = text.trim().chars().filter(kept);
    all.map(|c| if c == '²' { '2' } else { c }).collect()
}

fn find(text: &str) -> Option<(Kind, f64)> {
    let wanted = plain(text);
    let unit = UNITS.iter().find(|(name, ..)| plain(name) == wanted);
    unit.map(|(_, kind, factor)| (*kind, *factor))
}

/// Quantity that a unit belongs to, where it is one of a single quantity.
pub(crate) fn measured_in(unit: &str) -> Option<Measured> {
    match find(unit) {
        Some((Kind::Of(measured), _)) => Some(measured),
        _ => None,
    }
}

/// `true` for a unit of neither acceleration, force nor moment, nor of what stands for one.
pub(crate) fn is_other(unit: &str) -> bool {
    OTHERS.iter().any(|other| plain(other) == plain(unit))
}

/// `true` for a unit that a sensitivity belongs to.
pub(crate) fn is_electric(unit: &str) -> bool {
    matches!(find(unit), Some((Kind::Voltage | Kind::Charge, _)))
}

impl Measured {
    /// The units that a channel of this quantity may have, in words.
    pub(super) fn accepted(self) -> String {
        let own: Vec<String> = UNITS
            .iter()
            .filter(|(_, kind, _)| *kind == Kind::Of(self))
            .map(|(name, ..)| format!("\"{name}\""))
            .collect();
        let like = match self {
            Self::Acceleration => "100 mV/g",
            Self::Force => "4.1 pC/N",
            Self::Moment => "2 mV/(N m)",
        };
        format!(
            "{} for {}, or \"V\", \"mV\" or \"pC\" with a `sensitivity` such as \"{like}\", or \"counts\" with a `scale`",
            own.join(", "),
            self.words()
        )
    }

    fn words(self) -> &'static str {
        match self {
            Self::Acceleration => "an acceleration",
            Self::Force => "a force",
            Self::Moment => "a moment",
        }
    }

    /// The SI unit.
    pub(crate) fn si(self) -> &'static str {
        match self {
            Self::Acceleration => "m/s²",
            Self::Force => "N",
            Self::Moment => "N m",
        }
    }
}

impl From<Quantity> for Measured {
    fn from(quantity: Quantity) -> Self {
        match quantity {
            Quantity::Force => Self::Force,
            Quantity::Moment => Self::Moment,
        }
    }
}

/// Unit and sensitivity of recorded numbers as a setup states them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    /// The key `unit`.
    pub(super) unit: Option<String>,
    /// The key `sensitivity`.
    pub(super) sensitivity: Option<String>,
}

/// Reason why recorded numbers cannot become SI.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unfit {
    /// Key of the setup that is wrong or missing.
    pub(super) key: &'static str,
    /// The value in words; `None` where it is missing.
    pub(super) found: Option<String>,
    /// Values that are accepted.
    pub(super) expected: String,
}

/// Share by which `scale` and the size of a unit differ at most where the one stands for the other.
const TWICE: f64 = 0.02;

/// SI units per recorded unit, without `scale`.
fn factor(
    measured: Measured,
    unit: &str,
    sensitivity: Option<&str>,
    has_scale: bool,
) -> Result<f64, Unfit> {
    let unfit = |key, found: Option<&str>, expected: String| Unfit {
        key,
        found: found.map(|text| format!("\"{}\"", quoted(text))),
        expected,
    };
    let (kind, size) = match find(unit) {
        Some((Kind::Of(other), _)) if other != measured => Err(()),
        Some(found) => Ok(found),
        None => Err(()),
    }
    .map_err(|()| unfit("unit", Some(unit), measured.accepted()))?;
    let electric = matches!(kind, Kind::Voltage | Kind::Charge);
    match (sensitivity, kind) {
        (Some(text), _) if !electric => Err(unfit(
            "sensitivity",
            Some(text),
            format!("none beside the unit \"{}\"", quoted(unit)),
        )),
        (None, Kind::Counts) if !has_scale => {
            Err(unfit("scale", None, format!("{} per count", measured.si())))
        }
        (None, Kind::Voltage | Kind::Charge) if !has_scale => Err(unfit(
            "sensitivity",
            None,
            format!(
                "the sensitivity in \"{0}/{1}\", or a `scale` in {1} per {0}",
                quoted(unit),
                measured.si()
            ),
        )),
        (None, Kind::Of(_)) => Ok(size),
        (None, _) => Ok(1.0),
        (Some(text), _) => {
            let found = Sensitivity::of(text).filter(|s| s.kind == kind && s.measured == measured);
            let s = found.ok_or_else(|| {
                let expected = format!(
                    "a number with {}/{}, such as \"100 {}/{}\"",
                    if kind == Kind::Charge {
                        "pC"
                    } else {
                        "V or mV"
                    },
                    measured.si(),
                    quoted(unit),
                    measured.si(),
                );
                unfit("sensitivity", Some(text), expected)
            })?;
            // One and the same electric unit leaves no rounding.
            let ratio = if s.size == size { 1.0 } else { size / s.size };
            Ok(s.per * ratio / s.value)
        }
    }
}

/// A sensitivity such as `100 mV/g`.
struct Sensitivity {
    value: f64,
    kind: Kind,
    size: f64,
    measured: Measured,
    /// SI units per unit below the stroke.
    per: f64,
}

impl Sensitivity {
    fn of(text: &str) -> Option<Self> {
        let text = text.trim();
        let end = text.find(|c: char| !matches!(c, '0'..='9' | '.' | '+' | '-' | 'e' | 'E'))?;
        let value: f64 = text[..end].parse().ok()?;
        let (above, below) = text[end..].split_once('/')?;
        let below = below.trim();
        let inner = below.strip_prefix('(').and_then(|b| b.strip_suffix(')'));
        let (kind, size) = find(above)?;
        let (Kind::Of(measured), per) = find(inner.unwrap_or(below))? else {
            return None;
        };
        let exists = (1e-30..=1e30).contains(&value.abs());
        (exists && matches!(kind, Kind::Voltage | Kind::Charge)).then_some(Self {
            value,
            kind,
            size,
            measured,
            per,
        })
    }
}

impl Units {
    /// SI units per recorded unit, without `scale`: one where the setup states no unit.
    pub(crate) fn factor(&self, measured: Measured, has_scale: bool) -> Result<f64, Unfit> {
        let Some(unit) = &self.unit else {
            return Ok(1.0);
        };
        factor(measured, unit, self.sensitivity.as_deref(), has_scale)
    }

    /// The key `scale`, by which the unit gives a total scale, to the last bit.
    pub(super) fn key_scale(&self, measured: Measured, total: f64) -> f64 {
        let factor = self.factor(measured, true).unwrap_or(1.0);
        let near = total / factor;
        let [up, down] = [near.next_up(), near.next_down()];
        // Two roundings lie between the key and this quotient.
        let all = [near, up, down, up.next_up(), down.next_down()];
        // The ends of what the key may be.
        let allowed = |scale: &f64| (1e-100..=1e100).contains(&scale.abs());
        let exact = all
            .into_iter()
            .find(|scale| scale * factor == total && allowed(scale));
        exact.unwrap_or(near)
    }

    /// The unit by which readings of so many SI units each are said most plainly, where there is one
    /// and no sensitivity stands in its place; the sign is left to the key `scale`.
    pub(crate) fn plainest(&self, measured: Measured, total: f64) -> Option<&'static str> {
        let electric = |unit: &String| !matches!(find(unit), Some((Kind::Of(_), _)));
        if self.sensitivity.is_some() || self.unit.as_ref().is_some_and(electric) {
            return None;
        }
        let fits = |size: f64| (total.abs() / size - 1.0).abs() < 1e-6;
        let mut units = UNITS.iter();
        let (unit, ..) =
            units.find(|(_, kind, size)| *kind == Kind::Of(measured) && fits(*size))?;
        (self.unit.is_some() || *unit != measured.si()).then_some(*unit)
    }

    /// Factor that takes the readings of a channel whose recording states `found` to the unit that
    /// the setup's scale is for. `scale` is that of the setup.
    ///
    /// # Errors
    /// Cause and remedy in words.
    pub(super) fn of_recording(
        &self,
        measured: Measured,
        scale: f64,
        found: Option<&str>,
    ) -> Result<f64, String> {
        let shown = quoted(found.unwrap_or_default());
        let unfit = |why: Unfit| match why.found {
            None => format!(
                "the recording says [{shown}], and the setup has no `{}`; give {}",
                why.key, why.expected
            ),
            Some(value) if why.key == "unit" => format!(
                "the recording says {value}; accepted are {}: correct the header, or state `unit` in the setup",
                why.expected
            ),
            Some(value) => format!(
                "the recording says [{shown}], and `{}` of the setup is {value}; expected {}",
                why.key, why.expected
            ),
        };
        match (found, &self.unit) {
            (None, None) if self.sensitivity.is_some() => Err(
                "the setup has a `sensitivity`, but neither the setup nor the recording states the unit of the readings; write `unit = \"V\"`, \"mV\" or \"pC\"".to_owned(),
            ),
            (None, Some(stated)) => self.once(measured, scale, stated),
            (None, None) => Ok(1.0),
            (Some(found), Some(stated)) => {
                let same = match (find(found), find(stated)) {
                    (Some(a), Some(b)) => a == b,
                    // A word that is no unit says nothing.
                    (None, _) => true,
                    _ => false,
                };
                if !same {
                    return Err(format!(
                        "the recording says [{shown}], and the setup's `unit` says \"{}\"; correct the one that is wrong",
                        quoted(stated)
                    ));
                }
                self.once(measured, scale, stated)
            }
            (Some(found), None) => {
                let has_scale = scale != 1.0;
                let sensitivity = self.sensitivity.as_deref();
                let size = factor(measured, found, sensitivity, has_scale).map_err(unfit)?;
                if size != 1.0 && (scale.abs() / size - 1.0).abs() < TWICE {
                    return Err(format!(
                        "the recording says [{shown}], and `scale` = {scale} of the setup would convert it a second time; leave `scale` out, or -1 for a sensor that is turned round"
                    ));
                }
                Ok(size)
            }
        }
    }

    /// One, where the total scale does not have the size of the stated unit twice.
    fn once(&self, measured: Measured, total: f64, stated: &str) -> Result<f64, String> {
        let Some((Kind::Of(_), size)) = find(stated) else {
            return Ok(1.0);
        };
        let key = self.key_scale(measured, total);
        if size != 1.0 && (key.abs() / size - 1.0).abs() < TWICE {
            return Err(format!(
                "`unit` = \"{}\" of the setup converts the readings, and `scale` = {key} would convert them a second time; leave `scale` out, or -1 for a sensor that is turned round",
                quoted(stated)
            ));
        }
        Ok(1.0)
    }
}

/// Units of one channel in the recordings of two runs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum UnitsOfTwo {
    /// The same, or the setup states the unit for both.
    Alike,
    /// One recording states no unit, and its readings count the same as those of the other.
    Assumed,
    /// Two different units.
    Other,
    /// One recording states no unit, and its readings would count as another unit.
    Missing {
        /// The unit that the other recording states.
        unit: String,
        /// List of the setup that the sensor is in.
        list: &'static str,
        /// The unit that readings without one count as.
        si: &'static str,
    },
}

impl Units {
    /// Holds the units that the recordings of two runs state for one channel against each other.
    pub(super) fn of_two(
        &self,
        list: &'static str,
        measured: Measured,
        scale: f64,
        found: [Option<&str>; 2],
    ) -> UnitsOfTwo {
        if self.unit.is_some() {
            return UnitsOfTwo::Alike;
        }
        match found {
            [None, None] => UnitsOfTwo::Alike,
            [Some(a), Some(b)] if find(a) == find(b) => UnitsOfTwo::Alike,
            [Some(_), Some(_)] => UnitsOfTwo::Other,
            [Some(unit), None] | [None, Some(unit)] => {
                match self.of_recording(measured, scale, Some(unit)) {
                    Ok(1.0) => UnitsOfTwo::Assumed,
                    _ => UnitsOfTwo::Missing {
                        unit: quoted(unit),
                        list,
                        si: measured.si(),
                    },
                }
            }
        }
    }
}

/// Unit of all lengths of a setup, as a fraction of metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Length {
    above: f64,
    below: f64,
}

impl Default for Length {
    fn default() -> Self {
        LENGTHS[0].1
    }
}

const fn length(above: f64, below: f64) -> Length {
    Length { above, below }
}

/// Fractions, so that 35 mm are the number nearest to 0.035 m: a factor 0.001 is rounded itself.
const LENGTHS: [(&str, Length); 4] = [
    ("m", length(1.0, 1.0)),
    ("mm", length(1.0, 1000.0)),
    ("cm", length(1.0, 100.0)),
    ("in", length(254.0, 10_000.0)),
];

impl Length {
    /// A length in m.
    pub(super) fn metres(self, x: f64) -> f64 {
        x * self.above / self.below
    }
}

/// The key `length_unit`.
pub(super) fn length_unit<'de, D: Deserializer<'de>>(value: D) -> Result<Length, D::Error> {
    keys::word(value, &LENGTHS)
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(value: D) -> Result<Self, D::Error> {
        length_unit(value)
    }
}

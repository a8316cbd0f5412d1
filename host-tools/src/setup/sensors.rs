//! The sensors of a setup as they are written: one channel or a triaxial sensor an entry, with what
//! sensors of one type share.

use std::f64::consts::FRAC_PI_2;

use massline_core::geometry::Placement;
use nalgebra::Vector3;
use serde::{Deserialize, Deserializer};

use super::document::{Document, Section, nearest};
use super::keys::{self, text, vector, word};
use super::units::{Length, Measured, Unfit, Units};
use super::{
    AccelerometerEntry, LoadCellEntry, Mount, Quantity, SetupError, Uncertainty, uncertainty,
};
use crate::printable::quoted;
use crate::recording::{MOST_CORNER, MOST_DELAY};

/// An `[[accelerometer]]`, a `[[load_cell]]` or a `[[sensor_type]]` as it is written.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub(super) struct SensorKeys {
    #[serde(deserialize_with = "text")]
    name: Option<String>,
    #[serde(rename = "type", deserialize_with = "text")]
    kind: Option<String>,
    #[serde(deserialize_with = "text")]
    channel: Option<String>,
    #[serde(deserialize_with = "text")]
    triaxial: Option<String>,
    #[serde(deserialize_with = "keys::texts")]
    channels: Vec<String>,
    #[serde(deserialize_with = "vector")]
    position: Option<[f64; 3]>,
    #[serde(deserialize_with = "keys::direction")]
    direction: Option<[f64; 3]>,
    #[serde(deserialize_with = "keys::directions")]
    directions: Option<[[f64; 3]; 3]>,
    #[serde(deserialize_with = "vector")]
    rotation: Option<[f64; 3]>,
    #[serde(deserialize_with = "some_mount")]
    mount: Option<Mount>,
    #[serde(deserialize_with = "some_quantity")]
    quantity: Option<Quantity>,
    #[serde(deserialize_with = "text")]
    unit: Option<String>,
    #[serde(deserialize_with = "keys::texts")]
    sensitivity: Vec<String>,
    #[serde(deserialize_with = "scale")]
    scale: Vec<f64>,
    #[serde(deserialize_with = "delay")]
    delay: Vec<f64>,
    #[serde(deserialize_with = "ac_corner")]
    ac_corner: Vec<f64>,
    #[serde(deserialize_with = "uncertainty::noise")]
    noise: Option<f64>,
    #[serde(deserialize_with = "uncertainty::calibration")]
    calibration_uncertainty: Option<f64>,
    #[serde(deserialize_with = "uncertainty::position")]
    position_uncertainty: Option<f64>,
    #[serde(deserialize_with = "uncertainty::direction")]
    direction_uncertainty: Option<f64>,
}

keys::lists! {
    scale: "SI units per recorded unit, not 0, or a list of 3 for a triaxial sensor",
        |x| (1e-100..=1e100).contains(&x.abs());
    delay: "samples from -4096 to 4096 that the channel comes late, or a list of 3 for a triaxial sensor",
        |x| x.abs() <= f64::from(MOST_DELAY);
    ac_corner: "Hz from 0 to 100, the corner of the coupling to alternating current, or a list of 3 for a triaxial sensor",
        |x| (0.0..=MOST_CORNER).contains(&x);
}

pub(super) const MOUNTS: [(&str, Mount); 2] = [
    ("interface", Mount::Interface),
    ("structure", Mount::Structure),
];
pub(super) const QUANTITIES: [(&str, Quantity); 2] =
    [("force", Quantity::Force), ("moment", Quantity::Moment)];

pub(crate) fn quantity<'de, D: Deserializer<'de>>(value: D) -> Result<Quantity, D::Error> {
    word(value, &QUANTITIES)
}

fn some_mount<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Mount>, D::Error> {
    word(value, &MOUNTS).map(Some)
}

fn some_quantity<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Quantity>, D::Error> {
    quantity(value).map(Some)
}

/// Keys that sensors of one type may share.
const SHARED: [&str; 9] = [
    "unit",
    "sensitivity",
    "scale",
    "delay",
    "ac_corner",
    "noise",
    "calibration_uncertainty",
    "position_uncertainty",
    "direction_uncertainty",
];
const SENSOR: [&str; 8] = [
    "channel",
    "position",
    "direction",
    "triaxial",
    "channels",
    "directions",
    "rotation",
    "type",
];

/// Refuses keys that an entry of its list does not have.
pub(super) fn check_keys(document: &Document<'_>) -> Result<(), SetupError> {
    let lists: [(&str, &[&str], &[&str]); 3] = [
        ("accelerometer", &SENSOR, &["mount"]),
        ("load_cell", &SENSOR, &["quantity"]),
        ("sensor_type", &[], &["name", "mount", "quantity"]),
    ];
    for (list, first, own) in lists {
        let known = [first, own, &SHARED].concat();
        for section in document.sections(list) {
            section.only(&known)?;
        }
    }
    Ok(())
}

/// Sensors, and the number of the section that each of them comes from.
pub(super) struct Sensors {
    pub(super) accelerometers: Vec<AccelerometerEntry>,
    pub(super) load_cells: Vec<LoadCellEntry>,
    pub(super) sections: [Vec<usize>; 2],
}

impl Sensors {
    /// Refuses delays: amplitudes of a stepped sine are no samples.
    pub(super) fn no_delays(&self, document: &Document<'_>) -> Result<(), SetupError> {
        let motion = self.accelerometers.iter().map(|a| a.delay);
        let force = self.load_cells.iter().map(|c| c.delay);
        let expected = "none in a setup with a run of `excitation = \"sine\"`, whose amplitudes are no samples: take the delay out of their phases";
        self.all_zero(document, "delay", motion, force, expected)
    }

    /// Refuses couplings to alternating current: behind one there is no reading of a pose.
    pub(super) fn no_corners(&self, document: &Document<'_>) -> Result<(), SetupError> {
        let motion = self.accelerometers.iter().map(|a| a.ac_corner);
        let force = self.load_cells.iter().map(|c| c.ac_corner);
        let expected = "none in a setup with a run of `excitation = \"static\"`: a sensor that is coupled to alternating current does not see gravity";
        self.all_zero(document, "ac_corner", motion, force, expected)
    }

    fn all_zero(
        &self,
        document: &Document<'_>,
        key: &str,
        motion: impl Iterator<Item = f64>,
        force: impl Iterator<Item = f64>,
        expected: &str,
    ) -> Result<(), SetupError> {
        let [of_motion, of_force] = &self.sections;
        let motion = of_motion.iter().zip(motion);
        let force = of_force.iter().zip(force);
        let motion = motion.map(|(n, x)| ("accelerometer", *n, x));
        let force = force.map(|(n, x)| ("load_cell", *n, x));
        match motion.chain(force).find(|(.., x)| *x != 0.0) {
            None => Ok(()),
            Some((list, number, found)) => Err(document
                .section(list, number)
                .unexpected(key, found, expected)
                .into()),
        }
    }
}

/// The entries of the three lists.
pub(super) struct Lists {
    pub(super) accelerometer: Vec<SensorKeys>,
    pub(super) load_cell: Vec<SensorKeys>,
    pub(super) sensor_type: Vec<SensorKeys>,
}

/// Sensors of a setup, one a channel, in SI.
pub(super) fn sensors(
    document: &Document<'_>,
    lists: &Lists,
    length: Length,
) -> Result<Sensors, SetupError> {
    let types = Types::new(document, &lists.sensor_type)?;
    let mut all = Sensors {
        accelerometers: Vec::new(),
        load_cells: Vec::new(),
        sections: [Vec::new(), Vec::new()],
    };
    let written = document.sections("accelerometer");
    for (number, (section, keys)) in written.iter().zip(&lists.accelerometer).enumerate() {
        let entry = types.entry(section, keys)?;
        let position = entry.position(length)?;
        let uncertainty = entry.uncertainty(length)?;
        for axis in entry.axes(Measured::Acceleration)? {
            all.sections[0].push(number);
            all.accelerometers.push(AccelerometerEntry {
                channel: axis.channel,
                position,
                direction: axis.direction,
                mount: entry.of(|k| k.mount).unwrap_or(Mount::Structure),
                scale: axis.scale,
                units: axis.units,
                delay: axis.delay,
                ac_corner: axis.ac_corner,
                uncertainty,
            });
        }
    }
    let written = document.sections("load_cell");
    for (number, (section, keys)) in written.iter().zip(&lists.load_cell).enumerate() {
        let entry = types.entry(section, keys)?;
        let quantity = entry.of(|k| k.quantity).unwrap_or(Quantity::Force);
        // A pure moment is the same everywhere.
        let position = match (quantity, keys.position) {
            (Quantity::Moment, None) => [0.0; 3],
            _ => entry.position(length)?,
        };
        let uncertainty = entry.uncertainty(length)?;
        for axis in entry.axes(quantity.into())? {
            all.sections[1].push(number);
            all.load_cells.push(LoadCellEntry {
                channel: axis.channel,
                position,
                direction: axis.direction,
                quantity,
                scale: axis.scale,
                units: axis.units,
                delay: axis.delay,
                ac_corner: axis.ac_corner,
                uncertainty,
            });
        }
    }
    Ok(all)
}

struct Types<'d> {
    sections: Vec<Section<'d>>,
    keys: &'d [SensorKeys],
}

impl<'d> Types<'d> {
    fn new(document: &'d Document<'_>, keys: &'d [SensorKeys]) -> Result<Self, SetupError> {
        let sections = document.sections("sensor_type");
        for (number, (section, own)) in sections.iter().zip(keys).enumerate() {
            let Some(name) = &own.name else {
                return Err(section
                    .missing("name", "the word by which sensors refer to the type")
                    .into());
            };
            if keys[..number].iter().any(|other| other.name == own.name) {
                let found = format_args!("\"{}\" once more", quoted(name));
                return Err(section
                    .unexpected("name", found, "a name of its own for each type")
                    .into());
            }
        }
        Ok(Self { sections, keys })
    }

    fn entry<'e>(
        &'e self,
        section: &'e Section<'d>,
        own: &'e SensorKeys,
    ) -> Result<Entry<'e, 'd>, SetupError> {
        let shared = match &own.kind {
            None => None,
            Some(name) => {
                let number = self.keys.iter().position(|k| k.name.as_ref() == Some(name));
                let names = self.keys.iter().filter_map(|k| k.name.as_deref());
                let number = number.ok_or_else(|| {
                    let expected =
                        format!("the name of a [[sensor_type]]; {}", nearest(name, names));
                    section.unexpected("type", format_args!("\"{}\"", quoted(name)), expected)
                })?;
                Some((&self.sections[number], &self.keys[number]))
            }
        };
        Ok(Entry {
            section,
            own,
            shared,
        })
    }
}

/// One sensor with its type.
struct Entry<'e, 'd> {
    section: &'e Section<'d>,
    own: &'e SensorKeys,
    shared: Option<(&'e Section<'d>, &'e SensorKeys)>,
}

/// One channel of a sensor.
struct Axis {
    channel: String,
    direction: [f64; 3],
    scale: f64,
    units: Units,
    delay: f64,
    ac_corner: f64,
}

impl<'e, 'd> Entry<'e, 'd> {
    /// A key's value: the sensor's own, else that of its type.
    fn of<T>(&self, key: impl Fn(&'e SensorKeys) -> Option<T>) -> Option<T> {
        key(self.own).or_else(|| key(self.shared?.1))
    }

    /// The section that has a key.
    fn holder(&self, key: &str) -> &Section<'d> {
        match self.shared {
            Some((shared, _)) if !self.section.has(key) && shared.has(key) => shared,
            _ => self.section,
        }
    }

    /// A list that is one for all axes, or one for each.
    fn list<T>(&self, key: impl Fn(&'e SensorKeys) -> &'e Vec<T>) -> &'e [T] {
        self.of(|k| Some(key(k)).filter(|list| !list.is_empty()))
            .map_or(&[], Vec::as_slice)
    }

    fn position(&self, length: Length) -> Result<[f64; 3], SetupError> {
        let missing = || {
            let expected = "[x, y, z] in m, or in the unit that `length_unit` names";
            self.section.missing("position", expected)
        };
        let position = self.own.position.ok_or_else(missing)?;
        Ok(position.map(|x| length.metres(x)))
    }

    fn uncertainty(&self, length: Length) -> Result<Uncertainty, SetupError> {
        let of = |keys: &SensorKeys| Uncertainty {
            noise: keys.noise,
            calibration: keys.calibration_uncertainty,
            position: keys.position_uncertainty,
            direction: keys.direction_uncertainty,
        };
        let shared = self
            .shared
            .map_or_else(Uncertainty::default, |(_, k)| of(k));
        let key = "position_uncertainty";
        let all = of(self.own).or(shared);
        Ok(all.in_metres(length, key, self.holder(key))?)
    }

    /// Channels and directions, one or three.
    fn channels(&self) -> Result<Vec<(String, [f64; 3])>, SetupError> {
        let keys = self.own;
        let only_triaxial = "it in a sensor that has `triaxial`";
        let Some(name) = &keys.triaxial else {
            let Some(channel) = &keys.channel else {
                let expected =
                    "the column's name in the recordings, or `triaxial` for a sensor of three";
                return Err(self.section.missing("channel", expected).into());
            };
            for (key, given) in [
                ("channels", !keys.channels.is_empty()),
                ("directions", keys.directions.is_some()),
                ("rotation", keys.rotation.is_some()),
            ] {
                if given {
                    return Err(self.section.unexpected(key, "given", only_triaxial).into());
                }
            }
            let missing = || {
                let expected = "the axis along which the channel reads positive, for example \"+z\" or [0, 0, 1]";
                self.section.missing("direction", expected)
            };
            return Ok(vec![(channel.clone(), keys.direction.ok_or_else(missing)?)]);
        };
        for (key, given, expected) in [
            (
                "channel",
                keys.channel.is_some(),
                "either `channel` or `triaxial`",
            ),
            (
                "direction",
                keys.direction.is_some(),
                "`rotation` or `directions` beside `triaxial`",
            ),
            (
                "rotation",
                keys.rotation.is_some() && keys.directions.is_some(),
                "either `rotation` or `directions`",
            ),
        ] {
            if given {
                return Err(self.section.unexpected(key, "given, too", expected).into());
            }
        }
        let channels = match keys.channels.as_slice() {
            [] => ["X", "Y", "Z"].map(|axis| format!("{name}:{axis}")),
            [x, y, z] => [x, y, z].map(Clone::clone),
            other => {
                let found = format_args!("a list of {}", other.len());
                let expected = "the columns of the sensor's x, y and z axis";
                return Err(self.section.unexpected("channels", found, expected).into());
            }
        };
        let directions = match (keys.directions, keys.rotation) {
            (Some(directions), _) => directions,
            (None, rotation) => turned(rotation.unwrap_or_default()).ok_or_else(|| {
                let expected = "a rotation vector in degrees";
                self.section.unexpected("rotation", "no rotation", expected)
            })?,
        };
        let [x, y, z] = directions.map(Vector3::from);
        // A sensor's axes are at right angles to a few degrees.
        if x.cross(&y).dot(&z).abs() < 0.9 {
            let expected = "three directions at right angles";
            return Err(self
                .section
                .unexpected("directions", "not at right angles", expected)
                .into());
        }
        Ok(channels.into_iter().zip(directions).collect())
    }

    fn axes(&self, measured: Measured) -> Result<Vec<Axis>, SetupError> {
        let channels = self.channels()?;
        let scales = self.list(|k| &k.scale);
        let sensitivities = self.list(|k| &k.sensitivity);
        let delays = self.list(|k| &k.delay);
        let corners = self.list(|k| &k.ac_corner);
        for (key, count) in [
            ("scale", scales.len()),
            ("sensitivity", sensitivities.len()),
            ("delay", delays.len()),
            ("ac_corner", corners.len()),
        ] {
            if count > 1 && count != channels.len() {
                let found = format_args!("a list of {count}");
                let expected = "one for all axes, or a list of 3 for those of a triaxial sensor";
                return Err(self.holder(key).unexpected(key, found, expected).into());
            }
        }
        let axis = |(n, (channel, direction)): (usize, (String, [f64; 3]))| {
            let units = Units {
                unit: self.of(|k| k.unit.clone()),
                sensitivity: each(sensitivities, n).cloned(),
            };
            let scale = each(scales, n);
            let factor = units.factor(measured, scale.is_some());
            let factor = factor.map_err(|why| self.unfit(why))?;
            Ok(Axis {
                channel,
                direction,
                scale: scale.copied().unwrap_or(1.0) * factor,
                units,
                delay: each(delays, n).copied().unwrap_or(0.0),
                ac_corner: each(corners, n).copied().unwrap_or(0.0),
            })
        };
        channels.into_iter().enumerate().map(axis).collect()
    }

    fn unfit(&self, why: Unfit) -> SetupError {
        let section = self.holder(why.key);
        match why.found {
            Some(found) => section.unexpected(why.key, found, why.expected),
            None => section.missing(why.key, why.expected),
        }
        .into()
    }
}

/// Entry `n` of a list that has one for all or one for each.
fn each<T>(list: &[T], n: usize) -> Option<&T> {
    list.get(n).or_else(|| list.first())
}

/// Directions of the axes of a sensor that is turned by a rotation vector in degrees.
fn turned(degrees: [f64; 3]) -> Option<[[f64; 3]; 3]> {
    let placement = Placement::new(degrees.into(), Vector3::zeros()).ok()?;
    let rotation = placement.rotation();
    // Quarter turns leave rounding of the cosine of 90° and no more; it is taken off, so that they
    // are the same numbers as directions that are written.
    let tidy = |x: f64| match (x - x.round()).abs() < 1e-12 * FRAC_PI_2 {
        true => x.round() + 0.0,
        false => x,
    };
    let [x, y, z] = [0, 1, 2].map(|k| keys::unit(rotation.column(k).map(tidy).into()));
    Some([x?, y?, z?])
}

//! From a setup file to [`Setup`]: serde reads its keys, and what several of them say together is
//! checked here.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Deserializer};

use super::document::{Document, Keys, Section, Source, nearest};
use super::keys::{self, outside, text, vector, word};
use super::{
    AccelerometerEntry, BLOCK_LENGTHS, Defaults, Estimation, Excitation, LoadCellEntry, Mount,
    OVERLAPS, Processing, Quantity, Run, Setup, SetupError, Uncertainty, uncertainty,
};
use crate::limits;
use crate::printable::{printable, quoted};
use crate::recording::Checksum;

pub(super) const MOUNTS: [(&str, Mount); 2] = [
    ("interface", Mount::Interface),
    ("structure", Mount::Structure),
];
pub(super) const QUANTITIES: [(&str, Quantity); 2] =
    [("force", Quantity::Force), ("moment", Quantity::Moment)];
const EXCITATIONS: [(&str, Excitation); 3] = [
    ("random", Excitation::Random),
    ("sine", Excitation::Sine),
    ("static", Excitation::Static),
];

pub(super) fn word_of<T: PartialEq + Copy>(words: &[(&'static str, T)], value: T) -> &'static str {
    words
        .iter()
        .find(|(_, candidate)| *candidate == value)
        .map_or("", |(word, _)| word)
}

impl Excitation {
    /// The word of the setup file.
    #[must_use]
    pub fn word(self) -> &'static str {
        word_of(&EXCITATIONS, self)
    }
}

/// The file as a whole.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
struct File {
    #[serde(deserialize_with = "text")]
    title: Option<String>,
    #[serde(deserialize_with = "vector")]
    reference_point: [f64; 3],
    #[serde(deserialize_with = "known_mass")]
    known_mass: Option<f64>,
    #[serde(deserialize_with = "known_mass_uncertainty")]
    known_mass_uncertainty: Option<f64>,
    processing: Option<Processing>,
    estimation: Estimation,
    defaults: Defaults,
    accelerometer: Vec<AccelerometerEntry>,
    load_cell: Vec<LoadCellEntry>,
    run: Vec<Run>,
}

impl Keys for File {
    const REQUIRED: &'static [(&'static str, &'static str)] = &[
        (
            "averaging_band",
            "[low, high] in Hz, well below the first elastic natural frequency",
        ),
        ("channel", "the column's name in the recordings"),
        ("position", "[x, y, z] in m"),
        (
            "direction",
            "the axis along which the channel reads positive, for example [0, 0, 1]",
        ),
        ("name", "what the run is called in results"),
        ("recording", "the recording's file name"),
        ("crc32", CRC32),
        ("bytes", BYTES),
    ];
}

const MASS_UNCERTAINTY: &str =
    "the standard uncertainty of `known_mass` in kg, more than 0, beside a `known_mass`";
const CRC32: &str = "the CRC-32 of the recording in eight hexadecimal digits, such as \"cbf43926\"";
const BYTES: &str = "the recording's length, a whole number of bytes";

keys::numbers! {
    known_mass:
        "the weighed mass in kg, more than 0 (leave it out to have the mass identified)",
        |mass| mass > 0.0;
    known_mass_uncertainty: MASS_UNCERTAINTY, |u| u > 0.0;
    sample_rate: "samples per second in Hz, more than 0", |rate| rate > 0.0;
    overlap:
        format_args!("a share of the block from {} to {}", OVERLAPS.start(), OVERLAPS.end()),
        |overlap| OVERLAPS.contains(&overlap);
    minimum_weight:
        "the weight of the accelerometer that sees the modes most, more than 0 and at most 1",
        |weight| weight > 0.0 && weight <= 1.0;
    tolerance: "a distance in m, more than 0", |distance| distance > 0.0;
    scale: "SI units per recorded unit, not 0", |scale| scale != 0.0;
    // Up to 2^53 every whole number has its own f64.
    bytes: BYTES, |n| n.fract() == 0.0 && (0.0..=9e15).contains(&n);
}

pub(crate) fn block_length<'de, D: Deserializer<'de>>(value: D) -> Result<usize, D::Error> {
    let (low, high) = (BLOCK_LENGTHS.start(), BLOCK_LENGTHS.end());
    let expected = format_args!("a power of two from {low} to {high}");
    keys::whole(value, expected, |length| {
        length.is_power_of_two() && BLOCK_LENGTHS.contains(&length.into())
    })
}

pub(super) fn modes<'de, D: Deserializer<'de>>(value: D) -> Result<usize, D::Error> {
    let most = Estimation::default().modes;
    let expected = format_args!("a whole number of modes from 1 to {most}");
    keys::whole(value, expected, |modes| (1..=most).contains(&modes.into()))
}

pub(super) fn iterations<'de, D: Deserializer<'de>>(value: D) -> Result<u32, D::Error> {
    let expected = "a whole number from 1 to 1000";
    keys::whole(value, expected, |n| (1..=1000).contains(&n))
}

pub(super) fn excitation<'de, D: Deserializer<'de>>(value: D) -> Result<Excitation, D::Error> {
    word(value, &EXCITATIONS)
}

fn mount<'de, D: Deserializer<'de>>(value: D) -> Result<Mount, D::Error> {
    word(value, &MOUNTS)
}

pub(crate) fn quantity<'de, D: Deserializer<'de>>(value: D) -> Result<Quantity, D::Error> {
    word(value, &QUANTITIES)
}

fn structure() -> Mount {
    Mount::Structure
}

fn force() -> Quantity {
    Quantity::Force
}

fn one() -> f64 {
    1.0
}

/// An `[[accelerometer]]` as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct AccelerometerKeys {
    #[serde(deserialize_with = "text")]
    channel: String,
    #[serde(deserialize_with = "vector")]
    position: [f64; 3],
    #[serde(deserialize_with = "keys::direction")]
    direction: [f64; 3],
    #[serde(default = "structure", deserialize_with = "mount")]
    mount: Mount,
    #[serde(default = "one", deserialize_with = "scale")]
    scale: f64,
    #[serde(default, deserialize_with = "uncertainty::noise")]
    noise: Option<f64>,
    #[serde(default, deserialize_with = "uncertainty::calibration")]
    calibration_uncertainty: Option<f64>,
    #[serde(default, deserialize_with = "uncertainty::position")]
    position_uncertainty: Option<f64>,
    #[serde(default, deserialize_with = "uncertainty::direction")]
    direction_uncertainty: Option<f64>,
}

impl From<AccelerometerKeys> for AccelerometerEntry {
    fn from(keys: AccelerometerKeys) -> Self {
        Self {
            channel: keys.channel,
            position: keys.position,
            direction: keys.direction,
            mount: keys.mount,
            scale: keys.scale,
            uncertainty: Uncertainty {
                noise: keys.noise,
                calibration: keys.calibration_uncertainty,
                position: keys.position_uncertainty,
                direction: keys.direction_uncertainty,
            },
        }
    }
}

/// A `[[load_cell]]` as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LoadCellKeys {
    #[serde(deserialize_with = "text")]
    channel: String,
    #[serde(default, deserialize_with = "vector")]
    position: Option<[f64; 3]>,
    #[serde(deserialize_with = "keys::direction")]
    direction: [f64; 3],
    #[serde(default = "force", deserialize_with = "quantity")]
    quantity: Quantity,
    #[serde(default = "one", deserialize_with = "scale")]
    scale: f64,
    #[serde(default, deserialize_with = "uncertainty::noise")]
    noise: Option<f64>,
    #[serde(default, deserialize_with = "uncertainty::calibration")]
    calibration_uncertainty: Option<f64>,
    #[serde(default, deserialize_with = "uncertainty::position")]
    position_uncertainty: Option<f64>,
    #[serde(default, deserialize_with = "uncertainty::direction")]
    direction_uncertainty: Option<f64>,
}

impl TryFrom<LoadCellKeys> for LoadCellEntry {
    type Error = &'static str;

    fn try_from(keys: LoadCellKeys) -> Result<Self, Self::Error> {
        // A pure moment is the same everywhere.
        let position = match keys.quantity {
            Quantity::Force => keys.position.ok_or("missing field `position`")?,
            Quantity::Moment => keys.position.unwrap_or_default(),
        };
        Ok(Self {
            channel: keys.channel,
            position,
            direction: keys.direction,
            quantity: keys.quantity,
            scale: keys.scale,
            uncertainty: Uncertainty {
                noise: keys.noise,
                calibration: keys.calibration_uncertainty,
                position: keys.position_uncertainty,
                direction: keys.direction_uncertainty,
            },
        })
    }
}

pub(super) fn checksum<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Checksum>, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields, expecting = "a table")]
    struct ChecksumKeys {
        #[serde(deserialize_with = "crc32")]
        crc32: u32,
        #[serde(deserialize_with = "bytes")]
        bytes: f64,
    }
    let keys = ChecksumKeys::deserialize(value)?;
    Ok(Some(Checksum {
        crc32: keys.crc32,
        bytes: keys.bytes as u64,
    }))
}

fn crc32<'de, D: Deserializer<'de>>(value: D) -> Result<u32, D::Error> {
    let digits: String = text(value)?;
    let is_hex = digits.len() == 8 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let sum = u32::from_str_radix(&digits, 16).ok().filter(|_| is_hex);
    sum.ok_or_else(|| outside(format_args!("\"{}\"", quoted(&digits)), CRC32))
}

pub(super) fn setup(source: &Source) -> Result<Setup, SetupError> {
    let document = Document::new(source)?;
    fits(source, &document)?;
    let file: File = document.read()?;
    if let (Some(found), None) = (file.known_mass_uncertainty, file.known_mass) {
        let key = "known_mass_uncertainty";
        return Err(document
            .top()
            .unexpected(key, found, MASS_UNCERTAINTY)
            .into());
    }
    if let Some(processing) = &file.processing
        && let Some(rate) = processing.sample_rate
    {
        let check = processing.check_bands(rate);
        check.map_err(|source| SetupError::BandLines {
            place: document.section("processing", 0).place_of(source.key()),
            source,
        })?;
    }
    for (list, reason, found) in [
        (
            "accelerometer",
            "no motion is known",
            file.accelerometer.len(),
        ),
        ("load_cell", "no force is known", file.load_cell.len()),
        ("run", "there is nothing to evaluate", file.run.len()),
    ] {
        if found == 0 {
            return Err(SetupError::NoEntries {
                file: source.file.clone(),
                list,
                reason,
            });
        }
    }
    one_sensor_a_channel(&document, &file)?;
    for (number, section) in document.sections("run").iter().enumerate() {
        check_run(section, number, &file, &document)?;
    }
    Ok(Setup {
        title: file.title.unwrap_or_else(|| stem(&source.file)),
        reference_point: file.reference_point,
        known_mass: file.known_mass,
        known_mass_uncertainty: file.known_mass_uncertainty,
        processing: file.processing,
        estimation: file.estimation,
        defaults: file.defaults,
        accelerometers: file.accelerometer,
        load_cells: file.load_cell,
        runs: file.run,
        folder: source.file.parent().map(Path::to_owned).unwrap_or_default(),
    })
}

/// Refuses more entries than can be used before any of them is looked at.
fn fits(source: &Source, document: &Document<'_>) -> Result<(), SetupError> {
    let sensors = document.count("accelerometer") + document.count("load_cell");
    let split = "do the test in parts, each with a setup of its own";
    for (what, found, limit, advice) in [
        ("sensors", sensors, limits::SENSORS, "leave some out"),
        ("runs", document.count("run"), limits::RUNS, split),
    ] {
        if found > limit {
            return Err(SetupError::TooMany {
                file: source.file.clone(),
                what,
                found,
                limit,
                advice,
            });
        }
    }
    Ok(())
}

fn stem(file: &Path) -> String {
    file.file_stem().map_or_else(
        || "Untitled".to_owned(),
        |stem| printable(&stem.to_string_lossy()).into_owned(),
    )
}

fn one_sensor_a_channel(document: &Document<'_>, file: &File) -> Result<(), SetupError> {
    let motion = file.accelerometer.iter().map(|a| &a.channel).enumerate();
    let motion = motion.map(|(number, channel)| ("accelerometer", number, channel));
    let force = file.load_cell.iter().map(|c| &c.channel).enumerate();
    let force = force.map(|(number, channel)| ("load_cell", number, channel));
    let mut seen = BTreeMap::new();
    for (list, number, channel) in motion.chain(force) {
        if let Some((list_of_first, first)) = seen.insert(channel, (list, number)) {
            return Err(SetupError::DuplicateChannel {
                place: document.section(list, number).place_of("channel"),
                channel: channel.clone(),
                first: document.section(list_of_first, first).title,
            });
        }
    }
    Ok(())
}

impl super::BandError {
    fn key(&self) -> &'static str {
        match self {
            Self::AboveSpectrum { key, .. } | Self::TooFewLines { key, .. } => key,
        }
    }
}

/// Checks run `number` against the sensors and the runs before it.
fn check_run(
    section: &Section<'_>,
    number: usize,
    file: &File,
    document: &Document<'_>,
) -> Result<(), SetupError> {
    let (run, before) = (&file.run[number], &file.run[..number]);
    if !run.references.is_empty() && run.excitation != Excitation::Random {
        return Err(SetupError::ReferenceUnused {
            place: section.place_of("reference"),
            excitation: run.excitation.word(),
        });
    }
    for (k, channel) in run.references.iter().enumerate() {
        let sensors = file.accelerometer.iter().map(|a| &a.channel);
        let mut sensors = sensors.chain(file.load_cell.iter().map(|c| &c.channel));
        if sensors.any(|c| c == channel) {
            return Err(SetupError::ReferenceIsSensor {
                place: section.place_of("reference"),
                channel: channel.clone(),
            });
        }
        if run.references[..k].contains(channel) {
            return Err(SetupError::ReferenceTwice {
                place: section.place_of("reference"),
                channel: channel.clone(),
            });
        }
    }
    check_weights(section, run, file)?;
    check_repeats(section, run, before)?;
    if let Some(first) = before.iter().position(|other| other.name == run.name) {
        return Err(SetupError::DuplicateRun {
            place: section.place_of("name"),
            name: run.name.clone(),
            first: document.section("run", first).title,
        });
    }
    if file.processing.is_none() && run.excitation != Excitation::Static {
        return Err(SetupError::NoProcessing {
            place: section.place(),
        });
    }
    Ok(())
}

/// Refuses a run that repeats what is no run before it, or not the same test.
fn check_repeats(section: &Section<'_>, run: &Run, before: &[Run]) -> Result<(), SetupError> {
    let Some(name) = &run.repeats else {
        return Ok(());
    };
    let expected = if run.excitation != Excitation::Sine {
        "only in a run of `excitation = \"sine\"`: blocks of a random run repeat it, and poses are told to be the same by a column `pose` of their recording"
    } else {
        match before.iter().find(|other| other.name == *name) {
            None => "the name of a run that stands before this one",
            Some(first) if first.repeats.is_some() => {
                "the name of the first of the runs that repeat each other"
            }
            Some(first)
                if first.excitation != run.excitation
                    || first.rotation != run.rotation
                    || first.translation != run.translation =>
            {
                "the name of a sine run in which the specimen stands as in this one"
            }
            Some(_) => return Ok(()),
        }
    };
    let found = format_args!("\"{}\"", quoted(name));
    Err(section.unexpected("repeats", found, expected).into())
}

fn check_weights(section: &Section<'_>, run: &Run, file: &File) -> Result<(), SetupError> {
    for (channel, &weight) in &run.weights {
        // The line of a place is counted from the file's beginning, so only where it is told.
        let place = || section.place_of("weights");
        let sensors = file.accelerometer.iter().map(|a| a.channel.as_str());
        if file.load_cell.iter().any(|cell| cell.channel == *channel) {
            return Err(SetupError::WeightOnLoadCell {
                place: place(),
                channel: channel.clone(),
            });
        }
        if !sensors.clone().any(|sensor| sensor == channel) {
            return Err(SetupError::WeightUnknown {
                place: place(),
                channel: quoted(channel),
                hint: nearest(channel, sensors),
            });
        }
        if !(weight > 0.0 && weight <= 1.0) {
            return Err(SetupError::WeightRange {
                place: place(),
                channel: channel.clone(),
                found: weight,
            });
        }
    }
    Ok(())
}

//! From a setup file to [`Setup`]: serde reads its keys, and what several of them say together is
//! checked here.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Deserializer};

use super::document::{Document, Keys, Section, Source, nearest};
use super::keys::{self, outside, text, vector, word};
use super::sensors::{self, SensorKeys, Sensors};
use super::units::Length;
use super::{
    BLOCK_LENGTHS, Defaults, Estimation, Excitation, OVERLAPS, Place, Processing, Run, Setup,
    SetupError,
};
use crate::frame::Frame;
use crate::limits;
use crate::printable::{printable, quoted};
use crate::recording::{Checksum, Form};

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
    #[serde(deserialize_with = "super::form::read")]
    recording: Form,
    #[serde(deserialize_with = "super::frame::read")]
    frame: Option<Frame>,
    length_unit: Length,
    sensor_type: Vec<SensorKeys>,
    accelerometer: Vec<SensorKeys>,
    load_cell: Vec<SensorKeys>,
    run: Vec<Run>,
}

impl Keys for File {
    const REQUIRED: &'static [(&'static str, &'static str)] = &[
        (
            "averaging_band",
            "[low, high] in Hz, well below the first elastic natural frequency",
        ),
        ("name", "what the run is called in results"),
        ("recording", "the recording's file name"),
        ("crc32", CRC32),
        ("bytes", BYTES),
    ];
}

const MASS_UNCERTAINTY: &str =
    "the standard uncertainty of `known_mass` in kg, more than 0, beside a `known_mass`";
const RIGID_UP_TO: &str = "a frequency in Hz, above the end of `averaging_band`";
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
    rigid_up_to: RIGID_UP_TO, |frequency| frequency > 0.0;
    tolerance: "a distance in m, more than 0", |distance| distance > 0.0;
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
    let sensors = document.count("accelerometer") + document.count("load_cell");
    fits(source, sensors, document.count("run"))?;
    sensors::check_keys(&document)?;
    let mut file: File = document.read()?;
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
    if let (Some(processing), Some(highest)) = (&file.processing, file.estimation.rigid_up_to)
        && highest <= processing.averaging_band[1]
    {
        let estimation = document.section("estimation", 0);
        return Err(estimation
            .unexpected("rigid_up_to", highest, RIGID_UP_TO)
            .into());
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
    let lists = sensors::Lists {
        accelerometer: std::mem::take(&mut file.accelerometer),
        load_cell: std::mem::take(&mut file.load_cell),
        sensor_type: std::mem::take(&mut file.sensor_type),
    };
    let length = file.length_unit;
    let sensors = sensors::sensors(&document, &lists, length)?;
    let has = |kind: Excitation| file.run.iter().any(|run| run.excitation == kind);
    if has(Excitation::Sine) {
        sensors.no_delays(&document)?;
    }
    if has(Excitation::Static) {
        sensors.no_corners(&document)?;
    }
    let count = sensors.accelerometers.len() + sensors.load_cells.len();
    fits(source, count, file.run.len())?;
    one_sensor_a_channel(&document, &sensors)?;
    for (number, section) in document.sections("run").iter().enumerate() {
        check_run(section, number, &file, &sensors, &document)?;
    }
    if document.section("estimation", 0).has("tolerance") {
        file.estimation.tolerance = length.metres(file.estimation.tolerance);
    }
    for run in &mut file.run {
        run.translation = run.translation.map(|x| length.metres(x));
    }
    Ok(Setup {
        title: file.title.unwrap_or_else(|| stem(&source.file)),
        reference_point: file.reference_point.map(|x| length.metres(x)),
        known_mass: file.known_mass,
        known_mass_uncertainty: file.known_mass_uncertainty,
        processing: file.processing,
        estimation: file.estimation,
        defaults: file.defaults.in_metres(length, &document)?,
        form: file.recording,
        frame: file.frame.map(|frame| Frame {
            origin: frame.origin.map(|x| length.metres(x)),
            ..frame
        }),
        accelerometers: sensors.accelerometers,
        load_cells: sensors.load_cells,
        runs: file.run,
        folder: source.file.parent().map(Path::to_owned).unwrap_or_default(),
    })
}

/// Refuses more entries than can be used before any of them is looked at.
fn fits(source: &Source, sensors: usize, runs: usize) -> Result<(), SetupError> {
    let split = "do the test in parts, each with a setup of its own";
    for (what, found, limit, advice) in [
        ("sensors", sensors, limits::SENSORS, "leave some out"),
        ("runs", runs, limits::RUNS, split),
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

fn one_sensor_a_channel(document: &Document<'_>, all: &Sensors) -> Result<(), SetupError> {
    let [of_motion, of_force] = &all.sections;
    let motion = of_motion.iter().zip(&all.accelerometers);
    let motion = motion.map(|(number, a)| ("accelerometer", *number, &a.channel));
    let force = of_force.iter().zip(&all.load_cells);
    let force = force.map(|(number, c)| ("load_cell", *number, &c.channel));
    let mut seen = BTreeMap::new();
    for (list, number, channel) in motion.chain(force) {
        if let Some((list_of_first, first)) = seen.insert(channel, (list, number)) {
            return Err(SetupError::DuplicateChannel {
                place: place_of_channel(&document.section(list, number)),
                channel: channel.clone(),
                first: document.section(list_of_first, first).title,
            });
        }
    }
    Ok(())
}

/// Place of the key that names a sensor's channels.
fn place_of_channel(section: &Section<'_>) -> Box<Place> {
    let keys = ["channel", "channels", "triaxial"];
    let key = keys.into_iter().find(|key| section.has(key));
    section.place_of(key.unwrap_or("channel"))
}

impl super::BandError {
    fn key(&self) -> &'static str {
        match self {
            Self::AmongModes { .. } => "averaging_band",
            Self::AboveSpectrum { key, .. } | Self::TooFewLines { key, .. } => key,
        }
    }
}

/// Checks run `number` against the sensors and the runs before it.
fn check_run(
    section: &Section<'_>,
    number: usize,
    file: &File,
    all: &Sensors,
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
        let sensors = all.accelerometers.iter().map(|a| &a.channel);
        let mut sensors = sensors.chain(all.load_cells.iter().map(|c| &c.channel));
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
    if let (true, Some(unit)) = (run.references.is_empty(), &run.reference_unit) {
        let found = format_args!("\"{}\"", quoted(unit));
        let expected = "it beside a `reference`";
        return Err(section.unexpected("reference_unit", found, expected).into());
    }
    check_weights(section, run, all)?;
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

fn check_weights(section: &Section<'_>, run: &Run, all: &Sensors) -> Result<(), SetupError> {
    for (channel, &weight) in &run.weights {
        // The line of a place is counted from the file's beginning, so only where it is told.
        let place = || section.place_of("weights");
        let sensors = all.accelerometers.iter().map(|a| a.channel.as_str());
        if all.load_cells.iter().any(|cell| cell.channel == *channel) {
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

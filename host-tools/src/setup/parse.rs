//! From the sections of a setup file to [`Setup`], with everything checked on the way.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::document::{Section, Source, nearest};
use super::{
    AccelerometerEntry, BLOCK_LENGTHS, DEFAULT_BLOCK_LENGTH, DEFAULT_OVERLAP, Estimation,
    Excitation, LoadCellEntry, Mount, OVERLAPS, Processing, Quantity, Run, Setup, SetupError,
    uncertainty,
};
use crate::limits;
use crate::printable::printable;
use crate::printable::quoted;
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

/// Sensor in which each channel was first seen.
type Channels = BTreeMap<String, String>;

pub(super) fn setup(source: &Source) -> Result<Setup, SetupError> {
    let table = source.parse()?;
    let root = Section::root(source, &table);
    root.only(&[
        "title",
        "reference_point",
        "known_mass",
        "known_mass_uncertainty",
        "processing",
        "estimation",
        "defaults",
        "accelerometer",
        "load_cell",
        "run",
    ])?;

    fits(source, &root)?;

    let known_mass = root.number_where(
        "known_mass",
        "the weighed mass in kg, more than 0 (leave it out to have the mass identified)",
        |mass| mass > 0.0,
    )?;
    let known_mass_uncertainty = root.number_where(
        "known_mass_uncertainty",
        "the standard uncertainty of `known_mass` in kg, more than 0, beside a `known_mass`",
        |u| u > 0.0 && known_mass.is_some(),
    )?;
    let processing = root
        .section("processing")?
        .map(|section| processing(&section))
        .transpose()?;

    let estimation = root
        .section("estimation")?
        .map(|section| estimation(&section))
        .transpose()?
        .unwrap_or_default();
    let defaults = root
        .section("defaults")?
        .map(|section| uncertainty::defaults(&section))
        .transpose()?
        .unwrap_or_default();

    let mut seen = Channels::new();
    let accelerometers = root
        .sections("accelerometer", "channel")?
        .iter()
        .map(|section| accelerometer(section, &mut seen))
        .collect::<Result<Vec<_>, _>>()?;
    let load_cells = root
        .sections("load_cell", "channel")?
        .iter()
        .map(|section| load_cell(section, &mut seen))
        .collect::<Result<Vec<_>, _>>()?;
    not_empty(
        source,
        "accelerometer",
        "no motion is known",
        &accelerometers,
    )?;
    not_empty(source, "load_cell", "no force is known", &load_cells)?;

    let sections = root.sections("run", "name")?;
    not_empty(source, "run", "there is nothing to evaluate", &sections)?;
    let mut names = BTreeMap::new();
    let mut runs: Vec<Run> = Vec::with_capacity(sections.len());
    for section in &sections {
        let run = run(section, &accelerometers, &load_cells)?;
        repeats(section, &run, &runs)?;
        if let Some(first) = names.insert(run.name.clone(), section.title.clone()) {
            return Err(SetupError::DuplicateRun {
                place: section.place_of("name"),
                name: run.name,
                first,
            });
        }
        if processing.is_none() && run.excitation != Excitation::Static {
            return Err(SetupError::NoProcessing {
                place: section.place(),
            });
        }
        runs.push(run);
    }

    Ok(Setup {
        title: root.text("title")?.unwrap_or_else(|| stem(&source.file)),
        reference_point: root.vector("reference_point")?.unwrap_or_default(),
        known_mass,
        known_mass_uncertainty,
        processing,
        estimation,
        defaults,
        accelerometers,
        load_cells,
        runs,
        folder: source.file.parent().map(Path::to_owned).unwrap_or_default(),
    })
}

/// Refuses more entries than can be used before any of them is looked at.
fn fits(source: &Source, root: &Section<'_>) -> Result<(), SetupError> {
    let sensors = root.count("accelerometer") + root.count("load_cell");
    let split = "do the test in parts, each with a setup of its own";
    for (what, found, limit, advice) in [
        ("sensors", sensors, limits::SENSORS, "leave some out"),
        ("runs", root.count("run"), limits::RUNS, split),
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

fn not_empty<T>(
    source: &Source,
    list: &'static str,
    reason: &'static str,
    entries: &[T],
) -> Result<(), SetupError> {
    if entries.is_empty() {
        return Err(SetupError::NoEntries {
            file: source.file.clone(),
            list,
            reason,
        });
    }
    Ok(())
}

fn processing(section: &Section<'_>) -> Result<Processing, SetupError> {
    section.only(&[
        "sample_rate",
        "block_length",
        "overlap",
        "averaging_band",
        "mode_band",
    ])?;
    let sample_rate = section.number_where(
        "sample_rate",
        "samples per second in Hz, more than 0",
        |rate| rate > 0.0,
    )?;
    let block_length = section.number_where(
        "block_length",
        &format!(
            "a power of two from {} to {}",
            BLOCK_LENGTHS.start(),
            BLOCK_LENGTHS.end()
        ),
        // The cast is exact where it matters: what it would change fails the comparison.
        |length| {
            let whole = length as usize;
            whole as f64 == length && whole.is_power_of_two() && BLOCK_LENGTHS.contains(&whole)
        },
    )?;
    let overlap = section.number_where(
        "overlap",
        &format!(
            "a share of the block from {} to {}",
            OVERLAPS.start(),
            OVERLAPS.end()
        ),
        |overlap| OVERLAPS.contains(&overlap),
    )?;
    let processing = Processing {
        sample_rate,
        block_length: block_length.map_or(DEFAULT_BLOCK_LENGTH, |length| length as usize),
        overlap: overlap.unwrap_or(DEFAULT_OVERLAP),
        averaging_band: band(section, "averaging_band")?.ok_or_else(|| {
            section.missing(
                "averaging_band",
                "[low, high] in Hz, well below the first elastic natural frequency",
            )
        })?,
        mode_band: band(section, "mode_band")?,
    };
    if let Some(rate) = sample_rate {
        processing
            .check_bands(rate)
            .map_err(|source| SetupError::BandLines {
                place: section.place_of(source.key()),
                source,
            })?;
    }
    Ok(processing)
}

fn estimation(section: &Section<'_>) -> Result<Estimation, SetupError> {
    section.only(&[
        "minimum_weight",
        "modes",
        "fit_band",
        "tolerance",
        "iterations",
    ])?;
    let default = Estimation::default();
    let most = default.modes as f64;
    let whole = |number: f64| number.fract() == 0.0;
    let minimum_weight = section.number_where(
        "minimum_weight",
        "the weight of the accelerometer that sees the modes most, more than 0 and at most 1",
        |weight| weight > 0.0 && weight <= 1.0,
    )?;
    let modes = section.number_where(
        "modes",
        &format!("a whole number of modes from 1 to {most}"),
        |modes| whole(modes) && (1.0..=most).contains(&modes),
    )?;
    let tolerance =
        section.number_where("tolerance", "a distance in m, more than 0", |t| t > 0.0)?;
    let iterations = section.number_where("iterations", "a whole number from 1 to 1000", |n| {
        whole(n) && (1.0..=1000.0).contains(&n)
    })?;
    Ok(Estimation {
        minimum_weight: minimum_weight.unwrap_or(default.minimum_weight),
        modes: modes.map_or(default.modes, |modes| modes as usize),
        fit_band: band(section, "fit_band")?,
        tolerance: tolerance.unwrap_or(default.tolerance),
        iterations: iterations.map_or(default.iterations, |n| n as u32),
    })
}

impl super::BandError {
    fn key(&self) -> &'static str {
        match self {
            Self::AboveSpectrum { key, .. } | Self::TooFewLines { key, .. } => key,
        }
    }
}

fn band(section: &Section<'_>, key: &'static str) -> Result<Option<[f64; 2]>, SetupError> {
    match section.vector::<2>(key)? {
        Some(found) if found[0] < 0.0 || found[1] <= found[0] => Err(SetupError::Band {
            place: section.place_of(key),
            key,
            found,
        }),
        band => Ok(band),
    }
}

/// Refuses keys that are neither among these nor say how sure a sensor is.
fn only(section: &Section<'_>, known: &[&str]) -> Result<(), SetupError> {
    let all: Vec<&str> = known.iter().copied().chain(uncertainty::KEYS).collect();
    Ok(section.only(&all)?)
}

fn accelerometer(
    section: &Section<'_>,
    seen: &mut Channels,
) -> Result<AccelerometerEntry, SetupError> {
    only(
        section,
        &["channel", "position", "direction", "mount", "scale"],
    )?;
    Ok(AccelerometerEntry {
        channel: channel(section, seen)?,
        position: position(section)?,
        direction: direction(section)?,
        mount: section
            .choice("mount", &MOUNTS)?
            .unwrap_or(Mount::Structure),
        scale: scale(section)?,
        uncertainty: uncertainty::read(section)?,
    })
}

fn load_cell(section: &Section<'_>, seen: &mut Channels) -> Result<LoadCellEntry, SetupError> {
    only(
        section,
        &["channel", "position", "direction", "quantity", "scale"],
    )?;
    let quantity = section
        .choice("quantity", &QUANTITIES)?
        .unwrap_or(Quantity::Force);
    Ok(LoadCellEntry {
        channel: channel(section, seen)?,
        position: match quantity {
            Quantity::Force => position(section)?,
            Quantity::Moment => section.vector("position")?.unwrap_or_default(),
        },
        direction: direction(section)?,
        quantity,
        scale: scale(section)?,
        uncertainty: uncertainty::read(section)?,
    })
}

fn channel(section: &Section<'_>, seen: &mut Channels) -> Result<String, SetupError> {
    let channel = section
        .text("channel")?
        .ok_or_else(|| section.missing("channel", "the column's name in the recordings"))?;
    if let Some(first) = seen.insert(channel.clone(), section.title.clone()) {
        return Err(SetupError::DuplicateChannel {
            place: section.place_of("channel"),
            channel,
            first,
        });
    }
    Ok(channel)
}

fn position(section: &Section<'_>) -> Result<[f64; 3], SetupError> {
    Ok(section
        .vector("position")?
        .ok_or_else(|| section.missing("position", "[x, y, z] in m"))?)
}

fn direction(section: &Section<'_>) -> Result<[f64; 3], SetupError> {
    let found = section.vector("direction")?.ok_or_else(|| {
        section.missing(
            "direction",
            "the axis along which the channel reads positive, for example [0, 0, 1]",
        )
    })?;
    unit(found).ok_or_else(|| SetupError::ZeroDirection {
        place: section.place_of("direction"),
    })
}

fn scale(section: &Section<'_>) -> Result<f64, SetupError> {
    Ok(section
        .number_where("scale", "SI units per recorded unit, not 0", |scale| {
            scale != 0.0
        })?
        .unwrap_or(1.0))
}

/// The vector at unit length, `None` for the zero vector.
///
/// A vector that is a unit vector to rounding is returned untouched, so that a setup
/// that was written and read again is bit for bit the same.
pub(crate) fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    // Scaled by the largest component first: squares of 1e-200 would vanish.
    let largest = vector.iter().fold(0.0_f64, |max, c| max.max(c.abs()));
    if largest == 0.0 {
        return None;
    }
    let square: f64 = vector.iter().map(|c| c * c).sum();
    // Three squares, two sums and the rounding of three components: below 8 ε.
    if (square - 1.0).abs() <= 8.0 * f64::EPSILON {
        return Some(vector);
    }
    let scaled = vector.map(|c| c / largest);
    let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    Some(scaled.map(|c| c / length))
}

fn run(
    section: &Section<'_>,
    accelerometers: &[AccelerometerEntry],
    load_cells: &[LoadCellEntry],
) -> Result<Run, SetupError> {
    section.only(&[
        "name",
        "recording",
        "checksum",
        "excitation",
        "reference",
        "repeats",
        "weights",
        "rotation",
        "translation",
    ])?;
    let excitation = section
        .choice("excitation", &EXCITATIONS)?
        .unwrap_or(Excitation::Random);
    let references = section.texts("reference")?;
    if !references.is_empty() && excitation != Excitation::Random {
        return Err(SetupError::ReferenceUnused {
            place: section.place_of("reference"),
            excitation: excitation.word(),
        });
    }
    for (k, channel) in references.iter().enumerate() {
        let sensors = accelerometers.iter().map(|a| &a.channel);
        let mut sensors = sensors.chain(load_cells.iter().map(|c| &c.channel));
        if sensors.any(|c| c == channel) {
            return Err(SetupError::ReferenceIsSensor {
                place: section.place_of("reference"),
                channel: channel.clone(),
            });
        }
        if references[..k].contains(channel) {
            return Err(SetupError::ReferenceTwice {
                place: section.place_of("reference"),
                channel: channel.clone(),
            });
        }
    }
    Ok(Run {
        name: section
            .text("name")?
            .ok_or_else(|| section.missing("name", "what the run is called in results"))?,
        recording: section
            .text("recording")?
            .map(PathBuf::from)
            .ok_or_else(|| section.missing("recording", "the recording's file name"))?,
        checksum: checksum(section)?,
        excitation,
        references,
        repeats: section.text("repeats")?,
        weights: weights(section, accelerometers, load_cells)?,
        rotation: section.vector("rotation")?.unwrap_or_default(),
        translation: section.vector("translation")?.unwrap_or_default(),
    })
}

/// Refuses a run that repeats what is no run before it, or not the same test.
fn repeats(section: &Section<'_>, run: &Run, before: &[Run]) -> Result<(), SetupError> {
    let Some(name) = &run.repeats else {
        return Ok(());
    };
    let found = format!("\"{}\"", quoted(name));
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
    Err(section.unexpected("repeats", found, expected).into())
}

fn checksum(section: &Section<'_>) -> Result<Option<Checksum>, SetupError> {
    let Some(table) = section.section("checksum")? else {
        return Ok(None);
    };
    table.only(&["crc32", "bytes"])?;
    let expected = "the CRC-32 of the recording in eight hexadecimal digits, such as \"cbf43926\"";
    let crc32 = table
        .text("crc32")?
        .ok_or_else(|| table.missing("crc32", expected))?;
    let is_hex = crc32.len() == 8 && crc32.bytes().all(|b| b.is_ascii_hexdigit());
    let Some(crc32) = u32::from_str_radix(&crc32, 16).ok().filter(|_| is_hex) else {
        return Err(table
            .unexpected("crc32", format!("\"{crc32}\""), expected)
            .into());
    };
    // Up to 2^53 every whole number has its own f64.
    let length = "the recording's length, a whole number of bytes";
    let bytes = table
        .number_where("bytes", length, |n| {
            n.fract() == 0.0 && (0.0..=9e15).contains(&n)
        })?
        .ok_or_else(|| table.missing("bytes", length))?;
    Ok(Some(Checksum {
        crc32,
        bytes: bytes as u64,
    }))
}

fn weights(
    section: &Section<'_>,
    accelerometers: &[AccelerometerEntry],
    load_cells: &[LoadCellEntry],
) -> Result<BTreeMap<String, f64>, SetupError> {
    let mut weights = BTreeMap::new();
    let Some(table) = section.section("weights")? else {
        return Ok(weights);
    };
    for (channel, weight) in table.numbers()? {
        // The line of a place is counted from the file's beginning, so only where it is told.
        let place = || section.place_of("weights");
        if load_cells.iter().any(|cell| cell.channel == channel) {
            let place = place();
            return Err(SetupError::WeightOnLoadCell { place, channel });
        }
        if !accelerometers.iter().any(|a| a.channel == channel) {
            let hint = nearest(&channel, accelerometers.iter().map(|a| a.channel.as_str()));
            return Err(SetupError::WeightUnknown {
                place: place(),
                channel: quoted(&channel),
                hint,
            });
        }
        if !(weight > 0.0 && weight <= 1.0) {
            return Err(SetupError::WeightRange {
                place: place(),
                channel,
                found: weight,
            });
        }
        weights.insert(channel, weight);
    }
    Ok(weights)
}

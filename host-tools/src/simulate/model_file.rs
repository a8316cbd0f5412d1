//! The TOML format of bodies and sprung masses on a six-axis table, as `models/README.md`
//! describes it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::Deserialize;

use super::DRIVE;
use super::error::ModelError;
use super::lumped::{Body, SprungMass, reading, specimen};
use super::model::{AXES, Measurement, Model, MotionSensor, Plan, Shaking, Table};
use crate::setup::{
    AccelerometerEntry, Document, Keys, LoadCellEntry, Mount, Quantity, Section, Source, keys,
    nearest, quantity,
};

/// Longest chain of files that extend each other.
const LONGEST_CHAIN: usize = 8;

impl Model {
    /// Reads a model: `.toml` for bodies and sprung masses, `.json` for plane beams.
    ///
    /// # Errors
    /// Whatever is wrong with the file, with line and section, and what to write instead.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("toml") => model(Source::read(path)?),
            Some("json") => Self::from_json(Source::read(path)?.text(), path),
            _ => Err(ModelError::Format {
                file: path.to_owned(),
            }),
        }
    }

    /// All files that a model is read from: itself and those that it extends.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub fn files(path: &Path) -> Result<Vec<PathBuf>, ModelError> {
        if path.extension().is_none_or(|extension| extension != "toml") {
            return Ok(vec![path.to_owned()]);
        }
        let chain = chain(Source::read(path)?)?;
        Ok(chain.into_iter().map(|(source, _)| source.file).collect())
    }

    /// A model of bodies and sprung masses from text; `path` names the file in messages,
    /// and `extends` is looked for beside it.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, ModelError> {
        model(Source::new(text, path))
    }
}

/// A file as a whole; a key that it has hides the same key of the file that it extends.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
struct File {
    #[serde(deserialize_with = "keys::text")]
    title: Option<String>,
    #[serde(deserialize_with = "keys::text")]
    extends: Option<String>,
    #[serde(deserialize_with = "keys::vector")]
    reference_point: Option<[f64; 3]>,
    body: Option<Vec<Body>>,
    sprung_mass: Option<Vec<SprungMass>>,
    accelerometer: Option<Vec<AccelerometerKeys>>,
    load_cell: Option<Vec<LoadCellKeys>>,
    table: Option<Table>,
    measurement: Option<Measurement>,
    run: Option<Vec<RunKeys>>,
}

const VECTOR: &str = "[x, y, z]";
const POSITIVE: &str = "a number more than 0";

impl Keys for File {
    const REQUIRED: &'static [(&'static str, &'static str)] = &[
        ("name", "a name that nothing else has"),
        ("mass", POSITIVE),
        ("centre_of_gravity", VECTOR),
        ("position", VECTOR),
        ("direction", VECTOR),
        ("frequency", POSITIVE),
        ("damping", POSITIVE),
        ("averaging_band", "[low, high] in Hz"),
    ];
}

/// An `[[accelerometer]]` of one or three channels.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct AccelerometerKeys {
    #[serde(deserialize_with = "keys::text")]
    name: String,
    #[serde(default, deserialize_with = "keys::vector")]
    position: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "keys::direction")]
    direction: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "keys::text")]
    on: Option<String>,
}

/// A `[[load_cell]]` of one or three channels.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct LoadCellKeys {
    #[serde(deserialize_with = "keys::text")]
    name: String,
    #[serde(deserialize_with = "keys::vector")]
    position: [f64; 3],
    #[serde(default, deserialize_with = "keys::direction")]
    direction: Option<[f64; 3]>,
    #[serde(default = "force", deserialize_with = "quantity")]
    quantity: Quantity,
}

fn force() -> Quantity {
    Quantity::Force
}

/// A `[[run]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RunKeys {
    #[serde(deserialize_with = "keys::text")]
    name: String,
    #[serde(default, deserialize_with = "keys::motion")]
    motion: Option<[f64; 6]>,
    #[serde(default, deserialize_with = "keys::band")]
    band: Option<[f64; 2]>,
    drive: Option<bool>,
    #[serde(default, deserialize_with = "keys::vectors")]
    poses: Option<Vec<[f64; 3]>>,
    #[serde(default, deserialize_with = "keys::vector")]
    rotation: [f64; 3],
    #[serde(default, deserialize_with = "keys::vector")]
    translation: [f64; 3],
}

/// The file and those it extends, in that order.
fn chain(first: Source) -> Result<Vec<(Source, File)>, ModelError> {
    let mut chain = Vec::new();
    let mut next = Some(first);
    while let Some(source) = next {
        let file: File = Document::new(&source)?.read()?;
        let base = file.extends.as_deref().map(|base| {
            let folder = source.file.parent();
            folder.map_or_else(|| base.into(), |folder| folder.join(base))
        });
        chain.push((source, file));
        if let (Some(file), LONGEST_CHAIN) = (&base, chain.len()) {
            return Err(ModelError::Endless {
                file: file.clone(),
                limit: LONGEST_CHAIN,
            });
        }
        next = base.map(|base| Source::read(&base)).transpose()?;
    }
    Ok(chain)
}

/// The first file of a chain that has a key, and its value.
struct Layers<'a>(Vec<(Document<'a>, File)>);

impl<'a> Layers<'a> {
    /// The document of the file itself where none has the key.
    fn take<T>(&mut self, key: impl Fn(&mut File) -> Option<T>) -> (&Document<'a>, Option<T>) {
        let found = self.0.iter_mut().enumerate();
        let found = found.map(|(layer, (_, file))| (layer, key(file)));
        let found = found.filter(|(_, value)| value.is_some());
        // The list starts with the file itself, and is never empty.
        let (layer, value) = found.take(1).next().unwrap_or((0, None));
        (&self.0[layer].0, value)
    }

    /// The tables of a list, each with its place.
    fn list<T>(
        &mut self,
        name: &str,
        key: impl Fn(&mut File) -> Option<Vec<T>>,
    ) -> Vec<(Section<'_>, T)> {
        let (document, list) = self.take(key);
        let sections = document.sections(name).into_iter();
        sections.zip(list.unwrap_or_default()).collect()
    }
}

/// Names that are taken, and by whom.
type Names = BTreeMap<String, String>;

fn claim(names: &mut Names, name: &str, section: &Section<'_>) -> Result<(), ModelError> {
    match names.insert(name.to_owned(), section.title.clone()) {
        None => Ok(()),
        Some(first) => Err(ModelError::DuplicateName {
            place: section.place_of("name"),
            name: name.to_owned(),
            first,
        }),
    }
}

fn model(first: Source) -> Result<Model, ModelError> {
    let (sources, files): (Vec<Source>, Vec<File>) = chain(first)?.into_iter().unzip();
    let documents = sources.iter().map(Document::new);
    let documents = documents.collect::<Result<Vec<_>, _>>()?;
    let mut layers = Layers(documents.into_iter().zip(files).collect());

    let mut parts = Names::new();
    for reserved in ["interface", "structure"] {
        parts.insert(reserved.to_owned(), format!("the {reserved} itself"));
    }
    let mut bodies = Vec::new();
    for (section, body) in layers.list("body", |file| file.body.take()) {
        claim(&mut parts, &body.name, &section)?;
        bodies.push(body);
    }
    let mut sprung = Vec::new();
    for (section, mass) in layers.list("sprung_mass", |file| file.sprung_mass.take()) {
        claim(&mut parts, &mass.name, &section)?;
        sprung.push(mass);
    }
    // Modes ascend in frequency everywhere.
    sprung.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));

    let mut taken = Names::from([(DRIVE.to_owned(), "the drive signal".to_owned())]);
    let mut accelerometers = Vec::new();
    for (section, keys) in layers.list("accelerometer", |file| file.accelerometer.take()) {
        accelerometer(
            &section,
            &keys,
            &parts,
            &sprung,
            &mut taken,
            &mut accelerometers,
        )?;
    }
    let mut load_cells = Vec::new();
    for (section, keys) in layers.list("load_cell", |file| file.load_cell.take()) {
        for (channel, direction) in channels(&section, &keys.name, keys.direction, &mut taken)? {
            let cell = LoadCellEntry::new(channel, keys.position, direction, keys.quantity);
            load_cells.push(cell);
        }
    }
    let table = layers.take(|file| file.table.take()).1.unwrap_or_default();
    let mut runs = Vec::new();
    let mut names = Names::new();
    for (section, keys) in layers.list("run", |file| file.run.take()) {
        claim(&mut names, &keys.name, &section)?;
        runs.push(run(&section, keys, &table)?);
    }
    for (list, reason, found) in [
        ("[[body]]", "nothing stands on the table", bodies.len()),
        (
            "[[accelerometer]]",
            "no motion is recorded",
            accelerometers.len(),
        ),
        ("[[load_cell]]", "no force is recorded", load_cells.len()),
        ("[[run]]", "there is nothing to simulate", runs.len()),
    ] {
        if found == 0 {
            return Err(ModelError::NoEntries {
                file: sources[0].file.clone(),
                list,
                reason,
            });
        }
    }
    let (document, measurement) = layers.take(|file| file.measurement.take());
    let expected = "a section with `averaging_band`";
    let measurement = measurement.ok_or_else(|| document.top().missing("measurement", expected))?;
    let bands = measurement
        .processing()
        .check_bands(measurement.sample_rate);
    bands.map_err(|source| ModelError::Band {
        place: document.section("measurement", 0).place(),
        source,
    })?;
    let title = layers.take(|file| file.title.take()).1;
    let reference_point = layers.take(|file| file.reference_point.take()).1;
    Ok(Model {
        title: title.unwrap_or_else(|| "Untitled".to_owned()),
        reference_point: reference_point.unwrap_or_default(),
        specimen: specimen(&bodies, &sprung),
        accelerometers,
        load_cells,
        table,
        measurement,
        runs,
    })
}

/// The channels of a sensor with their unit directions: one as named where a direction
/// is given, else three with the axis appended.
fn channels(
    section: &Section<'_>,
    name: &str,
    direction: Option<[f64; 3]>,
    taken: &mut Names,
) -> Result<Vec<(String, [f64; 3])>, ModelError> {
    let channels = match direction {
        Some(direction) => vec![(name.to_owned(), direction)],
        None => vec![
            (format!("{name}.x"), [1.0, 0.0, 0.0]),
            (format!("{name}.y"), [0.0, 1.0, 0.0]),
            (format!("{name}.z"), [0.0, 0.0, 1.0]),
        ],
    };
    for (channel, _) in &channels {
        claim(taken, channel, section)?;
    }
    Ok(channels)
}

fn accelerometer(
    section: &Section<'_>,
    keys: &AccelerometerKeys,
    parts: &Names,
    sprung: &[SprungMass],
    taken: &mut Names,
    sensors: &mut Vec<MotionSensor>,
) -> Result<(), ModelError> {
    let on = keys.on.as_deref().unwrap_or("structure");
    if !parts.contains_key(on) {
        return Err(ModelError::NoSuchPart {
            place: section.place_of("on"),
            hint: nearest(on, parts.keys().map(String::as_str)),
            name: on.to_owned(),
        });
    }
    let mount = match on {
        "interface" => Mount::Interface,
        _ => Mount::Structure,
    };
    let carrier = sprung.iter().find(|mass| mass.name == on);
    let own = carrier.map(|mass| mass.position.into());
    let position = keys.position.or(own);
    let position = position.ok_or_else(|| section.missing("position", VECTOR))?;
    for (channel, direction) in channels(section, &keys.name, keys.direction, taken)? {
        let shape = sprung.iter().map(|mass| match carrier {
            Some(carrier) if carrier.name == mass.name => reading(mass, &Vector3::from(direction)),
            _ => 0.0,
        });
        sensors.push(MotionSensor {
            shape: shape.collect(),
            entry: AccelerometerEntry::new(channel, position, direction, mount),
        });
    }
    Ok(())
}

fn run(section: &Section<'_>, keys: RunKeys, table: &Table) -> Result<Plan, ModelError> {
    let excitation = match (keys.motion, keys.poses) {
        (Some(motion), None) => {
            let moved = motion.iter().zip(table.axes).zip(AXES);
            let mut fixed = moved.filter(|((level, free), _)| **level != 0.0 && !free);
            if let Some((_, axis)) = fixed.next() {
                return Err(ModelError::NoSuchAxis {
                    place: section.place_of("motion"),
                    axis,
                });
            }
            Shaking::Random {
                motion,
                band: keys.band,
                drive: keys.drive.unwrap_or(true),
            }
        }
        (None, Some(poses)) => Shaking::Poses(poses),
        _ => {
            return Err(ModelError::MotionOrPoses {
                place: section.place(),
            });
        }
    };
    Ok(Plan {
        name: keys.name,
        excitation,
        rotation: keys.rotation,
        translation: keys.translation,
    })
}

//! The TOML format of bodies and sprung masses on a six-axis table, as `models/README.md`
//! describes it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Vector3;

use super::error::ModelError;
use super::lumped::{Body, SprungMass, inertia_tensor, specimen};
use super::model::Model;
use super::sensor_file;
use super::table_file::{measurement, runs, table};
use crate::setup::{DocumentError, Section, Source, unit};

/// Longest chain of files that extend each other.
const LONGEST_CHAIN: usize = 8;

/// A file and those it extends; what stands in an earlier one hides the same key of all
/// later ones.
pub(super) struct Layers<'a>(Vec<Section<'a>>);

impl<'a> Layers<'a> {
    /// The top of the file that has the key.
    pub(super) fn with(&self, key: &str) -> &Section<'a> {
        // The list starts with the file itself, and is never empty.
        self.0
            .iter()
            .find(|layer| layer.has(key))
            .unwrap_or(&self.0[0])
    }

    pub(super) fn list(&self, key: &str) -> Result<Vec<Section<'a>>, DocumentError> {
        self.with(key).sections(key, "name")
    }
}

/// Names that are taken, and by whom.
pub(super) type Names = BTreeMap<String, String>;

pub(super) fn claim(
    names: &mut Names,
    name: &str,
    section: &Section<'_>,
) -> Result<(), ModelError> {
    match names.insert(name.to_owned(), section.title.clone()) {
        None => Ok(()),
        Some(first) => Err(ModelError::DuplicateName {
            place: section.place_of("name"),
            name: name.to_owned(),
            first,
        }),
    }
}

pub(super) fn model(first: Source) -> Result<Model, ModelError> {
    let sources = chain(first)?;
    let tables = sources
        .iter()
        .map(Source::parse)
        .collect::<Result<Vec<_>, _>>()?;
    let layers = Layers(
        sources
            .iter()
            .zip(&tables)
            .map(|(source, table)| Section::root(source, table))
            .collect(),
    );
    for layer in &layers.0 {
        layer.only(&[
            "title",
            "extends",
            "reference_point",
            "body",
            "sprung_mass",
            "accelerometer",
            "load_cell",
            "table",
            "measurement",
            "run",
        ])?;
    }
    build(&layers, &sources[0])
}

/// The files that a model is read from.
pub(super) fn files(first: Source) -> Result<Vec<PathBuf>, ModelError> {
    Ok(chain(first)?.into_iter().map(|s| s.file).collect())
}

/// The file and those it extends, in that order.
fn chain(first: Source) -> Result<Vec<Source>, ModelError> {
    let mut sources = vec![first];
    loop {
        let last = &sources[sources.len() - 1];
        let base = Section::root(last, &last.parse()?).text("extends")?;
        let Some(base) = base else {
            return Ok(sources);
        };
        let file = last.file.parent().map(|folder| folder.join(&base));
        let file = file.unwrap_or_else(|| base.into());
        if sources.len() == LONGEST_CHAIN {
            return Err(ModelError::Endless {
                file,
                limit: LONGEST_CHAIN,
            });
        }
        sources.push(Source::read(&file)?);
    }
}

fn build(layers: &Layers<'_>, source: &Source) -> Result<Model, ModelError> {
    let mut parts = Names::new();
    for reserved in ["interface", "structure"] {
        parts.insert(reserved.to_owned(), format!("the {reserved} itself"));
    }
    let mut bodies = Vec::new();
    for section in layers.list("body")? {
        bodies.push(body(&section, &mut parts)?);
    }
    if bodies.is_empty() {
        return Err(ModelError::NoEntries {
            file: source.file.clone(),
            list: "[[body]]",
            reason: "nothing stands on the table",
        });
    }
    let mut sprung = Vec::new();
    for section in layers.list("sprung_mass")? {
        sprung.push(sprung_mass(&section, &mut parts)?);
    }
    // Modes ascend in frequency everywhere.
    sprung.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));

    let mut channels = Names::new();
    let accelerometers = sensor_file::accelerometers(layers, &parts, &sprung, &mut channels)?;
    let load_cells = sensor_file::load_cells(layers, &mut channels)?;
    let table = table(layers)?;
    let runs = runs(layers, &table)?;
    for (list, reason, empty) in [
        (
            "[[accelerometer]]",
            "no motion is recorded",
            accelerometers.is_empty(),
        ),
        (
            "[[load_cell]]",
            "no force is recorded",
            load_cells.is_empty(),
        ),
        ("[[run]]", "there is nothing to simulate", runs.is_empty()),
    ] {
        if empty {
            return Err(ModelError::NoEntries {
                file: source.file.clone(),
                list,
                reason,
            });
        }
    }
    Ok(Model {
        title: layers
            .with("title")
            .text("title")?
            .unwrap_or_else(|| "Untitled".to_owned()),
        reference_point: layers
            .with("reference_point")
            .vector("reference_point")?
            .unwrap_or_default(),
        specimen: specimen(&bodies, &sprung),
        accelerometers,
        load_cells,
        table,
        measurement: measurement(layers)?,
        runs,
    })
}

pub(super) fn positive(section: &Section<'_>, key: &'static str) -> Result<f64, ModelError> {
    section
        .number_where(key, "a number more than 0", |value| value > 0.0)?
        .ok_or_else(|| section.missing(key, "a number more than 0").into())
}

pub(super) fn share(section: &Section<'_>, key: &'static str) -> Result<f64, ModelError> {
    Ok(section
        .number_where(key, "a share from 0 to 1", |value| {
            (0.0..=1.0).contains(&value)
        })?
        .unwrap_or(0.0))
}

pub(super) fn required_vector(
    section: &Section<'_>,
    key: &'static str,
) -> Result<[f64; 3], ModelError> {
    section
        .vector(key)?
        .ok_or_else(|| section.missing(key, "[x, y, z]").into())
}

pub(super) fn required_name(section: &Section<'_>) -> Result<String, ModelError> {
    section.text("name")?.ok_or_else(|| {
        section
            .missing("name", "a name that nothing else has")
            .into()
    })
}

pub(super) fn unit_direction(
    section: &Section<'_>,
    direction: [f64; 3],
) -> Result<[f64; 3], ModelError> {
    unit(direction).ok_or_else(|| ModelError::ZeroDirection {
        place: section.place_of("direction"),
    })
}

fn body(section: &Section<'_>, parts: &mut Names) -> Result<Body, ModelError> {
    section.only(&["name", "mass", "centre_of_gravity", "inertia"])?;
    claim(parts, &required_name(section)?, section)?;
    let mut inertia = [0.0; 6];
    if let Some(given) = section.section("inertia")? {
        const TERMS: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];
        given.only(&TERMS)?;
        for (slot, term) in inertia.iter_mut().zip(TERMS) {
            *slot = given.number(term)?.unwrap_or(0.0);
        }
    }
    let inertia = inertia_tensor(inertia);
    let mut principal: [f64; 3] = inertia.symmetric_eigenvalues().into();
    principal.sort_by(f64::total_cmp);
    // A thin plate reaches equality, and so does a rod with zero: leave room for rounding.
    let slack = 1e-9 * principal[2].abs();
    if principal[0] < -slack || principal[0] + principal[1] < principal[2] - slack {
        return Err(ModelError::Inertia {
            place: section.place_of("inertia"),
            principal,
        });
    }
    Ok(Body {
        mass: positive(section, "mass")?,
        centre_of_gravity: Vector3::from(required_vector(section, "centre_of_gravity")?),
        inertia,
    })
}

fn sprung_mass(section: &Section<'_>, parts: &mut Names) -> Result<SprungMass, ModelError> {
    section.only(&[
        "name",
        "mass",
        "position",
        "direction",
        "frequency",
        "damping",
    ])?;
    let name = required_name(section)?;
    claim(parts, &name, section)?;
    let direction = unit_direction(section, required_vector(section, "direction")?)?;
    Ok(SprungMass {
        name,
        mass: positive(section, "mass")?,
        position: Vector3::from(required_vector(section, "position")?),
        direction: Vector3::from(direction),
        frequency: positive(section, "frequency")?,
        damping: share(section, "damping")?,
    })
}

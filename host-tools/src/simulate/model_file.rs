//! The TOML format of bodies and sprung masses on a six-axis table, as `models/README.md`
//! describes it.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::error::ModelError;
use super::lumped::{Body, SprungMass, inertia_tensor, specimen};
use super::model::Model;
use super::section::{
    Layers, Names, claim, positive, required_name, required_vector, share, unit_direction,
};
use super::sensor_file;
use super::table_file::{measurement, runs, table};
use crate::setup::{Section, Source};

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
        files(Source::read(path)?)
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

fn model(first: Source) -> Result<Model, ModelError> {
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
fn files(first: Source) -> Result<Vec<PathBuf>, ModelError> {
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

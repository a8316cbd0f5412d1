//! Keys of model files that more than one of their parts has.

use std::collections::BTreeMap;

use super::error::ModelError;
use crate::setup::{DocumentError, Section, unit};

/// A file and those it extends; what stands in an earlier one hides the same key of all
/// later ones.
pub(super) struct Layers<'a>(pub(super) Vec<Section<'a>>);

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

//! Names, units and directions that a file states for channels: by attributes, and by the table of channels of the
//! Rattlesnake controller.

use super::attributes::{self, Attribute};
use super::dataset::Dataset;
use super::file::File;
use super::links::{self, Link};
use super::object::Object;
use crate::printable::printable;
use crate::recording::RecordingError;
use std::collections::HashMap;

/// Attributes that name the channels of a dataset, and those that state their units.
const NAMES: [&str; 7] = [
    "channel_names",
    "channels",
    "channel",
    "names",
    "labels",
    "columns",
    "column_names",
];
const UNITS: [&str; 4] = ["units", "unit", "channel_units", "unit_string"];
/// Directions by the letters of a controller's table.
const AXES: [&str; 6] = ["X", "Y", "Z", "RX", "RY", "RZ"];

/// Names and units of the channels of a dataset; empty where the file states none.
#[derive(Clone, Debug, Default)]
pub(super) struct Labels {
    pub(super) names: Vec<String>,
    /// One for each channel, or one for all of them.
    pub(super) units: Vec<String>,
    pub(super) directions: Vec<Option<[f64; 3]>>,
    /// `true` if they are those of the controller's table.
    pub(super) of_controller: bool,
}

/// Names and units that attributes state.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn labels(file: &File, attributes: &[Attribute]) -> Result<Labels, RecordingError> {
    let list = |names: &[&str]| -> Result<Vec<String>, RecordingError> {
        for name in names {
            let named = attributes
                .iter()
                .filter(|a| a.name.eq_ignore_ascii_case(name));
            for attribute in named {
                if let Some(texts) = attribute.texts(file)? {
                    return Ok(texts
                        .iter()
                        .map(|t| printable(t.trim()).into_owned())
                        .collect());
                }
            }
        }
        Ok(Vec::new())
    };
    Ok(Labels {
        names: list(&NAMES)?,
        units: list(&UNITS)?,
        ..Labels::default()
    })
}

/// `true` if a dataset is the length of a dimension of netCDF and nothing else.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn is_dimension(file: &File, attributes: &[Attribute]) -> Result<bool, RecordingError> {
    let Some(name) = attributes.iter().find(|a| a.name == "NAME") else {
        return Ok(false);
    };
    let texts = name.texts(file)?.unwrap_or_default();
    let alone = "This is a netCDF dimension but not a netCDF variable";
    Ok(texts.first().is_some_and(|text| text.starts_with(alone)))
}

/// The table of channels that the Rattlesnake controller writes beside its streams.
pub(super) struct ChannelTable(HashMap<&'static str, Vec<String>>);

/// Reads the group `channels` of a file with streams `time_data`.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn channel_table(
    file: &File,
    links: &[Link],
) -> Result<Option<ChannelTable>, RecordingError> {
    let at = |links: &[Link], name: &str| links.iter().find(|link| link.0 == name).map(|l| l.1);
    let Some(group) = at(links, "time_data").and_then(|_| at(links, "channels")) else {
        return Ok(None);
    };
    let inner = links::links(file, &Object::read(file, group)?)?;
    let mut lists = HashMap::new();
    for name in ["node_number", "node_direction", "unit", "comment"] {
        let Some(at) = at(&inner, name) else { continue };
        let Some(Ok(list)) = Dataset::read(file, &Object::read(file, at)?)? else {
            continue;
        };
        if let Some(elements) = list.elements(file)?
            && let Some(texts) = attributes::texts(file, list.datatype, &elements)?
        {
            lists.insert(name, texts);
        }
    }
    Ok(lists
        .contains_key("node_number")
        .then_some(ChannelTable(lists)))
}

impl ChannelTable {
    /// Labels of a dataset: those of the table if it is a stream.
    pub(super) fn labels(&self, own: Labels, dataset: &str) -> Labels {
        let number = dataset
            .strip_prefix("time_data")
            .map(|rest| rest.strip_prefix('_').unwrap_or(rest));
        if !number.is_some_and(|number| number.chars().all(|c| c.is_ascii_digit())) {
            return own;
        }
        let list = |name: &str| self.0.get(name).map_or(&[][..], Vec::as_slice);
        let of = |name: &str, n: usize| list(name).get(n).map_or("", |text| text.trim());
        let count = list("node_number").len();
        let axis = |n: usize| {
            let text = of("node_direction", n);
            let letters = text.trim_matches(['+', '-']);
            let axis = AXES
                .iter()
                .position(|axis| letters.eq_ignore_ascii_case(axis))?;
            Some((axis, if text.contains('-') { '-' } else { '+' }))
        };
        let name = |n: usize| match (of("node_number", n), axis(n)) {
            ("", _) => of("comment", n).to_owned(),
            (node, Some((axis, sign))) => {
                format!("{node}:{sign}{}", AXES.get(axis).unwrap_or(&""))
            }
            (node, None) => format!("{node}:{}", of("node_direction", n))
                .trim_end_matches(':')
                .to_owned(),
        };
        let direction = |n: usize| {
            let (axis, sign) = axis(n)?;
            let mut direction = [0.0; 3];
            *direction.get_mut(axis)? = if sign == '-' { -1.0 } else { 1.0 };
            Some(direction)
        };
        Labels {
            names: (0..count)
                .map(|n| printable(&name(n)).into_owned())
                .collect(),
            units: (0..count)
                .map(|n| printable(of("unit", n)).into_owned())
                .collect(),
            directions: (0..count).map(direction).collect(),
            of_controller: true,
        }
    }
}

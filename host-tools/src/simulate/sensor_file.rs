//! Accelerometers and load cells of a model file, one or three channels each.

use nalgebra::Vector3;

use super::DRIVE;
use super::error::ModelError;
use super::lumped::{SprungMass, reading};
use super::model::MotionSensor;
use super::section::{Layers, Names, claim, required_name, required_vector, unit_direction};
use crate::setup::{
    AccelerometerEntry, LoadCellEntry, Mount, Quantity, Section, Uncertainty, nearest,
};

/// The channels of a sensor with their unit directions: one as named where a direction
/// is given, else three with the axis appended.
fn channels(
    section: &Section<'_>,
    taken: &mut Names,
) -> Result<Vec<(String, [f64; 3])>, ModelError> {
    let name = required_name(section)?;
    let channels = match section.vector("direction")? {
        Some(direction) => vec![(name, unit_direction(section, direction)?)],
        None => vec![
            (format!("{name}.x"), [1.0, 0.0, 0.0]),
            (format!("{name}.y"), [0.0, 1.0, 0.0]),
            (format!("{name}.z"), [0.0, 0.0, 1.0]),
        ],
    };
    if taken.is_empty() {
        taken.insert(DRIVE.to_owned(), "the drive signal".to_owned());
    }
    for (channel, _) in &channels {
        claim(taken, channel, section)?;
    }
    Ok(channels)
}

pub(super) fn accelerometers(
    layers: &Layers<'_>,
    parts: &Names,
    sprung: &[SprungMass],
    taken: &mut Names,
) -> Result<Vec<MotionSensor>, ModelError> {
    let mut sensors = Vec::new();
    for section in layers.list("accelerometer")? {
        section.only(&["name", "position", "direction", "on"])?;
        let on = section
            .text("on")?
            .unwrap_or_else(|| "structure".to_owned());
        if !parts.contains_key(&on) {
            return Err(ModelError::NoSuchPart {
                place: section.place_of("on"),
                hint: nearest(&on, parts.keys().map(String::as_str)),
                name: on,
            });
        }
        let carrier = sprung.iter().find(|mass| mass.name == on);
        let position = match (carrier, section.vector("position")?) {
            (_, Some(position)) => position,
            (Some(mass), None) => mass.position.into(),
            (None, None) => required_vector(&section, "position")?,
        };
        for (channel, direction) in channels(&section, taken)? {
            let shape = sprung
                .iter()
                .map(|mass| match carrier {
                    Some(carrier) if carrier.name == mass.name => {
                        reading(mass, &Vector3::from(direction))
                    }
                    _ => 0.0,
                })
                .collect();
            sensors.push(MotionSensor {
                entry: AccelerometerEntry {
                    channel,
                    position,
                    direction,
                    mount: match on.as_str() {
                        "interface" => Mount::Interface,
                        _ => Mount::Structure,
                    },
                    scale: 1.0,
                    uncertainty: Uncertainty::default(),
                },
                shape,
            });
        }
    }
    Ok(sensors)
}

pub(super) fn load_cells(
    layers: &Layers<'_>,
    taken: &mut Names,
) -> Result<Vec<LoadCellEntry>, ModelError> {
    let mut cells = Vec::new();
    for section in layers.list("load_cell")? {
        section.only(&["name", "position", "direction", "quantity"])?;
        let quantity = section
            .choice(
                "quantity",
                &[("force", Quantity::Force), ("moment", Quantity::Moment)],
            )?
            .unwrap_or(Quantity::Force);
        let position = required_vector(&section, "position")?;
        for (channel, direction) in channels(&section, taken)? {
            cells.push(LoadCellEntry {
                channel,
                position,
                direction,
                quantity,
                scale: 1.0,
                uncertainty: Uncertainty::default(),
            });
        }
    }
    Ok(cells)
}

//! Recordings to sensors and runs.

use super::InitError;
use super::names::{Kind, parse};
use crate::limits;
use crate::output::same_file;
use crate::printable::steers;
use crate::recording::{Channel, HEALTH_COLUMN, Recording, some_of};
use crate::setup::{Excitation, Mount, is_other};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// A sensor of one channel or of three.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Name: that of its channels without the axis.
    pub name: String,
    /// Channels, in the order of x, y and z where there are three.
    pub channels: Vec<String>,
    /// Kind, where name or unit tell it.
    pub kind: Option<Kind>,
    /// Directions of the channels, words such as `+z`; empty where not known.
    pub directions: Vec<String>,
    /// Unit that the recordings state.
    pub in_header: Option<String>,
    /// Unit that the user states.
    pub unit: Option<String>,
    /// Sensitivity that the user states.
    pub sensitivity: Option<String>,
    /// Position, where it is known.
    pub position: Option<[f64; 3]>,
    /// Place of an accelerometer, where it is known.
    pub mount: Option<Mount>,
}

/// A recording as a run.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OfRun {
    pub(super) file: PathBuf,
    pub(super) excitation: Excitation,
    pub(super) references: Vec<String>,
}

/// Sensors and runs of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Sensors, in the order of the first recording.
    pub sensors: Vec<Sensor>,
    pub(super) runs: Vec<OfRun>,
    /// Channels that no entry is written for: not in every recording, or not in the table.
    pub left_out: Vec<String>,
    /// Unit of lengths, a word of the key `length_unit`.
    pub length_unit: String,
    /// `true` if a recording tells its sample rate.
    pub has_rate: bool,
    /// Sample rate in Hz, where it is known.
    pub sample_rate: Option<f64>,
    /// Averaging band in Hz, where it is known.
    pub band: Option<[f64; 2]>,
}

impl Found {
    /// Number of channels of the sensors.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.sensors.iter().map(|s| s.channels.len()).sum()
    }

    /// Checks that a setup can hold the sensors.
    ///
    /// # Errors
    /// [`InitError::TooMany`].
    pub fn check(&self) -> Result<(), InitError> {
        let (found, limit) = (self.channels(), limits::SENSORS);
        match found > limit {
            true => Err(InitError::TooMany { found, limit }),
            false => Ok(()),
        }
    }
}

/// Looks at the headers of recordings.
///
/// # Errors
/// [`InitError`].
pub fn find(recordings: &[PathBuf]) -> Result<Found, InitError> {
    let mut runs = Vec::new();
    let mut all: Vec<Vec<Channel>> = Vec::new();
    let mut has_rate = true;
    let mut positions: HashMap<String, Option<[f64; 3]>> = HashMap::new();
    for (n, file) in recordings.iter().enumerate() {
        if recordings
            .iter()
            .take(n)
            .any(|other| same_file(other, file))
        {
            return Err(InitError::Twice { file: file.clone() });
        }
        let recording = Recording::open(file, &[])?;
        if !recording.looks_recorded() {
            return Err(InitError::NoRecording { file: file.clone() });
        }
        let (channels, run, rate) = look(file, &recording)?;
        for channel in &channels {
            let parts = ["", ".re"].map(|part| format!("{}{part}", channel.name));
            let mut stated = parts.iter().filter_map(|name| recording.position(name));
            let Some(position) = stated.next() else {
                continue;
            };
            // Files that contradict each other state nothing.
            let known = positions
                .entry(channel.name.clone())
                .or_insert(Some(position));
            *known = known.filter(|known| *known == position);
        }
        has_rate &= rate;
        all.push(channels);
        runs.push(run);
    }
    let mut left_out = Vec::new();
    let mut common: Vec<&Channel> = Vec::new();
    let mut seen = HashSet::new();
    for channel in all.iter().flatten() {
        if !seen.insert(&channel.name) {
            continue;
        }
        let everywhere = all.iter().all(|c| c.iter().any(|c| c.name == channel.name));
        match channel.unit.as_deref().filter(|unit| is_other(unit)) {
            Some(unit) => left_out.push(format!("{} [{unit}]", channel.name)),
            None if everywhere => common.push(channel),
            None => left_out.push(channel.name.clone()),
        }
    }
    if common.is_empty() {
        let first = recordings.first().map(|file| Recording::open(file, &[]));
        let names = first.transpose()?.map_or_else(Vec::new, |r| {
            r.in_file().iter().map(|c| c.name.clone()).collect()
        });
        return Err(InitError::NoSensor {
            found: some_of(names.iter()),
        });
    }
    Ok(Found {
        sensors: sensors(&common, &positions),
        runs,
        left_out,
        length_unit: "m".to_owned(),
        has_rate,
        sample_rate: None,
        band: None,
    })
}

/// Channels of sensors, the run, and `true` if the recording tells its rate.
fn look(file: &Path, recording: &Recording) -> Result<(Vec<Channel>, OfRun, bool), InitError> {
    let listed = recording.in_file();
    let has = |name: &str| listed.iter().any(|c| c.name == name);
    let excitation = if has("frequency") && listed.iter().any(|c| c.name.ends_with(".re")) {
        Excitation::Sine
    } else if has("pose") {
        Excitation::Static
    } else {
        Excitation::Random
    };
    let mut channels: Vec<Channel> = Vec::new();
    let mut references = Vec::new();
    for channel in listed {
        let mut channel = channel.clone();
        let own = ["time", "frequency", "pose", HEALTH_COLUMN];
        if own
            .iter()
            .any(|name| channel.name.eq_ignore_ascii_case(name))
            || channel.name.is_empty()
        {
            continue;
        }
        if channel.name.contains(steers) {
            return Err(InitError::Name {
                file: file.to_owned(),
                channel: channel.name,
            });
        }
        if excitation == Excitation::Sine {
            let parts = [".re", ".im"].map(|part| channel.name.strip_suffix(part));
            let Some(name) = parts.into_iter().flatten().next().map(str::to_owned) else {
                continue;
            };
            if channels.iter().any(|c| c.name == name) {
                continue;
            }
            channel.name = name;
        }
        match parse(&channel.name, channel.unit.as_deref()).is_reference {
            true => references.push(channel.name),
            false => channels.push(channel),
        }
    }
    if excitation != Excitation::Random {
        references.clear();
    }
    let has_time = listed.iter().any(|c| {
        let seconds = matches!(c.unit.as_deref(), None | Some("s"));
        seconds && c.name.eq_ignore_ascii_case("time")
    });
    let has_rate = has_time || recording.states_rate();
    let run = OfRun {
        file: file.to_owned(),
        excitation,
        references,
    };
    Ok((channels, run, has_rate || excitation != Excitation::Random))
}

/// Channels of one stem whose axes are x, y and z are one sensor.
fn sensors(channels: &[&Channel], positions: &HashMap<String, Option<[f64; 3]>>) -> Vec<Sensor> {
    let all: Vec<_> = channels
        .iter()
        .map(|c| parse(&c.name, c.unit.as_deref()))
        .collect();
    let mut taken = vec![false; all.len()];
    let mut sensors = Vec::new();
    for first in 0..all.len() {
        if taken[first] {
            continue;
        }
        let mates: Vec<usize> = (0..all.len())
            .filter(|&k| {
                all[k].stem == all[first].stem
                    && all[k].kind == all[first].kind
                    && channels[k].unit == channels[first].unit
            })
            .collect();
        let axis = |wanted: usize| {
            let mut of = mates
                .iter()
                .filter(|&&k| all[k].axis.is_some_and(|(axis, _)| axis == wanted));
            match (of.next(), of.next()) {
                (Some(only), None) => Some(*only),
                _ => None,
            }
        };
        let members = match [axis(0), axis(1), axis(2)] {
            [Some(x), Some(y), Some(z)] if mates.len() == 3 => vec![x, y, z],
            _ => vec![first],
        };
        members.iter().for_each(|&k| taken[k] = true);
        let one = &all[first];
        let directions: Option<Vec<String>> = members
            .iter()
            .map(|&k| {
                let stated = channels[k].direction.and_then(word_of);
                stated.or_else(|| {
                    let (axis, sign) = all[k].axis?;
                    Some(format!("{}{}", sign.unwrap_or('+'), ["x", "y", "z"][axis]))
                })
            })
            .collect();
        let interface = all[first].on_interface && one.kind.is_none_or(|k| k == Kind::Acceleration);
        sensors.push(Sensor {
            name: match members.len() {
                1 => channels[first].name.clone(),
                _ => one.stem.clone(),
            },
            channels: members.iter().map(|&k| channels[k].name.clone()).collect(),
            kind: one.kind.or(interface.then_some(Kind::Acceleration)),
            directions: directions.unwrap_or_default(),
            in_header: channels[first].unit.clone(),
            unit: None,
            sensitivity: None,
            position: positions.get(&channels[first].name).copied().flatten(),
            mount: interface.then_some(Mount::Interface),
        });
    }
    sensors
}

/// The word of a direction along an axis.
fn word_of(direction: [f64; 3]) -> Option<String> {
    let words = ["x", "y", "z"].into_iter().zip(direction);
    let mut along = words.filter(|(_, part)| *part != 0.0);
    let (axis, part) = along.next()?;
    let sign = if part > 0.0 { '+' } else { '-' };
    along.next().is_none().then(|| format!("{sign}{axis}"))
}

//! Facts about a recording that Parquet files and journals carry beside its samples, as a JSON
//! document of the schema `massline/recording/1`.

use super::preamble::{Preamble, Traceability, TrueRate};
use super::source::Channel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the schema.
pub(crate) const SCHEMA: &str = "massline/recording/1";

/// Facts about a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct About {
    /// [`SCHEMA`].
    pub(crate) schema: String,
    /// Rate that the converters are set to, Hz.
    pub(crate) nominal_sample_rate: Option<f64>,
    /// The true sample rate, where it was measured.
    pub(crate) sample_rate: Option<TrueRate>,
    /// The channels in their order.
    pub(crate) channels: Vec<AboutChannel>,
    /// Number of samples, and of those that have faults or never came.
    pub(crate) samples: u64,
    pub(crate) faulty_samples: u64,
    pub(crate) missing_samples: u64,
    /// Samples with each fault.
    pub(crate) by_fault: BTreeMap<String, u64>,
    /// The box that the samples come from.
    pub(crate) firmware: Option<Firmware>,
    /// The set-up, or the inputs of a box: TOML.
    pub(crate) setup: String,
}

/// Facts about a channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct AboutChannel {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) unit: Option<String>,
    /// Positive direction as a unit vector.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) direction: Option<[f64; 3]>,
    /// Calibration, where there is one.
    #[serde(flatten)]
    pub(crate) calibration: Traceability,
    /// `true` if the calibration is known, even if all its texts are empty.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) calibration_stated: bool,
    /// CRC-32 of the readings, four bytes each in little-endian order, without missing ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) crc32: Option<u32>,
}

/// The firmware that recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Firmware {
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// Source revision that it was built from.
    pub build: String,
    /// Serial number of the chip, hexadecimal.
    pub chip_serial: String,
}

impl About {
    /// Facts about a recording of these channels.
    pub(crate) fn new(channels: Vec<Channel>, preamble: &Preamble) -> Self {
        let mut about = Self {
            schema: SCHEMA.to_owned(),
            channels: channels.into_iter().map(AboutChannel::new).collect(),
            ..Self::default()
        };
        about.state(preamble);
        about
    }

    /// Facts about a recording of which only the channels' names are known.
    pub(crate) fn of_names<'n>(names: impl IntoIterator<Item = &'n str>) -> Self {
        let channel = |name: &str| Channel {
            name: name.to_owned(),
            ..Channel::default()
        };
        let channels = names.into_iter().map(channel).collect();
        Self::new(channels, &Preamble::default())
    }

    /// Takes over true rate and calibrations.
    pub(crate) fn state(&mut self, preamble: &Preamble) {
        self.sample_rate.clone_from(&preamble.sample_rate);
        for channel in &mut self.channels {
            let known = preamble.channel.get(&channel.name);
            channel.calibration_stated = known.is_some();
            channel.calibration = known.cloned().unwrap_or_default();
        }
    }

    /// True rate and calibrations.
    pub(crate) fn preamble(&self) -> Preamble {
        let known = self.channels.iter().filter(|c| c.calibration_stated);
        let known = known.map(|c| (c.name.clone(), c.calibration.clone()));
        let preamble = Preamble {
            sample_rate: self.sample_rate.clone(),
            channel: known.collect(),
        };
        preamble.printable()
    }

    /// The true rate, else the one that the converters are set to, Hz.
    pub(crate) fn rate(&self) -> Option<f64> {
        let measured = self.sample_rate.as_ref().map(|rate| rate.value);
        let rate = measured.or(self.nominal_sample_rate);
        rate.filter(|rate| rate.is_finite() && *rate > 0.0)
    }

    /// The document.
    pub(crate) fn to_json(&self) -> String {
        // Nothing in it is beyond JSON.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads a document; `None` if it is another one.
    pub(crate) fn read(text: &[u8]) -> Option<Self> {
        let about: Self = serde_json::from_slice(text).ok()?;
        (about.schema == SCHEMA).then_some(about)
    }
}

impl AboutChannel {
    fn new(channel: Channel) -> Self {
        Self {
            name: channel.name,
            unit: channel.unit,
            direction: channel.direction,
            ..Self::default()
        }
    }
}

//! Inputs to TOML, as they are stored: by what a count stands for.

use super::{InputEntry, circuit, day};
use serde::Serialize;

#[derive(Serialize)]
struct File<'a> {
    input: Vec<Entry<'a>>,
}

#[derive(Serialize)]
struct Entry<'a> {
    input: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    channel: Option<&'a str>,
    circuit: &'static str,
    #[serde(flatten)]
    calibration: Option<Calibration<'a>>,
}

#[derive(Serialize)]
struct Calibration<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    serial: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    certificate: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibrated: Option<String>,
    uncertainty: f64,
    per_count: f64,
    offset: f64,
    gain: u8,
    limits: [i32; 2],
}

pub(super) fn document(entries: &[InputEntry]) -> String {
    let input = entries.iter().map(|e| {
        let stored = e.setting();
        Entry {
            input: e.number(),
            channel: e.channel.as_deref(),
            circuit: circuit(stored.circuit),
            calibration: e.is_used().then(|| Calibration {
                serial: stored.serial,
                certificate: stored.certificate,
                calibrated: stored.calibrated.map(day),
                uncertainty: stored.uncertainty,
                per_count: stored.per_count,
                offset: stored.offset,
                gain: stored.gain,
                limits: stored.limits,
            }),
        }
    });
    let file = File {
        input: input.collect(),
    };
    // Nothing in it is beyond TOML.
    toml::to_string(&file).unwrap_or_default()
}

//! The preamble of a recording above its header: its true sample rate and the calibrations of
//! its channels.
//!
//! Lines that begin with `#`, which other programs skip. The first one is
//! `# massline recording 1`, the rest is TOML behind the `#`:
//!
//! ```text
//! # massline recording 1
//! # [sample_rate]
//! # value = 511.99871
//! # uncertainty = 0.00021
//! # clock = "host"
//! # [channel.a1]
//! # serial = "11723"
//! # certificate = "K 2026-17"
//! # calibrated = "2026-03-02"
//! # uncertainty = 0.005
//! ```

use crate::printable::printable;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{self, BufRead, Write};

/// The first line.
const TITLE: &str = "# massline recording 1";
/// Longest preamble, bytes: a thousand channels' worth. What is longer is none.
const LONGEST: usize = 256 << 10;

/// True sample rate and calibrations that a recording states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Preamble {
    /// The true sample rate, where it was measured.
    pub sample_rate: Option<TrueRate>,
    /// Calibration of each channel that has one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub channel: BTreeMap<String, Traceability>,
}

/// The sample rate as it was measured against another clock than the converters' own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueRate {
    /// Samples per second.
    pub value: f64,
    /// Standard uncertainty, Hz.
    pub uncertainty: f64,
    /// The clock it was held against: `host`, `box`.
    pub clock: String,
}

/// Calibration of a channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Traceability {
    /// Serial number of the sensor.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub serial: String,
    /// Calibration laboratory or number of the certificate.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub certificate: String,
    /// Day of the calibration, year-month-day.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<String>,
    /// Standard uncertainty of the sensitivity, relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<f64>,
}

impl Preamble {
    /// `true` if it states nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The same with texts that show as they stand.
    pub(super) fn printable(mut self) -> Self {
        let clean = |text: &mut String| *text = printable(text).into_owned();
        if let Some(rate) = &mut self.sample_rate {
            clean(&mut rate.clock);
        }
        for known in self.channel.values_mut() {
            clean(&mut known.serial);
            clean(&mut known.certificate);
            known.calibrated.iter_mut().for_each(clean);
        }
        self
    }

    /// Writes it, or nothing if it says nothing.
    ///
    /// # Errors
    /// The writer's.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        writeln!(out, "{TITLE}")?;
        let text = toml::to_string(self).map_err(io::Error::other)?;
        for line in text.lines().filter(|l| !l.is_empty()) {
            writeln!(out, "# {line}")?;
        }
        Ok(())
    }
}

/// Takes the lines that begin with `#` from the beginning of a recording. Gives them, and what
/// they say: nothing if they are somebody else's remarks, or why they cannot be read.
pub(super) fn take(
    from: &mut dyn BufRead,
) -> io::Result<(Vec<u8>, Result<Preamble, toml::de::Error>)> {
    let mut bytes = Vec::new();
    while from.fill_buf()?.first() == Some(&b'#') && bytes.len() < LONGEST {
        let mut line = io::Read::take(&mut *from, (LONGEST - bytes.len()) as u64);
        line.read_until(b'\n', &mut bytes)?;
    }
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = text.lines().map(str::trim_end);
    if lines.next() != Some(TITLE) {
        return Ok((bytes, Ok(Preamble::default())));
    }
    let body: Vec<&str> = lines.map(|line| line.trim_start_matches('#')).collect();
    let preamble = toml::from_str(&body.join("\n")).map(Preamble::printable);
    Ok((bytes, preamble))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> Preamble {
        let calibrated = Traceability {
            serial: "11723 # \"new\"".to_owned(),
            certificate: "K 2026-17".to_owned(),
            calibrated: Some("2026-03-02".to_owned()),
            uncertainty: Some(0.005),
        };
        Preamble {
            sample_rate: Some(TrueRate {
                value: 511.998_71,
                uncertainty: 2.1e-4,
                clock: "host".to_owned(),
            }),
            channel: [
                ("a 1, left".to_owned(), calibrated),
                ("fx".to_owned(), Traceability::default()),
            ]
            .into(),
        }
    }

    #[test]
    fn what_is_written_is_read_and_nothing_behind_it() {
        let mut bytes = Vec::new();
        full().write(&mut bytes).unwrap();
        let length = bytes.len();
        bytes.extend_from_slice(b"a1,fx\n1,2\n");
        let mut rest = &bytes[..];
        let (taken, preamble) = take(&mut rest).unwrap();
        assert_eq!(preamble.unwrap(), full());
        assert_eq!(taken.len(), length);
        assert_eq!(rest, b"a1,fx\n1,2\n");
    }

    #[test]
    fn an_empty_one_writes_nothing() {
        let mut bytes = Vec::new();
        Preamble::default().write(&mut bytes).unwrap();
        assert!(bytes.is_empty());
    }

    #[test]
    fn remarks_of_others_say_nothing() {
        let mut text = &b"# made by LabThing 3\n# [channel\na,b\n1,2\n"[..];
        let (_, preamble) = take(&mut text).unwrap();
        assert_eq!(preamble.unwrap(), Preamble::default());
        assert_eq!(text, b"a,b\n1,2\n");
    }

    #[test]
    fn one_that_is_broken_is_told() {
        let mut text = &b"# massline recording 1\n# [channel\na,b\n"[..];
        assert!(take(&mut text).unwrap().1.is_err());
    }
}

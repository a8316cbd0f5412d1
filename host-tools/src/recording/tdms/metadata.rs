//! The metadata of a TDMS segment: objects, the layout of their raw data, properties.

use crate::printable::printable;
use crate::recording::bytes::Part;
use crate::recording::number::Kind;
use std::io::{self, Read};

/// Most bytes of a path, a name or a text that is kept; longer texts are skipped.
const TEXT: u32 = 64 << 10;

/// A channel.
#[derive(Debug, Default)]
pub(super) struct Object {
    pub(super) group: String,
    pub(super) channel: String,
    pub(super) unit: Option<String>,
    /// Time from one sample to the next, s.
    pub(super) step: Option<f64>,
    /// `true` if its numbers are counts whose scale stands in the properties.
    pub(super) unscaled: bool,
    scales: f64,
    status: Option<String>,
}

impl Object {
    pub(super) fn new([group, channel]: [String; 2]) -> Self {
        Self {
            group,
            channel,
            ..Self::default()
        }
    }

    pub(super) fn settle(&mut self) {
        self.unscaled = self.scales > 0.0 && self.status.as_deref() == Some("unscaled");
    }
}

/// Raw data of an object in a segment.
#[derive(Debug)]
pub(super) enum Raw {
    None,
    /// As in the segment before.
    Same,
    Numbers {
        kind: u32,
        count: u64,
    },
    /// Text: bytes of a chunk.
    Text {
        bytes: u64,
    },
    Daqmx,
}

/// An error: the reader's, or what was found and what was expected.
#[derive(Debug)]
pub(super) enum Wrong {
    Io(io::Error),
    Other(String, &'static str),
}

impl From<io::Error> for Wrong {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// A reader of metadata.
pub(super) struct Metadata {
    pub(super) part: Part,
    pub(super) big: bool,
}

impl Metadata {
    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.part.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    pub(super) fn u32(&mut self) -> io::Result<u32> {
        let bytes = self.bytes()?;
        Ok(if self.big {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    pub(super) fn u64(&mut self) -> io::Result<u64> {
        let bytes = self.bytes()?;
        Ok(if self.big {
            u64::from_be_bytes(bytes)
        } else {
            u64::from_le_bytes(bytes)
        })
    }

    fn skip(&mut self, count: u64) -> io::Result<()> {
        if self.part.end - self.part.at.min(self.part.end) < count {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.part.at += count;
        Ok(())
    }

    fn text(&mut self) -> Result<String, Wrong> {
        let length = self.u32()?;
        if length > TEXT {
            let found = format!("a name of {length} bytes");
            return Err(Wrong::Other(found, "at most 65536"));
        }
        let mut bytes = vec![0; length as usize];
        self.part.read_exact(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Path of an object and the index of its raw data.
    pub(super) fn object(&mut self) -> Result<(String, Raw), Wrong> {
        let path = self.text()?;
        let length = self.u32()?;
        let raw = match length {
            u32::MAX => Raw::None,
            0 => Raw::Same,
            0x0000_1269 | 0x0000_1369 | 0x6912_0000 | 0x6913_0000 => Raw::Daqmx,
            _ => {
                let (kind, dimensions, count) = (self.u32()?, self.u32()?, self.u64()?);
                if dimensions != 1 {
                    let found = format!("data of {dimensions} dimensions");
                    return Err(Wrong::Other(found, "one"));
                }
                match kind {
                    0x20 => Raw::Text { bytes: self.u64()? },
                    kind => Raw::Numbers { kind, count },
                }
            }
        };
        Ok((path, raw))
    }

    /// Reads the properties of an object, which may be none of a channel.
    pub(super) fn properties(&mut self, mut object: Option<&mut Object>) -> Result<(), Wrong> {
        let count = self.u32()?;
        for _ in 0..count {
            let name = self.text()?;
            let kind = self.u32()?;
            if kind == 0x20 {
                let length = self.u32()?;
                if length > TEXT {
                    self.skip(u64::from(length))?;
                    continue;
                }
                let mut bytes = vec![0; length as usize];
                self.part.read_exact(&mut bytes)?;
                let text = String::from_utf8_lossy(&bytes);
                match (name.as_str(), object.as_deref_mut()) {
                    ("unit_string", Some(object)) => {
                        let unit = printable(text.trim()).into_owned();
                        object.unit = Some(unit).filter(|unit| !unit.is_empty());
                    }
                    ("NI_Scaling_Status", Some(object)) => object.status = Some(text.into_owned()),
                    _ => {}
                }
                continue;
            }
            let Some(size) = size(kind) else {
                let found = format!("a property of type {kind:#x}");
                return Err(Wrong::Other(found, "a type of TDMS"));
            };
            let at = self.part.at;
            if let Some(object) = object.as_deref_mut() {
                match (name.as_str(), kind) {
                    ("wf_increment", 10) => {
                        let step = f64::from_bits(self.u64()?);
                        let sound = step.is_finite() && step > 0.0;
                        object.step = sound.then_some(step);
                    }
                    ("NI_Number_Of_Scales", 3 | 7) => object.scales = f64::from(self.u32()?),
                    _ => {}
                }
            }
            self.part.at = at;
            self.skip(size)?;
        }
        Ok(())
    }
}

/// Bytes of a value of a type.
fn size(kind: u32) -> Option<u64> {
    Some(match kind {
        0 => 0,
        1 | 5 | 0x21 => 1,
        2 | 6 => 2,
        3 | 7 | 9 | 0x19 => 4,
        4 | 8 | 10 | 0x1a | 0x08_000c => 8,
        11 | 0x1b | 0x44 | 0x10_000d => 16,
        _ => return None,
    })
}

/// Kind of number of a type; or the bytes of a value that is no number that is read.
pub(super) fn kind(kind: u32) -> Result<Kind, Option<u64>> {
    Ok(match kind {
        1 => Kind::I8,
        2 => Kind::I16,
        3 => Kind::I32,
        4 => Kind::I64,
        5 => Kind::U8,
        6 => Kind::U16,
        7 => Kind::U32,
        8 => Kind::U64,
        9 | 0x19 => Kind::F32,
        10 | 0x1a => Kind::F64,
        other => return Err(size(other).filter(|size| *size > 0)),
    })
}

/// Group and channel of a path such as `/'rig'/'a1'`, in which a quote is doubled; `None` for
/// the file and for a group.
pub(super) fn parts(path: &str) -> Option<[String; 2]> {
    let inner = path.strip_prefix("/'")?.strip_suffix('\'')?;
    let mut parts = Vec::new();
    let mut part = String::new();
    let mut rest = inner;
    while let Some(c) = rest.chars().next() {
        if let Some(next) = rest.strip_prefix("'/'") {
            parts.push(std::mem::take(&mut part));
            rest = next;
        } else if let Some(next) = rest.strip_prefix("''") {
            part.push('\'');
            rest = next;
        } else {
            part.push(c);
            rest = rest.get(c.len_utf8()..)?;
        }
    }
    parts.push(part);
    parts.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_have_a_group_and_a_channel() {
        let of = |path| parts(path).map(|p| p.join("|"));
        assert_eq!(of("/'rig'/'a1'").as_deref(), Some("rig|a1"));
        assert_eq!(of("/'it''s'/'a''/''b'").as_deref(), Some("it's|a'/'b"));
        assert_eq!(of("/'rig'"), None);
        assert_eq!(of("/"), None);
        assert_eq!(of(""), None);
    }
}

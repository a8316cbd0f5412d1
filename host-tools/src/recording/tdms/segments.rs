//! The segments of a TDMS file, and the values of a channel across them.

use super::metadata::{self, Metadata, Object, Raw, Wrong};
use crate::limits;
use crate::recording::bytes::{Bytes, Part};
use crate::recording::columns::Series;
use crate::recording::number::Coding;
use crate::recording::{Place, RecordingError};
use std::collections::HashMap;
use std::io::Read;
use std::rc::Rc;

/// Bytes of the lead of a segment.
const LEAD: u64 = 28;
/// Most segments: as many as a recorder writes in a year at one in thirty seconds, in 32 MB.
const SEGMENTS: usize = 1 << 20;

const METADATA: u32 = 1 << 1;
const NEW_LIST: u32 = 1 << 2;
const RAW: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG: u32 = 1 << 6;
const DAQMX: u32 = 1 << 7;

/// Values of a channel in a chunk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) object: usize,
    pub(super) count: u64,
    coding: Coding,
    /// First byte within the chunk, and bytes from one value to the next.
    first: u64,
    stride: u64,
}

/// Places of the values in a chunk.
#[derive(Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) values: Vec<Run>,
    chunk: u64,
}

/// A segment with raw data.
#[derive(Debug)]
pub(super) struct Segment {
    pub(super) layout: Rc<Layout>,
    pub(super) chunks: u64,
    at: u64,
}

pub(super) struct Found {
    pub(super) objects: Vec<Object>,
    pub(super) segments: Vec<Segment>,
    pub(super) notes: Vec<String>,
}

/// Raw data of the objects that are active, in their order: object and index.
type Active = Vec<(usize, Option<(u32, u64)>)>;

struct Reader<'a> {
    bytes: &'a Rc<Bytes>,
    paths: HashMap<String, usize>,
    found: Found,
    active: Active,
    /// Position of each active object.
    positions: HashMap<usize, usize>,
    /// Index of each object as it was stated last.
    last: HashMap<usize, (u32, u64)>,
    layout: Option<Rc<Layout>>,
    /// Segments with raw data so far.
    count: usize,
    /// Segments that end in no whole chunk.
    cut: Cut,
}

/// Bytes behind the last whole chunk of segments: how many segments have some, their sum, and the place of the first.
#[derive(Default)]
struct Cut {
    segments: usize,
    bytes: u64,
    first: u64,
}

pub(super) fn read(bytes: &Rc<Bytes>) -> Result<Found, RecordingError> {
    let mut reader = Reader {
        bytes,
        paths: HashMap::new(),
        found: Found {
            objects: Vec::new(),
            segments: Vec::new(),
            notes: Vec::new(),
        },
        active: Vec::new(),
        positions: HashMap::new(),
        last: HashMap::new(),
        layout: None,
        count: 0,
        cut: Cut::default(),
    };
    let mut at = 0;
    while at < bytes.len {
        at = reader.segment(at)?;
    }
    reader.tell_cut();
    reader.found.objects.iter_mut().for_each(Object::settle);
    Ok(reader.found)
}

impl Reader<'_> {
    /// Reads a segment; the place of the next one.
    fn segment(&mut self, at: u64) -> Result<u64, RecordingError> {
        let bytes = self.bytes;
        let place = Place::Byte(at);
        if bytes.len - at < LEAD {
            // A recorder was stopped while it wrote the lead.
            let rest = bytes.len - at;
            self.note(format!(
                "the last {rest} bytes begin a segment that is not there"
            ));
            return Ok(bytes.len);
        }
        let mut lead = Metadata {
            part: bytes.part(at, at + LEAD),
            big: false,
        };
        let io = |e| bytes.damaged(at, &e);
        let tag = lead.u32().map_err(io)?;
        if tag != u32::from_le_bytes(*b"TDSm") {
            return Err(bytes.malformed(
                place,
                "",
                "something else",
                "TDSm, which begins a segment",
            ));
        }
        let contents = lead.u32().map_err(io)?;
        lead.big = contents & BIG != 0;
        lead.u32().map_err(io)?;
        let (next, raw) = (lead.u64().map_err(io)?, lead.u64().map_err(io)?);
        let begin = at + LEAD;
        // A recorder that was stopped has not come to state the length.
        let end = match next {
            u64::MAX => Some(bytes.len),
            next => begin.checked_add(next).filter(|end| *end <= bytes.len),
        };
        let data = begin.checked_add(raw);
        let (Some(end), Some(data)) = (end, data.filter(|data| *data <= bytes.len)) else {
            let found = format!("{} bytes up to the end of the file", bytes.len - begin);
            let expected = format!("{} of a segment that has its metadata in {raw}", next);
            return Err(bytes.malformed(place, "", found, expected));
        };
        if data > end {
            let found = format!("metadata of {raw} bytes in a segment of {next}");
            return Err(bytes.malformed(place, "", found, "fewer"));
        }
        if contents & METADATA != 0 {
            self.metadata(begin, data, contents)
                .map_err(|wrong| match wrong {
                    Wrong::Io(e) => bytes.damaged(begin, &e),
                    Wrong::Other(found, expected) => {
                        bytes.malformed(Place::Byte(begin), "", found, expected)
                    }
                })?;
            self.layout = None;
        }
        if contents & RAW != 0 && end > data {
            if contents & DAQMX != 0 {
                return Err(self.daqmx());
            }
            self.raw(data, end, contents)?;
        }
        Ok(end)
    }

    /// Notes the bytes that are left out, once for all segments.
    fn tell_cut(&mut self) {
        let Cut {
            segments,
            bytes,
            first,
        } = self.cut;
        match segments {
            0 => {}
            1 => self.note(format!(
                "{bytes} bytes from byte {first} on are left out: they are no whole chunk of all channels"
            )),
            _ => self.note(format!(
                "{bytes} bytes at the ends of {segments} segments, the first from byte {first} on, are left out: they are no whole chunks of all channels"
            )),
        }
    }

    fn note(&mut self, note: String) {
        self.found.notes.push(note);
    }

    fn daqmx(&self) -> RecordingError {
        RecordingError::OtherKind {
            file: self.bytes.file.clone(),
            kind: "a TDMS file with raw data of DAQmx".to_owned(),
            advice: "their scaling is not read: save it with scaled data in DIAdem or LabVIEW, or export it as CSV",
        }
    }

    fn metadata(&mut self, begin: u64, end: u64, contents: u32) -> Result<(), Wrong> {
        let mut metadata = Metadata {
            part: self.bytes.part(begin, end),
            big: contents & BIG != 0,
        };
        if contents & NEW_LIST != 0 {
            self.active.clear();
            self.positions.clear();
        }
        let count = metadata.u32()?;
        for _ in 0..count {
            let (path, raw) = metadata.object()?;
            let known = self.paths.get(&path).copied();
            let number = match (known, metadata::parts(&path)) {
                (Some(number), _) => Some(number),
                (None, Some(parts)) => {
                    let number = self.found.objects.len();
                    if number >= limits::COLUMNS {
                        return Err(Wrong::Other("more channels".to_owned(), "at most 131072"));
                    }
                    self.found.objects.push(Object::new(parts));
                    self.paths.insert(path, number);
                    Some(number)
                }
                (None, None) => None,
            };
            if let Raw::Daqmx = raw {
                return Err(Wrong::Other(
                    "raw data of DAQmx".to_owned(),
                    "scaled data, as DIAdem and LabVIEW save them",
                ));
            }
            if let Some(number) = number {
                let index = match raw {
                    Raw::None | Raw::Daqmx => None,
                    Raw::Same => self.last.get(&number).copied(),
                    Raw::Numbers { kind, count } => Some((kind, count)),
                    Raw::Text { bytes } => Some((0x20, bytes)),
                };
                if let Some(index) = index {
                    self.last.insert(number, index);
                }
                let position = *self.positions.entry(number).or_insert(self.active.len());
                match self.active.get_mut(position) {
                    Some((_, own)) => *own = index,
                    None => self.active.push((number, index)),
                }
            }
            metadata.properties(number.and_then(|n| self.found.objects.get_mut(n)))?;
        }
        Ok(())
    }

    /// The places of the values in a chunk of the active objects.
    fn layout(&self, contents: u32, place: Place) -> Result<Layout, RecordingError> {
        let interleaved = contents & INTERLEAVED != 0;
        let mut values = Vec::new();
        let (mut chunk, mut row) = (0_u64, 0_u64);
        let mut counts = Vec::new();
        for (object, index) in &self.active {
            let Some((kind, count)) = *index else {
                continue;
            };
            let name = self
                .found
                .objects
                .get(*object)
                .map_or("", |o| o.channel.as_str());
            let (size, coding) = match (kind, metadata::kind(kind)) {
                (0x20, _) => (1, None),
                (_, Ok(kind)) => {
                    let big = contents & BIG != 0;
                    (kind.size() as u64, Some(Coding { kind, big }))
                }
                (_, Err(Some(size))) => (size, None),
                (_, Err(None)) => {
                    let found = format!("values of type {kind:#x}");
                    return Err(self.bytes.malformed(place, name, found, "a type of TDMS"));
                }
            };
            let first = if interleaved { row } else { chunk };
            let length = count.checked_mul(size).and_then(|n| chunk.checked_add(n));
            let Some(length) = length else {
                let found = format!("{count} values in a chunk");
                return Err(self.bytes.malformed(place, name, found, "fewer"));
            };
            chunk = length;
            row += size;
            counts.push(count);
            if let Some(coding) = coding.filter(|_| count > 0) {
                values.push(Run {
                    object: *object,
                    count,
                    coding,
                    first,
                    stride: size,
                });
            }
        }
        if interleaved {
            if counts.windows(2).any(|pair| pair[0] != pair[1]) {
                let found = "interleaved channels of different lengths";
                return Err(self.bytes.malformed(place, "", found, "equal ones"));
            }
            // A row of values is a chunk, so that one that breaks off loses nothing before it.
            values.iter_mut().for_each(|run| run.count = 1);
            chunk = row;
        }
        Ok(Layout { values, chunk })
    }

    fn raw(&mut self, data: u64, end: u64, contents: u32) -> Result<(), RecordingError> {
        let place = Place::Byte(data);
        let same = self.layout.take();
        let layout = match same {
            Some(layout) => layout,
            None => {
                let layout = self.layout(contents, place)?;
                // Most segments repeat the one before.
                let last = self.found.segments.last();
                let last = last.filter(|last| *last.layout == layout);
                last.map_or_else(|| Rc::new(layout), |last| Rc::clone(&last.layout))
            }
        };
        if layout.chunk == 0 {
            let found = format!("{} bytes of raw data of no channel", end - data);
            return Err(self
                .bytes
                .malformed(place, "", found, "metadata that say whose they are"));
        }
        let chunks = (end - data) / layout.chunk;
        let rest = (end - data) % layout.chunk;
        if rest > 0 {
            if self.cut.segments == 0 {
                self.cut.first = end - rest;
            }
            self.cut.segments += 1;
            self.cut.bytes += rest;
        }
        self.count += 1;
        if self.count > SEGMENTS {
            return Err(self
                .bytes
                .malformed(place, "", "more segments", "at most 1048576"));
        }
        if chunks > 0 {
            self.found.segments.push(Segment {
                layout: Rc::clone(&layout),
                chunks,
                at: data,
            });
        }
        self.layout = Some(layout);
        Ok(())
    }
}

/// The stretches of even distance in which the values of a channel lie.
pub(super) struct Stretches {
    segments: Rc<Vec<Segment>>,
    object: usize,
    segment: usize,
    chunk: u64,
}

/// Values at even distances.
struct Stretch {
    at: u64,
    end: u64,
    count: u64,
    stride: u64,
    coding: Coding,
}

impl Stretches {
    pub(super) fn new(segments: Rc<Vec<Segment>>, object: usize) -> Self {
        Self {
            segments,
            object,
            segment: 0,
            chunk: 0,
        }
    }

    fn next(&mut self) -> Option<Stretch> {
        loop {
            let segment = self.segments.get(self.segment)?;
            let mut runs = segment.layout.values.iter();
            let run = runs.find(|run| run.object == self.object);
            let Some(run) = run.filter(|_| self.chunk < segment.chunks) else {
                self.segment += 1;
                self.chunk = 0;
                continue;
            };
            let length = segment.layout.chunk;
            let at = segment.at + self.chunk * length + run.first;
            let end = segment.at + segment.chunks * length;
            // Chunks of one value each are a stretch together.
            let (count, stride) = match run.count {
                1 => (segment.chunks, length),
                count => (count, run.stride),
            };
            self.chunk = if run.count == 1 {
                segment.chunks
            } else {
                self.chunk + 1
            };
            return Some(Stretch {
                at,
                end,
                count,
                stride,
                coding: run.coding,
            });
        }
    }
}

/// The values of a channel.
pub(super) struct Values {
    bytes: Rc<Bytes>,
    stretches: Stretches,
    stretch: Option<(Part, Stretch)>,
    channel: String,
}

impl Values {
    pub(super) fn new(bytes: &Rc<Bytes>, stretches: Stretches, channel: &str) -> Self {
        Self {
            bytes: Rc::clone(bytes),
            stretches,
            stretch: None,
            channel: channel.to_owned(),
        }
    }
}

impl Series for Values {
    fn next(&mut self) -> Result<f64, RecordingError> {
        loop {
            if let Some((part, stretch)) = &mut self.stretch
                && stretch.count > 0
            {
                let mut raw = [0; 8];
                let raw = raw.get_mut(..stretch.coding.kind.size()).unwrap_or(&mut []);
                let at = part.at;
                part.read_exact(raw)
                    .map_err(|e| self.bytes.damaged(at, &e))?;
                part.at = at + stretch.stride;
                stretch.count -= 1;
                return Ok(stretch.coding.value(raw));
            }
            let Some(next) = self.stretches.next() else {
                let place = Place::Byte(self.bytes.len);
                return Err(self.bytes.malformed(
                    place,
                    &self.channel,
                    "the file ends",
                    "more samples",
                ));
            };
            self.stretch = Some((self.bytes.part(next.at, next.end), next));
        }
    }
}

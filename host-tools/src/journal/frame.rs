//! The frames of a journal.
//!
//! ```text
//! mark (4) | kind (4) | number of the first row (8) | length (4) | content | CRC-32 (4)
//! ```
//!
//! Numbers are little-endian; the checksum is that of everything between mark and checksum. A frame of
//! rows has the number of readings of a row (2), then for each row its faults (2) and its readings in
//! single precision (4 each).

use massline_firmware::wire::Health;

/// First bytes of each frame, which no text contains.
pub(super) const MARK: [u8; 4] = [0xf7, b'M', b'L', b'J'];
/// Bytes before the content.
pub(super) const BEFORE: usize = 20;
/// Bytes behind the content.
pub(super) const BEHIND: usize = 4;
/// Most bytes of a content.
pub(super) const LONGEST: usize = 4 << 20;

/// Content of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Facts about the recording, JSON.
    Head,
    /// The true sample rate so far, JSON.
    Rate,
    /// Rows.
    Rows,
}

const KINDS: [(u32, Kind); 3] = [(1, Kind::Head), (2, Kind::Rate), (3, Kind::Rows)];

/// A frame that was read.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    pub(super) kind: Kind,
    /// Number of the first row, from zero.
    pub(super) first: u64,
    pub(super) content: &'a [u8],
}

/// Outcome of looking for a frame at the beginning of some bytes.
pub(super) enum Found<'a> {
    /// There is one.
    Frame(Frame<'a>),
    /// More bytes are needed: so many in all.
    More(usize),
    /// There is none.
    Nothing,
}

/// Adds a frame to some bytes.
pub(super) fn write(kind: Kind, first: u64, content: &[u8], out: &mut Vec<u8>) {
    let number = KINDS.iter().find(|(_, own)| *own == kind);
    let begin = out.len() + MARK.len();
    out.extend_from_slice(&MARK);
    out.extend_from_slice(&number.map_or(0, |(number, _)| *number).to_le_bytes());
    out.extend_from_slice(&first.to_le_bytes());
    out.extend_from_slice(&(content.len() as u32).to_le_bytes());
    out.extend_from_slice(content);
    let sum = sum_of(out.get(begin..).unwrap_or_default());
    out.extend_from_slice(&sum.to_le_bytes());
}

/// Looks for a frame at the beginning of some bytes.
pub(super) fn find(bytes: &[u8]) -> Found<'_> {
    let known = bytes.len().min(MARK.len());
    if bytes.get(..known) != MARK.get(..known) {
        return Found::Nothing;
    }
    let Some((before, rest)) = bytes.split_first_chunk::<BEFORE>() else {
        return Found::More(BEFORE);
    };
    let number = |at: usize| {
        u32::from_le_bytes([before[at], before[at + 1], before[at + 2], before[at + 3]])
    };
    let length = number(16) as usize;
    let kind = KINDS.iter().find(|(own, _)| *own == number(4));
    let Some((_, kind)) = kind.filter(|_| length <= LONGEST) else {
        return Found::Nothing;
    };
    let Some((content, sum)) = rest.split_at_checked(length) else {
        return Found::More(BEFORE + length + BEHIND);
    };
    let Some(sum) = sum.first_chunk() else {
        return Found::More(BEFORE + length + BEHIND);
    };
    let summed = bytes.get(MARK.len()..BEFORE + length).unwrap_or_default();
    if sum_of(summed) != u32::from_le_bytes(*sum) {
        return Found::Nothing;
    }
    Found::Frame(Frame {
        kind: *kind,
        first: u64::from(number(8)) | u64::from(number(12)) << 32,
        content,
    })
}

/// Adds a row to the content of a frame of rows.
pub(super) fn add_row(si: &[f32], health: Health, content: &mut Vec<u8>) {
    if content.is_empty() {
        content.extend_from_slice(&(si.len() as u16).to_le_bytes());
    }
    content.extend_from_slice(&health.0.to_le_bytes());
    for x in si {
        content.extend_from_slice(&x.to_le_bytes());
    }
}

/// The rows of a frame, each with its bytes of readings, and how many readings each has; `None` if the
/// content is no whole number of rows.
pub(super) fn rows(content: &[u8]) -> Option<(usize, impl Iterator<Item = (Health, &[u8])>)> {
    let (width, rest) = content.split_first_chunk()?;
    let width = usize::from(u16::from_le_bytes(*width));
    let size = 2 + 4 * width;
    let whole = rest.len().is_multiple_of(size);
    let rows = rest.chunks_exact(size).filter_map(|row| {
        let (health, readings) = row.split_first_chunk()?;
        Some((Health(u16::from_le_bytes(*health)), readings))
    });
    whole.then_some((width, rows))
}

fn sum_of(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}

//! Headers of objects: groups and datasets as lists of messages.

use super::file::{Cursor, File};
use crate::recording::RecordingError;

/// Kinds of messages.
pub(super) const SPACE: u16 = 0x01;
pub(super) const LINK_INFO: u16 = 0x02;
pub(super) const TYPE: u16 = 0x03;
pub(super) const FILL: u16 = 0x05;
pub(super) const LINK: u16 = 0x06;
pub(super) const LAYOUT: u16 = 0x08;
pub(super) const FILTERS: u16 = 0x0b;
pub(super) const ATTRIBUTE: u16 = 0x0c;
pub(super) const ATTRIBUTE_INFO: u16 = 0x15;
pub(super) const SYMBOLS: u16 = 0x11;
const CONTINUATION: u16 = 0x10;
/// Most blocks that the messages of an object lie in.
const BLOCKS: usize = 4096;

/// A message of an object.
pub(super) struct Message {
    pub(super) kind: u16,
    /// `true` if its body says where the message is.
    pub(super) shared: bool,
    pub(super) body: Vec<u8>,
}

/// An object.
pub(super) struct Object {
    pub(super) at: u64,
    pub(super) messages: Vec<Message>,
}

impl Object {
    /// Reads the header at an address.
    ///
    /// # Errors
    /// [`RecordingError`] of the structure.
    pub(super) fn read(file: &File, at: u64) -> Result<Self, RecordingError> {
        let new = file.read(at, 4)? == b"OHDR";
        let broken = || file.wrong(at, "other bytes", "a whole header of an object");
        // Bytes before a message's body, and of the checksum behind a block.
        let (mut blocks, track, tail) = if new {
            let head = file.read(at, 6)?;
            let flags = head.last().copied().unwrap_or(0);
            let times = if flags & 0x20 != 0 { 16 } else { 0 };
            let phase = if flags & 0x10 != 0 { 4 } else { 0 };
            let width = 1 << (flags & 3);
            let lead = 6 + times + phase;
            let size = Cursor(&file.read(at + lead, width)?).uint(width as usize);
            let size = size.ok_or_else(broken)?;
            (vec![(at + lead + width, size)], flags & 4 != 0, 4)
        } else {
            let head = file.read(at, 12)?;
            let mut cursor = Cursor(&head);
            let version = cursor.byte();
            cursor.take(7).ok_or_else(broken)?;
            let size = cursor.uint(4).filter(|_| version == Some(1));
            (vec![(at + 16, size.ok_or_else(broken)?)], false, 0)
        };
        let mut messages = Vec::new();
        let mut next = 0;
        while let Some(&(begin, size)) = blocks.get(next) {
            next += 1;
            let bytes = file.read(begin, size)?;
            let mut cursor = Cursor(&bytes);
            if new && next > 1 {
                let inner = size.checked_sub(tail + 4).ok_or_else(broken)?;
                let head = cursor.take(4);
                cursor = Cursor(cursor.take(inner as usize).ok_or_else(broken)?);
                if head != Some(b"OCHK") {
                    return Err(broken());
                }
            }
            while let Some(message) = message(&mut cursor, new, track) {
                if message.kind == CONTINUATION {
                    let mut place = Cursor(&message.body);
                    let place = place.uint(file.address).zip(place.uint(file.length));
                    blocks.push(place.ok_or_else(broken)?);
                    if blocks.len() > BLOCKS {
                        return Err(broken());
                    }
                } else if message.kind != 0 {
                    messages.push(message);
                }
            }
        }
        Ok(Self { at, messages })
    }

    /// The body of the first message of a kind, unless it is elsewhere.
    pub(super) fn message(&self, kind: u16) -> Option<Cursor<'_>> {
        let message = self.messages.iter().find(|message| message.kind == kind)?;
        (!message.shared).then_some(Cursor(&message.body))
    }
}

fn message(cursor: &mut Cursor<'_>, new: bool, track: bool) -> Option<Message> {
    let kind = cursor.uint(if new { 1 } else { 2 })? as u16;
    let size = cursor.uint(2)? as usize;
    let flags = cursor.byte()?;
    let lead = if new { 2 * usize::from(track) } else { 3 };
    cursor.take(lead)?;
    Some(Message {
        kind,
        shared: flags & 2 != 0,
        body: cursor.take(size)?.to_vec(),
    })
}

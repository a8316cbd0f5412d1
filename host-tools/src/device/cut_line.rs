//! A line that is cut at a given frame or byte, so that every place can be tried in turn.

use super::{Port, PortError};
use std::time::Duration;

/// Kind of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The port is gone from there on, as one that was unplugged.
    Gone,
    /// Nothing arrives on either side from there on, and the port seems to work.
    Silent,
    /// That one frame is lost, or that one byte.
    Once,
}

/// Place of a cut, counted over both directions together and from zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The frame of this number.
    Frame(u64),
    /// The byte of this number.
    Byte(u64),
}

/// Pause where nothing can come any more, so that who waits does not do so at full speed.
const PAUSE: Duration = Duration::from_millis(5);

/// A port behind a line that is cut.
pub struct CutLine<P> {
    port: P,
    cut: Cut,
    place: Place,
    frames: u64,
    bytes: u64,
    /// `true` if the bytes that come from the box belong to a frame.
    within: bool,
}

impl<P: Port> CutLine<P> {
    /// A line before `port` that is cut at a place; one beyond all that is said cuts nothing.
    pub const fn new(port: P, cut: Cut, place: Place) -> Self {
        Self {
            port,
            cut,
            place,
            frames: 0,
            bytes: 0,
            within: false,
        }
    }

    /// Frames and bytes that came to the line so far.
    #[must_use]
    pub const fn passed(&self) -> [u64; 2] {
        [self.frames, self.bytes]
    }

    /// Takes note of a byte, the first one of its frame or another. Whether it goes on.
    fn passes(&mut self, first: bool) -> bool {
        self.frames += u64::from(first);
        self.bytes += 1;
        // Numbers of this frame and of this byte.
        let (here, place) = match self.place {
            Place::Frame(place) => (self.frames.saturating_sub(1), place),
            Place::Byte(place) => (self.bytes - 1, place),
        };
        here < place || (self.cut == Cut::Once && here > place)
    }

    /// `true` if it is cut for good, by what has passed.
    fn is_cut(&self) -> bool {
        let beyond = match self.place {
            Place::Frame(place) => self.frames > place,
            Place::Byte(place) => self.bytes > place,
        };
        beyond && self.cut != Cut::Once
    }

    fn gone(&self) -> Result<(), PortError> {
        if self.cut == Cut::Gone && self.is_cut() {
            return Err(PortError::Gone {
                name: self.port.name(),
                reason: "the line was cut".to_owned(),
            });
        }
        Ok(())
    }
}

impl<P: Port> Port for CutLine<P> {
    fn name(&self) -> String {
        self.port.name()
    }

    /// One frame at a time.
    fn send(&mut self, frame: &[u8]) -> Result<(), PortError> {
        let mut out = Vec::with_capacity(frame.len());
        for (k, &byte) in frame.iter().enumerate() {
            if self.passes(k == 0) {
                out.push(byte);
            }
        }
        self.port.send(&out)?;
        self.gone()
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        let before = into.len();
        let mut bytes = Vec::new();
        while into.len() == before {
            self.gone()?;
            if self.is_cut() {
                std::thread::sleep(PAUSE.min(timeout));
                return Ok(0);
            }
            bytes.clear();
            if self.port.receive(&mut bytes, timeout)? == 0 {
                return Ok(0);
            }
            for &byte in &bytes {
                let first = byte != 0 && !self.within;
                self.within = byte != 0;
                if self.passes(first) {
                    into.push(byte);
                }
            }
        }
        Ok(into.len() - before)
    }

    super::port::ask_within!(self, self.port);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{Client, ClientMemory, HostBox, HostBoxMemory};

    fn passed(cut: Cut, place: Place) -> ([u64; 2], Result<u64, String>) {
        let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
        let line = CutLine::new(HostBox::new(&mut own, 1), cut, place);
        let mut client = Client::new(line, &mut memory);
        let pong = client.ping(7).map_err(|e| e.to_string());
        (client.port().passed(), pong.map(|pong| pong.stamp))
    }

    #[test]
    fn the_cut_is_where_it_was_ordered() {
        // The time in a reply takes fewer bytes the sooner it comes.
        let uncut = || passed(Cut::Gone, Place::Frame(u64::MAX));
        let some = std::iter::repeat_with(uncut).take(20);
        let ([frames, bytes], pong) = some.min_by_key(|([_, bytes], _)| *bytes).unwrap();
        // At the least a request, and the reply as the last of them.
        assert!(frames >= 2 && pong == Ok(7), "{frames} {pong:?}");
        for place in [
            Place::Frame(frames - 1),
            Place::Byte(bytes - 1),
            Place::Byte(0),
        ] {
            let (_, pong) = passed(Cut::Gone, place);
            assert!(pong.unwrap_err().contains("the line was cut"));
            let (_, pong) = passed(Cut::Silent, place);
            assert!(pong.unwrap_err().contains("no answer to Ping"));
            let ([more, _], pong) = passed(Cut::Once, place);
            assert_eq!(pong, Ok(7));
            if place == Place::Frame(frames - 1) {
                assert_eq!(more, frames + 2, "asked and answered again");
            }
        }
        let behind = || passed(Cut::Gone, Place::Byte(bytes));
        let mut some = std::iter::repeat_with(behind).take(20);
        let (_, pong) = some.find(|([_, of], _)| *of == bytes).unwrap();
        assert_eq!(pong, Ok(7));
    }
}

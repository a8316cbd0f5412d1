//! Bytes of a compressed variable from any of its places on.
//!
//! Columns of a matrix, and fields of a struct, lie one after the other in one stream, and each channel needs its own place
//! in it. A decoder that has come to a place is kept there, 43 KiB, and the next channel goes on from it: two passes over
//! the stream in place of one for each channel from its beginning.

use crate::recording::bytes::{Bytes, Part};
use miniz_oxide::inflate::stream::{InflateState, inflate};
use miniz_oxide::{DataFormat, MZError, MZFlush, MZStatus};
use std::cell::RefCell;
use std::io::{self, BufRead, Read};
use std::rc::Rc;

/// Decoders that are kept.
const KEPT: usize = 64;

/// A decoder of zlib that can be copied.
pub(super) struct Inflater {
    state: Box<InflateState>,
    input: Part,
    /// Bytes that came out.
    given: u64,
}

impl Inflater {
    fn new(input: Part) -> Self {
        Self {
            state: InflateState::new_boxed(DataFormat::Zlib),
            input,
            given: 0,
        }
    }
}

impl Read for Inflater {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            let input = self.input.fill_buf()?;
            let ended = input.is_empty();
            let result = inflate(&mut self.state, input, buffer, MZFlush::None);
            self.input.consume(result.bytes_consumed);
            let given = result.bytes_written;
            if given > 0 {
                self.given += given as u64;
                return Ok(given);
            }
            match result.status {
                Ok(MZStatus::StreamEnd) => return Ok(0),
                Ok(_) | Err(MZError::Buf) if ended => {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                Ok(_) => {}
                Err(error) => {
                    let why = format!("its compressed bytes are wrong ({error:?})");
                    return Err(io::Error::new(io::ErrorKind::InvalidData, why));
                }
            }
        }
    }
}

/// Decoders at places of the compressed variables of a file.
#[derive(Default)]
pub(super) struct Places(RefCell<Vec<Place>>);

struct Place {
    /// First byte of the variable in the file.
    begin: u64,
    /// Bytes of it that came out.
    given: u64,
    state: Box<InflateState>,
    /// Next byte in the file.
    at: u64,
}

impl Places {
    /// The bytes of a variable, which lies in `part` of the file, behind the first `lead` ones.
    ///
    /// # Errors
    /// If the bytes before are damaged or too few.
    pub(super) fn from(
        &self,
        bytes: &Rc<Bytes>,
        [begin, end]: [u64; 2],
        lead: u64,
    ) -> io::Result<Inflater> {
        let mut places = self.0.borrow_mut();
        let before = |place: &&Place| place.begin == begin && place.given <= lead;
        let nearest = places.iter().filter(before).max_by_key(|place| place.given);
        let mut inflater = match nearest {
            Some(place) => Inflater {
                state: place.state.clone(),
                input: bytes.part(place.at, end),
                given: place.given,
            },
            None => Inflater::new(bytes.part(begin, end)),
        };
        let mut left = lead - inflater.given;
        if left > 0 {
            left -= io::copy(&mut (&mut inflater).take(left), &mut io::sink())?;
            if left > 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if places.len() == KEPT {
                places.remove(0);
            }
            places.push(Place {
                begin,
                given: lead,
                state: inflater.state.clone(),
                at: inflater.input.at,
            });
        }
        Ok(inflater)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Draws;
    use crate::recording::input::Input;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write as _;

    /// Bytes that come out from some places on, in an order that goes back and forth, are those of the whole.
    #[test]
    fn any_place_is_reached() {
        let mut rng = Draws::new(3);
        let values: Vec<u8> = (0..40_000)
            .flat_map(|k| ((rng.normal() * f64::from(k % 100)) as i32).to_le_bytes())
            .collect();
        let mut encoder = ZlibEncoder::new(vec![7; 5], Compression::default());
        encoder.write_all(&values).unwrap();
        let packed = encoder.finish().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let open = |content: &[u8]| {
            let file = folder.path().join("packed");
            std::fs::write(&file, content).unwrap();
            let input = Input {
                file,
                start: Vec::new(),
                content: Box::new(io::empty()),
                packed: false,
            };
            Bytes::open(input, "a test").unwrap()
        };
        let bytes = open(&packed);
        let part = [5, packed.len() as u64];
        let places = Places::default();
        // More places than are kept.
        let order = (0..100)
            .map(|k| k * 1601)
            .chain([3, 160_000, 80_001, 159_999]);
        for lead in order {
            let mut found = Vec::new();
            let mut inflater = places.from(&bytes, part, lead).unwrap();
            inflater.read_to_end(&mut found).unwrap();
            assert!(found == values[lead as usize..], "from {lead} on");
        }
        assert!(places.from(&bytes, part, 160_001).is_err());

        // A stream that is cut, and one that is changed, is an error and never ends.
        let cut = open(&packed[..packed.len() / 2]);
        let mut rest = Places::default().from(&cut, part, 100).unwrap();
        assert!(rest.read_to_end(&mut Vec::new()).is_err());
        let mut wrong = packed.clone();
        let last = wrong.len() - 1;
        wrong[last] ^= 1;
        let wrong = open(&wrong);
        let mut rest = Places::default().from(&wrong, part, 100).unwrap();
        assert!(rest.read_to_end(&mut Vec::new()).is_err());
    }
}

//! Consistent overhead byte stuffing: a body of any bytes without a single zero.
//!
//! The body is cut at its zeros into groups. Each group is preceded by a code, its
//! length plus one, and the zero itself is left out; a group of 254 bytes has the code
//! 255 and no zero after it. So a zero on the wire is always the end of a frame, wherever
//! one starts to listen. The price is one byte a frame and one more per 254.
//!
//! Own code rather than a crate: the encoder writes straight behind the serialiser into
//! the lent buffer, so that a frame needs one buffer and one pass, and the decoder tells
//! its caller byte by byte what came, so that errors can be counted by kind.

/// Code of a group that no zero follows, and one more than the bytes in it.
const FULL: u8 = 0xFF;

/// The lent buffer is too small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Full;

/// Writes a stuffed body into lent storage.
#[derive(Debug)]
pub(super) struct Encoder<'o> {
    out: &'o mut [u8],
    /// Where the code of the open group lies.
    code_at: usize,
    /// Where the next byte goes.
    at: usize,
    code: u8,
}

impl<'o> Encoder<'o> {
    /// Starts at `start` of `out`, where the first code will lie.
    pub(super) fn new(out: &'o mut [u8], start: usize) -> Self {
        Self {
            out,
            code_at: start,
            at: start + 1,
            code: 1,
        }
    }

    fn put(&mut self, at: usize, byte: u8) -> Result<(), Full> {
        *self.out.get_mut(at).ok_or(Full)? = byte;
        Ok(())
    }

    fn close_group(&mut self) -> Result<(), Full> {
        self.put(self.code_at, self.code)?;
        self.code_at = self.at;
        self.at += 1;
        self.code = 1;
        Ok(())
    }

    /// Stuffs one byte.
    pub(super) fn push(&mut self, byte: u8) -> Result<(), Full> {
        // A full group is closed only when another byte comes: a body that ends with one
        // needs no empty group behind it.
        if self.code == FULL {
            self.close_group()?;
        }
        if byte == 0 {
            self.close_group()
        } else {
            self.put(self.at, byte)?;
            self.at += 1;
            self.code += 1;
            Ok(())
        }
    }

    /// Ends the body with the delimiter; where the frame ends in the buffer.
    pub(super) fn finish(mut self) -> Result<usize, Full> {
        self.put(self.code_at, self.code)?;
        self.put(self.at, 0)?;
        Ok(self.at + 1)
    }
}

/// What one byte of the wire means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// A code: the body has not grown.
    Nothing,
    /// The next byte of the body.
    Byte(u8),
    /// A delimiter that ends a well-formed body.
    End,
    /// A delimiter in the middle of a group.
    Broken,
    /// A delimiter after a delimiter.
    Idle,
}

/// Takes the stuffing out again, one byte at a time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Decoder {
    started: bool,
    /// Bytes of the open group that are still to come.
    left: u8,
    /// Whether the open group stands for a zero behind it, if another group follows.
    zero: bool,
}

impl Decoder {
    pub(super) const fn new() -> Self {
        Self {
            started: false,
            left: 0,
            zero: false,
        }
    }

    /// Takes one byte. Every delimiter leaves the decoder as new.
    pub(super) fn feed(&mut self, byte: u8) -> Step {
        if byte == 0 {
            let step = match (self.started, self.left) {
                (false, _) => Step::Idle,
                (true, 0) => Step::End,
                (true, _) => Step::Broken,
            };
            *self = Self::new();
            return step;
        }
        if self.left > 0 {
            self.left -= 1;
            return Step::Byte(byte);
        }
        let step = if self.zero {
            Step::Byte(0)
        } else {
            Step::Nothing
        };
        self.started = true;
        self.left = byte - 1;
        self.zero = byte != FULL;
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Bytes = heapless::Vec<u8, 1100>;

    fn encoded(body: &[u8]) -> Bytes {
        let mut out = [0xAA; 1100];
        let mut encoder = Encoder::new(&mut out, 0);
        for &byte in body {
            encoder.push(byte).unwrap();
        }
        let end = encoder.finish().unwrap();
        Bytes::from_slice(&out[..end]).unwrap()
    }

    /// The body and how the last byte ended it.
    fn decoded(wire: &[u8]) -> (Bytes, Option<Step>) {
        let mut decoder = Decoder::new();
        let mut body = Bytes::new();
        let mut last = None;
        for &byte in wire {
            let step = decoder.feed(byte);
            if let Step::Byte(b) = step {
                body.push(b).unwrap();
            }
            last = Some(step);
        }
        (body, last)
    }

    #[test]
    fn bodies_whose_stuffing_is_known() {
        assert_eq!(&encoded(&[]), &[1, 0]);
        assert_eq!(&encoded(&[0]), &[1, 1, 0]);
        assert_eq!(&encoded(&[0, 0]), &[1, 1, 1, 0]);
        assert_eq!(&encoded(&[7, 0, 9]), &[2, 7, 2, 9, 0]);
        assert_eq!(&encoded(&[7, 8, 9]), &[4, 7, 8, 9, 0]);
        let full = [5; 254];
        let wire = encoded(&full);
        assert_eq!(
            (wire[0], wire.len()),
            (255, 256),
            "no empty group behind it"
        );
    }

    #[test]
    fn every_length_comes_back_with_the_stated_overhead() {
        for n in 0..1080 {
            for period in [1_usize, 2, 253, 254, 255, 2000] {
                let mut body = Bytes::new();
                for i in 0..n {
                    // `period` 1 is all zeros, 2000 has none.
                    let byte = if (i + 1) % period == 0 {
                        0
                    } else {
                        1 + (i % 255) as u8
                    };
                    body.push(byte).unwrap();
                }
                let wire = encoded(&body);
                assert!(wire.len() <= n + n / 254 + 2, "{n} bytes, period {period}");
                assert!(!wire[..wire.len() - 1].contains(&0));
                assert_eq!(decoded(&wire), (body, Some(Step::End)));
            }
        }
    }

    #[test]
    fn a_small_buffer_is_an_error_at_every_length() {
        let body = [3, 0, 4, 0, 0, 5];
        let needed = encoded(&body).len();
        for n in 0..needed {
            let mut out = [0; 16];
            let mut encoder = Encoder::new(&mut out[..n], 0);
            let fits = body.iter().all(|&b| encoder.push(b).is_ok());
            assert!(!fits || encoder.finish().is_err(), "{n} of {needed} bytes");
        }
    }

    #[test]
    fn whatever_came_before_a_delimiter_the_next_body_is_read() {
        // All byte strings of up to five bytes over those that steer the decoder.
        let alphabet = [0, 1, 2, 3, 0xFE, 0xFF];
        for length in 0..=5_u32 {
            for mut n in 0..6_usize.pow(length) {
                let mut decoder = Decoder::new();
                for _ in 0..length {
                    decoder.feed(alphabet[n % 6]);
                    n /= 6;
                }
                decoder.feed(0);
                let steps = [2, 7, 2, 9, 0].map(|b| decoder.feed(b));
                let body = [Step::Nothing, Step::Byte(7), Step::Byte(0), Step::Byte(9)];
                assert_eq!(steps[..4], body);
                assert_eq!(steps[4], Step::End);
            }
        }
    }
}

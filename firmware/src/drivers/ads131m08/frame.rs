//! Frames: words of 24 bits, closed by a checksum.

use super::super::Fault;
use super::registers::{CHANNELS, Register, command};

/// Bytes of a word.
pub const WORD: usize = 3;
/// Words of the usual frame: command or answer, the channels, the checksum.
pub const WORDS: usize = CHANNELS + 2;
/// Bytes of the usual frame.
pub const BYTES: usize = WORDS * WORD;
/// Bytes of the longest frame: all writable registers between a command and a checksum.
pub const BYTES_MAX: usize = (Register::WRITABLE + 2) * WORD;

/// Checksum CRC-16-CCITT: polynomial 0x1021, from 0xFFFF on, neither reflected nor inverted.
#[must_use]
#[inline]
pub fn crc(bytes: &[u8]) -> u16 {
    // The checksum is linear, so that each byte of a word adds its own, shifted by the bytes behind
    // it. Three independent look-ups take the chip half as long as three in turn. Bytes stay in the
    // wire's order until the end.
    let (threes, words) = bytes.as_chunks::<{ 3 * WORD }>();
    let (words, rest) = words.as_chunks::<WORD>();
    let crc = threes
        .iter()
        .fold(0xFFFF, |crc, &[a, b, c, d, e, f, g, h, i]| {
            let crc = add(crc, [a, b, c]);
            add(add(crc, [d, e, f]), [g, h, i])
        });
    let crc = words.iter().fold(crc, |crc, word| add(crc, *word));
    let crc = rest.iter().fold(crc, |crc, &byte| {
        let [high, low] = crc.to_le_bytes();
        u16::from(low) ^ ALONE[usize::from(high ^ byte)]
    });
    u16::from_be_bytes(crc.to_le_bytes())
}

/// The checksum with a word behind it.
#[inline(always)]
fn add(crc: u16, [a, b, c]: [u8; WORD]) -> u16 {
    let [a, b] = (u16::from_le_bytes([a, b]) ^ crc).to_le_bytes();
    TWO_BEHIND[usize::from(a)] ^ ONE_BEHIND[usize::from(b)] ^ ALONE[usize::from(c)]
}

/// Checksums of single bytes from zero on, with no, one and two zeros behind them, in the wire's
/// byte order: the upper byte first.
// Three variables, not an array of three: their addresses stay in registers.
static ALONE: [u16; 256] = table(0);
static ONE_BEHIND: [u16; 256] = table(1);
static TWO_BEHIND: [u16; 256] = table(2);

const fn table(behind: usize) -> [u16; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 * (1 + behind) {
            let out = crc & 0x8000 != 0;
            crc <<= 1;
            if out {
                crc ^= 0x1021;
            }
            bit += 1;
        }
        table[byte] = u16::from_le_bytes(crc.to_be_bytes());
        byte += 1;
    }
    table
}

/// A frame to be sent, in the buffer that receives the answer.
#[derive(Clone, Debug)]
pub struct Frame {
    bytes: [u8; BYTES_MAX],
    length: usize,
}

impl Frame {
    /// A command, its checksum, and zeros up to the usual length.
    #[must_use]
    pub fn command(word: u16) -> Self {
        Self::with_registers(word, &[])
    }

    /// A command with the contents of registers behind it; contents beyond
    /// [`Register::WRITABLE`] registers are cut off.
    #[must_use]
    pub fn with_registers(word: u16, registers: &[u16]) -> Self {
        let registers = registers.get(..Register::WRITABLE).unwrap_or(registers);
        let mut bytes = [0; BYTES_MAX];
        let words = core::iter::once(&word).chain(registers);
        for (slot, word) in bytes.chunks_exact_mut(WORD).zip(words) {
            put(slot, *word);
        }
        let covered = (registers.len() + 1) * WORD;
        let checksum = bytes.get(..covered).map_or(0, crc);
        if let Some(slot) = bytes.get_mut(covered..covered + WORD) {
            put(slot, checksum);
        }
        Self {
            bytes,
            length: BYTES.max(covered + WORD),
        }
    }

    /// The NULL command, in a frame long enough for the answer to a read of `count` registers.
    #[must_use]
    pub fn null_for(count: usize) -> Self {
        let mut frame = Self::command(command::NULL);
        let length = count.saturating_add(2).saturating_mul(WORD);
        frame.length = length.clamp(BYTES, BYTES_MAX);
        frame
    }

    /// The bytes that are exchanged.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        // The length never exceeds the array.
        self.bytes.get_mut(..self.length).unwrap_or_default()
    }

    /// The received words before the checksum; `words` is their number, [`CHANNELS`] + 1 in a usual
    /// frame.
    ///
    /// # Errors
    ///
    /// As [`checked`].
    pub fn checked(&self, words: usize) -> Result<&[u8], Fault> {
        checked(&self.bytes, words)
    }
}

/// The words before the checksum.
///
/// # Errors
///
/// [`Fault::Checksum`] unless the first word and the checksum are filled up with zeros and the
/// checksum is right; [`Fault::Stuck`] if all bits are the same.
// Inlined, so that code for other lengths falls away where the length is constant.
#[inline]
pub fn checked(bytes: &[u8], words: usize) -> Result<&[u8], Fault> {
    let whole = || -> Option<&[u8]> {
        let (body, rest) = bytes.split_at_checked(words.saturating_mul(WORD))?;
        let [high, low, fill] = *rest.first_chunk()?;
        let filled = body.get(2) == Some(&0) && fill == 0;
        (filled && crc(body) == u16::from_be_bytes([high, low])).then_some(body)
    };
    whole().ok_or_else(|| garbled(bytes))
}

/// The fault of bytes that are no frame.
#[cold]
fn garbled(bytes: &[u8]) -> Fault {
    let is_stuck = |level: u8| bytes.iter().all(|&byte| byte == level);
    if is_stuck(0) || is_stuck(u8::MAX) {
        Fault::Stuck
    } else {
        Fault::Checksum
    }
}

/// Writes 16 bits into a word of 24.
pub fn put(slot: &mut [u8], word: u16) {
    let [high, low] = word.to_be_bytes();
    for (slot, byte) in slot.iter_mut().zip([high, low, 0]) {
        *slot = byte;
    }
}

/// The upper 16 bits of the word of this number; zero beyond the end.
#[must_use]
#[inline]
pub fn word(bytes: &[u8], number: usize) -> u16 {
    let first_two = bytes.get(number * WORD..).and_then(<[u8]>::first_chunk);
    first_two.map_or(0, |two| u16::from_be_bytes(*two))
}

/// The count in a word: 24 bits, two's complement.
#[must_use]
#[inline]
pub fn count([high, middle, low]: [u8; WORD]) -> i32 {
    // An arithmetic shift from the top extends the sign.
    i32::from_be_bytes([high, middle, low, 0]) >> 8
}

/// The counts of a sample, behind its status; zeros if they are not all there.
#[must_use]
#[inline]
pub fn counts(words: &[u8]) -> [i32; CHANNELS] {
    // Written out, since the chip's code is compiled for size, and this runs for every sample.
    words.first_chunk().map_or([0; CHANNELS], |words| {
        [
            count_at::<1>(words),
            count_at::<2>(words),
            count_at::<3>(words),
            count_at::<4>(words),
            count_at::<5>(words),
            count_at::<6>(words),
            count_at::<7>(words),
            count_at::<8>(words),
        ]
    })
}

/// The count in the word of this number, above zero. It is loaded with the byte before it, at once, and
/// shifts drop that byte and extend the sign.
#[inline(always)]
fn count_at<const NUMBER: usize>(words: &[u8; (CHANNELS + 1) * WORD]) -> i32 {
    let four = words.get(NUMBER * WORD - 1..).and_then(<[u8]>::first_chunk);
    // They are there.
    four.map_or(0, |four| i32::from_be_bytes(*four) << 8 >> 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksum_is_ccitt() {
        // The check value of the catalogue of CRCs (CRC-16/IBM-3740).
        assert_eq!(crc(b"123456789"), 0x29B1);
    }

    #[test]
    fn a_line_that_is_stuck_is_no_frame() {
        for level in [0x00, 0xFF] {
            for words in 1..=Register::WRITABLE + 1 {
                assert_eq!(checked(&[level; BYTES_MAX], words), Err(Fault::Stuck));
            }
        }
    }

    #[test]
    fn counts_keep_their_sign() {
        let cases = [
            ([0x7F, 0xFF, 0xFF], 8_388_607),
            ([0x80, 0, 0], -8_388_608),
            ([0xFF, 0xFF, 0xFE], -2),
            ([0, 1, 2], 258),
        ];
        for (bytes, expected) in cases {
            assert_eq!(count(bytes), expected);
            // All words alike, so that each of these bytes is before a count once.
            assert_eq!(
                counts(&[bytes; CHANNELS + 1].concat()),
                [expected; CHANNELS]
            );
        }
    }

    #[test]
    fn any_three_wrong_bits_are_noticed() {
        // A CRC of 16 bits with this polynomial has Hamming distance 4 up to 32751 bits.
        let mut frame = Frame::command(command::NULL);
        let body: [u8; BYTES - WORD] = core::array::from_fn(|i| {
            if i == 2 {
                0
            } else {
                (i as u8).wrapping_mul(31)
            }
        });
        let mut bytes = [0; BYTES];
        bytes[..BYTES - WORD].copy_from_slice(&body);
        put(&mut bytes[BYTES - WORD..], crc(&body));
        assert!(checked(&bytes, WORDS - 1).is_ok());
        let bits = BYTES * 8;
        for a in (0..bits).step_by(7) {
            for b in 0..bits {
                for c in [b, bits - 1 - a] {
                    let mut wrong = bytes;
                    for bit in [a, b, c] {
                        wrong[bit / 8] ^= 0x80 >> (bit % 8);
                    }
                    frame.bytes[..BYTES].copy_from_slice(&wrong);
                    assert_eq!(frame.checked(WORDS - 1).is_ok(), wrong == bytes);
                }
            }
        }
    }
}

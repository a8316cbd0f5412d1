//! The frame's checksum: CRC-32/ISO-HDLC, the one of Ethernet and gzip.
//!
//! Reflected polynomial 0xEDB88320, register preset to ones, inverted at the end, check
//! value 0xCBF43926. A table of its own instead of a crate: it is twenty lines, costs
//! 1 KiB of flash like any byte-wise table, and is built by the compiler. The chip's CRC
//! unit knows only the unreflected form by words, which a byte stream would have to be
//! turned into first; at the link's rate the table costs about one percent of the core.

/// One step of eight bits for each value of the low byte.
const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut n = 0;
    while n < 256 {
        let mut r = n as u32;
        let mut bit = 0;
        while bit < 8 {
            r = if r & 1 == 1 {
                (r >> 1) ^ 0xEDB8_8320
            } else {
                r >> 1
            };
            bit += 1;
        }
        table[n] = r;
        n += 1;
    }
    table
};

/// A checksum in the making.
#[derive(Clone, Copy, Debug)]
pub struct Crc32(u32);

impl Crc32 {
    /// Of no bytes yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Takes one byte.
    pub const fn push(&mut self, byte: u8) {
        // The index is a byte and the table has 256 entries: no bounds check is left.
        self.0 = (self.0 >> 8) ^ TABLE[(self.0 as u8 ^ byte) as usize];
    }

    /// Takes many bytes.
    pub const fn extend(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while let Some((&byte, tail)) = rest.split_first() {
            self.push(byte);
            rest = tail;
        }
    }

    /// The checksum of what was taken so far.
    #[must_use]
    pub const fn value(self) -> u32 {
        !self.0
    }
}

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

/// The checksum of `bytes`.
#[must_use]
pub const fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = Crc32::new();
    crc.extend(bytes);
    crc.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, bit by bit.
    fn by_bits(bytes: &[u8]) -> u32 {
        let mut r = u32::MAX;
        for byte in bytes {
            for k in 0..8 {
                let carry = (r ^ u32::from(byte >> k)) & 1;
                r = (r >> 1) ^ (carry * 0xEDB8_8320);
            }
        }
        !r
    }

    #[test]
    fn the_catalogues_check_value() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b""), 0);
    }

    #[test]
    fn the_table_is_the_polynomial() {
        let bytes: [u8; 256] = core::array::from_fn(|i| (i as u8).wrapping_mul(167));
        for n in 0..=bytes.len() {
            assert_eq!(crc32(&bytes[..n]), by_bits(&bytes[..n]), "{n} bytes");
        }
    }
}

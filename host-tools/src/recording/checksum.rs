//! Length and checksum of a recording, by which a setup tells it from another one.

use std::io::{self, BufReader, Read, Write};
use std::path::Path;

/// Bytes that are read together.
const TOGETHER: usize = 128 << 10;

/// Length and checksum of a file. It tells a file that was exchanged or cut, not one that
/// somebody forged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checksum {
    /// CRC-32 of all bytes, as of gzip and zip.
    pub crc32: u32,
    /// Length, bytes.
    pub bytes: u64,
}

/// Counts and sums up the bytes that pass on their way from or to a file.
pub(crate) struct Summed<T> {
    inner: T,
    sum: flate2::Crc,
    bytes: u64,
}

impl<T> Summed<T> {
    pub(crate) fn new(inner: T) -> Self {
        Self {
            inner,
            sum: flate2::Crc::new(),
            bytes: 0,
        }
    }

    /// Length and checksum of the bytes so far.
    pub(crate) fn checksum(&self) -> Checksum {
        Checksum {
            crc32: self.sum.sum(),
            bytes: self.bytes,
        }
    }

    fn add(&mut self, bytes: &[u8]) {
        self.sum.update(bytes);
        self.bytes += bytes.len() as u64;
    }
}

impl<R: Read> Read for Summed<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.add(buffer.get(..n).unwrap_or_default());
        Ok(n)
    }
}

impl<W: Write> Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.inner.write(bytes)?;
        self.add(bytes.get(..n).unwrap_or_default());
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl Checksum {
    /// Length and checksum of a file.
    ///
    /// # Errors
    /// The system's.
    pub fn of_file(file: &Path) -> io::Result<Self> {
        let summed = Summed::new(std::fs::File::open(file)?);
        let mut buffered = BufReader::with_capacity(TOGETHER, summed);
        io::copy(&mut buffered, &mut io::sink())?;
        let summed = buffered.into_inner();
        Ok(summed.checksum())
    }
}

impl std::fmt::Display for Checksum {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bytes, CRC-32 {:08x}", self.bytes, self.crc32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_checksum_of_gzip_and_zip() {
        // The check value of CRC-32 in the catalogue of CRCs: "123456789" gives cbf43926.
        let mut summed = Summed::new(Vec::new());
        summed.write_all(b"1234").unwrap();
        summed.write_all(b"56789").unwrap();
        let expected = Checksum {
            crc32: 0xcbf4_3926,
            bytes: 9,
        };
        assert_eq!(summed.checksum(), expected);
        let mut read = Summed::new(&b"123456789"[..]);
        io::copy(&mut read, &mut io::sink()).unwrap();
        assert_eq!(read.checksum(), expected);
        assert_eq!(expected.to_string(), "9 bytes, CRC-32 cbf43926");
    }
}

//! The bytes of a recording: a regular file, unpacked where it is compressed.

use super::{Checksum, Place, RecordingError, Summed};
use flate2::read::MultiGzDecoder;
use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Bytes of a file by which its format is known.
const START: u64 = 4096;
/// First bytes of a gzip file.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// A file that was opened, before its format is known.
pub(super) struct Input {
    pub(super) file: PathBuf,
    /// First bytes of the content, unpacked: [`START`] of them where there are as many.
    pub(super) start: Vec<u8>,
    /// The content from its first byte on, unpacked.
    pub(super) content: Box<dyn Read>,
    /// `true` if the file is compressed by gzip.
    pub(super) packed: bool,
}

/// Bytes of the file that have been read, while others read on.
#[derive(Clone)]
pub(super) struct Passed(Rc<RefCell<Summed<Box<dyn Read>>>>);

impl Passed {
    pub(super) fn new(file: impl Read + 'static) -> Self {
        Self(Rc::new(RefCell::new(Summed::new(Box::new(file)))))
    }

    /// Length and checksum of the bytes that were read so far.
    pub(super) fn checksum(&self) -> Checksum {
        self.0.borrow().checksum()
    }
}

impl Read for Passed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.borrow_mut().read(buffer)
    }
}

/// An error that is due when the bytes before it have been read.
pub(super) struct Broken(pub(super) Option<io::Error>);

impl Read for Broken {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        self.0.take().map_or(Ok(0), Err)
    }
}

/// Opens a file; its size in bytes, and the bytes that are read of it.
///
/// # Errors
/// [`RecordingError`] if it is empty, no regular file, or cannot be read.
pub(super) fn open(file: &Path) -> Result<(Input, u64, Passed), RecordingError> {
    let unreadable = |source| RecordingError::Unreadable {
        file: file.to_owned(),
        source,
    };
    let metadata = std::fs::metadata(file).map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(unreadable(io::ErrorKind::IsADirectory.into()));
    }
    // Recordings are read several times, which a pipe cannot be; one without a writer would not
    // even open.
    if !metadata.is_file() {
        return Err(RecordingError::NoFile {
            file: file.to_owned(),
        });
    }
    let opened = File::open(file).map_err(unreadable)?;
    if metadata.len() == 0 {
        return Err(RecordingError::Empty {
            file: file.to_owned(),
        });
    }
    let passed = Passed::new(opened);
    let raw: Box<dyn Read> = Box::new(passed.clone());
    let (mut start, mut content) = peek(raw, file)?;
    let packed = start.starts_with(&GZIP);
    if packed {
        let unpacked: Box<dyn Read> = Box::new(MultiGzDecoder::new(BufReader::new(content)));
        (start, content) = peek(unpacked, file)?;
    }
    let input = Input {
        file: file.to_owned(),
        start,
        content,
        packed,
    };
    Ok((input, metadata.len(), passed))
}

/// The first bytes of a reader, and a reader of all of them.
fn peek(
    mut reader: Box<dyn Read>,
    file: &Path,
) -> Result<(Vec<u8>, Box<dyn Read>), RecordingError> {
    let mut start = Vec::new();
    let failed = reader.by_ref().take(START).read_to_end(&mut start).err();
    match failed {
        Some(error) if start.is_empty() => Err(RecordingError::Damaged {
            file: file.to_owned(),
            place: Place::Line(1),
            reason: error.to_string(),
        }),
        failed => {
            let all = Cursor::new(start.clone())
                .chain(Broken(failed))
                .chain(reader);
            Ok((start, Box::new(all)))
        }
    }
}

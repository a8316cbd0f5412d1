//! The bytes of a file that is read as a whole: never more than a limit, and never waited for
//! without end.

use super::error::DocumentError;
use crate::limits;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

/// Reads a file of at most [`limits::DOCUMENT`] bytes. What is no regular file, a pipe for
/// instance or the standard input, is read as well, but not for longer than [`limits::PIPE`].
///
/// # Errors
/// [`DocumentError::Unreadable`], [`DocumentError::TooLong`], [`DocumentError::Late`].
pub(crate) fn read(file: &Path) -> Result<Vec<u8>, DocumentError> {
    read_within(file, limits::DOCUMENT, limits::PIPE)
}

/// Reads a file of at most `limit` bytes, otherwise as [`read`].
///
/// # Errors
/// As [`read`].
pub(crate) fn read_of(file: &Path, limit: u64) -> Result<Vec<u8>, DocumentError> {
    read_within(file, limit, limits::PIPE)
}

fn read_within(file: &Path, limit: u64, time: Duration) -> Result<Vec<u8>, DocumentError> {
    let unreadable = |source| DocumentError::Unreadable {
        file: file.to_owned(),
        source,
    };
    let kind = std::fs::metadata(file).map_err(unreadable)?;
    let bytes = if kind.is_file() {
        capped(file, limit)
    } else if kind.is_dir() {
        Err(ErrorKind::IsADirectory.into())
    } else {
        // A pipe that has no writer does not even open. The thread that tries may stay until
        // this program ends; it holds nothing else.
        let (tell, told) = mpsc::channel();
        let path = file.to_owned();
        let reader = std::thread::Builder::new().spawn(move || tell.send(capped(&path, limit)));
        reader.map_err(unreadable)?;
        told.recv_timeout(time).map_err(|_| DocumentError::Late {
            file: file.to_owned(),
            seconds: time.as_secs_f64(),
        })?
    };
    let bytes = bytes.map_err(unreadable)?;
    if bytes.len() as u64 > limit {
        return Err(DocumentError::TooLong {
            file: file.to_owned(),
            limit,
        });
    }
    Ok(bytes)
}

/// The bytes of a file up to one beyond the limit.
fn capped(file: &Path, limit: u64) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(file)?.take(limit + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::process::Command;
    use std::time::Instant;

    fn fifo(folder: &Path) -> std::path::PathBuf {
        let pipe = folder.join("pipe");
        let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        pipe
    }

    #[test]
    fn a_pipe_without_a_writer_is_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let since = Instant::now();
        let error = read_within(
            &fifo(folder.path()),
            limits::DOCUMENT,
            Duration::from_millis(200),
        )
        .unwrap_err();
        assert!(matches!(error, DocumentError::Late { .. }), "{error}");
        assert!(error.to_string().contains("0.2 s"), "{error}");
        // Fifty times what it was told, on a machine that is busy otherwise.
        assert!(since.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_pipe_that_is_written_to_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = fifo(folder.path());
        let path = pipe.clone();
        let writer = std::thread::spawn(move || std::fs::write(path, "title = 1"));
        assert_eq!(read(&pipe).unwrap(), b"title = 1");
        writer.join().unwrap().unwrap();
    }

    #[test]
    fn a_file_has_a_largest_size_and_a_device_an_end() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.toml");
        std::fs::write(&file, vec![b'#'; limits::DOCUMENT as usize]).unwrap();
        assert_eq!(read(&file).unwrap().len() as u64, limits::DOCUMENT);
        std::fs::write(&file, vec![b'#'; limits::DOCUMENT as usize + 1]).unwrap();
        for path in [&file, Path::new("/dev/zero")] {
            let error = read(path).unwrap_err();
            assert!(matches!(error, DocumentError::TooLong { .. }), "{error}");
        }
        assert!(matches!(
            read(folder.path()),
            Err(DocumentError::Unreadable { .. })
        ));
    }
}

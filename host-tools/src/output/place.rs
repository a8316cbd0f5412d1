//! Target of a path that is to be written.

use std::fs::{self, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Target of a path.
pub(super) enum Place {
    /// A regular file, or nothing yet.
    File {
        /// Behind all links.
        target: PathBuf,
        /// Metadata of the file that is there already.
        old: Option<Metadata>,
    },
    /// A device, pipe or stream, which is written directly.
    Stream(Box<dyn Write + Send>),
}

/// More links than any system follows.
const MOST_LINKS: u32 = 40;

/// File at the end of all links.
pub(super) enum End {
    /// Nothing, but a file could.
    Nothing(PathBuf),
    /// This.
    Found(PathBuf, Metadata),
    /// A stream that this process has open already, where the system shows it as a file, such
    /// as `/dev/stdout`. It may be a regular file, but that is not to be replaced while others
    /// write it, and what stands in it is not to be cut off.
    Open(PathBuf),
}

/// Follows links to their end.
///
/// # Errors
/// The system's, if it leads nowhere.
pub(super) fn follow(file: &Path) -> io::Result<End> {
    let mut path = file.to_owned();
    for _ in 0..MOST_LINKS {
        let folder = folder(&path);
        if cfg!(unix) && folder.canonicalize().is_ok_and(|f| is_descriptors(&f)) {
            return Ok(End::Open(path));
        }
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_symlink() => path = folder.join(fs::read_link(&path)?),
            Ok(found) => return Ok(End::Found(path, found)),
            // Its folder may have to be made, or cannot be one.
            Err(error) if is_nothing(&error) && is_named(&path) => return Ok(End::Nothing(path)),
            Err(error) => return Err(error),
        }
    }
    Err(io::Error::other("symbolic links go round in circles"))
}

/// Finds out where a path leads, and opens what is written directly.
///
/// # Errors
/// The system's, if it leads to a folder, nowhere, or to what this user may not write.
pub(super) fn find(file: &Path) -> io::Result<Place> {
    match follow(file)? {
        End::Nothing(target) => Ok(Place::File { target, old: None }),
        End::Found(_, found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
        End::Found(target, found) => {
            // One that is protected is not to be got round by a rename.
            let opened = OpenOptions::new().write(true).open(&target)?;
            if !found.is_file() {
                return Ok(Place::Stream(Box::new(opened)));
            }
            let old = Some(found);
            Ok(Place::File { target, old })
        }
        End::Open(path) => Ok(Place::Stream(
            match path.file_name().and_then(|name| name.to_str()) {
                Some("1") => Box::new(io::stdout()),
                Some("2") => Box::new(io::stderr()),
                _ => Box::new(OpenOptions::new().append(true).open(path)?),
            },
        )),
    }
}

/// The folder of a file.
pub(super) fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn is_nothing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

/// `true` if the path ends in a name that a file could have.
fn is_named(path: &Path) -> bool {
    let text = path.as_os_str().as_encoded_bytes();
    path.file_name().is_some() && !text.ends_with(b"/")
}

/// `true` if a folder is that of a process's descriptors.
fn is_descriptors(folder: &Path) -> bool {
    let linux = folder.starts_with("/proc") && folder.ends_with("fd");
    linux || folder == Path::new("/dev/fd")
}

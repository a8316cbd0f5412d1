//! Rows of a recording that grows.
//!
//! They go to a file beside the recording's place, whose name ends in `.part`. Programs that
//! are killed leave it there, and it holds all rows that were [flushed](Part::flush); a computer
//! that loses its power leaves those that were [handed to the disk](Part::sync_behind). It is
//! never written over, nor removed by anybody but the program that has made it. `--force` sets
//! it aside under another name.

use super::disk::{self, Handle};
use super::place::{self, End};
use super::{OutputError, TRIES};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Ending of the name of a recording that grows.
pub(crate) const GROWING: &str = "part";

/// Rows of a recording that grows.
pub(crate) struct Part {
    path: PathBuf,
    rows: BufWriter<Handle>,
    set_aside: Option<PathBuf>,
}

/// Path of the rows of a recording while it grows.
pub(crate) fn part_of(file: &Path) -> PathBuf {
    let mut part = file.as_os_str().to_owned();
    part.push(".");
    part.push(GROWING);
    part.into()
}

impl Part {
    /// Begins the rows of a recording. Its folder is made if it is missing. With `force`, what a
    /// killed program has left of such a recording is set aside.
    ///
    /// # Errors
    /// [`OutputError`] if there can be no such file, or if it would be in the way of another.
    pub(crate) fn begin(file: &Path, force: bool) -> Result<Self, OutputError> {
        let refused = |source| OutputError::write(file, source);
        let target = match place::follow(file).map_err(refused)? {
            End::Nothing(target) => target,
            End::Found(target, found) if found.is_file() => target,
            End::Found(_, found) if found.is_dir() => {
                return Err(refused(io::ErrorKind::IsADirectory.into()));
            }
            End::Found(..) | End::Open(_) => {
                return Err(OutputError::NotRegular {
                    file: file.to_owned(),
                });
            }
        };
        let folder = place::folder(&target);
        disk::create_folders(folder).map_err(|source| OutputError::write(folder, source))?;
        let path = part_of(&target);
        let mut set_aside = None;
        let found = std::fs::symlink_metadata(&path);
        if let Ok(found) = found {
            if found.is_file() && disk::is_in_use(&path) == Some(true) {
                return Err(OutputError::InUse {
                    file: file.to_owned(),
                });
            }
            if !force {
                return Err(OutputError::Unfinished {
                    part: path,
                    file: file.to_owned(),
                    bytes: found.len(),
                });
            }
            let aside = free_name(&target).map_err(refused)?;
            disk::rename(&path, &aside).map_err(refused)?;
            set_aside = Some(aside);
        }
        let refused = |source| OutputError::write(&path, source);
        let rows = BufWriter::new(disk::create_new(&path).map_err(refused)?);
        Ok(Self {
            path,
            rows,
            set_aside,
        })
    }

    /// Path of the rows.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// New path of the rows of an earlier recording that were in the way.
    pub(crate) fn set_aside(&self) -> Option<&Path> {
        self.set_aside.as_deref()
    }

    /// Has the disk hold all rows that were written up to now, beside what else goes on.
    ///
    /// # Errors
    /// The system's, among them that of an earlier time.
    pub(crate) fn sync_behind(&mut self) -> io::Result<()> {
        self.rows.flush()?;
        self.rows.get_mut().sync_behind()
    }

    /// Has the disk hold the name under which the rows are.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn sync_name(&self) -> io::Result<()> {
        disk::sync_folder(place::folder(&self.path))
    }

    /// All that was written, from its beginning.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn reread(&mut self) -> io::Result<impl Read + use<>> {
        self.rows.flush()?;
        self.rows.get_ref().reread()
    }

    /// Removes it.
    ///
    /// # Errors
    /// The system's; then it is still there.
    pub(crate) fn remove(&mut self) -> io::Result<()> {
        disk::remove(&self.path)
    }

    /// Removes it, and puts back what was set aside for it.
    pub(crate) fn undo(&mut self) {
        // What cannot be put back is still there under the other name.
        if self.remove().is_ok()
            && let Some(aside) = self.set_aside.take()
        {
            let _ = disk::rename(&aside, &self.path);
        }
    }
}

impl Write for Part {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.rows.write(bytes)
    }

    /// Hands all rows to the system: from here on they outlive this program, however it ends.
    fn flush(&mut self) -> io::Result<()> {
        self.rows.flush()
    }
}

/// `x.csv.1.part`, `x.csv.2.part` and so on, the first that is free.
fn free_name(target: &Path) -> io::Result<PathBuf> {
    let name = |k: u32| {
        let mut name = target.as_os_str().to_owned();
        name.push(format!(".{k}"));
        part_of(Path::new(&name))
    };
    let free = |path: &PathBuf| std::fs::symlink_metadata(path).is_err();
    (1..=TRIES).map(name).find(free).ok_or_else(|| {
        io::Error::other(format!(
            "{TRIES} unfinished recordings have been set aside here; move them away"
        ))
    })
}

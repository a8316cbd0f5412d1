//! The operations on the file system that outputs are made of.
//!
//! There are no others: a test that has each of them fail in turn (see `faults`) has seen all
//! that can go wrong on the way to the disk.

use super::operation::Operation;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::{self, JoinHandle};

/// Tests have an operation fail here, or a write take fewer bytes.
#[cfg(test)]
use super::faults::step;

/// Every operation goes to the system.
#[cfg(not(test))]
#[inline]
fn step(_: Operation, _: &Path, bytes: usize) -> io::Result<usize> {
    Ok(bytes)
}

/// A file that this program has made and nobody else writes.
pub(super) struct Handle {
    file: File,
    path: PathBuf,
    behind: Option<Syncing>,
}

/// A thread that has the disk hold a file while this program goes on: a slow disk takes seconds
/// over it, and samples do not wait.
struct Syncing {
    /// Gone when there is nothing more to come.
    wanted: Option<SyncSender<()>>,
    failed: Receiver<io::Error>,
    thread: Option<JoinHandle<()>>,
}

/// Makes a file that is not there yet.
pub(super) fn create_new(path: &Path) -> io::Result<Handle> {
    step(Operation::Create, path, 0)?;
    let mut options = OpenOptions::new();
    options.read(true).write(true).create_new(true);
    let file = options.open(path)?;
    // Says that it is in use, until this program ends in whatever way. Not every file system
    // knows locks: there it is never taken for a left-over.
    #[cfg(unix)]
    let _ = file.try_lock();
    Ok(Handle {
        file,
        path: path.to_owned(),
        behind: None,
    })
}

/// `true` if a program has the file in use; `None` where the system does not tell.
pub(crate) fn is_in_use(path: &Path) -> Option<bool> {
    #[cfg(unix)]
    {
        match File::open(path).ok()?.try_lock() {
            Ok(()) => Some(false),
            Err(fs::TryLockError::WouldBlock) => Some(true),
            Err(fs::TryLockError::Error(_)) => None,
        }
    }
    #[cfg(windows)]
    {
        use std::os::windows::fs::OpenOptionsExt;
        // To share it with nobody is refused while somebody has it open.
        const SHARING_VIOLATION: i32 = 32;
        match OpenOptions::new().write(true).share_mode(0).open(path) {
            Ok(_) => Some(false),
            Err(error) => (error.raw_os_error() == Some(SHARING_VIOLATION)).then_some(true),
        }
    }
    #[cfg(not(any(unix, windows)))]
    {
        let _ = path;
        None
    }
}

/// Puts a file in the place of another one, or where there is none.
pub(super) fn rename(from: &Path, to: &Path) -> io::Result<()> {
    step(Operation::Rename, to, 0)?;
    fs::rename(from, to)
}

/// Removes a file.
pub(super) fn remove(path: &Path) -> io::Result<()> {
    step(Operation::Remove, path, 0)?;
    fs::remove_file(path)
}

/// Makes a folder and those that it lies in.
pub(super) fn create_folders(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    step(Operation::Create, path, 0)?;
    fs::create_dir_all(path)
}

/// Has the disk hold the names in a folder.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    step(Operation::Sync, path, 0)?;
    // Elsewhere folders are no files.
    #[cfg(unix)]
    match File::open(path).and_then(|folder| folder.sync_all()) {
        // A folder that may be written but not listed, or a file system that knows no such
        // thing: it does by itself what it does.
        Err(error) if !is_failure(&error) => (),
        done => return done,
    }
    Ok(())
}

/// `true` if the disk failed, `false` if the system has no such operation.
fn is_failure(error: &io::Error) -> bool {
    use io::ErrorKind::{InvalidInput, PermissionDenied, Unsupported};
    !matches!(error.kind(), InvalidInput | PermissionDenied | Unsupported)
}

impl Handle {
    /// Has the disk hold what was written.
    pub(super) fn sync(&self) -> io::Result<()> {
        step(Operation::Sync, &self.path, 0)?;
        self.file.sync_all()
    }

    /// Has the disk hold what was written up to now, beside what else goes on. Where it is still
    /// at that, it begins anew once it is done.
    ///
    /// # Errors
    /// The system's, among them that of an earlier time.
    pub(super) fn sync_behind(&mut self) -> io::Result<()> {
        step(Operation::Sync, &self.path, 0)?;
        if self.behind.is_none() {
            self.behind = Some(Syncing::new(self.file.try_clone()?)?);
        }
        self.behind.as_ref().map_or(Ok(()), Syncing::again)
    }

    /// Gives it the permissions of another file, and its owner where that is allowed.
    pub(super) fn be_like(&self, old: &Metadata) -> io::Result<()> {
        step(Operation::Permit, &self.path, 0)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::{MetadataExt, fchown};
            let own = self.file.metadata()?;
            if (own.uid(), own.gid()) != (old.uid(), old.gid()) {
                // Only some may give files away; to the others it stays their own.
                let _ = fchown(&self.file, Some(old.uid()), Some(old.gid()));
            }
        }
        // After the owner, whose change takes some of them away.
        self.file.set_permissions(old.permissions())
    }

    /// The bytes that have been written, from the beginning.
    pub(super) fn reread(&self) -> io::Result<File> {
        use io::Seek;
        let mut file = self.file.try_clone()?;
        file.rewind()?;
        Ok(file)
    }
}

impl Syncing {
    fn new(file: File) -> io::Result<Self> {
        // One that is wanted while another goes on is as good as several.
        let (wanted, orders) = mpsc::sync_channel(1);
        let (tell, failed) = mpsc::channel();
        let thread = thread::Builder::new().spawn(move || {
            for () in orders {
                match file.sync_data() {
                    Err(error) if is_failure(&error) => {
                        // Nobody asks any more.
                        let _ = tell.send(error);
                    }
                    _ => {}
                }
            }
        })?;
        Ok(Self {
            wanted: Some(wanted),
            failed,
            thread: Some(thread),
        })
    }

    fn again(&self) -> io::Result<()> {
        if let Ok(error) = self.failed.try_recv() {
            return Err(error);
        }
        if let Some(wanted) = &self.wanted {
            // Full: it is wanted already.
            let _ = wanted.try_send(());
        }
        Ok(())
    }
}

impl Drop for Syncing {
    /// Waits until it is done: until then the file is in use.
    fn drop(&mut self) {
        self.wanted = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Write for Handle {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = step(Operation::Write, &self.path, bytes.len())?;
        self.file.write(bytes.get(..taken).unwrap_or(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

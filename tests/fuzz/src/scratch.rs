//! A folder for the files of one target, in memory if the system has a file system there.

use massline::printable::steers;
use std::path::{Path, PathBuf};

/// A folder that is removed on drop.
#[derive(Debug)]
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    /// An empty folder.
    ///
    /// # Panics
    /// If there is no room for it.
    #[must_use]
    pub fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() {
            tempfile::tempdir_in(memory)
        } else {
            tempfile::tempdir()
        };
        Self(folder.expect("there is room for a folder"))
    }

    /// Path of a file in it.
    #[must_use]
    pub fn place(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file into it.
    ///
    /// # Panics
    /// If there is no room for it.
    #[must_use]
    pub fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let place = self.place(name);
        std::fs::write(&place, bytes).expect("there is room for a file");
        place
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

/// Asserts the properties of all messages to users: not empty, not too long, and without control
/// characters for terminals.
///
/// # Panics
/// If a property does not hold.
pub fn assert_message(text: &str) {
    assert!(!text.is_empty());
    assert!(text.len() < 8000, "{} bytes: {text:.300}", text.len());
    // Messages may have several lines.
    let steering = text.find(|c| steers(c) && c != '\n');
    assert_eq!(steering, None, "{text:?}");
}

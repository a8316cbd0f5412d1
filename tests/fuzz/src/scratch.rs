//! A folder for the files of one target, in memory where the system has such a place.

use massline::printable::steers;
use std::path::{Path, PathBuf};

/// A folder that is gone with this.
#[derive(Debug)]
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    /// An empty one.
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

    /// The place of a file in it.
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

/// Asserts what holds for everything that is said to a user: it is something, it is no novel, and
/// nothing in it steers a terminal, wherever it came from.
///
/// # Panics
/// If it does not hold.
pub fn sayable(text: &str) {
    assert!(!text.is_empty());
    assert!(text.len() < 8000, "{} bytes: {text:.300}", text.len());
    // Messages may have several lines.
    let steering = text.find(|c| steers(c) && c != '\n');
    assert_eq!(steering, None, "{text:?}");
}

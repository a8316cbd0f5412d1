//! Recordings of stepped sines and static poses in a folder that goes when it is no longer needed.

use super::TrialError;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

pub(super) fn sine_rows(names: &[&str], frequencies: &[f64], channels: &[Vec<f32>]) -> String {
    let mut text = "frequency".to_owned();
    for name in names {
        // Writing to a string cannot fail.
        let _ = write!(text, ",{name}.re,{name}.im");
    }
    for (line, frequency) in frequencies.iter().enumerate() {
        let _ = write!(text, "\n{frequency:?}");
        for channel in channels {
            let _ = write!(text, ",{:?},{:?}", channel[2 * line], channel[2 * line + 1]);
        }
    }
    text + "\n"
}

pub(super) fn pose_rows(names: &[&str], channels: &[Vec<f32>]) -> String {
    let mut text = names.join(",");
    for row in 0..channels.first().map_or(0, Vec::len) {
        text.push('\n');
        for (c, channel) in channels.iter().enumerate() {
            let comma = if c == 0 { "" } else { "," };
            let _ = write!(text, "{comma}{:?}", channel[row]);
        }
    }
    text + "\n"
}

/// A folder that goes when it is no longer needed.
pub(super) struct Scratch(pub(super) PathBuf);

impl Scratch {
    pub(super) fn new() -> Result<Self, TrialError> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("massline-study-{}-{number}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).map_err(|source| TrialError::Scratch {
            path: path.clone(),
            source,
        })?;
        Ok(Self(path))
    }

    pub(super) fn write(&self, name: &Path, text: &str) -> Result<(), TrialError> {
        let path = self.0.join(name);
        std::fs::write(&path, text).map_err(|source| TrialError::Scratch { path, source })
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // A folder that stays is nothing that a study should fail for.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scratch_folders_go() {
        let path = {
            let scratch = Scratch::new().unwrap();
            scratch.write(Path::new("a.csv"), "a").unwrap();
            scratch.0.clone()
        };
        assert!(!path.exists());
    }
}

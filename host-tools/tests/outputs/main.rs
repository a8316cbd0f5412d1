//! Files that the command writes: those that it may replace, and those that a full disk or a kill
//! leaves. Each of its operations on the file system fails in the library's own
//! tests; here the command is real, and so are the disk and the kill.

#[path = "../bench/mod.rs"]
mod bench;

#[cfg(unix)]
mod full_disk;
mod killed;
mod replaced;
#[cfg(unix)]
mod special_files;

use std::collections::BTreeMap;
use std::path::Path;

/// Regular files of a folder and their content.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let regular = entries.filter(|entry| entry.file_type().unwrap().is_file());
    regular
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, std::fs::read(entry.path()).unwrap())
        })
        .collect()
}

//! Operations on the file system, as tests count them.

/// An operation, as tests count them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operation {
    /// A new file, or one opened for more.
    Create,
    /// Bytes to a file.
    Write,
    /// A file's permissions and owner.
    Permit,
    /// Bytes that were written go to the disk.
    Sync,
    /// A file under another name.
    Rename,
    /// A file's end.
    Remove,
}

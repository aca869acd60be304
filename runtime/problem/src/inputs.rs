//! The files that a scene reads in addition to its texts.

use std::path::{Path, PathBuf};

use wfl_output::Hash;

/// A file that was read: a mesh, a table of values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// Its name as the scene writes it.
    pub name: String,
    /// Where it is.
    pub path: PathBuf,
    /// Of the bytes that were read.
    pub hash: Hash,
}

impl InputFile {
    pub(super) fn new(folder: &Path, name: &str, hash: Hash) -> Self {
        Self { name: name.to_owned(), path: folder.join(name), hash }
    }
}

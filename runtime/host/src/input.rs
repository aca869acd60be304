//! Reads files from disc: scenes and the files they use, meshes, tables, checkpoints, results.
//!
//! Promises: only regular files are opened, so a pipe or device can neither block the program nor fill its memory; the
//! size is compared with the available memory first, and no more bytes than that are read. Does not interpret the
//! content; which files a scene may name is decided by [`crate::reading`].

use std::{
    fs::{File, FileType, Metadata},
    io::{ErrorKind, Read},
    path::Path,
};

use crate::memory::{TooMuchMemory, claim};

/// What a file is read for: its noun in messages, and the memory its content needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputKind {
    /// A scene, or a text that it uses.
    Scene,
    /// A mesh.
    Mesh,
    /// Values at positions: data, starts.
    Values,
    /// What an earlier run wrote: checkpoints, tables of a sweep, reports, result files.
    Results,
}

impl InputKind {
    /// Bytes that are needed for each byte of the file: its content, and what is made of it while it is held. Measured
    /// on long sums, ASCII meshes and tables of random numbers.
    fn bytes_per_byte(self) -> u64 {
        match self {
            InputKind::Scene => 40,
            InputKind::Mesh => 4,
            InputKind::Values => 3,
            InputKind::Results => 2,
        }
    }

    fn noun(self) -> &'static str {
        match self {
            InputKind::Scene => "a scene of this size",
            InputKind::Mesh => "a mesh file of this size",
            InputKind::Values => "a table of this size",
            InputKind::Results => "a result file of this size",
        }
    }
}

/// A file that cannot be read. The words can stand behind "cannot read FILE: ".
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// There is none.
    #[error("there is no such file")]
    NotFound,
    /// It is something else than a regular file.
    #[error("it is {0}, a file is needed")]
    NotAFile(&'static str),
    /// Its content does not fit into the memory.
    #[error(transparent)]
    TooLarge(#[from] TooMuchMemory),
    /// Somebody else writes to it.
    #[error("its size changed while it was read (it had {expected} bytes)")]
    Changed {
        /// Bytes that it had.
        expected: u64,
    },
    /// It is no text.
    #[error("it is a binary file (byte {at} is 0), a text is needed")]
    Binary {
        /// Place of the first byte that is 0.
        at: usize,
    },
    /// It is text of another coding.
    #[error("it is not UTF-8 text (byte {at} is no character)")]
    NotText {
        /// Place of the first byte that is no character.
        at: usize,
    },
    /// The user may not read it.
    #[error("permission denied")]
    Denied,
    /// The system says something else.
    #[error(transparent)]
    Io(std::io::Error),
}

impl From<std::io::Error> for InputError {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            ErrorKind::NotFound => InputError::NotFound,
            ErrorKind::IsADirectory => InputError::NotAFile("a directory"),
            ErrorKind::PermissionDenied => InputError::Denied,
            _ => InputError::Io(error),
        }
    }
}

/// The bytes of a regular file.
///
/// # Errors
/// [`InputError`]; nothing is read from what is no regular file.
pub fn read_input(path: &Path, kind: InputKind) -> Result<Vec<u8>, InputError> {
    // asked before opening: opening a pipe waits for a writer
    regular(&path.metadata()?)?;
    let file = File::open(path)?;
    let size = regular(&file.metadata()?)?;
    claim(size.saturating_mul(kind.bytes_per_byte()), kind.noun())?;
    let changed = InputError::Changed { expected: size };
    let mut bytes = Vec::new();
    let length = usize::try_from(size).unwrap_or(usize::MAX);
    if bytes.try_reserve_exact(length.saturating_add(1)).is_err() {
        return Err(InputError::Io(ErrorKind::OutOfMemory.into()));
    }
    // one byte more tells a file that grows; no file can make this read more than it said
    file.take(size.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() == length { Ok(bytes) } else { Err(changed) }
}

/// The text of a regular file.
///
/// # Errors
/// As [`read_input`], and for what is no UTF-8 text.
pub fn read_text(path: &Path, kind: InputKind) -> Result<String, InputError> {
    let bytes = read_input(path, kind)?;
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        return Err(InputError::Binary { at });
    }
    String::from_utf8(bytes).map_err(|e| InputError::NotText { at: e.utf8_error().valid_up_to() })
}

/// The bytes of a file, or an error if it is no regular file.
fn regular(metadata: &Metadata) -> Result<u64, InputError> {
    if metadata.is_file() { Ok(metadata.len()) } else { Err(InputError::NotAFile(name_of(metadata.file_type()))) }
}

fn name_of(kind: FileType) -> &'static str {
    if kind.is_dir() {
        return "a directory";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a named pipe";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
        if kind.is_socket() {
            return "a socket";
        }
    }
    "no regular file"
}

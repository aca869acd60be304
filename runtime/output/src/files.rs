//! Reading and writing single files of a results folder.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use wfl_host::input::{InputKind, read_input};

use super::OutputError;
use super::hash::{Hash, Hasher};
use super::manifest::{Content, MANIFEST_FILE, Manifest, Unusable};

/// Bytes gathered before they go to the system.
pub(super) const BUFFER: usize = 1 << 17;
/// Files synced at the same time: with 8 the system needs twice as long for 300 of them, with more as long.
const SYNCS_AT_ONCE: usize = 32;

/// The manifest of a folder, if there is one.
pub(super) fn read_manifest(folder: &Path) -> Result<Option<Manifest>, OutputError> {
    let file = folder.join(MANIFEST_FILE);
    let bytes = match fs::symlink_metadata(&file) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Ok(found) if !found.is_file() => return Err(OutputError::Foreign { file, what: "is no plain file" }),
        _ => read_input(&file, InputKind::Results),
    };
    let bytes =
        bytes.map_err(|e| OutputError::Manifest { file: file.clone(), what: format!("cannot be read: {e}") })?;
    let what = match Manifest::read(&bytes) {
        Ok(manifest) => return Ok(Some(manifest)),
        Err(Unusable::Foreign) => return Err(OutputError::Foreign { file, what: "is no manifest of this program" }),
        Err(Unusable::Format(format)) => format!("was written by another version (layout {format})"),
        Err(Unusable::Line(line)) => format!("is damaged: line {line} is not what was written"),
        Err(Unusable::Cut) => "is damaged: its end is missing".to_owned(),
    };
    Err(OutputError::Manifest { file, what })
}

/// The path of a file that has one of the contents; any, where there are none. `None` if it is not there.
pub(super) fn check_file(file: &Path, contents: &[Content]) -> Result<Option<PathBuf>, OutputError> {
    let damaged = |what: String| OutputError::Damaged { file: file.to_path_buf(), what };
    let found = match fs::symlink_metadata(file) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(damaged(e.to_string())),
        Ok(found) if !found.is_file() => return Err(damaged("it is no plain file".to_owned())),
        Ok(found) => found.len(),
    };
    // the caller knows what is to be compared of a file without a size
    let Some(size) = contents.last().and_then(|c| c.size) else { return Ok(Some(file.to_path_buf())) };
    if contents.iter().all(|c| c.size != Some(found)) {
        return Err(damaged(format!("it has {found} bytes, {size} were written")));
    }
    let hash = hash_of(file).map_err(|e| damaged(e.to_string()))?;
    if contents.contains(&Content { size: Some(found), hash }) {
        return Ok(Some(file.to_path_buf()));
    }
    Err(damaged("its content is not what was written".to_owned()))
}

fn hash_of(file: &Path) -> io::Result<Hash> {
    let (mut file, mut hasher, mut buffer) = (File::open(file)?, Hasher::default(), vec![0; BUFFER]);
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(hasher.end()),
            n => hasher.add(&buffer[..n]),
        }
    }
}

/// Hashes what goes into a file.
struct Counted {
    file: File,
    size: u64,
    hasher: Hasher,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.file.write(bytes)?;
        self.hasher.add(&bytes[..n]);
        self.size += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Fills a file by `write` and flushes it.
pub(super) fn fill(file: File, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<Content> {
    let counted = Counted { file, size: 0, hasher: Hasher::default() };
    let mut buffered = BufWriter::with_capacity(BUFFER, counted);
    write(&mut buffered)?;
    let Counted { size, hasher, .. } = buffered.into_inner().map_err(|error| error.into_error())?;
    Ok(Content { size: Some(size), hash: hasher.end() })
}

/// Syncs files, as many at a time as the system gains from.
pub(super) fn sync_all(files: &[PathBuf]) -> Result<(), OutputError> {
    let sync = |file: &PathBuf| {
        // a handle that may write: some systems sync through no other
        let synced = OpenOptions::new().write(true).open(file).and_then(|f| f.sync_all());
        synced.map_err(|source| OutputError::Write { file: file.clone(), source })
    };
    let next = AtomicUsize::new(0);
    let work = || loop {
        match files.get(next.fetch_add(1, Ordering::Relaxed)) {
            Some(file) => sync(file)?,
            None => return Ok(()),
        }
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..files.len().min(SYNCS_AT_ONCE)).map(|_| scope.spawn(work)).collect();
        let own = work();
        let joined = others.into_iter().map(|o| o.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        joined.fold(own, Result::and)
    })
}

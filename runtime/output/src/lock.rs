//! One writer a folder.
//!
//! Promises: while a [`Lock`] lives no other process gets one of the same folder, where the system can lock files; the
//! system releases it when its process ends in any way, so that nobody has to remove it. The file
//! goes with the lock. Does not keep two systems apart that share a folder without shared locks.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, Read, Seek, Write},
    path::{Path, PathBuf},
};

use super::{OutputError, names::is_temporary_of};

/// The file that is locked: it names the process that writes into the folder.
pub(super) const LOCK_FILE: &str = ".wfl-lock";

/// The right to write into a folder.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    /// `None` where the system cannot lock files: there the user takes care.
    file: Option<File>,
}

impl Lock {
    /// Takes the lock of a folder.
    ///
    /// # Errors
    /// [`OutputError::InUse`], [`OutputError::NotWritable`], [`OutputError::Foreign`] where the name is taken by
    /// something that is no plain file.
    pub(super) fn take(folder: &Path) -> Result<Self, OutputError> {
        let path = folder.join(LOCK_FILE);
        let failed = |source| OutputError::NotWritable { path: folder.to_path_buf(), source };
        loop {
            let mut file = open(&path)
                .map_err(failed)?
                .ok_or_else(|| OutputError::Foreign { file: path.clone(), what: "is no plain file" })?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(OutputError::InUse { path: folder.to_path_buf(), by: holder(&mut file) });
                }
                Err(TryLockError::Error(_)) => return Ok(Self { path, file: None }),
            }
            // the former holder may have removed the file between our opening and locking it
            if is_at(&file, &path) {
                let text = named(std::process::id());
                // best effort: on a full disc the lock holds without a name
                drop(file.set_len(0).and_then(|()| file.write_all(text.as_bytes())));
                return Ok(Self { path, file: Some(file) });
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // best effort: a file that stays is taken over by the next writer
        if self.file.is_some() {
            drop(fs::remove_file(&self.path));
        }
    }
}

/// Removes what this process would have removed from a folder had it not been interrupted: temporary files and the
/// lock.
pub fn abandon(folder: &Path) {
    let names =
        fs::read_dir(folder).into_iter().flatten().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let own = |name: &String| is_temporary_of(name, std::process::id());
    // best effort: what stays is removed by the next writer
    names.filter(own).for_each(|name| drop(fs::remove_file(folder.join(name))));
    let lock = folder.join(LOCK_FILE);
    if fs::read_to_string(&lock).is_ok_and(|text| text == named(std::process::id())) {
        drop(fs::remove_file(lock));
    }
}

/// What the file says of the process that holds the lock.
fn named(process: u32) -> String {
    format!("process {process}\n")
}

/// Opens the file or makes it; `None` if the name is taken by a link, a folder or a device.
fn open(path: &Path) -> io::Result<Option<File>> {
    match OpenOptions::new().read(true).write(true).create_new(true).open(path) {
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => match open_there(path) {
            // gone between the two calls
            Err(e) if e.kind() == io::ErrorKind::NotFound => open(path),
            other => other,
        },
        other => other.map(Some),
    }
}

fn open_there(path: &Path) -> io::Result<Option<File>> {
    if !fs::symlink_metadata(path)?.is_file() {
        return Ok(None);
    }
    OpenOptions::new().read(true).write(true).open(path).map(Some)
}

/// Who holds the lock, as the file says.
fn holder(file: &mut File) -> String {
    /// Bytes of the name of a process.
    const MOST: u64 = 64;
    let mut text = String::new();
    let read = file.rewind().and_then(|()| file.take(MOST).read_to_string(&mut text));
    let text = text.trim();
    let is_one = text.strip_prefix("process ").is_some_and(|n| n.parse::<u32>().is_ok());
    if read.is_ok() && is_one { text.to_owned() } else { "another process".to_owned() }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |m: fs::Metadata| (m.dev(), m.ino());
    file.metadata().map(id).ok() == fs::symlink_metadata(path).map(id).ok()
}

/// Elsewhere a file that is open cannot be removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::super::scratch::Scratch;
    use super::*;

    #[test]
    fn a_second_writer_is_told_who_the_first_is_and_a_dead_one_is_taken_over() {
        let scratch = Scratch::new();
        // what a killed process leaves
        fs::write(scratch.path().join(LOCK_FILE), "process 999999\nand more").unwrap();
        let first = Lock::take(scratch.path()).unwrap();
        match Lock::take(scratch.path()) {
            Err(OutputError::InUse { by, .. }) => assert_eq!(by, format!("process {}", std::process::id())),
            other => panic!("{other:?}"),
        }
        drop(first);
        assert_eq!(scratch.names(), [""; 0]);
        assert!(Lock::take(scratch.path()).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_not_followed() {
        let scratch = Scratch::new();
        let victim = scratch.path().join("victim");
        for target in ["victim", "nowhere"] {
            fs::write(&victim, "mine").unwrap();
            std::os::unix::fs::symlink(target, scratch.path().join(LOCK_FILE)).unwrap();
            assert!(matches!(Lock::take(scratch.path()), Err(OutputError::Foreign { .. })));
            assert_eq!(fs::read_to_string(&victim).unwrap(), "mine");
            fs::remove_file(scratch.path().join(LOCK_FILE)).unwrap();
        }
        assert_eq!(scratch.names(), ["victim"]);
    }
}

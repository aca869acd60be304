//! Which files a scene may read: meshes, data, initial values, other scenes.
//!
//! A scene may come from another author. It reads files in its own folder and below, or in a folder that was allowed by
//! name ([`allow`]); links are resolved first. Any other file is refused before it is opened, so no message can show
//! its content. How a file is opened and read is the task of [`crate::input`].

use std::{
    io::ErrorKind,
    path::{Component, Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use thiserror::Error;

use crate::input::{InputError, InputKind, read_input, read_text};

/// Folders that every scene of this process may read from, with all links followed.
static ALLOWED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Lets scenes read the files of a folder and below.
///
/// # Errors
/// There is no such folder.
pub fn allow(folder: &Path) -> std::io::Result<()> {
    let folder = plain(folder).canonicalize()?;
    if !folder.is_dir() {
        return Err(ErrorKind::NotADirectory.into());
    }
    let mut allowed = ALLOWED.lock().unwrap_or_else(PoisonError::into_inner);
    if !allowed.contains(&folder) {
        allowed.push(folder);
    }
    Ok(())
}

/// Why a scene gets no file.
#[derive(Debug, Error)]
pub enum ReadingError {
    /// It lies where the scene may not read; nothing was opened.
    #[error("it lies outside the folder of the scene")]
    Outside {
        /// The folder to be allowed, as it can be typed.
        folder: PathBuf,
    },
    /// It cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
}

impl ReadingError {
    /// What to type so that the file may be read.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            ReadingError::Outside { folder } => Some(format!(
                "a scene reads its own folder and below; to allow this one: --allow-read {}",
                plain(folder).display()
            )),
            _ => None,
        }
    }
}

/// The file that a text in `folder` calls `name`, if a scene in the folder `scene` may read it: its place with all
/// links followed.
///
/// # Errors
/// [`ReadingError`]; a file outside is not looked at, not even whether it exists.
pub fn locate(scene: &Path, folder: &Path, name: &str) -> Result<PathBuf, ReadingError> {
    let root = plain(scene).canonicalize().map_err(InputError::from)?;
    let named = folder.join(name);
    let parent = || tidied(&named).parent().map(Path::to_path_buf).unwrap_or_default();
    let from = plain(folder).canonicalize().map_err(InputError::from)?;
    if !is_inside(&tidied(&from.join(name)), &root) {
        return Err(ReadingError::Outside { folder: parent() });
    }
    let real = from.join(name).canonicalize().map_err(InputError::from)?;
    if !is_inside(&real, &root) {
        return Err(ReadingError::Outside { folder: real.parent().map(Path::to_path_buf).unwrap_or_default() });
    }
    Ok(real)
}

/// The bytes of a file that a scene names; see [`locate`].
///
/// # Errors
/// [`ReadingError`].
pub fn bytes(scene: &Path, folder: &Path, name: &str, kind: InputKind) -> Result<Vec<u8>, ReadingError> {
    Ok(read_input(&locate(scene, folder, name)?, kind)?)
}

/// The text of a file that a scene names; see [`locate`].
///
/// # Errors
/// [`ReadingError`].
pub fn text(scene: &Path, folder: &Path, name: &str, kind: InputKind) -> Result<String, ReadingError> {
    Ok(read_text(&locate(scene, folder, name)?, kind)?)
}

/// A word of a file as a message may show it: a short one made of the signs of numbers, else only its length.
#[must_use]
pub fn excerpt(word: &str) -> String {
    /// More is no slip in a number.
    const LONGEST: usize = 24;
    let like_a_number = word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
        && word.chars().all(|c| c.is_ascii_digit() || "+-.,eEdD_".contains(c));
    if like_a_number && word.len() <= LONGEST {
        return format!("`{word}`");
    }
    match word.chars().count() {
        1 => "a text of 1 character".to_owned(),
        n => format!("a text of {n} characters"),
    }
}

fn is_inside(file: &Path, root: &Path) -> bool {
    let allowed = ALLOWED.lock().unwrap_or_else(PoisonError::into_inner);
    file.starts_with(root) || allowed.iter().any(|folder| file.starts_with(folder))
}

/// The path of a folder that may be empty: the current one.
fn plain(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// A path with `.` and `..` worked out as written.
fn tidied(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            Component::ParentDir if out.has_root() => {}
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_reads_its_folder_and_what_is_allowed() {
        let base = std::env::temp_dir().join(format!("wfl-reading-{}", std::process::id()));
        let (scene, beside) = (base.join("scene"), base.join("beside"));
        std::fs::create_dir_all(scene.join("inner")).expect("a folder");
        std::fs::create_dir_all(&beside).expect("a folder");
        std::fs::write(scene.join("inner/a"), "a").expect("a file");
        std::fs::write(beside.join("b"), "b").expect("a file");
        let read = |name: &str| text(&scene, &scene, name, InputKind::Scene);
        assert_eq!(read("inner/a").ok().as_deref(), Some("a"));
        assert_eq!(read("inner/../inner/./a").ok().as_deref(), Some("a"));
        // a text in a folder below may go back up, as far as the folder of the scene
        assert_eq!(text(&scene, &scene.join("inner"), "../inner/a", InputKind::Scene).ok().as_deref(), Some("a"));
        let absolute = beside.join("b").display().to_string();
        for name in ["../beside/b", "../beside/missing", "inner/../../beside/b", absolute.as_str(), "/dev/zero"] {
            assert!(matches!(read(name), Err(ReadingError::Outside { .. })), "{name}");
        }
        assert!(matches!(read("missing"), Err(ReadingError::Input(InputError::NotFound))));
        assert!(matches!(read("inner"), Err(ReadingError::Input(InputError::NotAFile(_)))));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(beside.join("b"), scene.join("link")).expect("a link");
            assert!(matches!(read("link"), Err(ReadingError::Outside { .. })));
        }
        allow(&beside).expect("a folder");
        assert_eq!(read("../beside/b").ok().as_deref(), Some("b"));
        assert!(allow(&beside.join("b")).is_err() && allow(&base.join("missing")).is_err());
        std::fs::remove_dir_all(&base).expect("removed");
    }

    #[test]
    fn only_words_like_numbers_are_shown() {
        assert_eq!(excerpt("1.2.3"), "`1.2.3`");
        assert_eq!(excerpt("root:x:0"), "a text of 8 characters");
        assert_eq!(excerpt(&"1".repeat(30)), "a text of 30 characters");
    }
}

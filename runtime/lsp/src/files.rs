//! The texts that are open, and which files use which: a file that others use is understood as a part of them.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use wfl_host::input::InputKind;
use wfl_tasks::scene_file::{OpenTexts, plain_path, read_text};

/// Folders above the one of a file in which scenes that use it are looked for: a scene uses files of its own folder and
/// below, rarely deeper than this.
const FOLDERS_ABOVE: usize = 2;

/// Files of a folder that are looked at; a folder of more is no folder of scenes written by hand.
const MOST_FILES: usize = 1000;

/// Open texts, and the files around them.
#[derive(Default)]
pub(crate) struct Files {
    pub(crate) open: OpenTexts,
    /// The files that each file uses, of those that were looked at.
    uses: BTreeMap<PathBuf, Vec<PathBuf>>,
    /// Folders that were looked through.
    known: BTreeSet<PathBuf>,
}

impl Files {
    /// A text was opened or changed.
    pub(crate) fn set(&mut self, path: &Path, text: String) {
        self.uses.insert(path.to_owned(), used(path, &text));
        self.open.insert(path.to_owned(), text);
        let mut folder = path.parent();
        for _ in 0..=FOLDERS_ABOVE {
            let Some(here) = folder else { break };
            self.look_through(here);
            folder = here.parent();
        }
    }

    /// A text was closed: what is on disc counts again.
    pub(crate) fn close(&mut self, path: &Path) {
        self.open.remove(path);
        self.forget();
    }

    /// Files may have changed on disc.
    pub(crate) fn forget(&mut self) {
        let open = &self.open;
        self.uses.retain(|path, _| open.contains_key(path));
        self.known.clear();
        let folders: Vec<PathBuf> = self.open.keys().filter_map(|p| p.parent().map(Path::to_owned)).collect();
        for folder in folders {
            for above in folder.ancestors().take(FOLDERS_ABOVE + 1) {
                self.look_through(above);
            }
        }
    }

    fn look_through(&mut self, folder: &Path) {
        if !self.known.insert(folder.to_owned()) {
            return;
        }
        let Ok(entries) = std::fs::read_dir(folder) else { return };
        let mut scenes: Vec<PathBuf> = entries
            .take(MOST_FILES)
            .filter_map(|e| Some(e.ok()?.path()))
            .filter(|p| p.extension().is_some_and(|e| e == "wfl"))
            .collect();
        scenes.sort();
        for path in scenes {
            // a file that cannot be read uses nothing
            if !self.uses.contains_key(&path)
                && let Ok(text) = read_text(&path, InputKind::Scene)
            {
                self.uses.insert(path.clone(), used(&path, &text));
            }
        }
    }

    /// The scenes that a file is part of, open ones first; the file itself if no other uses it.
    pub(crate) fn roots(&self, path: &Path) -> Vec<PathBuf> {
        let mut seen: BTreeSet<&Path> = BTreeSet::from([path]);
        let mut waiting = vec![path];
        let mut roots = Vec::new();
        while let Some(file) = waiting.pop() {
            let users: Vec<&PathBuf> =
                self.uses.iter().filter(|(_, u)| u.iter().any(|u| u == file)).map(|u| u.0).collect();
            if users.is_empty() {
                roots.push(file.to_owned());
            }
            waiting.extend(users.into_iter().map(PathBuf::as_path).filter(|user| seen.insert(user)));
        }
        roots.sort_by_key(|root| (!self.open.contains_key(root), root.clone()));
        // files that use each other in a circle have no root
        if roots.is_empty() { vec![path.to_owned()] } else { roots }
    }

    /// The scene in which a file is understood.
    pub(crate) fn root(&self, path: &Path) -> PathBuf {
        self.roots(path).swap_remove(0)
    }

    /// Scenes and files of scenes that lie beside a file, for `use`.
    pub(crate) fn beside(&self, path: &Path) -> Vec<PathBuf> {
        let same = |p: &&PathBuf| p.parent() == path.parent() && p.as_path() != path;
        self.uses.keys().filter(same).cloned().collect()
    }
}

/// The files that a text uses, seen from the folder of its file.
fn used(path: &Path, text: &str) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = |line: &str| {
        let quoted = line.strip_prefix("use")?.trim_start().strip_prefix('"')?;
        let name = quoted.split('"').next()?;
        let ending = if name.ends_with(".wfl") { "" } else { ".wfl" };
        Some(plain_path(&folder.join(format!("{name}{ending}"))))
    };
    text.lines().filter_map(name).collect()
}

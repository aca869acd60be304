//! What the server knows, and how it comes to know it: a text changes, its scenes are read again, messages go out.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    process::Command,
};

use crossbeam_channel::Sender;
use lsp_server::{Message, Notification};
use lsp_types::{MessageType, PublishDiagnosticsParams, ShowMessageParams, Uri};
use serde::Serialize;

use crate::{
    Options,
    analysis::Analysis,
    check::{Broken, Found, Job},
    features::diagnostics,
    files::Files,
    places,
    symbols::Key,
};

/// What the server knows.
pub(crate) struct State {
    editor: Sender<Message>,
    options: Options,
    pub(crate) files: Files,
    /// The versions of open texts, as the editor counts them: messages say which one they are about.
    versions: BTreeMap<PathBuf, i32>,
    /// Scenes by their files, as their texts are now.
    analyses: BTreeMap<PathBuf, Analysis>,
    /// The last check of each scene.
    checks: BTreeMap<PathBuf, Found>,
    /// Scenes whose last check broke down: that is told once, not at every keystroke.
    broken: BTreeSet<PathBuf>,
    /// What has messages by scene: they are taken back when there are none.
    told: BTreeMap<PathBuf, BTreeSet<PathBuf>>,
    jobs: Sender<Job>,
    /// Where runs tell how they ended.
    runs: Sender<Ended>,
}

/// How a run ended, as it is shown.
pub(crate) struct Ended {
    pub(crate) typ: MessageType,
    pub(crate) message: String,
}

impl State {
    pub(crate) fn new(editor: Sender<Message>, options: Options, jobs: Sender<Job>, runs: Sender<Ended>) -> Self {
        Self {
            editor,
            options,
            files: Files::default(),
            versions: BTreeMap::new(),
            analyses: BTreeMap::new(),
            checks: BTreeMap::new(),
            broken: BTreeSet::new(),
            told: BTreeMap::new(),
            jobs,
            runs,
        }
    }

    pub(crate) fn send(&self, message: impl Into<Message>) {
        // an editor that does not listen is gone; the loop ends with the next message
        let _ = self.editor.send(message.into());
    }

    fn notify(&self, method: &str, params: impl Serialize) {
        self.send(Notification::new(method.to_owned(), params));
    }

    /// Shows a line to the user.
    pub(crate) fn show(&self, typ: MessageType, message: String) {
        self.notify("window/showMessage", ShowMessageParams { typ, message });
    }

    /// A text was opened or changed.
    pub(crate) fn text(&mut self, uri: &Uri, text: String, version: i32) {
        let Some(path) = places::file(uri) else { return };
        self.versions.insert(path.clone(), version);
        self.files.set(&path, text);
        let mut roots: BTreeSet<PathBuf> = BTreeSet::from([self.files.root(&path)]);
        // other open scenes may use this text, too
        roots.extend(self.files.roots(&path).into_iter().filter(|r| self.files.open.contains_key(r)));
        for root in roots {
            self.refresh(&root);
        }
    }

    /// A text was closed.
    pub(crate) fn close(&mut self, uri: &Uri) {
        let Some(path) = places::file(uri) else { return };
        self.versions.remove(&path);
        self.files.close(&path);
        self.refresh_all();
    }

    /// Reads all open scenes again, and forgets those that are not open any more.
    pub(crate) fn refresh_all(&mut self) {
        let roots: BTreeSet<PathBuf> = self.files.open.keys().map(|path| self.files.root(path)).collect();
        let gone: Vec<PathBuf> = self.told.keys().filter(|r| !roots.contains(*r)).cloned().collect();
        for root in gone {
            self.analyses.remove(&root);
            self.checks.remove(&root);
            self.publish(&root);
        }
        for root in roots {
            self.refresh(&root);
        }
    }

    /// Reads a scene again, tells what its text shows, and asks for the rest.
    fn refresh(&mut self, root: &Path) {
        let dim = self.checks.get(root).and_then(|c| c.problem.as_ref()).map(|p| p.dim);
        match Analysis::new(root, &self.files.open, dim) {
            Ok(analysis) => self.analyses.insert(root.to_owned(), analysis),
            Err(_) => self.analyses.remove(root),
        };
        self.publish(root);
        self.check(self.job(root));
    }

    /// Checks a scene for someone who is shown the outcome.
    pub(crate) fn ask(&self, root: &Path) {
        self.check(Job { asked: true, ..self.job(root) });
    }

    /// A check of a scene as its texts are now.
    fn job(&self, root: &Path) -> Job {
        Job { root: root.to_owned(), open: self.files.open.clone(), asked: false }
    }

    fn check(&self, job: Job) {
        // the loop ends where the thread has
        let _ = self.jobs.send(job);
    }

    /// The check of a scene has ended.
    pub(crate) fn checked(&mut self, found: Found) {
        let root = found.root.clone();
        self.broken.remove(&root);
        if found.asked {
            self.show(MessageType::INFO, outcome(&found));
        }
        let new_dim = found.problem.as_ref().map(|p| p.dim);
        self.checks.insert(root.clone(), found);
        let known = self.analyses.get(&root).map(|a| a.dim);
        if known.is_some_and(|dim| new_dim.is_some() && dim != new_dim)
            && let Ok(analysis) = Analysis::new(&root, &self.files.open, new_dim)
        {
            self.analyses.insert(root.clone(), analysis);
        }
        if known.is_some() {
            self.publish(&root);
        }
    }

    /// The check of a scene has broken down: what the text alone shows stays.
    pub(crate) fn broke_down(&mut self, broken: &Broken) {
        if self.broken.insert(broken.root.clone()) || broken.asked {
            let message = format!(
                "{}: the check broke down, which is a mistake of this program ({}); the messages are those of the text alone",
                name_of(&broken.root),
                broken.why
            );
            self.show(MessageType::ERROR, message);
        }
    }

    /// The last check of a scene, if its texts have not changed since.
    pub(crate) fn check_of(&self, root: &Path) -> Option<&Found> {
        let (found, analysis) = (self.checks.get(root)?, self.analyses.get(root)?);
        let now = analysis.sources.iter().map(|(_, s)| (&s.name, &s.text));
        let same = found.texts.iter().map(|t| (&t.0, &t.1)).eq(now);
        same.then_some(found)
    }

    /// The scene in which a file is understood, with its file.
    pub(crate) fn analysis(&self, path: &Path) -> Option<(PathBuf, &Analysis)> {
        let root = self.files.root(path);
        let analysis = self.analyses.get(&root)?;
        Some((root, analysis))
    }

    /// All scenes that know a name of the scene `root`: files that it stands in may belong to several, which then have to
    /// agree on it.
    pub(crate) fn each_scene_with(&self, root: &Path, key: &Key, f: &mut dyn FnMut(&Analysis)) {
        let mut seen: BTreeSet<PathBuf> = BTreeSet::from([root.to_owned()]);
        let mut waiting = vec![root.to_owned()];
        while let Some(root) = waiting.pop() {
            let read;
            let analysis = match self.analyses.get(&root) {
                Some(analysis) => analysis,
                None => match Analysis::new(&root, &self.files.open, None) {
                    Ok(made) => {
                        read = made;
                        &read
                    }
                    Err(_) => continue,
                },
            };
            f(analysis);
            for (id, path) in analysis.own_files() {
                if analysis.names().of(id).iter().any(|o| o.key == *key) {
                    let others = self.files.roots(&path).into_iter();
                    waiting.extend(others.filter(|other| seen.insert(other.clone())));
                }
            }
        }
    }

    /// Tells the messages of a scene, file by file; a file of several scenes has those of the first.
    fn publish(&mut self, root: &Path) {
        let mut by_file: BTreeMap<PathBuf, Vec<lsp_types::Diagnostic>> = BTreeMap::new();
        if let Some(analysis) = self.analyses.get(root) {
            let messages = self.check_of(root).map_or(&analysis.messages, |found| &found.messages);
            for (id, path) in analysis.own_files() {
                if self.files.root(&path) == root {
                    by_file.insert(path, diagnostics::of_file(analysis, id, messages));
                }
            }
        }
        let before = self.told.remove(root).unwrap_or_default();
        for path in before.into_iter().filter(|p| !by_file.contains_key(p)) {
            // another scene may have taken the file over
            let owner = self.files.root(&path);
            if owner == root || !self.told.get(&owner).is_some_and(|t| t.contains(&path)) {
                self.publish_file(&path, Vec::new());
            }
        }
        self.told.insert(root.to_owned(), by_file.keys().cloned().collect());
        for (path, list) in by_file {
            self.publish_file(&path, list);
        }
    }

    fn publish_file(&self, path: &Path, diagnostics: Vec<lsp_types::Diagnostic>) {
        let Some(uri) = places::address(path) else { return };
        let params = PublishDiagnosticsParams { uri, diagnostics, version: self.versions.get(path).copied() };
        self.notify("textDocument/publishDiagnostics", params);
    }

    /// Runs a scene with the program of the options, and shows its last line when it has ended.
    pub(crate) fn run(&self, scene: &Path) -> Result<(), String> {
        let program = self.options.program.clone().ok_or("this server has no program to run scenes with")?;
        let ended = self.runs.clone();
        let scene = scene.to_owned();
        let thread = std::thread::Builder::new();
        let started = thread.spawn(move || {
            let folder = scene.parent().unwrap_or(Path::new(""));
            let ran = Command::new(program).arg("run").arg(&scene).current_dir(folder).output();
            let (typ, message) = match ran {
                Ok(ran) if ran.status.success() => (MessageType::INFO, last_line(&ran.stdout)),
                Ok(ran) => (MessageType::ERROR, first_line(&ran.stderr)),
                Err(e) => (MessageType::ERROR, format!("cannot start the run: {e}")),
            };
            // the server may have ended before the run
            let _ = ended.send(Ended { typ, message });
        });
        started.map(|_| ()).map_err(|e| format!("cannot start the run: {e}"))
    }
}

fn last_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).lines().next_back().unwrap_or("done").trim().to_owned()
}

fn first_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).lines().next().unwrap_or("the run failed").trim().to_owned()
}

fn name_of(scene: &Path) -> String {
    scene.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// What a check found, on a line.
fn outcome(found: &Found) -> String {
    let errors = found.messages.iter().filter(|d| d.is_error()).count();
    let warnings = found.messages.len() - errors;
    let name = name_of(&found.root);
    let what = match &found.problem {
        Some(p) => format!("{} cells, {} unknowns", p.cells, p.free),
        None => "no problem can be made of it".to_owned(),
    };
    let count = |n: usize, word: &str| format!("{n} {word}{}", if n == 1 { "" } else { "s" });
    format!("{name}: {}, {}; {what}", count(errors, "error"), count(warnings, "warning"))
}

//! A scene file, read: the file, the files it includes, the values given for its parameters, and its problem.
//!
//! Promises that every error is kept as a message with its place, so that later stages can add what they find. Does not
//! run and does not print.

use std::{
    collections::BTreeMap,
    path::{Component, Path, PathBuf},
    sync::Arc,
};

use wfl::{
    Code, DataValue, Diagnostic, Field, FieldKind, Loader, Override, ResolvedScript, Source, SourceId, SourceMap, Span,
    Unloaded,
    ast::{Place, Rank, Space},
    parse_expr, resolve,
};
use wfl_adapt::knobs::{self, KnobError, OF_STATEMENTS};
use wfl_compiler::backend::KernelBackend;
use wfl_discrete::pruning::Pruning;
use wfl_host::{
    input::{self, InputError, InputKind},
    reading::{self, ReadingError},
    team::Team,
};
use wfl_output::{
    About, Hash, OrderedMap, Report, SceneText,
    record::{self, Rounds, marks_of},
};
use wfl_problem::{Scene, ScenePart, prepare_part, prepare_refined};

/// A scene that was read, with its texts.
pub struct Loaded {
    /// Its texts.
    pub sources: SourceMap,
    /// What they say.
    pub script: ResolvedScript,
    /// Everything found so far; with an error among it there will be no scene.
    pub messages: Vec<Diagnostic>,
    /// The folder of the file.
    pub folder: PathBuf,
    /// The name of the file without its ending.
    pub name: String,
    /// Knobs of the command line that changed its statements, `NAME=VALUE`.
    pub knobs: Vec<String>,
    /// The refinement of its mesh that a knob gives.
    pub rounds: Rounds,
}

impl Loaded {
    /// The scene and the files it uses, by their names seen from its folder.
    #[must_use]
    pub fn texts(&self) -> OrderedMap<Hash> {
        let files = self.sources.iter().map(|(_, s)| s).filter(|s| s.name != COMMAND_LINE);
        let name = |s: &Source| {
            let path = Path::new(&s.name);
            path.strip_prefix(&self.folder).unwrap_or(path).display().to_string()
        };
        files.map(|s| (name(s), Hash::of(s.text.as_bytes()))).collect()
    }

    /// What else was given that changes numbers: knobs, and prunings that are put back.
    #[must_use]
    pub fn settings(&self, keep: &[Pruning]) -> OrderedMap<String> {
        let mut settings: OrderedMap<String> = OrderedMap::new();
        for (name, value) in self.knobs.iter().filter_map(|word| word.split_once('=')) {
            settings.insert(name, value);
        }
        if !keep.is_empty() {
            settings.insert("no_prune", keep.iter().map(|p| p.name()).collect::<Vec<_>>().join(","));
        }
        settings
    }

    /// What a report keeps of the scene.
    #[must_use]
    pub fn about(&self) -> About {
        let mut units = OrderedMap::default();
        for param in &self.script.params {
            if let Some(unit) = &param.unit {
                let text = self.sources.snippet(unit.span);
                units.insert(param.name.name.clone(), text.trim_matches(['[', ']', ' ']));
            }
        }
        for known in wfl::unit_report(&self.script, &self.sources) {
            units.insert(known.name, known.unit);
        }
        let mut descriptions = OrderedMap::default();
        for param in &self.script.params {
            if let Some(text) = &param.text {
                descriptions.insert(param.name.name.clone(), text.clone());
            }
        }
        let text = |(_, s): (_, &Source)| SceneText { name: s.name.clone(), text: s.text.to_string() };
        About {
            step_variable: self.script.steps.as_ref().map(|s| s.variable.name.clone()),
            units,
            descriptions,
            texts: self.sources.iter().map(text).collect(),
            marks: marks_of(&self.rounds),
        }
    }

    /// Leaves the values of these data fields and parameters to the caller, who gives them to the prepared scene
    /// ([`Scene::give_data`]). A parameter then is a data field of one number, which may change from step to step; so it
    /// cannot be part of what is fixed before a run, such as the mesh.
    ///
    /// # Errors
    /// The name of what is neither a data field nor a parameter of one number.
    pub fn leave_to_caller(&mut self, names: &[String]) -> Result<(), String> {
        for name in names {
            let field = self.script.fields.iter_mut().find(|f| f.name.name == *name);
            if let Some(field) = field {
                match &mut field.kind {
                    FieldKind::Data { value } => *value = DataValue::Caller,
                    _ => return Err(format!("`{name}` is not data: its first values are given as a start")),
                }
                continue;
            }
            let Some(k) = self.script.params.iter().position(|p| p.name.name == *name) else {
                let fields = self.script.fields.iter().filter(|f| matches!(f.kind, FieldKind::Data { .. }));
                let known = fields.map(|f| &f.name.name).chain(self.script.params.iter().map(|p| &p.name.name));
                let known = known.map(String::as_str).collect::<Vec<_>>().join(", ");
                return Err(format!("the scene has no data field and no parameter `{name}`; it has {known}"));
            };
            let param = self.script.params.remove(k);
            let span = param.name.span;
            let space =
                Space { rank: Rank::Scalar, element: None, place: Place::Global(span), unit: param.unit.clone(), span };
            let kind = FieldKind::Data { value: DataValue::Caller };
            self.script.fields.push(Field { name: param.name, kind, space, span });
        }
        Ok(())
    }

    /// The problem of the scene; what is in `keep` is done although it does not need it. All messages stay here, in the
    /// order of the text; with an error among them there is no problem.
    pub fn prepare(&mut self, backend: &dyn KernelBackend, keep: &[Pruning]) -> Option<Scene> {
        let prepared = prepare_refined(&self.script, &self.folder, backend, keep, &self.rounds);
        self.messages.extend(prepared.diagnostics);
        let place = |d: &Diagnostic| d.labels.first().map(|l| (l.span.source.index(), l.span.start));
        self.messages.sort_by_key(place);
        let has_error = self.messages.iter().any(Diagnostic::is_error);
        if has_error {
            // what a broken statement would have used is no leftover
            self.messages.retain(|d| d.code != Code::W702);
        }
        prepared.scene.filter(|_| !has_error)
    }

    /// The problem of one of several ranks that was sent a part of it ([`Scene::part_of`]), made by all of them together.
    ///
    /// # Errors
    /// What is wrong with the part: the first rank has told what is wrong with the scene.
    pub fn prepare_part(
        &self,
        backend: &dyn KernelBackend,
        keep: &[Pruning],
        bytes: &[u8],
        team: Arc<dyn Team>,
    ) -> Result<Scene, String> {
        let part = ScenePart::from_bytes(bytes).ok_or("the part of the scene is not what was sent")?;
        let prepared = prepare_part(&self.script, &self.folder, backend, keep, part, team);
        let why = prepared.diagnostics.iter().find(|d| d.is_error()).map(|d| d.message.clone());
        prepared.scene.ok_or_else(|| why.unwrap_or_else(|| "the part of the scene cannot be prepared".to_owned()))
    }
}

/// Texts by their files, which stand for what is on disc: those that are open in an editor.
pub type OpenTexts = BTreeMap<PathBuf, String>;

/// The path without `.` and without names that a `..` behind them takes back; nothing is asked of the disc.
#[must_use]
pub fn plain_path(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(plain.components().next_back(), Some(Component::Normal(_))) => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

/// Finds included files beside the file that includes them.
struct Files<'o> {
    /// The folder of the scene: what it uses lies there or below.
    scene: PathBuf,
    folders: BTreeMap<usize, PathBuf>,
    /// Folder of the file last read: texts are gone through as they are read, so a text not yet known is that one.
    last: PathBuf,
    /// Texts that stand for files.
    open: &'o OpenTexts,
}

impl Loader for Files<'_> {
    fn load(&mut self, path: &str, from: SourceId) -> Result<(String, String), Unloaded> {
        let folder = self.folders.entry(from.index()).or_insert_with(|| self.last.clone());
        let full = folder.join(path);
        let read = reading::text(&self.scene, folder, path, InputKind::Scene);
        let text = match (self.open.get(&plain_path(&full)), read) {
            (Some(open), Ok(_) | Err(ReadingError::Input(InputError::NotFound))) => open.clone(),
            (_, read) => read.map_err(unloaded)?,
        };
        self.last = full.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok((full.display().to_string(), text))
    }

    fn table(&mut self, path: &str) -> Result<String, Unloaded> {
        reading::text(&self.scene, &self.scene, path, InputKind::Values).map_err(unloaded)
    }
}

fn unloaded(e: ReadingError) -> Unloaded {
    Unloaded {
        why: e.to_string(),
        missing: matches!(e, ReadingError::Input(InputError::NotFound)),
        outside: matches!(e, ReadingError::Outside { .. }),
        help: e.help(),
    }
}

/// The text of a file, or why it cannot be read.
///
/// # Errors
/// In words, without the name of the file.
pub fn read_text(path: &Path, kind: InputKind) -> Result<String, String> {
    input::read_text(path, kind).map_err(|e| e.to_string())
}

/// Reads and resolves a scene with values for its parameters, `NAME=VALUE`; messages show these behind `command` of the
/// program. `more` are statements put behind the text of the scene.
///
/// # Errors
/// Why there is no text to check, in words; other errors are messages of what is returned.
pub fn read_scene(scene: &Path, overrides: &[String], command: &str, more: &str) -> Result<Loaded, String> {
    let mut text = read_text(scene, InputKind::Scene).map_err(|why| {
        let named = scene.with_extension("wfl");
        let help = if scene.extension().is_none() && named.is_file() {
            format!("\n  = help: wfl {command} {}", named.display())
        } else {
            String::new()
        };
        format!("cannot read {}: {why}{help}", scene.display())
    })?;
    if !more.is_empty() {
        text = format!("{}\n{more}", text.trim_end());
    }
    read_scene_text(scene, text, overrides, command)
}

/// [`read_scene`] of a text that stands in no file, or not as it is: `scene` is the name that messages show, and files are
/// found beside it.
///
/// # Errors
/// As [`read_scene`].
pub fn read_scene_text(scene: &Path, text: String, overrides: &[String], command: &str) -> Result<Loaded, String> {
    if text.trim().is_empty() {
        let help = "a scene has at least a mesh, an unknown and a term; the README shows one";
        return Err(format!("{} is empty\n  = help: {help}", scene.display()));
    }
    let mut sources = SourceMap::new();
    let main = sources.add(scene.display().to_string(), text);
    let mut diagnostics = Vec::new();
    let overrides = command_line(scene, overrides, command, &mut sources, &mut diagnostics);
    resolved(scene, sources, main, &overrides, diagnostics, &OpenTexts::new())
}

/// Reads and resolves a scene of which texts may be open in an editor: `open` is asked before the disc, by
/// [`plain_path`]. The text of the scene itself is there or on disc, and may be empty.
///
/// # Errors
/// Why there is no text to check, in words; other errors are messages of what is returned.
pub fn read_open_scene(scene: &Path, open: &OpenTexts) -> Result<Loaded, String> {
    let text = match open.get(&plain_path(scene)) {
        Some(text) => text.clone(),
        None => read_text(scene, InputKind::Scene).map_err(|why| format!("cannot read {}: {why}", scene.display()))?,
    };
    let mut sources = SourceMap::new();
    let main = sources.add(scene.display().to_string(), text);
    resolved(scene, sources, main, &[], Vec::new(), open)
}

/// Resolves the text `main` of a scene, with the messages so far.
fn resolved(
    scene: &Path,
    mut sources: SourceMap,
    main: SourceId,
    overrides: &[Override],
    mut diagnostics: Vec<Diagnostic>,
    open: &OpenTexts,
) -> Result<Loaded, String> {
    let folder = scene.parent().map(Path::to_path_buf).unwrap_or_default();
    let mut loader = Files {
        scene: folder.clone(),
        folders: BTreeMap::from([(main.index(), folder.clone())]),
        last: folder.clone(),
        open,
    };
    let checked = resolve(&mut sources, main, &mut loader, overrides);
    diagnostics.extend(checked.diagnostics);
    let name = scene.file_stem().map_or_else(|| "scene".to_owned(), |s| s.to_string_lossy().into_owned());
    // a script is always made, however many errors it has
    let script = checked.value.ok_or_else(String::new)?;
    Ok(Loaded { script, sources, messages: diagnostics, folder, name, knobs: Vec::new(), rounds: Rounds::new() })
}

/// Reads a scene with parameters and the knobs of statements: the setting of a sweep or a demanded accuracy can be run
/// again as it is written there. A word whose name is a parameter of the scene is that parameter.
///
/// # Errors
/// As [`read_scene`], and where a knob means nothing for the scene.
pub fn read_scene_with_knobs(scene: &Path, words: &[String], command: &str) -> Result<Loaded, String> {
    with_knobs(words, |params| read_scene(scene, params, command, ""))
}

/// The same of a text, see [`read_scene_text`].
///
/// # Errors
/// As [`read_scene_with_knobs`].
pub fn read_scene_text_with_knobs(scene: &Path, text: &str, words: &[String], command: &str) -> Result<Loaded, String> {
    with_knobs(words, |params| read_scene_text(scene, text.to_owned(), params, command))
}

/// Reads a scene with those of the words that are parameters, and applies the others.
fn with_knobs(words: &[String], read: impl Fn(&[String]) -> Result<Loaded, String>) -> Result<Loaded, String> {
    let name = |word: &str| word.split_once('=').map(|(name, _)| name.trim().to_owned());
    let is_knob = |word: &String| name(word).is_some_and(|n| OF_STATEMENTS.contains(&n.as_str()));
    let (mut knobs, mut params): (Vec<String>, Vec<String>) = words.iter().cloned().partition(is_knob);
    let mut loaded = read(&params)?;
    let named =
        |loaded: &Loaded, word: &str| loaded.script.params.iter().any(|p| name(word).is_some_and(|n| n == p.name.name));
    if knobs.iter().any(|word| named(&loaded, word)) {
        (params, knobs) = words.iter().cloned().partition(|word| !is_knob(word) || named(&loaded, word));
        loaded = read(&params)?;
    }
    let named = |words: &[String]| -> Vec<(String, String)> {
        let one = |word: &String| word.split_once('=').map(|(n, v)| (n.trim().to_owned(), v.trim().to_owned()));
        words.iter().filter_map(one).collect()
    };
    let (setting, given) = (named(&knobs), named(&params));
    let names: Vec<String> = given.iter().map(|(name, _)| name.clone()).collect();
    let all = [setting.as_slice(), given.as_slice()].concat();
    knobs::apply(&mut loaded.script, &all, &names, &[]).map_err(|why| match why {
        KnobError::Twice(_) => format!("[{}]: {why}", Code::E209),
        why => why.to_string(),
    })?;
    let rounds = rounds_of(&setting)?;
    Ok(Loaded { knobs, rounds, ..loaded })
}

/// The refinement of the mesh that a setting names: that in the report of a run with a demanded accuracy, or of one that
/// took it from there.
///
/// # Errors
/// Where there is no such report.
pub(crate) fn rounds_of(setting: &knobs::Setting) -> Result<Rounds, String> {
    let Some((_, path)) = setting.iter().find(|(name, _)| name == knobs::MARKS) else { return Ok(Rounds::new()) };
    let text = read_text(Path::new(path), InputKind::Results)?;
    let report: Report = serde_json::from_str(&text).map_err(|e| format!("{path} is no report of a run: {e}"))?;
    if report.about.marks.is_empty() {
        return Err(format!("{path} is the report of a run whose mesh was not refined for an accuracy"));
    }
    Ok(record::rounds_of(&report.about.marks))
}

/// The name of the text that holds the command line.
const COMMAND_LINE: &str = "(command line)";

/// The values given as NAME=VALUE; messages show them where they stand in the command line.
fn command_line(
    scene: &Path,
    words: &[String],
    command: &str,
    sources: &mut SourceMap,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Override> {
    let mut line = format!("wfl {command} {}", scene.display());
    let mut starts = Vec::new();
    for word in words {
        line.push(' ');
        starts.push(line.len());
        line.push_str(word);
    }
    let id = sources.add(COMMAND_LINE, line.as_str());
    let mut out = Vec::new();
    let mut taken = 0;
    for (k, (word, start)) in words.iter().zip(starts).enumerate() {
        if k < taken {
            continue;
        }
        if let Some((count, meant)) = apart(&words[k..]) {
            let text = words[k..k + count].join(" ");
            let d = Diagnostic::new(Code::E703, format!("`{text}` is not NAME=VALUE"));
            diagnostics.push(d.at(span(id, start, start + text.len()), "").help(format!("without spaces: {meant}")));
            taken = k + count;
            continue;
        }
        let span = span(id, start, start + word.len());
        match one_override(word, span, sources) {
            Ok(given) => out.push(given),
            Err(messages) => diagnostics.extend(messages),
        }
    }
    out
}

/// How many of the first words are one value whose parts stand apart, `gamma 3`, `gamma = 3`, `gamma= 3`, and what to
/// type.
fn apart(words: &[String]) -> Option<(usize, String)> {
    let is_name = |w: &str| {
        w.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && w.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    let first = words.first()?;
    let name = first.strip_suffix(['=', ':']).unwrap_or(first);
    if !is_name(name) {
        return None;
    }
    let signed = name.len() < first.len();
    let (count, value) = match words.get(1)?.as_str() {
        "=" | ":" if !signed => (3, words.get(2)?.as_str()),
        second if !signed && second.starts_with(['=', ':']) => (2, &second[1..]),
        second => (2, second),
    };
    (!value.is_empty() && !value.contains('=')).then(|| (count, format!("{name}={value}")))
}

fn span(source: SourceId, start: usize, end: usize) -> Span {
    let narrow = |x: usize| u32::try_from(x).unwrap_or(u32::MAX);
    Span { source, start: narrow(start), end: narrow(end) }
}

fn one_override(word: &str, whole: Span, sources: &SourceMap) -> Result<Override, Vec<Diagnostic>> {
    let wrong = |text: String, note: &str| Err(vec![Diagnostic::new(Code::E703, text).at(whole, "").help(note)]);
    let Some((name, value)) = word.split_once('=') else {
        return wrong(format!("`{word}` is not NAME=VALUE"), "gamma=1e6 replaces the value of param gamma");
    };
    if name.trim().is_empty() {
        return wrong("there is no name before `=`".to_owned(), "gamma=1e6 replaces the value of param gamma");
    }
    if value.trim().is_empty() {
        return wrong(
            format!("`{}` is given no value", name.trim()),
            "write the value right behind `=`; one with spaces in quotes: \"gamma=1e6 + 1\"",
        );
    }
    // The value is read from a text of blanks in which it stands where it stands in the command line, with the same
    // id: so the places of all its parts are right.
    let before = whole.start as usize + name.len() + 1;
    let line = format!("{}{value}", " ".repeat(before));
    let mut texts = SourceMap::new();
    for (k, _) in sources.iter() {
        let text = if k == whole.source { line.as_str() } else { "" };
        texts.add(COMMAND_LINE, text);
    }
    let parsed = parse_expr(&texts, whole.source);
    match parsed.value {
        Some(value) if parsed.diagnostics.iter().all(|d| !d.is_error()) => {
            Ok(Override { name: name.trim().to_owned(), value, span: whole })
        }
        _ => Err(parsed.diagnostics),
    }
}

//! Reading scenes: files, included files, parameters of the command line, and printing of messages.

use std::{
    collections::BTreeMap,
    io::{IsTerminal, Write},
    path::{Path, PathBuf},
};

use wfl::{
    Diagnostic, Loader, Override, ResolvedScript, Source, SourceId, SourceMap, Span, Unloaded, one_per_cause,
    parse_expr, render, resolve, visible,
};
use wfl_runtime::{
    Pruning,
    input::{self, InputError, InputKind},
    output::{Hash, OrderedMap},
    reading::{self, ReadingError},
};

/// A scene that was read, with its texts.
pub(crate) struct Loaded {
    pub(crate) sources: SourceMap,
    pub(crate) script: ResolvedScript,
    /// Everything found so far; with an error among it there will be no scene.
    pub(crate) messages: Vec<Diagnostic>,
    pub(crate) folder: PathBuf,
    pub(crate) name: String,
    /// Knobs of the command line that changed its statements, `NAME=VALUE`.
    pub(crate) knobs: Vec<String>,
}

impl Loaded {
    /// The scene and the files it uses, by their names seen from its folder.
    pub(crate) fn texts(&self) -> OrderedMap<Hash> {
        let files = self.sources.iter().map(|(_, s)| s).filter(|s| s.name != COMMAND_LINE);
        let name = |s: &Source| {
            let path = Path::new(&s.name);
            path.strip_prefix(&self.folder).unwrap_or(path).display().to_string()
        };
        files.map(|s| (name(s), Hash::of(s.text.as_bytes()))).collect()
    }

    /// What else was given that changes numbers: knobs, and prunings that are put back.
    pub(crate) fn settings(&self, keep: &[Pruning]) -> OrderedMap<String> {
        let mut settings: OrderedMap<String> = OrderedMap::new();
        for (name, value) in self.knobs.iter().filter_map(|word| word.split_once('=')) {
            settings.insert(name, value);
        }
        if !keep.is_empty() {
            settings.insert("no_prune", keep.iter().map(|p| p.name()).collect::<Vec<_>>().join(","));
        }
        settings
    }
}

/// Finds included files beside the file that includes them.
struct Files {
    /// The folder of the scene: what it uses lies there or below.
    scene: PathBuf,
    folders: BTreeMap<usize, PathBuf>,
    /// Folder of the file last read: texts are gone through as they are read, so a text not yet known is that one.
    last: PathBuf,
}

impl Loader for Files {
    fn load(&mut self, path: &str, from: SourceId) -> Result<(String, String), Unloaded> {
        let folder = self.folders.entry(from.index()).or_insert_with(|| self.last.clone());
        let full = folder.join(path);
        let text = reading::text(&self.scene, folder, path, InputKind::Scene).map_err(|e| Unloaded {
            why: e.to_string(),
            missing: matches!(e, ReadingError::Input(InputError::NotFound)),
            outside: matches!(e, ReadingError::Outside { .. }),
            help: e.help(),
        })?;
        self.last = full.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok((full.display().to_string(), text))
    }
}

/// The text of a file that the command line names, or why it cannot be read.
pub(crate) fn read_text(path: &Path, kind: InputKind) -> Result<String, String> {
    input::read_text(path, kind).map_err(|e| e.to_string())
}

/// Reads and resolves a scene. Prints why and returns `None` only if there is no text to check; other errors are kept, so
/// that the stages behind can add what they find.
pub(crate) fn load(scene: &Path, overrides: &[String], command: &str) -> Option<Loaded> {
    match read_scene(scene, overrides, command, "") {
        Ok(loaded) => Some(loaded),
        Err(why) => {
            if !why.is_empty() {
                say(&format!("error: {why}\n"));
            }
            None
        }
    }
}

/// The same without printing; `more` are statements put behind the text of the scene.
pub(crate) fn read_scene(scene: &Path, overrides: &[String], command: &str, more: &str) -> Result<Loaded, String> {
    let mut sources = SourceMap::new();
    let mut text = read_text(scene, InputKind::Scene).map_err(|why| {
        let named = scene.with_extension("wfl");
        let help = if scene.extension().is_none() && named.is_file() {
            format!("\n  = help: wfl {command} {}", named.display())
        } else {
            String::new()
        };
        format!("cannot read {}: {why}{help}", scene.display())
    })?;
    if text.trim().is_empty() {
        let help = "a scene has at least a mesh, an unknown and a term; the README shows one";
        return Err(format!("{} is empty\n  = help: {help}", scene.display()));
    }
    if !more.is_empty() {
        text = format!("{}\n{more}", text.trim_end());
    }
    let main = sources.add(scene.display().to_string(), text);
    let folder = scene.parent().map(Path::to_path_buf).unwrap_or_default();
    let mut diagnostics = Vec::new();
    let overrides = command_line(scene, overrides, command, &mut sources, &mut diagnostics);
    let mut loader = Files {
        scene: folder.clone(),
        folders: BTreeMap::from([(main.index(), folder.clone())]),
        last: folder.clone(),
    };
    let checked = resolve(&mut sources, main, &mut loader, &overrides);
    diagnostics.extend(checked.diagnostics);
    let name = scene.file_stem().map_or_else(|| "scene".to_owned(), |s| s.to_string_lossy().into_owned());
    // a script is always made, however many errors it has
    let script = checked.value.ok_or_else(String::new)?;
    Ok(Loaded { script, sources, messages: diagnostics, folder, name, knobs: Vec::new() })
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
            let d = Diagnostic::new("E703", format!("`{text}` is not NAME=VALUE"));
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
    let wrong = |text: String, note: &str| Err(vec![Diagnostic::new("E703", text).at(whole, "").help(note)]);
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

/// Prints messages to standard error, each cause once, with colour on a terminal.
pub(crate) fn print_all(diagnostics: &[Diagnostic], sources: &SourceMap) {
    let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let (told, more) = one_per_cause(diagnostics, sources);
    for d in told {
        // colours are our own; what the scene says is made visible inside
        let _ = std::io::stderr().lock().write_all(format!("{}\n", render(&d, sources, color)).as_bytes());
    }
    for (code, more) in more {
        say(&format!("{more} more messages with the code {code}\n"));
    }
}

/// Writes to standard error, with what moves the cursor of a terminal made visible; a closed pipe is not our problem.
pub(crate) fn say(text: &str) {
    let _ = std::io::stderr().lock().write_all(visible(text).as_bytes());
}

/// Writes to standard output, like [`say`]; a closed pipe is not our problem.
pub(crate) fn out(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let _ = stdout.write_all(visible(text).as_bytes()).and_then(|()| stdout.flush());
}

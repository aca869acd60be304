//! Reading scenes: files, included files, parameters of the command line, and printing of messages.

use std::{
    io::{IsTerminal, Write},
    path::{Path, PathBuf},
};

use wfl::{Diagnostic, Loader, Override, ResolvedScript, SourceId, SourceMap, parse_expr, render, resolve};

use crate::args::SceneArgs;

/// A scene that was read, with its texts.
pub(crate) struct Loaded {
    pub(crate) sources: SourceMap,
    pub(crate) script: ResolvedScript,
    pub(crate) warnings: Vec<Diagnostic>,
    pub(crate) folder: PathBuf,
    pub(crate) name: String,
}

/// Finds included files beside the file that includes them.
struct Files {
    folders: Vec<PathBuf>,
}

impl Loader for Files {
    fn load(&mut self, path: &str, from: SourceId) -> Result<(String, String), String> {
        let folder = self.folders.get(from.index()).cloned().unwrap_or_default();
        let full = folder.join(path);
        let text = read_text(&full)?;
        Ok((full.display().to_string(), text))
    }
}

/// The text of a file, or why it cannot be read.
fn read_text(path: &Path) -> Result<String, String> {
    let bytes = std::fs::read(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "no such file".to_owned(),
        std::io::ErrorKind::IsADirectory => "it is a directory".to_owned(),
        _ => e.to_string(),
    })?;
    String::from_utf8(bytes).map_err(|e| format!("not UTF-8 text (byte {})", e.utf8_error().valid_up_to()))
}

/// Reads and resolves a scene; prints what is wrong and returns `None` on errors.
pub(crate) fn load(args: &SceneArgs) -> Option<Loaded> {
    let mut sources = SourceMap::new();
    let text = match read_text(&args.scene) {
        Ok(text) => text,
        Err(why) => {
            say(&format!("error: cannot read {}: {why}\n", args.scene.display()));
            return None;
        }
    };
    let main = sources.add(args.scene.display().to_string(), text);
    let folder = args.scene.parent().map(Path::to_path_buf).unwrap_or_default();
    let mut diagnostics = Vec::new();
    let overrides = overrides(&args.overrides, &mut sources, &mut diagnostics);
    let mut loader = Files { folders: vec![folder.clone(); sources.iter().count() + 64] };
    let checked = resolve(&mut sources, main, &mut loader, &overrides);
    diagnostics.extend(checked.diagnostics);
    let failed = diagnostics.iter().any(Diagnostic::is_error);
    if failed {
        print_all(&diagnostics, &sources);
        return None;
    }
    let name = args.scene.file_stem().map_or_else(|| "scene".to_owned(), |s| s.to_string_lossy().into_owned());
    Some(Loaded { script: checked.value?, sources, warnings: diagnostics, folder, name })
}

fn overrides(words: &[String], sources: &mut SourceMap, diagnostics: &mut Vec<Diagnostic>) -> Vec<Override> {
    let mut out = Vec::new();
    for word in words {
        let Some((name, value)) = word.split_once('=') else {
            let id = sources.add("(command line)", word.as_str());
            let end = u32::try_from(word.len()).unwrap_or(u32::MAX);
            let d = Diagnostic::new("E703", format!("`{word}` is not NAME=VALUE"));
            diagnostics.push(d.at(wfl::Span { source: id, start: 0, end }, "").help("gamma=1e6 replaces the value of param gamma"));
            continue;
        };
        // the name stays in the text, so that columns are those of the command line
        let padded = format!("{}{value}", " ".repeat(name.len() + 1));
        let id = sources.add("(command line)", padded);
        let parsed = parse_expr(sources, id);
        diagnostics.extend(parsed.diagnostics);
        if let Some(value) = parsed.value {
            out.push(Override { name: name.trim().to_owned(), span: value.span, value });
        }
    }
    out
}

/// Prints messages to standard error, with colour on a terminal.
pub(crate) fn print_all(diagnostics: &[Diagnostic], sources: &SourceMap) {
    let color = std::io::stderr().is_terminal();
    for d in diagnostics {
        say(&render(d, sources, color));
        say("\n");
    }
}

/// Writes to standard error; a closed pipe is not our problem.
pub(crate) fn say(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Writes to standard output; a closed pipe is not our problem.
pub(crate) fn out(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

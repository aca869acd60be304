//! One mistake in an example gives one error: a statement that is gone, a misspelt name, a bracket or a component too few,
//! another shape. What has several messages all the same is listed with its reason.
//!
//! Where a mistake is made is drawn from the name of the scene, so that another example does not move those of others.

use std::{collections::BTreeMap, fmt::Write as _, path::Path};

use rayon::prelude::*;
use wfl::{Diagnostic, Loader, SourceId, SourceMap, one_per_cause, resolve};
use wfl_compiler::InterpreterBackend;
use wfl_problem::prepare;
use wfl_tests::{examples, files};

/// Not scenes by themselves, or with so many cells that reading them takes seconds.
const LEFT_OUT: &[&str] = &["fault/fault.wfl", "fault_gmsh/common.wfl", "dynamics/tpv205.wfl", "dynamics/sphere.wfl"];

/// Mistakes of one kind that are made in each scene.
const EACH: usize = 2;

/// Scenes and mistakes with several messages, and why.
const SEVERAL: &[(&str, &str, &str)] = &[(
    "fault/nitsche.wfl",
    "remove on line 4",
    "mesh, unknowns and macros were all in the file that is no longer used",
)];

/// Files beside a scene.
struct Beside<'a>(&'a Path);

impl Loader for Beside<'_> {
    fn load(&mut self, path: &str, _from: SourceId) -> Result<(String, String), wfl::Unloaded> {
        let full = self.0.join(path);
        Ok((full.display().to_string(), std::fs::read_to_string(&full).map_err(|e| e.to_string())?))
    }

    fn table(&mut self, path: &str) -> Result<String, wfl::Unloaded> {
        Ok(std::fs::read_to_string(self.0.join(path)).map_err(|e| e.to_string())?)
    }
}

/// The errors that are told of a text, with their lines.
fn told(folder: &Path, text: &str) -> Vec<String> {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let mut checked = resolve(&mut sources, main, &mut Beside(folder), &[]);
    let mut found = std::mem::take(&mut checked.diagnostics);
    if let Some(script) = &checked.value {
        found.extend(prepare(script, folder, &InterpreterBackend).diagnostics);
    }
    found.retain(Diagnostic::is_error);
    let line = |d: &Diagnostic| d.labels.first().map_or(0, |l| sources.line_column(l.span).0);
    let (told, _) = one_per_cause(&found, &sources);
    told.iter().map(|d| format!("{} {} (line {})", d.code.as_str(), d.message, line(d))).collect()
}

/// A generator of numbers that is the same everywhere (Knuth's, of 64 bits).
struct Draw(u64);

impl Draw {
    fn of(name: &str) -> Self {
        Draw(name.bytes().fold(1, |h, b| h.wrapping_mul(0x0100_0000_01b3) ^ u64::from(b)))
    }

    /// A number below `n`, which is not 0.
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n
    }
}

/// Ranges in the code of a line, without its comment and what is quoted, that can be replaced, each with the new text.
fn places(kind: &str, line: &str) -> Vec<(std::ops::Range<usize>, String)> {
    let mut code: String = line.split('#').next().unwrap_or("").to_owned();
    if code.matches('"').count() == 2 {
        let (a, b) = (code.find('"').unwrap_or(0), code.rfind('"').unwrap_or(0));
        code.replace_range(a..=b, &" ".repeat(b + 1 - a));
    }
    if code.trim().is_empty() || code.starts_with("wfl ") || !code.is_ascii() {
        return Vec::new();
    }
    let mut out = Vec::new();
    match kind {
        "remove" if !line.starts_with(' ') => out.push((0..line.len(), String::new())),
        "misspell" => {
            let mut at = 0;
            for word in code.split(|c: char| !c.is_ascii_alphanumeric() && c != '_') {
                if word.len() > 1 && word.starts_with(|c: char| c.is_ascii_alphabetic()) {
                    let end = at + word.len();
                    let letter = if word.ends_with('q') { "z" } else { "q" };
                    out.push((end - 1..end, letter.to_owned()));
                }
                at += word.len() + 1;
            }
        }
        "bracket" => out.extend(code.match_indices(['(', ')', '[', ']']).map(|(k, _)| (k..k + 1, String::new()))),
        "component" => {
            for (close, _) in code.match_indices(']') {
                let open = code[..close].rfind('[').unwrap_or(close);
                let comma = code[open..close].rfind(',').map(|k| open + k);
                out.extend(comma.filter(|k| !code[*k..close].contains(')')).map(|k| (k..close, String::new())));
            }
        }
        "shape" => {
            for (from, to) in [(": vector", ": scalar"), (": scalar", ": vector")] {
                out.extend(code.match_indices(from).map(|(k, _)| (k..k + from.len(), to.to_owned())));
            }
        }
        _ => {}
    }
    out
}

/// The text with one mistake, and the words for it.
fn mistaken(kind: &str, text: &str, draw: &mut Draw) -> Option<(String, String)> {
    let mut all = Vec::new();
    let mut at = 0;
    for (k, line) in text.split('\n').enumerate() {
        all.extend(places(kind, line).into_iter().map(|(r, new)| (k + 1, at + r.start..at + r.end, new)));
        at += line.len() + 1;
    }
    if all.is_empty() {
        return None;
    }
    let (line, range, new) = all.swap_remove(draw.below(all.len()));
    let words = format!("{kind} on line {line}: `{}` becomes `{new}`", &text[range.clone()]);
    let mut wrong = text.to_owned();
    wrong.replace_range(range, &new);
    Some((words, wrong))
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn one_mistake_gives_one_message() {
    let root = examples();
    let scenes: Vec<_> =
        files("examples", "wfl").into_iter().filter(|f| LEFT_OUT.iter().all(|l| !f.ends_with(l))).collect();
    let mut jobs = Vec::new();
    for scene in &scenes {
        let name = scene.strip_prefix(&root).unwrap_or(scene).display().to_string();
        let short = name.rsplit("examples/").next().unwrap_or(&name).to_owned();
        let text = std::fs::read_to_string(scene).expect("an example");
        for kind in ["remove", "misspell", "bracket", "component", "shape"] {
            let mut draw = Draw::of(&format!("{short} {kind}"));
            jobs.extend((0..EACH).filter_map(|_| mistaken(kind, &text, &mut draw)).map(|m| (scene, short.clone(), m)));
        }
    }
    assert!(jobs.len() > 300, "{} mistakes", jobs.len());
    let results: Vec<_> = jobs
        .par_iter()
        .map(|(scene, name, (words, wrong))| (name, words, told(scene.parent().expect("a folder"), wrong)))
        .collect();
    let (mut report, mut counts) = (String::new(), BTreeMap::new());
    let known =
        |name: &str, words: &str| SEVERAL.iter().any(|(scene, what, _)| *scene == name && words.starts_with(what));
    for (name, words, errors) in results {
        *counts.entry(errors.len()).or_insert(0) += 1;
        if errors.len() > 1 && !known(name, words) {
            let _ = writeln!(report, "{name}, {words}\n    {}", errors.join("\n    "));
        }
    }
    assert!(report.is_empty(), "messages by their number {counts:?}; several, of one mistake:\n{report}");
}

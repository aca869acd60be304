//! Scenes as the command line names them, and printing: messages, text on standard error, text on standard output.

use std::{
    io::{IsTerminal, Write},
    path::Path,
    sync::{Mutex, PoisonError},
};

use wfl::{Diagnostic, SourceMap, one_per_cause, render, render_coloured, visible};
use wfl_tasks::{
    Loaded,
    scene_file::{read_scene, read_scene_with_knobs},
};

/// Reads and resolves a scene. Prints why and returns `None` only if there is no text to check; other errors are kept, so
/// that the stages behind can add what they find.
pub(crate) fn load(scene: &Path, overrides: &[String], command: &str) -> Option<Loaded> {
    or_told(read_scene(scene, overrides, command, ""))
}

/// The same with parameters and knobs.
pub(crate) fn load_with_knobs(scene: &Path, words: &[String], command: &str) -> Option<Loaded> {
    or_told(read_scene_with_knobs(scene, words, command))
}

fn or_told(read: Result<Loaded, String>) -> Option<Loaded> {
    read.inspect_err(|why| {
        if !why.is_empty() {
            say(&format!("error: {why}\n"));
        }
    })
    .ok()
}

/// Prints messages to standard error, each cause once, with colour on a terminal.
pub(crate) fn print_all(diagnostics: &[Diagnostic], sources: &SourceMap) {
    let coloured = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let render = if coloured { render_coloured } else { render };
    let (told, more) = one_per_cause(diagnostics, sources);
    for d in told {
        // colours are our own; what the scene says is made visible inside
        let text = format!("{}\n", render(&d, sources));
        if !is_kept(&text) {
            let _ = std::io::stderr().lock().write_all(text.as_bytes());
        }
    }
    for (code, more) in more {
        say(&format!("{more} more messages with the code {code}\n"));
    }
}

/// What a rank that is not the first one would have said last; `None` where there is one rank, or on the first.
static UNSAID: Mutex<Option<String>> = Mutex::new(None);

/// Says nothing from now on: one of several ranks speaks for all.
#[cfg(feature = "petsc")]
pub(crate) fn fall_silent() {
    *UNSAID.lock().unwrap_or_else(PoisonError::into_inner) = Some(String::new());
}

/// What would have been said last, where nothing is said; from now on all is.
#[cfg(feature = "petsc")]
pub(crate) fn speak_up() -> Option<String> {
    UNSAID.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Keeps a text in place of saying it, on a rank that is silent.
fn is_kept(text: &str) -> bool {
    let mut unsaid = UNSAID.lock().unwrap_or_else(PoisonError::into_inner);
    unsaid.as_mut().map(|kept| text.clone_into(kept)).is_some()
}

/// Writes to standard error, with what moves the cursor of a terminal made visible; a closed pipe is not our problem.
pub(crate) fn say(text: &str) {
    if is_kept(text) {
        return;
    }
    let _ = std::io::stderr().lock().write_all(visible(text).as_bytes());
}

/// Writes to standard output, like [`say`]; a closed pipe is not our problem.
pub(crate) fn out(text: &str) {
    if is_kept(text) {
        return;
    }
    let mut stdout = std::io::stdout().lock();
    let _ = stdout.write_all(visible(text).as_bytes()).and_then(|()| stdout.flush());
}

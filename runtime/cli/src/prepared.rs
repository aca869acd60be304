//! A scene made ready for a command: text, messages, compiled terms.

use wfl::Diagnostic;
use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_jit::JitBackend;
use wfl_runtime::{Pruning, Scene, prepare_keeping};

use crate::load::{Loaded, print_all, say};

/// The exit code of every error.
pub(crate) const EXIT_ERROR: u8 = 1;

/// Machine code, or the interpreter when asked for.
pub(crate) fn backend(interpret: bool) -> Option<Box<dyn KernelBackend>> {
    if interpret {
        return Some(Box::new(InterpreterBackend));
    }
    match JitBackend::new() {
        Ok(jit) => Some(Box::new(jit)),
        Err(e) => {
            say(&format!("error: {e}\n  = help: wfl run --interpret works without machine code, more slowly\n"));
            None
        }
    }
}

/// Prepares a scene; what is in `keep` is done although it does not need it. All messages go to `loaded`, in the order of
/// the text; they are printed here only when there is no scene.
pub(crate) fn prepare_scene(loaded: &mut Loaded, backend: &dyn KernelBackend, keep: &[Pruning]) -> Option<Scene> {
    let prepared = prepare_keeping(&loaded.script, &loaded.folder, backend, keep);
    loaded.messages.extend(prepared.diagnostics);
    let place = |d: &Diagnostic| d.labels.first().map(|l| (l.span.source.index(), l.span.start));
    loaded.messages.sort_by_key(place);
    if loaded.messages.iter().any(Diagnostic::is_error) {
        // what a broken statement would have used is no leftover
        loaded.messages.retain(|d| d.code != "W702");
    }
    let scene = prepared.scene.filter(|_| !loaded.messages.iter().any(Diagnostic::is_error));
    if scene.is_none() {
        print_all(&loaded.messages, &loaded.sources);
    }
    scene
}

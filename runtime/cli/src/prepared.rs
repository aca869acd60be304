//! A scene made ready for a command: text, messages, compiled terms.

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_discrete::pruning::Pruning;
use wfl_jit::JitBackend;
use wfl_problem::Scene;
use wfl_tasks::Loaded;

use crate::{
    heartbeat::Heartbeat,
    load::{print_all, say},
};

/// The exit code of every error.
pub(crate) const EXIT_ERROR: u8 = 1;

/// Machine code, or the interpreter on request.
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

/// Says on standard error that a scene is still being prepared, every few seconds until it is dropped.
pub(crate) fn sign_of_life() -> Heartbeat {
    Heartbeat::new(|text| say(&format!("{text}\n")))
}

/// Prepares a scene; what is in `keep` is done although it does not need it. Messages are printed here only when there
/// is no scene.
pub(crate) fn prepare_scene(loaded: &mut Loaded, backend: &dyn KernelBackend, keep: &[Pruning]) -> Option<Scene> {
    let scene = loaded.prepare(backend, keep);
    if scene.is_none() {
        print_all(&loaded.messages, &loaded.sources);
    }
    scene
}

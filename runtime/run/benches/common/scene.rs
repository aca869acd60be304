//! A scene made ready to run, for all benches.

use std::path::Path;

use wfl::{Diagnostic, Loader, SourceMap, render, resolve};
use wfl_jit::JitBackend;
use wfl_problem::{Scene, prepare};

/// Reads and compiles a scene to machine code.
///
/// # Errors
/// The messages as text.
pub(crate) fn scene(name: &str, text: String, loader: &mut dyn Loader) -> Result<Scene, String> {
    let mut sources = SourceMap::new();
    let main = sources.add(name, text);
    let checked = resolve(&mut sources, main, loader, &[]);
    let told = |d: &[Diagnostic]| d.iter().map(|d| render(d, &sources)).collect::<Vec<_>>().join("\n");
    if checked.diagnostics.iter().any(Diagnostic::is_error) {
        return Err(told(&checked.diagnostics));
    }
    let script = checked.value.ok_or("no script")?;
    let backend = JitBackend::new().map_err(|e| e.to_string())?;
    let made = prepare(&script, Path::new("."), &backend);
    made.scene.ok_or_else(|| told(&made.diagnostics))
}

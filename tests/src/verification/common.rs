//! What the benchmarks share: example scenes with changes, reference rows, orders of convergence.

use serde_json::Value;

use super::Case;
use crate::{Solved, examples, solve};

/// Solves an example with text replacements and parameters; every replacement must be found.
///
/// # Errors
/// The message, a step that did not converge, or a text that is not in the scene.
pub(super) fn example(path: &str, edits: &[(&str, String)], params: &[(&str, f64)]) -> Result<Solved, String> {
    let full = examples().join(path);
    let text = std::fs::read_to_string(&full).map_err(|e| format!("{path}: {e}"))?;
    for (from, _) in edits {
        if !text.contains(from) {
            return Err(format!("{path} has no `{from}`"));
        }
    }
    let folder = full.parent().map(std::path::Path::to_path_buf).unwrap_or_else(examples);
    converged(solve(&folder, text, edits, params)?)
}

/// Solves a scene given as text.
///
/// # Errors
/// The message, or a step that did not converge.
pub(super) fn scene(text: &str, params: &[(&str, f64)]) -> Result<Solved, String> {
    converged(solve(&examples(), text.to_owned(), &[], params)?)
}

/// A scene whose steps all converged.
///
/// # Errors
/// If one did not.
pub(super) fn converged(solved: Solved) -> Result<Solved, String> {
    if solved.outcome.converged() { Ok(solved) } else { Err("a step did not converge".to_owned()) }
}

/// A case, or the line that says why there is none.
pub(super) fn or_failed(what: &str, made: Result<Case, String>) -> Case {
    made.unwrap_or_else(|why| Case::failed(what, why))
}

/// Rows of numbers of a reference table.
pub(super) fn rows(table: &Value) -> Vec<Vec<f64>> {
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    let list = |v: &Value| v.as_array().map(|r| r.iter().map(number).collect()).unwrap_or_default();
    table.as_array().map(|t| t.iter().map(list).collect()).unwrap_or_default()
}

/// The order of convergence between two meshes with `n` and `m` cells a side and these errors.
pub(super) fn order(n: f64, coarse: f64, m: f64, fine: f64) -> f64 {
    (coarse / fine).ln() / (m / n).ln()
}

/// Lagrange elements of the plane: name, shape of the cells, degree.
pub(super) const PLANE: [(&str, &str, f64); 4] =
    [("P1", "tri", 1.0), ("P2", "tri", 2.0), ("Q1", "quad", 1.0), ("Q2", "quad", 2.0)];

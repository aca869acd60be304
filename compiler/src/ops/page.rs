//! All functions as a table in Markdown: the one of `docs/language.md` and of `wfl explain --functions`.

use std::fmt::Write as _;

use super::{def::OpDef, table::all};

/// The table, by name.
#[must_use]
pub fn function_table() -> String {
    let mut rows: Vec<&OpDef> = all().collect();
    rows.sort_by_key(|op| (op.name.to_ascii_lowercase(), op.name));
    let cell = |text: &str| text.replace('|', "\\|");
    let mut text = "| function | what it is |\n|---|---|\n".to_owned();
    for op in rows {
        let _ = writeln!(text, "| `{}` | {} |", cell(op.usage), cell(op.doc));
    }
    text
}

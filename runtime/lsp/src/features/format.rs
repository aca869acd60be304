//! The canonical text of a file: that of `wfl fmt`.

use lsp_types::TextEdit;

use crate::view::{Refused, View};

/// One change of the lines that differ; none of a text with errors, which says why.
pub(crate) fn format(view: &View<'_>) -> Result<Option<Vec<TextEdit>>, Refused> {
    let formatted = wfl::format(&view.analysis.sources, view.id);
    let Some(new) = formatted.value else {
        return Err(Refused::new("a text with errors is not formatted: its meaning is not known"));
    };
    if new == view.text {
        return Ok(Some(Vec::new()));
    }
    let same = |a: &str, b: &str| a == b;
    let (old_lines, new_lines) = (lines(view.text), lines(&new));
    let shared = old_lines.len().min(new_lines.len());
    let head = (0..shared).take_while(|k| same(old_lines[*k], new_lines[*k])).count();
    let from_end = |list: &[&str], k: usize| list.len() - 1 - k;
    let tail = (0..shared - head)
        .take_while(|k| same(old_lines[from_end(&old_lines, *k)], new_lines[from_end(&new_lines, *k)]))
        .count();
    let start: usize = old_lines[..head].iter().map(|l| l.len()).sum();
    let end: usize = old_lines[..old_lines.len() - tail].iter().map(|l| l.len()).sum();
    let text = new_lines[head..new_lines.len() - tail].concat();
    Ok(Some(vec![TextEdit { range: view.lines.range(view.text, start, end), new_text: text }]))
}

fn lines(text: &str) -> Vec<&str> {
    text.split_inclusive('\n').collect()
}

//! The table of a sweep: one row a setting, kept as CSV (RFC 4180), the one file that plots are made from.
//!
//! Promises: what is written is read back the same; columns stand in the order of their first use; the file is replaced
//! as a whole, so that a sweep that is killed leaves a table that can be read.

use std::path::Path;

use thiserror::Error;
use wfl_host::input::InputKind;
use wfl_output::{OutputDir, OutputError};

use crate::scene_file::read_text;

/// The name of the file in the folder of a sweep.
pub(super) const TABLE_FILE: &str = "sweep.csv";

/// The status of a run with a solution.
pub(super) const SOLVED: &str = "ok";
/// The status of a run with a solution for which an expectation of its scene does not hold.
pub(super) const NOT_AS_EXPECTED: &str = "not as expected";

/// One run: texts by column.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Row(Vec<(String, String)>);

impl Row {
    /// Sets a column.
    pub(super) fn set(&mut self, column: impl Into<String>, text: impl Into<String>) {
        let (column, text) = (column.into(), text.into());
        match self.0.iter_mut().find(|c| c.0 == column) {
            Some(found) => found.1 = text,
            None => self.0.push((column, text)),
        }
    }

    /// Sets a number: the fewest digits that determine it.
    pub(super) fn number(&mut self, column: impl Into<String>, value: f64) {
        let text =
            if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) { format!("{value:e}") } else { value.to_string() };
        self.set(column, text);
    }

    /// The text of a column; empty if there is none.
    pub(super) fn text(&self, column: &str) -> &str {
        self.0.iter().find(|c| c.0 == column).map_or("", |c| &c.1)
    }

    /// The number in a column; `None` for no number, also for NaN and infinity.
    pub(super) fn value(&self, column: &str) -> Option<f64> {
        self.text(column).parse().ok().filter(|x: &f64| x.is_finite())
    }

    /// Whether it has a solution, whatever the scene expects of it.
    pub(super) fn is_solved(&self) -> bool {
        [SOLVED, NOT_AS_EXPECTED].contains(&self.text("status"))
    }

    /// Names of its columns.
    pub(super) fn columns(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|c| c.0.as_str())
    }
}

/// A table that cannot be read.
#[derive(Debug, Error)]
pub(super) enum TableError {
    #[error("cannot read {path}: {why}")]
    Read { path: String, why: String },
    #[error("{path}, row {row}: {found} cells where the first row has {expected}")]
    Cells { path: String, row: usize, found: usize, expected: usize },
}

/// Every column of some rows, in the order of first use.
pub(super) fn columns(rows: &[Row]) -> Vec<&str> {
    let mut out: Vec<&str> = Vec::new();
    for column in rows.iter().flat_map(Row::columns) {
        if !out.contains(&column) {
            out.push(column);
        }
    }
    out
}

/// Rows as CSV.
pub(super) fn csv(rows: &[Row]) -> String {
    let columns = columns(rows);
    let line = |cells: Vec<&str>| cells.into_iter().map(cell).collect::<Vec<_>>().join(",") + "\n";
    let head = line(columns.clone());
    rows.iter().fold(head, |text, row| text + &line(columns.iter().map(|c| row.text(c)).collect()))
}

fn cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Writes a table in place of the one there was.
pub(super) fn write(dir: &OutputDir, rows: &[Row]) -> Result<(), OutputError> {
    write_text(dir, TABLE_FILE, &csv(rows))
}

/// Writes a text into the folder of a sweep.
pub(super) fn write_text(dir: &OutputDir, name: &str, text: &str) -> Result<(), OutputError> {
    dir.write_atomic(name, |out| out.write_all(text.as_bytes())).map(drop)
}

/// Reads a table; no rows where there is no file.
pub(super) fn read(folder: &Path) -> Result<Vec<Row>, TableError> {
    let path = folder.join(TABLE_FILE);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let shown = path.display().to_string();
    let text = read_text(&path, InputKind::Results).map_err(|why| TableError::Read { path: shown.clone(), why })?;
    let mut lines = cells(&text).into_iter();
    let head = lines.next().unwrap_or_default();
    let mut rows = Vec::new();
    for (k, line) in lines.enumerate() {
        if line.len() != head.len() {
            return Err(TableError::Cells { path: shown, row: k + 2, found: line.len(), expected: head.len() });
        }
        rows.push(Row(head.iter().cloned().zip(line).collect()));
    }
    Ok(rows)
}

/// The cells of each line; quoted cells may hold commas, quotes and ends of lines.
fn cells(text: &str) -> Vec<Vec<String>> {
    let (mut lines, mut line, mut one, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => {
                chars.next();
                one.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => line.push(std::mem::take(&mut one)),
            '\r' if !quoted => {}
            '\n' if !quoted => {
                line.push(std::mem::take(&mut one));
                lines.push(std::mem::take(&mut line));
            }
            c => one.push(c),
        }
    }
    if !one.is_empty() || !line.is_empty() {
        line.push(one);
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use wfl_output::{Kind, Plan};

    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let mut a = Row::default();
        a.set("scene", "a,b.wfl");
        a.number("time", 0.1 + 0.2);
        a.set("message", "he said \"no\"\nand left");
        let mut b = Row::default();
        b.number("time", 1e-12);
        b.number("error", f64::NAN);
        let rows = vec![a, b];
        let folder = std::env::temp_dir().join(format!("wfl_table_{}", std::process::id()));
        let dir = OutputDir::open(&folder).expect("a folder");
        dir.go_on(Kind::Sweep, &Plan::default()).expect("a folder of sweeps");
        write(&dir, &rows).expect("written");
        let back = read(&folder).expect("read");
        drop(dir);
        std::fs::remove_dir_all(&folder).expect("removed");
        for (found, written) in back.iter().zip(&rows) {
            assert!(columns(&rows).iter().all(|c| found.text(c) == written.text(c)));
        }
        assert_eq!(back[0].value("time"), Some(0.1 + 0.2));
        assert_eq!((back[1].text("error"), back[1].value("error")), ("NaN", None));
    }
}

//! Tables that are printed aligned or as JSON: one description, two looks.

use std::fmt::Write as _;

use serde_json::{Map, Value};

/// A named table.
pub(crate) struct Table {
    /// Key in JSON and title in text.
    pub(crate) name: &'static str,
    /// Column names; spaces become underscores in JSON.
    pub(crate) columns: Vec<&'static str>,
    /// The cells.
    pub(crate) rows: Vec<Vec<Value>>,
}

impl Table {
    pub(crate) fn new(name: &'static str, columns: &[&'static str]) -> Self {
        Self { name, columns: columns.to_vec(), rows: Vec::new() }
    }

    pub(crate) fn push(&mut self, row: Vec<Value>) {
        debug_assert_eq!(row.len(), self.columns.len(), "{}", self.name);
        self.rows.push(row);
    }

    /// Aligned text: numbers to the right, words to the left. Nothing for a table without rows.
    pub(crate) fn text(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let cells: Vec<Vec<String>> = self.rows.iter().map(|r| r.iter().map(cell).collect()).collect();
        let width = |c: usize| {
            let widest = cells.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
            widest.max(self.columns[c].chars().count())
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let right: Vec<bool> =
            (0..widths.len()).map(|c| self.rows.iter().all(|r| r[c].is_number() || r[c].is_null())).collect();
        let mut out = format!("{}\n", self.name);
        let mut line = |cells: &[String]| {
            let mut text = String::from("  ");
            for (c, cell) in cells.iter().enumerate() {
                let pad = " ".repeat(widths[c] - cell.chars().count());
                let _ = if right[c] { write!(text, "{pad}{cell}  ") } else { write!(text, "{cell}{pad}  ") };
            }
            let _ = writeln!(out, "{}", text.trim_end());
        };
        let heads: Vec<String> = self.columns.iter().map(|c| (*c).to_owned()).collect();
        if heads.iter().any(|h| !h.is_empty()) {
            line(&heads);
        }
        for row in &cells {
            line(row);
        }
        out
    }

    /// A list of objects.
    pub(crate) fn json(&self) -> Value {
        let object = |row: &Vec<Value>| {
            let pairs = self.columns.iter().zip(row).map(|(c, v)| (c.replace(' ', "_"), v.clone()));
            Value::Object(pairs.collect::<Map<String, Value>>())
        };
        Value::Array(self.rows.iter().map(object).collect())
    }
}

/// A value as text.
pub(crate) fn cell(value: &Value) -> String {
    match value {
        Value::Null => "-".to_owned(),
        Value::Bool(b) => (if *b { "yes" } else { "no" }).to_owned(),
        Value::Number(n) => n.as_f64().filter(|_| n.is_f64()).map_or_else(|| n.to_string(), number),
        Value::String(s) => s.clone(),
        Value::Array(list) => list.iter().map(cell).collect::<Vec<_>>().join(", "),
        Value::Object(_) => value.to_string(),
    }
}

/// A number as a person would write it: 0.25, 1e24.
pub(crate) fn number(v: f64) -> String {
    if v == 0.0 || (1e-4..1e7).contains(&v.abs()) { v.to_string() } else { format!("{v:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_to_the_left_numbers_to_the_right() {
        let mut table = Table::new("fields", &["name", "free dofs"]);
        table.push(vec!["u".into(), 1200.into()]);
        table.push(vec!["lambda".into(), 9.into()]);
        assert_eq!(table.text(), "fields\n  name    free dofs\n  u            1200\n  lambda          9\n");
        assert_eq!(table.json().to_string(), r#"[{"free_dofs":1200,"name":"u"},{"free_dofs":9,"name":"lambda"}]"#);
        assert_eq!(Table::new("empty", &["a"]).text(), "");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.25, 1e24, -1e5, 1e-12, 0.0].map(number), ["0.25", "1e24", "-100000", "1e-12", "0"]);
    }
}

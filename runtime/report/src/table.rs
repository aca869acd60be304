//! Tables of numbers, as `output csv` writes them.

use std::path::Path;

use crate::folder::{ReportError, bytes, damaged};

/// Columns with their names.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Columns {
    pub(crate) names: Vec<String>,
    /// One vector a column.
    pub(crate) values: Vec<Vec<f64>>,
}

impl Columns {
    pub(crate) fn read(file: &Path) -> Result<Self, ReportError> {
        let text = String::from_utf8(bytes(file)?).map_err(|_| damaged(file, "it is not UTF-8 text"))?;
        if !text.ends_with('\n') {
            return Err(damaged(file, "its last line is cut off"));
        }
        Self::of(file, &text)
    }

    /// A table that somebody else has written.
    pub(crate) fn foreign(file: &Path) -> Result<Self, ReportError> {
        let text = String::from_utf8(bytes(file)?).map_err(|_| damaged(file, "it is not UTF-8 text"))?;
        Self::of(file, &text)
    }

    fn of(file: &Path, text: &str) -> Result<Self, ReportError> {
        let mut lines = text.lines();
        let names = header(lines.next().unwrap_or_default());
        let mut values = vec![Vec::new(); names.len()];
        for (k, line) in lines.enumerate() {
            let mut entries = line.split(',');
            for column in &mut values {
                let entry = entries.next().and_then(|e| e.parse::<f64>().ok());
                column.push(entry.ok_or_else(|| damaged(file, format!("line {} is no row of numbers", k + 2)))?);
            }
            if entries.next().is_some() {
                return Err(damaged(file, format!("line {} has too many entries", k + 2)));
            }
        }
        Ok(Columns { names, values })
    }
}

/// Names of the columns; quoted ones may hold commas and doubled quotes (RFC 4180).
fn header(line: &str) -> Vec<String> {
    let mut names = vec![String::new()];
    let (mut quoted, mut characters) = (false, line.chars().peekable());
    while let Some(c) = characters.next() {
        match c {
            '"' if quoted && characters.peek() == Some(&'"') => {
                characters.next();
                names.last_mut().into_iter().for_each(|n| n.push('"'));
            }
            '"' => quoted = !quoted,
            ',' if !quoted => names.push(String::new()),
            c => names.last_mut().into_iter().for_each(|n| n.push(c)),
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_be_quoted() {
        assert_eq!(header("s,\"a, \"\"b\"\"\",c"), ["s", "a, \"b\"", "c"]);
    }
}

//! Values at positions from a text file, and their transfer to the nodes of a field.
//!
//! The format: one line of column names, then one line of numbers a position, separated by commas. `x`, `y`, `z` are
//! the position; the values of a field `u` stand in a column `u` or in `u_1`, `u_2`, ... (`u_11`, `u_21`, ... for a
//! matrix, first index first), as `output csv` writes them. Empty entries and `nan` are no values; other columns are
//! ignored; lines that begin with `#` are comments. Nothing is interpolated: a node takes the values of the position
//! that is its own within [`SAME_PLACE`] of the mesh size, or the file does not fit.

use thiserror::Error;

use wfl_host::reading::excerpt;

/// Positions are the same within this part of the mesh size.
pub const SAME_PLACE: f64 = 1e-9;

/// Columns of numbers by name.
#[derive(Clone, Debug, PartialEq)]
pub struct PointValues {
    names: Vec<String>,
    positions: Vec<[f64; 3]>,
    /// `values[row * names.len() + column]`
    values: Vec<f64>,
    /// The line of the file of each row.
    lines: Vec<usize>,
}

/// Why a file does not give the values of a field.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PointValuesError {
    /// Not the format.
    #[error("line {line}: {what}")]
    Format {
        /// Its number from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// No columns for the field.
    #[error("none of its {count} columns is `{wanted}`{near}")]
    Columns {
        /// The column that is missing.
        wanted: String,
        /// How many are there.
        count: usize,
        /// One of a like name, in words.
        near: String,
    },
    /// An infinite value.
    #[error("line {line}: the value of `{column}` is infinite; where there is no value, write nan or nothing")]
    Infinite {
        /// Its number from 1.
        line: usize,
        /// Which column.
        column: String,
    },
    /// Nodes that have no position in the file.
    #[error(
        "{count} of {total} nodes have no line; the first stands at {at:?}, the nearest line is {distance:.1e} away"
    )]
    Unmatched {
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
        /// Where the first is.
        at: [f64; 3],
        /// How far its nearest line is; infinite without lines.
        distance: f64,
    },
    /// Two lines at one place that differ.
    #[error("two lines at {at:?} with different values of `{column}`")]
    Twice {
        /// Where.
        at: [f64; 3],
        /// Which column.
        column: String,
    },
}

impl PointValues {
    /// Reads a text.
    ///
    /// # Errors
    /// [`PointValuesError::Format`] with the line.
    pub fn parse(text: &str) -> Result<Self, PointValuesError> {
        let wrong = |line: usize, what: String| PointValuesError::Format { line: line + 1, what };
        let mut lines =
            text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
        let Some((first, head)) = lines.next() else {
            return Err(wrong(0, "the file is empty".to_owned()));
        };
        let names: Vec<String> = head.split(',').map(|n| n.trim().trim_matches('"').to_owned()).collect();
        let axis = |name: &str| names.iter().position(|n| n == name);
        let axes = ["x", "y", "z"].map(axis);
        if axes[0].is_none() {
            let text = format!("the first line names the columns, and none of its {} is `x`", names.len());
            return Err(wrong(first, text));
        }
        if let Some(twice) = names.iter().enumerate().find(|(k, n)| names[..*k].contains(n)) {
            let first_of = names.iter().position(|n| n == twice.1).unwrap_or(0);
            return Err(wrong(first, format!("columns {} and {} have one name", first_of + 1, twice.0 + 1)));
        }
        let (mut positions, mut values, mut lines_of) = (Vec::new(), Vec::new(), Vec::new());
        for (number, line) in lines {
            let row: Vec<&str> = line.split(',').map(str::trim).collect();
            if row.len() != names.len() {
                return Err(wrong(number, format!("{} numbers for {} columns", row.len(), names.len())));
            }
            let start = values.len();
            for (column, entry) in row.iter().enumerate() {
                let value = if entry.is_empty() { Ok(f64::NAN) } else { entry.parse::<f64>() };
                let what = |why: &str| format!("{} in column {} is {why}", excerpt(entry), column + 1);
                let value = value.map_err(|_| wrong(number, what("no number")))?;
                if value.is_infinite() {
                    return Err(wrong(number, what("not finite")));
                }
                values.push(value);
            }
            let x = axes.map(|k| k.map_or(0.0, |k| values[start + k]));
            if x.iter().any(|c| !c.is_finite()) {
                return Err(wrong(number, "a position must be finite".to_owned()));
            }
            positions.push(x);
            lines_of.push(number + 1);
        }
        Ok(Self { names, positions, values, lines: lines_of })
    }

    /// True if the column `s` is the distance along the line that an output wrote: a field of that name has no column then.
    #[must_use]
    pub fn has_distances(&self) -> bool {
        // an output writes it in front of the positions
        if !(self.names.first().is_some_and(|n| n == "s") && self.names.get(1).is_some_and(|n| n == "x")) {
            return false;
        }
        let at = |row: usize| self.values[row * self.names.len()];
        let apart = |row: usize| {
            let [a, b] = [self.positions[row], self.positions[row - 1]];
            (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
        };
        let rows = self.positions.len();
        let length: f64 = (1..rows).map(apart).sum();
        let is_next = |row: usize| (at(row) - at(row - 1) - apart(row)).abs() <= SAME_PLACE * length;
        rows > 1 && length > 0.0 && at(0) == 0.0 && (1..rows).all(is_next)
    }

    /// True if there is a column for the field.
    #[must_use]
    pub fn has(&self, field: &str) -> bool {
        let own = |n: &String| {
            n == field
                || n.strip_prefix(field).is_some_and(|r| {
                    r.strip_prefix('_').is_some_and(|i| !i.is_empty() && i.bytes().all(|b| b.is_ascii_digit()))
                })
        };
        self.names.iter().any(own)
    }

    /// Names of a file are not shown, except one that is close to the wanted name.
    fn without_column(&self, wanted: String) -> PointValuesError {
        let near = wfl::nearest(&wanted, self.names.iter().map(String::as_str));
        let near = near.map_or_else(String::new, |n| format!("; there is a `{n}`"));
        PointValuesError::Columns { wanted, count: self.names.len(), near }
    }

    /// The values of a field at `nodes`: `out[node * entries.len() + entry]`. `entries` are the names of its entries
    /// behind the underscore, one empty name for a scalar; `size` is that of the mesh.
    ///
    /// # Errors
    /// [`PointValuesError`] where columns or nodes are missing, or two lines disagree.
    pub fn at_nodes(
        &self,
        field: &str,
        entries: &[String],
        nodes: &[[f64; 3]],
        size: f64,
    ) -> Result<Vec<f64>, PointValuesError> {
        let mut columns = Vec::with_capacity(entries.len());
        for entry in entries {
            let wanted = if entry.is_empty() { field.to_owned() } else { format!("{field}_{entry}") };
            let place = self.names.iter().position(|n| *n == wanted);
            columns.push(place.ok_or_else(|| self.without_column(wanted))?);
        }
        let value = |row: usize, column: usize| self.values[row * self.names.len() + column];
        for row in 0..self.positions.len() {
            if let Some(c) = columns.iter().find(|c| value(row, **c).is_infinite()) {
                return Err(PointValuesError::Infinite { line: self.lines[row], column: self.names[*c].clone() });
            }
        }
        let mut rows: Vec<usize> =
            (0..self.positions.len()).filter(|r| columns.iter().all(|c| value(*r, *c).is_finite())).collect();
        rows.sort_by(|a, b| self.positions[*a][0].total_cmp(&self.positions[*b][0]).then(a.cmp(b)));
        let reach = SAME_PLACE * size;
        let (mut out, mut unmatched) = (Vec::with_capacity(nodes.len() * columns.len()), Vec::new());
        for x in nodes {
            let begin = rows.partition_point(|r| self.positions[*r][0] < x[0] - reach);
            let near = rows[begin..].iter().copied().take_while(|r| self.positions[*r][0] <= x[0] + reach);
            let mut here = near.filter(|r| (0..3).all(|d| (self.positions[*r][d] - x[d]).abs() <= reach));
            let Some(row) = here.next() else {
                unmatched.push(*x);
                continue;
            };
            for other in here {
                if let Some(c) = columns.iter().find(|c| value(row, **c) != value(other, **c)) {
                    return Err(PointValuesError::Twice { at: *x, column: self.names[*c].clone() });
                }
            }
            out.extend(columns.iter().map(|c| value(row, *c)));
        }
        let Some(at) = unmatched.first().copied() else { return Ok(out) };
        let distance = |r: &usize| (0..3).fold(0.0f64, |m, d| m.hypot(self.positions[*r][d] - at[d]));
        let nearest = rows.iter().map(distance).fold(f64::INFINITY, f64::min);
        Err(PointValuesError::Unmatched { count: unmatched.len(), total: nodes.len(), at, distance: nearest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a table\ns, x, y, u_1, u_2, k\n0, 0, 0, 1, 2, 5\n1, 1, 0, 3, 4, \n2, 0, 1, nan, 0, 7\n";

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|s| (*s).to_owned()).collect()
    }

    #[test]
    fn nodes_take_the_values_of_their_places() {
        let table = PointValues::parse(TEXT).expect("a table");
        assert!(table.has("u") && table.has("k") && !table.has("v"));
        let nodes = [[1.0, 1e-10, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(table.at_nodes("u", &names(&["1", "2"]), &nodes, 1.0), Ok(vec![3.0, 4.0, 1.0, 2.0]));
        assert_eq!(table.at_nodes("k", &names(&[""]), &[[0.0, 1.0, 0.0]], 1.0), Ok(vec![7.0]));
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let table = PointValues::parse(TEXT).expect("a table");
        // the line at (0, 1) has no u
        let found = table.at_nodes("u", &names(&["1", "2"]), &[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], 1.0);
        let wanted = PointValuesError::Unmatched { count: 1, total: 2, at: [0.0, 1.0, 0.0], distance: 1.0 };
        assert_eq!(found, Err(wanted));
        let found = table.at_nodes("v", &names(&[""]), &[], 1.0);
        assert!(matches!(found, Err(PointValuesError::Columns { wanted, .. }) if wanted == "v"));
        let twice = PointValues::parse("x,k\n0,1\n0,2\n").expect("a table");
        assert!(matches!(twice.at_nodes("k", &names(&[""]), &[[0.0; 3]], 1.0), Err(PointValuesError::Twice { .. })));
        for (text, line) in [
            ("", 1),
            ("x,k\n0,1e400\n", 2),
            ("x,k\n0,-inf\n", 2),
            ("a,b\n1,2\n", 1),
            ("x,k\n1\n", 2),
            ("x,k\n1,two\n", 2),
            ("x,k\ninf,1\n", 2),
            ("x,x\n", 1),
        ] {
            assert!(
                matches!(PointValues::parse(text), Err(PointValuesError::Format { line: l, .. }) if l == line),
                "{text}"
            );
        }
    }
}

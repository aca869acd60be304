//! Tables of a scene, `table("history.csv", t)`: columns of numbers over the first one, linear between the rows.
//!
//! Promises: arguments are finite and increase from row to row, values are finite, there are at least two rows; whatever
//! is wrong with a file has its line. Reads no file itself: a [`crate::Loader`] does. Messages show no text of a file but
//! the names of its columns.

use std::sync::Arc;

use crate::{ast::Unit, source::Span};

/// One column of a table over its first one.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// The file as the scene writes it, with the column where the file has several.
    pub name: String,
    /// What the rows are over: increasing.
    pub arguments: Arc<[f64]>,
    /// One value for each row.
    pub values: Vec<f64>,
}

impl Curve {
    /// The first and the last argument.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        (self.arguments[0], self.arguments[self.arguments.len() - 1])
    }

    /// The arguments at which the slope changes; ends are none.
    #[must_use]
    pub fn corners(&self) -> Vec<f64> {
        /// Slopes of rows on one line differ by the rounding of decimal numbers.
        const SAME: f64 = 1e-9;
        let slope = |k: usize| (self.values[k + 1] - self.values[k]) / (self.arguments[k + 1] - self.arguments[k]);
        let bends = |k: &usize| {
            let (before, behind) = (slope(k - 1), slope(*k));
            (before - behind).abs() > SAME * before.abs().max(behind.abs())
        };
        (1..self.arguments.len() - 1).filter(bends).map(|k| self.arguments[k]).collect()
    }
}

/// A column as the first line of a file names it.
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    /// Its name; none in a file without a line of names.
    pub name: Option<String>,
    /// Its unit; the place is that of the text that names the file.
    pub unit: Option<Unit>,
}

/// A file of rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The file as the scene writes it.
    pub name: String,
    /// Its text as read.
    pub text: Arc<str>,
    /// What the first line says of each column, that of the arguments first.
    pub heads: Vec<Head>,
    /// The other columns.
    pub curves: Vec<Arc<Curve>>,
}

/// Why a file is no table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoTable {
    /// The line, from 1; none for the whole file.
    pub line: Option<usize>,
    /// What is wrong, in words.
    pub why: String,
    /// What to do.
    pub help: &'static str,
}

const FORM: &str = "a line of names such as `t [s],q [MPa]`, then a line for each row: numbers with commas between";

impl NoTable {
    fn new(line: Option<usize>, why: impl Into<String>, help: &'static str) -> Self {
        Self { line, why: why.into(), help }
    }
}

impl Table {
    /// Reads the text of a file. `span` is the place that names it.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn parse(name: &str, text: Arc<str>, span: Span) -> Result<Table, NoTable> {
        let mut heads: Option<Vec<Head>> = None;
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut lines: Vec<usize> = Vec::new();
        for (line, cells) in rows(&text) {
            let Some(heads) = &heads else {
                let known = heads_of(line, &cells, span)?;
                let named = known.iter().any(|h| h.name.is_some());
                columns = vec![Vec::new(); known.len()];
                heads = Some(known);
                if !named {
                    take(line, &cells, &mut columns)?;
                    lines.push(line);
                }
                continue;
            };
            if cells.len() != heads.len() {
                let why = format!("{}, the first line has {}", cells_of(cells.len()), heads.len());
                return Err(NoTable::new(Some(line), why, FORM));
            }
            take(line, &cells, &mut columns)?;
            lines.push(line);
        }
        let Some(heads) = heads else { return Err(NoTable::new(None, "it is empty", FORM)) };
        let rows = columns[0].len();
        if rows < 2 {
            let why = format!("it has {}; a table needs two at least", if rows == 0 { "no row" } else { "one row" });
            return Err(NoTable::new(None, why, FORM));
        }
        increasing(&columns, &lines)?;
        let mut columns = columns.into_iter();
        let arguments: Arc<[f64]> = columns.next().unwrap_or_default().into();
        let several = heads.len() > 2;
        let curve = |(values, head): (Vec<f64>, &Head)| {
            let column = head.name.as_deref().filter(|_| several);
            let name = column.map_or_else(|| format!("\"{name}\""), |c| format!("\"{name}\", column `{c}`"));
            Arc::new(Curve { name, arguments: Arc::clone(&arguments), values })
        };
        let curves = columns.zip(&heads[1..]).map(curve).collect();
        Ok(Table { name: name.to_owned(), text, heads, curves })
    }

    /// The curve of a column; of the only one without a name.
    ///
    /// # Errors
    /// Why there is none, and what to write.
    pub fn curve(&self, column: Option<&str>) -> Result<&Arc<Curve>, (String, String)> {
        let names: Vec<String> = self.heads[1..].iter().filter_map(|h| h.name.clone()).collect();
        let listed = names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", ");
        let (file, n) = (&self.name, self.curves.len());
        match column {
            None if n == 1 => Ok(&self.curves[0]),
            None if names.is_empty() => Err((
                format!("\"{file}\" has {n} columns of values, and no line of names"),
                "give the columns names in its first line, and name one: table(\"file.csv\", t, \"q\")".to_owned(),
            )),
            None => Err((
                format!("\"{file}\" has {n} columns of values"),
                format!("name one of {listed}: table(\"{file}\", t, \"{}\")", names[0]),
            )),
            Some(wanted) => {
                let found = self.heads[1..].iter().position(|h| h.name.as_deref() == Some(wanted));
                let known =
                    if names.is_empty() { "it has no line of names".to_owned() } else { format!("it has {listed}") };
                found.map(|k| &self.curves[k]).ok_or((format!("\"{file}\" has no column of values `{wanted}`"), known))
            }
        }
    }

    /// What the first line says of the column of a curve.
    #[must_use]
    pub fn head(&self, curve: &Arc<Curve>) -> Option<&Head> {
        let k = self.curves.iter().position(|c| Arc::ptr_eq(c, curve))?;
        self.heads.get(k + 1)
    }
}

/// Lines with something in them, with their numbers, cut at commas. What stands behind `#` is a comment.
fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let written = |line: &str| !line.trim().is_empty();
    let lines = text.lines().map(|l| l.split('#').next().unwrap_or(l)).enumerate();
    lines.filter(move |(_, l)| written(l)).map(|(k, l)| (k + 1, l.split(',').map(str::trim).collect()))
}

fn cells_of(n: usize) -> String {
    if n == 1 { "1 cell".to_owned() } else { format!("{n} cells") }
}

/// The columns as the first line names them; without names if it is a row of numbers.
fn heads_of(line: usize, cells: &[&str], span: Span) -> Result<Vec<Head>, NoTable> {
    if cells.len() < 2 {
        let other = [(';', "`;`"), ('\t', "a tab")].into_iter().find(|(sign, _)| cells[0].contains(*sign));
        let help = "the cells of a row are separated by commas, and numbers have a decimal point";
        return Err(match other {
            Some((_, sign)) => NoTable::new(Some(line), format!("the cells are separated by {sign}"), help),
            None => NoTable::new(Some(line), "there is one column only", FORM),
        });
    }
    if cells.iter().all(|c| number(c).is_some()) {
        return Ok(vec![Head { name: None, unit: None }; cells.len()]);
    }
    let mut heads: Vec<Head> = Vec::with_capacity(cells.len());
    for (k, cell) in cells.iter().enumerate() {
        let head =
            head(cell, span).map_err(|why| NoTable::new(Some(line), format!("column {}: {why}", k + 1), FORM))?;
        if let Some(twin) = heads.iter().position(|h| h.name == head.name) {
            let why = format!("columns {} and {} have the same name", twin + 1, k + 1);
            return Err(NoTable::new(Some(line), why, FORM));
        }
        heads.push(head);
    }
    Ok(heads)
}

/// A sign that names are made of.
fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// `q [MPa]`
fn head(cell: &str, span: Span) -> Result<Head, &'static str> {
    let (name, unit) = match cell.split_once('[') {
        Some((name, rest)) => (name, Some(rest.strip_suffix(']').ok_or("the unit has no closing bracket")?)),
        None => (cell, None),
    };
    let name = name.trim().trim_matches('"');
    if name.is_empty() || !name.chars().all(is_word) || name.starts_with(|c: char| c.is_ascii_digit()) {
        return Err("its name is no word of letters, digits and `_`");
    }
    let unit =
        unit.map(|u| factors(u).ok_or("its unit cannot be read; write it as in a scene: [N/mm^2]")).transpose()?;
    Ok(Head { name: Some(name.to_owned()), unit: unit.map(|factors| Unit { factors, places: Vec::new(), span }) })
}

/// `MPa*s/mm^2`, `N mm`; nothing where a scene could not have it.
fn factors(text: &str) -> Option<Vec<(String, i32)>> {
    let mut found = Vec::new();
    let is_sign = |c: char| ['*', '/', '^'].contains(&c);
    let mut bare = String::new();
    for word in text.split_whitespace() {
        // a blank beside a sign says nothing
        if !bare.is_empty() && !bare.ends_with(is_sign) && !word.starts_with(is_sign) {
            bare.push(' ');
        }
        bare.push_str(word);
    }
    if bare.split_once('/').is_some_and(|(_, divisors)| divisors.contains(' ')) {
        return None;
    }
    let (mut rest, mut sign) = (bare.as_str(), 1);
    loop {
        let end = rest.find(['*', '/', ' ']).unwrap_or(rest.len());
        let (name, power) = rest[..end].split_once('^').unwrap_or((&rest[..end], "1"));
        let power = i32::from(power.trim().parse::<i8>().ok()?);
        match name.trim() {
            "1" => {}
            name if name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_word) => {
                found.push((name.to_owned(), sign * power));
            }
            _ => return None,
        }
        if end == rest.len() {
            return Some(found);
        }
        sign = if rest.as_bytes()[end] == b'/' { -1 } else { 1 };
        rest = &rest[end + 1..];
    }
}

/// A number as Rust reads it, words such as `nan` included.
fn number(cell: &str) -> Option<f64> {
    cell.parse().ok()
}

/// Adds a row.
fn take(line: usize, cells: &[&str], columns: &mut [Vec<f64>]) -> Result<(), NoTable> {
    for (k, (cell, column)) in cells.iter().zip(columns).enumerate() {
        let at = |why: &str| NoTable::new(Some(line), format!("column {}: {why}", k + 1), FORM);
        let value = match number(cell) {
            Some(value) => value,
            None if cell.is_empty() => return Err(at("the cell is empty")),
            None => return Err(at("the cell is no number")),
        };
        if !value.is_finite() {
            return Err(at("the number is not finite"));
        }
        column.push(value);
    }
    Ok(())
}

/// Arguments increase, and slopes are numbers.
fn increasing(columns: &[Vec<f64>], lines: &[usize]) -> Result<(), NoTable> {
    const ORDER: &str = "sort the rows by the first column; a jump is two rows a little apart";
    let arguments = &columns[0];
    for k in 1..arguments.len() {
        let (before, here) = (arguments[k - 1], arguments[k]);
        if here <= before {
            let word = if here < before { "is smaller than" } else { "repeats" };
            let why = format!(
                "the argument {here} {word} the one before{}",
                if here < before { format!(", {before}") } else { String::new() }
            );
            return Err(NoTable::new(Some(lines[k]), why, ORDER));
        }
        if let Some(c) = columns.iter().position(|c| !((c[k] - c[k - 1]) / (here - before)).is_finite()) {
            let why = format!("column {}: the slope from the row before is too large for a number", c + 1);
            return Err(NoTable::new(Some(lines[k]), why, ORDER));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::SourceId;

    fn parsed(text: &str) -> Result<Table, NoTable> {
        Table::parse("h.csv", text.into(), Span { source: SourceId::new(0), start: 0, end: 0 })
    }

    fn refused(text: &str) -> String {
        let e = parsed(text).unwrap_err();
        format!("{}: {}", e.line.unwrap_or(0), e.why)
    }

    #[test]
    fn columns_names_and_units() {
        let table =
            parsed("\u{feff}# of a test\r\nt [s], q [MPa*s/mm^2] ,f\r\n0,1,2\r\n\r\n 1e0 ,3,-4.5e-1 # last\r\n")
                .unwrap();
        assert_eq!(table.curves.len(), 2);
        assert_eq!(*table.curves[0].arguments, [0.0, 1.0]);
        assert_eq!(table.curves[1].values, [2.0, -0.45]);
        let unit = table.heads[1].unit.as_ref().unwrap();
        assert_eq!(unit.factors, [("MPa".to_owned(), 1), ("s".to_owned(), 1), ("mm".to_owned(), -2)]);
        let of = |text: &str| factors(text).map(|f| f.into_iter().map(|(n, p)| format!("{n}{p}")).collect::<String>());
        assert_eq!(of("N mm"), of("N*mm"));
        assert_eq!([of(" kN  m ^ 2 / s "), of("kg/m/s^2")], [of("kN*m^2/s"), of("kg*m^-1*s^-2")]);
        assert_eq!([of("J/kg K"), of("N  * / m"), of("")], [None, None, None]);
        assert_eq!(table.heads[2], Head { name: Some("f".to_owned()), unit: None });
        assert!(table.curve(None).is_err() && table.curve(Some("t")).is_err());
        assert_eq!(table.curve(Some("f")).unwrap().name, "\"h.csv\", column `f`");
        let bare = parsed("0,1\n2,3\n").unwrap();
        assert_eq!((bare.curve(None).unwrap().range(), bare.heads[0].name.as_ref()), ((0.0, 2.0), None));
    }

    #[test]
    fn each_defect_has_its_line() {
        assert_eq!(refused(""), "0: it is empty");
        assert_eq!(refused("t,q\n"), "0: it has no row; a table needs two at least");
        assert_eq!(refused("t,q\n0,1\n"), "0: it has one row; a table needs two at least");
        assert_eq!(refused("t;q\n0;1\n"), "1: the cells are separated by `;`");
        assert_eq!(refused("t\n0\n"), "1: there is one column only");
        assert_eq!(refused("t,q\n0,1\n1\n"), "3: 1 cell, the first line has 2");
        assert_eq!(refused("t,q\n0,1\n1,x\n"), "3: column 2: the cell is no number");
        assert_eq!(refused("t,q\n0,1\n1,\n"), "3: column 2: the cell is empty");
        assert_eq!(refused("t,q\n0,1\n1,NaN\n"), "3: column 2: the number is not finite");
        assert_eq!(refused("t,q\n0,1e400\n1,0\n"), "2: column 2: the number is not finite");
        assert_eq!(refused("t,q\n0,1\n0,2\n"), "3: the argument 0 repeats the one before");
        assert_eq!(refused("t,q\n0,1\n\n-1,2\n"), "4: the argument -1 is smaller than the one before, 0");
        assert_eq!(refused("t,t\n0,1\n1,2\n"), "1: columns 1 and 2 have the same name");
        assert_eq!(refused("t,q [MPa\n0,1\n"), "1: column 2: the unit has no closing bracket");
        assert_eq!(
            refused("0,1e308\n1e-300,-1e308\n"),
            "2: column 2: the slope from the row before is too large for a number"
        );
    }

    #[test]
    fn rows_on_a_line_are_no_corners() {
        let table = parsed("0,0\n0.1,0.3\n0.2,0.6\n1,3\n2,3\n4,3\n5,0\n").unwrap();
        assert_eq!(table.curves[0].corners(), [1.0, 4.0]);
    }
}

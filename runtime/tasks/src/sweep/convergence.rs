//! Errors over the size of the cells, with the rates between neighbouring meshes.
//!
//! The size is what the sweep says of it: the knob `h`, or one over `refine`, `cells`, or a parameter `n` of the scene. Rows
//! that differ in nothing else are one line; a line has at least two sizes.

use wfl_charts::{Chart, Scale, Section, Series, Table};

use super::{
    front::{doubt, method, points, quantities, setting, title},
    table::Row,
};

/// Knobs that tell how fine a mesh is, and whether the size is one over them.
const KNOBS: [(&str, bool); 5] =
    [("knob h", false), ("knob refine", true), ("knob cells", true), ("knob n", true), ("knob N", true)];

/// Errors of one setting on meshes of several sizes, the coarsest first.
struct Line {
    name: String,
    /// Size, error, and what is said behind it.
    points: Vec<(f64, f64, &'static str)>,
}

impl Line {
    /// The order between each size and the one before.
    fn rates(&self) -> Vec<f64> {
        let rate = |pair: &[(f64, f64, &str)]| (pair[0].1 / pair[1].1).ln() / (pair[0].0 / pair[1].0).ln();
        self.points.windows(2).map(rate).collect()
    }
}

/// The column of the knob that makes meshes finer, and whether the size is one over it.
fn knob(rows: &[Row]) -> Option<(&'static str, bool)> {
    let several = |column: &str| {
        let mut found: Vec<&str> = rows.iter().map(|r| r.text(column)).filter(|t| !t.is_empty()).collect();
        found.sort_unstable();
        found.dedup();
        found.len() > 1
    };
    KNOBS.into_iter().find(|(column, _)| several(column))
}

/// The size that a row says: of cells in several directions the first.
fn size(row: &Row, knob: (&str, bool)) -> Option<f64> {
    let text = row.text(knob.0).trim_start_matches('[');
    let first: f64 = text.split([',', ']']).next()?.trim().parse().ok()?;
    let size = if knob.1 { 1.0 / first } else { first };
    (size.is_finite() && size > 0.0).then_some(size)
}

fn lines(rows: &[Row], quantity: &str, knob: (&str, bool)) -> Vec<Line> {
    let mut out: Vec<Line> = Vec::new();
    for point in points(rows, quantity).iter().filter(|p| p.error > 0.0) {
        let Some(size) = size(point.row, knob) else { continue };
        let rest = setting(point.row).into_iter().filter(|(column, _)| *column != knob.0);
        let words = rest.map(|(column, value)| match column.strip_prefix("knob ") {
            Some(name) => format!("{name}={value}"),
            None => method(value),
        });
        let name = words.collect::<Vec<_>>().join(" ");
        let entry = (size, point.error, doubt(point, quantity));
        match out.iter_mut().find(|l| l.name == name) {
            Some(line) => line.points.push(entry),
            None => out.push(Line { name, points: vec![entry] }),
        }
    }
    for line in &mut out {
        line.points.sort_by(|a, b| b.0.total_cmp(&a.0));
        line.points.dedup_by(|a, b| a.0 == b.0);
    }
    out.retain(|l| l.points.len() > 1);
    out
}

/// A plot of error over size for each quantity, with the name of its file.
pub(super) fn charts(rows: &[Row]) -> Vec<(String, Chart)> {
    let Some(knob) = knob(rows) else { return Vec::new() };
    let (fields, _) = quantities(rows);
    let mut out = Vec::new();
    for quantity in fields {
        let lines = lines(rows, &quantity, knob);
        if lines.is_empty() {
            continue;
        }
        let mut chart = Chart::new(title(&quantity)).x(axis(knob), Scale::Log).y("relative error [-]", Scale::Log);
        for line in lines {
            let last = line.rates().last().copied().unwrap_or(f64::NAN);
            let name = format!("{}, rate {last:.2}", line.name);
            chart = chart.line_points(Series::new(name, line.points.iter().map(|p| [p.0, p.1])));
        }
        out.push((file(&quantity), chart));
    }
    out
}

/// The file of a plot, without its ending.
pub(super) fn file(quantity: &str) -> String {
    let word: String = quantity.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!("convergence_{word}")
}

fn axis(knob: (&str, bool)) -> String {
    let name = knob.0.strip_prefix("knob ").unwrap_or(knob.0);
    if knob.1 { format!("1/{name}") } else { name.to_owned() }
}

/// The section of the page; `None` where nothing was made finer.
pub(super) fn section(rows: &[Row]) -> Option<Section> {
    let charts = charts(rows);
    let knob = knob(rows).filter(|_| !charts.is_empty())?;
    let mut section = Section::new("Error over the size of the cells").text(
        "The rate is that between a size and the one before: the order of the error. That of the finest two stands at the line.",
    );
    for (_, chart) in &charts {
        section = section.chart(chart);
    }
    let mut table =
        Table::new(["quantity".to_owned(), "setting".to_owned(), axis(knob), "error".to_owned(), "rate".to_owned()]);
    let (fields, _) = quantities(rows);
    for quantity in fields {
        for line in lines(rows, &quantity, knob) {
            let rates = line.rates();
            for (k, (size, error, doubt)) in line.points.iter().enumerate() {
                let rate = k.checked_sub(1).map_or_else(String::new, |k| format!("{:.2}", rates[k]));
                let words = [title(&quantity), line.name.clone(), wfl_charts::short(*size)];
                let [quantity, name, size] = words;
                table.row([quantity, name, size, format!("{error:.2e}{doubt}"), rate]);
            }
        }
    }
    Some(section.table(table))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(knobs: &[(&str, &str)], error: f64) -> Row {
        let mut row = Row::default();
        row.set("scene", "a.wfl");
        for (name, value) in knobs {
            row.set(format!("knob {name}"), *value);
        }
        row.set("status", "ok");
        row.number("time", 1.0);
        row.number("error L2", error);
        row
    }

    #[test]
    fn rates_are_between_neighbouring_sizes_of_one_setting() {
        let mut rows = Vec::new();
        for (degree, order) in [("1", 2), ("2", 3)] {
            // not in the order of the sizes
            for n in [4, 1, 2] {
                let error = 0.1 / f64::from(n).powi(order);
                rows.push(row(&[("refine", &n.to_string()), ("degree", degree)], error));
            }
        }
        let lines = lines(&rows, "L2", knob(&rows).unwrap());
        let found: Vec<(String, Vec<i32>)> =
            lines.iter().map(|l| (l.name.clone(), l.rates().iter().map(|r| r.round() as i32).collect())).collect();
        assert_eq!(found, [("a degree=1".to_owned(), vec![2, 2]), ("a degree=2".to_owned(), vec![3, 3])]);
        let (name, chart) = &charts(&rows)[0];
        let text = chart.svg();
        assert!(
            name == "convergence_L2"
                && text.contains("rate 2.00")
                && text.contains("rate 3.00")
                && text.contains("1/refine")
        );
        assert!(section(&rows).is_some());
    }

    #[test]
    fn cells_in_several_directions_count_by_the_first_and_one_size_is_no_line() {
        let rows = [row(&[("cells", "[8,4]")], 0.1), row(&[("cells", "[16,8]")], 0.025)];
        assert_eq!(lines(&rows, "L2", knob(&rows).unwrap())[0].rates(), [2.0]);
        assert!(charts(&rows[..1]).is_empty() && section(&rows[..1]).is_none());
    }
}

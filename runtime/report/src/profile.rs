//! Profiles along the lines that a scene asks for, and charts over the steps.

use wfl_charts::{Chart, Scale, Section, Series, short};

use crate::{
    events,
    folder::{ReportError, RunFolder},
    picture::{Picture, at_step, over_steps},
    table::Columns,
};

/// Part of the largest number of a quantity below which a component, or a change, is only rounding.
const ROUNDING: f64 = 1e-9;

/// A section for every table: scalars at the chosen steps, components of vectors and matrices at the last of them.
pub(crate) fn sections(run: &RunFolder, chosen: &[usize]) -> Result<Vec<(Section, Vec<Picture>)>, ReportError> {
    let mut sections = Vec::new();
    for series in &run.tables {
        let mut tables = Vec::new();
        for (step, file) in series.steps.iter().filter(|(s, _)| chosen.contains(s)) {
            tables.push((*step, Columns::read(file)?));
        }
        let Some((last, columns)) = tables.last() else { continue };
        let mut section = Section::new(format!("Along the line of {}", series.name)).text(ends(run, columns));
        let mut pictures = Vec::new();
        for group in groups(run, columns) {
            let chart = chart(run, &group);
            let chart = match group.columns[..] {
                [column] => over_steps(run, chart, tables.iter().map(|(s, c)| (*s, points(c, column))).collect()),
                _ => components(chart.titled(format!("{}, {}", group.name, at_step(run, *last))), columns, &group),
            };
            section = section.chart(&chart);
            pictures.push(Picture::new(&format!("{}_{}", series.name, group.name), chart));
        }
        sections.push((section, pictures));
    }
    Ok(sections)
}

/// The columns of one quantity.
struct Group {
    name: String,
    columns: Vec<usize>,
}

/// Where the line runs.
fn ends(run: &RunFolder, columns: &Columns) -> String {
    let dim = usize::try_from(run.report.mesh.dim).unwrap_or(0);
    let place = |last: bool| {
        let value = |c: &Vec<f64>| if last { c.last().copied() } else { c.first().copied() };
        let x = columns.values.iter().skip(1).take(dim).filter_map(value);
        format!("[{}]", x.map(short).collect::<Vec<_>>().join(", "))
    };
    format!("From {} to {}; s is the distance from the first end.", place(false), place(true))
}

/// Columns by quantity: `u_1`, `u_2` belong to `u`. Columns that are rounding, and the mirrored entries of a symmetric
/// matrix, are left out.
fn groups(run: &RunFolder, columns: &Columns) -> Vec<Group> {
    let first = 1 + usize::try_from(run.report.mesh.dim).unwrap_or(0);
    let mut groups: Vec<Group> = Vec::new();
    for (k, column) in columns.names.iter().enumerate().skip(first) {
        let name = quantity_of(column);
        match groups.iter_mut().find(|g| g.name == name) {
            Some(group) => group.columns.push(k),
            None => groups.push(Group { name: name.to_owned(), columns: vec![k] }),
        }
    }
    for group in &mut groups {
        let size = |k: usize| columns.values[k].iter().filter(|x| x.is_finite()).fold(0.0f64, |m, x| m.max(x.abs()));
        let largest = group.columns.iter().map(|k| size(*k)).fold(0.0, f64::max);
        let same = |a: usize, b: usize| {
            let pairs = columns.values[a].iter().zip(&columns.values[b]);
            pairs.into_iter().all(|(a, b)| (a - b).abs() <= ROUNDING * largest || (a.is_nan() && b.is_nan()))
        };
        let all = group.columns.clone();
        group.columns.retain(|k| size(*k) > ROUNDING * largest);
        let mirror = |k: usize| all.iter().copied().find(|o| *o < k && mirrored(&columns.names[*o], &columns.names[k]));
        group.columns.retain(|k| mirror(*k).is_none_or(|o| !same(o, *k)));
        if group.columns.is_empty() {
            group.columns.push(all[0]);
        }
    }
    groups
}

/// `stress_12` as `stress`: the name without its indices.
fn quantity_of(column: &str) -> &str {
    let index = |i: &str| (1..=3).contains(&i.len()) && i.bytes().all(|b| (b'1'..=b'9').contains(&b));
    column.rsplit_once('_').filter(|(name, i)| !name.is_empty() && index(i)).map_or(column, |(name, _)| name)
}

/// The entries `12` and `21` of one matrix.
fn mirrored(a: &str, b: &str) -> bool {
    let index = |column: &str| column.rsplit_once('_').map(|(_, i)| i.to_owned()).filter(|i| i.len() == 2);
    match (index(a), index(b)) {
        (Some(i), Some(j)) => i != j && i.chars().rev().eq(j.chars()),
        _ => false,
    }
}

fn chart(run: &RunFolder, group: &Group) -> Chart {
    Chart::new(&group.name)
        .x(run.with_unit("s", "X"), Scale::Linear)
        .y(run.with_unit(&group.name, &group.name), Scale::Linear)
}

/// Points where the quantity lives; the line may leave its body, and that is nothing to count.
fn points(columns: &Columns, column: usize) -> Vec<[f64; 2]> {
    let all = columns.values[0].iter().zip(&columns.values[column]);
    all.filter(|(_, v)| !v.is_nan()).map(|(s, v)| [*s, *v]).collect()
}

fn components(mut chart: Chart, columns: &Columns, group: &Group) -> Chart {
    for column in &group.columns {
        let name = columns.names[*column].strip_prefix(&format!("{}_", group.name)).unwrap_or_default();
        chart = chart.line(Series::new(format!("component {name}"), points(columns, *column)));
    }
    chart
}

/// Measures over the steps, a chart each; nothing in a run of one step, where the table says it all.
pub(crate) fn measures(run: &RunFolder) -> Vec<Picture> {
    let steps = &run.report.steps;
    let Some(first) = steps.first().filter(|_| steps.len() > 1) else { return Vec::new() };
    let names = first.measures.iter().map(|(name, _)| name);
    let chart = |name: &str| {
        let empty = events::marked(run, Chart::new(name));
        let points = without_rounding(steps.iter().filter_map(|s| Some([s.t.0, s.measures.get(name)?.0])).collect());
        empty
            .x(run.with_unit(run.variable(), run.variable()), Scale::Linear)
            .y(run.with_unit(name, name), Scale::Linear)
            .size(330.0, 240.0)
            .line_points(Series::new(name, points))
    };
    names.map(|name| Picture::new(&format!("measure_{name}"), chart(name))).collect()
}

/// Values that are the same but for rounding, on one level; others as they are. A chart would show the rounding as data.
fn without_rounding(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let range = |v: &dyn Fn(f64) -> f64| points.iter().map(|p| v(p[1])).fold(f64::NEG_INFINITY, f64::max);
    let (high, low, size) = (range(&|y| y), -range(&|y| -y), range(&f64::abs));
    if points.iter().all(|p| p[1].is_finite()) && high - low <= ROUNDING * size {
        points.iter_mut().for_each(|p| p[1] = f64::midpoint(low, high));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_one_quantity_belong_together() {
        assert_eq!(
            ["u_1", "stress_12", "max_slip", "u_0", "_1"].map(quantity_of),
            ["u", "stress", "max_slip", "u_0", "_1"]
        );
        assert!(mirrored("s_12", "s_21") && !mirrored("s_11", "s_11") && !mirrored("s_12", "s_13"));
    }

    #[test]
    fn a_measure_that_stays_is_drawn_as_a_level_line() {
        let drawn =
            |values: [f64; 3]| without_rounding(values.map(|y| [0.0, y]).to_vec()).iter().map(|p| p[1]).collect();
        let level: Vec<f64> = drawn([2.0, 2.0 + 4e-16, 2.0 - 4e-16]);
        assert_eq!(level, [2.0; 3]);
        let moving: Vec<f64> = drawn([1.0, 1.0 + 1e-6, 1.0]);
        assert_eq!(moving, [1.0, 1.0 + 1e-6, 1.0]);
        let nothing: Vec<f64> = drawn([0.0; 3]);
        assert_eq!(nothing, [0.0; 3]);
        // of a value that is not a number nothing is known
        let broken: Vec<f64> = drawn([f64::INFINITY, 1.0, 2.0]);
        assert_eq!(broken, [f64::INFINITY, 1.0, 2.0]);
    }
}

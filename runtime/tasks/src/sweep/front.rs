//! Evaluation of a table of runs: the Pareto front, the cheapest setting for a demanded error, and the main source of
//! the error of a run. Reads rows only.

use wfl_adapt::compare::MEASURE;

use super::table::{Row, columns};

/// Wanted errors of the table of cheapest settings.
pub(super) const WANTED: [(f64, &str); 4] = [(1e-1, "10 %"), (1e-2, "1 %"), (1e-3, "0.1 %"), (1e-4, "0.01 %")];

/// The column with the knobs that make a row another problem.
pub(super) const PROBLEM: &str = "problem";

/// Below this an error is rounding.
const ROUNDING: f64 = 1e-11;
/// The error of a reference says nothing about runs whose error is less than so many times as large.
pub(super) const TRUSTED: f64 = 3.0;
/// A reference with this error of its own knows nothing.
const UNKNOWN: f64 = 0.5;
/// A knob matters where its best value takes away at least this part of the error.
const MATTERS: f64 = 0.1;

/// A run with a finite error and a time.
#[derive(Clone, Copy)]
pub(super) struct Point<'r> {
    pub(super) row: &'r Row,
    /// Relative error of one quantity.
    pub(super) error: f64,
    /// Wall time in seconds, the median of the repetitions.
    pub(super) time: f64,
}

/// Quantities with errors: norms and outputs first, measures behind them.
pub(super) fn quantities(rows: &[Row]) -> (Vec<String>, Vec<String>) {
    let all = columns(rows);
    let named = all.iter().filter_map(|c| c.strip_prefix("error ")).map(str::to_owned);
    let has = |column: String| all.contains(&column.as_str());
    // an output and a measure may have one name: the measure is then told apart
    let measured = |n: &String| has(format!("measure {n}")) && !has(format!("error {MEASURE}{n}"));
    named.partition(|name| !name.starts_with(MEASURE) && !measured(name))
}

/// The runs whose reference knows a quantity well enough to say anything: one that is zero but for rounding has no
/// relative error.
pub(super) fn known_points<'r>(rows: &'r [Row], quantity: &str) -> Vec<Point<'r>> {
    let mut known = points(rows, quantity);
    known.retain(|p| own_error(p.row, quantity) < UNKNOWN);
    known
}

/// What is said behind a setting whose error is no larger than that of its reference may be; nothing for others.
pub(super) fn doubt(point: &Point<'_>, quantity: &str) -> &'static str {
    let own = own_error(point.row, quantity);
    if own > ROUNDING && point.error < TRUSTED * own { " (not resolved by the reference)" } else { "" }
}

/// The estimated error of the reference of a row; 0 where the solution is exact.
fn own_error(row: &Row, quantity: &str) -> f64 {
    row.value(&format!("reference error {quantity}")).unwrap_or(0.0)
}

/// The runs that have an error of a quantity.
pub(super) fn points<'r>(rows: &'r [Row], quantity: &str) -> Vec<Point<'r>> {
    let column = format!("error {quantity}");
    let point = |row: &'r Row| {
        let (error, time) = (row.value(&column)?, row.value("time")?);
        row.is_solved().then_some(Point { row, error, time })
    };
    rows.iter().filter_map(point).collect()
}

/// The points of each problem that the sweep solves: only those of one can be compared.
pub(super) fn problems<'r>(points: &[Point<'r>]) -> Vec<Vec<Point<'r>>> {
    let mut out: Vec<Vec<Point<'r>>> = Vec::new();
    for point in points {
        match out.iter_mut().find(|p| p[0].row.text(PROBLEM) == point.row.text(PROBLEM)) {
            Some(found) => found.push(*point),
            None => out.push(vec![*point]),
        }
    }
    out
}

/// The points that no other one of the same problem beats in time and error, by growing time.
pub(super) fn front<'r>(points: &[Point<'r>]) -> Vec<Point<'r>> {
    problems(points).iter().flat_map(|p| front_of_one(p)).collect()
}

fn front_of_one<'r>(points: &[Point<'r>]) -> Vec<Point<'r>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.error.total_cmp(&b.error)));
    let mut out: Vec<Point<'r>> = Vec::new();
    for point in sorted {
        if out.last().is_none_or(|best| point.error < best.error) {
            out.push(point);
        }
    }
    out
}

/// The cheapest run with at most this error.
pub(super) fn cheapest<'r>(points: &[Point<'r>], wanted: f64) -> Option<Point<'r>> {
    points.iter().filter(|p| p.error <= wanted).min_by(|a, b| a.time.total_cmp(&b.time)).copied()
}

/// A quantity in words.
pub(super) fn title(quantity: &str) -> String {
    match quantity {
        "L2" => "unknowns (L2)".to_owned(),
        "H1" => "gradients of the unknowns (H1)".to_owned(),
        other => other.to_owned(),
    }
}

/// The method and knobs of a row as texts: column and value.
pub(super) fn setting(row: &Row) -> Vec<(&str, &str)> {
    row.columns().filter(|c| *c == "scene" || c.starts_with("knob ")).map(|c| (c, row.text(c))).collect()
}

/// The setting in words: the scene without folder and ending, and the knobs.
pub(super) fn words(row: &Row) -> String {
    let word = |(column, value): (&str, &str)| match column.strip_prefix("knob ") {
        Some(_) if value.is_empty() => None,
        Some(name) => Some(format!("{name}={value}")),
        None => Some(method(value)),
    };
    setting(row).into_iter().filter_map(word).collect::<Vec<_>>().join(" ")
}

/// The name of a scene.
pub(super) fn method(scene: &str) -> String {
    std::path::Path::new(scene).file_stem().map_or_else(|| scene.to_owned(), |s| s.to_string_lossy().into_owned())
}

/// Where the error of a run mostly comes from: the knob whose best value takes most of it away.
///
/// `mesh` for a knob that changes the number of unknowns, `tolerance`, `integration`, `method` (the scene), else the
/// name of the parameter; `reference` and `rounding` where the error is too small to tell; `not in the sweep` where no
/// knob helps.
pub(super) fn source(point: Point<'_>, all: &[Point<'_>], quantity: &str) -> String {
    if point.error < ROUNDING {
        return "rounding".to_owned();
    }
    if !doubt(&point, quantity).is_empty() {
        return "reference".to_owned();
    }
    let here = setting(point.row);
    let mut best: Option<(f64, Point<'_>, &str)> = None;
    for other in all.iter().filter(|o| o.row.text(PROBLEM) == point.row.text(PROBLEM)) {
        let there = setting(other.row);
        let mut changed = here.iter().filter(|k| !there.contains(k));
        let (Some((column, _)), None) = (changed.next(), changed.next()) else { continue };
        let gain = 1.0 - other.error / point.error;
        if gain > MATTERS && best.is_none_or(|b| gain > b.0) {
            best = Some((gain, *other, column));
        }
    }
    let Some((_, other, column)) = best else { return "not in the sweep".to_owned() };
    let sized = |r: &Row| (r.text("dofs").to_owned(), r.text("cells").to_owned());
    match column.strip_prefix("knob ") {
        None => "method".to_owned(),
        Some("tol") => "tolerance".to_owned(),
        Some("quadrature") => "integration".to_owned(),
        Some(_) if sized(other.row) != sized(point.row) => "mesh".to_owned(),
        Some(name) => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(h: &str, gamma: &str, status: &str, time: f64, error: f64) -> Row {
        let mut row = Row::default();
        row.set("scene", "a/penalty.wfl");
        row.set("knob h", h);
        row.set("knob gamma", gamma);
        row.set("status", status);
        row.set("dofs", h);
        row.number("time", time);
        row.number("error H1", error);
        row
    }

    fn table() -> Vec<Row> {
        vec![
            row("1", "10", "ok", 1.0, 0.2),
            row("1", "100", "ok", 1.5, 0.19),
            row("0.5", "10", "ok", 3.0, 0.08),
            row("0.5", "100", "ok", 2.5, 0.05),
            row("0.25", "10", "not converged", 0.1, 1e-9),
            row("0.25", "100", "not finite", 0.1, f64::NAN),
        ]
    }

    #[test]
    fn the_front_has_what_nothing_beats_and_no_failure() {
        let rows = table();
        let points = points(&rows, "H1");
        assert_eq!(points.len(), 4);
        let front: Vec<f64> = front(&points).iter().map(|p| p.time).collect();
        assert_eq!(front, [1.0, 1.5, 2.5]);
        assert_eq!(cheapest(&points, 0.1).map(|p| words(p.row)), Some("penalty h=0.5 gamma=100".to_owned()));
        assert!(cheapest(&points, 0.01).is_none());
    }

    #[test]
    fn settings_of_different_problems_do_not_beat_each_other() {
        let mut rows = table();
        rows[1].set(PROBLEM, "q=1");
        rows[3].set(PROBLEM, "q=1");
        let points = points(&rows, "H1");
        let front: Vec<f64> = front(&points).iter().map(|p| p.time).collect();
        assert_eq!(front, [1.0, 3.0, 1.5, 2.5]);
        assert_eq!(source(points[2], &points, "H1"), "not in the sweep");
    }

    #[test]
    fn the_source_of_an_error_is_the_knob_that_takes_most_of_it_away() {
        let rows = table();
        let points = points(&rows, "H1");
        let of = |k: usize| source(points[k], &points, "H1");
        assert_eq!([of(0), of(1), of(2), of(3)], ["mesh", "mesh", "gamma", "not in the sweep"]);
    }
}

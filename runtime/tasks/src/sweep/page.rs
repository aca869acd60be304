//! `sweep.html` and one SVG file a plot, made from the table alone.
//!
//! Every row is shown somewhere: solved runs in the plots and the table of all runs, failures in a table of their own.

use wfl_charts::{Chart, Colour, Page, Scale, Section, Series, Table};
use wfl_output::{OutputDir, OutputError};

use super::{
    convergence,
    front::{
        PROBLEM, Point, TRUSTED, WANTED, cheapest, doubt, front, known_points, method, points, problems, quantities,
        source, title, words,
    },
    table::{Row, SOLVED, write_text},
};

/// The name of the page in the folder of a sweep.
pub(super) const PAGE_FILE: &str = "sweep.html";

/// Writes page and plots into the folder of a sweep.
pub(super) fn write(dir: &OutputDir, rows: &[Row]) -> Result<(), OutputError> {
    for (name, chart) in charts(rows).into_iter().chain(convergence::charts(rows)) {
        write_text(dir, &format!("{name}.svg"), &chart.svg())?;
    }
    write_text(dir, PAGE_FILE, &page(rows).html())
}

/// A plot of time over error for each quantity, with the name of its file.
pub(super) fn charts(rows: &[Row]) -> Vec<(String, Chart)> {
    let (fields, _) = quantities(rows);
    let plots = fields.iter().map(|q| (q, points(rows, q))).filter(|(_, p)| !p.is_empty());
    plots.map(|(q, p)| (plot_name(q), chart(q, &p))).collect()
}

/// A plot with one more line: runs on meshes that were refined where the error comes from, error and time of each.
pub(super) fn with_refined(chart: Chart, runs: &[[f64; 2]]) -> Chart {
    if runs.is_empty() { chart } else { chart.line_points(Series::new("refined locally", runs.iter().copied())) }
}

/// The file of a plot, without its ending.
pub(super) fn plot_name(quantity: &str) -> String {
    let word: String = quantity.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!("trade_{word}")
}

/// The error of the gradients of a scene over its unknowns: uniform meshes by degree, and the way of a search.
pub(super) fn over_unknowns(scene: &str, rows: &[Row], way: &[[f64; 2]]) -> Chart {
    let mut chart = Chart::new(format!("{scene}: gradients of the unknowns (H1)"))
        .x("unknowns", Scale::Log)
        .y("relative error [-]", Scale::Log);
    let own = || points(rows, "H1").into_iter().filter(|p| method(p.row.text("scene")) == scene);
    let mut degrees: Vec<&str> = own().map(|p| p.row.text("knob degree")).collect();
    degrees.sort_unstable();
    degrees.dedup();
    for degree in degrees {
        let of = own().filter(|p| p.row.text("knob degree") == degree);
        let points = of.filter_map(|p| Some([p.row.value("dofs")?, p.error]));
        chart = chart.line_points(Series::new(format!("uniform, degree {degree}"), points));
    }
    chart.line_points(Series::new("refined locally, estimated", way.iter().copied()))
}

fn chart(quantity: &str, points: &[Point<'_>]) -> Chart {
    let label = format!("relative error of {} [-]", title(quantity));
    let mut chart = Chart::new(title(quantity)).x(label, Scale::Log).y("time [s]", Scale::Log);
    let mut scenes: Vec<&str> = Vec::new();
    for point in points {
        let scene = point.row.text("scene");
        if !scenes.contains(&scene) {
            scenes.push(scene);
        }
    }
    for scene in scenes {
        let of: Vec<&Point<'_>> = points.iter().filter(|p| p.row.text("scene") == scene).collect();
        let note = |p: &&Point<'_>| {
            format!(
                "{}\nerror {:.2e}, {:.3} s\n{} unknowns, {} iterations\nmain source: {}",
                words(p.row),
                p.error,
                p.time,
                p.row.text("dofs"),
                p.row.text("iterations"),
                source(**p, points, quantity)
            )
        };
        let notes: Vec<String> = of.iter().map(note).collect();
        chart = chart.points(Series::new(method(scene), of.iter().map(|p| [p.error, p.time])).notes(notes));
    }
    for problem in problems(points) {
        let best = front(&problem).into_iter().map(|p| [p.error, p.time]);
        chart = chart.line(Series::new("front", best).colour(Colour::Ink));
    }
    chart
}

fn page(rows: &[Row]) -> Page {
    let failures: Vec<&Row> = rows.iter().filter(|r| r.text("status") != SOLVED).collect();
    let (fields, _) = quantities(rows);
    let solved = rows.iter().filter(|r| r.is_solved()).count();
    let mut page = Page::new("Accuracy against computing time")
        .lead(format!(
            "{}. Each point is a run; failed runs are listed below.",
            ended(rows.len() - solved, failures.len() + solved - rows.len(), &format!("{solved} runs solved"))
        ))
        .section(about(rows));
    let mut plots = Section::new("Computing time over error").text(
        "Lower and further left is better. The line is the Pareto front: no run is both faster and more accurate than a run on it.",
    );
    for (_, chart) in charts(rows) {
        plots = plots.chart(&chart);
    }
    page = page.section(plots);
    page = convergence::section(rows).into_iter().fold(page, Page::section);
    let wanted = wanted(rows);
    page = page.section(
        Section::new("Demanded error and cheapest setting")
            .text("The fastest run of the table whose error is at most the demanded one. Quantities that the reference does not resolve are omitted here; the plots have them.")
            .table(wanted),
    );
    for quantity in &fields {
        let all = points(rows, quantity);
        if !all.is_empty() {
            page = page.section(
                Section::new(format!("Pareto front: {}", title(quantity)))
                    .text("The main source of the error is the setting whose best value reduces the error most.")
                    .table(fronts(&all, quantity)),
            );
        }
    }
    if !failures.is_empty() {
        let mut table = Table::new(["setting", "status", "time [s]", "message"]);
        for row in failures {
            table.row([words(row), row.text("status").to_owned(), seconds(row), row.text("message").to_owned()]);
        }
        page = page.section(Section::new("Failures").table(table));
    }
    page.section(Section::new("All runs").table(all(rows, &fields)))
}

/// How many runs failed, and of how many an expectation does not hold, behind how many there are.
pub(super) fn ended(failed: usize, not_as_expected: usize, all: &str) -> String {
    match not_as_expected {
        0 => format!("{all}, {failed} failed"),
        n => format!("{all}, {failed} failed, {n} not as the scene expects"),
    }
}

fn about(rows: &[Row]) -> Section {
    let mut facts = Vec::new();
    for column in ["machine", "version", "commit", "threads", "repeats", "reference"] {
        let mut found: Vec<&str> = rows.iter().map(|r| r.text(column)).filter(|t| !t.is_empty()).collect();
        found.sort_unstable();
        found.dedup();
        facts.push((column, found.join("; ")));
    }
    let mut section = Section::new("What was run").facts(facts);
    let own = |q: &String| {
        let column = format!("reference error {q}");
        let largest = rows.iter().filter_map(|r| r.value(&column)).max_by(f64::total_cmp)?;
        Some((title(q), largest))
    };
    let mut table = Table::new(["quantity", "estimated error of the reference"]);
    let (fields, measures) = quantities(rows);
    for (name, error) in fields.iter().chain(&measures).filter_map(own) {
        table.row([name, format!("{error:.1e}")]);
    }
    if !table.is_empty() {
        section = section
            .text(format!(
                "The error of the reference is estimated by Richardson extrapolation from coarser meshes and from the distance to the reference of another method. Errors below {TRUSTED} times that estimate are not significant.",
            ))
            .table(table);
    }
    section
}

/// The cheapest run for each demanded error of each quantity, or one of the runs without it: problem by problem.
fn demands<'r>(rows: &'r [Row]) -> Vec<(String, &'static str, Result<Point<'r>, Point<'r>>)> {
    let (fields, measures) = quantities(rows);
    let mut out = Vec::new();
    for quantity in fields.into_iter().chain(measures) {
        for problem in problems(&known_points(rows, &quantity)) {
            let found = |error| cheapest(&problem, error).ok_or(problem[0]);
            out.extend(WANTED.map(|(error, word)| (quantity.clone(), word, found(error))));
        }
    }
    out
}

/// What stands in a table where no run has the demanded error.
fn none_of(point: &Point<'_>) -> String {
    match point.row.text(PROBLEM) {
        "" => "none of these runs".to_owned(),
        problem => format!("none of these runs with {problem}"),
    }
}

fn wanted(rows: &[Row]) -> Table {
    let mut table = Table::new(["quantity", "demanded error", "cheapest setting", "time [s]", "error"]);
    for (quantity, word, found) in demands(rows) {
        let name = title(&quantity);
        match found {
            Ok(p) => {
                let setting = words(p.row) + doubt(&p, &quantity);
                table.row([name, word.into(), setting, seconds(p.row), format!("{:.1e}", p.error)]);
            }
            Err(other) => table.row([name, word.into(), none_of(&other)]),
        }
    }
    table
}

fn fronts(all: &[Point<'_>], quantity: &str) -> Table {
    let mut table = Table::new(["setting", "time [s]", "error", "main source", "unknowns", "iterations"]);
    for point in front(all) {
        table.row([
            words(point.row),
            seconds(point.row),
            format!("{:.1e}", point.error),
            source(point, all, quantity),
            point.row.text("dofs").to_owned(),
            point.row.text("iterations").to_owned(),
        ]);
    }
    table
}

fn all(rows: &[Row], quantities: &[String]) -> Table {
    let head = ["setting", "status", "time [s]", "unknowns", "iterations", "factorisations"].map(str::to_owned);
    let mut table = Table::new(head.into_iter().chain(quantities.iter().map(|q| format!("error {q}"))));
    for row in rows {
        let mut cells = vec![words(row), row.text("status").to_owned(), seconds(row)];
        cells.extend(["dofs", "iterations", "factorisations"].map(|c| row.text(c).to_owned()));
        let error = |q: &String| match row.text(&format!("error {q}")) {
            "" => String::new(),
            text => text.parse::<f64>().map_or_else(|_| text.to_owned(), |e| format!("{e:.1e}")),
        };
        cells.extend(quantities.iter().map(error));
        table.row(cells);
    }
    table
}

fn seconds(row: &Row) -> String {
    row.value("time").map_or_else(String::new, |t| format!("{t:.3}"))
}

/// The same tables in Markdown, for a study: demanded errors and Pareto fronts; nothing where no error is known.
pub(super) fn markdown(rows: &[Row]) -> String {
    let head = "| quantity | demanded error | cheapest setting | time [s] | error |\n|---|---|---|---|---|\n";
    let mut text = String::new();
    for (quantity, word, found) in demands(rows) {
        let name = title(&quantity);
        match found {
            Ok(p) => {
                let (time, doubt) = (seconds(p.row), doubt(&p, &quantity));
                text += &format!("| {name} | {word} | `{}`{doubt} | {time} | {:.1e} |\n", words(p.row), p.error);
            }
            Err(other) => text += &format!("| {name} | {word} | {} | | |\n", none_of(&other)),
        }
    }
    if text.is_empty() { text } else { format!("{head}{text}") }
}

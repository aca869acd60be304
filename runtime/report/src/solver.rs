//! How the run went: facts, failures, iterations, contact counts, time, checks.

use wfl_charts::{Bar, Chart, Colour, Scale, Section, Series, Table, short};
use wfl_output::{ParameterValue, StepReport};

use crate::{
    events,
    folder::RunFolder,
    picture::{Picture, STATES, over_steps},
};

/// The facts and everything that a reader must not miss.
pub(crate) fn summary(run: &RunFolder) -> Section {
    let report = &run.report;
    let good = report.steps.iter().filter(|s| s.converged).count();
    let iterations: u64 = report.steps.iter().map(|s| s.iterations).sum();
    let kinds: Vec<String> = report.mesh.kinds.iter().map(|(kind, n)| format!("{n} {}", cells(kind, *n))).collect();
    let mut facts = vec![
        ("unknowns".to_owned(), report.dofs.to_string()),
        ("mesh".to_owned(), format!("{}-D, {}", report.mesh.dim, kinds.join(", "))),
        ("steps".to_owned(), format!("{good} of {} converged", report.steps.len())),
        ("iterations".to_owned(), iterations.to_string()),
        ("time".to_owned(), format!("{} s on {} threads", short(report.timings.total), report.threads)),
    ];
    #[expect(clippy::cast_precision_loss, reason = "shown with four digits")]
    let megabytes = |bytes: u64| format!("{} MB", short((bytes as f64 / 1e6).round()));
    let by_rank = &report.peak_memory_by_rank;
    if let Some(most) = by_rank.iter().max() {
        let (most, all, n) = (megabytes(*most), megabytes(by_rank.iter().sum()), by_rank.len());
        facts.push(("memory".to_owned(), format!("at most {most} on each of {n} ranks, {all} in all")));
    } else if let Some(bytes) = report.peak_memory_bytes {
        facts.push(("memory".to_owned(), megabytes(bytes)));
    }
    let mut section = Section::new("The run").facts(facts);
    if let Some(solver) = report.solver.as_ref().filter(|s| !s.is_empty()) {
        section = section.text(format!("Solver: {solver}."));
    }
    for failure in failures(run) {
        section = section.failure(failure);
    }
    for warning in &report.warnings {
        section = section.warning(warning.as_str());
    }
    section
}

/// The word for cells of a kind: `1 hexahedron`, `512 hexahedra`.
fn cells(kind: &str, n: u64) -> String {
    match kind.strip_suffix("hedron") {
        _ if n == 1 => kind.to_owned(),
        Some(stem) => format!("{stem}hedra"),
        None => format!("{kind}s"),
    }
}

/// What was not done because the scene does not need it.
pub(crate) fn left_out(run: &RunFolder) -> Section {
    let list = &run.report.left_out;
    let measured = list.iter().any(|l| l.times.is_some());
    let mut heads = vec!["what", "why", "turned off by"];
    if measured {
        heads.extend(["ratio of times without it", "change of measures without it"]);
    }
    let mut table = Table::new(heads);
    for l in list {
        let mut row = vec![l.name.clone(), l.why.clone(), l.switch.clone().unwrap_or_default()];
        if measured {
            row.extend([l.times, l.moved].map(|x| x.map_or(String::new(), |x| short(x.0))));
        }
        table.row(row);
    }
    let section = Section::new("What was not needed");
    if table.is_empty() { section } else { section.table(table) }
}

/// Why this result is not to be trusted, if so.
fn failures(run: &RunFolder) -> Vec<String> {
    let mut found: Vec<String> = run.report.error.iter().map(|e| format!("The run ended with an error: {e}")).collect();
    for step in run.report.steps.iter().filter(|s| !s.converged) {
        let residual = step.residual.last().map_or(f64::NAN, |r| r.0);
        found.push(format!(
            "Step {} = {} did not converge in {} iterations: residual {}.",
            run.variable(),
            short(step.t.0),
            step.iterations,
            short(residual)
        ));
    }
    let broken = run.report.checks.iter().filter(|(_, check)| !check.ok);
    found.extend(broken.map(|(name, check)| format!("Violated: {name} (found {})", short(check.value.0))));
    let finite = |s: &StepReport| s.measures.iter().all(|(_, v)| v.0.is_finite());
    if run.report.steps.iter().any(|s| !finite(s)) {
        found.push("A measure is not a finite number at some step.".to_owned());
    }
    found
}

/// Residuals of all steps, and how many iterations each took.
pub(crate) fn newton(run: &RunFolder) -> (Section, Vec<Picture>) {
    let steps = &run.report.steps;
    let mut residuals = Vec::new();
    for (k, step) in steps.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "few iterations")]
        let points: Vec<[f64; 2]> = step.residual.iter().enumerate().map(|(i, r)| [i as f64, r.0]).collect();
        residuals.push((k, points));
    }
    let chart =
        Chart::new("Residual in each step").x("iteration", Scale::Linear).y("relative residual [-]", Scale::Log);
    let mut pictures = vec![Picture::new("newton", over_steps(run, chart, residuals))];
    if steps.len() > 1 {
        pictures.push(Picture::new("iterations", iterations(run)));
    }
    let mut section = Section::new("Newton");
    for picture in &pictures {
        section = section.chart(&picture.chart);
    }
    let attempts = attempts(run);
    if !attempts.is_empty() {
        section = section.text("Load steps that were solved in smaller increments:").table(attempts);
    }
    (section, pictures)
}

#[expect(clippy::cast_precision_loss, reason = "few iterations")]
fn iterations(run: &RunFolder) -> Chart {
    let of = |converged: bool| {
        let steps = run.report.steps.iter().filter(move |s| s.converged == converged);
        steps.map(|s| [s.t.0, s.iterations as f64]).collect::<Vec<_>>()
    };
    let chart = events::marked(run, Chart::new("Iterations of each step"))
        .x(run.with_unit(run.variable(), run.variable()), Scale::Linear)
        .y("iterations", Scale::Linear)
        .points(Series::new("converged", of(true)));
    match of(false) {
        failed if failed.is_empty() => chart,
        failed => chart.points(Series::new("not converged", failed)),
    }
}

fn attempts(run: &RunFolder) -> Table {
    let mut table = Table::new([run.variable(), "grows", "from", "to", "iterations", "converged", "error"]);
    for step in &run.report.steps {
        for a in &step.attempts {
            let converged = if a.converged { "yes" } else { "no" };
            let error = a.error.clone().unwrap_or_default();
            let (from, to) = (short(a.from), short(a.to));
            table.row([short(step.t.0), a.path.clone(), from, to, a.iterations.to_string(), converged.into(), error]);
        }
    }
    table
}

/// Shares of open, slipping and sticking points over the steps.
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
pub(crate) fn contact(run: &RunFolder) -> (Section, Vec<Picture>) {
    let counts: Vec<(f64, [u64; 3])> =
        run.report.steps.iter().filter_map(|s| s.contact.map(|c| (s.t.0, [c.open, c.slip, c.stick]))).collect();
    let Some((_, last)) = counts.last() else { return (Section::new("Contact"), Vec::new()) };
    let facts = STATES.iter().zip(last).map(|((name, _), n)| (format!("{name} at the end"), format!("{n} points")));
    let mut section = Section::new("Contact").facts(facts);
    if counts.iter().all(|(_, n)| n[1] == 0) {
        section = section.text("No point slips in any step. Without friction, closed points count as sticking.");
    }
    if counts.len() < 2 {
        return (section, Vec::new());
    }
    let mut chart = events::marked(run, Chart::new("State of contact points"))
        .x(run.with_unit(run.variable(), run.variable()), Scale::Linear)
        .y("share of points [%]", Scale::Linear);
    for (k, (name, colour)) in STATES.iter().enumerate() {
        let share = |n: &[u64; 3]| 100.0 * n[k] as f64 / (n.iter().sum::<u64>().max(1)) as f64;
        let series = Series::new(*name, counts.iter().map(|(t, n)| [*t, share(n)]));
        chart = chart.line_points(series.colour(colour.unwrap_or(Colour::Ink)));
    }
    let picture = Picture::new("contact_points", chart);
    (section.chart(&picture.chart), vec![picture])
}

/// Where the time went.
pub(crate) fn time(run: &RunFolder) -> (Section, Vec<Picture>) {
    let t = run.report.timings;
    let parts = [
        ("parse", t.parse),
        ("compile", t.compile),
        ("mesh", t.mesh),
        ("assemble", t.assemble),
        ("factor", t.factor),
        ("solve", t.solve),
        ("write", t.write),
    ];
    let searched = run.report.accuracy.iter().flat_map(|a| a.trial_runs.split_last()).flat_map(|(_, before)| before);
    let searched: f64 = searched.map(|t| t.seconds).sum();
    let parts = parts.into_iter().chain((searched > 0.0).then_some(("other meshes", searched)));
    let parts: Vec<(&str, f64)> = parts.collect();
    let rest = t.total - parts.iter().map(|p| p.1).sum::<f64>();
    let note = |name: &str, s: f64| {
        format!("{name}: {} s, {} % of {} s", short(s), short(100.0 * s / t.total), short(t.total))
    };
    let all = parts.into_iter().chain([("rest", rest.max(0.0))]);
    let bars = all.map(|(name, s)| Bar::new(name, s).note(note(name, s)));
    let picture = Picture::new("time", Chart::new("Time by part").x("time [s]", Scale::Linear).bars(bars));
    (Section::new("Time").chart(&picture.chart), vec![picture])
}

/// Conditions of the scene and of physics, as the run judged them.
pub(crate) fn checks(run: &RunFolder) -> Section {
    let mut table = Table::new(["condition", "holds", "found", "allowed"]);
    for (name, check) in run.report.checks.iter() {
        // an expectation of the scene holds or not; there is no number behind it
        let number = |x: f64| if name.starts_with("expect ") { String::new() } else { short(x) };
        // an infinite tolerance is written as no number: the value is shown and not judged
        let (holds, allowed) = match (check.tolerance.0.is_finite(), check.ok) {
            (false, _) => ("", "any".to_owned()),
            (true, true) => ("yes", number(check.tolerance.0)),
            (true, false) => ("no", number(check.tolerance.0)),
        };
        table.row([name.to_owned(), holds.to_owned(), number(check.value.0), allowed]);
    }
    let section = Section::new("Checks");
    if table.is_empty() { section } else { section.table(table) }
}

/// Measures at the end, and parameters with their units.
pub(crate) fn numbers(run: &RunFolder) -> Section {
    let unit = |name: &str| match run.report.about.units.get(name).map(String::as_str) {
        None | Some("not known") => String::new(),
        Some(unit) => unit.to_owned(),
    };
    let mut section = Section::new("Numbers");
    let mut measures = Table::new(["measure at the end", "value", "unit"]);
    for (name, value) in run.report.steps.last().into_iter().flat_map(|s| s.measures.iter()) {
        measures.row([name.to_owned(), format!("{:?}", value.0), unit(name)]);
    }
    if !measures.is_empty() {
        section = section.table(measures);
    }
    let about = &run.report.about;
    let mut heads = vec!["parameter", "value", "unit"];
    if !about.descriptions.is_empty() {
        heads.push("meaning");
    }
    let mut parameters = Table::new(heads);
    for (name, value) in run.report.parameters.iter() {
        let row = |v: &[wfl_output::Real]| {
            format!("[{}]", v.iter().map(|x| format!("{:?}", x.0)).collect::<Vec<_>>().join(", "))
        };
        let shown = match value {
            ParameterValue::Number(x) => format!("{:?}", x.0),
            ParameterValue::Text(text) => text.clone(),
            ParameterValue::Vector(v) => row(v),
            ParameterValue::Matrix(rows) => rows.iter().map(|r| row(r)).collect::<Vec<_>>().join(" "),
        };
        let mut row = vec![name.to_owned(), shown, unit(name)];
        if !about.descriptions.is_empty() {
            row.push(about.descriptions.get(name).cloned().unwrap_or_default());
        }
        parameters.row(row);
    }
    if parameters.is_empty() { section } else { section.table(parameters) }
}

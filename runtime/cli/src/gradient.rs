//! `wfl run --gradient` and `wfl verify --gradient`: derivatives of results, told and compared.

use std::process::ExitCode;

use serde_json::Value;
use wfl::{Diagnostic, SourceMap};
use wfl_compiler::backend::KernelBackend;
use wfl_gradient::{Gradient, Gradients, NO_DERIVATIVE, NearKink, Request, settle};
use wfl_problem::Scene;
use wfl_run::Outcome;
use wfl_tasks::{
    Loaded, available_threads,
    folder::{error_line, told},
    gradient::{Comparison, Verdict, Verified, numbers, to_sides, verify, write},
};

use crate::{
    args::{RunArgs, VerifyArgs},
    load::{out, print_all, say},
    prepared::{EXIT_ERROR, backend, sign_of_life},
    progress::Loudness,
    ready::Ready,
    table::Table,
};

/// The derivatives that a run is asked for beside its results; nothing after a message.
#[expect(clippy::option_option, reason = "a command without derivatives is no error")]
pub(crate) fn request(args: &RunArgs, on_ranks: bool) -> Option<Option<Request>> {
    let refused = [
        (args.resume, "--resume", "the steps before are not kept: run it from the start"),
        (on_ranks, "several ranks yet", "run it without mpirun"),
    ];
    let request = args.gradient.request().and_then(|request| match refused.iter().find(|(given, ..)| *given) {
        Some((_, word, help)) if request.is_some() => {
            Err(format!("--gradient does not go with {word}\n  = help: {help}"))
        }
        _ => Ok(request),
    });
    request.inspect_err(|why| say(&error_line(why))).ok()
}

/// Whether the derivatives that a scene states can be found in such a run; says why not.
pub(crate) fn may_state(loaded: &Loaded, resumes: bool, on_ranks: bool) -> bool {
    let Some(statement) = loaded.script.gradients.first() else { return true };
    let (what, help) = match (resumes, on_ranks) {
        (false, false) => return true,
        (true, _) => ("a run that goes on has not kept the steps before", "run it from the start, without --resume"),
        (false, true) => ("several ranks have no derivatives yet", "run it without mpirun"),
    };
    let d = Diagnostic::new(NO_DERIVATIVE, what).at(statement.span, "the scene asks for derivatives").help(help);
    print_all(&[d], &loaded.sources);
    false
}

/// Differentiates a run that has ended as the scene and the command line ask, and writes what was found; nothing after a
/// message.
pub(crate) fn differentiate(
    of: (&Loaded, &Scene, &dyn KernelBackend),
    ready: &Ready,
    outcome: &mut Outcome,
    request: Option<&Request>,
) -> Option<Gradients> {
    let (loaded, scene, backend) = of;
    if request.is_none() && loaded.script.gradients.is_empty() {
        return Some(Gradients::default());
    }
    let found = match settle((scene, &loaded.script), (backend, ready.options.threads), request, outcome) {
        Ok(found) => found,
        Err(d) => {
            print_all(std::slice::from_ref(&d), &loaded.sources);
            return None;
        }
    };
    if let Some(folder) = &ready.options.out
        && let Err(error) = write(folder, scene, &found, &mut outcome.report)
    {
        say(&told(&error));
        return None;
    }
    Some(found)
}

/// Tells what was found.
pub(crate) fn tell(loaded: &Loaded, ready: &Ready, found: &Gradients) {
    if found.results.is_empty() {
        return;
    }
    if ready.loudness != Loudness::Quiet {
        out(&text(found));
    }
    warn(&loaded.sources, found);
}

/// What there is to tell of points between two branches, and of parameters.
fn warn(sources: &SourceMap, found: &Gradients) {
    let near: Vec<Diagnostic> = found.near.iter().map(NearKink::finding).collect();
    print_all(&near, sources);
    found.notes.iter().for_each(|note| say(&format!("note: {note}\n")));
}

/// The derivatives as a table.
fn text(found: &Gradients) -> String {
    let sided = found.results.iter().any(|result| !result.sides.is_empty());
    let columns: &[&str] = if sided { &["to larger values", "to smaller values"] } else { &[] };
    let mut table = Table::new("derivatives", &[&["result", "value", "in", "derivative"], columns].concat());
    for result in &found.results {
        let one = Gradients { results: vec![result.clone()], ..Gradients::default() };
        for (name, value) in numbers(&one) {
            let parameter = name.strip_prefix(&format!("{}_by_", result.name)).unwrap_or(&name).to_owned();
            let shown = [result.value, value].map(wfl_tasks::words::number);
            let [of, by] = shown.map(Value::from);
            let sides = if sided { shown_sides(result, &parameter) } else { Vec::new() };
            table.push([vec![result.name.clone().into(), of, parameter.into(), by], sides].concat());
        }
        for (field, values) in &result.fields {
            let sum: f64 = values.iter().sum();
            let shown = format!("{} in all, by node in a file", wfl_tasks::words::number(sum));
            let value = wfl_tasks::words::number(result.value).into();
            let mut row: Vec<Value> =
                vec![result.name.clone().into(), value, format!("field {field}").into(), shown.into()];
            row.extend(columns.iter().map(|_| Value::from("")));
            table.push(row);
        }
    }
    let again = match found.steps_again {
        0 => String::new(),
        n => format!(", {n} steps computed again"),
    };
    format!(
        "\n{}  {} with the transposed tangent, {}{again}, {:.2} s\n",
        table.text(),
        wfl_tasks::words::count(found.solutions, "solution"),
        wfl_tasks::words::count(found.factorisations, "factor"),
        found.seconds
    )
}

/// The derivatives of a result to both sides of a parameter, `g(2)` for the second entry of one of several numbers.
fn shown_sides(result: &Gradient, parameter: &str) -> Vec<Value> {
    let [larger, smaller] = to_sides(result, parameter);
    let shown = |x: Option<f64>| x.map_or_else(String::new, wfl_tasks::words::number);
    vec![shown(larger).into(), shown(smaller).into()]
}

/// Compares derivatives with differences of whole runs.
pub(crate) fn compare(args: &VerifyArgs, request: &Request) -> ExitCode {
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let preparing = sign_of_life();
    let of = Verified {
        file: &args.scene.scene,
        overrides: &args.scene.overrides,
        request,
        backend: &*backend,
        threads: available_threads(),
    };
    let verified = verify(of);
    drop(preparing);
    let Comparison { rows, found, sources } = match verified {
        Ok(comparison) => comparison,
        Err(why) => {
            say(&if why.starts_with("error") { why } else { format!("error: {why}") });
            return ExitCode::from(EXIT_ERROR);
        }
    };
    let columns = ["result", "in", "derivative", "difference", "to more", "to less", ""];
    let sided: &[&str] = if request.sides.is_empty() { &[] } else { &["to larger values", "to smaller values"] };
    let mut table = Table::new("derivatives and differences of runs", &[&columns[..], sided].concat());
    for row in &rows {
        let verdict = match row.verdict {
            Verdict::Agrees => "",
            Verdict::Kink if row.agrees_with == [true, false] => "a kink: that to more",
            Verdict::Kink if row.agrees_with == [false, true] => "a kink: that to less",
            Verdict::Kink => "a kink: of one side, or between",
            Verdict::BothSides => "a kink: both sides agree",
            Verdict::Unclear => "differences too rough to tell",
            Verdict::Disagrees => "WRONG",
        };
        let [a, b, c, d] = [row.derivative, row.central, row.forward, row.backward].map(wfl_tasks::words::number);
        let names = [row.result.clone(), row.parameter.clone()];
        let shown = |x: Option<f64>| x.map_or_else(String::new, wfl_tasks::words::number);
        let sides = if sided.is_empty() { Vec::new() } else { row.sides.map(shown).to_vec() };
        let all = names.into_iter().chain([a, b, c, d, verdict.to_owned()]).chain(sides);
        table.push(all.map(Value::from).collect());
    }
    out(&table.text());
    warn(&sources, &found);
    let wrong: Vec<String> = rows
        .iter()
        .filter(|row| row.verdict == Verdict::Disagrees)
        .map(|row| format!("{} in {}", row.result, row.parameter))
        .collect();
    if wrong.is_empty() {
        return ExitCode::SUCCESS;
    }
    say(&format!("error: derivatives that agree with no difference of runs: {}\n", wrong.join(", ")));
    ExitCode::from(EXIT_ERROR)
}

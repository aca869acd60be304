//! `wfl extremes`: each parameter far from its value, in turn; what the scene then does.

use std::{path::Path, process::ExitCode, time::Instant};

use serde_json::Value;
use wfl::Diagnostic;
use wfl_compiler::backend::KernelBackend;
use wfl_runtime::{Outcome, Quiet, RunOptions, prepare, run};

use crate::{
    args::ExtremesArgs,
    load::{Loaded, load, out, say},
    nitsche,
    prepared::{EXIT_ERROR, backend},
    table::{Table, number},
    threads,
};

/// What each parameter is divided and multiplied by.
const FACTORS: [f64; 2] = [1e6, 1e3];

/// The values a parameter takes; divided, because a product with 1e-3 is not a short number.
fn values(x: f64) -> [f64; 4] {
    let [far, near] = FACTORS;
    [x / far, x / near, x * near, x * far]
}

/// How a run ended, from the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Ending {
    /// Claims a solution with numbers that are none.
    SilentlyWrong,
    /// Stopped with a message.
    Refused,
    /// A step did not converge, and the run says so.
    NotConverged,
    /// A solution with a warning.
    Warned,
    /// A solution that an expectation of the scene does not hold for.
    Unexpected,
    /// A solution.
    Solved,
}

impl Ending {
    fn word(self) -> &'static str {
        match self {
            Ending::SilentlyWrong => "SILENTLY WRONG",
            Ending::Refused => "refused",
            Ending::NotConverged => "not converged",
            Ending::Warned => "solved, with a warning",
            Ending::Unexpected => "solved, not as expected",
            Ending::Solved => "solved",
        }
    }
}

/// One run.
struct Trial {
    ending: Ending,
    /// Steps that converged and Newton iterations of all.
    steps: (usize, usize),
    message: String,
}

pub(crate) fn extremes(args: &ExtremesArgs, started: Instant) -> ExitCode {
    let Some(base) = load(&args.scene.scene, &args.scene.overrides, "extremes") else {
        return ExitCode::from(EXIT_ERROR);
    };
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let parameters = match parameters(&base, &*backend) {
        Ok(list) => list,
        Err(messages) => {
            crate::load::print_all(&messages, &base.sources);
            return ExitCode::from(EXIT_ERROR);
        }
    };
    let mut table = Table::new("extremes", &["parameter", "value", "outcome", "steps", "iterations", "message"]);
    let mut worst: Option<(String, Trial)> = None;
    let mut silently = false;
    let word = |name: &String, x: f64| (name.clone(), x, Some(format!("{name}={x:e}")));
    let changed = parameters.iter().flat_map(|(name, value)| values(*value).map(move |x| word(name, x)));
    let trials = std::iter::once((String::from("as written"), f64::NAN, None)).chain(changed);
    let count = 1 + 2 * FACTORS.len() * parameters.len();
    for (k, (name, value, word)) in trials.enumerate() {
        let label = word.clone().unwrap_or_else(|| name.clone());
        say(&format!("{} of {count}: {label}\n", k + 1));
        let trial = one(args, word, &*backend, started);
        silently |= trial.ending == Ending::SilentlyWrong;
        let value = if value.is_nan() { Value::Null } else { number(value).into() };
        let (steps, iterations) = trial.steps;
        table.push(vec![
            name.into(),
            value,
            trial.ending.word().into(),
            steps.into(),
            iterations.into(),
            trial.message.clone().into(),
        ]);
        let failed = trial.ending < Ending::Warned;
        if failed && worst.is_none() {
            worst = Some((label, trial));
        }
    }
    out(&table.text());
    out(&match &worst {
        Some((label, trial)) => format!("\nfirst failure: {label}: {}: {}\n", trial.ending.word(), trial.message),
        None => "\nno failure\n".to_owned(),
    });
    if let Some(path) = &args.out
        && let Err(error) = std::fs::write(path, csv(&table))
    {
        say(&format!("error: cannot write {}: {error}\n", path.display()));
        return ExitCode::from(EXIT_ERROR);
    }
    if silently { ExitCode::from(EXIT_ERROR) } else { ExitCode::SUCCESS }
}

/// The parameters that are numbers other than zero, with their values; the messages of a scene that is wrong.
fn parameters(base: &Loaded, backend: &dyn KernelBackend) -> Result<Vec<(String, f64)>, Vec<Diagnostic>> {
    let prepared = prepare(&base.script, &base.folder, backend);
    let messages: Vec<Diagnostic> = base.messages.iter().cloned().chain(prepared.diagnostics).collect();
    let scene = prepared.scene.filter(|_| !messages.iter().any(Diagnostic::is_error)).ok_or(messages)?;
    let number = |(name, value): &(String, wfl_compiler::Constant)| match value.values.as_slice() {
        [x] if *x != 0.0 => Some((name.clone(), *x)),
        _ => None,
    };
    Ok(scene.params.iter().filter_map(number).collect())
}

/// Runs the scene with one word more on the command line; nothing is written.
fn one(args: &ExtremesArgs, word: Option<String>, backend: &dyn KernelBackend, started: Instant) -> Trial {
    let refused = |message: String| Trial { ending: Ending::Refused, steps: (0, 0), message };
    let name = |w: &str| w.split('=').next().unwrap_or_default().trim().to_owned();
    let mut words = args.scene.overrides.clone();
    if let Some(word) = word {
        words.retain(|w| name(w) != name(&word));
        words.push(word);
    }
    let Some(loaded) = load(&args.scene.scene, &words, "extremes") else {
        return refused("the scene cannot be read".to_owned());
    };
    let prepared = prepare(&loaded.script, &loaded.folder, backend);
    let messages: Vec<Diagnostic> = loaded.messages.iter().cloned().chain(prepared.diagnostics).collect();
    let line = |d: &Diagnostic| format!("{}: {}", d.code, d.message);
    if let Some(error) = messages.iter().find(|d| d.is_error()) {
        return refused(line(error));
    }
    let Some(mut scene) = prepared.scene else { return refused("no scene".to_owned()) };
    let options = options(&args.scene.scene, started);
    let doubt = nitsche::parameters(&loaded, &mut scene).first().map(line);
    match run(&mut scene, &options, &mut Quiet) {
        Ok(outcome) => judge(&outcome, doubt),
        Err(error) => refused(error.to_string()),
    }
}

fn options(scene: &Path, started: Instant) -> RunOptions {
    let threads = threads::available();
    RunOptions {
        name: scene.display().to_string(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        keep_states: true,
        ..RunOptions::without_files(threads, started)
    }
}

/// How a run ended; `doubt` is a warning from before.
fn judge(outcome: &Outcome, doubt: Option<String>) -> Trial {
    let iterations = outcome.steps.iter().map(|s| s.history.n_iterations()).sum();
    let converged = outcome.steps.iter().filter(|s| s.history.converged());
    let steps = (converged.clone().count(), iterations);
    let mut finite = converged.flat_map(|s| s.state.iter().copied().chain(s.measures.iter().map(|m| m.1)));
    let (ending, message) = if !finite.all(f64::is_finite) {
        (Ending::SilentlyWrong, "a converged step has numbers that are not finite".to_owned())
    } else if let Some(step) = outcome.steps.iter().find(|s| !s.history.converged()) {
        let residual = step.history.iterations.last().map_or(f64::NAN, |i| i.residual);
        (Ending::NotConverged, format!("E603: t = {}: residual {residual:.1e}", step.time))
    } else if let Some((code, text)) = outcome.warnings.first() {
        (Ending::Warned, format!("{code}: {text}"))
    } else if let Some(text) = doubt {
        (Ending::Warned, text)
    } else if let Some((expect, _)) = outcome.expectations.iter().find(|e| e.1 != Some(true)) {
        (Ending::Unexpected, format!("does not hold: {}", expect.text))
    } else {
        (Ending::Solved, String::new())
    };
    Trial { ending, steps, message }
}

/// The table as comma-separated values, texts in quotes (RFC 4180).
fn csv(table: &Table) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let mut text = table.columns.join(",") + "\n";
    for row in &table.rows {
        let cells: Vec<String> = row
            .iter()
            .map(|v| match v {
                Value::Null => String::new(),
                Value::String(s) => quoted(s),
                other => other.to_string(),
            })
            .collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

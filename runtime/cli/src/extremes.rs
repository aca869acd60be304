//! `wfl extremes`: each parameter far from its value, in turn; what the scene then does.

use std::{
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::Path,
    process::ExitCode,
    time::{Duration, Instant},
};

use serde_json::Value;
use wfl::Diagnostic;
use wfl_compiler::backend::KernelBackend;
use wfl_runtime::{Outcome, Progress, RunOptions, newton::Iteration, prepare, run};

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

/// A value may take so many times what the scene takes as written, and not less than so many seconds: far from their
/// values parameters need more iterations, not another order of them.
const LONGER: u32 = 3;
const LEAST: Duration = Duration::from_secs(10);
/// A value was refused, did not converge or was out of time.
const EXIT_FAILED: u8 = 2;

/// How a run ended, from the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Ending {
    /// Claims a solution with numbers that are none.
    SilentlyWrong,
    /// Stopped with a message.
    Refused,
    /// A step did not converge, and the run says so.
    NotConverged,
    /// Still running when its time was over.
    OutOfTime,
    /// A solution with a warning.
    Warned,
    /// A solution that an expectation of the scene does not hold for.
    Unexpected,
    /// A solution.
    Solved,
    /// Outside what the scene declares for the parameter: not tried.
    Outside,
}

impl Ending {
    fn word(self) -> &'static str {
        match self {
            Ending::SilentlyWrong => "SILENTLY WRONG",
            Ending::Refused => "refused",
            Ending::NotConverged => "not converged",
            Ending::OutOfTime => "out of time",
            Ending::Warned => "solved, with a warning",
            Ending::Unexpected => "solved, not as expected",
            Ending::Solved => "solved",
            Ending::Outside => "outside its range",
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
    let (table, trials) = all(args, &parameters, &*backend, started);
    out(&table.text());
    out(&summary(&trials));
    if let Some(path) = &args.out
        && let Err(error) = std::fs::write(path, csv(&table))
    {
        say(&format!("error: cannot write {}: {error}\n", path.display()));
        return ExitCode::from(EXIT_ERROR);
    }
    match trials.iter().map(|(_, trial)| trial.ending).min() {
        Some(Ending::SilentlyWrong) => ExitCode::from(EXIT_ERROR),
        Some(ending) if ending < Ending::Warned => ExitCode::from(EXIT_FAILED),
        _ => ExitCode::SUCCESS,
    }
}

/// The scene as written and each parameter at each of its values: the table, and what became of each.
fn all(
    args: &ExtremesArgs,
    parameters: &[(String, f64)],
    backend: &dyn KernelBackend,
    started: Instant,
) -> (Table, Vec<(String, Trial)>) {
    let mut table = Table::new("extremes", &["parameter", "value", "outcome", "steps", "iterations", "message"]);
    let mut done: Vec<(String, Trial)> = Vec::new();
    let word = |name: &String, x: f64| (name.clone(), x, Some(format!("{name}={x:e}")));
    let changed = parameters.iter().flat_map(|(name, value)| values(*value).map(move |x| word(name, x)));
    let trials = std::iter::once((String::from("as written"), f64::NAN, None)).chain(changed);
    let count = 1 + 2 * FACTORS.len() * parameters.len();
    let mut limit = args.limit.map(Duration::from_secs_f64);
    for (k, (name, value, word)) in trials.enumerate() {
        let label = word.clone().unwrap_or_else(|| name.clone());
        say(&format!("{} of {count}: {label}", k + 1));
        let begin = Instant::now();
        let trial = one(args, word, (backend, limit), started);
        // the scene as written has all the time it needs, unless the user says otherwise
        limit = limit.or_else(|| Some(LEAST.max(LONGER * begin.elapsed())));
        say(&format!(": {} ({:.1} s)\n", trial.ending.word(), begin.elapsed().as_secs_f64()));
        let value = if value.is_nan() { Value::Null } else { number(value).into() };
        let (steps, iterations) = trial.steps;
        let (ending, message) = (trial.ending.word().into(), trial.message.clone().into());
        table.push(vec![name.into(), value, ending, steps.into(), iterations.into(), message]);
        done.push((label, trial));
    }
    (table, done)
}

/// How many ended how, and the first that failed.
fn summary(trials: &[(String, Trial)]) -> String {
    let mut counts: Vec<(Ending, usize)> = Vec::new();
    for (_, trial) in trials {
        match counts.iter_mut().find(|(ending, _)| *ending == trial.ending) {
            Some((_, n)) => *n += 1,
            None => counts.push((trial.ending, 1)),
        }
    }
    counts.sort_by_key(|(ending, _)| std::cmp::Reverse(*ending));
    let counts: Vec<String> = counts.iter().map(|(ending, n)| format!("{n} {}", ending.word())).collect();
    let first = match trials.iter().find(|(_, trial)| trial.ending < Ending::Warned) {
        Some((label, trial)) => format!("first failure: {label}: {}: {}", trial.ending.word(), trial.message),
        None => "no failure".to_owned(),
    };
    format!("\n{}\n{first}\n", counts.join(", "))
}

/// Ends a run whose time is over: iterations are told, and a run that is left at one leaves nothing behind.
struct Limited {
    end: Option<Instant>,
}

/// What is thrown then.
struct TimeIsOver;

impl Progress for Limited {
    fn iteration(&mut self, _iteration: &Iteration) {
        if self.end.is_some_and(|end| Instant::now() > end) {
            resume_unwind(Box::new(TimeIsOver));
        }
    }
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
fn one(
    args: &ExtremesArgs,
    word: Option<String>,
    (backend, limit): (&dyn KernelBackend, Option<Duration>),
    started: Instant,
) -> Trial {
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
        let outside = error.code == "E701";
        return Trial { ending: if outside { Ending::Outside } else { Ending::Refused }, ..refused(line(error)) };
    }
    let Some(mut scene) = prepared.scene else { return refused("no scene".to_owned()) };
    let options = options(&args.scene.scene, started);
    let doubt = nitsche::parameters(&loaded, &mut scene).first().map(line);
    let mut limited = Limited { end: limit.map(|l| Instant::now() + l) };
    // the scene is not looked at again
    match catch_unwind(AssertUnwindSafe(|| run(&mut scene, &options, &mut limited))) {
        Ok(Ok(outcome)) => judge(&outcome, doubt),
        Ok(Err(error)) => refused(error.to_string()),
        Err(thrown) if thrown.is::<TimeIsOver>() => {
            let seconds = limit.unwrap_or_default().as_secs_f64();
            Trial { ending: Ending::OutOfTime, ..refused(format!("more than {seconds:.0} s; --limit allows more")) }
        }
        Err(thrown) => resume_unwind(thrown),
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
        (Ending::Unexpected, format!("does not hold: {}{}", expect.text, measured(&expect.text, outcome)))
    } else {
        (Ending::Solved, String::new())
    };
    Trial { ending, steps, message }
}

/// The measures that a condition names, at the end of the run: by how much it does not hold.
fn measured(condition: &str, outcome: &Outcome) -> String {
    let words: Vec<&str> = condition.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    let last = outcome.steps.last().map_or(&[][..], |s| s.measures.as_slice());
    let named = last.iter().filter(|(name, _)| words.contains(&name.as_str()));
    named.map(|(name, value)| format!("; {name} = {value:.6e}")).collect()
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

//! A scene driven to its extremes: each parameter far from its value, in turn; what the scene then does.

use std::{
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::Path,
    time::{Duration, Instant},
};

use wfl::{Code, Diagnostic};
use wfl_compiler::backend::KernelBackend;
use wfl_gradient::settle;
use wfl_newton::Iteration;
use wfl_problem::prepare;
use wfl_run::{Outcome, Progress, RunOptions, run};

use crate::{Listener, Loaded, VERSION, advice, available_threads, scene_file::read_scene};

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
/// How a run ended, from the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
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
    /// In words.
    #[must_use]
    pub fn word(self) -> &'static str {
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
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// How it ended.
    pub ending: Ending,
    /// Steps that converged.
    pub steps: usize,
    /// Newton iterations of all steps.
    pub iterations: usize,
    /// Why it ended so; empty where there is nothing to say.
    pub message: String,
}

/// A run with what was changed for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    /// The parameter; `as written` for the scene itself.
    pub parameter: String,
    /// Its value; not a number for the scene itself.
    pub value: f64,
    /// What became of it.
    pub trial: Trial,
}

impl Tried {
    /// What was changed, as on the command line.
    #[must_use]
    pub fn label(&self) -> String {
        self.word().unwrap_or_else(|| self.parameter.clone())
    }

    fn word(&self) -> Option<String> {
        (!self.value.is_nan()).then(|| format!("{}={:e}", self.parameter, self.value))
    }
}

/// What is driven to its extremes.
pub struct Job<'a> {
    /// The scene.
    pub file: &'a Path,
    /// Values of its parameters, `NAME=VALUE`.
    pub overrides: &'a [String],
    /// Time that each value may take; found from the scene as written where there is none.
    pub limit: Option<Duration>,
    /// Runs terms.
    pub backend: &'a dyn KernelBackend,
    /// Hears of each run.
    pub listener: &'a dyn Listener,
    /// When the work began.
    pub started: Instant,
}

/// The scene as written and each parameter at each of its values; `base` is the scene as read.
///
/// # Errors
/// The messages of a scene that is wrong.
pub fn extremes(job: &Job<'_>, base: &Loaded) -> Result<Vec<Tried>, Vec<Diagnostic>> {
    let parameters = parameters(base, job.backend)?;
    let changed = parameters.iter().flat_map(|(name, value)| values(*value).map(move |x| (name.clone(), x)));
    let trials = std::iter::once((String::from("as written"), f64::NAN)).chain(changed);
    let count = 1 + 2 * FACTORS.len() * parameters.len();
    let mut limit = job.limit;
    let mut done: Vec<Tried> = Vec::new();
    for (k, (parameter, value)) in trials.enumerate() {
        let trial = Trial { ending: Ending::Solved, steps: 0, iterations: 0, message: String::new() };
        let mut tried = Tried { parameter, value, trial };
        job.listener.progress_part(&format!("{} of {count}: {}", k + 1, tried.label()));
        let begin = Instant::now();
        tried.trial = one(job, tried.word(), limit);
        // the scene as written has all the time it needs, unless the user says otherwise
        limit = limit.or_else(|| Some(LEAST.max(LONGER * begin.elapsed())));
        let seconds = begin.elapsed().as_secs_f64();
        job.listener.progress_part(&format!(": {} ({seconds:.1} s)\n", tried.trial.ending.word()));
        done.push(tried);
    }
    Ok(done)
}

/// How many ended how, and the first that failed.
#[must_use]
pub fn summary(trials: &[Tried]) -> String {
    let mut counts: Vec<(Ending, usize)> = Vec::new();
    for Tried { trial, .. } in trials {
        match counts.iter_mut().find(|(ending, _)| *ending == trial.ending) {
            Some((_, n)) => *n += 1,
            None => counts.push((trial.ending, 1)),
        }
    }
    counts.sort_by_key(|(ending, _)| std::cmp::Reverse(*ending));
    let counts: Vec<String> = counts.iter().map(|(ending, n)| format!("{n} {}", ending.word())).collect();
    let first = match trials.iter().find(|t| t.trial.ending < Ending::Warned) {
        Some(tried) => {
            let Trial { ending, message, .. } = &tried.trial;
            format!("first failure: {}: {}: {message}", tried.label(), ending.word())
        }
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
fn one(job: &Job<'_>, word: Option<String>, limit: Option<Duration>) -> Trial {
    let refused = |message: String| Trial { ending: Ending::Refused, steps: 0, iterations: 0, message };
    let name = |w: &str| w.split('=').next().unwrap_or_default().trim().to_owned();
    let mut words = job.overrides.to_vec();
    if let Some(word) = word {
        words.retain(|w| name(w) != name(&word));
        words.push(word);
    }
    let loaded = match read_scene(job.file, &words, "extremes", "") {
        Ok(loaded) => loaded,
        Err(why) => return refused(why),
    };
    let prepared = prepare(&loaded.script, &loaded.folder, job.backend);
    let messages: Vec<Diagnostic> = loaded.messages.iter().cloned().chain(prepared.diagnostics).collect();
    let line = |d: &Diagnostic| format!("{}: {}", d.code, d.message);
    if let Some(error) = messages.iter().find(|d| d.is_error()) {
        let outside = error.code == Code::E701;
        return Trial { ending: if outside { Ending::Outside } else { Ending::Refused }, ..refused(line(error)) };
    }
    let Some(scene) = prepared.scene else { return refused("no scene".to_owned()) };
    let states_some = !loaded.script.gradients.is_empty();
    let options = RunOptions { keep_trajectory: states_some, ..options(job) };
    let first = scene.at_first_step().ok();
    let doubt = first.and_then(|first| advice::parameters(&loaded, &scene, &first).first().map(line));
    let mut limited = Limited { end: limit.map(|l| Instant::now() + l) };
    // the scene is not looked at again
    match catch_unwind(AssertUnwindSafe(|| run(&scene, &options, &mut limited))) {
        Ok(Ok(mut outcome)) => {
            // expectations may read them
            if states_some
                && outcome.converged()
                && let Err(d) = settle((&scene, &loaded.script), (job.backend, options.threads), None, &mut outcome)
            {
                return refused(line(&d));
            }
            judge(&outcome, doubt)
        }
        Ok(Err(error)) => refused(error.to_string()),
        Err(thrown) if thrown.is::<TimeIsOver>() => {
            let seconds = limit.unwrap_or_default().as_secs_f64();
            Trial { ending: Ending::OutOfTime, ..refused(format!("more than {seconds:.0} s; --limit allows more")) }
        }
        Err(thrown) => resume_unwind(thrown),
    }
}

fn options(job: &Job<'_>) -> RunOptions {
    RunOptions {
        name: job.file.display().to_string(),
        version: VERSION.to_owned(),
        keep_states: true,
        keep_outputs: Vec::new(),
        ..RunOptions::without_files(available_threads(), job.started)
    }
}

/// How a run ended; `doubt` is a warning from before.
fn judge(outcome: &Outcome, doubt: Option<String>) -> Trial {
    let iterations = outcome.steps.iter().map(|s| s.iterations()).sum();
    let converged = outcome.steps.iter().filter(|s| s.history.converged());
    let steps = converged.clone().count();
    let mut finite = converged.flat_map(|s| s.state.iter().copied().chain(s.measures.iter().map(|m| m.1)));
    let (ending, message) = if !finite.all(f64::is_finite) {
        (Ending::SilentlyWrong, "a converged step has numbers that are not finite".to_owned())
    } else if let Some(step) = outcome.steps.iter().find(|s| !s.history.converged()) {
        let residual = step.history.iterations.last().map_or(f64::NAN, |i| i.residual);
        (Ending::NotConverged, format!("E603: t = {}: residual {residual:.1e}", step.window.end))
    } else if let Some(warning) = outcome.warnings.first() {
        (Ending::Warned, format!("{}: {}", warning.code, warning.line()))
    } else if let Some(text) = doubt {
        (Ending::Warned, text)
    } else if let Some((expect, _)) = outcome.expectations.iter().find(|e| e.1 != Some(true)) {
        (Ending::Unexpected, format!("does not hold: {}{}", expect.text, measured(&expect.text, outcome)))
    } else {
        (Ending::Solved, String::new())
    };
    Trial { ending, steps, iterations, message }
}

/// The measures that a condition names, at the end of the run: by how much it does not hold.
fn measured(condition: &str, outcome: &Outcome) -> String {
    let words: Vec<&str> = condition.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    let last = outcome.steps.last().map_or(&[][..], |s| s.measures.as_slice());
    let named = last.iter().filter(|(name, _)| words.contains(&name.as_str()));
    named.map(|(name, value)| format!("; {name} = {value:.6e}")).collect()
}

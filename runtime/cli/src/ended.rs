//! What is said of a run that has ended, and its exit code.

use std::{path::Path, process::ExitCode};

use wfl::{Diagnostic, ast::Cond};
use wfl_compiler::{KinkKind, locate};
use wfl_runtime::{
    AttemptEnd, FRUITLESS, Outcome, RunError, RunOptions, Scene, Singular, StepResult,
    assemble::{AssembledTerm, NonFinitePlace, TermError},
    finite::{self, BadState, position, short, word},
    memory::TooMuchMemory,
    newton::{Iteration, NewtonError},
    output::Report,
    solve::SolveError,
};

use crate::{
    folder::{told, told_of_resuming},
    load::{Loaded, out, print_all, say},
    prepared::EXIT_ERROR,
    progress::Loudness,
    ready::Ready,
};

/// How the checks of a report begin that are expectations of the scene.
const EXPECT: &str = "expect ";
/// A step did not converge.
const EXIT_NOT_CONVERGED: u8 = 2;
/// An expectation of the scene does not hold.
const EXIT_EXPECTATION: u8 = 3;

/// Ends a run: messages, summary, expectations. `picked` is the setting that was picked for an accuracy.
pub(crate) fn finish(
    loaded: &Loaded,
    scene: &Scene,
    options: &RunOptions,
    outcome: &Outcome,
    (loudness, picked): (Loudness, Option<&str>),
) -> ExitCode {
    let fresh: Vec<Diagnostic> = outcome.diagnostics.iter().filter(|d| !loaded.messages.contains(d)).cloned().collect();
    print_all(&fresh, &loaded.sources);
    if loudness != Loudness::Quiet {
        out(&summary(options, outcome));
    }
    for (code, text) in &outcome.warnings {
        say(&format!("warning[{code}]: {text}\n"));
    }
    if !outcome.converged() {
        for step in outcome.steps.iter().filter(|s| !s.history.converged()) {
            if let Some(d) = circle(loaded, scene, step) {
                print_all(&[d], &loaded.sources);
            }
            let residual = step.history.iterations.last().map_or(f64::NAN, |i| i.residual);
            say(&format!(
                "error[E603]: step t = {} did not converge in {} iterations: residual {residual:.1e}\n",
                step.time,
                step.history.n_iterations()
            ));
            if step.fruitless() > FRUITLESS * scene.newton.max_iterations {
                say(&format!(
                    "  = note: {} attempts came to nothing after {} iterations in all, more than {FRUITLESS} times max_iter: smaller parts were not tried\n",
                    step.attempts.iter().filter(|a| a.end != AttemptEnd::Converged).count(),
                    step.fruitless()
                ));
            }
            if is_below(loaded) {
                say(
                    "  = note: a Nitsche parameter is below its smallest safe value (W503): there need not be a solution\n",
                );
                say("  = help: raise it to the value given there, or take theta = -1\n");
            }
        }
        return ExitCode::from(EXIT_NOT_CONVERGED);
    }
    if not_finite(loaded, outcome) {
        return ExitCode::from(EXIT_ERROR);
    }
    let mut failed = false;
    for (expect, holds) in &outcome.expectations {
        if *holds != Some(true) {
            failed = true;
            let d = Diagnostic::new("E604", "an expectation of the scene does not hold");
            let last = outcome.steps.last().map(|s| s.measures.as_slice()).unwrap_or_default();
            let d = d.at(expect.span, sides(scene, &expect.condition, last));
            let d = match picked {
                Some(setting) => d
                    .note(format!("judged with {setting}, which was picked for the accuracy, not with the scene's own mesh"))
                    .help("where it holds numbers of that mesh, judge it without the accuracy: wfl run without --accuracy"),
                None => d,
            };
            print_all(&[d], &loaded.sources);
        }
    }
    if failed { ExitCode::from(EXIT_EXPECTATION) } else { ExitCode::SUCCESS }
}

/// Says of a run that is to go on that nothing of it is left to do.
pub(crate) fn ended_before(ready: &Ready, report: &Report) -> ExitCode {
    if ready.loudness != Loudness::Quiet {
        let folder = ready.options.out.as_deref().unwrap_or(Path::new("")).display();
        let steps = match report.steps.len() {
            1 => "step".to_owned(),
            n => format!("{n} steps"),
        };
        out(&format!("{folder}: the run is finished, its {steps} and files are whole: nothing is left to do\n"));
    }
    let broken = report.checks.iter().filter(|(name, check)| name.starts_with(EXPECT) && !check.ok);
    let broken: Vec<&str> = broken.map(|(name, _)| name).collect();
    for name in &broken {
        say(&format!("error[E604]: an expectation of the scene does not hold\n  = note: {name}\n"));
    }
    let measures = report.steps.iter().flat_map(|s| s.measures.iter().map(|(name, value)| (name, value.0, s.t.0)));
    let bad: Vec<String> = measures
        .filter(|(_, value, _)| !value.is_finite())
        .map(|(name, value, t)| format!("error[E611]: the measure `{name}` is {} at t = {t}\n", word(value)))
        .collect();
    bad.iter().for_each(|line| say(line));
    if !bad.is_empty() {
        return ExitCode::from(EXIT_ERROR);
    }
    if broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(EXIT_EXPECTATION) }
}

/// Tells of measures that are not finite; true if there are any.
fn not_finite(loaded: &Loaded, outcome: &Outcome) -> bool {
    let bad = outcome.bad_measures();
    for (time, name, value, place) in &bad {
        match place {
            Some(place) => print_all(&[place.diagnostic(&loaded.script.expansions, *time)], &loaded.sources),
            None => say(&format!("error[E611]: the measure `{name}` is {} at t = {time}\n", word(*value))),
        }
    }
    !bad.is_empty()
}

/// The values on both sides of the comparisons of a condition.
fn sides(scene: &Scene, condition: &Cond, measures: &[(String, f64)]) -> String {
    let sides = scene.sides(condition, measures);
    sides.iter().map(|(span, value)| format!("{} is {value}", wfl::quote(*span))).collect::<Vec<_>>().join(", ")
}

/// True if a Nitsche parameter is below its smallest safe value.
fn is_below(loaded: &Loaded) -> bool {
    loaded.messages.iter().any(|d| d.code == "W503")
}

/// W602 for a step whose branches were those of two iterations before: between which branches points go to and fro.
fn circle(loaded: &Loaded, scene: &Scene, step: &StepResult) -> Option<Diagnostic> {
    let returns = |w: &[Iteration]| w[0].fingerprint == w[2].fingerprint && w[1].fingerprint != w[2].fingerprint;
    let iterations = &step.history.iterations;
    let last = iterations.windows(3).rev().find(|w| returns(w)).filter(|_| step.history.cycles() > 0)?;
    let first = iterations.windows(3).find(|w| returns(w)).map_or(0, |w| w[0].number);
    let kinks = || scene.system.terms.iter().flat_map(AssembledTerm::kinks);
    let kink = kinks().find(|k| k.kind == KinkKind::Ball).or_else(|| kinks().next())?;
    let words = if kink.kind == KinkKind::Ball { ["open", "slip", "stick"] } else { ["open", "slip", "closed"] };
    let (a, b) = (last[0].contact.unwrap_or_default(), last[1].contact.unwrap_or_default());
    let moved: Vec<&str> = (0..3).filter(|k| a[*k] != b[*k]).map(|k| words[k]).collect();
    let n = (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0);
    let who = match n {
        0 => "points change places".to_owned(),
        1 => format!("1 point switches {}", moved.join("/")),
        _ => format!("{n} points switch {}", moved.join("/")),
    };
    let text = format!("{who} in turn since iteration {first}");
    let d = Diagnostic::new("W602", "the contact set goes in a circle");
    let d = d.note(format!(
        "step t = {}; the residual alternates {:.4}, {:.4}",
        step.time, last[1].residual, last[2].residual
    ));
    let search = if scene.newton.search { "" } else { "solver newton with search=auto, or " };
    let help = if is_below(loaded) {
        "raise gamma to the value of W503".to_owned()
    } else {
        format!("{search}smaller steps: steps ... by a smaller step")
    };
    let d = d.help(help);
    Some(match kink.origin {
        Some(origin) => locate(d, origin, &loaded.script.expansions, text),
        None => d.note(text),
    })
}

fn summary(options: &RunOptions, outcome: &Outcome) -> String {
    let report = &outcome.report;
    let mut text = String::new();
    let good = outcome.steps.iter().filter(|s| s.history.converged()).count();
    let iterations: usize = outcome.steps.iter().map(|s| s.history.n_iterations()).sum();
    text += &format!(
        "{}: {} unknowns, {good} of {} steps converged, {iterations} iterations\n",
        report.scene,
        report.dofs,
        outcome.steps.len()
    );
    if let Some(step) = outcome.steps.last() {
        for (name, value) in &step.measures {
            text += &format!("  {name} = {value:.9e}\n");
        }
    }
    text += &judged(outcome);
    let t = report.timings;
    text += &format!(
        "  text to kernels {:.1} ms: parse {:.1}, compile {:.1}\n",
        1e3 * (t.parse + t.compile),
        1e3 * t.parse,
        1e3 * t.compile
    );
    text += &format!(
        "  time {:.3} s: mesh {:.3}, assemble {:.3}, factor {:.3}, solve {:.3}, write {:.3}\n",
        t.total, t.mesh, t.assemble, t.factor, t.solve, t.write
    );
    if let Some(out) = &options.out {
        text += &format!("  results in {}\n", out.display());
    }
    text
}

/// How good the last converged step is, in lines.
fn judged(outcome: &Outcome) -> String {
    let Some(step) = outcome.steps.iter().rev().find(|s| s.history.converged()) else { return String::new() };
    let mut text = String::new();
    if let (Some(a), Some(i)) = (&step.accuracy, step.history.iterations.last()) {
        let stop = step.history.stop.map_or("", |s| s.word());
        text += &format!(
            "  at t = {}: residual {:.1e} ({stop}; rounding leaves {:.1e}), {:.0} digits\n",
            step.time,
            i.residual,
            i.floor,
            a.digits().floor()
        );
    }
    let works: Vec<f64> = outcome.steps.iter().filter_map(|s| Some(s.friction?.taken)).collect();
    if !works.is_empty() {
        text += &format!("  energy that friction took: {:.6e}\n", works.iter().sum::<f64>());
    }
    for check in &step.checks {
        let mark = if check.holds() { "" } else { "  NOT within its limit" };
        text += &format!("  {}: {:.1e}{mark}", check.name, check.value);
        text += &if check.name.starts_with("equilibrium") { format!(" ({})\n", check.detail) } else { "\n".to_owned() };
    }
    text
}

/// Prints why a run stopped, at the place in the scene where there is one.
pub(crate) fn explain(loaded: &Loaded, scene: &Scene, error: &RunError) {
    let (time, inner) = match error {
        RunError::Newton { time, error: inner, .. } => (time, inner),
        RunError::Start(bad) => {
            print_all(&[bad.diagnostic(&loaded.script.expansions, None)], &loaded.sources);
            return;
        }
        RunError::State { .. } => {
            say(&format!("error[E612]: {error}\n"));
            return;
        }
        other => {
            say(&match other {
                RunError::Output(error) => told(error),
                RunError::Checkpoint(error) => told_of_resuming(error),
                other => format!("error: {other}\n"),
            });
            return;
        }
    };
    match inner {
        NewtonError::Term(TermError::NonFinite(place)) => {
            print_all(&[non_finite(loaded, place, *time)], &loaded.sources);
        }
        NewtonError::Term(TermError::State(bad)) => say(&unbounded(bad, *time)),
        NewtonError::Given(bad) => {
            print_all(&[bad.diagnostic(&loaded.script.expansions, Some(*time))], &loaded.sources);
        }
        NewtonError::Solve(SolveError::Singular { mode, .. }) => {
            let names = moving_fields(scene, mode.dofs_above(0.1).as_slice());
            say(&format!(
                "error[E602]: step t = {time}: nothing holds {names}\n  = note: the tangent is singular: {inner}\n  = help: fix it, or press it against something that is held\n"
            ));
        }
        NewtonError::Solve(SolveError::VanishingPivot { dof, .. }) => {
            let names = u32::try_from(*dof).map_or_else(|_| "the scene".to_owned(), |d| moving_fields(scene, &[d]));
            say(&format!(
                "error[E602]: step t = {time}: next to nothing holds {names}{}\n  = note: the tangent is singular but for rounding: {inner}\n  = help: a body that slides as a whole, or contact that is far stiffer than it: fix it, press it against something that is held, or take a smaller gamma\n",
                place_of(scene, *dof)
            ));
        }
        NewtonError::Singular { why, error } => {
            let mode = if let SolveError::Singular { mode, .. } = error { mode.dofs_above(0.1) } else { Vec::new() };
            let inactive = why.what.starts_with("the equation of");
            let told = held_by_nothing(loaded, scene, &mode).filter(|_| inactive);
            print_all(&[told.unwrap_or_else(|| undetermined(loaded, why, *time))], &loaded.sources);
        }
        NewtonError::TooMuchMemory(need) => too_much_memory(need),
        other => say(&format!("error[E602]: step t = {time}: {other}\n")),
    }
}

/// E606 where there is no place in the scene.
pub(crate) fn too_much_memory(need: &TooMuchMemory) {
    say(&format!("error[E606]: {need}\n  = help: fewer cells, a lower degree, or more memory: --memory 16GB\n"));
}

/// E602 for a tangent of which is known what it leaves undetermined, at the field or the term it is about.
fn undetermined(loaded: &Loaded, why: &Singular, time: f64) -> Diagnostic {
    let mut d = Diagnostic::new("E602", format!("step t = {time}: {}", why.what));
    let field = loaded.script.fields.iter().find(|f| f.name.name == why.name).map(|f| f.name.span);
    if let Some(span) = field {
        d = d.at(span, "");
    }
    for note in &why.notes {
        d = d.note(note.clone());
    }
    d.help(why.help.clone())
}

/// E403 for a number of the whole scene that no equation holds.
fn held_by_nothing(loaded: &Loaded, scene: &Scene, dofs: &[u32]) -> Option<Diagnostic> {
    let [free] = dofs else { return None };
    let dof = *scene.system.numbering.free_dofs.get(*free as usize)?;
    let (field, _, _) = scene.system.numbering.describe(&scene.system.fields, dof as usize);
    let name = &scene.system.fields[field].name;
    let declared = loaded.script.fields.iter().find(|f| f.name.name == *name)?;
    if !matches!(declared.space.place, wfl::ast::Place::Global(_)) {
        return None;
    }
    let d =
        Diagnostic::new("E403", format!("nothing holds `{name}` at the start: its row of the first tangent is zero"));
    let d = d.at(declared.name.span, "every term with it is inactive");
    Some(d.help(format!("start from a touching state, e.g. `start {name} = 0.01`")))
}

/// " at [1, 0]" for a free dof.
fn place_of(scene: &Scene, free: usize) -> String {
    let system = &scene.system;
    let Some(dof) = system.numbering.free_dofs.get(free) else { return String::new() };
    let (field, node, _) = system.numbering.describe(&system.fields, *dof as usize);
    let x = system.fields[field].node_position(node);
    let x: Vec<String> = x.iter().take(system.mesh.dim()).map(|c| short(*c)).collect();
    format!(" at [{}]", x.join(", "))
}

/// The fields of free dofs, with what they do in a singular mode.
fn moving_fields(scene: &Scene, dofs: &[u32]) -> String {
    let mut names: Vec<String> = Vec::new();
    for free in dofs {
        let Some(dof) = scene.system.numbering.free_dofs.get(*free as usize) else { continue };
        let (field, _, component) = scene.system.numbering.describe(&scene.system.fields, *dof as usize);
        let f = &scene.system.fields[field];
        let name =
            if f.n_components > 1 { format!("`{}({})`", f.name, component + 1) } else { format!("`{}`", f.name) };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    if names.is_empty() { "the scene".to_owned() } else { names.join(", ") }
}

fn non_finite(loaded: &Loaded, place: &NonFinitePlace, time: f64) -> Diagnostic {
    let at = format!(
        "at position {}, entity {} of the region, point {}, step t = {time}",
        position(place.position),
        place.entity,
        place.point
    );
    let nan = place.cause.as_ref().is_none_or(|c| c.result.is_nan());
    let what = if nan { "not a number" } else { "an infinite number" };
    let d = Diagnostic::new("E601", format!("{what} in the residual of `{}`", place.term));
    finite::told(d, place.cause.as_ref(), &at, &loaded.script.expansions, None)
}

/// E612: an unknown, or what is computed from it, has no finite value.
fn unbounded(bad: &BadState, time: f64) -> String {
    let note = if bad.largest.is_finite() {
        format!("  = note: the largest unknown is {}\n", short(bad.largest))
    } else {
        String::new()
    };
    format!(
        "error[E612]: step t = {time}: the {} of `{}` is {} at {}\n{note}  = help: numbers end at 1.8e308: another unit for \
         what is prescribed, loaded or started from\n",
        bad.what,
        bad.field,
        word(bad.value),
        position(bad.position)
    )
}

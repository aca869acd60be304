//! What is said of a run that has ended, or that stopped, and what it ended as.
//!
//! Promises that a run counts as done only if every step converged, every measure is finite and every expectation of
//! the scene holds. Does not print.

use std::path::Path;

use wfl::{Code, Diagnostic, Fix, Span, ast::Cond};
use wfl_compiler::{KinkKind, locate};
use wfl_discrete::{
    assemble::{AssembledTerm, NonFinitePlace, TermError},
    finite::{self, BadState, position, short, word},
};
use wfl_host::memory::{self, TooMuchMemory};
use wfl_newton::{Iteration, NewtonError, Singular};
use wfl_output::Report;
use wfl_problem::Scene;
use wfl_run::{AttemptEnd, Episode, FRUITLESS, Outcome, RunError, StepResult};
use wfl_sparse::solve::SolveError;

use crate::{
    Loaded,
    folder::{told, told_of_resuming},
    words::{self, count, number},
};

/// How the checks of a report begin that are expectations of the scene.
const EXPECT: &str = "expect ";

/// What a run ended as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Every step converged and every expectation holds.
    Done,
    /// A step did not converge.
    NotConverged,
    /// A measure is not finite.
    NotFinite,
    /// An expectation of the scene does not hold.
    NotAsExpected,
}

/// Something that is said.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// A message with its place in the scene.
    Message(Diagnostic),
    /// Lines with their ends.
    Text(String),
}

/// The end of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// What it ended as.
    pub ending: Ending,
    /// Messages of the run that were not told before.
    pub messages: Vec<Diagnostic>,
    /// Warnings, and why it is not done.
    pub said: Vec<Said>,
}

/// Judges a run that has ended. `picked` is the setting that was picked for an accuracy.
#[must_use]
pub fn judged(loaded: &Loaded, scene: &Scene, outcome: &Outcome, picked: Option<&str>) -> Ended {
    let fresh = outcome.diagnostics.iter().filter(|d| !loaded.messages.contains(d)).cloned().collect();
    let warnings = outcome.warnings.iter().cloned().map(Said::Message);
    let mut ended = Ended { ending: Ending::Done, messages: fresh, said: warnings.collect() };
    let why = [
        (Ending::NotConverged, not_converged(loaded, scene, outcome)),
        (Ending::NotFinite, not_finite(loaded, outcome)),
        (Ending::NotAsExpected, not_as_expected(scene, outcome, picked)),
    ];
    if let Some((ending, said)) = why.into_iter().find(|(_, said)| !said.is_empty()) {
        ended.ending = ending;
        ended.said.extend(said);
    }
    ended
}

/// Why steps did not converge; empty where all did.
fn not_converged(loaded: &Loaded, scene: &Scene, outcome: &Outcome) -> Vec<Said> {
    let mut said = Vec::new();
    for step in outcome.steps.iter().filter(|s| !s.history.converged()) {
        said.extend(circle(loaded, scene, step).map(Said::Message));
        let residual = step.history.iterations.last().map_or(f64::NAN, |i| i.residual);
        let attempts = match step.parts().len() {
            0 => String::new(),
            n => format!(" ({n} attempts)"),
        };
        let mut d = Diagnostic::new(
            Code::E603,
            format!(
                "step t = {} did not converge in {} iterations{attempts}: residual {residual:.1e}",
                step.window.end,
                step.iterations()
            ),
        );
        if step.fruitless() > FRUITLESS * scene.newton.max_iterations {
            d = d.note(format!(
                "{} attempts failed after {} iterations in total, more than {FRUITLESS} times max_iter: smaller increments \
                 were not tried",
                step.attempts.iter().filter(|a| a.end != AttemptEnd::Converged).count(),
                step.fruitless()
            ));
        }
        for table in &scene.tables.states {
            d = d.note(format!("a state outside the rows of {table} is no solution"));
        }
        if !scene.tables.states.is_empty() {
            d = d.help(
                "if the solution is out there: more rows, or a law that holds the last value, such as \
                 table(\"law.csv\", max(first, min(x, last)))",
            );
        }
        if is_below(loaded) {
            d = d
                .note("a Nitsche parameter is below its coercivity bound (W503): a solution need not exist")
                .help("raise it to the value given there, or use theta = -1");
        }
        said.push(Said::Message(d));
    }
    said
}

/// The expectations that do not hold.
fn not_as_expected(scene: &Scene, outcome: &Outcome, picked: Option<&str>) -> Vec<Said> {
    let broken = outcome.expectations.iter().filter(|(_, holds)| *holds != Some(true));
    let told = |expect: &wfl::Expect| {
        let d = Diagnostic::new(Code::E604, "an expectation of the scene does not hold");
        let d = d.at(expect.span, sides(scene, &expect.condition, outcome));
        match picked {
            Some(setting) => d
                .note(format!(
                    "evaluated with {setting}, which was picked for the accuracy, not on the mesh of the scene"
                ))
                .help("if it contains numbers of that mesh, run without --accuracy"),
            None => d,
        }
    };
    broken.map(|(expect, _)| Said::Message(told(expect))).collect()
}

/// What is said of a run that is to go on where nothing of it is left to do, and what it ended as.
#[must_use]
pub fn finished_before(report: &Report) -> (Ending, Vec<String>) {
    let broken = report.checks.iter().filter(|(name, check)| name.starts_with(EXPECT) && !check.ok);
    let line = |name: &str| format!("error[E604]: an expectation of the scene does not hold\n  = note: {name}\n");
    let mut lines: Vec<String> = broken.map(|(name, _)| line(name)).collect();
    let mut ending = if lines.is_empty() { Ending::Done } else { Ending::NotAsExpected };
    let measures = report.steps.iter().flat_map(|s| s.measures.iter().map(|(name, value)| (name, value.0, s.t.0)));
    for (name, value, t) in measures.filter(|(_, value, _)| !value.is_finite()) {
        lines.push(format!("error[E611]: the measure `{name}` is {} at t = {t}\n", word(value)));
        ending = Ending::NotFinite;
    }
    (ending, lines)
}

/// The line that says so.
#[must_use]
pub fn nothing_left(folder: &Path, report: &Report) -> String {
    let steps = match report.steps.len() {
        1 => "step".to_owned(),
        n => format!("{n} steps"),
    };
    format!("{}: the run is finished; its {steps} and files are complete\n", folder.display())
}

/// The measures that are not finite.
fn not_finite(loaded: &Loaded, outcome: &Outcome) -> Vec<Said> {
    let mut said = Vec::new();
    for (time, name, value, place) in outcome.bad_measures() {
        said.push(match place {
            Some(place) => Said::Message(place.diagnostic(&loaded.script.expansions, time)),
            None => {
                let text = format!("the measure `{name}` is {} at t = {time}", word(value));
                Said::Message(Diagnostic::new(Code::E611, text))
            }
        });
    }
    said
}

/// The values on both sides of the comparisons of a condition.
fn sides(scene: &Scene, condition: &Cond, outcome: &Outcome) -> String {
    let told = |(span, value): &(Span, f64)| {
        let value = if value.is_finite() { value.to_string() } else { word(*value).to_owned() };
        format!("{} is {value}", wfl::quote(*span))
    };
    scene.sides(condition, &outcome.known, &outcome.derivatives).iter().map(told).collect::<Vec<_>>().join(", ")
}

/// True if a Nitsche parameter is below its smallest safe value.
fn is_below(loaded: &Loaded) -> bool {
    loaded.messages.iter().any(|d| d.code == Code::W503)
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
        0 => "points change their state".to_owned(),
        1 => format!("1 point switches {}", moved.join("/")),
        _ => format!("{n} points switch {}", moved.join("/")),
    };
    let text = format!("{who} alternately since iteration {first}");
    let d = Diagnostic::new(Code::W602, "the active set cycles");
    let d = d.note(format!(
        "step t = {}; the residual alternates {:.4}, {:.4}",
        step.window.end, last[1].residual, last[2].residual
    ));
    let search = if scene.newton.search { "" } else { "solver newton with search=auto, or " };
    let help = if is_below(loaded) {
        "raise gamma to the value of W503".to_owned()
    } else {
        format!("{search}smaller load steps: steps ... by a smaller value")
    };
    let d = d.help(help);
    let may_search = !search.is_empty() && !is_below(loaded) && loaded.script.solver.is_none();
    let statement = may_search.then(|| Fix::AddStatement("solver newton with search=auto".to_owned()));
    let d = statement.into_iter().fold(d, Diagnostic::fix);
    Some(match kink.origin {
        Some(origin) => locate(d, origin, &loaded.script.expansions, text),
        None => d.note(text),
    })
}

/// The numbers of a run in lines: size, measures, quality, times.
#[must_use]
pub fn summary(out: Option<&Path>, outcome: &Outcome) -> String {
    let report = &outcome.report;
    let mut text = String::new();
    let good = outcome.steps.iter().filter(|s| s.history.converged()).count();
    let iterations: usize = outcome.steps.iter().map(|s| s.iterations()).sum();
    text += &format!(
        "{}: {}, {good} of {} steps converged, {}\n",
        report.scene,
        count(usize::try_from(report.dofs).unwrap_or(usize::MAX), "unknown"),
        outcome.steps.len(),
        count(iterations, "iteration")
    );
    if let Some(step) = outcome.steps.last() {
        for (name, value) in &step.measures {
            text += &format!("  {name} = {}\n", number(*value));
        }
    }
    text += &times_of_events(&outcome.events);
    text += &quality(outcome);
    let t = report.timings;
    text += &format!(
        "  text to kernels {:.1} ms: parse {:.1}, compile {:.1}\n",
        1e3 * (t.parse + t.compile),
        1e3 * t.parse,
        1e3 * t.compile
    );
    text += &format!(
        "  time {:.3} s: mesh {:.3}, check {:.3}, assemble {:.3}, factor {:.3}, solve {:.3}, measure {:.3}, write {:.3}\n",
        t.total, t.mesh, t.check, t.assemble, t.factor, t.solve, t.measure, t.write
    );
    text += &memory_of_ranks(&report.peak_memory_by_rank);
    if let Some(out) = out {
        text += &format!("  results in {}\n", out.display());
    }
    text
}

/// What the ranks of a run took, in a line; nothing for one alone.
fn memory_of_ranks(peaks: &[u64]) -> String {
    let Some(most) = peaks.iter().max() else { return String::new() };
    let (n, all) = (peaks.len(), peaks.iter().sum());
    format!("  memory: at most {} on each of {n} ranks, {} in all\n", memory::shown(*most), memory::shown(all))
}

/// When the events of a run were, a line each: all times of few episodes, the first and the last one of many.
fn times_of_events(events: &[(String, Vec<Episode>)]) -> String {
    const FEW: usize = 3;
    let time = |e: &Episode| match e.end {
        Some(end) => format!("{} to {}", number(e.begin), number(end)),
        None => format!("from {} on", number(e.begin)),
    };
    let line = |(name, episodes): &(String, Vec<Episode>)| match episodes.as_slice() {
        [] => format!("  {name}: never\n"),
        [first, .., last] if episodes.len() > FEW => {
            format!("  {name}: {} times, the first {}, the last {}\n", episodes.len(), time(first), time(last))
        }
        few => format!("  {name}: {}\n", few.iter().map(time).collect::<Vec<_>>().join("; ")),
    };
    events.iter().map(line).collect()
}

/// How good the last converged step is, in lines.
fn quality(outcome: &Outcome) -> String {
    let Some(step) = outcome.steps.iter().rev().find(|s| s.history.converged()) else { return String::new() };
    let mut text = String::new();
    if let (Some(a), Some(i)) = (&step.accuracy, step.history.iterations.last()) {
        let stop = step.history.stop.map_or("", |s| s.word());
        let hidden =
            if step.hidden > 0.0 { format!(", {:.0e} of the forces hidden", step.hidden) } else { String::new() };
        text += &format!(
            "  at t = {}: residual {:.1e} ({stop}; rounding floor {:.1e}), about {:.0} correct digits{hidden}\n",
            step.window.end,
            i.residual,
            i.floor,
            a.digits().floor()
        );
    }
    let works: Vec<f64> = outcome.steps.iter().filter_map(|s| Some(s.friction?.taken)).collect();
    if !works.is_empty() {
        text += &format!("  energy dissipated by friction: {}\n", number(works.iter().sum()));
    }
    if let Some(why) = outcome.friction_untested {
        text += &format!("  energy dissipated by friction: not tested: {why}\n");
    }
    for check in outcome.conditions_of(step) {
        if check.why_untested().is_some() {
            text += &format!("  {}: {}\n", check.name, check.detail);
            continue;
        }
        let mark = if check.holds() { "" } else { "  NOT within its limit" };
        text += &format!("  {}: {}{mark}", check.name, words::error(check.value));
        text += &if check.name.starts_with("equilibrium") { format!(" ({})\n", check.detail) } else { "\n".to_owned() };
    }
    text
}

/// Why a run stopped, at the place in the scene where there is one.
#[must_use]
pub fn stopped(loaded: &Loaded, scene: &Scene, error: &RunError) -> Said {
    match error {
        RunError::Newton { step, time, error: inner } => newton_stopped(loaded, scene, (*step, *time), inner),
        RunError::Start(bad) => Said::Message(bad.diagnostic(&loaded.script.expansions, None)),
        RunError::State { .. } => Said::Message(Diagnostic::new(Code::E612, error.to_string())),
        RunError::NoEquations | RunError::NotOfThisScene | RunError::Begun => Said::Text(format!("error: {error}\n")),
        RunError::Output(error) => Said::Text(told(error)),
        RunError::Checkpoint(error) => Said::Text(told_of_resuming(error)),
    }
}

/// `at` is the number of the step from 0, and its time.
fn newton_stopped(loaded: &Loaded, scene: &Scene, at: (usize, f64), inner: &NewtonError) -> Said {
    let (step, time) = at;
    match inner {
        NewtonError::Term(TermError::NonFinite(place)) => Said::Message(non_finite(loaded, place, time)),
        NewtonError::Term(TermError::State(bad)) => Said::Message(unbounded(loaded, bad, time)),
        NewtonError::Given(bad) => Said::Message(bad.diagnostic(&loaded.script.expansions, Some(time))),
        NewtonError::Solve(SolveError::Singular { mode, .. }) => {
            let dofs = mode.dofs_above(0.1);
            let names = moving_fields(scene, dofs.as_slice());
            let d = Diagnostic::new(Code::E602, format!("step t = {time}: nothing supports {names}"));
            let d = d.at_or_note(place_of_dof(loaded, scene, dofs.first()), "it moves freely");
            let d = d.note(format!("the tangent is singular: {inner}"));
            Said::Message(d.help("prescribe a displacement of it, or press it against a supported body"))
        }
        NewtonError::Solve(SolveError::VanishingPivot { dof, .. }) => {
            let free = u32::try_from(*dof).ok();
            let names = free.map_or_else(|| "the scene".to_owned(), |d| moving_fields(scene, &[d]));
            let at = place_of(scene, *dof);
            let d = Diagnostic::new(Code::E602, format!("step t = {time}: almost no stiffness supports {names}{at}"));
            let d = d.at_or_note(
                place_of_dof(loaded, scene, free.as_ref()),
                "a body slides as a whole, or its contact is far stiffer than it",
            );
            Said::Message(
                d.note(format!("the tangent is numerically singular: {inner}"))
                    .help("prescribe a displacement of it, press it against a supported body, or use a smaller gamma"),
            )
        }
        NewtonError::Singular { why, error } => {
            let mode = if let SolveError::Singular { mode, .. } = error { mode.dofs_above(0.1) } else { Vec::new() };
            // in later steps something has held it so far
            let from_the_start = step == 0 && why.what.starts_with("the equation of");
            let told = held_by_nothing(loaded, scene, &mode).filter(|_| from_the_start);
            Said::Message(told.unwrap_or_else(|| undetermined(loaded, why, time)))
        }
        NewtonError::TooMuchMemory(need) => Said::Message(too_much_memory(need)),
        other => Said::Message(Diagnostic::new(Code::E602, format!("step t = {time}: {other}"))),
    }
}

/// E606 where there is no place in the scene.
#[must_use]
pub fn too_much_memory(need: &TooMuchMemory) -> Diagnostic {
    let d = Diagnostic::new(Code::E606, need.to_string());
    d.help("fewer cells, a lower degree, or more memory: --memory 16GB")
}

/// E602 for a tangent of which is known what it leaves undetermined, at the field or the term it is about.
fn undetermined(loaded: &Loaded, why: &Singular, time: f64) -> Diagnostic {
    let mut d = Diagnostic::new(Code::E602, format!("step t = {time}: {}", why.what));
    if let Some(span) = declaration(loaded, &why.name) {
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
    let d = Diagnostic::new(
        Code::E403,
        format!("`{name}` has no stiffness at the start: its row of the first tangent is zero"),
    );
    let d = d.at(declared.name.span, "every term with it is inactive");
    Some(d.help(format!("start from a state in contact, e.g. `start {name} = 0.01`")))
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
    let d = Diagnostic::new(Code::E601, format!("{what} in the residual of `{}`", place.term));
    finite::told(d, place.cause.as_ref(), &at, &loaded.script.expansions, None)
}

/// E612: an unknown, or what is computed from it, has no finite value.
fn unbounded(loaded: &Loaded, bad: &BadState, time: f64) -> Diagnostic {
    let at = position(bad.position);
    let text = format!("step t = {time}: the {} of `{}` is {} at {at}", bad.what, bad.field, word(bad.value));
    let mut d = Diagnostic::new(Code::E612, text);
    if let Some(declared) = declaration(loaded, &bad.field) {
        d = d.at(declared, "");
    }
    if bad.largest.is_finite() {
        d = d.note(format!("the largest unknown is {}", short(bad.largest)));
    }
    d.help("numbers end at 1.8e308: another unit for what is prescribed, loaded or started from")
}

/// Where a field is declared.
fn declaration(loaded: &Loaded, field: &str) -> Option<Span> {
    loaded.script.fields.iter().find(|f| f.name.name == field).map(|f| f.name.span)
}

/// Where the field of a free dof is declared.
fn place_of_dof(loaded: &Loaded, scene: &Scene, free: Option<&u32>) -> Option<Span> {
    let dof = *scene.system.numbering.free_dofs.get(*free? as usize)?;
    let (field, ..) = scene.system.numbering.describe(&scene.system.fields, dof as usize);
    declaration(loaded, &scene.system.fields[field].name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_events_are_told_in_a_line_each() {
        let episode = |k: u32| Episode { begin: f64::from(k), end: (k < 4).then(|| f64::from(k) + 0.5) };
        let of = |n: u32| ("quake".to_owned(), (0..n).map(episode).collect::<Vec<_>>());
        assert_eq!(times_of_events(&[of(0)]), "  quake: never\n");
        assert_eq!(times_of_events(&[of(2)]), "  quake: 0.0 to 0.5; 1.0 to 1.5\n");
        assert_eq!(times_of_events(&[of(5)]), "  quake: 5 times, the first 0.0 to 0.5, the last from 4.0 on\n");
    }
}

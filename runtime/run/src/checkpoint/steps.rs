//! What was done in a step as bytes of the log.

use wfl_checks::{About, Accuracy, Others, PhysicsCheck, TurnedCells};
use wfl_contact::{Creep, FrictionWork, SlidPast};
use wfl_discrete::{assemble::NegativeVolumes, window::Window};
use wfl_newton::{Iteration, Method, StepHistory, Stop};
use wfl_output::bytes::{Reader, Unreadable, Writer};
use wfl_sparse::solve::SolveReport;

use super::found::{found, read_found};
use crate::{Attempt, AttemptEnd, Path, StepResult};

pub(super) fn step(w: &mut Writer, s: &StepResult) {
    w.numbers(&[s.window.end, s.window.increment, s.limit]);
    let h = &s.history;
    w.count(h.iterations.len());
    for i in &h.iterations {
        w.count(i.number);
        w.numbers(&[i.residual, i.floor, i.step, i.merit]);
        w.count(i.method.number());
        w.count(i.changed);
        w.flag(i.contact.is_some());
        i.contact.unwrap_or_default().iter().for_each(|c| w.count(*c));
        w.word(i.fingerprint);
    }
    w.count(h.solves.len());
    for s in &h.solves {
        w.numbers(&[s.relative_residual, s.componentwise_residual]);
        w.count(s.refinements);
        w.count(s.krylov_iterations);
        w.flag(s.refactored);
    }
    w.count(match h.stop {
        None => 0,
        Some(Stop::Tolerance) => 1,
        Some(Stop::Floor) => 2,
        Some(Stop::MaxIterations) => 3,
        Some(Stop::Given) => 4,
        Some(Stop::Rest) => 5,
    });
    w.flag(h.displaced);
    w.count(h.turns);
    w.count(s.others as usize);
    w.count(s.attempts.len());
    s.attempts.iter().for_each(|a| attempt(w, a));
    w.numbers(&[s.hidden]);
    w.count(usize::from(s.accuracy.is_some()));
    s.accuracy.iter().for_each(|a| {
        w.numbers(&[a.error]);
        w.text(&a.field);
    });
    w.count(s.checks.len());
    for c in &s.checks {
        w.text(&c.name);
        let (kind, of) = match &c.about {
            About::Scene => (0, ""),
            About::Field(name) => (1, name.as_str()),
            About::Term(name) => (2, name.as_str()),
        };
        w.count(kind);
        w.text(of);
        let numbers: Vec<f64> = [c.value, c.limit].into_iter().chain(c.displacement).collect();
        w.numbers(&numbers);
        w.text(&c.detail);
    }
    w.count(s.turned.len());
    for TurnedCells { term, field, volumes } in &s.turned {
        w.text(term);
        w.text(field);
        w.count(volumes.n_cells);
        w.count(volumes.of);
        let [x, y, z] = volumes.position;
        w.numbers(&[volumes.smallest, x, y, z]);
    }
    w.count(usize::from(s.friction.is_some()));
    s.friction.iter().for_each(|f| w.numbers(&[f.taken, f.size, f.bound]));
    w.count(usize::from(s.creep.is_some()));
    if let Some(Creep { term, slip, step, position: [x, y, z], lost, moved, deformed }) = &s.creep {
        w.text(term);
        w.numbers(&[*slip, *step, *x, *y, *z, *lost, *moved, *deformed]);
    }
    w.count(s.slid.len());
    for SlidPast { term, faces, slip, position: [x, y, z], share } in &s.slid {
        w.text(term);
        w.numbers(&[*faces, *slip, *x, *y, *z, *share]);
    }
    found(w, s);
    quantities(w, s);
}

/// What was evaluated at the end of a step.
fn quantities(w: &mut Writer, s: &StepResult) {
    w.count(s.events.len());
    s.events.iter().for_each(|sides| w.numbers(sides));
    w.count(s.series.len());
    for rows in &s.series {
        w.count(rows.len());
        rows.iter().for_each(|row| w.numbers(row));
    }
    w.count(s.measures.len());
    for (name, value) in &s.measures {
        w.text(name);
        w.numbers(&[*value]);
    }
}

fn read_check(r: &mut Reader<'_>) -> Result<PhysicsCheck, Unreadable> {
    let name = r.text()?;
    let about = match (r.count()?, r.text()?) {
        (0, _) => About::Scene,
        (1, name) => About::Field(name),
        (2, name) => About::Term(name),
        _ => return Err(Unreadable),
    };
    let (value, limit, displacement) = match *r.numbers()?.as_slice() {
        [value, limit] => (value, limit, None),
        [value, limit, displacement] => (value, limit, Some(displacement)),
        _ => return Err(Unreadable),
    };
    Ok(PhysicsCheck { name, about, value, limit, detail: r.text()?, displacement })
}

pub(super) fn read_step(r: &mut Reader<'_>) -> Result<StepResult, Unreadable> {
    let [end, increment, limit] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let mut step =
        StepResult { window: Window::new(end, increment), limit, history: read_history(r)?, ..StepResult::default() };
    step.others = match r.count()? {
        0 => Others::Unknown,
        1 => Others::Possible,
        2 => Others::Proved,
        _ => return Err(Unreadable),
    };
    step.attempts = r.list(read_attempt)?;
    let [hidden] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    step.hidden = hidden;
    let accuracy = r.list(|r| {
        let [error] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(Accuracy { error, field: r.text()? })
    })?;
    step.accuracy = accuracy.into_iter().next();
    step.checks = r.list(read_check)?;
    step.turned = r.list(|r| {
        let (term, field, n_cells, of) = (r.text()?, r.text()?, r.count()?, r.count()?);
        let [smallest, x, y, z] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        let volumes = NegativeVolumes { n_cells, of, smallest, position: [x, y, z] };
        Ok(TurnedCells { term, field, volumes })
    })?;
    let friction = r.list(|r| {
        let [taken, size, bound] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(FrictionWork { taken, size, bound })
    })?;
    step.friction = friction.into_iter().next();
    let creep = r.list(|r| {
        let term = r.text()?;
        let [slip, step, x, y, z, lost, moved, deformed] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(Creep { term, slip, step, position: [x, y, z], lost, moved, deformed })
    })?;
    step.creep = creep.into_iter().next();
    step.slid = r.list(|r| {
        let term = r.text()?;
        let [faces, slip, x, y, z, share] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(SlidPast { term, faces, slip, position: [x, y, z], share })
    })?;
    read_found(r, &mut step)?;
    step.events = r.list(|r| r.numbers()?.try_into().map_err(|_| Unreadable))?;
    step.series = r.list(|r| r.list(Reader::numbers))?;
    step.measures = r.list(|r| {
        let name = r.text()?;
        let [value] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok((name, value))
    })?;
    Ok(step)
}

fn read_history(r: &mut Reader<'_>) -> Result<StepHistory, Unreadable> {
    let iterations = r.list(|r| {
        let number = r.count()?;
        let [residual, floor, step, merit] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        let method = Method::from_number(r.count()?).ok_or(Unreadable)?;
        let changed = r.count()?;
        let known = r.flag()?;
        let counts = [r.count()?, r.count()?, r.count()?];
        let contact = known.then_some(counts);
        Ok(Iteration { number, residual, floor, step, method, merit, changed, contact, fingerprint: r.word()? })
    })?;
    let solves = r.list(|r| {
        let [relative_residual, componentwise_residual] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        let (refinements, krylov_iterations, refactored) = (r.count()?, r.count()?, r.flag()?);
        Ok(SolveReport { relative_residual, componentwise_residual, refinements, krylov_iterations, refactored })
    })?;
    let stop = match r.count()? {
        0 => None,
        1 => Some(Stop::Tolerance),
        2 => Some(Stop::Floor),
        3 => Some(Stop::MaxIterations),
        4 => Some(Stop::Given),
        5 => Some(Stop::Rest),
        _ => return Err(Unreadable),
    };
    let (displaced, turns) = (r.flag()?, r.count()?);
    Ok(StepHistory { iterations, solves, stop, displaced, turns, ..StepHistory::default() })
}

fn attempt(w: &mut Writer, a: &Attempt) {
    let (path, worse) = match (a.path, &a.end) {
        (Path::Steps, _) => (0, 0.0),
        (Path::Load, _) => (1, 0.0),
        (Path::Chosen, AttemptEnd::Rejected(error) | AttemptEnd::Forced(error)) => (2, *error),
        (Path::Chosen, _) => (2, 0.0),
    };
    w.count(path);
    w.numbers(&[a.part.0, a.part.1, worse]);
    w.count(a.iterations);
    w.count(a.linear_solves);
    let (kind, why) = match &a.end {
        AttemptEnd::Converged => (0, ""),
        AttemptEnd::NotConverged => (1, ""),
        AttemptEnd::Failed(why) => (2, why.as_str()),
        AttemptEnd::Rejected(_) => (3, ""),
        AttemptEnd::Forced(_) => (4, ""),
    };
    w.count(kind);
    w.text(why);
}

fn read_attempt(r: &mut Reader<'_>) -> Result<Attempt, Unreadable> {
    let path = *[Path::Steps, Path::Load, Path::Chosen].get(r.count()?).ok_or(Unreadable)?;
    let [from, to, worse] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let (iterations, linear_solves) = (r.count()?, r.count()?);
    let (kind, why) = (r.count()?, r.text()?);
    let end = match kind {
        0 => AttemptEnd::Converged,
        1 => AttemptEnd::NotConverged,
        2 => AttemptEnd::Failed(why),
        3 => AttemptEnd::Rejected(worse),
        4 => AttemptEnd::Forced(worse),
        _ => return Err(Unreadable),
    };
    Ok(Attempt { path, part: (from, to), iterations, linear_solves, end })
}

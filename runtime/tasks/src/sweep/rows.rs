//! One row of a sweep: the repeated runs of a setting, its errors, times and costs.

use wfl_adapt::{
    compare::{Solved, measures},
    knobs::Setting,
};

use super::{
    Method, Sweep,
    front::PROBLEM,
    kept::problem_of_key,
    machine,
    plan::Planned,
    reference::Reference,
    table::{NOT_AS_EXPECTED, Row, SOLVED},
};
use crate::{
    bench::{Run, Status},
    setting_text,
};

impl Sweep<'_> {
    /// What identifies a row: scene with its text, setting, repetitions and reference.
    pub(super) fn key(&self, method: &Method, setting: &Setting) -> String {
        let reference = match method.against(setting) {
            Some(Ok(k)) => format!("{} {}", self.references[*k].what, self.references[*k].identity),
            Some(Err(why)) => format!("none: {}", why.lines().next().unwrap_or_default()),
            None => "none".to_owned(),
        };
        let n = self.job.repeat;
        let problem = problem_of_key(&method.path.display().to_string(), &method.known.identity.hash());
        format!("{problem}{} | {n} | {reference}", setting_text(setting))
    }

    /// Runs a setting as often as requested.
    pub(super) fn row(&self, planned: &Planned<'_>) -> Row {
        let Planned { method, setting, key, .. } = planned;
        machine::forget_peak_memory();
        let mut runs: Vec<Run> = Vec::new();
        for _ in 0..self.job.repeat.get() {
            let run = self.bench.run(&method.path, &method.known, setting, &method.more);
            let ok = run.status == Status::Ok;
            runs.push(run);
            if !ok {
                break;
            }
        }
        let mut row = self.head(method, setting);
        let mut seconds: Vec<f64> = runs.iter().map(|r| r.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let last = runs.pop();
        let errors = last.as_ref().and_then(|run| self.errors(method, setting, run));
        row.set("status", "failed");
        if let Some(run) = &last {
            let (status, message) = status(run, errors.as_ref());
            row.set("status", status);
            row.set("message", message);
        }
        row.number("repeats", seconds.len() as f64);
        if !self.parallel() {
            row.number("time", seconds[seconds.len() / 2]);
            row.number("time_min", seconds[0]);
            row.number("time_max", seconds[seconds.len() - 1]);
        }
        if let Some(solved) = last.as_ref().and_then(|r| r.solved.as_ref()) {
            if !self.parallel() {
                times(&mut row, solved);
            }
            costs(&mut row, solved);
        }
        if let Some(Ok(errors)) = errors {
            let reference = self.reference(method, setting);
            for (name, value) in &errors {
                row.number(format!("error {name}"), *value);
                if let Some(own) = reference.and_then(|r| r.own_error(name)) {
                    row.number(format!("reference error {name}"), own);
                }
            }
        }
        row.set("key", key.as_str());
        row
    }

    /// The columns that say how to run it again.
    fn head(&self, method: &Method, setting: &Setting) -> Row {
        let mut row = Row::default();
        row.set("scene", method.path.display().to_string());
        for (name, value) in setting {
            row.set(format!("knob {name}"), value.clone());
        }
        for column in ["status", "message"] {
            row.set(column, "");
        }
        let reference = match method.against(setting) {
            Some(Ok(k)) => self.references[*k].what.clone(),
            Some(Err(why)) => format!("none: {why}"),
            None => "none".to_owned(),
        };
        row.set("reference", reference);
        let problem: Vec<_> = setting.iter().filter(|k| self.problem_knobs.contains(&k.0)).cloned().collect();
        row.set(PROBLEM, setting_text(&problem));
        row.set("version", self.machine.version.clone());
        row.set("commit", self.machine.commit.clone());
        row.set("machine", self.machine.name.clone());
        row.number("threads", self.bench.threads as f64);
        row.set("command", format!("wfl sweep {} {}", method.path.display(), setting_text(setting)).trim_end());
        row
    }

    fn reference(&self, method: &Method, setting: &Setting) -> Option<&Reference> {
        method.against(setting)?.as_ref().ok().map(|k| &self.references[*k])
    }

    fn errors(&self, method: &Method, setting: &Setting, run: &Run) -> Option<Result<Vec<(String, f64)>, String>> {
        let reference = self.reference(method, setting)?;
        let solved = run.solved.as_ref().filter(|_| run.status == Status::Ok)?;
        Some(reference.errors(solved, self.bench.backend))
    }
}

/// The status of a row and what there is to say about it. Numbers that are not finite are a failure of their own.
fn status(run: &Run, errors: Option<&Result<Vec<(String, f64)>, String>>) -> (&'static str, String) {
    match (&run.status, errors) {
        (Status::Failed(why), _) => ("failed", why.clone()),
        (Status::NotConverged(why), _) => ("not converged", why.clone()),
        (Status::Ok, Some(Err(why))) => ("failed", format!("solved, but not comparable: {why}")),
        (Status::Ok, errors) => {
            let measures = run.solved.as_ref().map(measures).unwrap_or_default();
            let errors = errors.and_then(|e| e.as_ref().ok()).into_iter().flatten();
            let broken: Vec<&str> =
                errors.chain(&measures).filter(|v| !v.1.is_finite()).map(|v| v.0.as_str()).collect();
            if !broken.is_empty() {
                return ("not finite", format!("not a finite number: {}", broken.join(", ")));
            }
            let expected = run.solved.iter().flat_map(|s| &s.outcome.expectations);
            // one that reads a derivative is unknown: a sweep makes none
            let wrong: Vec<&str> = expected.filter(|e| e.1 == Some(false)).map(|e| e.0.text.as_str()).collect();
            if wrong.is_empty() {
                (SOLVED, String::new())
            } else {
                (NOT_AS_EXPECTED, format!("does not hold: expect {}", wrong.join("; expect ")))
            }
        }
    }
}

/// Seconds and memory of a run that had the machine to itself.
fn times(row: &mut Row, solved: &Solved) {
    let report = &solved.outcome.report;
    let t = report.timings;
    let split = [t.parse, t.compile, t.mesh, t.assemble, t.factor, t.solve];
    for (name, value) in ["parse", "compile", "mesh", "assemble", "factor", "solve"].into_iter().zip(split) {
        row.number(name, value);
    }
    if let Some(bytes) = report.peak_memory_bytes {
        row.number("peak_memory_bytes", bytes as f64);
    }
}

/// What a run cost in numbers that do not depend on the machine, and its measures.
fn costs(row: &mut Row, solved: &Solved) {
    let report = &solved.outcome.report;
    let steps = &solved.outcome.steps;
    row.set("solver", report.solver.clone().unwrap_or_default());
    row.number("dofs", report.dofs as f64);
    row.number("cells", report.mesh.cells as f64);
    row.number("steps", steps.len() as f64);
    row.number("iterations", steps.iter().map(wfl_run::StepResult::iterations).sum::<usize>() as f64);
    row.number("factorisations", report.factorisations as f64);
    let residual = |s: &wfl_run::StepResult| s.history.iterations.last().map(|i| i.residual);
    if let Some(largest) = steps.iter().filter_map(residual).max_by(f64::total_cmp) {
        row.number("residual", largest);
    }
    for (name, value) in measures(solved) {
        row.number(format!("measure {name}"), value);
    }
}

//! The contents of `report.json` from what a run did.

use wfl_discrete::pruning::Saving;
use wfl_host::team::Team;
use wfl_linear::LinearSolver;
use wfl_mesh::mesh::{CellKind, Mesh};
use wfl_newton::Stop;
use wfl_output::{
    AttemptReport, Check, ContactCounts, LeftOutReport, MeshReport, OrderedMap, ParameterValue, Real, Report,
    StepReport, Timings, peak_memory_bytes,
};
use wfl_problem::{LeftOut, Scene};

use super::{Attempt, AttemptEnd, Path, Run, RunOptions, StepResult, findings::worst_checks};

/// The report of a run, finished or not.
pub(super) fn report(
    scene: &Scene,
    options: &RunOptions,
    run: &Run,
    expectations: &[(wfl::Expect, Option<bool>)],
) -> Report {
    let (clock, solver) = (&run.clock, run.stepper.solver.as_ref().map(|solver| described(solver, &run.steps)));
    let explicit = scene.explicit.as_ref().map(|e| e.describe(&scene.steps));
    let mut report = Report {
        scene: options.name.clone(),
        version: options.version.clone(),
        dofs: scene.system.n_unknowns() as u64,
        threads: options.threads as u64,
        peak_memory_bytes: peak_memory_bytes(),
        solver: Some(solver.or(explicit).unwrap_or_default()),
        factorisations: run.stepper.solver.as_ref().map_or(0, LinearSolver::factorisations) as u64,
        warnings: options.warnings.clone(),
        about: options.about.clone(),
        ..Report::default()
    };
    for (name, value) in &scene.params {
        let shown = match (value.shape.rank(), value.values.as_slice()) {
            (0, [x]) => ParameterValue::from(*x),
            _ => ParameterValue::from(value.values.as_slice()),
        };
        report.parameters.insert(name.clone(), shown);
    }
    report.mesh = mesh_report(&scene.system.mesh);
    for (k, field) in scene.system.fields.iter().enumerate() {
        if let Some(range) = scene.system.range(k) {
            let is_free =
                |d: &usize| scene.system.numbering.free[*d] != wfl_discrete::system::FIXED && scene.system.owns(*d);
            let free = scene.system.team().count(range.filter(is_free).count());
            report.fields.insert(field.name.clone(), free as u64);
        }
    }
    report.left_out = scene.left_out().into_iter().map(|l| left_out(l, &options.savings)).collect();
    report.steps = run.steps.iter().map(step_report).collect();
    put_expectations(&mut report, expectations);
    for (_, check) in worst_checks(&run.steps) {
        let made = Check { value: Real(check.value), tolerance: Real(check.limit), ok: check.holds() };
        report.checks.insert(check.name.clone(), made);
    }
    report.timings = Timings {
        parse: options.parse_seconds,
        compile: scene.times.compile,
        mesh: scene.times.mesh,
        check: options.check_seconds + clock.check,
        assemble: clock.assemble,
        factor: clock.factor,
        solve: clock.solve,
        measure: clock.measure,
        write: clock.write,
        total: options.started.elapsed().as_secs_f64(),
    };
    report
}

/// The solver in words, with what an iteration took in all steps, those before the run was resumed included.
fn described(solver: &LinearSolver, steps: &[StepResult]) -> String {
    let text = solver.describe();
    let solves = || steps.iter().flat_map(|step| &step.history.solves);
    match solves().map(|solve| solve.krylov_iterations).sum::<usize>() {
        n if n > 0 && solver.has_no_factor() => format!("{text}; {n} iterations in {} solutions", solves().count()),
        _ => text,
    }
}

/// Writes which expectations hold.
pub fn put_expectations(report: &mut Report, expectations: &[(wfl::Expect, Option<bool>)]) {
    for (expect, holds) in expectations {
        let value = f64::from(u8::from(*holds != Some(true)));
        report.checks.insert(format!("expect {}", expect.text), Check::at_most(0.0, value));
    }
}

/// Largest resident memory of each rank in bytes, 0 where that is not known; asked by all of them. Empty for one alone.
pub(super) fn memory_by_rank(team: &dyn Team) -> Vec<u64> {
    if team.is_alone() {
        return Vec::new();
    }
    let mut all = vec![0; team.size()];
    all[team.rank()] = peak_memory_bytes().unwrap_or(0);
    team.sum_words(&mut all);
    all
}

fn mesh_report(mesh: &Mesh) -> MeshReport {
    let mut kinds: OrderedMap<u64> = OrderedMap::default();
    let counts = mesh.counts_by_kind();
    for (kind, count) in CellKind::ALL.iter().zip(&counts).filter(|(_, count)| **count > 0) {
        kinds.insert(kind.to_string(), u64::from(*count));
    }
    MeshReport {
        dim: mesh.dim() as u64,
        cells: counts.into_iter().map(u64::from).sum(),
        nodes: mesh.n_nodes_of_whole() as u64,
        kinds,
        ..MeshReport::default()
    }
}

fn step_report(step: &StepResult) -> StepReport {
    let history = &step.history;
    let mut measures: OrderedMap<Real> = OrderedMap::default();
    for (name, value) in &step.measures {
        measures.insert(name.clone(), Real(*value));
    }
    StepReport {
        t: Real(step.window.end),
        converged: history.converged(),
        stop: match history.stop {
            Some(Stop::Tolerance) => wfl_output::Stop::Tolerance,
            Some(Stop::Floor) => wfl_output::Stop::Floor,
            Some(Stop::Given) => wfl_output::Stop::Given,
            Some(Stop::Rest) => wfl_output::Stop::Rest,
            _ => wfl_output::Stop::Maxit,
        },
        iterations: step.iterations() as u64,
        floor: history.iterations.last().map(|i| Real(i.floor)),
        digits: step.accuracy.as_ref().map(|a| Real(a.digits())),
        residual: history.iterations.iter().map(|i| Real(i.residual)).collect(),
        contact: history.iterations.last().and_then(|i| i.contact).map(|c| ContactCounts {
            open: c[0] as u64,
            slip: c[1] as u64,
            stick: c[2] as u64,
        }),
        friction_work: step.friction.map(|f| Real(f.taken)),
        measures,
        attempts: step.parts().iter().map(attempt_report).collect(),
    }
}

fn attempt_report(attempt: &Attempt) -> AttemptReport {
    let (converged, error) = match &attempt.end {
        AttemptEnd::Converged => (true, None),
        AttemptEnd::NotConverged => (false, None),
        AttemptEnd::Forced(error) => (true, Some(format!("taken: its error is {error:.2e} of the demanded one"))),
        AttemptEnd::Rejected(error) => (true, Some(format!("rejected: its error is {error:.2e} of the demanded one"))),
        AttemptEnd::Failed(why) => (false, Some(why.clone())),
    };
    AttemptReport {
        path: match attempt.path {
            Path::Steps => "steps".to_owned(),
            Path::Load => "load".to_owned(),
            Path::Chosen => "chosen".to_owned(),
        },
        from: attempt.part.0,
        to: attempt.part.1,
        iterations: attempt.linear_solves as u64,
        converged,
        error,
    }
}

fn left_out(what: LeftOut, savings: &[Saving]) -> LeftOutReport {
    let saving = savings.iter().find(|s| Some(s.pruning) == what.switch);
    LeftOutReport {
        name: what.name,
        why: what.why,
        switch: what.switch.map(|s| s.name().to_owned()),
        times: saving.map(|s| Real(s.times)),
        moved: saving.map(|s| Real(s.moved)),
    }
}

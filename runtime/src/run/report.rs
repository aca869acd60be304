//! The contents of `report.json` from what a run did.

use super::{Attempt, AttemptEnd, Others, Path, PhysicsCheck, Run, RunOptions, StepResult, friction};
use crate::{
    checks::{NarrowZone, TurnedCells, Unstable, Zigzag},
    finite,
    left_out::LeftOut,
    mesh::{CellKind, Mesh},
    newton::{LinearSolver, Stop},
    output::{
        self, AttemptReport, Check, ContactCounts, LeftOutReport, MeshReport, OrderedMap, ParameterValue, Real, Report,
        StepReport, Timings, peak_memory_bytes,
    },
    pruning::Saving,
    scene::Scene,
    team::Team,
};

/// The report of a run, finished or not.
pub(super) fn report(
    scene: &Scene,
    options: &RunOptions,
    run: &Run,
    expectations: &[(wfl::Expect, Option<bool>)],
) -> Report {
    let (clock, solver) = (&run.clock, run.stepper.solver.as_ref().map(LinearSolver::describe));
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
            let is_free = |d: &usize| scene.system.numbering.free[*d] != crate::system::FIXED && scene.system.owns(*d);
            let free = scene.system.team().count(range.filter(is_free).count());
            report.fields.insert(field.name.clone(), free as u64);
        }
    }
    report.left_out = scene.left_out().into_iter().map(|l| left_out(l, &options.savings)).collect();
    report.steps = run.steps.iter().map(step_report).collect();
    for (expect, holds) in expectations {
        let value = f64::from(u8::from(*holds != Some(true)));
        report.checks.insert(format!("expect {}", expect.text), Check::at_most(0.0, value));
    }
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

/// Of each condition the step at which it holds least, in the order of their first appearance.
fn worst_checks(steps: &[StepResult]) -> Vec<(f64, &PhysicsCheck)> {
    let mut worst: Vec<(f64, &PhysicsCheck)> = Vec::new();
    for (time, check) in steps.iter().flat_map(|s| s.checks.iter().map(|c| (s.time, c))) {
        match worst.iter_mut().find(|w| w.1.name == check.name) {
            Some(w) if w.1.value >= check.value => {}
            Some(w) => *w = (time, check),
            None => worst.push((time, check)),
        }
    }
    worst
}

/// What gives cause to doubt the numbers: too few digits, conditions of mechanics that do not hold.
pub(super) fn warnings(steps: &[StepResult]) -> Vec<(&'static str, String)> {
    let mut out = Vec::new();
    let poorest = steps.iter().filter_map(|s| Some((s, s.accuracy.as_ref()?)));
    if let Some((step, a)) = poorest.min_by(|a, b| a.1.digits().total_cmp(&b.1.digits()))
        && a.digits() < FEW_DIGITS
    {
        out.push((
            "W605",
            format!(
                "fewer than {FEW_DIGITS} correct digits of `{}` at t = {}: rounding alone changes it by about {:.0e} of its size",
                a.field, step.time, a.error
            ),
        ));
    }
    if let Some(step) = steps.iter().find(|s| s.history.displaced) {
        out.push((
            "W607",
            format!("at t = {} the tangent is singular at zero: started from a displaced state", step.time),
        ));
    }
    out.extend(turned(steps).map(|(time, cells)| ("W616", turned_text(time, cells))));
    out.extend(narrow(steps).map(|text| ("W617", text)));
    out.extend(zigzags(steps).map(|text| ("W520", text)));
    out.extend(friction::warnings(steps));
    out.extend(several(steps).map(|text| ("W609", text)));
    out.extend(unstable(steps).map(|text| ("W640", text)));
    out.extend(laborious(steps).map(|text| ("W641", text)));
    for (time, check) in worst_checks(steps).into_iter().filter(|(_, c)| !c.holds()) {
        let (name, value, limit, detail) = (&check.name, check.value, check.limit, &check.detail);
        out.push(("W606", format!("{name}: {value:.1e} at t = {time}, at most {limit:.0e} expected; {detail}")));
    }
    out
}

/// By term the first step in which cells turned inside out.
pub(crate) fn turned(steps: &[StepResult]) -> impl Iterator<Item = (f64, &TurnedCells)> {
    let all = || steps.iter().flat_map(|s| s.turned.iter().map(|cells| (s.time, cells)));
    let is_first = move |at: usize, cells: &TurnedCells| all().take(at).all(|(_, c)| c.term != cells.term);
    all().enumerate().filter(move |(at, (_, cells))| is_first(*at, cells)).map(|(_, found)| found)
}

/// What is said of cells that turned.
pub(crate) fn turned_text(time: f64, cells: &TurnedCells) -> String {
    let TurnedCells { term, field, volumes } = cells;
    format!(
        "at t = {time} {} of the {} cells of `{term}` are turned inside out: the determinant of Id + Grad_{field} is {:.3e} \
         at {}",
        volumes.n_cells,
        volumes.of,
        volumes.smallest,
        finite::position(volumes.position)
    )
}

/// The zones of contact of the last step that cover no face.
fn narrow(steps: &[StepResult]) -> impl Iterator<Item = String> {
    let zones = steps.last().into_iter().flat_map(|s| s.narrow.iter().map(|zone| (s.time, zone)));
    zones.map(|(time, NarrowZone { term, faces })| {
        format!(
            "at t = {time} `{term}` presses at points of {} of its {} faces, and on none of them at all points: size and \
             pressures of so small a zone of contact are those of the quadrature rule; smaller faces there resolve it",
            faces.some, faces.of
        )
    })
}

/// By term the step in which its pressures alternate most.
fn zigzags(steps: &[StepResult]) -> impl Iterator<Item = String> {
    let mut worst: Vec<(f64, &Zigzag)> = Vec::new();
    for (time, zigzag) in steps.iter().flat_map(|s| s.zigzags.iter().map(|z| (s.time, z))) {
        match worst.iter_mut().find(|w| w.1.term == zigzag.term) {
            Some(w) if w.1.size.amplitude >= zigzag.size.amplitude => {}
            Some(w) => *w = (time, zigzag),
            None => worst.push((time, zigzag)),
        }
    }
    worst.into_iter().map(|(time, Zigzag { term, size })| {
        format!(
            "at t = {time} the pressures of `{term}` alternate from point to point by about {:.0} % of their mean, on {:.0} % \
             of the zone of contact; forces and means over faces are not affected. Either contact acts at more points than \
             the displacements can follow (leave `quadrature` out there, or `vertex`; through a mapping a smaller gamma), \
             or the gap varies from face to face (smaller faces resolve it)",
            100.0 * size.amplitude,
            100.0 * size.area
        )
    })
}

/// The strongest of what says that a state has others beside it.
fn several(steps: &[StepResult]) -> Option<String> {
    let first = |others: Others| steps.iter().find(|s| s.others == others);
    if let Some(step) = first(Others::Proved) {
        return Some(format!(
            "at t = {} the solution is not unique: the determinant of its tangent has the opposite sign to that of the \
             tied bodies, which proves that other solutions exist",
            step.time
        ));
    }
    if let Some(step) = steps.iter().find(|s| s.history.turns > 0) {
        return Some(format!(
            "from t = {} on the solution may not be unique: the load decreased on the path to it, with {} turning points",
            step.time, step.history.turns
        ));
    }
    first(Others::Possible).map(|step| {
        format!(
            "from t = {} on the solution may not be unique: the determinant of a tangent during the iteration has the \
             opposite sign to that of the tied bodies, so that some loads have several solutions",
            step.time
        )
    })
}

/// The first step that ends in an equilibrium which is no minimum of the energy.
fn unstable(steps: &[StepResult]) -> Option<String> {
    let (time, found) = steps.iter().find_map(|s| Some((s.time, s.unstable?)))?;
    let directions = match found {
        Unstable::Directions(1) => "1 direction (a negative eigenvalue of the tangent)".to_owned(),
        Unstable::Directions(n) => format!("{n} directions (negative eigenvalues of the tangent)"),
        Unstable::Odd => "an odd number of directions (the determinant of the tangent is negative)".to_owned(),
    };
    Some(format!(
        "at t = {time} the equilibrium is not stable: the energy decreases in {directions}, so that the bodies do not stay \
         there; a load at which they buckle or snap through lies before. `perturb=1e-6` follows the branch that buckles"
    ))
}

/// A step is told that took so many times the iterations of the others: the median of those that took some, and no fewer than
/// a nonlinear step takes whose start is good.
const LABORIOUS: usize = 10;
const FEW_ITERATIONS: usize = 3;

/// The step that took the most iterations, if those are many times what the other steps took.
fn laborious(steps: &[StepResult]) -> Option<String> {
    let converged = || steps.iter().filter(|s| s.history.converged());
    let most = converged().max_by(|a, b| a.iterations().cmp(&b.iterations()))?;
    let mut all: Vec<usize> = converged().map(StepResult::iterations).filter(|n| *n > 0).collect();
    all.sort_unstable();
    let usual = all.get((all.len().max(1) - 1) / 2)?.max(&FEW_ITERATIONS);
    // of one step there is nothing to compare it with
    let several = converged().count() > 1;
    let usual = if all.len() < 2 { FEW_ITERATIONS } else { *usual };
    (several && most.iterations() >= LABORIOUS * usual).then(|| {
        format!(
            "the step to t = {} took {} iterations, other steps about {usual}: it may have ended in another state than that \
             which the steps before lead to; compare its measures with those of smaller steps",
            most.time,
            most.iterations()
        )
    })
}

/// A result with fewer correct digits is warned of.
pub(super) const FEW_DIGITS: f64 = 3.0;

fn step_report(step: &StepResult) -> StepReport {
    let history = &step.history;
    let mut measures: OrderedMap<Real> = OrderedMap::default();
    for (name, value) in &step.measures {
        measures.insert(name.clone(), Real(*value));
    }
    StepReport {
        t: Real(step.time),
        converged: history.converged(),
        stop: match history.stop {
            Some(Stop::Tolerance) => output::Stop::Tolerance,
            Some(Stop::Floor) => output::Stop::Floor,
            Some(Stop::Given) => output::Stop::Given,
            _ => output::Stop::Maxit,
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

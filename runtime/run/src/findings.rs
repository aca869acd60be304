//! What a run gives cause to doubt at its end: too few digits, conditions of mechanics that do not hold, states beside the one
//! that was found. [`CHECKS`] is the list of all that is looked at; a terminal, a report and a binding show what it finds.
//! Each finding is made once, as a message with its place in the scene and what helps. Decides nothing about the steps.

use std::collections::BTreeMap;

use wfl::{Code, Diagnostic};
use wfl_checks::{About, Accuracy, NarrowZone, TurnedCells, Unstable, Zigzag};
use wfl_discrete::finite::position;
use wfl_problem::Scene;

use super::{Others, PhysicsCheck, Run, StepResult, ended::Ended, friction, leaving, partial, watched};

/// A result with fewer correct digits is warned of.
pub(super) const FEW_DIGITS: f64 = 3.0;

/// A step is told that took so many times the iterations of the others: the median of those that took some, and no fewer than
/// a nonlinear step takes whose start is good.
const LABORIOUS: usize = 10;
const FEW_ITERATIONS: usize = 3;

/// What is looked at when a run has ended.
struct Check {
    /// The codes of its messages: no other check has them.
    codes: &'static [Code],
    look: fn(&Ended<'_>) -> Vec<Diagnostic>,
}

/// Everything that is looked at, in the order in which it is told.
const CHECKS: &[Check] = &[
    Check { codes: &[Code::W605], look: |run| few_digits(run.scene, &run.run.steps) },
    Check { codes: &[Code::W607], look: |run| displaced(&run.run.steps).into_iter().collect() },
    Check { codes: &[Code::W616], look: |run| turned_cells(run.scene, &run.run.steps) },
    Check { codes: &[Code::W617], look: |run| narrow(run.scene, &run.run.steps) },
    Check { codes: &[Code::W520], look: |run| zigzags(run.scene, &run.run.steps) },
    Check {
        codes: &[Code::W615, Code::W630, Code::W631],
        look: |run| friction::findings(run.scene, &run.run.steps).collect(),
    },
    Check { codes: &[Code::W609], look: |run| several(&run.run.steps).into_iter().collect() },
    Check { codes: &[Code::W640], look: |run| unstable(&run.run.steps).into_iter().collect() },
    Check { codes: &[Code::W641], look: |run| laborious(&run.run.steps).into_iter().collect() },
    Check { codes: &[Code::W606], look: |run| broken_conditions(run.scene, &run.run.steps) },
    Check { codes: &[Code::W645], look: watched::large_strains },
    Check { codes: &[Code::W646], look: watched::distant_contacts },
    Check { codes: &[Code::W647], look: watched::growth },
    Check { codes: &[Code::W648], look: watched::locked_bending },
    Check { codes: &[Code::W649], look: watched::alternating },
    Check { codes: &[Code::W632, Code::W670], look: watched::lost_images },
    Check { codes: &[Code::W610], look: |run| bad_measures(run.run) },
    Check { codes: &[Code::W620], look: |run| leaving::lost(run).into_iter().collect() },
    Check { codes: &[Code::W650], look: unbalanced },
    Check { codes: &[Code::W651], look: partial::told },
    Check { codes: &[Code::W652], look: watched::ringing },
    Check {
        codes: &[Code::W621],
        look: |run| {
            let stability = run.run.integrators.explicit.as_ref().map(|explicit| &explicit.stability);
            let told = stability.and_then(|stability| stability.told(|| run.scene.steps.longest_increment()));
            told.into_iter().collect()
        },
    },
    Check {
        codes: &[Code::W618],
        look: |run| {
            let unestimated = run.run.unestimated(run.scene).filter(|_| run.is_done);
            run.run.forced(run.scene).into_iter().chain(unestimated).chain(run.run.beside(run.scene)).collect()
        },
    },
    Check { codes: &[Code::W619], look: |run| run.run.unlimited(run.scene).into_iter().collect() },
];

/// What gives cause to doubt the numbers of a run.
pub(super) fn of_run(run: &Ended<'_>) -> Vec<Diagnostic> {
    let mut out = Vec::new();
    for check in CHECKS {
        let found = (check.look)(run);
        debug_assert!(found.iter().all(|d| check.codes.contains(&d.code)), "{:?}: {found:?}", check.codes);
        out.extend(found);
    }
    out
}

/// By condition the largest displacement that it is in parts of, at any step.
fn farthest(steps: &[StepResult]) -> BTreeMap<&str, f64> {
    let mut found = BTreeMap::new();
    for check in steps.iter().flat_map(|s| &s.checks) {
        let far: &mut f64 = found.entry(check.name.as_str()).or_default();
        *far = far.max(check.displacement.unwrap_or(0.0));
    }
    found
}

/// The conditions of a step as they are judged beside the others of its run.
pub(super) fn judged_beside(step: &StepResult, steps: &[StepResult]) -> Vec<PhysicsCheck> {
    let farthest = farthest(steps);
    let judged = |check: &PhysicsCheck| {
        let value = check.beside(farthest.get(check.name.as_str()).copied().unwrap_or(0.0));
        PhysicsCheck { value, ..check.clone() }
    };
    step.checks.iter().map(judged).collect()
}

/// Of each condition the step at which it holds least, in the order of their first appearance.
pub(super) fn worst_checks(steps: &[StepResult]) -> Vec<(f64, PhysicsCheck)> {
    let farthest = farthest(steps);
    let beside = |check: &PhysicsCheck| check.beside(farthest[check.name.as_str()]);
    let mut worst: Vec<(f64, &PhysicsCheck)> = Vec::new();
    for (time, check) in steps.iter().flat_map(|s| s.checks.iter().map(|c| (s.window.end, c))) {
        match worst.iter_mut().find(|w| w.1.name == check.name) {
            Some(w) if beside(w.1) >= beside(check) => {}
            Some(w) => *w = (time, check),
            None => worst.push((time, check)),
        }
    }
    worst.into_iter().map(|(time, check)| (time, PhysicsCheck { value: beside(check), ..check.clone() })).collect()
}

/// W605, of the unknowns and of the forces.
fn few_digits(scene: &Scene, steps: &[StepResult]) -> Vec<Diagnostic> {
    let all = steps.iter().filter_map(|s| Some((s, s.accuracy.as_ref()?)));
    let of_unknowns = all.min_by(|a, b| a.1.digits().total_cmp(&b.1.digits())).filter(|(_, a)| a.digits() < FEW_DIGITS);
    let of_unknowns = of_unknowns.map(|(step, Accuracy { error, field })| {
        let text = format!("rounding alone changes it by about {error:.0e} of its size");
        let time = step.window.end;
        Diagnostic::new(Code::W605, format!("fewer than {FEW_DIGITS} correct digits of `{field}` at t = {time}"))
            .at_or_note(scene.place_of_field(field), text)
    });
    let of_forces = steps.iter().max_by(|a, b| a.hidden.total_cmp(&b.hidden)).filter(|step| step.hidden > 0.0);
    let of_forces = of_forces.map(|step| {
        let (time, part) = (step.window.end, step.hidden);
        let text = format!("{part:.0e} of them does not balance, which rounding of the terms hides");
        Diagnostic::new(Code::W605, format!("fewer than {FEW_DIGITS} correct digits of the forces at t = {time}"))
            .note(text)
    });
    of_unknowns.into_iter().chain(of_forces).collect()
}

/// W607.
fn displaced(steps: &[StepResult]) -> Option<Diagnostic> {
    let step = steps.iter().find(|s| s.history.displaced)?;
    let text = format!("at t = {} the tangent is singular at zero: started from a displaced state", step.window.end);
    Some(Diagnostic::new(Code::W607, text))
}

/// W606 for each condition, at the step at which it holds least.
fn broken_conditions(scene: &Scene, steps: &[StepResult]) -> Vec<Diagnostic> {
    let broken = worst_checks(steps).into_iter().filter(|(_, check)| !check.holds());
    broken.map(|(time, check)| of_check(scene, time, &check)).collect()
}

fn of_check(scene: &Scene, time: f64, check: &PhysicsCheck) -> Diagnostic {
    let PhysicsCheck { name, about, value, limit, detail, .. } = check;
    let text = format!("{name}: {value:.1e} at t = {time}, at most {limit:.0e} expected");
    let place = match about {
        About::Scene => None,
        About::Field(field) => scene.place_of_field(field),
        About::Term(term) => scene.place_of_term(term),
    };
    Diagnostic::new(Code::W606, text).at_or_note(place, detail)
}

/// W616.
fn turned_cells(scene: &Scene, steps: &[StepResult]) -> Vec<Diagnostic> {
    turned(steps).map(|(time, cells)| of_turned(scene, time, cells)).collect()
}

/// By term the first step in which cells turned inside out.
fn turned(steps: &[StepResult]) -> impl Iterator<Item = (f64, &TurnedCells)> {
    let all = || steps.iter().flat_map(|s| s.turned.iter().map(|cells| (s.window.end, cells)));
    let is_first = move |at: usize, cells: &TurnedCells| all().take(at).all(|(_, c)| c.term != cells.term);
    all().enumerate().filter(move |(at, (_, cells))| is_first(*at, cells)).map(|(_, found)| found)
}

fn of_turned(scene: &Scene, time: f64, cells: &TurnedCells) -> Diagnostic {
    let TurnedCells { term, field, volumes } = cells;
    let text = format!(
        "at t = {time} {} of the {} cells of `{term}` are turned inside out: the determinant of Id + Grad_{field} is {:.3e} \
         at {}",
        volumes.n_cells,
        volumes.of,
        volumes.smallest,
        position(volumes.position)
    );
    let law = "this law has a stress at negative volumes, and no body is in such a state";
    Diagnostic::new(Code::W616, text).at_or_note(scene.place_of_term(term), law).help(
        "smaller load steps; a law with log(Det(Id + Grad_u)), which keeps cells from turning; smaller cells where they turn",
    )
}

/// W617 for zones of contact of the last step that cover no face.
fn narrow(scene: &Scene, steps: &[StepResult]) -> Vec<Diagnostic> {
    let zones = steps.last().into_iter().flat_map(|s| s.narrow.iter().map(|zone| (s.window.end, zone)));
    let told = zones.map(move |(time, NarrowZone { term, faces })| {
        let text = format!(
            "at t = {time} `{term}` presses at points of {} of its {} faces, and on none of them at all points",
            faces.some, faces.of
        );
        let rule = "size and pressures of so small a zone of contact are those of the quadrature rule";
        Diagnostic::new(Code::W617, text)
            .at_or_note(scene.place_of_term(term), rule)
            .help("smaller faces there resolve it")
    });
    told.collect()
}

/// W520: by term the step in which its pressures alternate most.
fn zigzags(scene: &Scene, steps: &[StepResult]) -> Vec<Diagnostic> {
    let mut worst: Vec<(f64, &Zigzag)> = Vec::new();
    for (time, zigzag) in steps.iter().flat_map(|s| s.zigzags.iter().map(|z| (s.window.end, z))) {
        match worst.iter_mut().find(|w| w.1.term == zigzag.term) {
            Some(w) if w.1.size.amplitude >= zigzag.size.amplitude => {}
            Some(w) => *w = (time, zigzag),
            None => worst.push((time, zigzag)),
        }
    }
    let told = worst.into_iter().map(move |(time, Zigzag { term, size })| {
        let text = format!(
            "at t = {time} the pressures of `{term}` alternate from point to point by about {:.0} % of their mean, on {:.0} % \
             of the zone of contact",
            100.0 * size.amplitude,
            100.0 * size.area
        );
        Diagnostic::new(Code::W520, text)
            .at_or_note(scene.place_of_term(term), "forces and means over faces are not affected")
            .note(
                "either contact acts at more points than the displacements can follow, or the gap varies from face to face",
            )
            .help("leave `quadrature` out there, or `vertex`; through a mapping a smaller gamma")
            .help("smaller faces resolve a gap that varies")
    });
    told.collect()
}

/// W609: the strongest of what says that a state has others beside it.
fn several(steps: &[StepResult]) -> Option<Diagnostic> {
    let first = |others: Others| steps.iter().find(|s| s.others == others);
    let told = |text: String, why: &str| Some(Diagnostic::new(Code::W609, text).note(why));
    if let Some(step) = first(Others::Proved) {
        return told(
            format!("at t = {} the solution is not unique", step.window.end),
            "the determinant of its tangent has the opposite sign to that of the tied bodies, which proves that other \
             solutions exist",
        );
    }
    if let Some(step) = steps.iter().find(|s| s.history.turns > 0) {
        return told(
            format!("from t = {} on the solution may not be unique", step.window.end),
            &format!("the load decreased on the path to it, with {} turning points", step.history.turns),
        );
    }
    let step = first(Others::Possible)?;
    told(
        format!("from t = {} on the solution may not be unique", step.window.end),
        "the determinant of a tangent during the iteration has the opposite sign to that of the tied bodies, so that some \
         loads have several solutions",
    )
}

/// W640: the first step that ends in an equilibrium which is no minimum of the energy.
fn unstable(steps: &[StepResult]) -> Option<Diagnostic> {
    let (time, found) = steps.iter().find_map(|s| Some((s.window.end, s.unstable?)))?;
    let directions = match found {
        Unstable::Directions(1) | Unstable::Beside(1) => {
            "1 direction (a negative eigenvalue of the tangent)".to_owned()
        }
        Unstable::Directions(n) | Unstable::Beside(n) => {
            format!("{n} directions (negative eigenvalues of the tangent)")
        }
        Unstable::Odd => "an odd number of directions (by the sign of the determinant of the tangent)".to_owned(),
    };
    let help = if matches!(found, Unstable::Directions(_)) {
        "`perturb=1e-6` follows the branch that buckles"
    } else {
        "a force to the side of 1e-4 of the load leads to the branch that buckles (`perturb` needs a symmetric tangent of \
         displacements alone, and changes nothing here)"
    };
    let text = format!("at t = {time} the equilibrium is not stable: the energy decreases in {directions}");
    Some(
        Diagnostic::new(Code::W640, text)
            .note("the bodies do not stay there; a load at which they buckle or snap through lies before")
            .help(help),
    )
}

/// W641: the step that took the most iterations, if those are many times what the other steps took.
fn laborious(steps: &[StepResult]) -> Option<Diagnostic> {
    let converged = || steps.iter().filter(|s| s.history.converged());
    let most = converged().max_by(|a, b| a.iterations_of_state().cmp(&b.iterations_of_state()))?;
    let mut all: Vec<usize> = converged().map(StepResult::iterations_of_state).filter(|n| *n > 0).collect();
    all.sort_unstable();
    let usual = all.get((all.len().max(1) - 1) / 2)?.max(&FEW_ITERATIONS);
    // of one step there is nothing to compare it with
    let several = converged().count() > 1;
    let usual = if all.len() < 2 { FEW_ITERATIONS } else { *usual };
    (several && most.iterations_of_state() >= LABORIOUS * usual).then(|| {
        let text = format!(
            "the step to t = {} took {} iterations, other steps about {usual}",
            most.window.end,
            most.iterations_of_state()
        );
        Diagnostic::new(Code::W641, text)
            .note("it may have ended in another state than that which the steps before lead to")
            .help("compare its measures with those of smaller steps")
    })
}

/// W610 for measures that are no numbers.
fn bad_measures(run: &Run) -> Vec<Diagnostic> {
    run.bad.iter().map(|bad| Diagnostic::new(Code::W610, bad.text())).collect()
}

/// W650.
fn unbalanced(run: &Ended<'_>) -> Vec<Diagnostic> {
    let floor = |s: &StepResult| s.history.iterations.last().map_or(0.0, |i| i.floor);
    let ended = run.run.steps.iter().map(|s| wfl_problem::Ended {
        window: s.window,
        measures: &s.measures,
        moved: &s.moved,
        floor: floor(s),
    });
    wfl_problem::unbalanced(run.scene, ended)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_has_codes_of_its_own() {
        let mut codes: Vec<Code> = CHECKS.iter().flat_map(|check| check.codes).copied().collect();
        let n = codes.len();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), n, "{codes:?}");
    }
}

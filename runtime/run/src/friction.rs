//! Friction over the parts of a step: the energy that it takes, and points that creep. What it remembers stays with the run
//! as states do. Makes findings of it; decides nothing about the steps.

use wfl::{Code, Diagnostic};
use wfl_contact::{Creep, FrictionMemory, FrictionStep, SlidPast};
use wfl_discrete::finite;
use wfl_problem::{Scene, Solving};

use super::StepResult;

/// What a run keeps of friction.
#[derive(Clone, Default)]
pub(super) struct Friction {
    /// What it remembers from part to part.
    pub(super) memory: FrictionMemory,
    /// The parts of the present step.
    step: Option<FrictionStep>,
}

impl Friction {
    /// For a scene with friction whose steps are solved.
    pub(super) fn of(scene: &Solving<'_>) -> Option<Self> {
        (scene.contact.has_sliding() && scene.explicit.is_none()).then(Self::default)
    }

    /// Adds a part of a step that has ended at `u`, before its states become `next`.
    pub(super) fn slide(&mut self, scene: &Solving<'_>, u: &[f64], next: &[Vec<f64>]) {
        let states = scene.states.iter().zip(next);
        let next: Vec<(usize, &[f64])> = states.map(|(state, values)| (state.field, values.as_slice())).collect();
        let Some(part) = self.memory.pass(scene.system, scene.contact, u, &next) else { return };
        let step = self.step.get_or_insert_with(FrictionStep::default);
        *step = FrictionStep { work: step.work.and(part.work), creep: part.creep };
    }

    /// What friction did in the step that has ended.
    pub(super) fn take(&mut self) -> Option<FrictionStep> {
        self.step.take()
    }
}

/// Why nothing is known of the energy of friction in a run with these steps; `None` where it is known, or has no friction.
pub(super) fn untested(scene: &Solving<'_>, steps: &[StepResult]) -> Option<&'static str> {
    let has_steps = steps.iter().any(|s| s.history.converged());
    if !scene.contact.has_sliding() || !has_steps || steps.iter().any(|s| s.friction.is_some()) {
        return None;
    }
    Some(if scene.explicit.is_some() {
        "the laws of explicit steps are not read again at the end of a step"
    } else {
        "no force with a friction bound acts on a displacement that its law reads"
    })
}

/// Energy that friction gives back counts if it is this part of the most that it had taken in the run: where loads only
/// grow but turn, a few thousandths come back.
const BACK: f64 = 0.1;
/// It is rounding below this part of what it is summed from, and of the friction bound over the largest displacement.
const CANCELLED: f64 = 1e-3;
const MOVED: f64 = 1e-6;

/// How a law keeps the slip that it remembers.
const IN_A_STATE: &str = "keep the slip in a state, `state slid : vector on fault := Previous_slid + (Pt - \
                          Ball_projection(Pt, ...))/gamma`, and write Pt = gamma*(tang(jump(uL,uR)) - Previous_slid) - ...";

/// What there is to say of friction and sliding.
pub(super) fn findings(scene: &Scene, steps: &[StepResult]) -> impl Iterator<Item = Diagnostic> {
    energy_back(steps).into_iter().chain(creep(scene, steps)).chain(slid(scene, steps))
}

/// W615: the step in which friction as a whole has given back a part of the energy that it took.
fn energy_back(steps: &[StepResult]) -> Option<Diagnostic> {
    let works = || steps.iter().filter_map(|s| Some((s.window.end, s.friction?)));
    let (mut sum, mut most, mut size, mut bound) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (_, work) in works() {
        sum += work.taken;
        most = most.max(sum);
        size += work.size;
        bound = bound.max(work.bound);
    }
    let limit = (BACK * most).max(CANCELLED * size).max(MOVED * bound);
    let (mut sum, mut high) = (0.0f64, 0.0f64);
    for (time, work) in works() {
        sum += work.taken;
        high = high.max(sum);
        let back = high - sum;
        if back > limit {
            let text = format!(
                "by t = {time} friction has returned the energy {back:.3e} of {high:.3e} that it had dissipated"
            );
            let d = Diagnostic::new(Code::W615, text).note("a law for the total slip has no memory");
            return Some(d.help(IN_A_STATE));
        }
    }
    None
}

/// W630: the step in which points that stick had crept most.
fn creep(scene: &Scene, steps: &[StepResult]) -> Option<Diagnostic> {
    let any = || steps.iter().filter_map(|s| Some((s.window.end, s.creep.as_ref()?)));
    let moved = any().fold(0.0f64, |m, (_, creep)| m.max(creep.moved));
    let all = || any().filter(|(_, creep)| creep.counts(moved));
    let (first, _) = all().next()?;
    let (time, Creep { term, slip, step, position, .. }) = all().max_by(|a, b| a.1.slip.total_cmp(&b.1.slip))?;
    let text = format!(
        "at {} a point that sticks has slid by {slip:.3e} up to t = {time}, {step:.1e} of it in the last step, and slides on \
         with each step also where loads stay",
        finite::position(*position)
    );
    let d = Diagnostic::new(Code::W630, format!("from t = {first} on friction in `{term}` forgets where points stick"));
    let d = d.at_or_note(scene.place_of_term(term), text);
    Some(d.note("a law for the change of the slip since the last step loses its elastic part").help(IN_A_STATE))
}

/// W631: by term the first step in which its sides had slid by more than a face, and the most that they did.
fn slid(scene: &Scene, steps: &[StepResult]) -> impl Iterator<Item = Diagnostic> {
    let all = || steps.iter().flat_map(|s| s.slid.iter().map(|slid| (s.window.end, slid)));
    let is_first = move |at: usize, slid: &SlidPast| all().take(at).all(|(_, s)| s.term != slid.term);
    let firsts = all().enumerate().filter(move |(at, (_, slid))| is_first(*at, slid));
    firsts.map(move |(_, (first, SlidPast { term, faces, slip, position, .. }))| {
        let own = all().filter(|(_, s)| s.term == *term);
        let (time, most) = own.max_by(|a, b| a.1.faces.total_cmp(&b.1.faces)).expect("it is among them");
        let text = format!(
            "at {} by {slip:.3e}, {faces:.2} faces (at t = {time} at most by {:.3e}, {:.1} faces, with {:.0} % of the area in \
             contact beyond one)",
            finite::position(*position),
            most.slip,
            most.faces,
            100.0 * most.share
        );
        let message =
            format!("at t = {first} points of `{term}` that press have slid by more than a face of the other side");
        Diagnostic::new(Code::W631, message)
            .at_or_note(scene.place_of_term(term), text)
            .note(
                "points are paired once, on the initial mesh: forces stay on the faces where they were, also where the \
                 bodies have left each other",
            )
            .help(
                "let less slide, take faces of the other side that are as long as the slip, or write the other side as an \
                 obstacle, a formula of the position x + u",
            )
    })
}

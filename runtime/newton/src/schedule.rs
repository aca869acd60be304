//! Which method a step uses, and when the next one takes over: one table.
//!
//! Each method is the best somewhere (`docs/newton.md`). A step goes through the stages that its traits select, from
//! where it stands; a stage ends when its budget of iterations is spent or when it stalls. After the last one the first
//! begins again. A step whose tangent becomes singular on the way (a body that only friction holds, with all of it
//! slipping in an iterate) goes on with the next stage from its best state.

use super::{
    NewtonOptions,
    downhill::Downhill,
    history::{Iteration, StepHistory},
    homotopy::{FRICTION_BUDGET, FRICTION_PARTS, Homotopy},
    load_step::LoadStep,
    method::Method,
};
use wfl_contact::Contact;
use wfl_discrete::system::System;

/// What a step is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trait {
    /// It has projections, and steps are searched.
    Contact,
    /// It starts from the active set of a converged state.
    Warm,
    /// Contact is stiff against the bodies.
    Stiff,
    /// Contact binds the stresses of the bodies.
    OverConstrained,
    /// A projection is on a ball.
    Friction,
    /// With a frozen active set the problem is affine.
    Affine,
    /// It goes to where an energy is the least (`downhill`).
    Energy,
    /// The same but for laws on faces: joints that soften, and rub.
    NearEnergy,
    /// Bodies that are not linear go to where their energy is the least, but friction has none.
    Rubs,
}

impl Trait {
    /// True if all steps of a scene have it or none.
    fn is_of_the_scene(self) -> bool {
        matches!(self, Self::Contact | Self::Friction | Self::Affine | Self::Energy | Self::NearEnergy | Self::Rubs)
    }

    /// What a step with it is like, and one without; `None` for a trait of the scene.
    fn condition(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Warm => Some(("after a converged step", "without a converged step before")),
            Self::Stiff => Some(("stiff contact", "contact not stiff")),
            Self::OverConstrained => Some(("contact binds the stresses", "contact leaves the stresses free")),
            Self::Contact | Self::Friction | Self::Affine | Self::Energy | Self::NearEnergy | Self::Rubs => None,
        }
    }
}

/// When a stage ends before its budget is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stall {
    /// Not before.
    Never,
    /// After a full step that changed few points.
    Settled,
    /// Not even then while the residual gets smaller; at once where steps come to nothing or states come back.
    NoProgress,
    /// At once where most of the last steps are short and the residual does not fall.
    ShortSteps,
    /// With its budget, or before that where most of the last steps are short and the residual does not fall.
    Fruitless,
    /// As [`Stall::ShortSteps`], and where steps of any length do not make the residual smaller than it ever was: they may go round.
    Circling,
}

/// A line of the schedule.
#[derive(Clone, Copy, Debug)]
struct Stage {
    method: Method,
    /// Iterations that may pass.
    budget: usize,
    stall: Stall,
    /// Iterations at the beginning that are not damped: what the first active sets say of the laws is rough.
    undamped: usize,
    /// The traits that a step must have.
    with: &'static [Trait],
    /// The traits that it must not have.
    without: &'static [Trait],
}

/// Breakpoints that a path may pass: each costs an iteration, so that a path takes no longer than six stages of active
/// sets.
const PATH_BUDGET: usize = 150;
/// Breakpoints that all paths of an attempt may pass beside its iterations: as many paths as a schedule has.
pub(super) const BUDGET_OF_PATHS: usize = 3 * PATH_BUDGET;
/// Iterations while contact gets stiffer, beside the others of an attempt: five for each factor of four, up to what is ten million
/// times as stiff as the bodies.
pub(super) const ALL_OF_STIFFNESS: usize = 60;
/// Iterations in a row that may pass with short steps or without a smaller residual: two short steps were
/// tested and rejected (`docs/newton.md`).
const PATIENCE: usize = 6;

/// A stage with defaults: no undamped iterations.
const fn stage(
    method: Method,
    budget: usize,
    stall: Stall,
    with: &'static [Trait],
    without: &'static [Trait],
) -> Stage {
    Stage { method, budget, stall, undamped: 0, with, without }
}

/// The schedule. `docs/newton.md` has what it does.
const SCHEDULE: &[Stage] = {
    use Method as M;
    use Trait::{Affine, Contact, Energy, Friction, NearEnergy, OverConstrained, Rubs, Stiff, Warm};
    /// Iterations for all parts of friction, and some with friction as it is written: the last part has to converge.
    const ALL_OF_FRICTION: usize = FRICTION_PARTS * FRICTION_BUDGET + 10;
    &[
        stage(M::Overstress, 40, Stall::Never, &[Contact, OverConstrained], &[Warm]),
        Stage { undamped: 5, ..stage(M::ActiveSet, 25, Stall::NoProgress, &[Contact, OverConstrained, Warm], &[]) },
        Stage {
            undamped: 2,
            ..stage(M::ActiveSet, 10, Stall::NoProgress, &[Contact, Stiff], &[Warm, OverConstrained])
        },
        stage(M::ActiveSet, 10, Stall::NoProgress, &[Contact, Stiff, OverConstrained], &[Warm]),
        stage(M::ActiveSet, 25, Stall::NoProgress, &[Contact, Stiff, Warm], &[OverConstrained]),
        stage(M::ActiveSet, 25, Stall::NoProgress, &[Contact], &[Stiff, OverConstrained]),
        stage(M::ActiveSet, 25, Stall::NoProgress, &[Contact, OverConstrained], &[Stiff, Warm]),
        stage(M::Path, 20, Stall::Never, &[Contact, OverConstrained, Warm, Affine], &[]),
        stage(M::Overstress, 40, Stall::Never, &[Contact, OverConstrained, Warm], &[]),
        stage(M::ActiveSet, 25, Stall::NoProgress, &[Contact, OverConstrained, Warm], &[]),
        stage(M::Downhill, 50, Stall::Never, &[Contact, Energy], &[]),
        stage(M::Downhill, 50, Stall::Never, &[Contact, NearEnergy], &[]),
        stage(M::Stiffening, ALL_OF_STIFFNESS, Stall::Never, &[Contact, Energy, Affine], &[]),
        stage(M::Compliance, 8, Stall::Settled, &[Contact, Stiff], &[]),
        stage(M::ActiveSet, 25, Stall::NoProgress, &[Contact, Stiff], &[]),
        stage(M::Path, PATH_BUDGET, Stall::Never, &[Contact, Affine], &[]),
        stage(M::Stiffening, ALL_OF_STIFFNESS, Stall::Never, &[Contact, Affine], &[Energy, OverConstrained]),
        stage(M::PathFromStart, PATH_BUDGET, Stall::Never, &[Contact, Affine, Warm], &[]),
        // before the searches on the residual, which take long and seldom help where active sets circle
        stage(M::LessFriction, ALL_OF_FRICTION, Stall::Never, &[Contact, Friction], &[OverConstrained, Rubs]),
        stage(M::LessFriction, ALL_OF_FRICTION, Stall::Fruitless, &[Contact, Friction, Rubs], &[OverConstrained]),
        stage(M::Path, PATH_BUDGET, Stall::Never, &[Contact, Friction, Affine], &[OverConstrained]),
        stage(M::Downhill, 50, Stall::NoProgress, &[Contact, Rubs], &[]),
        stage(M::Natural, 50, Stall::Never, &[Contact], &[Stiff]),
        stage(M::Residual, PATIENCE, Stall::ShortSteps, &[], &[Energy, NearEnergy]),
        stage(M::Residual, PATIENCE, Stall::Circling, &[Energy], &[]),
        stage(M::Residual, PATIENCE, Stall::Circling, &[NearEnergy], &[]),
        stage(M::Natural, 50, Stall::Never, &[Contact, Stiff], &[]),
        stage(M::Downhill, 50, Stall::Never, &[Energy], &[Contact]),
        stage(M::Natural, 50, Stall::Never, &[], &[Contact]),
        stage(M::Downhill, 50, Stall::Never, &[NearEnergy], &[Contact]),
        // but where contact binds stresses they do
        stage(M::LessFriction, ALL_OF_FRICTION, Stall::Never, &[Contact, Friction, OverConstrained], &[]),
        stage(M::Path, PATH_BUDGET, Stall::Never, &[Contact, Friction, OverConstrained, Affine], &[]),
        stage(M::MoreFriction, ALL_OF_FRICTION, Stall::Never, &[Contact, Friction], &[]),
    ]
};

/// Of so many iterations in a row each steps less than this part of a correction where steps come to nothing: less than four
/// halvings each, five times, leaves more than four fifths of the way to go.
const STUCK: usize = 5;
const NOTHING: f64 = 0.04;
/// A state is met again if its branches are the same and its residual is, but for this part of it: what rounding and solutions
/// that are not exact leave of a cycle.
const AGAIN: f64 = 1e-6;
/// A stage may go on while the residual has halved in so many iterations: slower than that another method is worth its start.
const PROGRESS: usize = 10;
/// The part of the points whose change is small enough that an active set has settled: the branches that are left change at
/// the rims of zones, which the next stage begins with as well.
const FEW: f64 = 0.1;
/// A step below this part of a correction is short: two halvings are usual on the way, three are not.
const SHORT: f64 = 0.2;

/// A stage of the schedule of a scene, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedStage {
    /// The method.
    pub method: Method,
    /// Iterations before the next stage begins, unless the stage ends earlier.
    pub iterations: usize,
    /// The steps that come to it; empty for all.
    pub when: String,
}

/// The stages that the steps of a scene may go through, in their order. Whether contact is stiff is known when a step
/// begins, so it stays a condition. Empty for a linear scene.
#[must_use]
pub fn planned_stages(system: &System, contact: &Contact, options: NewtonOptions) -> Vec<PlannedStage> {
    if system.is_linear() {
        return Vec::new();
    }
    if !options.search {
        return planned(&[]).into_iter().take(1).collect();
    }
    let known = traits_of(system, contact).into_iter();
    let known: Vec<Trait> =
        known.filter(|t| t.is_of_the_scene() && (*t != Trait::Contact || !contact.is_empty())).collect();
    planned(&known)
}

fn planned(known: &[Trait]) -> Vec<PlannedStage> {
    let fits = |s: &&Stage| {
        s.with.iter().all(|t| !t.is_of_the_scene() || known.contains(t)) && s.without.iter().all(|t| !known.contains(t))
    };
    let words = |s: &Stage| {
        let with = s.with.iter().filter_map(|t| Some(t.condition()?.0));
        let without = s.without.iter().filter_map(|t| Some(t.condition()?.1));
        with.chain(without).collect::<Vec<_>>().join(", ")
    };
    let of = |s: &Stage| PlannedStage { method: s.method, iterations: s.budget, when: words(s) };
    SCHEDULE.iter().filter(fits).map(of).collect()
}

/// The schedule of a step, and where the step is in it.
pub(super) struct Schedule {
    stages: Vec<Stage>,
    position: usize,
    /// Iterations in the present stage, the present one included.
    iterations: usize,
    /// Stages whose tangent was singular.
    singular: usize,
    /// The last step was whole and changed few branches.
    settled: bool,
    homotopy: Homotopy,
}

impl Schedule {
    /// The stages for a step from `u`, or from a predicted state; the active set is chosen.
    pub(super) fn new(step: &mut LoadStep<'_>, u: &[f64], predicted: Option<&[f64]>) -> Self {
        let NewtonOptions { search, .. } = step.options;
        let mut traits = Vec::new();
        if search && !step.contact.is_empty() {
            let warm = step.contact.is_warm();
            step.contact.initialise(step.system, u, predicted);
            traits = traits_of(step.system, step.contact);
            traits.extend(warm.then_some(Trait::Warm));
        } else {
            traits.extend(energy_of(step.system));
        }
        let mut stages: Vec<Stage> = selected(&traits).collect();
        if !search || step.system.is_linear() {
            stages.truncate(1);
        }
        let homotopy = Homotopy::new(step.contact.stiffness_ratio());
        Self { stages, position: 0, iterations: 0, singular: 0, settled: false, homotopy }
    }

    fn stage(&self) -> Stage {
        self.stages[self.position]
    }

    /// The method of the present iteration.
    pub(super) fn method(&self) -> Method {
        self.stage().method
    }

    /// True if the step of the present iteration is taken as it is: where contact binds stresses, an active set that is
    /// wrong on the way costs less than short steps do.
    pub(super) fn is_undamped(&self) -> bool {
        self.method() == Method::Overstress || self.iterations <= self.stage().undamped
    }

    /// Overstress of the next active set, in parts of the stiffness of the bodies.
    pub(super) fn overstress(&self) -> f64 {
        if self.method() == Method::Overstress { self.homotopy.overstress() } else { 0.0 }
    }

    /// The factor on friction in the present iteration.
    pub(super) fn friction(&self) -> f64 {
        Homotopy::friction(self.method(), self.iterations)
    }

    /// True if the active set is frozen.
    pub(super) fn freezes(&self) -> bool {
        self.method().freezes()
    }

    /// Leaves a stage whose tangent is singular; false if that was so with each of them.
    pub(super) fn leave_singular(&mut self) -> bool {
        self.singular += 1;
        if self.singular >= self.stages.len() {
            return false;
        }
        self.go_on();
        self.iterations = 0;
        true
    }

    fn go_on(&mut self) {
        self.position = (self.position + 1) % self.stages.len();
        self.homotopy.restart();
    }

    /// Iterations in the present stage, this one included.
    pub(super) fn iterations(&self) -> usize {
        self.iterations
    }

    /// True if the present stage goes on with the active set of the one before.
    pub(super) fn continues(&self) -> bool {
        let before = self.position.checked_sub(1).map(|p| self.stages[p].method);
        matches!(self.method(), Method::Compliance | Method::ActiveSet) && before.is_some_and(Method::freezes)
    }

    /// Leaves a stage that goes nowhere at the next iteration.
    pub(super) fn give_up(&mut self) {
        self.iterations = usize::MAX / 2;
    }

    /// Hears how the last step with a frozen active set went: its length, the part of the points that changed branches,
    /// and the residual of the scene as written.
    pub(super) fn hear(&mut self, step: f64, changed: f64, residual: f64) {
        self.settled = step == 1.0 && changed <= FEW;
        if self.method() == Method::Overstress {
            self.homotopy.hear(changed, residual);
        }
        if self.method() == Method::Stiffening && step == 1.0 && changed == 0.0 {
            self.homotopy.stiffen();
        }
    }

    /// Begins with contact that is softer by this factor.
    pub(super) fn soften(&mut self, softness: f64) {
        self.homotopy.soften(softness);
    }

    /// The factor on the arguments of contact, 1 but while its stiffness grows.
    pub(super) fn softness(&self) -> f64 {
        if self.method() == Method::Stiffening { self.homotopy.softness() } else { 1.0 }
    }

    /// Counts an iteration; true if it is the first of another stage.
    pub(super) fn next(&mut self, history: &StepHistory) -> bool {
        self.iterations += 1;
        if self.stages.len() < 2 || !self.is_over(history) {
            return false;
        }
        self.go_on();
        self.iterations = 1;
        true
    }

    fn is_over(&self, history: &StepHistory) -> bool {
        let Stage { budget, stall, .. } = self.stage();
        let spent = self.iterations > budget;
        match stall {
            Stall::Never => spent,
            Stall::Settled => spent || (self.iterations > 1 && self.settled),
            Stall::NoProgress => (spent || self.is_stuck(history)) && !self.progresses(history),
            Stall::Fruitless => spent || self.iterations > PATIENCE + 1 && steps_are_short(history),
            Stall::ShortSteps => spent && steps_are_short(history),
            Stall::Circling => spent && (steps_are_short(history) || self.circles(history)),
        }
    }

    /// The iterations of this stage so far.
    fn own<'h>(&self, history: &'h StepHistory) -> &'h [Iteration] {
        &history.iterations[history.iterations.len().saturating_sub(self.iterations)..]
    }

    /// True if the residual has become smaller in the last iterations than it ever was before.
    fn progresses(&self, history: &StepHistory) -> bool {
        let own = self.own(history);
        let (before, last) = own.split_at(own.len().saturating_sub(PROGRESS));
        !before.is_empty() && smallest(last) < 0.5 * smallest(before)
    }

    /// True if the last iterations, as many as count, found no smaller residual than those before.
    fn circles(&self, history: &StepHistory) -> bool {
        self.own(history).len() > PROGRESS && !self.progresses(history)
    }

    /// True if the last steps were next to nothing, or came back to where one was before and there is a path to go on with.
    fn is_stuck(&self, history: &StepHistory) -> bool {
        let own = self.own(history);
        let Some((last, before)) = own.split_last() else { return false };
        let has_paths = self.stages.iter().any(|s| s.method.is_path());
        let again = |i: &Iteration| {
            i.fingerprint == last.fingerprint && (i.residual - last.residual).abs() < AGAIN * last.residual
        };
        let nothing = own.len() > STUCK && own[own.len() - STUCK..].iter().all(|i| i.step < NOTHING);
        nothing || (has_paths && own.len() > STUCK && before.iter().any(again))
    }
}

/// What a step has of its scene.
fn traits_of(system: &System, contact: &Contact) -> Vec<Trait> {
    let all = [
        (Trait::Contact, true),
        (Trait::Stiff, contact.is_stiff()),
        (Trait::OverConstrained, contact.is_over_constrained()),
        (Trait::Friction, contact.has_friction()),
        (Trait::Affine, system.is_affine_when_frozen()),
    ];
    all.into_iter().filter(|(_, holds)| *holds).map(|(t, _)| t).chain(energy_of(system)).collect()
}

/// Whether steps go to where an energy is the least.
fn energy_of(system: &System) -> Option<Trait> {
    if Downhill::suits(system) {
        return Some(Trait::Energy);
    }
    if Downhill::nearly_suits(system) {
        return Some(Trait::NearEnergy);
    }
    Downhill::rubs(system).then_some(Trait::Rubs)
}

fn selected(traits: &[Trait]) -> impl Iterator<Item = Stage> + '_ {
    let fits = |s: &&Stage| s.with.iter().all(|t| traits.contains(t)) && s.without.iter().all(|t| !traits.contains(t));
    SCHEDULE.iter().filter(fits).copied()
}

/// True if most of the last steps are short and the residual has not halved in them.
fn steps_are_short(history: &StepHistory) -> bool {
    let last = &history.iterations[history.iterations.len().saturating_sub(PATIENCE + 1)..];
    let (first, rest) = last.split_first().expect("iterations have passed");
    let short = rest.iter().filter(|i| i.step < SHORT).count();
    2 * short >= rest.len() && smallest(rest) > 0.5 * first.residual
}

fn smallest(list: &[Iteration]) -> f64 {
    list.iter().fold(f64::INFINITY, |m, i| m.min(i.residual))
}

#[cfg(test)]
mod tests;

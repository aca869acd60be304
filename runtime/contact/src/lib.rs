//! Contact and friction: complementarity laws `t = P(x)` at integration points, their active set, and how far a step may
//! go with it.
//!
//! A term with projections is solved in its frozen form (`compiler/src/frozen.rs`): each projection stays on a branch
//! while the unknowns move, and the branches are chosen anew afterwards. Each projection keeps a value `t` at every
//! integration point, that of its frozen branch at the present unknowns. The next branch is that of `t + c (x - t)`;
//! `c` is the stiffness of the bodies over the slope of `x` in the displacement, so that the choice does not depend on
//! the penalty, Nitsche or augmentation parameter in `x`. This is the primal-dual active set method (Alart and Curnier
//! 1991; Hintermüller, Ito and Kunisch 2002).
//!
//! Promises: the state of contact is [`Contact`]; systems are read, never changed. Does not decide when an iteration
//! stops or another method takes over: `newton` does.
#![forbid(unsafe_code)]

mod active_set;
mod alternation;
mod at_points;
mod background;
mod breakpoints;
mod careful;
mod carried;
mod coercivity;
mod conditions;
mod coupling;
mod creep;
mod flexibility;
mod following;
mod friction_work;
mod images;
mod joints;
mod points;
mod projection_state;
mod regularisation;
mod scaling;
mod sharing;
mod sliding;
mod slipping;
mod slopes;
mod term;

#[cfg(test)]
extern crate self as wfl_contact;
#[cfg(test)]
mod test_block;
#[cfg(test)]
mod tests;

use active_set::Near;
pub use alternation::Alternation;
pub use breakpoints::{Breakpoints, Ray};
pub use coercivity::{Coercivity, coercivity, is_consistent};
pub use conditions::{ContactGaps, Look, Moved, PressedFaces, Ways, contact_gaps, is_between};
pub use coupling::{Friction, couplings, has_multiplier};
pub use creep::Creep;
pub use friction_work::{FrictionMemory, FrictionStep, FrictionWork, NextStates};
pub use images::{Images, images};
pub use points::{ContactPoints, PointState, contact_points};
pub use projection_state::{ConvergedState, ProjectionState};
pub use regularisation::{Complementarity, Regularisation};
use sharing::SharedPoints;
pub use sliding::{SlidPast, slid_past_faces};
use std::sync::Arc;
pub use term::{ContactParts, ContactTerm};

use wfl_compiler::{
    Class, Projection, ProjectionKind,
    types::{FieldKind, FieldOp, InputSlot},
};

use wfl_discrete::assemble::FieldValues;
use wfl_discrete::system::{ActiveSet, System, TermBranches};
use wfl_discrete::window::Window;
use wfl_host::team::{Alone, Team};

/// The first choices from a start without a past are made for whole entities: the first finds where bodies touch, the second
/// and third how far slip has got; from then on points at the rims have to choose for themselves.
const CHOICES_BY_ENTITY: usize = 3;

/// The contact laws of a scene and the state they are in.
#[derive(Clone, Default)]
pub struct Contact {
    terms: Vec<ContactTerm>,
    active: ActiveSet,
    /// By term: what its projections were after the last iteration; empty at the start of a step.
    states: Vec<ProjectionState>,
    /// On the way of the last correction nothing brought the projections nearer to their laws.
    is_held: bool,
    /// The last two converged states, the later one first: the next is extrapolated from them.
    converged: Vec<ConvergedState>,
    /// The active set belongs to a converged state; else it is chosen anew at the start of a step.
    is_warm: bool,
    /// Points may be closed at the start that nothing prescribed brings together.
    closes_far: bool,
    complementarity: Complementarity,
    window: Window,
    /// Where several ranks have the points.
    team: Option<Arc<dyn Team>>,
}

impl Contact {
    /// Laws without a state; `terms` in the order of the frozen terms of their system.
    #[must_use]
    pub fn new(terms: Vec<ContactTerm>) -> Self {
        let mut this = Self { terms, ..Self::default() };
        this.forget();
        this
    }

    /// The terms with projections.
    #[must_use]
    pub fn terms(&self) -> &[ContactTerm] {
        &self.terms
    }

    /// True if a law on faces that presses reads the values of a field: it is a displacement.
    #[must_use]
    pub fn presses(&self, field: usize) -> bool {
        let is_value = |slot: &InputSlot| match slot {
            InputSlot::Field(b) => b.op == FieldOp::Value && b.field.index() == field,
            _ => false,
        };
        let is_half_line = |p: &Projection| p.acts && p.kind == ProjectionKind::HalfLine;
        let laws = self.terms.iter().filter(|t| !t.on_cells() && t.projections.iter().any(is_half_line));
        laws.into_iter().any(|t| t.law.law.inputs.iter().any(is_value))
    }

    /// False for a term on faces that has projections, of which none is one of contact ([`ContactTerm::pushes`]).
    #[must_use]
    pub fn pushes(&self, system: &System, term: usize) -> bool {
        self.terms.iter().filter(|t| t.term == term).all(|t| t.on_cells() || t.pushes(system))
    }

    /// True for a scene without projections.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// The branches that the projections are frozen on.
    #[must_use]
    pub fn active_set(&self) -> &ActiveSet {
        &self.active
    }

    /// Goes back to open contact without a past.
    pub fn forget(&mut self) {
        self.active = self.opened();
        self.states.clear();
    }

    /// Brings the laws to a step.
    pub fn begin_step(&mut self, window: Window) {
        self.window = window;
        self.terms.iter_mut().for_each(|t| t.begin_step(window));
    }

    /// Says whether the active set belongs to a converged state, which the next step starts from.
    pub fn set_warm(&mut self, warm: bool) {
        self.is_warm = warm;
        if !warm {
            self.converged.clear();
        }
    }

    /// Says whether bodies of finite strain may be tied at a start to what they do not touch and nothing prescribed brings
    /// them to: that crumples cells, but a body that contact alone holds needs it. Linear bodies always may.
    pub fn set_closes_far(&mut self, closes: bool) {
        self.closes_far = closes;
    }

    /// True if the active set belongs to a converged state.
    #[must_use]
    pub fn is_warm(&self) -> bool {
        self.is_warm
    }

    /// Keeps what the projections are at a converged state, for the start of the next step.
    pub fn accept(&mut self, system: &System, u: &[f64]) {
        if self.terms.is_empty() {
            return;
        }
        let states = self.read(system, u);
        let on_trend = self.is_on_trend();
        self.converged.truncate(1);
        self.converged.insert(0, ConvergedState { time: self.window.stage, on_trend, states });
    }

    /// True unless the active set of this state is nearer to that of the last state than to the extrapolated one.
    fn is_on_trend(&self) -> bool {
        let [last, before] = self.converged.as_slice() else { return true };
        let Some(ahead) = last.extrapolated(before, self.window.stage) else { return true };
        let wrong = |states: &[ProjectionState]| -> usize {
            let each = self.terms.iter().zip(states).zip(&self.active.terms);
            let next =
                |term: &ContactTerm, state, data: &TermBranches| term.next_branches(&self.complementarity, state, data);
            self.team().count(each.map(|((term, state), data)| term.n_differing(&next(term, state, data), data)).sum())
        };
        wrong(&ahead) <= wrong(&last.states)
    }

    /// Chooses the active set of a step that goes on as the last two did. Where it does not, this costs an iteration.
    fn extrapolate(&mut self) {
        let [last, before] = self.converged.as_slice() else { return };
        let Some(ahead) = last.extrapolated(before, self.window.stage).filter(|_| last.on_trend) else { return };
        self.complementarity.set_choices(0);
        for ((term, ahead), data) in self.terms.iter().zip(&ahead).zip(&mut self.active.terms) {
            *data = term.next_branches(&self.complementarity, ahead, data);
        }
    }

    /// Holds all points closed and sticking, regularised as they are.
    pub fn stick_everywhere(&mut self) {
        self.states.clear();
        for (term, data) in self.terms.iter().zip(&mut self.active.terms) {
            term.stick_all(data);
        }
    }

    /// Makes sure that there is an active set at the start of a step from `u`: that of the last converged state, else
    /// that of the terms as written. `predicted` is a state that the linear response to the step leads to, if one is known:
    /// then the active set is the one which that was made on, or of the terms as written there, and nothing is guessed.
    /// Bodies of finite strain that a guess ties to what they do not touch would crumple.
    pub fn initialise(&mut self, system: &System, u: &[f64], predicted: Option<&[f64]>) {
        self.states.clear();
        if self.is_warm {
            if predicted.is_none() {
                self.extrapolate();
            }
            return;
        }
        self.fit(system, u);
        if let Some(predicted) = predicted.filter(|_| !self.closes_far) {
            self.freeze_as_written(system, predicted);
            return;
        }
        // each side may move by the largest displacement that is known
        let unknown = |f: &usize| system.fields[*f].kind == FieldKind::Unknown;
        let known = (0..system.fields.len()).filter(unknown).filter_map(|f| system.range(f));
        let moved = 2.0 * self.team().largest(known.flatten().fold(0.0f64, |m, d| m.max(u[d].abs())));
        let near = Near { moved, or_all: self.closes_far || !system.has_nonlinear_bodies() };
        self.active = self.chosen(system, u, |term, values, data| term.close_if_open(system, values, data, near));
    }

    /// Fits the scaling of the laws to the stiffness of the bodies at `u`.
    fn fit(&mut self, system: &System, u: &[f64]) {
        let mut diagonal = vec![0.0; system.numbering.n_dofs];
        let values = system.values_with(u, &self.active);
        for term in system.terms.iter().filter(|t| t.law.class > Class::Constant && t.on_cells()) {
            system.add_diagonal(term, values.view(), &mut diagonal);
        }
        self.terms.iter_mut().for_each(|term| term.fit(system, values.view(), &diagonal));
    }

    /// Sets the friction of the laws; the active set stays as it is until it is chosen next.
    pub fn set_friction(&mut self, factor: f64) {
        self.complementarity.regularisation.friction = factor;
    }

    /// True if friction, stiffness and bounds of contact are those of the laws as written.
    #[must_use]
    pub fn is_as_written(&self) -> bool {
        self.terms.is_empty() || self.complementarity.regularisation.is_as_written()
    }

    /// Sets the Duvaut-Lions overstress, in parts of the stiffness of the bodies; branches as they are.
    pub fn set_overstress(&mut self, overstress: f64) {
        if self.complementarity.regularisation.overstress != overstress {
            self.complementarity.regularisation.overstress = overstress;
            self.write_regularisation();
        }
    }

    /// Makes contact compliant or rigid; branches as they are.
    pub fn set_compliant(&mut self, compliant: bool) {
        self.states.clear();
        self.complementarity.regularisation.set_compliant(compliant);
        self.write_regularisation();
    }

    /// Makes contact softer by this factor on its arguments (1: as written); branches as they are.
    pub fn set_softness(&mut self, softness: f64) {
        if self.complementarity.regularisation.softness != softness {
            self.states.clear();
            self.complementarity.regularisation.softness = softness;
            self.write_regularisation();
        }
    }

    fn write_regularisation(&mut self) {
        for (term, data) in self.terms.iter().zip(&mut self.active.terms) {
            term.write_regularisation(&self.complementarity.regularisation, data);
        }
    }

    /// True if some law has a projection on a ball.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.terms.iter().any(ContactTerm::has_friction)
    }

    /// True if friction acts on faces.
    #[must_use]
    pub fn has_sliding(&self) -> bool {
        self.terms.iter().any(ContactTerm::has_sliding)
    }

    /// The part of a full step to `u` after which the projections are nearer to their laws; exact where the bodies are
    /// linear. The next choice of the active set starts from there. The first step is full. Between bodies that are not linear the way is another one than is looked at: where nothing helps on
    /// two corrections running the second one is taken as it is.
    pub fn search(&mut self, system: &System, u: &[f64]) -> f64 {
        if self.states.is_empty() {
            self.take_full_step(system, u);
            return 1.0;
        }
        let to = self.read(system, u);
        let mut from = std::mem::take(&mut self.states);
        let (part, descends) = projection_state::search(self, &mut from, &to);
        if !descends && self.is_held && system.has_nonlinear_bodies() {
            self.states = to;
            self.is_held = false;
            return 1.0;
        }
        self.states = from;
        self.is_held = !descends;
        part
    }

    /// Takes a full step to `u` as it is: the next choice of the active set starts there.
    pub fn take_full_step(&mut self, system: &System, u: &[f64]) {
        self.states = self.read(system, u);
        self.is_held = false;
    }

    /// Freezes the branches of the terms as they are written at `u`.
    pub fn freeze_as_written(&mut self, system: &System, u: &[f64]) {
        self.states.clear();
        self.active = self.chosen(system, u, |_, _, _| {});
    }

    /// The branches of the terms as they are written at `u`, but that balls without a radius, of points that are open, hold
    /// nothing: as written they stick where their argument is zero, too.
    #[must_use]
    pub fn written_at(&self, system: &System, u: &[f64]) -> ActiveSet {
        self.chosen(system, u, |term, values, data| term.let_go(system, values, data))
    }

    /// The active set at `u` with all points closed and sticking: bodies that are tied together.
    #[must_use]
    pub fn tied(&self, system: &System, u: &[f64]) -> ActiveSet {
        self.chosen(system, u, |term, _, data| term.stick_all(data))
    }

    /// The active set with all points open.
    #[must_use]
    pub fn opened(&self) -> ActiveSet {
        ActiveSet { terms: self.terms.iter().map(ContactTerm::open).collect() }
    }

    /// The projections at the two ends of a line.
    pub fn along(&self, system: &System, from: &[f64], to: &[f64]) -> [Vec<ProjectionState>; 2] {
        [self.read(system, from), self.read(system, to)]
    }

    /// How far a ray goes before a breakpoint, at most to `end`, and the breakpoints there.
    #[must_use]
    pub fn next_breakpoints(&self, line: &[Vec<ProjectionState>; 2], sign: f64, end: f64) -> (f64, Breakpoints) {
        let rays = line[0].iter().zip(&line[1]).map(|(from, to)| Ray { from, to, sign });
        let friction = self.complementarity.regularisation.friction;
        breakpoints::next(self.terms.iter().zip(rays).zip(&self.active.terms), friction, end, self.team())
    }

    /// Shares the points out as the nodes of the mesh are, where several ranks have them.
    pub fn share(&mut self, system: &System) {
        let Some(part) = system.mesh.part() else { return };
        self.team = Some(Arc::clone(part.team()));
        for term in &mut self.terms {
            term.shared = Some(SharedPoints::new(&system.mesh, &term.sampled.domain));
        }
    }

    /// The ranks that have the points.
    fn team(&self) -> &dyn Team {
        self.team.as_deref().unwrap_or(&Alone)
    }

    /// How fast the first of some breakpoints is passed along a line, `at` this part of it.
    #[must_use]
    pub fn passage(&self, line: &[Vec<ProjectionState>; 2], at: f64, breakpoints: &Breakpoints) -> f64 {
        let own = breakpoints.here().first().map(|(k, place)| {
            let ray = Ray { from: &line[0][*k], to: &line[1][*k], sign: 1.0 };
            self.terms[*k].passage(ray, at, *place, self.complementarity.regularisation.friction)
        });
        // each rank that has the point finds the same
        let Some(rank) = self.team().first(own.is_some()) else { return 0.0 };
        self.team().numbers_of(rank, &own.map_or_else(Vec::new, |rate| vec![rate]))[0]
    }

    /// Changes the branches at some breakpoints, and turns the directions of slip to the arguments at `u`.
    pub fn cross(&mut self, system: &System, u: &[f64], breakpoints: &Breakpoints) {
        for (k, place) in breakpoints.here() {
            self.terms[*k].cross(*place, &mut self.active.terms[*k]);
        }
        let states = self.read(system, u);
        let friction = self.complementarity.regularisation.friction;
        for ((term, state), data) in self.terms.iter().zip(&states).zip(&mut self.active.terms) {
            term.turn_slip(state, data, friction);
        }
    }

    fn read(&self, system: &System, u: &[f64]) -> Vec<ProjectionState> {
        self.states_on(system, u, &self.active)
    }

    /// What the projections give at `u` on the branches of an active set, by term.
    #[must_use]
    pub fn states_on(&self, system: &System, u: &[f64], active: &ActiveSet) -> Vec<ProjectionState> {
        let values = system.values_with(u, active);
        self.terms.iter().map(|t| t.read(&system.mesh, values.view())).collect()
    }

    /// Chooses the active set that follows from the present one, for the `time`th time in this step.
    ///
    /// From a start without a past, all points of an entity choose the same at first where contact is stiff: else one
    /// that sticks takes the load of those beside it, and slip gets on by a point an iteration.
    pub fn update(&mut self, time: usize) -> Changes {
        self.complementarity.set_choices(time);
        let by_entity = !self.is_warm && time <= CHOICES_BY_ENTITY;
        let mut changes = Changes::default();
        for ((term, state), data) in self.terms.iter().zip(&self.states).zip(&mut self.active.terms) {
            let mean = (by_entity && term.locks_entities()).then(|| term.averaged(state));
            let next = term.next_branches(&self.complementarity, mean.as_ref().unwrap_or(state), data);
            changes.changed += term.n_differing(data, &next);
            changes.points += (0..state.points().count()).filter(|point| term.counts(*point)).count();
            *data = next;
        }
        let mut counts = [changes.changed as u64, changes.points as u64];
        self.team().sum_words(&mut counts);
        let [changed, points] = counts.map(|n| usize::try_from(n).expect("a number of points"));
        Changes { changed, points }
    }

    /// True if contact is stiff against the bodies: then making it compliant for a while helps.
    #[must_use]
    pub fn is_stiff(&self) -> bool {
        self.terms.iter().any(ContactTerm::is_stiff)
    }

    /// True if contact over-constrains the bodies: it binds their stresses to its traction
    /// (theta = -1 far below E/h).
    #[must_use]
    pub fn is_over_constrained(&self) -> bool {
        self.terms.iter().any(ContactTerm::is_over_constrained)
    }

    /// The largest stiffness of the bodies over a slope.
    #[must_use]
    pub fn stiffness_ratio(&self) -> f64 {
        self.terms.iter().fold(0.0, |m, t| m.max(t.stiffness_ratio()))
    }

    /// The branches of the laws as they are written at `u`, changed by `change`.
    fn chosen(
        &self,
        system: &System,
        u: &[f64],
        change: impl Fn(&ContactTerm, FieldValues<'_>, &mut TermBranches),
    ) -> ActiveSet {
        let values = system.values_with(u, &self.active);
        let friction = self.complementarity.regularisation.friction;
        let one = |term: &ContactTerm| {
            let mut data = term.as_written(system, values.view(), friction);
            change(term, values.view(), &mut data);
            data
        };
        ActiveSet { terms: self.terms.iter().map(one).collect() }
    }

    /// The numbers that the next step depends on beside the unknowns.
    #[must_use]
    pub fn memory(&self) -> ContactMemory {
        ContactMemory {
            warm: self.is_warm,
            active: self.active.terms.iter().flat_map(|t| [t.points.clone(), t.regularisation.clone()]).collect(),
            terms: self.terms.iter().map(|t| t.memory(&self.complementarity)).collect(),
            converged: self.converged.iter().flat_map(ConvergedState::numbers).collect(),
        }
    }

    /// Goes back to what was remembered before the first step: nothing of a run is left.
    ///
    /// # Panics
    /// If that belongs to other laws.
    pub fn restart(&mut self, memory: &ContactMemory) {
        self.complementarity = Complementarity::default();
        self.states.clear();
        let known = self.recall(memory);
        assert!(known, "the memory is that of these laws");
    }

    /// Goes back to what was remembered. False, and nothing is changed, if that belongs to other laws.
    #[must_use]
    pub fn recall(&mut self, memory: &ContactMemory) -> bool {
        let converged: Option<Vec<ConvergedState>> = memory
            .converged
            .chunks(1 + 2 * self.terms.len())
            .map(|numbers| ConvergedState::from_numbers(numbers, &self.terms))
            .collect();
        let own = |t: &ContactTerm| t.memory(&self.complementarity).len();
        let fit = |(term, own): (&ContactTerm, &TermBranches), known: &[Vec<f64>]| {
            let [points, regularisation] = [known[0].len(), known[1].len()];
            let has_points = points == own.points.len() || term.is_cut() && term.has_whole_points(points);
            has_points && regularisation == own.regularisation.len()
        };
        let mut all = self.terms.iter().zip(&self.active.terms).zip(memory.active.chunks_exact(2));
        let fits = memory.active.len() == 2 * self.terms.len()
            && all.all(|(own, known)| fit(own, known))
            && memory.terms.len() == self.terms.len()
            && self.terms.iter().zip(&memory.terms).all(|(t, m)| own(t) == m.len());
        let Some(converged) = converged.filter(|_| fits) else { return false };
        self.is_warm = memory.warm;
        self.converged = converged;
        for (own, known) in self.active.terms.iter_mut().zip(memory.active.chunks_exact(2)) {
            (own.points, own.regularisation) = (known[0].clone(), known[1].clone());
        }
        for (term, numbers) in self.terms.iter_mut().zip(&memory.terms) {
            term.recall(numbers, &mut self.complementarity);
        }
        true
    }
}

/// What a choice of the active set has changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Points whose branch is another one now.
    pub changed: usize,
    /// All points.
    pub points: usize,
}

impl Changes {
    /// The part of the points whose branch is another one now.
    #[must_use]
    pub fn share(self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a share of points")]
        return self.changed as f64 / self.points.max(1) as f64;
    }
}

/// What contact remembers from one step to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactMemory {
    /// Whether the active set belongs to a converged state.
    pub warm: bool,
    /// By term: the branches at its points, and its regularisation.
    pub active: Vec<Vec<f64>>,
    /// By term: the numbers by which its branches are chosen.
    pub terms: Vec<Vec<f64>>,
    /// The last two converged states of the projections, one after the other ([`ConvergedState::numbers`]).
    pub converged: Vec<Vec<f64>>,
}

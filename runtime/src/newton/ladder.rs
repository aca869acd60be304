//! Which globalisation a step uses, and when the next one takes over.
//!
//! Each of them is the best somewhere (`docs/newton.md`): held pieces for contact and friction, with a soft layer
//! between the sides for a few iterations where stiff contact makes no progress; where they circle, the path through
//! the pieces from where they stand and from the start of the step, then friction that grows from nothing; backtracking
//! on the residual for everything else, the natural monotonicity test, and friction that shrinks as the last resort.
//! Where the traction of soft contact binds the stresses of the bodies, overstress comes first. A step that makes no
//! progress with one goes on with the next from where it stands; one whose tangent becomes singular on the way (a body
//! that only friction holds, with all of it slipping in an iterate) goes on from its best state.

use crate::{
    assemble::TermError,
    newton::{Iteration, NewtonOptions, StepHistory, overstress::Overstress},
    system::System,
};

/// A way to get from one state to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// Held pieces with a soft layer between the sides: a few steps that find other pieces to go on with.
    Soft,
    /// Held pieces from a tied start, with traction that may exceed its bound ([`super::overstress`]).
    Overstress,
    /// Contact by held pieces ([`super::pieces`]).
    Pieces,
    /// The path through the pieces ([`super::path`]) from the start of the step.
    PathFromStart,
    /// The path through the pieces from where the step stands.
    Path,
    /// Backtracking on the norm of the residual.
    Residual,
    /// Backtracking on the norm of the simplified Newton correction.
    Natural,
    /// Held pieces while friction shrinks from a multiple to what is written: what only friction holds stays held.
    MoreFriction,
    /// Held pieces while friction grows from nothing to what is written.
    LessFriction,
}

impl Method {
    /// True if the path through the pieces is followed.
    pub(super) fn is_path(self) -> bool {
        matches!(self, Self::Path | Self::PathFromStart)
    }

    /// True if pieces are held.
    pub(super) fn holds(self) -> bool {
        matches!(
            self,
            Self::Soft
                | Self::Overstress
                | Self::Pieces
                | Self::PathFromStart
                | Self::Path
                | Self::MoreFriction
                | Self::LessFriction
        )
    }
}

/// Parts in which friction is brought to what is written, and the most iterations for each but the last.
const FRICTION_PARTS: usize = 8;
const FRICTION_PATIENCE: usize = 5;
/// Iterations that may pass with the friction as written at its end.
const AT_FULL_FRICTION: usize = 10;
/// What friction begins with above what is written, in units of it.
const MORE_FRICTION: f64 = 7.0;

/// Iterations that may pass with short steps or without a smaller residual.
const PATIENCE: usize = 6;
/// Iterations with held pieces that may pass: their residual says little before they settle.
const PIECES_PATIENCE: usize = 25;
/// Iterations from a start without a past before contact is made soft, if they bring no progress.
const TRIAL: usize = 10;
/// Whole steps of later steps before contact that binds the stresses of the bodies is searched.
const WHOLE_STEPS: usize = 5;
/// Iterations with overstress that may pass, and kinks that a path may pass before it.
const OVERSTRESS_PATIENCE: usize = 40;
const KINKS_BEFORE_OVERSTRESS: usize = 20;
/// Whole steps from a start without a past where contact is stiff: what the first choices say of the laws is rough.
const WHOLE_STEPS_FROM_REST: usize = 2;
/// So many steps in turn that are shorter than this part come to nothing.
const STUCK: usize = 5;
const NOTHING: f64 = 0.04;
/// A state is met again if its branches are the same and its residual is, but for this part.
const AGAIN: f64 = 1e-6;
/// Kinks that a path may pass.
const PATH_PATIENCE: usize = 150;
/// Kinks that all paths of an attempt may pass beside its iterations: as many paths as a ladder has.
pub(super) const ROOM_OF_PATHS: usize = 3 * PATH_PATIENCE;
/// More may pass while the residual has halved in so many.
const PROGRESS: usize = 10;
/// Iterations with soft contact that may pass, and the part of the points whose change is small enough to go on.
const SOFT_PATIENCE: usize = 8;
const FEW: f64 = 0.1;
/// Iterations under the natural test that may pass: short steps are progress there.
const NATURAL_PATIENCE: usize = 50;
/// A step below this is short.
const SHORT: f64 = 0.2;

/// The methods of a step, in their order.
pub(super) struct Ladder {
    methods: Vec<Method>,
    position: usize,
    /// Iterations with the present method.
    iterations: usize,
    /// Methods whose tangent was singular.
    singular: usize,
    /// The last step with soft contact was whole and changed few pieces.
    settled: bool,
    /// Iterations that may pass before contact is made soft.
    trial: usize,
    /// Whole steps with held pieces before they are searched.
    whole: usize,
    /// By how much traction may exceed its bound.
    overstress: Overstress,
}

impl Ladder {
    /// The methods that suit the scene; pieces are held where they come first.
    pub(super) fn new(system: &mut System, u: &[f64], options: NewtonOptions) -> Result<Self, TermError> {
        let mut methods = vec![Method::Residual, Method::Natural];
        let (mut trial, mut whole) = (PIECES_PATIENCE, 0);
        if options.search && system.has_pieces() {
            let warm = system.is_settled();
            system.start_pieces(u)?;
            trial = if warm { PIECES_PATIENCE } else { TRIAL };
            methods = if system.is_hard() {
                vec![Method::Pieces, Method::Soft, Method::Pieces, Method::Residual, Method::Natural]
            } else {
                vec![Method::Pieces, Method::Natural, Method::Residual]
            };
            let binds = system.binds_stresses();
            let affine = system.is_affine_when_held();
            if !warm && system.is_hard() {
                whole = WHOLE_STEPS_FROM_REST;
            }
            if system.has_friction() {
                // before the searches on the residual, which take long and seldom help where pieces circle: but where
                // contact binds stresses they do
                let searches = methods.iter().position(|m| !m.holds()).filter(|_| !binds);
                methods.insert(searches.unwrap_or(methods.len()), Method::LessFriction);
                methods.push(Method::MoreFriction);
            }
            if affine {
                let last = methods.iter().rposition(|m| *m == Method::Pieces).unwrap_or(0);
                methods.insert(last + 1, Method::Path);
                if warm {
                    methods.insert(last + 2, Method::PathFromStart);
                }
                if let Some(k) = methods.iter().position(|m| *m == Method::LessFriction) {
                    methods.insert(k + 1, Method::Path);
                }
            }
            if binds && warm {
                whole = WHOLE_STEPS;
                let path = affine.then_some(Method::Path);
                methods.splice(1..1, path.into_iter().chain([Method::Overstress, Method::Pieces]));
            } else if binds {
                methods.insert(0, Method::Overstress);
            }
        }
        if !options.search || system.is_linear() {
            methods.truncate(1);
        }
        let overstress = Overstress::new(system.reach());
        Ok(Self { methods, position: 0, iterations: 0, singular: 0, settled: false, trial, whole, overstress })
    }

    /// The method of the present iteration.
    pub(super) fn method(&self) -> Method {
        self.methods[self.position]
    }

    /// True if the step of the present iteration is taken as it is: where contact binds stresses, pieces that are wrong
    /// on the way cost less than short steps do.
    pub(super) fn takes_whole_steps(&self) -> bool {
        self.method() == Method::Overstress || self.position == 0 && self.iterations <= self.whole
    }

    /// Overstress of the next held pieces, in parts of the stiffness of the bodies.
    pub(super) fn overstress(&self) -> f64 {
        if self.method() == Method::Overstress { self.overstress.present() } else { 0.0 }
    }

    /// True if pieces are held.
    pub(super) fn held(&self) -> bool {
        self.method().holds()
    }

    /// The factor on friction in the present iteration.
    pub(super) fn friction(&self) -> f64 {
        let part = (self.iterations.saturating_sub(1) / FRICTION_PATIENCE).min(FRICTION_PARTS);
        #[expect(clippy::cast_precision_loss, reason = "few parts")]
        let done = part as f64 / FRICTION_PARTS as f64;
        match self.method() {
            Method::MoreFriction => 1.0 + MORE_FRICTION * (1.0 - done).powi(2),
            Method::LessFriction => done,
            _ => 1.0,
        }
    }

    /// Leaves a method whose tangent is singular; false if that was so with each of them.
    pub(super) fn leave_singular(&mut self) -> bool {
        self.singular += 1;
        if self.singular >= self.methods.len() {
            return false;
        }
        self.position = (self.position + 1) % self.methods.len();
        self.iterations = 0;
        self.overstress.restart();
        true
    }

    /// Iterations with the present method, this one included.
    pub(super) fn iterations(&self) -> usize {
        self.iterations
    }

    /// True if the present method goes on with the pieces of the one before.
    pub(super) fn continues(&self) -> bool {
        let before = self.position.checked_sub(1).map(|p| self.methods[p]);
        matches!(self.method(), Method::Soft | Method::Pieces) && before.is_some_and(Method::holds)
    }

    /// Leaves a path that goes nowhere.
    pub(super) fn give_up(&mut self) {
        self.iterations = usize::MAX / 2;
    }

    /// Hears how the last step with held pieces went: its length, the part of the points that changed pieces, and the
    /// residual of the scene as written.
    pub(super) fn settles(&mut self, step: f64, changed: f64, residual: f64) {
        self.settled = step == 1.0 && changed <= FEW;
        if self.method() == Method::Overstress {
            self.overstress.hear(changed, residual);
        }
    }

    /// Counts an iteration; true if it is the first of another method.
    pub(super) fn next(&mut self, history: &StepHistory) -> bool {
        self.iterations += 1;
        if self.methods.len() < 2 || !self.exhausted(history) {
            return false;
        }
        self.position = (self.position + 1) % self.methods.len();
        self.iterations = 1;
        self.overstress.restart();
        true
    }

    /// True if the residual has become smaller in the last iterations than it ever was before.
    fn progresses(&self, history: &StepHistory) -> bool {
        let here = &history.iterations[history.iterations.len().saturating_sub(self.iterations)..];
        let (before, last) = here.split_at(here.len().saturating_sub(PROGRESS));
        let smallest = |list: &[Iteration]| list.iter().fold(f64::INFINITY, |m, i| m.min(i.residual));
        !before.is_empty() && smallest(last) < 0.5 * smallest(before)
    }

    /// True if the last steps with held pieces were next to nothing or came back to where one was before, and there is
    /// a path to go on with.
    fn is_stuck(&self, history: &StepHistory) -> bool {
        let here = &history.iterations[history.iterations.len().saturating_sub(self.iterations)..];
        let (Some((last, before)), true) = (here.split_last(), self.methods.iter().any(|m| m.is_path())) else {
            return false;
        };
        let again = |i: &Iteration| {
            i.fingerprint == last.fingerprint && (i.residual - last.residual).abs() < AGAIN * last.residual
        };
        let nothing = here.len() > STUCK && here[here.len() - STUCK..].iter().all(|i| i.step < NOTHING);
        nothing || (here.len() > STUCK && before.iter().any(again))
    }

    fn exhausted(&self, history: &StepHistory) -> bool {
        match self.method() {
            Method::Soft => {
                return self.iterations > SOFT_PATIENCE || (self.iterations > 1 && self.settled);
            }
            Method::Pieces => {
                let softens = self.methods.get(self.position + 1) == Some(&Method::Soft);
                let patience = if softens { self.trial } else { PIECES_PATIENCE };
                return (self.iterations > patience || self.is_stuck(history)) && !self.progresses(history);
            }
            Method::Overstress => return self.iterations > OVERSTRESS_PATIENCE,
            Method::Path if self.methods.get(self.position + 1) == Some(&Method::Overstress) => {
                return self.iterations > KINKS_BEFORE_OVERSTRESS;
            }
            Method::Path | Method::PathFromStart => return self.iterations > PATH_PATIENCE,
            Method::Natural => return self.iterations > NATURAL_PATIENCE,
            Method::MoreFriction | Method::LessFriction => {
                return self.iterations > FRICTION_PARTS * FRICTION_PATIENCE + AT_FULL_FRICTION;
            }
            Method::Residual => {}
        }
        if self.iterations <= PATIENCE {
            return false;
        }
        let last = &history.iterations[history.iterations.len().saturating_sub(PATIENCE + 1)..];
        let (first, rest) = last.split_first().expect("iterations have passed");
        let short = rest.iter().filter(|i| i.step < SHORT).count();
        let smallest = rest.iter().fold(f64::INFINITY, |m, i| m.min(i.residual));
        2 * short >= rest.len() && smallest > 0.5 * first.residual
    }
}

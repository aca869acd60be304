//! Newton's method on the assembled problem: exact tangents, a line search over the kinks, honest stopping.
//!
//! The residual of each field is measured relative to its own scale ([`System::scales`]). An iteration stops at the
//! tolerance, or at the rounding floor (a multiple of the unit roundoff times |K||u|) and says which. A full step
//! that does not reduce the residual is halved: a plain Newton method on contact has stick/slip two-cycles.

mod energy;
mod history;
mod ladder;
mod line;
mod overstress;
mod path;
mod pieces;
mod predict;
mod refine;
mod start;

use std::time::Instant;

pub use history::{Iteration, Seconds, StepHistory, Stop};
pub use pieces::{Coercivity, ContactGaps, FrictionWork, Passed, TermPieces, Watched};
pub(crate) use pieces::{Kinks, Way, next_kinks, search};

use ladder::Ladder;
use line::Line;
use path::Path;
use thiserror::Error;

use crate::{
    assemble::TermError,
    finite::{BadGiven, largest as largest_of},
    memory::TooMuchMemory,
    solve::SolveError,
    strategy::Strategy,
    system::{Singular, System, SystemError},
};

/// When an iteration stops and how it searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonOptions {
    /// Largest relative residual of a converged step.
    pub tolerance: f64,
    /// Most iterations in a step.
    pub max_iterations: usize,
    /// Line search on; off takes every full step.
    pub search: bool,
}

/// The largest relative tolerance that can be asked for: where a tenth of the forces is out of balance nothing is solved.
pub const LARGEST_TOLERANCE: f64 = 0.1;

/// Default relative tolerance.
pub const DEFAULT_TOLERANCE: f64 = 1e-10;

impl Default for NewtonOptions {
    fn default() -> Self {
        Self { tolerance: DEFAULT_TOLERANCE, max_iterations: 150, search: true }
    }
}

/// What a linear solve may leave: part of the residual to come, part of the tolerance, and most of the residual at hand.
const UNSEEN: f64 = 0.1;
const UNSEEN_AT_THE_END: f64 = 1e-3;
const LARGEST_FORCING: f64 = 1e-4;
/// The rounding floor in units of roundoff times |K||u|.
const FLOOR_FACTOR: f64 = 4.0;

/// Why a step cannot go on.
#[derive(Debug, Error)]
pub enum NewtonError {
    /// A term gave a number that is not finite.
    #[error(transparent)]
    Term(#[from] TermError),
    /// A step could not be assembled.
    #[error(transparent)]
    System(SystemError),
    /// A value that the scene gives is not finite.
    #[error(transparent)]
    Given(Box<BadGiven>),
    /// A linear system could not be solved.
    #[error(transparent)]
    Solve(SolveError),
    /// What is needed does not fit into the memory: no other state, step or method can help, so it ends the run.
    #[error(transparent)]
    TooMuchMemory(TooMuchMemory),
    /// A linear system could not be solved, and it is known why.
    #[error("{}: {error}", why.what)]
    Singular {
        /// What is undetermined.
        why: Box<Singular>,
        /// What the solver says.
        error: SolveError,
    },
}

impl NewtonError {
    /// True if another state need not have this problem.
    fn is_of_the_state(&self) -> bool {
        matches!(self, Self::Term(_) | Self::Solve(SolveError::Singular { .. }))
    }

    /// Says of a tangent that is singular why it is; `u` is the state where that was seen. The pieces that
    /// are held afterwards are those of no state.
    pub(crate) fn explained(self, system: &mut System, u: &[f64]) -> Self {
        use SolveError::{ResidualTooLarge, Singular, VanishingPivot};
        match self {
            Self::Solve(error @ (Singular { .. } | VanishingPivot { .. } | ResidualTooLarge { .. })) => {
                match system.why_singular(u) {
                    Some(why) => Self::Singular { why: Box::new(why), error },
                    None => Self::Solve(error),
                }
            }
            other => other,
        }
    }
}

/// A need for memory is one kind of error, whoever had it.
impl From<SolveError> for NewtonError {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::Solve(other),
        }
    }
}

/// A number that is not finite is one kind of error, wherever it was met; so is a need for memory.
impl From<SystemError> for NewtonError {
    fn from(error: SystemError) -> Self {
        match error {
            SystemError::Term(term) => Self::Term(term),
            SystemError::Given(bad) => Self::Given(bad),
            SystemError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::System(other),
        }
    }
}

/// What to tell while a step runs.
pub trait Watch {
    /// After each iteration.
    fn iteration(&mut self, _iteration: &Iteration) {}
}

/// Watches nothing.
pub struct Silent;

impl Watch for Silent {}

/// A residual with its measures.
struct Measured {
    /// Of the scene as written, or with held pieces.
    residual: Vec<f64>,
    /// Largest over the fields of residual over scale, always of the scene as written.
    relative: f64,
    /// What rounding leaves of it.
    floor: f64,
    /// Weighted 2-norm of `residual` over the free dofs, for the search.
    norm: f64,
    /// What rounding leaves of that norm.
    rounding: f64,
}

/// Solves one step from `u`, which holds the prescribed values already; leaves the best state in `u`. `from` is the
/// same state before they were written into it.
///
/// Scenes with contact first run with held pieces (module `pieces`); if that does not settle, plain Newton steps with a
/// line search on the residual follow. A smooth scene on cells that is singular at rest (all zero) is started from a
/// displaced state, which the history tells.
///
/// # Errors
/// [`NewtonError`]; a step that does not converge is no error but is marked in the history.
pub fn solve_step(
    system: &mut System,
    strategy: &mut Strategy,
    (from, u): (&[f64], &mut [f64]),
    options: NewtonOptions,
    watch: &mut dyn Watch,
) -> Result<StepHistory, NewtonError> {
    let degenerate = start::may_be_degenerate(system, u);
    let rest = u.to_vec();
    let predicted = if options.search { predict::predict(system, strategy, from, u)? } else { None };
    let mut result = iterate(system, strategy, (u, predicted), options, watch);
    if degenerate && result.as_ref().is_err_and(NewtonError::is_of_the_state) {
        u.copy_from_slice(&rest);
        if start::displace(system, u) {
            match iterate(system, strategy, (u, None), options, watch) {
                Ok(mut history) => {
                    history.displaced = true;
                    result = Ok(history);
                }
                Err(error @ NewtonError::TooMuchMemory(_)) => result = Err(error),
                Err(_) => {}
            }
        }
    }
    let converged = result.as_ref().is_ok_and(StepHistory::converged);
    system.settle(converged);
    if converged {
        system.pass(u)?;
    }
    result.map_err(|error| error.explained(system, u))
}

fn iterate(
    system: &mut System,
    strategy: &mut Strategy,
    (u, predicted): (&mut [f64], Option<Vec<f64>>),
    options: NewtonOptions,
    watch: &mut dyn Watch,
) -> Result<StepHistory, NewtonError> {
    system.set_pointwise(false);
    system.set_overstress(0.0);
    let mut history = StepHistory::default();
    let mut weights = vec![1.0; system.fields.len()];
    let begin = Instant::now();
    let mut ladder = Ladder::new(system, u, options)?;
    system.set_soft(ladder.method() == ladder::Method::Soft);
    let mut here = measure(system, u, &weights, ladder.held())?;
    history.seconds.assemble += begin.elapsed().as_secs_f64();
    history.push(watch, 0, &here, 1.0, system);
    if let Some(start) = predicted
        && let Ok(found) = measure(system, &start, &weights, ladder.held())
        && found.norm < here.norm
    {
        u.copy_from_slice(&start);
        here = found;
        history.push(watch, 1, &here, 1.0, system);
    }
    let (mut direction, mut before) = (Vec::new(), None);
    let mut best = (here.relative, u.to_vec());
    let mut left = false;
    let mut path = None;
    let start = u.to_vec();
    let (mut iteration, mut room, mut room_of_paths) = (0, options.max_iterations, ladder::ROOM_OF_PATHS);
    while room > 0 {
        iteration += 1;
        // paths have a limit of their own
        let rooms = if path.is_some() && room_of_paths > 0 { &mut room_of_paths } else { &mut room };
        *rooms -= 1;
        if let Some(stop) = confirmed(system, u, &mut here, (ladder.held(), &weights, options))? {
            finish((system, strategy), u, (ladder.held(), &weights, options), (stop, &mut history), watch)?;
            return Ok(history);
        }
        let begin = Instant::now();
        let other = ladder.next(&history) | std::mem::take(&mut left);
        system.set_friction(ladder.friction());
        if other {
            path = take_over(system, &ladder, (u, &start))?;
            here = measure(system, u, &weights, ladder.held())?;
        }
        system.tangent(u, ladder.held())?;
        history.seconds.assemble += begin.elapsed().as_secs_f64();
        weights = system_weights(system);
        here.norm = weighted_norm(system, &here.residual, &weights);
        let forcing = forcing(here.relative, before, options.tolerance);
        before = Some(here.relative);
        let result = match &mut path {
            Some(path) => path.advance((system, strategy), u, (&here, &weights), &mut history).map(Some),
            None => correct(system, strategy, (&here.residual, forcing), &mut direction, &mut history).map(|()| None),
        };
        let followed = match result {
            Ok(followed) => followed,
            // at the start it is the scene that lacks something; on the way one state says little about the scene, and
            // it is an error only if each method meets one
            Err(error) => {
                let singular = matches!(error, NewtonError::Solve(SolveError::Singular { .. }));
                let on_the_way = iteration > 1 && (singular || path.is_some() && error.is_of_the_state());
                if !on_the_way || !ladder.leave_singular() {
                    return Err(error);
                }
                u.copy_from_slice(&best.1);
                left = true;
                continue;
            }
        };
        let begin = Instant::now();
        let alpha = if let Some((part, next)) = followed {
            here = next;
            if path.as_ref().is_some_and(Path::is_lost) {
                ladder.give_up();
            }
            part
        } else {
            let (method, whole) = (ladder.method(), ladder.takes_whole_steps());
            let mut line = Line { direction: &direction, weights: &weights, options, method, whole, before: here.norm };
            let (alpha, next) = line.advance(system, strategy, u, &here)?;
            here = next;
            if ladder.held() && stopped(&here, options).is_none() {
                follow(system, &mut ladder, (u, alpha), &mut here)?;
            }
            alpha
        };
        history.seconds.assemble += begin.elapsed().as_secs_f64();
        history.push(watch, history.iterations.len(), &here, alpha, system);
        if here.relative < best.0 {
            best = (here.relative, u.to_vec());
        }
    }
    let stop = confirmed(system, u, &mut here, (ladder.held(), &weights, options))?;
    history.stop = Some(stop.unwrap_or(Stop::MaxIterations));
    Ok(history)
}

/// Chooses the pieces that follow after a step of this length, and what is left of the residual with them.
fn follow(
    system: &mut System,
    ladder: &mut Ladder,
    (u, step): (&[f64], f64),
    here: &mut Measured,
) -> Result<(), TermError> {
    let changed = system.follow_pieces(ladder.iterations());
    ladder.settles(step, changed, here.relative);
    system.set_overstress(ladder.overstress());
    system.held_residual(u, &mut here.residual)
}

/// Refines a state whose residual is rounding, where that helps.
fn finish(
    (system, strategy): (&mut System, &mut Strategy),
    u: &mut [f64],
    how: (bool, &[f64], NewtonOptions),
    (stop, history): (Stop, &mut StepHistory),
    watch: &mut dyn Watch,
) -> Result<(), NewtonError> {
    history.stop = Some(stop);
    if stop == Stop::Floor && how.2.search && refine::helps(system, u) {
        refine::refine((system, strategy), u, how, history, watch)?;
    }
    Ok(())
}

/// Makes the pieces ready for a method that takes over; `start` is the state that the step began with. A path is begun
/// where one is to be followed.
fn take_over(
    system: &mut System,
    ladder: &Ladder,
    (u, start): (&mut [f64], &[f64]),
) -> Result<Option<Path>, NewtonError> {
    let method = ladder.method();
    if method.is_path() {
        system.set_soft(false);
        system.set_overstress(0.0);
        if method == ladder::Method::PathFromStart {
            u.copy_from_slice(start);
        }
        system.hold_as_written(u)?;
        let mut residual = Vec::new();
        system.residual(u, &mut residual)?;
        return Ok(Some(Path::new(&residual)));
    }
    if ladder.held() && !ladder.continues() {
        system.settle(false);
        system.start_pieces(u)?;
    }
    system.set_overstress(0.0);
    if method == ladder::Method::Overstress {
        system.tie_pieces();
    }
    system.set_soft(method == ladder::Method::Soft);
    Ok(None)
}

/// Part of the residual that a linear solve may leave: it must not show beside the next residual, which the speed of
/// the last iteration foretells (Eisenstat and Walker 1996, choice 2), nor beside the tolerance.
fn forcing(here: f64, before: Option<f64>, tolerance: f64) -> f64 {
    let next = before.map_or(1.0, |before| (here / before) * (here / before));
    (UNSEEN * next).max(UNSEEN_AT_THE_END * tolerance / here).min(LARGEST_FORCING)
}

/// Factors the tangent of `system` and solves for the correction of a residual, of which the given part may be left.
fn correct(
    system: &System,
    strategy: &mut Strategy,
    (residual, unseen): (&[f64], f64),
    direction: &mut Vec<f64>,
    history: &mut StepHistory,
) -> Result<(), NewtonError> {
    let begin = Instant::now();
    strategy.update(system)?;
    history.seconds.factor += begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let mut rhs = Vec::new();
    system.numbering.gather(residual, &mut rhs);
    rhs.iter_mut().for_each(|r| *r = -*r);
    let report = strategy.solve(&rhs, direction, unseen)?;
    history.solves.push(report);
    history.seconds.solve += begin.elapsed().as_secs_f64();
    Ok(())
}

/// Why the iteration stops at `u`, if it does. A floor is that of the tangent at this state: the one before may have been
/// at a state far away, with a floor above every residual.
fn confirmed(
    system: &mut System,
    u: &[f64],
    here: &mut Measured,
    (held, weights, options): (bool, &[f64], NewtonOptions),
) -> Result<Option<Stop>, TermError> {
    let stop = stopped(here, options);
    if stop != Some(Stop::Floor) {
        return Ok(stop);
    }
    system.tangent(u, held)?;
    *here = measure(system, u, weights, held)?;
    Ok(stopped(here, options))
}

fn stopped(here: &Measured, options: NewtonOptions) -> Option<Stop> {
    if here.relative <= options.tolerance {
        return Some(Stop::Tolerance);
    }
    // not finite, the floor says that nothing is known, not that nothing is left to do
    (here.floor.is_finite() && here.relative <= here.floor).then_some(Stop::Floor)
}

fn step_to(system: &System, start: &[f64], direction: &[f64], alpha: f64, u: &mut [f64]) {
    system.numbering.advance(start, direction, alpha, u);
}

fn measure(system: &mut System, u: &[f64], weights: &[f64], held: bool) -> Result<Measured, TermError> {
    let mut residual = Vec::new();
    system.residual(u, &mut residual)?;
    let magnitudes = system.magnitudes(u);
    let scales = system.scales(&magnitudes);
    // against a scale without bound every residual is small
    system.check_finite("sum of the sizes of forces", &magnitudes, u)?;
    let (mut relative, mut floor) = (0.0f64, 0.0f64);
    for field in 0..system.fields.len() {
        let Some(range) = system.range(field) else { continue };
        let roundoff = roundoff(&u[range.clone()]);
        let free = |d: &usize| system.numbering.free[*d] != crate::system::FIXED;
        let cancelled = largest_of(range.clone().map(|d| magnitudes[d]));
        let largest = largest_of(range.filter(free).map(|d| residual[d]));
        if largest > 0.0 {
            relative = relative.max(largest / scales[field]);
            floor = floor.max(FLOOR_FACTOR * roundoff * cancelled / scales[field]);
        }
    }
    let rounding = FLOOR_FACTOR * f64::EPSILON * weighted_norm(system, &magnitudes, weights);
    if held {
        system.held_residual(u, &mut residual)?;
    }
    let norm = weighted_norm(system, &residual, weights);
    Ok(Measured { residual, relative, floor, norm, rounding })
}

/// Unit of rounding of some unknowns, relative to the largest: numbers below 1e-308 have fewer digits.
fn roundoff(values: &[f64]) -> f64 {
    let largest = largest_of(values.iter().copied());
    if largest > 0.0 { f64::EPSILON.max(f64::from_bits(1) / largest) } else { f64::EPSILON }
}

/// The 2-norm over the free dofs, each times the weight of its field. Where squares leave the range of numbers the entries
/// are divided by a power of two near the largest before.
fn weighted_norm(system: &System, residual: &[f64], weights: &[f64]) -> f64 {
    let entries = || {
        let fields = weights.iter().enumerate().filter_map(|(k, w)| Some((system.range(k)?, *w)));
        let all = fields.flat_map(|(range, weight)| range.map(move |d| (d, weight)));
        all.filter(|(d, _)| system.numbering.free[*d] != crate::system::FIXED).map(|(d, w)| w * residual[d])
    };
    let norm = |unit: f64| entries().fold(0.0, |total, x| total + (x / unit).powi(2)).sqrt();
    let plain = norm(1.0);
    if plain.is_finite() && plain >= f64::MIN_POSITIVE.sqrt() {
        return plain;
    }
    let largest = largest_of(entries());
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    let unit = largest.log2().floor().clamp(-1000.0, 1000.0).exp2();
    unit * norm(unit)
}

/// Factors that bring the equations of multipliers to the units of forces: the ratio of the largest entries of the
/// displacement rows to those of the multiplier rows in the columns of the other unknowns.
fn system_weights(system: &System) -> Vec<f64> {
    use wfl_compiler::types::FieldKind;
    let field_of = |free: usize| {
        let dof = system.numbering.free_dofs[free] as usize;
        (0..system.fields.len()).find(|f| system.range(*f).is_some_and(|r| r.contains(&dof)))
    };
    let mut weights = vec![1.0; system.fields.len()];
    if system.fields.iter().all(|f| f.kind != FieldKind::Multiplier) {
        return weights;
    }
    let kind = |f: usize| system.fields[f].kind;
    let mut stiffness = 0.0f64;
    let mut coupling = vec![0.0f64; system.fields.len()];
    let fields: Vec<Option<usize>> = (0..system.numbering.n_free()).map(field_of).collect();
    for (row, field) in fields.iter().enumerate() {
        let Some(f) = *field else { continue };
        let (columns, values) = system.changing().row(row);
        for (column, value) in columns.iter().zip(values) {
            if fields[*column as usize].is_some_and(|c| kind(c) != FieldKind::Multiplier) {
                if kind(f) == FieldKind::Multiplier {
                    coupling[f] = coupling[f].max(value.abs());
                } else {
                    stiffness = stiffness.max(value.abs());
                }
            }
        }
    }
    for (f, weight) in weights.iter_mut().enumerate() {
        if kind(f) == FieldKind::Multiplier && coupling[f] > 0.0 && stiffness > 0.0 {
            *weight = stiffness / coupling[f];
        }
    }
    weights
}

//! One load step: the problem, the solver, and what its iterations share; the measures of a state.

mod scales;

use std::time::Instant;

use super::{Evaluated, LARGEST_TOLERANCE, Method, NewtonError, NewtonOptions, StepHistory, Stop, Watch};
use crate::Iteration;
use crate::began::Began;
use wfl_compiler::types::FieldKind;
use wfl_contact::Contact;
use wfl_discrete::assemble::VolumeLimit;
use wfl_discrete::finite::largest as largest_of;
use wfl_discrete::system::{Branches, FIXED, Form, LinearTerms, Residual, System, Tangent};
use wfl_linear::LinearSolver;
use wfl_sparse::solve::{SolveError, SolveReport};

/// The rounding floor in units of roundoff times |K||u|: each entry of a residual is rounded about so often, and errors of
/// different signs cancel in part.
pub(super) const FLOOR_FACTOR: f64 = 4.0;

/// What a linear solve may leave, relative to the residual at hand: no more than a full step has to gain at least.
pub(super) const LARGEST_FORCING: f64 = 1e-4;

/// Part of the forces that rounding may hide without a doubt: three digits are what a result is told without. What hides more is often
/// the slope of a law where the iteration stands, and none where it is going.
pub(super) const HIDDEN: f64 = 1e-3;

/// A line search sees an equation relative to at least this part of the largest of its field: the square root of roundoff,
/// so that rounding of the larger ones weighs as much as a residual of that size does.
const LEAST_IN_SEARCH: f64 = 1.5e-8;

/// What a volume of a body of finite strain may change by in one iteration: to a fifth, or to five times, of what it is. A
/// load step that crushes or blows up a cell by more takes another iteration; a correction that does so on the way leads
/// into another basin, with cells crumpled, more often than not.
const KEPT_OF_VOLUMES: f64 = 0.2;

/// Factor of what an iteration keeps of the scales of equations in the search that were larger before: a scale that jumps up
/// and down would let a search compare what is measured in two ways.
const FORGETS: f64 = 0.5;

/// What one load step is solved with.
pub struct LoadStep<'a> {
    /// The equations.
    pub system: &'a System,
    /// The laws of contact and the state they are in.
    pub contact: &'a mut Contact,
    /// The linear solver.
    pub solver: &'a mut LinearSolver,
    /// The tangent that was assembled last.
    pub tangent: &'a mut Tangent,
    /// By dof: a constant residual on top of that of the scene, of which only the rest is to be balanced; or empty.
    pub offset: &'a [f64],
    /// How linear terms are evaluated; refinement sets it to points.
    pub linear: LinearTerms,
    /// When an iteration stops.
    pub options: NewtonOptions,
    /// A state that was predicted is solved for at least once, however small its residual: where the next step is expected from this
    /// one, what a tolerance leaves would be taken for motion.
    pub solves_once: bool,
    /// What is told of each iteration.
    pub watch: &'a mut dyn Watch,
    /// What was spent on the step so far, attempts that failed included.
    pub spent: Spent,
    /// What rounding has taken from the state that was reached last; `None` where nobody asks.
    pub rounding: Option<Rounding>,
    /// The residual at the state that was reached, as the scene is written and with the offset; `None` where it is not at
    /// hand.
    pub reached: Option<Residual>,
}

/// What rounding takes from a state when a correction is added.
#[derive(Clone, Debug, Default)]
pub struct Rounding {
    /// The state that was reached last.
    state: Vec<f64>,
    /// By dof: the sum of the state before and the correction, less the state.
    lost: Vec<f64>,
}

impl Rounding {
    /// What was taken from a state: nothing is known of one that was not reached by a correction.
    #[must_use]
    pub fn of(self, state: &[f64]) -> Vec<f64> {
        if self.state == state { self.lost } else { vec![0.0; state.len()] }
    }

    /// The state at the end of a correction (Knuth's sum of two numbers, The Art of Computer Programming 2, 4.2.2).
    fn note(&mut self, start: &[f64], change: &[f64], state: &[f64]) {
        let lost = |start: &f64, change: &f64, sum: &f64| {
            let added = sum - start;
            (start - (sum - added)) + (change - added)
        };
        self.lost.clear();
        self.lost.extend(start.iter().zip(change).zip(state).map(|((a, b), s)| lost(a, b, s)));
        state.clone_into(&mut self.state);
    }
}

/// What a step costs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Newton iterations: those that are listed, the start aside.
    pub iterations: usize,
    /// Linear systems that were solved: corrections, predictors, merits and paths.
    pub linear_solves: usize,
    /// Seconds of factorisations.
    pub factor: f64,
    /// Seconds of solutions with a factor.
    pub solve: f64,
}

/// A residual with its measures.
pub(super) struct Measured {
    /// Of the scene as written, or with the frozen active set.
    pub(super) residual: Vec<f64>,
    /// That of the scene as written, with its sizes.
    pub(super) written: Residual,
    /// By dof what single equations are relative to; empty without fields that have some.
    pub(super) summands: Vec<f64>,
    /// Largest over the fields of residual over scale, always of the scene as written.
    pub(super) relative: f64,
    /// What rounding leaves of it.
    pub(super) floor: f64,
    /// By body the largest of the forces that are out of balance.
    pub(super) left: Vec<f64>,
    /// The largest of what is left over what may be left.
    pub(super) excess: f64,
    /// The residual of every kind of field is as small as rounding or the tolerance allows in fields of that kind.
    pub(super) settled: bool,
    /// A single equation has more left than rounding and the tolerance of what it began with.
    pub(super) is_open: bool,
    /// Nothing has more left than rounding and the tolerance of what cancels in it.
    pub(super) is_small: bool,
    /// What is left is below bounds of what rounds in positions and inside laws: it is rounding once it no longer falls.
    pub(super) bounded: bool,
    /// Fields have no force but rounding.
    pub(super) no_force: bool,
    /// Weighted 2-norm of `residual` over the free dofs, for the search.
    pub(super) norm: f64,
    /// What rounding leaves of that norm.
    pub(super) rounding: f64,
}

impl Measured {
    /// Why an iteration stops here, if it does.
    pub(super) fn stop(&self, options: NewtonOptions) -> Option<Stop> {
        if self.relative <= options.tolerance && !self.no_force && self.settled {
            return Some(Stop::Tolerance);
        }
        (self.settled || self.no_force && self.relative <= options.tolerance).then_some(Stop::Floor)
    }

    /// Whether forces are within the tolerance of the largest of them, whatever is left of what the step began with.
    pub(super) fn is_within(&self, options: NewtonOptions) -> bool {
        self.relative <= options.tolerance && self.is_small && !self.is_open && !self.no_force
    }
}

/// How far a state is measured: the weights of the fields in the norm, and whether branches are frozen.
#[derive(Clone)]
pub(super) struct Norm {
    /// By field: what brings its equations to the units of forces.
    pub(super) weights: Vec<f64>,
    /// By dof in fields with single equations: one over what cancels in the equation. Empty without such fields.
    pub(super) equations: Vec<f64>,
    /// What was left when the step began.
    pub(super) began: Began,
    /// What the factors of `equations` are made of: the scales of these equations, now and in the iterations before.
    pub(super) scales: Vec<f64>,
    /// The residual is that with the frozen active set.
    pub(super) frozen: bool,
}

impl Norm {
    /// With these weights, before anything is known of single equations.
    pub(super) fn new(weights: Vec<f64>, frozen: bool) -> Self {
        Self { weights, equations: Vec::new(), began: Began::default(), scales: Vec::new(), frozen }
    }
}

impl LoadStep<'_> {
    /// The equations as they are written.
    pub(super) fn form(&self) -> Form<'_> {
        Form { branches: Branches::AsWritten, linear: self.linear, offset: self.offset }
    }

    /// Assembles the tangent at `u`.
    pub(super) fn assemble_tangent(&mut self, u: &[f64], frozen: bool) -> Evaluated<()> {
        let branches = if frozen { Branches::Frozen(self.contact.active_set()) } else { Branches::AsWritten };
        self.system.tangent(u, branches, self.tangent)
    }

    /// The same where the tangent is going to be solved with: that of the state before is needed no more.
    pub(super) fn renew_tangent(&mut self, u: &[f64], frozen: bool) -> Evaluated<()> {
        self.solver.forget_applied();
        self.assemble_tangent(u, frozen)
    }

    /// The residual at `u` and its measures.
    pub(super) fn measure(&self, u: &[f64], norm: &Norm) -> Evaluated<Measured> {
        let system = self.system;
        let written = system.residual(u, &self.form())?;
        let mut sizes = system.sizes(u, &written, self.tangent);
        let positions = system.sizes_of_positions(self.tangent);
        let mut scales = self.scales(u, &written, [&sizes, &positions], &norm.began)?;
        let summands = system.summands(u, &written);
        // against a scale without bound every residual is small
        system.check_finite("sum of the sizes of forces", &sizes, u)?;
        system.check_finite("sum of the sizes of summands", &summands, u)?;
        sizes.iter_mut().zip(&summands).for_each(|(size, summand)| *size += summand);
        let is_multiplier = |body: usize| self.is_multiplier(body);
        let mut all = self.first_measures(u, &written, [&sizes, &summands], &mut scales);
        let settled = all.are_settled(is_multiplier, self.options.tolerance);
        let rounding = FLOOR_FACTOR * f64::EPSILON * self.weighted_norm(&sizes, norm);
        let mut bounded = settled;
        if !settled {
            let cancels = all.relative() < LARGEST_TOLERANCE && self.may_cancel(&written);
            sizes.iter_mut().zip(&positions).for_each(|(size, position)| *size += position);
            if cancels {
                sizes.iter_mut().zip(system.cancelled(u, &written)).for_each(|(size, inside)| *size = size.max(inside));
            }
            if cancels || !positions.is_empty() {
                all = self.body_measures(u, &written, [&sizes, &summands], &scales);
                bounded = all.are_settled(is_multiplier, self.options.tolerance);
            }
        }
        let (relative, floor, left) = (all.relative(), all.floor(), all.left());
        let excess = all.excess().max(relative / self.options.tolerance);
        let (no_force, is_open) = (scales.no_force, all.has_open_equation());
        let is_small = all.are_settled_beside_summands(is_multiplier, self.options.tolerance);
        let residual = if norm.frozen {
            system.frozen_residual(&written, u, self.contact.active_set())?
        } else {
            written.values.clone()
        };
        let norm = self.weighted_norm(&residual, norm);
        Ok(Measured {
            residual,
            written,
            summands,
            relative,
            floor,
            left,
            excess,
            settled,
            is_open,
            is_small,
            bounded,
            no_force,
            norm,
            rounding,
        })
    }

    /// The 2-norm over the free dofs, each times the weight of its field or of its equation. Where squares leave the range of
    /// numbers the entries are divided by a power of two near the largest before.
    pub(super) fn weighted_norm(&self, residual: &[f64], norm: &Norm) -> f64 {
        let of_equations = |field: usize| !norm.equations.is_empty() && self.system.has_single_equations(field);
        let entries = || {
            let fields = norm.weights.iter().enumerate().filter_map(|(k, w)| Some((k, self.system.range(k)?, *w)));
            let all = fields.flat_map(|(field, range, weight)| {
                let own = of_equations(field);
                range.map(move |d| (d, if own { norm.equations[d] } else { weight }))
            });
            all.filter(|(d, _)| self.system.numbering.free[*d] != FIXED).map(|(d, w)| w * residual[d])
        };
        // of each rank its rows: the others are zero
        let team = self.system.team();
        let norm = |unit: f64| team.total(entries().fold(0.0, |total, x| total + (x / unit).powi(2))).sqrt();
        let plain = norm(1.0);
        if plain.is_finite() && plain >= f64::MIN_POSITIVE.sqrt() {
            return plain;
        }
        let largest = team.largest(largest_of(entries()));
        if largest == 0.0 || !largest.is_finite() {
            return largest;
        }
        let unit = largest.log2().floor().clamp(-1000.0, 1000.0).exp2();
        unit * norm(unit)
    }

    /// Sets by dof in fields with single equations what makes their residuals relative, times the size of the forces in the
    /// other fields: then no equation hides another, whatever its units. Small equations of a field count less: where a
    /// part of a field is zero its residuals are rounding. A scale that falls is forgotten over some iterations: were each
    /// state measured by its own numbers alone, states could follow each other in a circle, each better than the last.
    pub(super) fn equation_weights(&self, here: &Measured, norm: &mut Norm) {
        let system = self.system;
        // a rank may have no dofs of its own
        if system.team().all(here.summands.is_empty()) {
            return;
        }
        norm.scales.resize(here.summands.len(), 0.0);
        norm.scales.iter_mut().zip(&here.summands).for_each(|(scale, now)| *scale = now.max(FORGETS * *scale));
        let mut out = norm.scales.clone();
        let single = |k: &usize| system.has_single_equations(*k);
        let others = system.unknown_bodies().filter(|body| !single(&system.field_of_body(*body)));
        let force = largest_of(others.map(|body| here.written.forces[body]));
        let unit = if force > 0.0 { force } else { 1.0 };
        let mut most = system.largest_by_field(&out);
        system.team().max(&mut most);
        for (k, range) in (0..system.fields.len()).filter(single).filter_map(|k| Some((k, system.range(k)?))) {
            let least = LEAST_IN_SEARCH * most[k];
            for size in &mut out[range] {
                let scale = size.max(least);
                *size = if scale > 0.0 { unit / scale } else { 0.0 };
            }
        }
        norm.equations = out;
    }

    /// Factors that bring the equations of multipliers to the units of forces: the ratio of the largest entries of the
    /// displacement rows to those of the multiplier rows in the columns of the other unknowns.
    pub(super) fn weights(&self) -> Vec<f64> {
        let system = self.system;
        let mut weights = vec![1.0; system.fields.len()];
        if system.fields.iter().all(|f| f.kind != FieldKind::Multiplier) {
            return weights;
        }
        let field_of = |free: usize| {
            let dof = system.numbering.free_dofs[free] as usize;
            (0..system.fields.len()).find(|f| system.range(*f).is_some_and(|r| r.contains(&dof)))
        };
        let kind = |f: usize| system.fields[f].kind;
        let mut stiffness = 0.0f64;
        let mut coupling = vec![0.0f64; system.fields.len()];
        let fields: Vec<Option<usize>> = (0..system.numbering.n_free()).map(field_of).collect();
        for (row, field) in fields.iter().enumerate() {
            let Some(f) = *field else { continue };
            let (columns, values) = self.tangent.changing.row(row);
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
        // each rank has seen its rows
        let mut largest = [stiffness];
        system.team().max(&mut largest);
        system.team().max(&mut coupling);
        let [stiffness] = largest;
        for (f, weight) in weights.iter_mut().enumerate() {
            if kind(f) == FieldKind::Multiplier && coupling[f] > 0.0 && stiffness > 0.0 {
                *weight = stiffness / coupling[f];
            }
        }
        weights
    }

    /// Factors the tangent and solves for the correction of a residual by dof, of which the part `unseen` may be left.
    pub(super) fn correct(
        &mut self,
        residual: &[f64],
        unseen: f64,
        direction: &mut Vec<f64>,
        history: &mut StepHistory,
    ) -> Result<(), NewtonError> {
        self.factor()?;
        let rhs = self.opposite(residual);
        let report = match self.solve(&rhs, direction, unseen) {
            Err(NewtonError::Solve(error)) if self.is_unresolved(&error) && self.system.soften(self.tangent) => {
                self.solver.update(self.system, self.tangent, true)?;
                self.solve(&rhs, direction, unseen)?
            }
            other => other?,
        };
        history.solves.push(report);
        Ok(())
    }

    /// The factor on the arguments of contact with which it is no stiffer than the bodies are; the tangent is that of linear bodies
    /// with all contact closed.
    pub(super) fn softness_of_bodies(&self) -> f64 {
        let (contact, bodies) = (&self.tangent.changing, self.system.bulk());
        let diagonals = (0..contact.n_rows()).map(|k| (contact.get(k, k), bodies.get(k, k)));
        let touched = diagonals.filter(|(contact, _)| *contact > 0.0);
        let (contact, bodies) = touched.fold((0.0, 0.0), |sums, of| (sums.0 + of.0, sums.1 + of.1));
        let (contact, bodies) = (self.system.team().total(contact), self.system.team().total(bodies));
        if bodies > 0.0 { (bodies / contact).min(1.0) } else { 1.0 }
    }

    /// Whether the tangent may be one beside which the bodies are rounding: then a flatter one shows the way.
    fn is_unresolved(&self, error: &SolveError) -> bool {
        use SolveError::{ResidualTooLarge, Singular, VanishingPivot};
        self.contact.is_empty() && matches!(error, Singular { .. } | VanishingPivot { .. } | ResidualTooLarge { .. })
    }

    /// Whether some equations have scales of their own: what an inexact solution leaves is small beside the largest
    /// equations alone, so each linear system is then solved with a factor of its own, to all digits.
    pub(super) fn has_single_equations(&self) -> bool {
        (0..self.system.fields.len()).any(|field| self.system.has_single_equations(field))
    }

    /// Hands the tangent to the linear solver.
    pub(super) fn factor(&mut self) -> Result<(), NewtonError> {
        let begin = Instant::now();
        if self.has_single_equations() {
            self.solver.expire();
        }
        let mut result = self.solver.update(self.system, self.tangent, self.contact.is_as_written());
        if let Err(error) = &result
            && self.is_unresolved(error)
            && self.system.soften(self.tangent)
        {
            let softened = self.solver.update(self.system, self.tangent, true);
            result = if softened.is_ok() { softened } else { result };
        }
        self.spent.factor += begin.elapsed().as_secs_f64();
        Ok(result?)
    }

    /// What balances a residual by dof, over the free dofs.
    pub(super) fn opposite(&self, residual: &[f64]) -> Vec<f64> {
        let mut out = Vec::new();
        self.system.numbering.gather(residual, &mut out);
        out.iter_mut().for_each(|r| *r = -*r);
        out
    }

    /// Solves with the factor at hand, over the free dofs.
    pub(super) fn solve(&mut self, rhs: &[f64], x: &mut Vec<f64>, unseen: f64) -> Result<SolveReport, NewtonError> {
        let begin = Instant::now();
        let unseen = if self.has_single_equations() { 0.0 } else { unseen };
        let forcing = self.solver.forcing(self.system, unseen);
        let result = self.solver.solve(rhs, x, forcing);
        self.spent.solve += begin.elapsed().as_secs_f64();
        self.spent.linear_solves += 1;
        Ok(result?)
    }

    /// Solves for what is left of a correction, a residual by dof with the tangent at hand, until `unseen` of it is left.
    pub(super) fn solve_part(
        &mut self,
        residual: &[f64],
        unseen: f64,
        x: &mut Vec<f64>,
    ) -> Result<SolveReport, NewtonError> {
        let rhs = self.opposite(residual);
        let begin = Instant::now();
        let result = self.solver.solve(&rhs, x, unseen);
        self.spent.solve += begin.elapsed().as_secs_f64();
        Ok(result?)
    }

    /// `u = start + alpha * direction`, the direction by free number.
    pub(super) fn go(&mut self, start: &[f64], direction: &[f64], alpha: f64, u: &mut [f64]) {
        let numbering = &self.system.numbering;
        numbering.advance(start, direction, alpha, u);
        if let Some(rounding) = &mut self.rounding {
            let mut change = vec![0.0; u.len()];
            numbering.advance(&change.clone(), direction, alpha, &mut change);
            rounding.note(start, &change, u);
        }
    }

    /// How far the way between two states may be followed, up to `most` times its length, with the volumes of bodies of
    /// finite strain within what one iteration may change them by.
    pub(super) fn longest_way(&self, from: &[f64], to: &[f64], most: f64) -> f64 {
        let limit = VolumeLimit { kept: KEPT_OF_VOLUMES, most };
        let part = if self.system.has_nonlinear_bodies() { self.system.way_of_volumes(from, to, limit) } else { most };
        self.system.way_of_images(from, to, part)
    }

    /// The same along a direction by free number.
    pub(super) fn longest_step(&self, start: &[f64], direction: &[f64], most: f64) -> f64 {
        let is_limited = self.system.has_nonlinear_bodies() || self.system.has_moving_images();
        if !(self.options.search && is_limited) {
            return most;
        }
        let mut to = start.to_vec();
        self.system.numbering.advance(start, direction, 1.0, &mut to);
        self.longest_way(start, &to, most)
    }

    /// Lists an iteration and tells it.
    pub(super) fn record(&mut self, history: &mut StepHistory, here: &Measured, done: Done) {
        let (contact, fingerprint) = branches(self.system, self.contact, &here.written);
        let number = history.iterations.last().map_or(0, |last| last.number) + done.corrections;
        let iteration = Iteration {
            number,
            residual: here.relative,
            floor: here.floor,
            step: done.step,
            method: done.method,
            merit: here.norm,
            changed: done.changed,
            contact,
            fingerprint,
        };
        self.spent.iterations += done.corrections;
        self.watch.iteration(&iteration);
        history.iterations.push(iteration);
    }
}

/// What an iteration did.
#[derive(Clone, Copy)]
pub(super) struct Done {
    pub(super) method: Method,
    /// Part of the correction that was taken.
    pub(super) step: f64,
    /// Points whose branch in the active set is another one now.
    pub(super) changed: usize,
    /// Corrections that it took: none to a start, one to an iteration; a predictor may take more.
    pub(super) corrections: usize,
}

/// Contact counts of the terms with kinks that push (the first of each region) and the fingerprint of all branches.
fn branches(system: &System, contact: &Contact, here: &Residual) -> (Option<[usize; 3]>, u64) {
    let mut fingerprint = 0;
    // of the terms of a region one: that with friction, which is in contact where the others are
    let mut found: Vec<(*const wfl_discrete::assemble::Domain, bool, [usize; 3])> = Vec::new();
    for (k, (term, branches)) in system.terms.iter().zip(&here.branches).enumerate() {
        fingerprint ^= branches.fingerprint.rotate_left(u32::try_from(found.len() % 64).expect("below 64"));
        let domain = std::sync::Arc::as_ptr(&term.integrator.domain);
        if let Some(counts) = term.contact_counts(branches)
            && contact.pushes(system, k)
        {
            match found.iter_mut().find(|(seen, ..)| *seen == domain) {
                None => found.push((domain, term.has_friction(), counts)),
                Some(known) if term.has_friction() && !known.1 => *known = (domain, true, counts),
                Some(_) => {}
            }
        }
    }
    let total = found.iter().map(|(.., counts)| *counts).reduce(|[a, b, c], [x, y, z]| [a + x, b + y, c + z]);
    (total, fingerprint)
}

#[cfg(test)]
mod tests;

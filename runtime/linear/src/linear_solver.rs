//! Which linear solver a scene gets, from the structure of its terms.
//!
//! - only linear terms: one matrix, factored when it changes (once, unless the step variable enters), or where that is
//!   cheaper solved by conjugate gradients with multigrid (`iterative`);
//! - a symmetric linear bulk and nonlinear terms on few dofs (contact): the bulk is factored once, the nonlinear part
//!   is condensed onto the dofs it touches;
//! - such a system that is too large for a factor of its bulk: GMRES with multigrid and a filter on the contact (`filtered`);
//! - anything else: the whole tangent, by conjugate gradients with multigrid where it is symmetric and that is cheaper
//!   (`tangents`), or factored anew where Krylov iterations with the factor of an earlier one would cost more.
//!
//! Symmetric matrices are tried as positive definite (LLT) where their diagonal is positive; where that fails they are
//! factored with pivots of both signs (LDLT), which takes half of the multiplications and of the memory of LU. So are those
//! that are symmetric once the equations of each field are multiplied by a number, as those of Biot are; LU is for the rest.

mod contact;
mod definite;
mod factors;
mod foreseen;
mod tangents;

use std::sync::Arc;

use contact::Factors;

use super::condensation::condenses;
use super::filtered;
use super::iterative::{self, Iterative};
use super::library;
use super::plan::{Extent, FactorKind, GMRES, ITERATION, LinearPlan};
use super::saddle;
use super::without_matrix;
use foreseen::groups;
use wfl_compiler::types::FieldKind;

use wfl_discrete::pruning::Pruning;
use wfl_discrete::system::{FIXED, System, Tangent};
use wfl_sparse::csr::{Csr, Pattern};
use wfl_sparse::solve::{
    CheckedAtPoints, DENSE_LIMIT, Elimination as Method, Equations, Kept, LinearMethod, LinearSolver as Factor, Linked,
    Precision, SolveError, SolveReport, SolverMemory, SolverOptions, Source,
};

enum Kind {
    /// Matrix of the linear terms only.
    Linear,
    /// Bulk once, changing part condensed.
    Condensed(Box<CheckedAtPoints>),
    /// A library, which is told of the part that changes.
    Linked,
    /// Sum of both; `None` where tangents are applied.
    Full(Option<Sum>),
}

/// Where the bulk and the changing part stand in their sum.
struct Sum {
    pattern: Arc<Pattern>,
    changing: Arc<Pattern>,
    bulk_positions: Vec<usize>,
    /// `None` where the changing part has all entries of the sum, as it has without linear terms: places take as much as values do.
    changing_positions: Option<Vec<usize>>,
}

/// What a solution of a library may leave of its right-hand side where a full step solves all equations but for branches
/// that change: Newton shall end there, as with a factor, and not need another step for what the solution has left.
const LEFT_OF_FULL_STEP: f64 = 1e-10;

/// The linear solver of a scene.
pub struct LinearSolver {
    kind: Kind,
    solver: Option<Box<dyn Factor + Send>>,
    /// In place of a factor.
    iterative: Option<Iterative>,
    /// What it solves with, kept for the factor that takes its place where it fails.
    source: Option<Source>,
    /// Attempts at steps in which a factor has taken the place of the iteration on tangents.
    given_way: usize,
    /// What solves in place of factors of our own: a linked library, or our iteration for contact.
    library: Option<Linked>,
    /// What it is told.
    equations: Option<Arc<Equations>>,
    /// What our factors are made of where our iteration does not get to its end.
    spare: Option<Box<Factors>>,
    /// Matrices count as symmetric and positive definite.
    symmetric: bool,
    /// The equations are symmetric, whatever has become of the factors.
    may_be_symmetric: bool,
    /// By free dof its field, where the equations of each may have a factor that makes matrices symmetric.
    groups: Option<Vec<u32>>,
    options: SolverOptions,
    coordinates: Vec<[f64; 3]>,
    factorisations: usize,
    notes: Vec<String>,
    /// Whether the determinant of the tied bodies is negative; that of the first tangent where that is tied.
    tied_is_negative: Option<bool>,
    starts_tied: bool,
    /// A tangent of the scene as written had a determinant of the other sign.
    has_met_other_sign: bool,
}

impl LinearSolver {
    /// Chooses and prepares the solver; call after the first [`System::begin_step`].
    ///
    /// # Errors
    /// [`SolveError`] when the bulk cannot be analysed.
    pub fn new(system: &System, options: SolverOptions) -> Result<Self, SolveError> {
        let coordinates = positions(system);
        let symmetric = system.is_symmetric() && system.uses(Pruning::Symmetric);
        let mut this = Self {
            kind: Kind::Linear,
            solver: None,
            iterative: None,
            source: None,
            given_way: 0,
            library: options.library,
            equations: None,
            spare: None,
            symmetric,
            may_be_symmetric: symmetric,
            groups: if symmetric { None } else { groups(system) },
            options,
            coordinates,
            factorisations: 0,
            notes: Vec::new(),
            tied_is_negative: None,
            starts_tied: true,
            has_met_other_sign: false,
        };
        if !system.is_linear() {
            this.choose_nonlinear(system)?;
        }
        Ok(this)
    }

    fn choose_nonlinear(&mut self, system: &System) -> Result<(), SolveError> {
        if self.library.is_some() {
            self.tell_library(system);
            self.kind = Kind::Linked;
            return Ok(());
        }
        let SolverOptions { method, solutions, .. } = self.options;
        if filtered::is_chosen(system, method, solutions) {
            self.iterate_on_contact(system);
            return Ok(());
        }
        if system.applies_tangents() || iterative::is_chosen(system, method, solutions) {
            return self.iterate_on_tangents(system);
        }
        if filtered::is_chosen_for_tangents(system, method, solutions) {
            return self.iterate_on_bodies_with_contact(system);
        }
        if saddle::is_chosen(system, method, solutions) {
            return self.iterate_on_flow(system);
        }
        match self.choose_factors(&Factors::of(system)) {
            Err(SolveError::TooMuchMemory(_))
                if method == LinearMethod::Auto && filtered::serves_linear_bodies(system) =>
            {
                self.notes.push("no factor of the bodies fits into the memory".to_owned());
                self.iterate_on_contact(system);
                Ok(())
            }
            other => other,
        }
    }

    /// Analyses anew where the pattern of a tangent has followed its images.
    fn follow(&mut self, system: &System, tangent: &Tangent) -> Result<(), SolveError> {
        let now = tangent.changing.pattern();
        if let Kind::Full(Some(sum)) = &self.kind
            && system.follows_images()
            && !Arc::ptr_eq(&sum.changing, now)
        {
            self.solver = None;
            self.sum_on(system.bulk(), now)?;
        }
        Ok(())
    }

    /// Tells a linked library of the equations as they are in this step.
    fn tell_library(&mut self, system: &System) {
        // what was made for the matrix before goes first
        (self.equations, self.solver) = (None, None);
        self.equations = Some(Arc::new(library::equations(system)));
        if self.options.library.is_none() {
            self.spare = Some(Box::new(Factors::of(system)));
        }
    }

    /// Whether the terms of a system are applied rather than assembled; then [`System::leave_matrix`] is for it, before its
    /// first step.
    #[must_use]
    pub fn needs_no_matrix(system: &System, options: &SolverOptions) -> bool {
        let SolverOptions { method, solutions, library, .. } = *options;
        library.is_none() && iterative::is_chosen(system, method, solutions) && without_matrix::pays(system)
    }

    /// Whether contact is treated apart from bodies that are not linear; then [`System::keep_faces_apart`] is for it, before its first
    /// tangent.
    #[must_use]
    pub fn needs_faces_apart(system: &System, options: &SolverOptions) -> bool {
        let SolverOptions { method, solutions, library, .. } = *options;
        library.is_none() && filtered::is_chosen_for_tangents(system, method, solutions)
    }

    /// The solver that a system asks for; nothing is assembled for it. A linear part that turns out not to be positive
    /// definite changes it.
    #[must_use]
    pub fn plan(system: &System, options: &SolverOptions) -> LinearPlan {
        let SolverOptions { method, solutions, library, .. } = *options;
        if let Some(Linked(library)) = library {
            return LinearPlan::Library(library.plan(&library::traits(system)));
        }
        if let Some(iterative) = iterative::plan(system, method, solutions) {
            return without_matrix::plan(system, iterative);
        }
        let on_tangents = || filtered::plan_of_tangents(system, method, solutions);
        let of_motion = || saddle::plan(system, method, solutions);
        if let Some(plan) = filtered::plan(system, method, solutions).or_else(on_tangents).or_else(of_motion) {
            return plan;
        }
        let factor = foreseen::factor(system);
        match (system.is_linear(), condenses(system)) {
            (true, _) => LinearPlan::Once(factor),
            (_, true) => LinearPlan::Condensed(Extent::Foreseen(system.n_changing_dofs())),
            _ => LinearPlan::Whole(factor),
        }
    }

    /// The solver in words, with what was noticed while solving.
    #[must_use]
    pub fn describe(&self) -> String {
        let single = matches!(&self.kind, Kind::Condensed(c) if matches!(c.elimination(), Method::Woodbury { single: true, .. }));
        let double = "precision: double, no matrix of contact forces is factored in single precision here";
        let missed = (self.options.precision == Precision::Mixed && !single).then_some(double);
        let notes = self.notes.iter().map(String::as_str).chain(missed);
        notes.fold(self.method().to_string(), |text, note| format!("{text}; {note}"))
    }

    /// What solves now.
    fn method(&self) -> LinearPlan {
        if let Some(iterative) = self.iterative.as_ref().filter(|iterative| iterative.is_at_work()) {
            return iterative.method();
        }
        if let (Some(Linked(library)), Some(equations)) = (self.library, &self.equations) {
            let found = self.solver.as_ref().and_then(|solver| solver.describe());
            return LinearPlan::Library(found.unwrap_or_else(|| library.plan(&equations.traits)));
        }
        match &self.kind {
            Kind::Linear => LinearPlan::Once(self.factor_kind()),
            Kind::Condensed(c) => LinearPlan::Condensed(Extent::Made((c.n_at_points(), c.elimination().to_string()))),
            Kind::Full(_) => LinearPlan::Whole(self.factor_kind()),
            Kind::Linked => LinearPlan::Whole(FactorKind::General),
        }
    }

    /// Whether an iteration of our own solves without a factor of the bodies.
    #[must_use]
    pub fn has_no_factor(&self) -> bool {
        self.iterates() || self.spare.is_some()
    }

    /// Factorisations so far: of the bulk, of the whole tangent, and of the condensed part where that was truly made
    /// anew; solutions with an older factor do not count.
    #[must_use]
    pub fn factorisations(&self) -> usize {
        self.factorisations
    }

    /// The matrix of the linear terms has changed.
    ///
    /// # Errors
    /// [`SolveError`] when the new bulk cannot be factored.
    pub fn bulk_changed(&mut self, system: &System) -> Result<(), SolveError> {
        match self.kind {
            Kind::Linear => self.solve_one_matrix(system),
            Kind::Condensed(_) => self.choose_nonlinear(system),
            Kind::Linked => {
                self.tell_library(system);
                Ok(())
            }
            Kind::Full(_) => Ok(()),
        }
    }

    /// Prepares for the one matrix of a linear scene.
    fn solve_one_matrix(&mut self, system: &System) -> Result<(), SolveError> {
        (self.iterative, self.source) = (None, None);
        if self.library.is_some() {
            self.tell_library(system);
            return self.factor(&system.new_tangent().changing);
        }
        let SolverOptions { method, solutions, .. } = self.options;
        if self.symmetric && iterative::is_chosen(system, method, solutions) {
            match self.iterate(system) {
                Err(error @ (SolveError::NotPositiveDefinite { .. } | SolveError::NotSymmetric { .. })) => {
                    self.note_factor(ITERATION, &error);
                }
                other => return other,
            }
        }
        if saddle::is_chosen(system, method, solutions) {
            match self.iterate_on_motion(system) {
                Err(error) if iterative::is_of_iteration(&error) => self.note_factor(GMRES, &error),
                other => return other,
            }
        }
        match self.factor(&*without_matrix::assembled(system)?) {
            Err(need @ SolveError::TooMuchMemory(_)) if method == LinearMethod::Auto && self.symmetric => {
                self.solver = None;
                self.notes.push(format!("no factor fits into the memory: {}", ITERATION));
                self.iterate(system).map_err(|_| need)
            }
            other => other,
        }
    }

    fn iterate(&mut self, system: &System) -> Result<(), SolveError> {
        let layout = iterative::layout(system).map_err(|_| SolveError::NotFactored)?;
        let source = match system.operator() {
            Some(operator) => Source::Applied(operator),
            None => Source::Stored(without_matrix::assembled(system)?),
        };
        self.iterative = Some(Iterative::of_one(layout, &source, self.options)?);
        (self.source, self.solver) = (Some(source), None);
        Ok(())
    }

    fn iterate_on_motion(&mut self, system: &System) -> Result<(), SolveError> {
        let layout = saddle::layout(system).map_err(|_| SolveError::NotFactored)?;
        let source = Source::Stored(without_matrix::assembled(system)?);
        self.iterative = Some(Iterative::of_saddle(layout, &source, self.options)?);
        (self.source, self.solver) = (Some(source), None);
        Ok(())
    }

    /// Says why a factor takes the place of the iteration.
    fn note_factor(&mut self, name: &str, error: &SolveError) {
        self.notes.push(format!("a factor in place of {name}: {error}"));
    }

    /// Takes over a tangent of `system`; `as_written` says that it is that of the laws as they are written.
    ///
    /// # Errors
    /// [`SolveError`] when it cannot be factored.
    pub fn update(&mut self, system: &System, tangent: &Tangent, as_written: bool) -> Result<(), SolveError> {
        self.take(system, tangent)?;
        if self.starts_tied && self.tied_is_negative.is_none() {
            self.tied_is_negative = self.was_negative();
        }
        if let (Some(tied), Some(now)) = (self.tied_is_negative, self.was_negative()) {
            self.has_met_other_sign |= tied != now && as_written;
        }
        Ok(())
    }

    fn take(&mut self, system: &System, tangent: &Tangent) -> Result<(), SolveError> {
        self.follow(system, tangent)?;
        match &mut self.kind {
            Kind::Linear => Ok(()),
            Kind::Condensed(c) => {
                let outcome = c.update(&tangent.changing);
                self.factorisations += c.take_factorisations();
                outcome
            }
            Kind::Linked => self.take_linked(&tangent.changing),
            Kind::Full(_) => {
                let keeps = !system.is_affine_when_frozen();
                match tangent.operator() {
                    Some(operator) => self.take_applied(system, tangent, operator),
                    None => {
                        let sum = self.sum([system.bulk(), &tangent.changing])?;
                        self.take_tangent(system, sum, tangent.on_faces(), keeps)
                    }
                }
            }
        }
    }

    /// The sum of the linear and the changing part.
    fn sum(&self, parts: [&Csr; 2]) -> Result<Csr, SolveError> {
        let Kind::Full(Some(Sum { pattern, bulk_positions, changing_positions, .. })) = &self.kind else {
            return Err(SolveError::NotFactored);
        };
        let [bulk, changing] = parts;
        let mut sum = match changing_positions {
            None => changing.clone(),
            Some(positions) => {
                let mut sum = Csr::zeros(pattern.clone());
                positions.iter().zip(changing.values()).for_each(|(p, v)| sum.values_mut()[*p] += v);
                sum
            }
        };
        bulk_positions.iter().zip(bulk.values()).for_each(|(p, v)| sum.values_mut()[*p] += v);
        Ok(sum)
    }

    /// Takes a whole matrix, and keeps an older factor where that may serve.
    fn take_for_factor(&mut self, sum: &Csr, keeps: bool) -> Result<(), SolveError> {
        if keeps
            && let Some(solver) = &mut self.solver
            && solver.keep_factor(sum)?
        {
            return Ok(());
        }
        self.factor(sum)
    }

    /// The next tangent gets a factor of its own. Done at the start of an attempt, so that a run that is resumed there goes
    /// on bit by bit.
    pub fn expire(&mut self) {
        if let Some(solver) = &mut self.solver {
            solver.expire();
        }
        self.expire_levels();
    }

    /// What later solutions depend on beside the matrices that are still to come.
    #[must_use]
    pub fn memory(&self) -> SolverMemory {
        let (symmetric, factorisations) = (self.symmetric, self.factorisations);
        match &self.kind {
            Kind::Condensed(c) => SolverMemory { symmetric, factorisations, ..c.memory() },
            Kind::Linked if self.spare.is_some() => {
                SolverMemory { symmetric, factorisations, iterative: true, ..SolverMemory::default() }
            }
            _ => SolverMemory { symmetric, factorisations, spent: self.given_way, ..SolverMemory::default() },
        }
    }

    /// Goes back to what was remembered of a solver of the same system. False if that does not fit.
    ///
    /// # Errors
    /// [`SolveError`] when the matrix remembered cannot be factored.
    pub fn recall(&mut self, memory: &SolverMemory) -> Result<bool, SolveError> {
        self.symmetric &= memory.symmetric;
        self.factorisations = memory.factorisations;
        if memory.iterative || self.spare.is_some() {
            return self.recall_iteration(memory);
        }
        if !matches!(self.kind, Kind::Condensed(_)) {
            self.recall_given_way(memory.spent);
        }
        if memory.factored.is_empty() {
            return Ok(true);
        }
        let Kind::Condensed(condensed) = &mut self.kind else { return Ok(false) };
        let fits = condensed.recall(memory);
        // What is made again has been counted when it was made first.
        condensed.take_factorisations();
        fits
    }

    /// Whether the determinant of the tangent that was factored last is negative.
    fn was_negative(&self) -> Option<bool> {
        match &self.kind {
            Kind::Condensed(c) => c.is_negative(),
            // conjugate gradients have met no direction of negative energy
            _ if self.iterates() => self.iteration_is_definite().map(|_| false),
            _ => self.solver.as_ref().and_then(|solver| solver.is_negative()),
        }
    }

    /// Says that the first tangent is not that of bodies tied together.
    pub fn starts_elsewhere(&mut self) {
        self.starts_tied = false;
    }

    /// Says whether the determinant of the bodies tied together is negative.
    pub fn set_tied_sign(&mut self, is_negative: bool) {
        self.tied_is_negative = Some(is_negative);
    }

    /// True if the determinant of the tangent that was factored last may have another sign than that of the tied bodies:
    /// at no cost, and of a tangent that may be that of an iterate before.
    pub fn may_have_turned(&self) -> bool {
        self.was_negative().is_some_and(|now| self.tied_is_negative != Some(now))
    }

    /// True if a tangent of the scene as written had a determinant of another sign than that of the tied bodies since
    /// this was last asked.
    pub fn take_other_sign(&mut self) -> bool {
        std::mem::take(&mut self.has_met_other_sign)
    }

    /// A solver of its own for the same system, which leaves this one as it is.
    ///
    /// # Errors
    /// [`SolveError`] when the bulk cannot be analysed.
    pub fn beside(&self, system: &System) -> Result<Self, SolveError> {
        Self::new(system, self.options)
    }

    /// Whether the determinant of the present tangent of `system` is negative; `None` where the factor does not tell.
    ///
    /// # Errors
    /// [`SolveError`] when it cannot be factored.
    pub fn is_negative(&mut self, system: &System, tangent: &Tangent) -> Result<Option<bool>, SolveError> {
        if let Kind::Condensed(c) = &mut self.kind {
            return c.sign_with(&tangent.changing);
        }
        self.take(system, tangent)?;
        Ok(self.was_negative())
    }

    /// What the solution for a correction of Newton may leave of its right-hand side where `wanted` would not show.
    #[must_use]
    pub fn forcing(&self, system: &System, wanted: f64) -> f64 {
        self.left_of_full_step(system).map_or(wanted, |left| wanted.min(left))
    }

    /// What a solution may leave of its right-hand side where a full step solves the equations but for branches that change,
    /// with a solver for which fewer digits cost less; `None` elsewhere.
    #[must_use]
    pub fn left_of_full_step(&self, system: &System) -> Option<f64> {
        let solves_in_parts = self.library.is_some() && !system.is_linear() && system.is_affine_when_frozen();
        solves_in_parts.then_some(LEFT_OF_FULL_STEP)
    }

    /// Solves with the tangent last given; vectors over the free dofs. A true residual of no more than `tolerance` of
    /// the right-hand side is good enough where iterations can make use of that; zero asks for all that can be had.
    ///
    /// # Errors
    /// [`SolveError`]; a solution that comes back has passed the checks of `solve`.
    pub fn solve(&mut self, rhs: &[f64], x: &mut Vec<f64>, tolerance: f64) -> Result<SolveReport, SolveError> {
        x.clear();
        x.resize(rhs.len(), 0.0);
        if self.iterates() {
            return self.solve_by_iteration(rhs, x, tolerance);
        }
        match &mut self.kind {
            Kind::Condensed(c) => {
                let report = c.solve_to(rhs, x, tolerance);
                self.factorisations += c.take_factorisations();
                report
            }
            _ if self.spare.is_some() => self.solve_on_contact(rhs, x, tolerance),
            _ => {
                let solver = self.solver.as_mut().ok_or(SolveError::NotFactored)?;
                let matrix = match solver.solve_with_kept(rhs, x, tolerance)? {
                    Kept::Solved(report) => return Ok(report),
                    Kept::None => return solver.solve(rhs, x),
                    Kept::Useless(matrix) => matrix.clone(),
                };
                self.factor(&matrix)?;
                let report = self.solver.as_mut().ok_or(SolveError::NotFactored)?.solve(rhs, x)?;
                Ok(SolveReport { refactored: true, ..report })
            }
        }
    }
}

/// Whether the condensed matrix is large enough that dofs which face each other share an unknown, and there are some.
pub fn shares_forces(system: &System) -> bool {
    let large = condenses(system) && system.n_changing_dofs() > DENSE_LIMIT && system.uses(Pruning::Forces);
    large && !facing(system).is_empty()
}

/// Where the free dofs are, in their order.
fn positions(system: &System) -> Vec<[f64; 3]> {
    let of = |d: &u32| {
        let (field, node, _) = system.numbering.describe(&system.fields, *d as usize);
        system.fields[field].node_position(node)
    };
    system.numbering.free_dofs.iter().map(of).collect()
}

/// Free dofs whose equations are laws at points.
fn at_points(system: &System) -> Vec<u32> {
    let of_points = |field: &usize| system.has_single_equations(*field);
    let ranges = (0..system.fields.len()).filter(of_points).filter_map(|field| system.range(field));
    ranges.flatten().map(|dof| system.numbering.free[dof]).filter(|free| *free != FIXED).collect()
}

/// Free dofs of unknown fields that are the only two of their component at one point: those that face each other across
/// an interface.
fn facing(system: &System) -> Vec<(u32, u32)> {
    // by node of an unknown field: where it is, its components, its first dof
    let mut nodes: Vec<([u64; 3], usize, usize)> = Vec::new();
    for (k, field) in system.fields.iter().enumerate().filter(|(_, field)| field.kind == FieldKind::Unknown) {
        for (node, first) in system.range(k).into_iter().flat_map(|dofs| dofs.step_by(field.n_components)).enumerate() {
            // adding zero takes the sign off a zero
            nodes.push((field.node_position(node).map(|x| (x + 0.0).to_bits()), field.n_components, first));
        }
    }
    nodes.sort_unstable();
    let free = |dof: usize| Some(system.numbering.free[dof]).filter(|free| *free != FIXED);
    let mut pairs = Vec::new();
    for alike in nodes.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        for component in 0..alike[0].1 {
            let mut free = alike.iter().filter_map(|node| free(node.2 + component));
            if let (Some(a), Some(b), None) = (free.next(), free.next(), free.next()) {
                pairs.push((a.min(b), a.max(b)));
            }
        }
    }
    pairs
}

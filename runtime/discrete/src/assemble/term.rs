//! A term ready to be assembled: compiled law, domain, dofs, scatter positions.
//!
//! Every thread adds to rows of its own and goes through the batches in the order of the domain ([`super::shares`]), so
//! sums are the same for any number of threads. After the first assembly nothing is allocated. A number that is not
//! finite stops the assembly with its place.

pub(super) mod applied;
mod coarser;
pub(super) mod diagonal;
mod fewer_points;
pub(super) mod gradients;
pub(super) mod local;
mod located;
mod moving;
mod states;
mod summands;
mod work;

use std::sync::{
    Arc, Mutex, OnceLock, PoisonError,
    atomic::{AtomicBool, AtomicU64, Ordering},
};

use thiserror::Error;
use wfl_compiler::{
    Kink, NonFinite, TermLaw,
    backend::PointKernel,
    first_non_finite,
    ir::{Inst, LANES, VerifiedKernel},
    run_prologue,
    types::FieldId,
};

use crate::domain::Over;
use crate::{
    assemble::{
        binding::{GroupBinding, Integrator, Needs},
        branches::{BranchCounts, mixed},
        contract::{self, TangentPlan},
        entries::{Entries, inputs_behind},
        evaluate::{Bound, FieldValues, Workspace},
        rows::Own,
        scatter::Scatter,
        shared::{add, shared, shared_words},
        shares::Duty,
    },
    finite::BadState,
    prologue::step_slots,
    share::Share,
    window::Window,
};
use applied::Given;
use moving::Moving;
use summands::Summands;
use wfl_host::team::{Alone, Team};
use wfl_mesh::mesh::{Mesh, SupportSet};
use wfl_sparse::{csr::CsrError, index::NONE};
use work::{Kept, Located};

/// Where a number stopped being finite.
#[derive(Clone, Debug)]
pub struct NonFinitePlace {
    /// The instruction and its place in the scene.
    pub cause: Option<NonFinite>,
    /// The term.
    pub term: String,
    /// Position of the entity in the region.
    pub entity: usize,
    /// Point of the quadrature rule.
    pub point: usize,
    /// Position in space.
    pub position: [f64; 3],
}

/// Why a term could not be assembled.
#[derive(Debug, Error)]
pub enum TermError {
    /// Not a number in the residual or the tangent.
    #[error("not a finite number in term `{}`", .0.term)]
    NonFinite(Box<NonFinitePlace>),
    /// An unknown, or a sum of finite parts of its equation, is not finite.
    #[error(transparent)]
    State(Box<BadState>),
    /// The matrix of images that have moved cannot be made.
    #[error(transparent)]
    Matrix(CsrError),
}

/// A term ready to be assembled at one step. A copy shares law, code, tables and places.
pub struct AssembledTerm {
    /// The compiled law.
    pub law: Arc<TermLaw>,
    /// Where, and what it reads.
    pub integrator: Integrator,
    /// The same as it is assembled.
    assembled: Integrator,
    /// The entities, in the order of the domain; `None` on cells and on `global`.
    pub place: Option<Arc<SupportSet>>,
    residual: Arc<dyn PointKernel>,
    tangent: Option<Arc<dyn PointKernel>>,
    summands: Option<Arc<Summands>>,
    /// What the prologue was given at this step, and what it made of it.
    step: Vec<f64>,
    uniforms: Vec<f64>,
    /// For each group: global dof of each local dof, `dofs[entity * n_dofs + k]`.
    dofs: Arc<Vec<Vec<u32>>>,
    entries: Arc<Entries>,
    residual_needs: Needs,
    tangent_needs: Needs,
    /// For each group.
    plans: Arc<Vec<Arc<TangentPlan>>>,
    /// For each group, once a pattern is known.
    scatters: Arc<OnceLock<Vec<Scatter>>>,
    /// The pattern; copies learn of it together.
    located: Arc<OnceLock<Arc<Located>>>,
    /// Of all rows, and of those of a rank.
    kept: [Mutex<Kept>; 2],
    workspaces: Mutex<Vec<Workspace>>,
    /// Where the images of its points follow the bodies.
    moving: Option<Moving>,
    /// Entries of the tangent that were evaluated before.
    given: Option<Given>,
}

/// Dofs of a group, `[entity][local dof]`: node after node, its components one after the other. `starts` are the first
/// dofs of the fields; a field without one is known and has none ([`NONE`]).
fn local_dofs(binding: &GroupBinding, n_entities: usize, starts: &[Option<usize>]) -> Vec<u32> {
    let mut dofs = Vec::with_capacity(n_entities * binding.n_dofs());
    for entity in 0..n_entities {
        for basis in &binding.bases {
            let start = starts[basis.field.index()];
            let n_own = basis.n_own_nodes(entity);
            for (k, node) in basis.nodes[entity * basis.n_nodes..][..basis.n_nodes].iter().enumerate() {
                for c in 0..basis.n_components {
                    dofs.push(match start.filter(|_| k < n_own) {
                        Some(s) => {
                            u32::try_from(s + *node as usize * basis.n_components + c).expect("fewer than 2^32 dofs")
                        }
                        None => NONE,
                    });
                }
            }
        }
    }
    dofs
}

impl AssembledTerm {
    /// A term from its law, its kernels and where it is integrated. `tangent` is what the backend made of
    /// [`crate::assemble::tangent_kernel`].
    #[must_use]
    pub fn new(
        law: impl Into<Arc<TermLaw>>,
        integrator: Integrator,
        place: Option<SupportSet>,
        residual: Box<dyn PointKernel>,
        tangent: Option<Box<dyn PointKernel>>,
        starts: &[Option<usize>],
    ) -> Self {
        let law = law.into();
        let assembled = integrator.assembled();
        let groups = assembled.binding.groups.iter().zip(&assembled.domain.groups);
        let dofs = groups.map(|(binding, group)| local_dofs(binding, group.entities.len(), starts)).collect();
        let binding = &assembled.binding;
        let entries = Entries::new(&law);
        let n_bases = binding.n_bases();
        let kernel = law.residual.kernel();
        let read = inputs_behind(kernel, &kernel.outputs);
        let residual_needs = binding.needs_of(n_bases, |k| read[k], true, false);
        let summands = Summands::new(&law, binding, n_bases);
        let read = entries.reads(&law);
        let tangent_needs = binding.needs_of(n_bases, |k| read[k], true, true);
        let plans = (0..binding.groups.len()).map(|g| Arc::new(TangentPlan::new(binding, g, &entries))).collect();
        let moving = integrator.moves().then(|| Moving::new(starts));
        Self {
            moving,
            entries: Arc::new(entries),
            residual_needs,
            tangent_needs,
            plans: Arc::new(plans),
            law,
            integrator,
            assembled,
            place: place.map(Arc::new),
            residual: residual.into(),
            tangent: tangent.map(Arc::from),
            summands: summands.map(Arc::new),
            step: Vec::new(),
            uniforms: Vec::new(),
            dofs: Arc::new(dofs),
            scatters: Arc::default(),
            located: Arc::default(),
            kept: Default::default(),
            workspaces: Mutex::default(),
            given: None,
        }
    }

    /// Shares the list of dofs with another term that acts on the same ones.
    pub(crate) fn share_dofs(&mut self, others: &[Self]) {
        if let Some(same) = others.iter().find(|other| other.dofs == self.dofs) {
            self.dofs = Arc::clone(&same.dofs);
        }
    }

    /// Sets the step.
    pub fn set_step(&mut self, window: Window) {
        self.step = step_slots(&self.law.prologue, window);
        self.uniforms = run_prologue(&self.law.prologue, &self.step);
        self.forget_images();
    }

    /// Forgets the term at the last state.
    fn forget_images(&mut self) {
        if let Some(moving) = &mut self.moving {
            moving.forget();
        }
    }

    /// Numbers of the law that are the same at all points, at the present step.
    #[must_use]
    pub fn uniforms(&self) -> &[f64] {
        &self.uniforms
    }

    /// Fields whose dofs the tangent of this term couples.
    pub fn coupled_fields(&self) -> impl Iterator<Item = FieldId> + '_ {
        self.law.tests.iter().chain(&self.law.trials).map(|s| s.field)
    }

    /// Sorted dofs of the fields that the term reads or tests, each once.
    #[must_use]
    pub fn dofs(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self.dofs.iter().flatten().copied().filter(|d| *d != NONE).collect();
        all.extend(self.dofs_behind_targets().into_iter().flatten());
        all.sort_unstable();
        all.dedup();
        all
    }

    /// True if it is integrated over cells.
    #[must_use]
    pub fn on_cells(&self) -> bool {
        self.integrator.domain.over == Over::Cells
    }

    /// Adds the diagonal of the tangent, by dof, in the rows of this rank.
    pub fn add_own_diagonal(&self, mesh: &Mesh, values: FieldValues<'_>, diagonal: &mut [f64], share: Option<&Share>) {
        if self.entries.list.is_empty() {
            return;
        }
        if let Some(moved) = self.moved_with_plans(mesh, values) {
            return moved.add_own_diagonal(mesh, values, diagonal, share);
        }
        let diagonal = shared(diagonal);
        self.share_out(mesh, share, |workspace, duties, owns| {
            for duty in duties {
                self.local_tangents(mesh, values, workspace, duty);
                let n = self.assembled.binding.groups[duty.group].n_dofs();
                let sources = &self.plans[duty.group].sources;
                for (lane, entity) in self.entities(duty).enumerate() {
                    for (k, dof) in self.dofs[duty.group][entity * n..][..n].iter().enumerate() {
                        let value = workspace.local.get(sources[k * n + k] as usize);
                        if let Some(value) = value.filter(|_| *dof != NONE && owns(*dof)) {
                            add(&diagonal[*dof as usize], value[lane]);
                        }
                    }
                }
            }
        });
    }

    /// The kinks of the law.
    #[must_use]
    pub fn kinks(&self) -> &[Kink] {
        &self.law.kinks
    }

    /// Calls `f` with the global dofs of each entity that are tested, and those that the tangent depends on at any state, for
    /// the matrix pattern; once for each group of nodes that nothing couples with the others.
    pub fn for_each_entity(&self, mut f: impl FnMut(&[u32], &[u32])) {
        if self.moving.is_some() {
            return self.for_each_possible(&mut f);
        }
        let (mut rows, mut columns) = (Vec::new(), Vec::new());
        for (g, binding) in self.assembled.binding.groups.iter().enumerate() {
            let n = binding.n_dofs();
            let coupled = self.plans[g].coupled(binding);
            for dofs in self.dofs[g].chunks_exact(n.max(1)) {
                for (tests, trials) in &coupled {
                    for (list, locals) in [(&mut rows, tests), (&mut columns, trials)] {
                        list.clear();
                        list.extend(locals.iter().map(|k| dofs[*k]).filter(|d| *d != NONE));
                    }
                    f(&rows, &columns);
                }
            }
        }
    }

    /// Adds the residual to `out` (by dof, fixed ones included). Returns the branches of its kinks.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_residual(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        out: &mut [f64],
    ) -> Result<BranchCounts, TermError> {
        self.add_own_residual(mesh, values, out, None)
    }

    /// The same in the rows of one rank alone, made by all ranks together: the branches are those of all points, and an
    /// error is the same on all ranks.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_own_residual(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        out: &mut [f64],
        share: Option<&Share>,
    ) -> Result<BranchCounts, TermError> {
        let mut branches = BranchCounts::default();
        self.add_to(mesh, values, (out, &mut branches), share)?;
        Ok(branches)
    }

    /// As [`Self::add_residual`] with branches that are written where some were before: allocates nothing then.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_residual_to(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        out: &mut [f64],
        branches: &mut BranchCounts,
    ) -> Result<(), TermError> {
        self.add_to(mesh, values, (out, branches), None)
    }

    fn add_to(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        target: (&mut [f64], &mut BranchCounts),
        share: Option<&Share>,
    ) -> Result<(), TermError> {
        if let Some(moved) = self.moved(mesh, values) {
            return moved.add_to(mesh, values, target, share);
        }
        let (out, branches) = target;
        let n_entities = if self.contact_kink().is_some() { self.integrator.domain.n_entities } else { 0 };
        let mut by_entity = std::mem::take(&mut branches.by_entity);
        by_entity.clear();
        by_entity.resize(n_entities, 0);
        let states = shared_words(&mut by_entity);
        branches.clear(self.law.kinks.len());
        let total = Mutex::new(&mut *branches);
        let finite = AtomicBool::new(true);
        let out = shared(out);
        self.share_out(mesh, share, |workspace, duties, owns| {
            let mut branches = std::mem::take(&mut workspace.branches);
            branches.clear(self.law.kinks.len());
            for duty in duties {
                if !self.residual_of(mesh, values, workspace, duty, out, &owns) {
                    finite.store(false, Ordering::Relaxed);
                }
                self.count(mesh, workspace, duty, &mut branches, states);
            }
            total.lock().unwrap_or_else(PoisonError::into_inner).add(&branches);
            workspace.branches = branches;
        });
        branches.by_entity = by_entity;
        if let Some(share) = share.filter(|_| !self.law.kinks.is_empty()) {
            branches.of_all(&**share.team(), mesh);
        }
        self.result(finite.into_inner(), mesh, values, (&self.law.residual, share))
    }

    /// The error, if a number is not finite: of several ranks that of the first one that has such a number, the same on all.
    fn result(
        &self,
        finite: bool,
        mesh: &Mesh,
        values: FieldValues<'_>,
        on: (&VerifiedKernel, Option<&Share>),
    ) -> Result<(), TermError> {
        let (kernel, share) = on;
        let team: &dyn Team = share.map_or(&Alone, |share| &**share.team());
        let Some(rank) = team.first(!finite) else { return Ok(()) };
        let own = if rank == team.rank() { self.find_non_finite(mesh, values, kernel) } else { None };
        let place = self.non_finite_at(own.unwrap_or_default().told(team, rank), kernel);
        Err(TermError::NonFinite(Box::new(place)))
    }

    /// Adds the residual of one batch. False if a number is not finite.
    fn residual_of(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        workspace: &mut Workspace,
        duty: &Duty,
        out: &[AtomicU64],
        owns: &impl Fn(u32) -> bool,
    ) -> bool {
        let (g, binding) = (duty.group, &self.assembled.binding);
        let n_out = self.law.residual.kernel().outputs.len();
        workspace.prepare_some(self.bound(mesh), g, duty.batch, values, &self.residual_needs);
        self.call(&*self.residual, workspace, g, n_out);
        let finite = contract::residual(workspace, binding, g, n_out);
        let n = binding.groups[g].n_dofs();
        for (lane, entity) in self.entities(duty).enumerate() {
            for (dof, value) in self.dofs[g][entity * n..][..n].iter().zip(&workspace.local) {
                if *dof != NONE && (duty.all_rows || owns(*dof)) {
                    add(&out[*dof as usize], value[lane]);
                }
            }
        }
        finite
    }

    /// Adds the tangent to the values of the matrix whose pattern was given to [`Self::locate`].
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    ///
    /// # Panics
    /// When no pattern was given.
    pub fn add_tangent(&self, mesh: &Mesh, values: FieldValues<'_>, matrix: &mut [f64]) -> Result<(), TermError> {
        self.tangent_into(mesh, values, matrix, false)
    }

    /// Makes the matrix the tangent, for any earlier values, zero where the term does not act. Otherwise as
    /// [`Self::add_tangent`]; quicker than to clear the matrix and add.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    ///
    /// # Panics
    /// When no pattern was given.
    pub fn set_tangent(&self, mesh: &Mesh, values: FieldValues<'_>, matrix: &mut [f64]) -> Result<(), TermError> {
        self.tangent_into(mesh, values, matrix, true)
    }

    fn tangent_into(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        matrix: &mut [f64],
        is_new: bool,
    ) -> Result<(), TermError> {
        if self.entries.list.is_empty() {
            if is_new {
                matrix.fill(0.0);
            }
            return Ok(());
        }
        if let Some(moved) = self.moved_in_matrix(mesh, values) {
            return moved.tangent_into(mesh, values, matrix, is_new);
        }
        let located = self.located.get().expect("a pattern before the tangent");
        let share = located.share.as_deref();
        let (shares, rows, halves) = self.shared_rows(mesh, located, is_new);
        let finite = AtomicBool::new(true);
        rows.share_out(matrix, |me, own| {
            let clear = |duty: usize, own: &mut Own<'_, '_>| {
                if is_new {
                    rows.clear(me, duty, own);
                }
            };
            self.with_workspace(|workspace| {
                for (k, duty) in shares.duties[me].iter().enumerate() {
                    clear(k, own);
                    if !self.local_tangents(mesh, values, workspace, duty) {
                        finite.store(false, Ordering::Relaxed);
                    }
                    let Workspace { arch, local, row, .. } = workspace;
                    let (scatter, entities) = (&self.scatters()[duty.group], self.entities(duty));
                    match halves.as_ref().and_then(|halves| halves.of(duty)) {
                        Some(half) => scatter.add_half(*arch, entities, local, (half, duty.all_rows), own),
                        None => scatter.add_batch(*arch, entities, local, row, own),
                    }
                    if let Some(halves) = &halves {
                        halves.copy(me, k, own);
                    }
                }
            });
            clear(shares.duties[me].len(), own);
        });
        self.result(finite.into_inner(), mesh, values, (&self.law.tangent, share))
    }

    /// Computes the local tangents of a batch. False if a number is not finite.
    fn local_tangents(&self, mesh: &Mesh, values: FieldValues<'_>, workspace: &mut Workspace, duty: &Duty) -> bool {
        let g = duty.group;
        self.evaluate_entries(mesh, values, workspace, [g, duty.batch]);
        let (group, binding) = (&self.assembled.domain.groups[g], &self.assembled.binding.groups[g]);
        contract::tangent(workspace, &self.plans[g], &self.entries, group, binding, &self.uniforms)
    }

    /// Entities of a batch.
    fn entities(&self, duty: &Duty) -> std::ops::Range<usize> {
        let total = self.assembled.domain.groups[duty.group].entities.len();
        duty.batch * LANES..((duty.batch + 1) * LANES).min(total)
    }

    fn bound<'a>(&'a self, mesh: &'a Mesh) -> Bound<'a> {
        Bound { mesh, domain: &self.assembled.domain, binding: &self.assembled.binding }
    }

    /// At the points in their order.
    fn bound_in_order<'a>(&'a self, mesh: &'a Mesh) -> Bound<'a> {
        Bound { mesh, domain: &self.integrator.domain, binding: &self.integrator.binding }
    }

    fn call(&self, kernel: &dyn PointKernel, workspace: &mut Workspace, g: usize, n_out: usize) {
        let n_points = self.assembled.domain.groups[g].n_points();
        workspace.outputs.resize(n_points * n_out * LANES, 0.0);
        kernel.run(&self.uniforms, &workspace.inputs, &mut workspace.outputs, n_points);
    }

    /// Counts the branches of a batch; their codes are the last outputs of the residual.
    fn count(
        &self,
        mesh: &Mesh,
        workspace: &Workspace,
        duty: &Duty,
        branches: &mut BranchCounts,
        by_entity: &[AtomicU64],
    ) {
        let n_out = self.law.residual.kernel().outputs.len();
        let first = self.law.tests.len();
        let group = &self.assembled.domain.groups[duty.group];
        let contact = self.contact_kink();
        for (lane, entity) in self.entities(duty).enumerate().filter(|(lane, _)| duty.counts >> lane & 1 == 1) {
            let place = group.entities[entity];
            // a name that no entity of another rank has
            let name = group.name(mesh, entity);
            let mut state = 0u64;
            for q in 0..group.n_points() {
                // of points that are entities the number in their rule
                let point = group.here.row(entity, q);
                for (k, counts) in branches.kinks.iter_mut().enumerate() {
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes are 0, 1 or 2")]
                    let code = (workspace.output(n_out, q, first + k)[lane] as usize).min(2);
                    counts[code] += 1;
                    if contact == Some(k) {
                        state += 1 << (16 * code);
                    }
                    branches.fingerprint = branches.fingerprint.wrapping_add(mixed(name, point, k, code));
                }
            }
            if contact.is_some() {
                // where images are in several cells the points of an entity are in several groups
                by_entity[place].fetch_add(state, Ordering::Relaxed);
            }
        }
    }

    /// What is constant in a step is computed before the points: such a number went wrong there.
    fn origin(&self, kernel: &VerifiedKernel, found: NonFinite) -> NonFinite {
        match kernel.kernel().insts[found.inst] {
            Inst::Uniform(_) => first_non_finite(&self.law.prologue.kernel, &self.step, &[]).unwrap_or(found),
            _ => found,
        }
    }
}

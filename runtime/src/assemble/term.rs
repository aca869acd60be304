//! A term ready to be assembled: compiled law, domain, dofs, scatter positions.
//!
//! Batches are computed in parallel in rounds of fixed size and added one after the other in the order of the
//! domain, so sums are the same for any number of threads. A number that is not finite stops the assembly with its
//! place.

use std::sync::Arc;

use rayon::prelude::*;
use thiserror::Error;
use wfl_compiler::{
    Kink, KinkKind, NonFinite, TermLaw,
    backend::PointKernel,
    first_non_finite,
    ir::{Inst, LANES, VerifiedKernel},
    run_prologue,
    types::{FieldId, UniformSlot},
};

use crate::{
    assemble::{
        binding::Binding,
        domain::Domain,
        evaluate::{Bound, FieldValues, Workspace},
        geometry::{Lanes, ZERO},
    },
    csr::{Csr, Pattern},
    mesh::Mesh,
    results::SupportSet,
};

/// Batches computed before their results are added; fixed, so that nothing depends on the number of threads.
const ROUND: usize = 32;

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
}

/// How many points are on which branch of the kinks of a term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BranchCounts {
    /// One list a kink: points (weighted by nothing) by code 0, 1, 2.
    pub kinks: Vec<[usize; 3]>,
    /// A number that changes when any point changes its branch.
    pub fingerprint: u64,
}

/// A law on a domain, callable.
pub struct Integrator {
    /// Where.
    pub domain: Arc<Domain>,
    /// Slots and tables.
    pub binding: Binding,
}

/// A term ready to be assembled.
pub struct AssembledTerm {
    /// The compiled law.
    pub law: TermLaw,
    /// Where, and what it reads.
    pub integrator: Integrator,
    /// The entities, in the order of the domain; `None` on cells and on `global`.
    pub place: Option<SupportSet>,
    residual: Box<dyn PointKernel>,
    tangent: Option<Box<dyn PointKernel>>,
    /// What the prologue was given at this step, and what it made of it.
    step: Vec<f64>,
    uniforms: Vec<f64>,
    /// For each group: global dof of each local dof, `dofs[entity * n_dofs + k]`.
    dofs: Vec<Vec<u32>>,
    /// For each group: position in the matrix values of each local pair, once a pattern is known.
    positions: Vec<Vec<u32>>,
    branches: BranchCounts,
    /// By entity of the region: points on each branch of the contact kink.
    states: Vec<[u16; 3]>,
}

/// No position in the matrix: row or column is fixed.
const NOWHERE: u32 = u32::MAX;

impl AssembledTerm {
    /// A term from its law, its kernels and where it is integrated.
    #[must_use]
    pub fn new(
        law: TermLaw,
        integrator: Integrator,
        place: Option<SupportSet>,
        residual: Box<dyn PointKernel>,
        tangent: Option<Box<dyn PointKernel>>,
        starts: &[Option<usize>],
    ) -> Self {
        let dofs = integrator
            .binding
            .groups
            .iter()
            .zip(&integrator.domain.groups)
            .map(|(binding, group)| {
                let mut dofs = Vec::with_capacity(group.entities.len() * binding.n_dofs());
                for entity in 0..group.entities.len() {
                    for basis in &binding.bases {
                        let start = starts[basis.field.index()];
                        for node in &basis.nodes[entity * basis.n_nodes..][..basis.n_nodes] {
                            for c in 0..basis.n_components {
                                dofs.push(match start {
                                    Some(s) => u32::try_from(s + *node as usize * basis.n_components + c)
                                        .expect("fewer than 2^32 dofs"),
                                    None => NOWHERE,
                                });
                            }
                        }
                    }
                }
                dofs
            })
            .collect();
        Self {
            law,
            integrator,
            place,
            residual,
            tangent,
            step: Vec::new(),
            uniforms: Vec::new(),
            dofs,
            positions: Vec::new(),
            branches: BranchCounts::default(),
            states: Vec::new(),
        }
    }

    /// Sets the step variable and its increment.
    pub fn set_step(&mut self, time: f64, increment: f64) {
        let slot = |slot: &UniformSlot| match slot {
            UniformSlot::Time => time,
            UniformSlot::TimeStep => increment,
        };
        self.step = self.law.prologue.slots.iter().map(slot).collect();
        self.uniforms = run_prologue(&self.law.prologue, &self.step);
    }

    /// Fields whose dofs the tangent of this term couples.
    pub fn coupled_fields(&self) -> impl Iterator<Item = FieldId> + '_ {
        self.law.tests.iter().chain(&self.law.trials).map(|s| s.field)
    }

    /// Sorted dofs of the fields that the term reads or tests, each once.
    #[must_use]
    pub fn dofs(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self.dofs.iter().flatten().copied().filter(|d| *d != NOWHERE).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// True if it is integrated over cells.
    #[must_use]
    pub fn on_cells(&self) -> bool {
        self.integrator.domain.groups.iter().all(|g| g.tangents.is_none() && !g.is_global)
    }

    /// Adds the diagonal of the tangent, by dof.
    pub fn add_diagonal(&self, mesh: &Mesh, values: FieldValues<'_>, diagonal: &mut [f64]) {
        self.tangent_blocks(mesh, values, |g, entity, lane, local| {
            let n = self.integrator.binding.groups[g].n_dofs();
            for (k, dof) in self.dofs[g][entity * n..][..n].iter().enumerate() {
                if *dof != NOWHERE {
                    diagonal[*dof as usize] += local[k * n + k][lane];
                }
            }
        });
    }

    /// The branch of each kink, counted over the points of the last residual.
    #[must_use]
    pub fn branches(&self) -> &BranchCounts {
        &self.branches
    }

    /// The kinks of the law.
    #[must_use]
    pub fn kinks(&self) -> &[Kink] {
        &self.law.kinks
    }

    /// Calls `f` with the global dofs of each entity that carry a test or trial slot, for the matrix pattern.
    pub fn for_each_entity(&self, mut f: impl FnMut(&[u32])) {
        let mut list = Vec::new();
        for (g, binding) in self.integrator.binding.groups.iter().enumerate() {
            let active = self.active_dofs(g);
            let n = binding.n_dofs();
            for entity in 0..self.integrator.domain.groups[g].entities.len() {
                list.clear();
                let row = &self.dofs[g][entity * n..][..n];
                list.extend(active.iter().map(|k| row[*k]).filter(|d| *d != NOWHERE));
                f(&list);
            }
        }
    }

    /// Local dofs of a group that the tangent couples.
    fn active_dofs(&self, g: usize) -> Vec<usize> {
        let binding = &self.integrator.binding;
        let mut active = Vec::new();
        for (b, basis) in binding.groups[g].bases.iter().enumerate() {
            let mut components = vec![false; basis.n_components];
            let slots = binding.tests.iter().chain(&binding.trials).filter(|p| p.basis == b);
            slots.for_each(|p| components[p.component] = true);
            let acts = binding.groups[g].acting_nodes(b, binding.tests.iter().chain(&binding.trials));
            for k in 0..basis.n_dofs() {
                if components[k % basis.n_components] && acts[k / basis.n_components] {
                    active.push(basis.offset + k);
                }
            }
        }
        active
    }

    /// Looks up where each local pair stands in a matrix; `free` maps a dof to its row, or to nothing when fixed.
    pub fn locate(&mut self, pattern: &Pattern, free: &[u32]) {
        self.positions = (0..self.dofs.len()).map(|g| self.group_positions(g, pattern, free)).collect();
    }

    fn group_positions(&self, g: usize, pattern: &Pattern, free: &[u32]) -> Vec<u32> {
        let n = self.integrator.binding.groups[g].n_dofs();
        let active = self.active_dofs(g);
        let entities = self.integrator.domain.groups[g].entities.len();
        let mut out = vec![NOWHERE; entities * n * n];
        for entity in 0..entities {
            let dofs = &self.dofs[g][entity * n..][..n];
            let place = |k: usize| if dofs[k] == NOWHERE { NOWHERE } else { free[dofs[k] as usize] };
            for &i in &active {
                let row = place(i);
                if row == NOWHERE {
                    continue;
                }
                for &j in &active {
                    let column = place(j);
                    if column != NOWHERE
                        && let Some(p) = pattern.position(row as usize, column as usize)
                    {
                        out[(entity * n + i) * n + j] = u32::try_from(p).expect("fewer than 2^32 entries");
                    }
                }
            }
        }
        out
    }

    /// Adds the residual to `out` (by dof, fixed ones included) and counts branches.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_residual(&mut self, mesh: &Mesh, values: FieldValues<'_>, out: &mut [f64]) -> Result<(), TermError> {
        let mut counts = vec![[0usize; 3]; self.law.kinks.len()];
        let mut fingerprint = 0xcbf2_9ce4_8422_2325_u64;
        let mut states = std::mem::take(&mut self.states);
        states.clear();
        states.resize(if self.contact_kink().is_some() { self.integrator.domain.n_entities } else { 0 }, [0; 3]);
        let this = &*self;
        let n_out = this.law.residual.kernel().outputs.len();
        for g in 0..this.dofs.len() {
            let n = this.integrator.binding.groups[g].n_dofs();
            let n_tests = this.law.tests.len();
            this.rounds(
                g,
                |workspace, batch| {
                    workspace.prepare(this.bound(mesh), g, batch, values);
                    this.call(&*this.residual, workspace, g, n_out);
                    let mut local = vec![ZERO; n];
                    workspace.contract_residual(this.bound(mesh), g, n_out, &mut local);
                    let codes = this.codes(workspace, g, n_out, n_tests);
                    (local, codes)
                },
                |batch, (local, codes)| {
                    this.scatter_vector(g, batch, &local, out);
                    this.count(g, batch, &codes, &mut counts, &mut fingerprint, &mut states);
                },
            );
        }
        self.branches = BranchCounts { kinks: counts, fingerprint };
        self.states = states;
        if out.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        match self.find_non_finite(mesh, values, &self.law.residual) {
            Some(place) => Err(TermError::NonFinite(Box::new(place))),
            None => Ok(()),
        }
    }

    /// Adds the tangent to the values of the matrix whose pattern was given to [`Self::locate`].
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_tangent(&self, mesh: &Mesh, values: FieldValues<'_>, matrix: &mut [f64]) -> Result<(), TermError> {
        let mut finite = true;
        self.tangent_blocks(mesh, values, |g, entity, lane, local| {
            let n = self.integrator.binding.groups[g].n_dofs();
            let positions = &self.positions[g][entity * n * n..][..n * n];
            for (position, value) in positions.iter().zip(local) {
                if *position != NOWHERE {
                    matrix[*position as usize] += value[lane];
                    finite &= value[lane].is_finite();
                }
            }
        });
        self.tangent_result(mesh, values, finite)
    }

    /// Adds the tangent to a matrix over all dofs, fixed ones included, without remembered positions.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub fn add_full_tangent(&self, mesh: &Mesh, values: FieldValues<'_>, matrix: &mut Csr) -> Result<(), TermError> {
        let mut finite = true;
        let active: Vec<Vec<usize>> = (0..self.dofs.len()).map(|g| self.active_dofs(g)).collect();
        self.tangent_blocks(mesh, values, |g, entity, lane, local| {
            let n = self.integrator.binding.groups[g].n_dofs();
            let dofs = &self.dofs[g][entity * n..][..n];
            for &i in &active[g] {
                for &j in &active[g] {
                    if dofs[i] == NOWHERE || dofs[j] == NOWHERE {
                        continue;
                    }
                    let value = local[i * n + j][lane];
                    if value != 0.0 {
                        let inside = matrix.add_to(dofs[i] as usize, dofs[j] as usize, value);
                        debug_assert!(inside, "the pattern was built from these dofs");
                        finite &= value.is_finite();
                    }
                }
            }
        });
        self.tangent_result(mesh, values, finite)
    }

    fn tangent_result(&self, mesh: &Mesh, values: FieldValues<'_>, finite: bool) -> Result<(), TermError> {
        if finite {
            return Ok(());
        }
        let place = self.find_non_finite(mesh, values, &self.law.tangent).unwrap_or_else(|| NonFinitePlace {
            cause: None,
            term: self.law.name.clone(),
            entity: 0,
            point: 0,
            position: [0.0; 3],
        });
        Err(TermError::NonFinite(Box::new(place)))
    }

    /// Computes local tangents and hands them over entity by entity in fixed order: `(group, entity, lane, local)`.
    fn tangent_blocks(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        mut take: impl FnMut(usize, usize, usize, &[Lanes]),
    ) {
        let Some(kernel) = &self.tangent else { return };
        let n_out = self.law.tangent.kernel().outputs.len();
        for g in 0..self.dofs.len() {
            let n = self.integrator.binding.groups[g].n_dofs();
            let total = self.integrator.domain.groups[g].entities.len();
            self.rounds(
                g,
                |workspace, batch| {
                    workspace.prepare(self.bound(mesh), g, batch, values);
                    self.call(&**kernel, workspace, g, n_out);
                    let mut local = vec![ZERO; n * n];
                    workspace.contract_tangent(self.bound(mesh), g, n_out, &self.law.entries, &mut local);
                    local
                },
                |batch, local| {
                    for lane in 0..LANES.min(total - batch * LANES) {
                        take(g, batch * LANES + lane, lane, &local);
                    }
                },
            );
        }
    }

    /// Runs `work` on all batches of a group in parallel rounds and `add` on the results in order.
    fn rounds<T: Send>(
        &self,
        g: usize,
        work: impl Fn(&mut Workspace, usize) -> T + Sync,
        mut add: impl FnMut(usize, T),
    ) {
        let n = self.integrator.domain.groups[g].n_batches();
        let mut first = 0;
        while first < n {
            let end = (first + ROUND).min(n);
            if end - first < 4 {
                let mut workspace = Workspace::default();
                for batch in first..end {
                    add(batch, work(&mut workspace, batch));
                }
            } else {
                let results: Vec<T> =
                    (first..end).into_par_iter().map_init(Workspace::default, |w, batch| work(w, batch)).collect();
                for (k, result) in results.into_iter().enumerate() {
                    add(first + k, result);
                }
            }
            first = end;
        }
    }

    fn bound<'a>(&'a self, mesh: &'a Mesh) -> Bound<'a> {
        Bound { mesh, domain: &self.integrator.domain, binding: &self.integrator.binding }
    }

    fn call(&self, kernel: &dyn PointKernel, workspace: &mut Workspace, g: usize, n_out: usize) {
        let n_points = self.integrator.domain.groups[g].n_points();
        workspace.outputs.resize(n_points * n_out * LANES, 0.0);
        kernel.run(&self.uniforms, &workspace.inputs, &mut workspace.outputs, n_points);
    }

    /// Branch codes of a batch: `codes[(point * n_kinks + kink) * LANES + lane]`.
    fn codes(&self, workspace: &Workspace, g: usize, n_out: usize, first: usize) -> Vec<u8> {
        let n_kinks = self.law.kinks.len();
        let n_points = self.integrator.domain.groups[g].n_points();
        let mut codes = Vec::with_capacity(n_points * n_kinks * LANES);
        for q in 0..n_points {
            for k in 0..n_kinks {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes are 0, 1 or 2")]
                codes.extend(workspace.output(n_out, q, first + k).iter().map(|c| *c as u8));
            }
        }
        codes
    }

    fn count(
        &self,
        g: usize,
        batch: usize,
        codes: &[u8],
        counts: &mut [[usize; 3]],
        fingerprint: &mut u64,
        states: &mut [[u16; 3]],
    ) {
        let n_kinks = self.law.kinks.len();
        let entities = &self.integrator.domain.groups[g].entities;
        let valid = LANES.min(entities.len() - batch * LANES);
        let contact = self.contact_kink();
        for (k, lanes) in codes.chunks_exact(LANES).enumerate() {
            for (lane, code) in lanes[..valid].iter().enumerate() {
                if contact == Some(k % n_kinks) {
                    states[entities[batch * LANES + lane]][usize::from(*code).min(2)] += 1;
                }
                counts[k % n_kinks][usize::from(*code).min(2)] += 1;
                *fingerprint = (*fingerprint ^ u64::from(*code)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
    }

    fn scatter_vector(&self, g: usize, batch: usize, local: &[Lanes], out: &mut [f64]) {
        let n = local.len();
        let total = self.integrator.domain.groups[g].entities.len();
        for lane in 0..LANES.min(total - batch * LANES) {
            let dofs = &self.dofs[g][(batch * LANES + lane) * n..][..n];
            for (dof, value) in dofs.iter().zip(local) {
                if *dof != NOWHERE {
                    out[*dof as usize] += value[lane];
                }
            }
        }
    }

    /// Finds the first entity and point at which an instruction gives something that is not finite.
    fn find_non_finite(&self, mesh: &Mesh, values: FieldValues<'_>, kernel: &VerifiedKernel) -> Option<NonFinitePlace> {
        let n_in = self.integrator.binding.inputs.len();
        let mut workspace = Workspace::default();
        for (g, group) in self.integrator.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(self.bound(mesh), g, batch, values);
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    for q in 0..group.n_points() {
                        let inputs: Vec<f64> =
                            (0..n_in).map(|s| workspace.inputs[(q * n_in + s) * LANES + lane]).collect();
                        let found = first_non_finite(kernel, &self.uniforms, &inputs).map(|f| self.origin(kernel, f));
                        let bad_input = inputs.iter().any(|x| !x.is_finite());
                        if found.is_some() || bad_input {
                            let k = batch * LANES + lane;
                            return Some(NonFinitePlace {
                                cause: found,
                                term: self.law.name.clone(),
                                entity: group.entities[k],
                                point: q,
                                position: mesh.point_at(group.here.cells[k], &group.here.geometry, q),
                            });
                        }
                    }
                }
            }
        }
        None
    }

    /// What is constant in a step is computed before the points: such a number went wrong there.
    fn origin(&self, kernel: &VerifiedKernel, found: NonFinite) -> NonFinite {
        match kernel.kernel().insts[found.inst] {
            Inst::Uniform(_) => first_non_finite(&self.law.prologue.kernel, &self.step, &[]).unwrap_or(found),
            _ => found,
        }
    }

    /// The friction kink if there is one, else the first selection.
    fn contact_kink(&self) -> Option<usize> {
        let ball = self.law.kinks.iter().position(|k| k.kind == KinkKind::Ball);
        ball.or(if self.law.kinks.is_empty() { None } else { Some(0) })
    }

    fn has_friction(&self) -> bool {
        self.law.kinks.iter().any(|k| k.kind == KinkKind::Ball)
    }

    /// Points open, slipping, sticking at the friction kink; without friction open and in contact (counted as stick).
    #[must_use]
    pub fn contact_counts(&self) -> Option<[usize; 3]> {
        let [zero, one, two] = *self.branches.kinks.get(self.contact_kink()?)?;
        Some(if self.has_friction() { [zero, one, two] } else { [zero, 0, one + two] })
    }

    /// By entity of the region: the state of most of its points, 0 open, 1 slip, 2 stick (or contact); `None` without
    /// a kink. Of a tie the higher one.
    #[must_use]
    pub fn contact_states(&self) -> Option<Vec<f64>> {
        self.contact_kink()?;
        let friction = self.has_friction();
        let state = |[zero, one, two]: &[u16; 3]| {
            let [zero, one, two] = if friction { [*zero, *one, *two] } else { [*zero, 0, one + two] };
            if two >= one && two >= zero {
                2.0
            } else if one >= zero {
                1.0
            } else {
                0.0
            }
        };
        Some(self.states.iter().map(state).collect())
    }
}
